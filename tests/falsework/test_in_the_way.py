"""Files, links and pipes where a run would put its own: said before the work, removed, or kept for the user."""

import os
import shutil
from pathlib import Path

import pytest

from groundwork.errors import InputError
from groundwork.files import MANIFEST
from tests.falsework.test_run import Run, run

__all__ = ["run"]


def test_what_stands_in_the_way_is_one_line(run: Run, tmp_path: Path) -> None:
    """A folder where a lock or a record belongs, a file where a link belongs: refused by name, and left there."""
    out = tmp_path / "out"
    run(2, faults={"cloud:1": "reject"})
    key = next((out / "failed").iterdir()).stem
    (out / "failed" / f"{key}.json").unlink()
    (out / "work" / f"{key}.lock").mkdir()
    assert "not a lock file of Falsework" in run(2).failed["0001"]
    (out / "work" / f"{key}.lock").rmdir()
    (out / "failed" / f"{key}.json").mkdir()
    assert "at the place of a record" in run(2, faults={"cloud:1": "reject"}).failed["0001"]
    (out / "scenes/0000/stage").unlink()
    (out / "scenes/0000/stage").write_text("mine")
    assert "at the place of a link" in run(2).failed["0000"]
    assert (out / "scenes/0000/stage").read_text() == "mine"


@pytest.mark.parametrize("name", ["store", "work", "run", "failed", "scenes", "evicted", "scenario.toml"])
def test_what_stands_in_place_of_our_own_is_said_before_the_work(name: str, run: Run, tmp_path: Path) -> None:
    """A file for a folder, a folder for a file, and a pipe for either: no traceback, no waiting, and it stays."""
    place = tmp_path / "out" / name
    run()
    if place.is_dir():
        shutil.rmtree(place)
        place.write_text("mine")
    elif place.exists():
        place.unlink()
        place.mkdir()
    else:
        place.write_text("mine")
    with pytest.raises(InputError, match=f"{name}: is in the way of a f"):
        run(faults={"cloud:0": "reject"})
    assert os.path.lexists(place)


@pytest.mark.parametrize(
    "name", ["store/capture", "store/texture", "evicted/capture", "scenes/0001", "scenes/0000/capture"]
)
def test_what_stands_in_place_of_a_folder_of_ours_is_said_before_the_work(name: str, tmp_path: Path, run: Run) -> None:
    """A file one level down: one line that names it, and nothing is made."""
    place = tmp_path / "out" / name
    run(2, faults={"stage:0": "input", "stage:1": "input"})
    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_text("mine")
    with pytest.raises(InputError, match=f"{name}: is in the way of a folder"):
        run(2, retry_failed=True)
    assert place.read_text() == "mine"
    assert not list((tmp_path / "out/scenes").glob("*/stage"))


def test_what_stands_in_place_of_work_goes_and_of_a_result_is_moved(tmp_path: Path, run: Run) -> None:
    """A link or a pipe in `work` is removed, and nothing is written behind it; a file in the store is kept for you."""
    run()
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    (capture,) = (out / "store/capture").iterdir()
    elsewhere.mkdir()
    for kind in ("link", "pipe", "file"):
        shutil.rmtree(capture)
        work = out / "work" / capture.name
        if kind == "link":
            work.symlink_to(elsewhere)
        elif kind == "pipe":
            os.mkfifo(work)
        else:
            capture.write_text("mine")
        run()
        assert (capture / MANIFEST).is_file()
        assert not capture.is_symlink()
    assert not list(elsewhere.iterdir())
    assert [path.read_text() for path in (out / "foreign").rglob("*") if path.is_file()] == ["mine"]
