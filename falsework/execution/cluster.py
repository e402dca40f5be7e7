"""Runs scenes on the workers of a Dask cluster, our own or an existing one; only the store decides what is finished."""

import logging
import multiprocessing
import os
import secrets
import signal
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import astuple, dataclass, field, replace
from functools import partial
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any

from falsework.execution.board import NO_BOARD, Board, SilentBoard, StepEvent, detailed
from falsework.execution.chain import Sources, scene_chain
from falsework.execution.memory import memory_guard
from falsework.execution.outcome import Outcome
from falsework.execution.scene import BusySceneError, RunOptions, blame_scene, run_scene, steps_of
from falsework.execution.scratch import scratch_folder
from falsework.scenario import Scenario
from falsework.store.store import Store
from groundwork.errors import FalseworkError, InputError
from groundwork.progress import Progress

DEATHS = 20  # of workers that a task survives; then it runs alone, as Dask blames all tasks of a dead worker
QUEUE = 4  # scenes per worker that are submitted ahead; the rest wait here and cost nothing
LEAST_QUEUE = 64
PATIENCE = "1 day"  # for the restart of a worker; Dask would end it after 15 s on a busy machine
CLOSING = 4.0  # [s]
TOLD_EVERY = 1.0  # [s] between two progress messages of a worker
LOOPBACK = "127.0.0.1"
UNGUARDED = 86  # exit code of a worker that ran the user's script again, up to its run(…); Python itself never has it


@dataclass(frozen=True)
class SceneJob:
    """One scene, as sent to a worker.

    Attributes:
        scenario: The scenario.
        sources: Its external inputs.
        index: Number of the scene.
        out: Output folder of the run, the same path on every worker.
        manner: Options of the run.
        topic: Dask topic of its events; empty if there is no listener.
        guarded: Whether the worker limits its own memory, because it is not a child process of the command.
        memory: Limit of the memory of that worker and the processes below it [GB]; None: nine tenths of its machine's.
        alone: Whether it runs while no other scene does, so that it is to blame if its workers die.
        deaths: Workers that died while they had it, since it began, or since it runs alone.
    """

    scenario: Scenario
    sources: Sources
    index: int
    out: Path
    manner: RunOptions
    topic: str = ""
    guarded: bool = False
    memory: float | None = None
    alone: bool = False
    deaths: int = 0


@dataclass
class _Teller(SilentBoard):
    """Listener in a worker: sends steps and progress to the cluster's log, and keeps notes for the result."""

    topic: str
    lines: list[str] = field(default_factory=list)
    _now: StepEvent | None = None
    _phase: str = ""
    _total: int = 0
    _spoke: float = 0.0

    def stage(self, name: str, total: int) -> None:
        self._phase, self._total = name, total

    def advance(self, done: int) -> None:
        if self._now is not None and time.monotonic() - self._spoke > TOLD_EVERY:
            self.tell(detailed(self._now, self._phase, done, self._total))

    def note(self, message: str) -> None:
        self.lines.append(message)

    def tell(self, event: StepEvent) -> None:
        from distributed import get_worker

        self._now, self._spoke = event if event.state == "begun" else None, time.monotonic()
        if self.topic:
            with suppress(Exception):  # an error in the display must not stop the work
                get_worker().log_event(self.topic, {"told": astuple(event)})  # Dask adds the worker's name


def do_job(job: SceneJob) -> tuple[Outcome, list[str]]:
    """Run one scene in a worker.

    Args:
        job: The scene.

    Returns:
        Its outcome, and notes for people.
    """
    teller = _Teller(job.topic)
    store = Store(job.out)
    with memory_guard(job.memory, teller.note) if job.guarded else nullcontext():
        outcome = run_scene(job.scenario, job.sources, job.index, store, job.manner, teller, board=teller)
    return outcome, teller.lines


def run_on_cluster(
    jobs: list[SceneJob], progress: Progress, workers: int, address: str | None, board: Board = NO_BOARD
) -> Outcome:
    """Run scenes on worker processes, restarting those that die.

    Args:
        jobs: The scenes.
        progress: Listener.
        workers: Number of workers of a cluster that exists during this call.
        address: Address of the scheduler of an existing cluster instead.
        board: Listener for the steps of the scenes.

    Returns:
        The outcome of all scenes.

    Raises:
        InputError: The script that calls this has no guard for workers, or no cluster answers at the address.
        FalseworkError: The workers did not start, or the cluster was lost.
        OutOfSpaceError: The disk is full.
    """
    outcome = Outcome()
    progress.stage("scenes", len(jobs))
    with _own_cluster(min(workers, len(jobs))) if address is None else _standing_cluster(address) as client:
        from distributed import wait

        threads = sum(client.nthreads().values())
        waiting, alone = deque(_told_to(jobs, client, board, threads)), deque[SceneJob]()
        room = max(LEAST_QUEUE, QUEUE * threads)
        sent: dict[Any, SceneJob] = {}
        done = 0
        while waiting or sent or alone:
            while waiting and len(sent) < room:
                job = waiting.popleft()
                sent[client.submit(do_job, job, pure=False)] = job
            if not sent:
                job = alone.popleft()
                sent[client.submit(do_job, job, pure=False)] = job
            finished: Any = wait(list(sent), return_when="FIRST_COMPLETED")
            for future in finished.done:
                again = _take(future, sent.pop(future), outcome, progress, board)
                future.release()
                if again is None:
                    done += 1
                    progress.advance(done)
                else:
                    (alone if again.alone else waiting).append(again)
    return outcome


def _told_to(jobs: list[SceneJob], client: Any, board: Board, workers: int) -> list[SceneJob]:
    """Forward the events of the workers to a board."""
    if board is NO_BOARD:
        return jobs
    chain = scene_chain(jobs[0].scenario, jobs[0].index, jobs[0].sources)
    board.expect([f"{job.index:04d}" for job in jobs], steps_of(chain, jobs[0].scenario.keep), max(workers, 1))
    topic = f"falsework-{secrets.token_hex(8)}"
    client.subscribe_topic(topic, lambda event: board.tell(StepEvent(*event[1]["told"])))
    return [replace(job, topic=topic) for job in jobs]


def _take(future: Any, job: SceneJob, outcome: Outcome, progress: Progress, board: Board) -> SceneJob | None:
    """Add the outcome of a job; return the job if it has to be run again."""
    from distributed import CancelledError, KilledWorker

    try:
        part, notes = future.result()
    except BusySceneError as error:  # another run is making it: it comes last, and then we wait
        outcome.made += error.made
        outcome.reused -= error.made
        return replace(job, manner=replace(job.manner, wait=True))
    except CancelledError:
        return job
    except KilledWorker as error:  # an existing cluster has a lower limit of its own
        deaths = job.deaths + error.allowed_failures + 1
        if deaths <= DEATHS:
            return replace(job, deaths=deaths)
        if not job.alone:
            return replace(job, alone=True, deaths=0)
        message = blame_scene(job.scenario, job.sources, job.index, Store(job.out), job.manner)
        outcome.add(Outcome(failed={f"{job.index:04d}": message}))
        board.tell(StepEvent(f"{job.index:04d}", state="failed"))
        return None
    for line in notes:
        progress.note(f"scene {job.index:04d}: {line}")
    outcome.add(part)
    return None


@contextmanager
def _own_cluster(workers: int) -> Iterator[Any]:
    """Start workers that are reachable only from this machine and end with this process, with their children."""
    if getattr(multiprocessing.current_process(), "_inheriting", False):  # a worker that runs the user's script again
        raise SystemExit(UNGUARDED)
    import distributed  # noqa: F401 (before the settings: its defaults overwrite them)
    from dask import config

    settings: dict[str, Any] = {
        "distributed.scheduler.allowed-failures": DEATHS,
        "distributed.deploy.lost-worker-timeout": PATIENCE,
        # Lost connections of an interrupted run are not logged; the workers get this with the settings.
        "logging": {"distributed": "critical"},
    }
    with scratch_folder() as scratch, config.set(settings):
        for name in ("distributed", "distributed.client"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
        cluster, client = _started_apart(partial(_start_workers, workers, scratch))
        try:
            yield client
        except BaseException:
            _kill_workers(cluster)
            raise
        finally:
            _close(client, cluster)


def _start_workers(workers: int, scratch: str) -> tuple[Any, Any]:
    """Start a cluster and its client."""
    from distributed import Client, LocalCluster, Nanny

    codes: list[int] = []

    class Watched(Nanny):  # only it knows how its worker ended
        def _on_worker_exit_sync(self, exitcode: int) -> None:
            codes.append(exitcode)
            super()._on_worker_exit_sync(exitcode)

    how: dict[str, Any] = {"dashboard_address": None, "memory_limit": 0}  # no dashboard, no memory monitor
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "(?s).*Port .* is already in use")  # of a dashboard that we do not use
            cluster = LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                host=LOOPBACK,
                local_directory=scratch,
                silence_logs=logging.CRITICAL,
                worker_class=Watched,
                **how,
            )
            return cluster, Client(cluster)
    except (RuntimeError, OSError) as error:
        if UNGUARDED in codes:
            raise InputError(
                "the workers did not start",
                field="workers",
                value=workers,
                hint='A script must call run(…) below `if __name__ == "__main__":`, because each worker reads it again',
            ) from error
        raise FalseworkError(f"the workers did not start: {_start_fault(error, codes)}") from error


def _start_fault(error: BaseException, codes: list[int]) -> str:
    """Say in one line why workers did not start: how the first one ended, or the error below Dask's own."""
    if codes and codes[0] < 0:
        return f"one died of {signal.Signals(-codes[0]).name}"
    if codes and codes[0] > 0:
        return f"one ended with exit code {codes[0]}; above is what it printed"
    while below := error.__cause__ or error.__context__:
        error = below
    return " ".join(f"{type(error).__name__}: {error}".split())


@contextmanager
def _standing_cluster(address: str) -> Iterator[Any]:
    from distributed import CancelledError, Client
    from distributed.comm.core import CommClosedError

    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        client = Client(address, timeout="30s")
    except (OSError, ValueError) as error:
        raise InputError(
            "no scheduler answers at this address",
            field="--cluster",
            value=address,
            hint="Start one with: dask scheduler",
        ) from error
    try:
        yield client
    except (CommClosedError, CancelledError):
        raise FalseworkError(
            f"{address}: the connection to the scheduler is lost. Finished results are kept; start a scheduler, then "
            "run the same command again"
        ) from None
    finally:
        _close(client)


def _started_apart(start: Callable[[], tuple[Any, Any]]) -> tuple[Any, Any]:
    """Start a cluster and its client in a thread that has Ctrl-C blocked, as have the workers: we end them ourselves.

    A terminal sends Ctrl-C to all of them. Here it ends the wait at once, and the workers that exist by then.
    """
    resource_tracker.ensure_running()  # now: Python unblocks the signal after it starts this process for the workers
    before = set(multiprocessing.active_children())
    result: Future[tuple[Any, Any]] = Future()

    def work() -> None:
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            result.set_result(start())
        except BaseException as error:  # raised where the result is read
            result.set_exception(error)

    starter = threading.Thread(target=work, name="start of workers", daemon=True)
    try:
        starter.start()
        return result.result()
    except BaseException:
        end = time.monotonic() + CLOSING
        while starter.is_alive() and time.monotonic() < end:
            for process in set(multiprocessing.active_children()) - before:
                process.kill()
            starter.join(0.1)
        if result.done() and result.exception() is None:
            cluster, client = result.result()
            _kill_workers(cluster)
            _close(client, cluster)
        raise


def _close(*started: Any) -> None:
    for one in started:
        with suppress(Exception):
            one.close(timeout=CLOSING)


def _kill_workers(cluster: Any) -> None:
    """End the workers at once: results are complete or absent, and interrupted work is resumed next time."""
    for nanny in list(cluster.workers.values()):
        pid = getattr(getattr(nanny, "process", None), "pid", None)
        if pid:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
