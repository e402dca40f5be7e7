"""A run's workers and its memory: limits, starts that fail, interrupts."""

import errno
import multiprocessing
import os
import re
import signal
import subprocess
import sys
import time
from concurrent.futures import Future
from pathlib import Path
from typing import TYPE_CHECKING, cast

import pytest

from falsework.execution import chain, cluster, memory
from falsework.execution.board import SilentBoard, StepEvent
from falsework.execution.chain import read_sources, scene_chain
from falsework.execution.cluster import SceneJob
from falsework.execution.memory import processes_below
from falsework.execution.outcome import Outcome
from falsework.execution.scene import RunOptions, blame_scene
from falsework.store.store import Store
from groundwork.errors import FalseworkError, InputError
from groundwork.memory import available_memory, machine_memory
from groundwork.progress import SILENT
from tests.falsework.test_run import Run, run  # noqa: F401 (a fixture)
from tests.falsework.tiny_chain import ROOT, tiny_scenario
from tests.patience import left

if TYPE_CHECKING:
    from distributed.scheduler import WorkerState


@pytest.fixture
def no_platform(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ask no driver."""
    monkeypatch.setattr(chain, "render_platform", lambda device="auto": {"gl_renderer": "none"})
    for name in ("recon_platform", "sample_platform"):
        monkeypatch.setattr(chain, name, lambda: {"cpu": "none"})


def test_all_processes_together_keep_a_limit_of_memory(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: F811
    """No child is over a limit of its own, but all processes are together: the largest child ends, the others go on."""
    monkeypatch.setattr("falsework.execution.memory._OURS", {"tests"})  # whose module the child runs
    together = sum(one.memory for one in processes_below(os.getpid()))
    assert 0.05 < together < machine_memory()
    outcome = run(scenes=2, faults={"capture:0": "grows in a child"}, memory=together + 0.2)
    assert list(outcome.failed) == ["0000"]
    assert "died of SIGKILL" in outcome.failed["0000"]
    assert len(outcome.clouds) == 1
    assert run(scenes=2, memory=together + 0.2).failed == {}  # and the next run makes it


def test_the_step_at_work_is_blamed(tmp_path: Path, no_platform: None) -> None:
    """In the order of a run: samples come before photographs, and a result that is there is not blamed."""
    scenario = tiny_scenario(2, sample=[{"kind": "mesh"}])
    sources, store, manner = read_sources(scenario, SILENT), Store(tmp_path), RunOptions(quarantine=True)
    steps = scene_chain(scenario, 0, sources)
    assert steps.stage is not None
    for step, name in ((steps.stage, "stage"), (steps.samples[0], "sample"), (steps.flights[0].capture, "capture")):
        assert f"died in its {name}" in blame_scene(scenario, sources, 0, store, manner)
        failure = store.failure(step.task)
        assert failure is not None
        assert failure.final
        assert failure.reason == "killed"
        store.produce(step.task, lambda folder: (folder / "made").touch(), retry=True)
        assert store.failure(step.task) is None
        store.blame(step.task, "it died")
        assert store.failure(step.task) is None
    assert not list((tmp_path / "work").iterdir())


@pytest.mark.parametrize(("allowed", "rounds"), [(20, 1), (3, 6)])
def test_a_standing_cluster_has_the_patience_of_ours(
    allowed: int, rounds: int, tmp_path: Path, no_platform: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """More than twenty workers have to die before a scene runs alone, and as many more before it is left out."""
    from distributed import KilledWorker

    scenario = tiny_scenario(2)
    future: Future[object] = Future()
    future.set_exception(KilledWorker("do_job", cast("WorkerState", None), allowed))
    told: list[StepEvent] = []
    board = SilentBoard()
    monkeypatch.setattr(board, "tell", told.append)
    outcome = Outcome()
    job: SceneJob | None = SceneJob(scenario, read_sources(scenario, SILENT), 1, tmp_path, RunOptions(quarantine=True))
    seen = []
    while job is not None:
        seen.append(job.alone)
        job = cluster._take(future, job, outcome, SILENT, board)
    assert seen == [False] * rounds + [True] * rounds
    assert list(outcome.failed) == ["0001"]
    assert [(event.scene, event.state) for event in told] == [("0001", "failed")]


def test_a_process_that_ends_while_it_is_read_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its files are empty from one moment to the next; the watch goes on."""
    read = memory.read_kernel_file
    monkeypatch.setattr(memory, "read_kernel_file", lambda path: "" if path.name == "statm" else read(path))
    assert memory.processes_below(os.getpid()) == []


@pytest.mark.parametrize(
    ("groups", "file"),
    [
        ("0::/slurm/job_7/step_0\n", "memory.max"),
        ("4:cpu,memory:/slurm/job_7/step_0\n", "memory/memory.limit_in_bytes"),
    ],
)
def test_memory_of_a_job_is_that_of_its_group(groups: str, file: str, tmp_path: Path) -> None:
    """Slurm limits the job, a group above that of the process; the root group, and others, say nothing of it."""
    hierarchy = tmp_path / "sys/fs/cgroup" / Path(file).parent
    (tmp_path / "proc/self").mkdir(parents=True)
    (tmp_path / "proc/meminfo").write_text("MemTotal:       64000000 kB\nMemFree: 1 kB\nMemAvailable: 3000000 kB\n")
    (tmp_path / "proc/self/cgroup").write_text(f"3:cpuset:/small\n{groups}")
    limits = {"": "99000000000", "slurm": "max", "slurm/job_7": "4000000000", "slurm/job_7/step_0": "max", "small": "1"}
    for group, limit in limits.items():
        (hierarchy / group).mkdir(parents=True, exist_ok=True)
        (hierarchy / group / Path(file).name).write_text(f"{limit}\n")
    (tmp_path / "proc/self/statm").write_text("900000 500000 100 1 0 7 0\n")  # pages: 2.048 GB of 4 kB
    assert machine_memory(tmp_path) == 4.0
    assert available_memory(tmp_path) == pytest.approx(4.0 - 500_000 * os.sysconf("SC_PAGE_SIZE") / 1e9)
    (hierarchy / "slurm/job_7" / Path(file).name).unlink()
    assert machine_memory(tmp_path) == 65.536
    assert available_memory(tmp_path) == 3.072


def test_a_script_without_a_guard_is_told_of_it(tmp_path: Path) -> None:
    """Each worker reads the script again: there the call ends it without a word, and the script's own says why."""
    script = tmp_path / "script.py"
    script.write_text("from falsework.execution.cluster import _own_cluster\nwith _own_cluster(1):\n    print('on')\n")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, script]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment, timeout=left())
    said = done.stderr.splitlines()[-1]
    assert re.search(r"InputError: workers: the workers did not start.*__name__", said)
    assert done.stdout == ""


@pytest.mark.parametrize(
    ("codes", "said"),
    [
        ([], "OSError: [Errno 24] Too many open files"),
        ([-signal.SIGKILL, 0], "one died of SIGKILL"),
        ([3], "one ended with exit code 3; above is what it printed"),
    ],
)
def test_workers_that_do_not_start_say_why(codes: list[int], said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Dask says of every error that a nanny failed; the reason is how a worker ended or the first error, no guard."""

    def start(*, worker_class: type, **how: object) -> None:
        nanny = object.__new__(worker_class)
        monkeypatch.setattr("distributed.Nanny._on_worker_exit_sync", lambda nanny, code: None)
        for code in codes:
            nanny._on_worker_exit_sync(code)
        raise RuntimeError("Nanny failed to start.") from OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr("distributed.LocalCluster", start)
    with pytest.raises(FalseworkError) as failed:
        cluster._start_workers(1, "")
    assert str(failed.value) == f"the workers did not start: {said}"
    assert not isinstance(failed.value, InputError)


def test_an_interrupt_ends_the_start_of_workers_at_once() -> None:
    """It ends the processes that exist by then, which never got what a terminal sends to all, and no others."""
    context = multiprocessing.get_context("spawn")
    other, worker = (context.Process(target=time.sleep, args=(60,)) for _ in range(2))
    other.start()
    blocked: list[set[int]] = []

    def start() -> tuple[None, None]:
        blocked.append(signal.pthread_sigmask(signal.SIG_BLOCK, ()))
        worker.start()
        os.kill(os.getpid(), signal.SIGINT)
        worker.join()  # as Dask waits for it
        raise RuntimeError("Nanny failed to start.")

    with pytest.raises(KeyboardInterrupt):
        cluster._started_apart(start)
    assert worker.exitcode == -signal.SIGKILL
    assert other.is_alive()
    other.kill()
    assert blocked == [{signal.SIGINT}]
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())
