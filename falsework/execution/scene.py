"""Runs the steps of one scene in order, each from verified inputs."""

import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from falsework.execution.board import NO_BOARD, Board, State, StepEvent
from falsework.execution.chain import Chain, Flight, Sources, Step, scene_chain
from falsework.execution.costs import bytes_added, check_space
from falsework.execution.events import write_event
from falsework.execution.needs import REPORT, consumers, needed_steps, rejected_steps, wanted_steps
from falsework.execution.outcome import Outcome
from falsework.scenario import Scenario
from falsework.stages import STAGES
from falsework.stops import stop_behind
from falsework.store.failures import QuarantinedError, failure_of
from falsework.store.store import Store
from groundwork.errors import ChildError, FalseworkError, OutOfSpaceError, RejectedSceneError
from groundwork.locks import BusyError
from groundwork.progress import Progress


class BusySceneError(FalseworkError):
    """Another process is making a result of this scene.

    Attributes:
        made: Number of results of the scene made before.
    """

    made = 0


@dataclass(frozen=True)
class RunOptions:
    """Options of a run that change no result.

    Attributes:
        quarantine: Store records of errors, so that the next run skips their tasks.
        retry: Retry what failed before.
        wait: Wait for another process that is making a needed result.
        keep: Stages whose results are kept.
        sizes: Size of each stage's results as multiples of the demo's, as in `Costs` [1].
    """

    quarantine: bool = False
    retry: bool = False
    wait: bool = True
    keep: tuple[str, ...] = tuple(STAGES)
    sizes: Mapping[str, float] = field(default_factory=dict[str, float])


@dataclass
class SceneRun:
    """The run of one scene.

    Attributes:
        store: Store of the results.
        chain: Its steps.
        manner: Options of the run.
        progress: Listener.
        board: Listener for its steps.
        outcome: Its outcome so far.
    """

    store: Store
    chain: Chain
    manner: RunOptions
    progress: Progress
    board: Board = NO_BOARD
    outcome: Outcome = field(default_factory=Outcome)

    def run(self) -> Outcome:
        """Make the missing results of the scene.

        Returns:
            Its outcome.

        Raises:
            RejectedSceneError: The scene does not suffice for a cloud.
            BusyError: Another process is making a needed result, and we do not wait.
        """
        needed = needed_steps(self.chain, self.store, self.manner.keep)
        without: set[str] = set()
        try:
            if self.chain.samples:  # first, so that a rejected flight does not prevent them
                self._sample(needed)
            for flight in self.chain.flights:
                if not flight.variant and not self.store.has(flight.capture.task):  # before the stage is made
                    for step in self._wanted(flight.model, *flight.clouds):
                        self.store.raise_former_failure(step.task, self.manner.retry)
            if not self.chain.samples:
                for step in self._wanted(self.chain.stage):
                    self._make(step, needed)
            for flight in self.chain.flights:
                self._fly(flight, without, needed)
        except RejectedSceneError:
            self._evict(set())
            self._name_clouds(*self.chain.samples)
            raise
        if "report" in self.manner.keep:
            self._make(self.chain.report(frozenset(without)), needed)
            self.outcome.reports.append(self._scene / REPORT)
        self._evict(needed_steps(self.chain, self.store, self.manner.keep))
        self._name_clouds(*self.chain.steps)
        return self.outcome

    def _name_clouds(self, *steps: Step) -> None:
        """Add the clouds of this run to the outcome."""
        clouds = [step for step in self._wanted(*steps) if step.kind == "cloud" and self.store.has(step.task)]
        self.outcome.clouds += [self._scene / step.link for step in clouds]

    def _sample(self, needed: set[str]) -> None:
        """Make the stage and the clouds that are sampled from it."""
        for step in self._wanted(self.chain.stage, *self.chain.samples):
            self._make(step, needed)

    @property
    def _scene(self) -> Path:
        return self.store.root / "scenes" / self.chain.name

    def _fly(self, flight: Flight, without: set[str], needed: set[str]) -> None:
        """Make the wanted results of a flight; add the links of those without result to `without`."""
        left = self._wanted(*flight.steps)
        try:
            while left:
                self._make(left[0], needed)
                left.pop(0)
        except RejectedSceneError as rejection:
            if not flight.variant:
                raise
            without.update(step.link for step in left)
            name = f"{self.chain.name}/{flight.name}"
            self.outcome.rejected[name] = f"{rejection.reason}: {rejection}"  # the other variants continue
            return
        self._forget_others(flight)

    def _wanted(self, *steps: Step | None) -> list[Step]:
        """Choose the steps that this run makes at all."""
        wanted = wanted_steps(self.chain, self.manner.keep)
        return [step for step in steps if step is not None and step.link in wanted]

    def _forget_others(self, flight: Flight) -> None:
        """Remove the links of clouds that the flight no longer has, such as after a change of the mode."""
        links = {step.link for step in flight.clouds}
        for other in flight.possible_links - links:
            self.store.unlink(f"scenes/{self.chain.name}/{other}")

    def _make(self, step: Step, needed: set[str]) -> None:
        if not self.store.has(step.task) and step.link not in needed:
            self.store.raise_former_failure(step.task, self.manner.retry)
            self.outcome.reused += 1  # it existed, and so does everything made from it
            self._tell(step, "done")
            return
        made = self._ensure(step)
        self.outcome.made += made
        self.outcome.reused += not made
        self._tell(step, "done")
        self.store.link(f"scenes/{self.chain.name}/{step.link}", step.task, step.file)

    def _evict(self, needed: set[str]) -> None:
        """Evict results that the run does not keep and no needed step uses."""
        for step in reversed(self.chain.steps):
            waited_for = consumers(self.chain, step)
            if step.kind in self.manner.keep or any(link in needed for link in waited_for):
                continue
            if self.store.has(step.task):
                self.store.evict(step.task, f"scenes/{self.chain.name}/{step.link}")

    def _ensure(self, step: Step) -> bool:
        """Make one result unless it exists; tell whether it was made."""
        if self.store.has(step.task):
            return False
        self.store.raise_former_failure(step.task, self.manner.retry)
        for parent in step.parents.values():
            self._provide(parent)
        return self._work(step)

    def _work(self, step: Step) -> bool:
        """Run a step whose inputs exist."""
        check_space(self.store.root, step.task.stage, step.task.key, self.manner.sizes)
        inputs = {**step.given, **{name: self.store.folder(parent.task) for name, parent in step.parents.items()}}
        stage, begin = STAGES[step.task.stage], time.monotonic()
        self._tell(step, "begun")
        settings = {**step.task.settings, **step.task.manner}
        made = self.store.produce(
            step.task,
            lambda folder: stage.run(settings, inputs, folder, self.progress),
            resume=stage.resumes,
            wait=self.manner.wait,
            quarantine=self.manner.quarantine,
            retry=self.manner.retry,
        )
        event = {"stage": step.task.stage, "key": step.task.key, "scene": self.chain.name, "made": made}
        size = {"bytes": bytes_added(self.store.folder(step.task))} if made else {}
        write_event(self.store.root, {**event, "seconds": time.monotonic() - begin, **size})
        return made

    def _tell(self, step: Step, state: State) -> None:
        self.board.tell(StepEvent(self.chain.name, step.task.stage, step.link, state))

    def _provide(self, step: Step) -> None:
        """Check an input; a damaged one is remade, with the same bytes."""
        former = self.store.evicted_files(step.task)
        if self.store.has(step.task):
            faults = self.store.faults(step.task)
            if not faults:
                return
            self.progress.note(f"{faults[0]}: the result is made again")
            former = self.store.files(step.task)
            self.store.discard(step.task)
        made = self._ensure(step)  # it counts its own results, so it must not be inside the sum
        self.outcome.made += made
        if former is not None and former != self.store.files(step.task):
            self.progress.note(f"{self.store.folder(step.task)}: its bytes differ from the former ones")


def run_scene(
    scenario: Scenario,
    sources: Sources,
    index: int,
    store: Store,
    manner: RunOptions,
    progress: Progress,
    *,
    kind: type[SceneRun] = SceneRun,
    board: Board = NO_BOARD,
) -> Outcome:
    """Run one scene, and record its errors; the other scenes of a scenario continue.

    Args:
        scenario: What to make.
        sources: What it takes from outside.
        index: Number of the scene.
        store: Store of the results.
        manner: Options of the run.
        progress: Listener.
        kind: Class of the scene's run.
        board: Listener for its steps.

    Raises:
        InputError: The error of the only scene of the scenario.
        OutOfSpaceError: The disk is full.
        BusySceneError: Another process is making a needed result, and we do not wait.
    """
    chain = scene_chain(scenario, index, sources)
    scene = kind(store, chain, manner, progress, board)
    try:
        scene.run()
    except RejectedSceneError as rejection:
        scene.outcome.rejected[chain.name] = f"{rejection.reason}: {rejection}"
    except BusyError as error:
        busy = BusySceneError(str(error))
        busy.made = scene.outcome.made
        raise busy from error
    except OutOfSpaceError:
        raise
    except (ChildError, QuarantinedError) as error:
        scene.outcome.failed[chain.name] = str(error)
    except Exception as error:
        if stop := stop_behind(error):
            raise stop from None
        if scenario.scenes == 1:
            raise
        failure = failure_of(error, 1, store.root)  # the random choices of one scene may be inconsistent
        scene.outcome.failed[chain.name] = str(error) if failure is None else failure.message
    state: State = "rejected" if chain.name in scene.outcome.rejected else "done"
    board.tell(StepEvent(chain.name, state="failed" if chain.name in scene.outcome.failed else state))
    return scene.outcome


def blame_scene(scenario: Scenario, sources: Sources, index: int, store: Store, manner: RunOptions) -> str:
    """Record that the processes which make a scene always die, so that the next run skips its missing result.

    Args:
        scenario: What to make.
        sources: What it takes from outside.
        index: Number of the scene.
        store: Store of the results.
        manner: Options of the run.

    Returns:
        One line for people.
    """
    chain = scene_chain(scenario, index, sources)
    needed = needed_steps(chain, store, manner.keep)
    flown = (step for flight in chain.flights for step in flight.steps)
    stage = () if chain.stage is None else (chain.stage,)
    steps = (*stage, *chain.samples, *flown, chain.report(rejected_steps(chain, store)))  # in the order of `run`
    missing = next((step for step in steps if step.link in needed and not store.has(step.task)), None)
    what = "" if missing is None else f" in its {missing.task.stage}"
    message = f"every process that worked on this scene died{what}, such as for lack of memory"
    if missing is not None and manner.quarantine:
        store.blame(missing.task, message)
    return message


def steps_of(chain: Chain, keep: tuple[str, ...]) -> dict[str, int]:
    """Count the results of each stage in a scene.

    Args:
        chain: The steps of the scene.
        keep: Stages whose results are kept.
    """
    wanted = wanted_steps(chain, keep)
    steps = [step for step in chain.steps if step.link in wanted]
    if "report" in keep:
        steps.append(chain.report())
    return dict(Counter(step.task.stage for step in steps))
