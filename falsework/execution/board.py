"""Events of a running run: which steps of which scenes have begun, ended, or existed already."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

State = Literal["begun", "done", "rejected", "failed"]


@dataclass(frozen=True)
class StepEvent:
    """One event of a run.

    Attributes:
        scene: Number of the scene, four digits.
        stage: Stage of the step; empty for the whole scene.
        link: Name of the step, e.g. `capture/local`.
        state: State of the step or scene.
        detail: Current phase and its progress, such as `features 36 %`; empty if unknown.
    """

    scene: str
    stage: str = ""
    link: str = ""
    state: State = "begun"
    detail: str = ""


class Board(Protocol):
    """Listener for the steps of a run."""

    def expect(self, scenes: Sequence[str], steps: Mapping[str, int], workers: int) -> None:
        """Set the work to do.

        Args:
            scenes: Numbers of the scenes, four digits each.
            steps: Name of each stage to the number of its results in one scene.
            workers: Number of scenes processed in parallel by other processes; 0: by this one.
        """
        ...

    def tell(self, event: StepEvent) -> None:
        """Add an event; called from any thread.

        Args:
            event: The event.
        """
        ...


class SilentBoard:
    """A board that shows nothing."""

    def expect(self, scenes: Sequence[str], steps: Mapping[str, int], workers: int) -> None:
        """Ignore the work to do."""

    def tell(self, event: StepEvent) -> None:
        """Ignore an event."""


NO_BOARD: Board = SilentBoard()


def detailed(step: StepEvent, phase: str, done: int, total: int) -> StepEvent:
    """Make the event of a step's progress.

    Args:
        step: The step.
        phase: Name of the phase.
        done: Units finished so far.
        total: Number of units; 0 if unknown.
    """
    share = f" {100 * min(done, total) // total} %" if total else ""
    return StepEvent(step.scene, step.stage, step.link, "begun", f"{phase}{share}")
