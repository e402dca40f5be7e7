"""Progress for people on standard error: a live line on a terminal, else a plain line from time to time."""

import sys
import time
from types import TracebackType

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from groundwork.progress import duration

PLAIN_INTERVAL = 10.0  # [s] between two lines of one stage if the output is not a terminal


class ConsoleProgress:
    """A listener that shows the stage, the count and the remaining time; use it as a context manager."""

    def __init__(self) -> None:
        """Choose the live line on a terminal and plain lines elsewhere."""
        console = Console(stderr=True)
        self._live = Progress(
            TextColumn("{task.description:<28}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=console,
            disable=not console.is_terminal,
        )
        self._plain = not console.is_terminal
        self._task: TaskID | None = None
        self._name, self._total, self._done = "", 0, 0
        self._begin = self._spoke = time.monotonic()
        self._first: tuple[float, int] | None = None  # when the first units were done, and how many

    def __enter__(self) -> "ConsoleProgress":
        """Start the live line."""
        self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Finish the last stage and the live line.

        Args:
            kind: Type of the exception that ends the block, or None.
            error: That exception.
            trace: Its traceback.
        """
        if kind is None:
            self._finish()
        self._live.stop()

    def stage(self, name: str, total: int) -> None:
        """Begin a stage.

        Args:
            name: What is being done.
            total: How many units it has; 0 when unknown.
        """
        self._finish()
        self._name, self._total, self._done, self._first = name, total, 0, None
        self._begin = self._spoke = time.monotonic()
        self._task = self._live.add_task(name, total=total or None)

    def advance(self, done: int) -> None:
        """Report how far the current stage is.

        Args:
            done: Units finished so far.
        """
        self._done = done
        if self._task is not None:
            self._live.update(self._task, completed=done)
        now = time.monotonic()
        if self._plain and now - self._spoke >= PLAIN_INTERVAL and done:
            self._spoke = now
            self._say(f"{self._name}: {done}/{self._total}{self._left(now)}")
        if self._first is None and done:
            self._first = (now, done)

    def note(self, message: str) -> None:
        """Print one line above the live one.

        Args:
            message: One line of text.
        """
        if self._plain:
            self._say(message)
        else:
            self._live.console.print(message, markup=False, highlight=False)

    def _left(self, now: float) -> str:
        """Estimate the time left from the rate after the first unit, which includes imports and loading."""
        if self._first is None or self._done <= self._first[1]:
            return ""
        rate = (now - self._first[0]) / (self._done - self._first[1])
        return f", about {duration(rate * (self._total - self._done))} left"

    def _finish(self) -> None:
        if self._task is not None:
            count = max(self._total, self._done, 1)
            self._live.update(self._task, total=count, completed=count)
            if self._plain:
                self._say(f"{self._name}: done in {time.monotonic() - self._begin:.1f} s")
        self._task = None

    def _say(self, line: str) -> None:
        sys.stderr.write(line + "\n")
        sys.stderr.flush()
