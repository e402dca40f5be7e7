"""The notebooks: their scripts run cell by cell, and what is made of them is what Jupyter reads."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import nbformat
import pytest

import falsework
from docs.notebook_files import FOLDER, SCRIPTS, cells, notebook
from tests.end_to_end.conftest import TINY, Chain
from tests.end_to_end.test_pages import falsework as command
from tests.end_to_end.test_pages import small_demo
from tests.falsework.served_here import served_here
from tests.render.prepared_here import rendered_here

SMALL = {key: TINY[key] for key in ("look", "light", "site")}


def run_cells(name: str, names: dict[str, Any], changes: dict[str, str]) -> list[str]:
    """Run the code cells of a notebook in their order; each change must fit somewhere."""
    code = [cell.text for cell in cells((FOLDER / f"{name}.py").read_text(encoding="utf-8")) if cell.is_code]
    for old, new in changes.items():
        assert any(old in text for text in code), old
        code = [text.replace(old, new) for text in code]
    for text in code:
        exec(compile(text, name, "exec"), names)
    return code


def test_authoring_and_swapping(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two looks, one truth, two photographs, said by the notebook itself."""
    monkeypatch.chdir(tmp_path)
    small = {'"images": 12, "width": 640, "height": 480': '"images": 8, "spacing": 40.0, "width": 160, "height": 120'}
    names: dict[str, Any] = {"small": SMALL}
    with rendered_here(), served_here():
        run_cells("author_and_swap", names, {**small, '"variants": {': '**small, "variants": {'})
    assert sorted(names["flights"]) == ["clean", "weathered"]
    assert "truth is the same: True · different first photographs: 2" in capsys.readouterr().out


@pytest.mark.usefixtures("densely")
def test_rendering_and_reconstructing(chain: Chain, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Scene, photographs and cloud are those that all tests share; every class of its cloud is printed."""
    monkeypatch.chdir(tmp_path)
    flown = chain.out / "scenes/0000"
    flight = falsework.read_capture(flown / "capture/global")
    monkeypatch.setattr("falsework.api.author", lambda *_: flown / "stage/scene.usda")
    monkeypatch.setattr("falsework.api.render", lambda *_, **__: {"global": flight})
    names: dict[str, Any] = {}
    run_cells("render_and_reconstruct", names, {})
    assert names["cloud"].source == "sfm-dense"
    assert len(names["cloud"]) == names["counts"].sum() > 1000
    assert len(names["figure"].data[0].x) == min(len(names["cloud"]), 20_000)


def test_training_and_predicting(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On five toy bridges; every point of the scan that was kept gets a class."""
    monkeypatch.chdir(tmp_path)
    small_demo(tmp_path, monkeypatch)
    names: dict[str, Any] = {"command": command}
    inside = "subprocess.run(shlex.split(line), check=True)"
    few = "--model forest --set network.trees=4 --set network.depth=6 --set network.points=4000"
    changes = {inside: "command(line)", "--set fewest=128": "--set fewest=64", "--model forest": few}
    run_cells("train_and_predict", names, changes)
    assert len(names["predicted"]) == len(names["clouds"]["beam26"])


@pytest.mark.parametrize("name", SCRIPTS)
def test_the_files_are_notebooks_of_the_scripts(name: str) -> None:
    """They are valid, fresh, and hold every line of code of their script."""
    kept = (FOLDER / f"{name}.ipynb").read_text(encoding="utf-8")
    assert kept == notebook(name)
    nbformat.validate(nbformat.reads(kept, as_version=4))
    code = [line for cell in json.loads(kept)["cells"] if cell["cell_type"] == "code" for line in cell["source"]]
    script = (FOLDER / f"{name}.py").read_text(encoding="utf-8").partition('"""\n\n')[2].splitlines()
    wanted = [line for line in script if line and line[0] != "#"]
    assert [line.rstrip("\n") for line in code if line.strip() and line[0] != "#"] == wanted
