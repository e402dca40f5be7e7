"""Every file of the house is read once and held to every rule; the rules, and their own tests, stand beside this."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.house.house import ROOMS, ROOT, findings, python_files
from tests.house.test_docstrings import OPEN, shapeless, undocumented, unitless
from tests.house.test_files import WRITER, raw_writes
from tests.house.test_folders import FLOORS, wrong_arrows
from tests.house.test_imports import a_cycle, forgetful_kernels, wrong_imports
from tests.house.test_sizes import crowded_functions, long_functions, long_modules, unannotated
from tests.house.test_spelling import british, british_texts


def broken_everywhere(source: str) -> list[str]:
    """Find what breaks the rules for rooms, tests, benchmarks and scripts: small, annotated, documented, American."""
    return [
        *long_modules(source),
        *long_functions(source),
        *unannotated(source),
        *undocumented(source),
        *british(source),
    ]


def broken_in_room(room: str, path: Path) -> list[str]:
    """Find what breaks the rules for rooms: those for all, shapes, arguments, writes, kernels, imports and texts."""
    source = path.read_text(encoding="utf-8")
    found = [*broken_everywhere(source), *shapeless(source), *crowded_functions(source), *forgetful_kernels(source)]
    found += [] if path == WRITER else raw_writes(source)
    found += [*wrong_imports(room, source), *british_texts(source)]
    place = path.relative_to(ROOT / room).parts[0]
    if room in FLOORS and place != "__init__.py":
        found += wrong_arrows(room, place, source)
    return [f"{path.relative_to(ROOT)}:{line}" for line in found]


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_keeps_every_rule(room: str) -> None:
    """Small modules and functions, few arguments by place, annotations, docstrings with shapes; compiled kernels kept.

    No file is written that could be seen half written. No import leads to a room above or a neighbor, nor to a folder
    above, and no module lies beside the folders unless it has a floor there.
    """
    found = [line for path in python_files(room) for line in broken_in_room(room, path)]
    if found:
        pytest.fail(f"{len(found)} findings\n" + "\n".join(found), pytrace=False)


def test_every_float_has_a_unit() -> None:
    """Of about 3,070 arguments, fields and return values, only the known ones leave their unit out."""
    lines = findings(unitless, python_files(*ROOMS))
    names = {line.split(": ", 1)[1].removesuffix(" has no unit such as [m]") for line in lines}
    assert not [line for line in lines if not any(f": {name} " in line for name in OPEN)]
    assert names == OPEN, "what has got its unit leaves the list"


def test_no_modules_import_each_other() -> None:
    """What imports what has no circle, over all rooms."""
    dotted = {path: ".".join(path.relative_to(ROOT).with_suffix("").parts) for path in python_files(*ROOMS)}
    sources = {name.removesuffix(".__init__"): path.read_text(encoding="utf-8") for path, name in dotted.items()}
    assert a_cycle(sources) == []


@pytest.mark.parametrize("folder", ["tests", "benchmarks", "docs", "bootstrap"])
def test_what_stands_beside_the_rooms_keeps_the_rules_for_all(folder: str) -> None:
    """Tests, benchmarks, the site's code and set-up scripts are small and annotated, and say what they do."""
    found = findings(broken_everywhere, python_files(folder))
    if found:
        pytest.fail(f"{len(found)} findings\n" + "\n".join(found), pytrace=False)
