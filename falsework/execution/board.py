"""What a run tells of itself while it works: which steps of which scenes have begun, ended, or were there already."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

State = Literal["begun", "done", "rejected", "failed"]


@dataclass(frozen=True)
class StepEvent:
    """One thing that happened.

    Attributes:
        scene: Number of the scene, four digits.
        stage: Stage of the step; empty where the whole scene is meant.
        link: Which of the scene's steps of that stage, e.g. `capture/local`.
        state: What became of it.
        detail: What is being done just now and how far it is, such as `features 36 %`; empty when unknown.
    """

    scene: str
    stage: str = ""
    link: str = ""
    state: State = "begun"
    detail: str = ""


class Board(Protocol):
    """Listener for the steps of a run."""

    def expect(self, scenes: Sequence[str], steps: Mapping[str, int], workers: int) -> None:
        """Take in what there is to do.

        Args:
            scenes: Numbers of the scenes, four digits each.
            steps: Name of each stage to the number of its results in one scene.
            workers: How many scenes are worked on at once in other processes; 0 where this one does the work.
        """
        ...

    def tell(self, told: StepEvent) -> None:
        """Take in one thing that happened; called from any thread.

        Args:
            told: What happened.
        """
        ...


class SilentBoard:
    """A board that shows nothing."""

    def expect(self, scenes: Sequence[str], steps: Mapping[str, int], workers: int) -> None:
        """Ignore what there is to do."""

    def tell(self, told: StepEvent) -> None:
        """Ignore what happened."""


NO_BOARD: Board = SilentBoard()


def detailed(told: StepEvent, phase: str, done: int, total: int) -> StepEvent:
    """Say what a step that is in work is doing.

    Args:
        told: The step.
        phase: What is being done.
        done: Units finished so far.
        total: How many there are; 0 when unknown.
    """
    share = f" {100 * min(done, total) // total} %" if total else ""
    return StepEvent(told.scene, told.stage, told.link, "begun", f"{phase}{share}")
