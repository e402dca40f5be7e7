"""The chain as the paper draws it: for every scene its stage, a capture and a cloud for each survey, and the report."""

from collections import deque
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from falsework.execution.chain import Sources, look_at_sources, scene_chain
from falsework.execution.claim import claim_run
from falsework.execution.failures import QuarantinedError, failure_of
from falsework.execution.locks import BusyError
from falsework.execution.outcome import Outcome
from falsework.execution.scene import Manner, SceneRun
from falsework.scenario import Scenario
from falsework.store import Store
from groundwork.errors import ChildError, OutOfSpaceError, RejectedSceneError
from groundwork.progress import Progress

__all__ = ["Outcome", "run_scenario"]


def run_scenario(
    scenario: Scenario, out: Path, progress: Progress, scenes: Iterable[int] | None = None, *,
    retry_failed: bool = False,
) -> Outcome:  # fmt: skip
    """Run the whole chain, or what is left of it; several processes may do so in one folder.

    Args:
        scenario: What to make.
        out: Output folder: absent, empty, or of a former run.
        progress: Listener.
        scenes: Which scenes; all of the scenario when None.
        retry_failed: Try again what failed in an earlier run.

    Returns:
        Counts and paths.

    Raises:
        InputError: The folder is not ours or not writable; or what is wrong with the only scene of the scenario.
        OutOfSpaceError: The disk is full; finished results stay.
    """
    claim_run(out, scenario)
    sources = look_at_sources(scenario, progress)
    manner = Manner(quarantine=scenario.scenes > 1, retry=retry_failed, keep=scenario.keep)
    indices = list(range(scenario.scenes) if scenes is None else scenes)
    outcome = _run_here(scenario, sources, indices, out, manner, progress)
    Store(out).sweep()
    return outcome


def _run_here(
    scenario: Scenario, sources: Sources, indices: list[int], out: Path, manner: Manner, progress: Progress
) -> Outcome:
    """Run scenes one after the other in this process; those that another process works on come last."""
    outcome, store = Outcome(), Store(out)
    waiting = deque(indices)
    busy = 0
    while waiting:
        index = waiting.popleft()
        how = replace(manner, wait=busy > len(waiting))  # every scene that is left is in the hands of others
        try:
            outcome.add(run_scene(scenario, sources, index, store, how, progress))
            busy = 0
        except BusyError as error:
            outcome.made += error.made
            outcome.reused -= error.made  # so they will be counted when the scene's turn comes again
            waiting.append(index)
            busy += 1
    return outcome


def run_scene(
    scenario: Scenario, sources: Sources, index: int, store: Store, manner: Manner, progress: Progress
) -> Outcome:
    """Run one scene, and count what is wrong with it; the other scenes of a scenario go on.

    Args:
        scenario: What to make.
        sources: What it takes from outside.
        index: Number of the scene.
        store: Where results are.
        manner: How to go about it.
        progress: Listener.

    Raises:
        InputError: What is wrong with the only scene of the scenario.
        OutOfSpaceError: The disk is full.
        BusyError: Another process is making what we need, and we do not wait.
    """
    chain = scene_chain(scenario, index, sources)
    scene = SceneRun(store, chain, manner, progress)
    try:
        scene.run()
    except RejectedSceneError as rejection:
        scene.outcome.rejected[chain.name] = f"{rejection.reason}: {rejection}"
    except BusyError as error:
        error.made = scene.outcome.made
        raise
    except OutOfSpaceError:
        raise
    except (ChildError, QuarantinedError) as error:
        scene.outcome.failed[chain.name] = str(error)
    except Exception as error:
        if scenario.scenes == 1:
            raise
        failure = failure_of(error, 1, store.root)  # what one scene draws may not go together
        scene.outcome.failed[chain.name] = str(error) if failure is None else failure.message
    return scene.outcome
