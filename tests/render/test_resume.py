"""A renderer that was killed goes on where it was; neither that nor the number of workers changes a byte."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from groundwork.canonical import folder_digest
from groundwork.errors import InputError
from groundwork.files import write_json
from groundwork.locks import hold_lock
from groundwork.progress import SILENT
from render.frames import render_scene
from render.settings import RenderSettings
from render.workers import render_survey
from render.writing.capture_writer import make_folders
from render.writing.journal import Journal
from tests.render.prepared_here import prepared_here, rendered_here
from tests.render.scenes import random_scene
from tests.render.test_frames import STAGE

FRAMES = 40


def flight(folder: Path) -> Path:
    """Write a stage whose camera flies for forty frames."""
    samples = ", ".join(f"{frame}: ({frame / 10 - 2}, -9, 4)" for frame in range(FRAMES))
    text = STAGE.format(texture="absent").replace("{ 0: (0, -9, 4), 1: (1, -9, 4), 2: (2, -9, 5) }", f"{{ {samples} }}")
    path = folder / "scene.usda"
    path.write_text(text.replace("(160, 120)", "(320, 240)"))
    return path


def request(stage: Path, folder: Path, settings: RenderSettings, workers: int = 1) -> dict[str, object]:
    """Describe one survey."""
    folder.mkdir(exist_ok=True)
    chosen = settings.model_copy(update={"workers": workers, "encoders": workers})
    return {
        "scene": str(stage),
        "folder": str(folder),
        "settings": chosen.model_dump(mode="json"),
        "seed": 3,
        "survey": "",
    }


def notes(folder: Path) -> set[str]:
    """Name the frames that a capture in the making says are done."""
    return {path.stem for path in folder.glob(".frames/0*.json")}


def test_killed_or_shared_the_bytes_are_the_same(tmp_path: Path, small: RenderSettings) -> None:
    """Two workers, and one that is killed and started again: same capture; what was done is not done again."""
    stage = flight(tmp_path)
    shared, killed = tmp_path / "shared", tmp_path / "killed"
    answer = render_survey(request(stage, shared, small, 2), time_limit=300, memory_limit=4, progress=SILENT)
    assert answer["frames"] == FRAMES
    asked = json.dumps(request(stage, killed, small)).encode() + b"\n"
    process = subprocess.Popen(
        [sys.executable, "-m", "render.frames"], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL
    )
    assert process.stdin is not None
    process.stdin.write(asked)
    process.stdin.close()
    deadline = time.monotonic() + 120
    while len(notes(killed)) < 5 and time.monotonic() < deadline:
        time.sleep(0.002)
    process.send_signal(signal.SIGKILL)
    process.wait()
    done = notes(killed)
    assert 5 <= len(done) < FRAMES, "killed in the middle of the work"
    written = {
        path: path.stat().st_mtime_ns
        for name in done
        for path in killed.rglob(f"*/{name}.*")
        if ".frames" not in path.parts
    }
    started = {path.stem for path in (killed / "images").glob("0*.jpg")}
    assert len(started - done) <= 1, "at most the frame in work is lost with one encoder"
    with rendered_here():  # goes on in another process than began
        again = render_survey(request(stage, killed, small), time_limit=300, memory_limit=4, progress=SILENT)
    assert (again["frames"], again["gain"], again["driver"]) == (FRAMES, answer["gain"], answer["driver"])
    assert again["gain"] > 0
    assert {path: path.stat().st_mtime_ns for path in written} == written
    assert folder_digest(killed) == folder_digest(shared)
    assert not list(killed.rglob(".*"))


def test_no_frame_is_written_outside_the_capture(tmp_path: Path) -> None:
    """A name that leads out is refused; frames named like the journal's own records hide neither of them."""
    folder = tmp_path / "capture"
    folder.mkdir()
    journal = Journal(folder, "a recipe")
    make_folders(folder)
    for files in ({"images/../../evil.png": b"x"}, {}):
        with pytest.raises(InputError, match="a name that leads out of its folder"):
            journal.write_frame("../evil", files, {})
    assert list(tmp_path.iterdir()) == [folder]
    journal.keep_gain(2.0)
    for name in ("gain", "recipe"):
        journal.write_frame(name, {f"images/{name}.png": b"x"}, {"name": name})
    again = Journal(folder, "a recipe")
    assert (again.gain(), again.facts("gain"), again.facts("recipe")) == (2.0, {"name": "gain"}, {"name": "recipe"})


def test_workers_meter_once(tmp_path: Path, small: RenderSettings, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who waited for another worker's metering takes its gain over, and meters nothing."""

    @contextmanager
    def wait_for_the_other(lock: Path) -> Iterator[None]:
        with hold_lock(lock):
            if lock.name == "gain.lock":
                write_json(lock.with_name("_gain.json"), 2.5)
            yield

    monkeypatch.setattr("render.frames.hold_lock", wait_for_the_other)
    settings = small.model_copy(update={"quality": "fast", "normals": False})
    with prepared_here():
        drawn = render_scene(random_scene(4, np.zeros(3), count=8), tmp_path, settings, 3, SILENT, share=(0, 2))
    assert drawn["gain"] == 2.5


def test_only_what_is_whole_and_of_the_same_recipe_is_taken_over(tmp_path: Path, small: RenderSettings) -> None:
    """A cut file is drawn again; another seed starts afresh; a finished capture is left alone."""
    scene = random_scene(4, np.zeros(3), count=8)
    settings = small.model_copy(update={"quality": "fast", "normals": False})

    def draw(name: str, seed: int = 3) -> str:
        (tmp_path / name).mkdir(exist_ok=True)
        render_scene(scene, tmp_path / name, settings, seed, SILENT)
        return folder_digest(tmp_path / name)

    whole, other = draw("whole"), draw("other", seed=4)
    assert draw("whole") == whole != other
    image = tmp_path / "half" / "images/000001.jpg"
    (tmp_path / "half").mkdir()
    render_scene(scene, tmp_path / "half", settings, 3, SILENT, share=(1, 2))
    assert sorted(path.stem for path in image.parent.iterdir()) == ["000001"]
    image.write_bytes(image.read_bytes()[:-100])
    assert draw("half") == whole
    render_scene(scene, (tmp_path / "half"), settings, 4, SILENT, share=(0, 2))
    assert draw("half", seed=4) == other
