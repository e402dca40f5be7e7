"""State of a run: a table of stages and scenes, its rate and the remaining time; drawn, or as one line."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from rich.console import Group
from rich.table import Table
from rich.text import Text

from falsework.execution.board import StepEvent
from groundwork.progress import duration

MOST_ROWS = 12  # scenes shown at a time: those being processed, then those that ended last
_MANY = 100.0  # [1/h] rates above are shown without a decimal


@dataclass
class _Scene:
    done: dict[str, set[str]] = field(default_factory=dict)
    details: dict[str, str] = field(default_factory=dict)
    state: str = ""
    seen: int = 0


@dataclass
class RunTable:
    """The state of a run, from its events.

    Attributes:
        seconds_of: Returns the mean time of a result of a stage [s].
        clock: Returns the time [s].
    """

    seconds_of: Callable[[str], float]
    clock: Callable[[], float] = time.monotonic
    _scenes: dict[str, _Scene] = field(default_factory=dict)
    _steps: dict[str, int] = field(default_factory=dict)
    _workers: int = 1
    _begin: float = 0.0
    _told: int = 0
    _worked: set[str] = field(default_factory=set)

    def expect(self, scenes: Sequence[str], steps: Mapping[str, int], workers: int) -> None:
        """Set the work to do.

        Args:
            scenes: Numbers of the scenes.
            steps: Name of each stage to the number of its results in one scene.
            workers: Number of scenes processed in parallel by other processes; 0: by this one.
        """
        self._scenes, self._steps = {name: _Scene() for name in scenes}, dict(steps)
        self._workers, self._begin = max(workers, 1), self.clock()

    def tell(self, event: StepEvent) -> None:
        """Add an event.

        Args:
            event: The event.
        """
        scene = self._scenes.get(event.scene)
        if scene is None:
            return
        self._told += 1
        scene.seen = self._told
        if not event.stage:
            scene.state = event.state
            scene.details.clear()
        elif event.state == "done":
            scene.done.setdefault(event.stage, set()).add(event.link)
            scene.details.pop(event.stage, None)
        else:
            scene.details[event.stage] = event.detail or "…"
            self._worked.add(event.scene)

    @property
    def ended(self) -> int:
        """Number of scenes that have ended, successfully or not."""
        return sum(scene.state != "" for scene in self._scenes.values())

    @property
    def rate(self) -> float:
        """Rate of processed scenes [1/h]."""
        ended = sum(self._scenes[name].state != "" for name in self._worked)
        return 3600.0 * ended / max(self.clock() - self._begin, 1e-3)

    @property
    def seconds_left(self) -> float:
        """Remaining time from the mean time of each stage [s]; scenes of other jobs count as not begun."""
        left = 0.0
        for stage, each in self._steps.items():
            missing = sum(each - len(scene.done.get(stage, ())) for scene in self._scenes.values() if not scene.state)
            left += max(missing, 0) * self.seconds_of(stage)
        open_scenes = len(self._scenes) - self.ended
        return left / max(min(self._workers, open_scenes), 1)

    def summary(self) -> str:
        """Summarize the progress in one line."""
        bad = {state: sum(scene.state == state for scene in self._scenes.values()) for state in ("rejected", "failed")}
        parts = [f"{self.ended} of {len(self._scenes)} scenes"]
        parts += [f"{count} {state}" for state, count in bad.items() if count]
        if self.rate > 0:
            parts.append(f"{self.rate:,.1f} per hour" if self.rate < _MANY else f"{self.rate:,.0f} per hour")
        if self.ended < len(self._scenes):
            parts.append(f"about {duration(self.seconds_left)} left")
        return ", ".join(parts)

    def line(self) -> str:
        """Describe the whole state in one line, for output that is not a terminal."""
        counts = ", ".join(f"{stage} {self._count(stage)}" for stage in self._steps)
        return f"{self.summary()} ({counts})"

    def drawn(self) -> Group:
        """Draw the scenes being processed and those that ended last, the sums below, and the summary."""
        if not self._steps:
            return Group()
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold", show_footer=True)
        table.add_column("scene", footer="all")
        for stage in self._steps:
            table.add_column(stage, footer=self._count(stage), min_width=12)
        table.add_column("")
        for name in self._shown():
            scene = self._scenes[name]
            table.add_row(name, *(self._cell(scene, stage) for stage in self._steps), scene.state.replace("done", ""))
        return Group(table, Text(self.summary()))

    def _shown(self) -> list[str]:
        """Choose the scenes to show: those being processed first, then the latest; in the order of their numbers."""
        known = [name for name, scene in self._scenes.items() if scene.seen]
        known.sort(key=lambda name: (self._scenes[name].state != "", -self._scenes[name].seen))
        return sorted(known[:MOST_ROWS])

    def _cell(self, scene: _Scene, stage: str) -> str:
        done, each = len(scene.done.get(stage, ())), self._steps[stage]
        if stage in scene.details:
            return f"{done}/{each} {scene.details[stage]}" if each > 1 else scene.details[stage]
        if done >= each:
            return "done"
        return f"{done}/{each}" if done else "-"

    def _count(self, stage: str) -> str:
        done = sum(min(len(scene.done.get(stage, ())), self._steps[stage]) for scene in self._scenes.values())
        return f"{done}/{self._steps[stage] * len(self._scenes)}"
