"""A standing Dask cluster, as its commands start it: a scheduler, and workers that stand somewhere else."""

import json
import os
import re
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from groundwork.canonical import folder_digest
from tests.conftest import Count, RecordProof
from tests.falsework.forked import run
from tests.falsework.tiny_chain import ROOT, SEED, contents, start
from tests.patience import left

pytestmark = pytest.mark.faults
SCENES = 4
SCENARIO = f"""
seed = {SEED}
scenes = {SCENES}
[background]
name = "worlds/town"
[[survey]]
kind = "global"
"""

SCHEDULER = ("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
WORKER = (
    "worker",
    "--nthreads",
    "1",
    "--memory-limit",
    "0",
    "--no-dashboard",
    "--preload",
    "tests.falsework.tiny_worker",
)


@contextmanager
def _process(folder: Path, *words: str, **environment: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run `dask …` in a folder of its own, and end it."""
    folder.mkdir()
    with (folder / "said").open("wb") as said:
        process = subprocess.Popen(
            [sys.executable, "-m", "dask", *words],
            cwd=folder,
            stdout=said,
            stderr=said,
            start_new_session=True,
            env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
        )
    try:
        yield process
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _address(folder: Path, scheduler: subprocess.Popen[bytes]) -> str:
    deadline = time.monotonic() + left()
    while time.monotonic() < deadline:
        assert scheduler.poll() is None, (folder / "scheduler/said").read_text()
        try:
            return json.loads((folder / "file.json").read_text())["address"]
        except (OSError, ValueError):
            time.sleep(0.05)
    raise AssertionError("no scheduler came up")


def _on_a_terminal(*words: str | Path, cwd: Path) -> str:
    """Run a command whose standard error is a terminal; give what is drawn there."""
    ours, theirs = os.openpty()
    process = start(*words, cwd=cwd, stderr=theirs, COLUMNS="110", LINES="40", TERM="xterm")
    os.close(theirs)
    parts = []
    with suppress(OSError):  # how the end of a terminal shows
        while select.select([ours], [], [], left())[0] and (part := os.read(ours, 1 << 16)):
            parts.append(part)
    os.close(ours)
    process.communicate(timeout=left())
    said = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", b"".join(parts).decode())
    assert process.returncode == 0, said
    return said


def test_a_standing_cluster_loses_a_worker(tmp_path: Path, proof_count: Count, record_proof: RecordProof) -> None:
    """Workers in other folders find the scenario's world; one is killed in its work, the other ends the run alone.

    The tree is that of a run in one process, and the table at the end counts what the workers told.
    """
    deaths = proof_count(1, 4)
    for name in ("in/worlds/town", "once"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "in/worlds/town/town.usda").write_text("#usda 1.0\n")
    (tmp_path / "in/s.toml").write_text(SCENARIO)
    calm, out = tmp_path / "in/calm", tmp_path / "in/out"
    assert run("run", tmp_path / "in/s.toml", "-o", calm, said=tmp_path / "said") == 0
    faults = {"TINY_FAULTS": '{"capture:1": "kill"}', "TINY_ONCE": str(tmp_path / "once"), "TINY_KILLS": str(deaths)}
    file = ("--scheduler-file", str(tmp_path / "file.json"))
    come_again = deaths > 1
    nanny = () if come_again else ("--no-nanny",)
    with (
        _process(tmp_path / "scheduler", *SCHEDULER, *file) as first,
        _process(tmp_path / "a", *WORKER, *nanny, *file, **faults) as one,
        _process(tmp_path / "b", *WORKER, *nanny, *file, **faults) as other,
    ):
        words = ("run", "s.toml", "-o", "out", "--cluster", _address(tmp_path, first))
        drawn = _on_a_terminal(*words, cwd=tmp_path / "in")
        alive = [process.poll() is None for process in (one, other)]
        assert sorted(alive) == [come_again, True]
        assert len(list((tmp_path / "once").iterdir())) == deaths
    assert f"all    {SCENES}/{SCENES}" in drawn
    assert f"{SCENES} of {SCENES} scenes" in drawn
    assert contents(out) == contents(calm)
    stage = next(out.glob("store/stage/*/scene.usda"))
    assert f"# world/town {folder_digest(tmp_path / 'in/worlds/town')}" in stage.read_text()
    record_proof("faults: worker of a standing cluster killed", deaths, 0, {"kills": deaths})


TWICE = """
from falsework.execution.cluster import _own_cluster
for _ in range(2):
    with _own_cluster(0) as client:
        print(len(client.nthreads()))
"""


def test_one_process_may_have_a_cluster_twice() -> None:
    """Dask's own settings outlive the first cluster of a process that had not loaded it before."""
    command = [sys.executable, "-c", TWICE]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=left())
    assert (done.stdout, done.stderr) == ("0\n0\n", "")


@pytest.mark.proof_only
def test_a_scheduler_that_goes_away_is_one_line(tmp_path: Path) -> None:
    """Killed in the middle of a run: no traceback, the results so far stay, and the next run ends as ever."""
    (tmp_path / "s.toml").write_text(f'seed = {SEED}\nscenes = {SCENES}\n[[survey]]\nkind = "global"\n')
    out, file = tmp_path / "out", ("--scheduler-file", str(tmp_path / "file.json"))
    with (
        _process(tmp_path / "scheduler", *SCHEDULER, *file) as scheduler,
        _process(tmp_path / "a", *WORKER, "--no-nanny", *file, TINY_WAIT="0.5"),
    ):
        process = start("run", tmp_path / "s.toml", "-o", out, "--cluster", _address(tmp_path, scheduler))
        deadline = time.monotonic() + left()
        while not list(out.glob("store/capture/*")):
            assert process.poll() is None, process.communicate()
            assert time.monotonic() < deadline
            time.sleep(0.02)
        scheduler.kill()
        _, said = process.communicate(timeout=left())
        assert process.returncode == 1
        assert "the connection to the scheduler is lost" in said.splitlines()[-1]
        assert "Traceback" not in said
    for folder in (out, tmp_path / "calm"):
        assert run("run", tmp_path / "s.toml", "-o", folder, said=tmp_path / "said") == 0
    assert contents(out) == contents(tmp_path / "calm")
