"""Killed at any moment, a run goes on, and ends with the same bytes as one that nobody disturbed."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from falsework.pipeline import run_scenario
from groundwork.canonical import file_digest
from groundwork.marks import MARK
from groundwork.progress import SILENT
from tests.conftest import Count, RecordProof
from tests.end_to_end.conftest import Chain
from tests.patience import left
from tests.render.prepared_here import rendered_here

FRAMES = 4  # of the 18 of the flight


@pytest.mark.faults
def test_killed_run_goes_on(chain: Chain, tmp_path: Path) -> None:
    """Kill the whole run while it draws its photographs, run it again to its end, and compare every stored byte.

    Stage and model are those of the chain: a reconstruction that is killed has its own tests in `tests/faults`.
    """
    out = tmp_path / "out"
    for stage in ("stage", "model"):
        shutil.copytree(chain.out / "store" / stage, out / "store" / stage)
    shutil.copy(chain.out / MARK, out / MARK)
    command = _command(chain, tmp_path, out)
    deadline = time.monotonic() + left()

    def drawing(process: subprocess.Popen[bytes]) -> None:
        while len(list(out.glob("work/*/images/0*.jpg"))) < FRAMES:
            assert process.poll() is None, "it ended before it could be killed"
            assert time.monotonic() < deadline
            time.sleep(0.01)

    _kill_when(command, drawing)
    assert not list(out.glob("store/capture/*"))
    (begun,) = out.glob("work/*/images")
    drawn = {path.name: path.stat().st_mtime_ns for path in begun.glob("0*.jpg")}
    with rendered_here():  # goes on in another process than began
        assert run_scenario(chain.scenario, out, SILENT).made == 3
    _assert_same(chain, out)
    (images,) = out.glob("store/capture/*/images")
    kept = sum((images / name).stat().st_mtime_ns == changed for name, changed in drawn.items())
    assert kept >= len(drawn) - 2  # those in work when it was killed are drawn again


@pytest.mark.proof_only
def test_workers_give_the_bytes_of_one_process(chain: Chain, tmp_path: Path, record_proof: RecordProof) -> None:
    """Three scenes shared out to two workers, with the real stages: the scene of the chain has every stored byte."""
    scenario = chain.scenario.model_copy(update={"scenes": 3})
    out = tmp_path / "out"
    outcome = run_scenario(scenario, out, SILENT, workers=2)
    assert outcome.failed == {}
    assert "0000" not in outcome.rejected  # the others may be: their flights are tiny, too
    files = 0
    for stage in ("stage", "capture", "model", "cloud"):
        for result in (chain.out / "store" / stage).iterdir():
            twin = out / "store" / stage / result.name
            assert _digests(result) == _digests(twin)
            files += len(_digests(twin))
    record_proof(
        "chain: two workers against one process",
        files,
        chain.scenario.seed,
        {"scenes": len(list(out.glob("scenes/*")))},
    )


@pytest.mark.faults
@pytest.mark.proof_only
def test_killed_run_goes_on_from_anywhere(
    chain: Chain, tmp_path: Path, proof_count: Count, record_proof: RecordProof
) -> None:
    """Kill the whole run at random moments, run it again to its end, and compare every stored byte."""
    out = tmp_path / "out"
    command = _command(chain, tmp_path, out)
    draw = np.random.default_rng(5)
    kills = proof_count(1, 12)
    for _ in range(kills):
        _kill_when(command, lambda _: time.sleep(draw.uniform(2.0, 20.0)))
    subprocess.run(command, check=True, capture_output=True)
    _assert_same(chain, out)
    record_proof("faults: whole chain killed at random moments", kills, 5, {"kills": kills})


def _command(chain: Chain, folder: Path, out: Path) -> list[str]:
    """Spell the run of the chain's scenario into another folder."""
    scenario = folder / "scenario.toml"
    scenario.write_text(chain.scenario.as_toml())
    return [sys.executable, "-m", "falsework", "run", str(scenario), "-o", str(out)]


def _kill_when(command: list[str], wait: Callable[[subprocess.Popen[bytes]], None]) -> None:
    """Begin a run, wait, and kill it and its children without warning."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    try:
        wait(process)
    finally:
        with suppress(ProcessLookupError):  # it has ended, and that was noticed
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _assert_same(chain: Chain, out: Path) -> None:
    """Compare every stored byte with the chain's, and look for what was left behind."""
    wanted = {path.name for path in chain.out.glob("store/*/*")}
    for stage in ("stage", "capture", "model", "cloud"):
        (done,) = out.glob(f"store/{stage}/*")
        assert done.name in wanted
        assert _digests(done) == _digests(chain.out / "store" / stage / done.name)
    assert not list((out / "work").iterdir())


def _digests(folder: Path) -> dict[str, str]:
    """Hash each file, so that a difference names it."""
    return {path.relative_to(folder).as_posix(): file_digest(path) for path in folder.rglob("*") if path.is_file()}
