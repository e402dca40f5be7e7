"""`verify` finds scenes that lack results, and no others."""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from falsework.cli import main
from tests.falsework.test_run import Run, run

__all__ = ["run"]

Told = Callable[..., list[str]]


@pytest.fixture
def told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Told:
    """Give `told(*options, code=…)`: the lines of `verify` on faults and on unfinished scenes."""

    def told(*options: str, code: int | None = None) -> list[str]:
        capsys.readouterr()
        with pytest.raises(SystemExit) as left:
            main(["verify", str(tmp_path / "out"), "--json", *options])
        found = json.loads(capsys.readouterr().out)
        lines = [*found["wrong"], *found["unfinished"]]
        assert found["whole"] == (not lines)
        assert left.value.code == (int(bool(lines)) if code is None else code)
        return lines

    return told


def delete(link: Path) -> None:
    """Delete a link of a scene and the result behind it."""
    target = link.resolve()
    shutil.rmtree(target if target.is_dir() else target.parent)
    link.unlink()


def test_scenes_without_results(run: Run, told: Told, tmp_path: Path) -> None:
    """A deleted scene, a deleted report, a scenario that is none or gone; not a scene that failed."""
    out = tmp_path / "out"
    run(4, faults={"capture:2": "input"})
    assert told() == []
    for link in [path for path in sorted((out / "scenes/0001").rglob("*")) if path.is_symlink()]:
        delete(link)
    (line,) = told()
    assert line.startswith("scenes/0001: no stage, capture/global, ")
    assert "falsework run makes them" in line
    assert told("--repair", code=0) == [line]  # nothing is damaged
    run(4)
    assert told() == []
    delete(out / "scenes/0003/report.html")
    assert [line[:27] for line in told()] == ["scenes/0003: no report.html"]
    (out / "scenario.toml").write_text("nonsense")
    (line,) = told()
    assert line.startswith("scenario.toml: ")
    (out / "scenario.toml").unlink()
    (line,) = told()
    assert line.startswith("scenario.toml: missing")


@pytest.mark.parametrize("keep", [["cloud"], ["cloud", "report"], ["report"], ["model", "report"]])
@pytest.mark.parametrize("fault", ["model:1", "cloud:1"])
def test_a_rejected_scene_is_no_fault(fault: str, keep: list[str], run: Run, told: Told) -> None:
    """Also where its stage and capture were not kept, so that only records say which scene it was."""
    run(3, faults={fault: "reject"}, keep=keep)
    assert told() == []


def test_a_result_beside_a_failed_one_is_missed(run: Run, told: Told, tmp_path: Path) -> None:
    """A report that failed excuses no cloud."""
    run(2, faults={"report:1": "input"})
    assert told() == []
    for link in (tmp_path / "out/scenes/0001/cloud").iterdir():
        delete(link)
    assert any(line.startswith("scenes/0001: no cloud/global") for line in told())


def test_a_moved_run_is_checked_as_far_as_its_inputs_are_here(
    run: Run, told: Told, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without the sky that it names, nothing is wrong."""
    run(1)
    text = (tmp_path / "out/scenario.toml").read_text()
    lost = re.sub(r"(?m)(^\[light\]\n)", r'\1sky = "gone.hdr"\n', re.sub(r'(?m)^sky = ""\n', "", text))
    assert lost != text
    (tmp_path / "out/scenario.toml").write_text(lost)
    assert told() == []


@pytest.mark.usefixtures("run")
def test_a_share_without_a_scene_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A job of an array with more jobs than scenes ends well."""
    (tmp_path / "s.toml").write_text('seed = 5\n[[survey]]\nkind = "global"\n')
    with pytest.raises(SystemExit) as left:
        main(["run", str(tmp_path / "s.toml"), "-o", str(tmp_path / "out"), "--shard", "5/7"])
    assert not left.value.code
    assert capsys.readouterr().out == "nothing to do: this share has no scene\n"
