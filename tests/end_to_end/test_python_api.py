"""The Python API: what docs/python.md shows runs as it stands, every name is there, and help tells the story."""

from __future__ import annotations

import ast
import pydoc
import re
import sys
from inspect import isfunction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import falsework
from tests.end_to_end.conftest import TINY, Chain
from tests.falsework.served_here import served_here
from tests.render.prepared_here import rendered_here

PAGE = Path(__file__).resolve().parents[2] / "docs" / "python.md"
REFERENCE = PAGE.with_name("api.md")
# The page's scene has textures and photographs for people; these are for a test.
SMALLER = {
    '"background": {"name": "none"},': '"background": {"name": "none"}, **tiny,',
    '"images": 40}': '"images": 8, "spacing": 40.0, "width": 160, "height": 120}',
}


@pytest.mark.usefixtures("densely")
def test_the_page_runs(chain: Chain, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every block in its order, in an empty folder, with a smaller scene and the dense cloud of a flight."""
    flown = chain.out / "scenes/0000"
    monkeypatch.chdir(tmp_path)
    text = PAGE.read_text(encoding="utf-8")
    for large, small in SMALLER.items():
        assert large in text
        text = text.replace(large, small)
    names: dict[str, Any] = {"tiny": {key: TINY[key] for key in ("look", "light", "site")}}
    blocks = re.findall(r"^```python\n(.*?)^```$", text, re.M | re.S)
    for block in blocks:
        if "falsework.reconstruct(" in block:
            assert names["flight"].folder == Path("captures/global")
            names["flight"] = falsework.read_capture(flown / "capture/global")
        with rendered_here(), served_here():
            exec(compile(block, str(PAGE), "exec"), names)
    assert len(blocks) == 8
    there, evening = (falsework.read_stage(names[name]) for name in ("scene", "evening"))
    np.testing.assert_array_equal(there.cameras[0].poses, evening.cameras[0].poses)
    assert there.sun is not None
    assert evening.sun is not None
    assert not np.allclose(there.sun.direction, evening.sun.direction)
    assert names["cloud"].source == "sfm-dense"
    assert [path.name for path in names["outcome"].clouds] == ["mesh"]
    assert (tmp_path / "above/cloud.json").is_file()


def test_every_public_name_is_there() -> None:
    """`dir`, `__all__` and what can be had are one list; each function's help has an example or says what it reads."""
    assert sorted(falsework.__all__) == dir(falsework)
    for name in falsework.__all__:
        what = getattr(falsework, name)
        assert what.__doc__, name
    for name in ("author", "render", "reconstruct", "sample", "save_cloud"):
        assert ">>> " in getattr(falsework, name).__doc__
    with pytest.raises(AttributeError, match="no attribute 'auhtor'"):
        falsework.auhtor  # noqa: B018


def test_help_begins_with_the_story() -> None:
    """The first screens of `help(falsework)` show a whole example, and each function with what it makes of what."""
    first = pydoc.plain(pydoc.render_doc(falsework)).splitlines()[:60]
    functions = {name for name in falsework.__all__ if isfunction(getattr(falsework, name))}
    assert {"author", "render", "reconstruct", "sample", "read_cloud"} < functions
    listed = {found[1] for line in first if (found := re.match(r" {8}(\w+)\(.*\) +.*->  \S", line))}
    assert listed == functions
    assert [name for name in falsework.__all__ if name.endswith("Settings") and name not in "\n".join(first)] == []
    example = "\n".join(line.strip() for line in first if line.startswith(" " * 8) and "->" not in line)
    assert {node.attr for node in ast.walk(ast.parse(example)) if isinstance(node, ast.Attribute)} >= {
        "author",
        "render",
        "reconstruct",
        "sample",
    }
    survey = falsework.scenario_of({"bridge": {"family": "beam"}}).survey[0]  # that of the example
    assert f'["{survey.id or survey.kind}"]' in example


def test_the_reference_lists_every_name() -> None:
    """docs/api.md documents each name of `__all__` once, and no other."""
    text = REFERENCE.read_text(encoding="utf-8")
    assert sorted(re.findall(r"^\.\. auto\w+:: falsework\.(\w+)$", text, re.M)) == sorted(falsework.__all__)


def test_several_clouds_at_once_are_refused(tmp_path: Path) -> None:
    """One call gives one cloud; the line says how to get both."""
    with pytest.raises(falsework.InputError, match="Call twice"):
        falsework.reconstruct(tmp_path, tmp_path / "out", settings=falsework.ReconSettings(mode="both"))
    assert "falsework.author(" in str(sys.modules["falsework"].__doc__)
