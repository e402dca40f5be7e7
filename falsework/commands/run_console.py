"""A run as it is seen: the table of stages and scenes on a terminal, a plain line now and then elsewhere."""

import sys
import threading
import time
from collections.abc import Mapping, Sequence
from types import TracebackType

from rich.console import Console, RenderableType
from rich.live import Live

from falsework.commands.console import PLAIN_INTERVAL, ConsoleProgress
from falsework.commands.run_table import RunTable
from falsework.execution.board import StepEvent, detailed
from falsework.execution.costs import Costs

REDRAWN = 2.0  # [1/s]


class RunConsole:
    """A listener for the progress of a run and for its steps; use it as a context manager."""

    def __init__(self, costs: Costs, console: Console | None = None) -> None:
        """Choose the table on a terminal and plain lines elsewhere.

        Args:
            costs: What results have cost so far.
            console: Where to draw; standard error when None.
        """
        self._console = console or Console(stderr=True)
        self._table, self._lock = RunTable(costs.seconds), threading.RLock()
        self._live: Live | None = None
        self._plain: ConsoleProgress | None = None
        self._now = StepEvent("")
        self._phase, self._total, self._many, self._here, self._spoke = "", 0, False, True, time.monotonic()

    def __enter__(self) -> "RunConsole":
        """Begin to draw."""
        if self._console.is_terminal:
            self._live = Live(
                get_renderable=self._draw,
                console=self._console,
                refresh_per_second=REDRAWN,
                redirect_stdout=False,
                redirect_stderr=False,
            )
            self._live.start()
        else:
            self._plain = ConsoleProgress()
            self._plain.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Draw for the last time; what was in work stays to be seen.

        Args:
            kind: Type of an exception on its way, or None.
            error: That exception.
            trace: Its trace.
        """
        if self._live is not None:
            self._live.stop()
        if self._plain is not None:
            self._plain.__exit__(kind, error, trace)

    def expect(self, scenes: Sequence[str], steps: Mapping[str, int], workers: int) -> None:
        """Take in what there is to do.

        Args:
            scenes: Numbers of the scenes.
            steps: Name of each stage to the number of its results in one scene.
            workers: How many scenes are worked on at once in other processes; 0 where this one does the work.
        """
        with self._lock:
            self._table.expect(scenes, steps, workers)
            self._many, self._here = len(scenes) > 1, workers == 0

    def tell(self, told: StepEvent) -> None:
        """Take in one thing that happened.

        Args:
            told: What happened.
        """
        with self._lock:
            self._table.tell(told)
            if told.state == "begun" and told.stage:
                self._now = told
            if self._plain is not None and self._many and not told.stage:
                self._say_now_and_then()

    def stage(self, name: str, total: int) -> None:
        """Begin a piece of the step that is in work.

        Args:
            name: What is being done.
            total: How many units it has; 0 when unknown.
        """
        with self._lock:
            self._phase, self._total = name, total
            if not self._here:
                return  # the table tells it
            if self._plain is not None:
                self._plain.stage(name, total)
            elif self._now.stage:
                self._table.tell(detailed(self._now, name, 0, 0))

    def advance(self, done: int) -> None:
        """Report how far it is.

        Args:
            done: Units finished so far.
        """
        with self._lock:
            if not self._here:
                return
            if self._plain is not None:
                self._plain.advance(done)
            elif self._now.stage:
                self._table.tell(detailed(self._now, self._phase, done, self._total))

    def note(self, message: str) -> None:
        """Print one line above the table.

        Args:
            message: One line of text.
        """
        if self._plain is not None:
            self._plain.note(message)
        else:
            self._console.print(message, markup=False, highlight=False)

    def _draw(self) -> RenderableType:
        with self._lock:
            return self._table.drawn()

    def _say_now_and_then(self) -> None:
        now = time.monotonic()
        if now - self._spoke >= PLAIN_INTERVAL:
            self._spoke = now
            sys.stderr.write(self._table.line() + "\n")
            sys.stderr.flush()
