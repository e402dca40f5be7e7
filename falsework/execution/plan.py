"""Plan of a run: the same decisions as in a run, on a store that only records what would be made."""

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

from falsework.execution.amounts import amounts, sizes
from falsework.execution.chain import Chain, Step, read_sources, scene_chain
from falsework.execution.claim import run_inputs
from falsework.execution.costs import Costs, free_space
from falsework.execution.outcome import Outcome
from falsework.execution.scene import RunOptions, SceneRun, run_scene
from falsework.scenario import Scenario
from falsework.stages import STAGES
from falsework.store.store import Store, Task
from groundwork.output.folder import check_run
from groundwork.progress import SILENT, Progress

NOWHERE = Path(os.devnull) / "run"  # a path that cannot exist


@dataclass
class StagePlan:
    """Planned results of one stage.

    Attributes:
        there: Number of existing results.
        let_go: Number of results that were made and then evicted, because nothing needs them (`keep`).
        make: Number of results to make.
        rejected: Number of results rejected in an earlier run.
        failed: Number of results that failed in an earlier run.
        skipped: Number of results that will not be made: an input is rejected or failed, or nothing needs them.
        seconds: Expected time of each [s].
        bytes: Expected disk space of each [bytes].
        learned: Whether the time was measured in this folder.
    """

    there: int = 0
    let_go: int = 0
    make: int = 0
    rejected: int = 0
    failed: int = 0
    skipped: int = 0
    seconds: float = 0.0
    bytes: float = 0.0
    learned: bool = False


@dataclass
class Plan:
    """Plan of a run.

    Attributes:
        stages: Name of each stage to its plan.
        outcome: Expected counts and reasons.
        scenes: Number of scenes.
        scenes_to_do: Number of scenes with work to do.
        seconds: Expected time of the whole in one process [s].
        peak_bytes: Largest additional disk space at any time [bytes].
        free_bytes: Free space of the file system [bytes].
    """

    stages: dict[str, StagePlan]
    outcome: Outcome = field(default_factory=Outcome)
    scenes: int = 0
    scenes_to_do: int = 0
    seconds: float = 0.0
    peak_bytes: float = 0.0
    free_bytes: int = 0


class PlannedStore(Store):
    """A store that records what would be made and evicted, and changes no file.

    Attributes:
        made: Keys of what would have been made.
        peak: Largest additional disk space at any time [bytes].
    """

    def __init__(self, root: Path, costs: Costs) -> None:
        """Open a run's folder.

        Args:
            root: The folder; it need not exist.
            costs: Costs of results.
        """
        super().__init__(root)
        self._hashes = None  # a plan compares only sizes; the run hashes its inputs
        self._costs = costs
        self.made: set[str] = set()
        self._gone: set[str] = set()
        self._space = self.peak = 0.0

    def has(self, task: Task) -> bool:
        """Tell whether a result exists, or would exist at this point.

        Args:
            task: The task.
        """
        return task.key not in self._gone and (task.key in self.made or super().has(task))

    def is_stored(self, task: Task) -> bool:
        """Tell whether a result is stored.

        Args:
            task: The task.
        """
        return super().has(task)

    def produce(
        self,
        task: Task,
        make: Callable[[Path], None],
        *,
        resume: bool = False,
        wait: bool = True,
        quarantine: bool = False,
        retry: bool = False,
    ) -> bool:
        """Record that a result would be made.

        Args:
            task: What would be made.
            make: Not called.
            resume: Without effect.
            wait: Without effect.
            quarantine: Without effect.
            retry: Retry what failed before.
        """
        if self.has(task):
            return False
        self.raise_former_failure(task, retry)
        self.made.add(task.key)
        self._gone.discard(task.key)
        self._space += self._costs.bytes_each(task.stage)
        self.peak = max(self.peak, self._space)
        return True

    def faults(self, task: Task) -> list[str]:
        """Compare the sizes of a stored result's files with its manifest; a planned result has no faults.

        Args:
            task: What made it.
        """
        return [] if task.key in self.made else super().faults(task)

    def discard(self, task: Task) -> bool:
        """Record that a damaged result would be removed.

        Args:
            task: What made it.
        """
        self._let_go(task)
        return True

    def evict(self, task: Task, link: str) -> None:
        """Record that a result would be evicted.

        Args:
            task: What made it.
            link: Without effect.
        """
        self._let_go(task)

    def link(self, name: str, task: Task, file: str = "") -> None:
        """Make no link.

        Args:
            name: Without effect.
            task: Without effect.
            file: Without effect.
        """

    def unlink(self, name: str) -> None:
        """Remove no link.

        Args:
            name: Without effect.
        """

    def _let_go(self, task: Task) -> None:
        self._gone.add(task.key)
        self._space -= self._costs.bytes_each(task.stage)


class PlannedRun(SceneRun):
    """A scene whose steps are decided, but not run."""

    def _work(self, step: Step) -> bool:
        return self.store.produce(step.task, lambda folder: None, retry=self.manner.retry)


def plan_run(
    scenario: Scenario,
    out: Path | None,
    progress: Progress,
    scenes: Iterable[int] | None = None,
    *,
    retry_failed: bool = False,
) -> Plan:
    """Plan what `run_scenario` would do with the same arguments; nothing is written.

    Args:
        scenario: What would be made.
        out: Output folder: absent, empty, or of an earlier run; None: an empty one.
        progress: Listener.
        scenes: Which scenes; all of the scenario when None.
        retry_failed: Try again what failed in an earlier run.

    Raises:
        InputError: Falsework did not write the folder.
    """
    if out is None:
        out, disk = NOWHERE, Path()
    else:
        check_run(out, run_inputs(scenario))
        disk = out
    sources, costs = read_sources(scenario, progress), Costs(out, amounts(scenario), sizes(scenario))
    store = PlannedStore(out, costs)
    manner = RunOptions(scenario.scenes > 1, retry_failed, keep=scenario.keep)
    names = [name for name in STAGES if name != "sample" or scenario.sample]
    plan = Plan(
        {
            name: StagePlan(seconds=costs.seconds(name), bytes=costs.bytes_each(name), learned=costs.is_learned(name))
            for name in names
        }
    )
    for index in range(scenario.scenes) if scenes is None else scenes:
        before = plan.outcome.made
        plan.outcome.add(run_scene(scenario, sources, index, store, manner, SILENT, kind=PlannedRun))
        plan.scenes += 1
        plan.scenes_to_do += plan.outcome.made > before
        _count(scene_chain(scenario, index, sources), store, manner, plan.stages)
    plan.seconds = sum(stage.make * stage.seconds for stage in plan.stages.values())
    plan.peak_bytes, plan.free_bytes = store.peak, free_space(disk)
    return plan


def _count(chain: Chain, store: PlannedStore, manner: RunOptions, stages: dict[str, StagePlan]) -> None:
    """Add the steps of a scene to the counts of their stages."""
    without = set()
    for step in chain.steps:
        fate = _fate(step.task, store, manner)
        without |= {step.link} if fate in ("rejected", "failed", "skipped") else set()
        setattr(stages[step.task.stage], fate, getattr(stages[step.task.stage], fate) + 1)
    if "report" in manner.keep:
        fate = _fate(chain.report(frozenset(without)).task, store, manner)
        setattr(stages["report"], fate, getattr(stages["report"], fate) + 1)


def _fate(task: Task, store: PlannedStore, manner: RunOptions) -> str:
    """Return the field of `StagePlan` in which a task counts."""
    if task.key in store.made:
        return "make"
    if store.is_stored(task):
        return "there"
    failure = store.failure(task)
    if failure is not None and failure.final and not (manner.retry and failure.kind == "failed"):
        return failure.kind
    return "skipped" if store.evicted_files(task) is None else "let_go"
