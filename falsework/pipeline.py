"""Conductor of the chain: for every scene its stage, a capture and a cloud for each survey, and the report."""

import os
from collections import deque
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from falsework.execution.amounts import sizes
from falsework.execution.board import NO_BOARD, Board
from falsework.execution.chain import Sources, read_sources, scene_chain
from falsework.execution.claim import claim_run
from falsework.execution.memory import memory_guard
from falsework.execution.outcome import Outcome
from falsework.execution.run_facts import write_run_report
from falsework.execution.scene import BusySceneError, RunOptions, run_scene, steps_of
from falsework.scenario import Scenario
from falsework.store.store import Store
from groundwork.errors import InputError
from groundwork.progress import Progress

__all__ = ["Outcome", "run_scenario"]


def run_scenario(
    scenario: Scenario,
    out: Path,
    progress: Progress,
    scenes: Iterable[int] | None = None,
    *,
    retry_failed: bool = False,
    workers: int = 0,
    cluster: str | None = None,
    memory: float | None = None,
    board: Board = NO_BOARD,
) -> Outcome:
    """Run the whole chain; finished results are reused, and several processes may share one folder.

    Args:
        scenario: The scenario.
        out: Output folder: absent, empty, or of a former run.
        progress: Listener.
        scenes: Numbers of the scenes; None: all of the scenario.
        retry_failed: Retry what failed in an earlier run.
        workers: Number of worker processes that share the scenes; 0: one scene after the other in this process.
        cluster: Address of an existing Dask scheduler whose workers share the scenes instead.
        memory: Limit of the memory of the run, all its processes together, or of each worker of an existing cluster
            [GB]; None: nine tenths of the machine's.
        board: Listener for the steps of the scenes.

    Returns:
        Counts and paths.

    Raises:
        InputError: Falsework did not write the folder, or it is not writable; the cluster's address is invalid, or it
            does not answer; or the error of the only scene of the scenario.
        OutOfSpaceError: The disk is full; finished results stay.
    """
    _check_workers(workers, cluster)
    indices = _wanted(scenario, scenes)
    claim_run(out, scenario)
    sources = read_sources(scenario, progress)
    manner = RunOptions(scenario.scenes > 1, retry_failed, keep=scenario.keep, sizes=sizes(scenario))
    with memory_guard(memory, progress.note):
        if indices and (workers or cluster):
            from falsework.execution.cluster import SceneJob, run_on_cluster

            place = Path(os.path.realpath(out))
            how = replace(manner, wait=False)
            own = {"guarded": cluster is not None, "memory": memory}
            jobs = [SceneJob(scenario, sources, index, place, how, **own) for index in indices]
            outcome = run_on_cluster(jobs, progress, workers, cluster, board).below(out, place)
        else:
            outcome = _run_here(scenario, sources, indices, out, manner, (progress, board))
    Store(out).sweep()
    write_run_report(out)
    return outcome


def _check_workers(workers: int, cluster: str | None) -> None:
    if workers < 0 or (workers and cluster):
        raise InputError(
            "number of workers out of range",
            field="workers",
            value=workers,
            allowed="0 or more; only 0 with a cluster",
        )
    if cluster is not None:
        from falsework.execution.address import check_address

        check_address(cluster)


def _wanted(scenario: Scenario, scenes: Iterable[int] | None) -> list[int]:
    """List the scenes to run; all must exist in the scenario."""
    indices = list(range(scenario.scenes) if scenes is None else scenes)
    unknown = sorted(set(indices) - set(range(scenario.scenes)))
    if unknown:
        raise InputError("no such scene", field="scenes", value=unknown, allowed=f"0 to {scenario.scenes - 1}")
    return indices


def _run_here(
    scenario: Scenario,
    sources: Sources,
    indices: list[int],
    out: Path,
    manner: RunOptions,
    listeners: tuple[Progress, Board],
) -> Outcome:
    """Run scenes one after the other in this process; those that another process is making come last."""
    outcome, store, (progress, board) = Outcome(), Store(out), listeners
    if indices:
        steps = steps_of(scene_chain(scenario, indices[0], sources), scenario.keep)
        board.expect([f"{index:04d}" for index in indices], steps, 0)
    waiting = deque(indices)
    busy = 0
    while waiting:
        index = waiting.popleft()
        how = replace(manner, wait=busy > len(waiting))  # every remaining scene is being made by another process
        try:
            outcome.add(run_scene(scenario, sources, index, store, how, progress, board=board))
            busy = 0
        except BusySceneError as error:
            outcome.made += error.made
            outcome.reused -= error.made  # so they are counted when the scene is retried
            waiting.append(index)
            busy += 1
    return outcome
