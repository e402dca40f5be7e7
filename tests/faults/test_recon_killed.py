"""Killed in any of its steps, a reconstruction goes on where it was, and ends with the bytes of one left in peace."""

import os
import signal
import sqlite3
import subprocess
import time
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from falsework.stages import STAGES
from falsework.store.store import Store, Task
from groundwork.marks import MARK
from groundwork.progress import Silent
from tests.conftest import Count, RecordProof
from tests.faults.conftest import FEW, SMALL, Start, contents, finish
from tests.patience import left

WORK = ".next/files"  # where an output is made
LOOK = 0.004  # [s]
SOON = 60.0  # [s] until the kernel has cleared away the child of a child


def kill_when(process: subprocess.Popen[str], seen: "Seen", work: Path) -> None:
    """Kill a run and its children without warning as soon as something is seen in its folder."""
    deadline = time.monotonic() + left()
    while not seen(work):
        assert process.poll() is None, "it ended before it could be killed"
        assert time.monotonic() < deadline
        time.sleep(LOOK)
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()


class Seen:
    """Tells whether files of a pattern are there; of databases, whether a table has so many rows."""

    def __init__(self, pattern: str, table: str = "", rows: int = 0) -> None:
        """Look for `pattern` below the folder in the making."""
        self.pattern, self.table, self.rows = pattern, table, rows

    def __call__(self, folder: Path) -> bool:
        """Look once."""
        found = next(iter(folder.glob(self.pattern)), None)
        if found is None or not self.table:
            return found is not None
        try:
            with closing(sqlite3.connect(f"file:{found}?mode=ro", uri=True)) as connection:
                count = connection.execute(f"SELECT COUNT(*) FROM {self.table}").fetchone()[0]
        except sqlite3.Error:
            return False
        return int(count) >= self.rows


MOMENTS = (
    Seen("work/features-*.partial"),
    Seen("work/features-*.partial/database.db", "keypoints", 2),
    Seen("work/matches-*.partial/share*/pairs.txt"),
    Seen("work/model-*.partial/models"),
    Seen("coord.npy"),
)


@pytest.mark.faults
def test_killed_in_every_step(calm: Path, start_reconstruct: Start, tmp_path: Path, proof_count: Count) -> None:
    """Kill one run in each of its steps, in turn: the end equals the undisturbed cloud, and no step was done twice."""
    out, folder = tmp_path / "out", tmp_path / "out" / WORK
    moments = MOMENTS[-proof_count(2, len(MOMENTS)) :]
    databases: list[tuple[int, int]] = []
    for moment in moments:
        kill_when(start_reconstruct(out), moment, folder)
        assert not (out / MARK).exists()
        finished = [path.stat() for path in folder.glob("work/features-*[!l]/database.db")]
        databases += [(status.st_ino, status.st_mtime_ns) for status in finished]
    said = finish(start_reconstruct(out))
    assert contents(out) == contents(calm)
    assert len(databases) == proof_count(2, 3)  # killed while matching, mapping, annotating
    assert len(set(databases)) == 1  # and never extracted again
    assert "features" not in said
    assert "matching" not in said
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.faults
@pytest.mark.proof_only
def test_killed_at_random(
    calm: Path, start_reconstruct: Start, tmp_path: Path, proof_count: Count, record_proof: RecordProof
) -> None:
    """Kill runs at random moments, several times each, and compare every byte of what they end with."""
    draw, kills = np.random.default_rng(8), 0
    begin = time.monotonic()
    finish(start_reconstruct(tmp_path / "timed"))
    span = time.monotonic() - begin
    for number in range(proof_count(1, 3)):
        out = tmp_path / f"out{number}"
        for _ in range(4):
            process = start_reconstruct(out)
            time.sleep(draw.uniform(0.1, 0.9) * span)
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                kills += 1
            process.communicate()
        finish(start_reconstruct(out))
        assert contents(out) == contents(calm)
    record_proof("reconstruction: killed at random, ends with the same bytes", kills, 8, {"kills": kills})


@pytest.mark.faults
@pytest.mark.proof_only
def test_killed_in_the_dense_step(start_reconstruct: Start, tmp_path: Path) -> None:
    """Kill a dense run while depth is measured and while points are labeled: the same bytes, and one model only."""
    settings = f'[recon]\nmode = "dense"\nquality = "medium"\n{FEW}'
    calm, out, folder = tmp_path / "calm", tmp_path / "out", tmp_path / "out" / WORK
    finish(start_reconstruct(calm, settings=settings))
    for moment in (Seen("work/dense-*.partial/*"), Seen("coord.npy")):
        kill_when(start_reconstruct(out, settings=settings), moment, folder)
    said = finish(start_reconstruct(out, settings=settings))
    assert contents(out) == contents(calm)
    assert "mapping" not in said


class Interrupted(Silent):
    """Raises what Ctrl-C raises when a stage begins, and writes down which stages it heard of."""

    def __init__(self, at: str) -> None:
        """Wait for the stage of this name."""
        self.at, self.heard = at, list[str]()

    def stage(self, name: str, total: int) -> None:
        """Hear a stage begin."""
        self.heard.append(name)
        if name == self.at:
            raise KeyboardInterrupt


@pytest.mark.faults
@pytest.mark.proof_only
def test_interrupted_run_goes_on_in_the_store(few_planes: Path, calm: Path, tmp_path: Path) -> None:
    """In a run's store, too, an interrupted model keeps its finished steps; it and its cloud have the same bytes."""
    model = Task("model", STAGES["model"].version, {"recon": SMALL.of_model()}, {"capture": "0"})
    cloud = Task("cloud", STAGES["cloud"].version, {"recon": SMALL.of_cloud("sparse")}, {"model": model.key})
    store, inputs = Store(tmp_path / "out"), {"capture": few_planes}

    def run(task: Task, listener: Silent) -> Path:
        stage = STAGES[task.stage]
        store.produce(task, lambda folder: stage.run(task.settings, inputs, folder, listener), resume=stage.resumes)
        return store.folder(task)

    with pytest.raises(KeyboardInterrupt):
        run(model, Interrupted("mapping"))
    listener = Interrupted("nothing")
    inputs["model"] = run(model, listener)
    assert not {"features", "matching"} & set(listener.heard)
    with pytest.raises(KeyboardInterrupt):
        run(cloud, Interrupted("annotate"))
    assert contents(inputs["model"]) == contents(calm / "model")
    both = {
        **contents(run(cloud, listener)),
        **{f"model/{name}": what for name, what in contents(calm / "model").items()},
    }
    assert both == contents(calm)


EXTRACTING, MATCHING = MOMENTS[1], MOMENTS[2]


@pytest.mark.faults
@pytest.mark.parametrize(
    "working",
    [pytest.param(EXTRACTING, marks=pytest.mark.proof_only, id="features"), pytest.param(MATCHING, id="matching")],
)
def test_interrupt_leaves_no_child(working: Seen, start_reconstruct: Start, tmp_path: Path) -> None:
    """Ctrl-C while children work: exit code 130, one line, and they are gone."""
    out = tmp_path / "out"
    process = start_reconstruct(out)
    deadline = time.monotonic() + left()
    while not working(tmp_path / "out" / WORK):
        assert process.poll() is None, "it ended before it could be interrupted"
        assert time.monotonic() < deadline
        time.sleep(LOOK)
    below = descendants(process.pid)
    assert below
    os.kill(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=left())
    assert process.returncode == 130
    assert said.strip().splitlines()[-1].startswith("falsework: interrupted; repeat the command")
    assert "Traceback" not in said
    assert not (out / MARK).exists()
    deadline = time.monotonic() + SOON
    while [child for child in below if Path(f"/proc/{child}/statm").exists()]:
        assert time.monotonic() < deadline
        time.sleep(LOOK)


def descendants(pid: int) -> list[int]:
    """List the children of a process, whichever of its threads started them, and theirs."""
    found = []
    for task in Path(f"/proc/{pid}/task").iterdir():
        for child in map(int, (task / "children").read_text().split()):
            found += [child, *descendants(child)]
    return found
