"""A run's workers and its memory: limits, starts that fail, interrupts."""

import multiprocessing
import os
import signal
import subprocess
from pathlib import Path
from typing import Any

import pytest

from falsework.execution import cluster, memory
from falsework.execution.memory import machine_memory, processes_below
from groundwork.errors import InputError
from tests.falsework.test_run import Run, run  # noqa: F401 (a fixture)


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


def test_a_process_that_ends_while_it_is_read_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its files are empty from one moment to the next; the watch goes on."""
    monkeypatch.setattr(memory, "_read", lambda path: "" if path.name == "statm" else path.read_text(errors="replace"))
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
    (tmp_path / "proc/meminfo").write_text("MemTotal:       64000000 kB\nMemFree: 1 kB\n")
    (tmp_path / "proc/self/cgroup").write_text(f"3:cpuset:/small\n{groups}")
    limits = {"": "99000000000", "slurm": "max", "slurm/job_7": "4000000000", "slurm/job_7/step_0": "max", "small": "1"}
    for group, limit in limits.items():
        (hierarchy / group).mkdir(parents=True, exist_ok=True)
        (hierarchy / group / Path(file).name).write_text(f"{limit}\n")
    assert machine_memory(tmp_path) == 4.0
    (hierarchy / "slurm/job_7" / Path(file).name).unlink()
    assert machine_memory(tmp_path) == 65.536


def test_script_without_a_guard(run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:  # noqa: F811
    """Each worker reads the script again: there the call ends it without a word, and the script's own says why."""
    with monkeypatch.context() as worker:
        worker.setattr(multiprocessing.current_process(), "_inheriting", True, raising=False)
        with pytest.raises(SystemExit) as left:
            run(workers=1, out=tmp_path / "worker")
    assert left.value.code == 1

    def start(**how: Any) -> None:
        raise RuntimeError("Nanny failed to start.")

    monkeypatch.setattr("distributed.LocalCluster", start)
    with pytest.raises(InputError, match=r"workers: the workers did not start.*__name__"):
        run(workers=1)


def test_interrupt_during_the_start_of_workers_is_not_lost() -> None:
    """It is raised when they have started; a process started meanwhile does not get what a terminal sends to all."""
    started: list[bytes] = []

    def start() -> None:
        with cluster._deaf_to_interrupts():
            os.kill(os.getpid(), signal.SIGINT)
            started.append(subprocess.check_output(["sh", "-c", "kill -INT $$; echo on"]))

    with pytest.raises(KeyboardInterrupt):
        start()
    assert started == [b"on\n"]
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())
