"""No reader of foreign files can be forgotten: the table of readers and the code agree, and no rule is broken."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

import pytest

from tests.faults import readers
from tests.house.house import ROOMS, python_files

OPENERS_THEMSELVES = {"foreign_file", "files"}  # the safe opener, and the protocol of outputs
LOOKS = (
    "check_regular",
    "is_regular",
    "check_file",
    "is_file",
    "used_files",
    "own_files",
    "open_regular",
    "read_regular",
)


@cache
def modules() -> dict[Path, str]:
    """Read the modules of the rooms."""
    return {path: path.read_text(encoding="utf-8") for path in python_files(*ROOMS)}


@cache
def found_in_code() -> dict[str, Path]:
    """Find the places that open files by themselves: `module.function` to the module's file."""
    return {
        place: path
        for path, source in modules().items()
        if path.stem not in OPENERS_THEMSELVES or path.parent.name != "groundwork"
        for place in readers.openings(source, path.stem)
    }


def test_every_opening_has_a_reason() -> None:
    """Who opens a file without the safe opener stands in the table with a reason, and nobody else does."""
    listed = [place for places in readers.OPENED_RAW.values() for place in places]
    assert len(listed) == len(set(listed))
    code = set(found_in_code())
    assert sorted(code - set(listed)) == []  # new: read through groundwork.foreign_file, or give the reason
    assert sorted(set(listed) - code) == []  # gone


def test_libraries_open_only_what_was_looked_at() -> None:
    """The modules whose libraries open files themselves ask first whether these are regular files."""
    code = found_in_code()
    # recon.formats.scan and recon.photos.photos ask for them
    apart = {
        "read_las",
        "read_ply",
        "read_e57",
        "read_numpy",
        "read_text",
        "unpack_laz",
        "extraction",
        "copy_las",
        "copy_ply",
    }
    apart |= {"copy_table", "labeled_copy"}
    for place in sorted(readers.OPENED_RAW[readers.LOOKED_AT]):
        if place.partition(".")[0] not in apart:
            assert any(look in modules()[code[place]] for look in LOOKS), place


def test_every_safe_reader_belongs_to_a_format() -> None:
    """Who reads through the safe opener belongs to a format that is mutated, or stands among those that need not."""
    code = {
        place
        for path, source in modules().items()
        if path.stem != "foreign_file" or path.parent.name != "groundwork"
        for place in readers.safe_readings(source, path.stem)
    }
    listed = readers.READ_SAFELY_ANYHOW.union(*readers.FORMATS.values())
    assert sorted(code - listed) == []
    others = set(found_in_code()) | {"model_files.unpack"}
    assert sorted(listed - code - others) == []


def test_nothing_from_a_file_runs_or_calls() -> None:
    """No pickle but between a parent and its child, no array of objects, no evaluated text, nothing from a network."""
    for path, source in modules().items():
        for node in ast.walk(readers.parsed(source)):
            if isinstance(node, ast.Import | ast.ImportFrom):
                names = [node.module or ""] if isinstance(node, ast.ImportFrom) else [one.name for one in node.names]
                plain = {name.partition(".")[0] for name in names if name != "urllib.parse"}
                local = {"socket"} if path.stem == "interrupts" else set()  # a pair of ends within the process
                assert not plain & readers.NETWORK - local, path
                assert "pickle" not in plain or path.stem == "preparation_child", path
            if not isinstance(node, ast.Call):
                continue
            call = ast.unparse(node.func) if isinstance(node.func, ast.Name | ast.Attribute) else ""
            assert call not in ("eval", "exec", "yaml.load", "marshal.loads", "shelve.open"), f"{path}: {call}"
            if call in ("np.load", "numpy.load", "np.lib.format.read_array"):
                said = {one.arg: ast.unparse(one.value) for one in node.keywords}
                assert said.get("allow_pickle") == "False", f"{path}:{node.lineno}"


@pytest.mark.parametrize(
    ("source", "place"),
    [
        ("def f(p):\n    return np.load(p)", "m.f"),
        ("def f(p):\n    return p.read_bytes()", "m.f"),
        ("class C:\n    def f(self, p):\n        return open(p).read()", "m.C.f"),
        ("def f(p):\n    with p.open('rb') as file:\n        return file.read()", "m.f"),
        ("def f(p):\n    return [Usd.Stage.Open(str(p))]", "m.f"),
        ("x = json.loads(y)", "m"),
        ("def f(p):\n    return files('a').joinpath('b').read_text()", "m.f"),
    ],
)
def test_an_opening_is_found(source: str, place: str) -> None:
    """Every way to open a file is found, wherever it stands."""
    assert set(readers.openings(source, "m")) == {place}


def test_writing_is_no_opening() -> None:
    """What only writes is another rule's business; a safe reading is found by its name."""
    assert readers.openings("def f(p):\n    p.open('wb').write(b'')", "m") == {}
    assert readers.safe_readings("def f(p):\n    return image_files.decode(p)", "m") == {"m.f"}
