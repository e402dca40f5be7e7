"""Canonical JSON: one spelling for each value, and hashes that follow content only."""

import json
import math
import shutil
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel

from groundwork.canonical import canonical_json, digest, file_digest, folder_digest, source_digest

PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=20,
)


class Point(BaseModel):
    """A model with a path in it."""

    x: float = 1.5
    file: Path = Path("a/b")


@given(value=PLAIN)
def test_round_trip_and_ascii(value: object) -> None:
    """What is written reads back as itself, in ASCII and on one line."""
    text = canonical_json(value)
    assert json.loads(text) == value
    assert text.isascii()
    assert "\n" not in text


@given(value=st.dictionaries(st.text(), PLAIN, min_size=2))
def test_key_order_does_not_matter(value: dict[str, object]) -> None:
    """The same entries in another order have the same spelling and hash."""
    turned = dict(reversed(list(value.items())))
    assert canonical_json(turned) == canonical_json(value)
    assert digest(turned) == digest(value)


@given(first=PLAIN, second=PLAIN)
def test_different_values_have_different_spellings(first: object, second: object) -> None:
    """Equal text means equal value; 1 and 1.0 and True differ on purpose."""
    if canonical_json(first) == canonical_json(second):
        assert json.dumps(first, sort_keys=True) == json.dumps(second, sort_keys=True)


def test_models_and_paths() -> None:
    """Settings and paths have a form; tuples are lists; other objects have none."""
    assert canonical_json({"p": Point(), "q": (Path("x") / "y",)}) == '{"p":{"file":"a/b","x":1.5},"q":["x/y"]}'
    with pytest.raises(TypeError, match="set has no canonical form"):
        canonical_json({1, 2})


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_numbers_that_are_not_finite_are_refused(number: float) -> None:
    """JSON has no NaN."""
    with pytest.raises(ValueError, match="JSON compliant"):
        canonical_json([number])


def test_file_and_folder_digests(tmp_path: Path) -> None:
    """Content and names count, order of writing and place do not."""
    for place, names in (("one", "abc"), ("two", "cba")):
        folder = tmp_path / place / "in"
        folder.mkdir(parents=True)
        for name in names:
            (folder / name).write_text(name * 3)
    one, two = tmp_path / "one", tmp_path / "two"
    assert folder_digest(one) == folder_digest(two)
    assert file_digest(one / "in" / "a") == "9834876dcfb05cb167a5c24953eba58c4ac89b1adf57f28f2f9d09af107ee8f0"
    (two / "in" / "a").rename(two / "in" / "d")
    renamed = folder_digest(two)
    assert renamed != folder_digest(one)
    (two / "in" / "d").write_text("other")
    assert folder_digest(two) not in (renamed, folder_digest(one))


SOURCE = '''"""Places."""

from a.b import c, d


def f(x: int) -> int:
    """Do it."""
    from a.e import g

    return g(c, d) + x * 2
'''
MOVED = '''"""Where things lie."""

from z import d
from y.x import c


def f(x: int) -> int:
    """Do what is asked."""
    from w.a.e import g

    # two of each
    return g(c, d) + x * 2
'''


@pytest.mark.parametrize(
    ("source", "same"),
    [
        (MOVED, True),
        (SOURCE.replace("* 2", "* 3"), False),
        (SOURCE.replace("c, d\n", "c, h as d\n"), False),
        (SOURCE.replace("import g", "import h as g"), False),
        (SOURCE.replace("+ x", "+ 'x'"), False),
    ],
)
def test_a_module_is_known_by_what_it_does(tmp_path: Path, source: str, same: bool) -> None:
    """Moving a module and rewording its docstrings keeps its hash; another name, number or text changes it."""
    before, after, empty = (tmp_path / name for name in ("a.py", "b.py", "__init__.py"))
    before.write_text(SOURCE, encoding="utf-8")
    after.write_text(source, encoding="utf-8")
    empty.touch()
    assert (source_digest([before]) == source_digest([empty, after])) is same


def test_runs_below_a_folder_do_not_count_where_that_is_asked(tmp_path: Path) -> None:
    """The output of a run beside the stage that it is made from leaves the stage's hash alone; other folders count."""
    (tmp_path / "stage.usda").write_text("#usda 1.0")
    before = folder_digest(tmp_path, without="run")
    for name, kind in (("out", "run"), ("captures", "captures")):
        (tmp_path / name).mkdir()
        (tmp_path / name / ".falsework").write_text(f"{kind}\n")
        (tmp_path / name / "result").write_text(name)
        assert (folder_digest(tmp_path, without="run") == before) == (kind == "run")
    assert folder_digest(tmp_path) != folder_digest(tmp_path, without="run")


def test_linked_folders_count(tmp_path: Path) -> None:
    """Each file behind a link counts, through links in linked folders, too; circles end, and runs do not count."""
    top, outside = tmp_path / "top", tmp_path / "outside"
    for folder in (top / "real", outside / "inner", tmp_path / "run"):
        folder.mkdir(parents=True)
        (folder / "file").write_text("first")
    (tmp_path / "run/.falsework").write_text("run\n")
    plain = folder_digest(top)
    assert plain == digest({"real/file": file_digest(top / "real/file")})
    (top / "out").symlink_to(tmp_path / "run")
    assert folder_digest(top, without="run") == plain != folder_digest(top)
    (top / "out").unlink()
    (top / "linked").symlink_to("../outside")
    (outside / "circle").symlink_to("../outside")
    (outside / "back").symlink_to("../top")
    (outside / "inner/up").symlink_to("../..")
    seen = [folder_digest(top)]
    (outside / "inner/file").write_text("second")
    seen.append(folder_digest(top))
    (top / "alias").symlink_to("real")
    seen.append(folder_digest(top))
    (top / "alias").unlink()
    (top / "alias").symlink_to("linked/inner")
    seen.append(folder_digest(top))
    assert len({plain, *seen}) == 5
    (tmp_path / "elsewhere").mkdir()
    for folder in (top, outside):
        shutil.copytree(folder, tmp_path / "elsewhere" / folder.name, symlinks=True)
    assert folder_digest(tmp_path / "elsewhere/top") == seen[-1]


def test_linked_folders_elsewhere_do_not_count_where_that_is_asked(tmp_path: Path) -> None:
    """What a link leads to is not even listed, unless it is in one of the given folders."""
    top, library, archive = (tmp_path / name for name in ("top", "library", "archive"))
    for folder in (top, library / "textures", archive):
        folder.mkdir(parents=True)
        (folder / "file").write_text("first")
    plain = folder_digest(top)
    (top / "archive").symlink_to(archive)
    assert folder_digest(top, within=(top, library)) == plain != folder_digest(top)
    (top / "textures").symlink_to(library / "textures")
    before = folder_digest(top, within=(top, library))
    (library / "textures/file").write_text("second")
    assert len({plain, before, folder_digest(top, within=(top, library))}) == 3
