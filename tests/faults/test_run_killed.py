"""A run of tiny stages, killed, interrupted, and deprived of its workers: nothing is lost, the bytes are the same."""

import os
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import Count, RecordProof
from tests.falsework.forked import begin, end_of
from tests.falsework.tiny_chain import SEED, contents, start
from tests.patience import left

pytestmark = pytest.mark.faults
SCENES = 6


@pytest.fixture(scope="module")
def scenario(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a scenario of some scenes."""
    path = tmp_path_factory.mktemp("scenario") / "s.toml"
    path.write_text(f'seed = {SEED}\nscenes = {SCENES}\n[[survey]]\nkind = "global"\n')
    return path


@pytest.fixture(scope="module")
def calm(scenario: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Give the tree of a run that nobody disturbed."""
    folder = tmp_path_factory.mktemp("calm")
    _go_on(scenario, folder / "out", folder / "said")
    return contents(folder / "out")


def _finish(process: subprocess.Popen[str]) -> None:
    _, said = process.communicate(timeout=left())
    assert process.returncode == 0, said
    assert "Traceback" not in said


def _go_on(scenario: Path, out: Path, said: Path) -> None:
    """Run the command to its end in a copy of this process, which saves its start."""
    _end_well(begin("run", scenario, "-o", out, said=said), said)


def _end_well(pid: int, said: Path) -> None:
    code, words = end_of(pid), said.read_text()
    assert code == 0, words
    assert "Traceback" not in words


def _wait_for(out: Path, pattern: str, process: subprocess.Popen[str] | None = None) -> None:
    deadline = time.monotonic() + left()
    while not list(out.glob(pattern)):
        assert process is None or process.poll() is None, process.communicate()
        assert time.monotonic() < deadline, pattern
        time.sleep(0.01)


def _alive(session: int) -> list[int]:
    """List the processes of a session that have not ended."""
    found = []
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                fields = (folder / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if int(fields[3]) == session and fields[0] != "Z":
                found.append(int(folder.name))
    return found


def _assert_all_end(session: int) -> None:
    deadline = time.monotonic() + left()
    while _alive(session):
        assert time.monotonic() < deadline, _alive(session)
        time.sleep(0.05)


def test_workers_die_again_and_again_on_one_task(
    scenario: Path, calm: dict[str, str], tmp_path: Path, proof_count: Count, record_proof: RecordProof
) -> None:
    """More often than Dask would forgive: the task is not blamed, none is lost, and the bytes are those of a loop."""
    deaths = proof_count(4, 10)
    (tmp_path / "once").mkdir()
    process = start(
        "run",
        scenario,
        "-o",
        tmp_path / "out",
        "--workers",
        "1",
        TINY_FAULTS='{"capture:1": "kill"}',
        TINY_ONCE=str(tmp_path / "once"),
        TINY_KILLS=str(deaths),
    )
    _finish(process)
    assert len(list((tmp_path / "once").iterdir())) == deaths
    assert contents(tmp_path / "out") == calm
    _assert_all_end(process.pid)
    record_proof("faults: worker killed again and again on one task", deaths, 0, {"kills": deaths})


def test_a_scene_whose_workers_always_die_is_left_out(scenario: Path, calm: dict[str, str], tmp_path: Path) -> None:
    """The run ends, and has made all others; the next one skips the scene, and `--retry-failed` makes it."""
    (tmp_path / "once").mkdir()
    fault: dict[str, Any] = {
        "TINY_FAULTS": '{"capture:1": "kill"}',
        "TINY_ONCE": str(tmp_path / "once"),
        "TINY_KILLS": "1000",
    }
    out = tmp_path / "out"
    process = start("run", scenario, "-o", out, "--workers", "2", TINY_DEATHS="1", **fault)
    said = process.communicate(timeout=left())
    assert process.returncode == 3, said
    assert "every process that worked on this scene died in its capture" in "".join(said)
    assert len(list(out.glob("scenes/*/report.html"))) == SCENES - 1
    assert len(list((tmp_path / "once").iterdir())) >= 4  # two among the others, and two alone
    _assert_all_end(process.pid)
    for words, code in ((), 3), (("--retry-failed",), 0):
        pid = begin("run", scenario, "-o", out, *words, said=tmp_path / "said")
        assert end_of(pid) == code, (tmp_path / "said").read_text()
    assert contents(out) == {**calm, "failed": "folder"}  # empty again


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_interrupted_run_goes_on(
    number: signal.Signals, code: int, scenario: Path, calm: dict[str, str], tmp_path: Path
) -> None:
    """It ends with the signal's exit code in the middle of a stage; the next one finishes the work."""
    out, said = tmp_path / "out", tmp_path / "said"
    pid = begin("run", scenario, "-o", out, said=said, TINY_FAULTS='{"capture:1": "hang"}')
    _wait_for(out, "store/capture/*")
    _wait_for(out, "work/*.lock")
    os.kill(pid, number)
    assert end_of(pid) == code, said.read_text()
    assert "Traceback" not in said.read_text()
    _go_on(scenario, out, said)
    assert contents(out) == calm


@pytest.mark.parametrize(
    ("number", "code"),
    [(signal.SIGINT, 130), pytest.param(signal.SIGTERM, 143, marks=pytest.mark.proof_only)],
)
def test_workers_end_with_an_interrupted_run(
    number: signal.Signals, code: int, scenario: Path, calm: dict[str, str], tmp_path: Path, proof_count: Count
) -> None:
    """A signal in the middle of a stage ends the workers, too; the next run finishes the work."""
    out, workers = tmp_path / "out", str(proof_count(1, 2))
    process = start("run", scenario, "-o", out, "--workers", workers, TINY_FAULTS='{"capture:1": "hang"}')
    _wait_for(out, "store/capture/*", process)
    _wait_for(out, "work/*.lock", process)
    process.send_signal(number)
    _, said = process.communicate(timeout=left())
    assert process.returncode == code, said
    assert "Traceback" not in said
    _assert_all_end(process.pid)
    _go_on(scenario, out, tmp_path / "said")
    assert contents(out) == calm


def test_second_interrupt_ends_what_will_not(scenario: Path, tmp_path: Path, record_proof: RecordProof) -> None:
    """A stage that swallows the first one is ended by the second one."""
    faults = '{"capture:0": "stubborn"}'
    pid = begin("run", scenario, "-o", tmp_path / "out", said=tmp_path / "said", TINY_FAULTS=faults)
    for heard in (0, 1):
        _wait_for(tmp_path / "out", f"work/*/heard-{heard}")
        os.kill(pid, signal.SIGINT)
    code = end_of(pid)
    assert code == 130
    record_proof("faults: second interrupt of a stage that swallows the first", 1, 0, {"exit_code": code})


def test_workers_die_with_the_run(scenario: Path, calm: dict[str, str], tmp_path: Path) -> None:
    """The command killed without warning leaves no worker behind, and the next one finishes the work."""
    out = tmp_path / "out"
    process = start("run", scenario, "-o", out, "--workers", "2", TINY_FAULTS='{"capture:1": "hang"}')
    _wait_for(out, "store/capture/*", process)
    assert len(_alive(process.pid)) >= 3
    process.kill()
    process.communicate()
    _assert_all_end(process.pid)
    _go_on(scenario, out, tmp_path / "said")
    assert contents(out) == calm


def test_parts_of_a_run_make_the_whole(scenario: Path, calm: dict[str, str], tmp_path: Path) -> None:
    """Three jobs of an array at once on one output: together, the tree of a single run."""
    out = tmp_path / "out"
    said = [tmp_path / f"said{part}" for part in range(3)]
    jobs = [begin("run", scenario, "-o", out, "--shard", f"{part}/3", said=said[part]) for part in range(3)]
    for pid, words in zip(jobs, said, strict=True):
        _end_well(pid, words)
    assert contents(out) == calm
