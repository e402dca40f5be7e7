"""Progress of a run: the table of stages and scenes on a terminal, else a plain line from time to time."""

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
            costs: Costs of results so far.
            console: Console to draw on; None: standard error.
        """
        self._console = console or Console(stderr=True)
        self._table, self._lock = RunTable(costs.seconds), threading.RLock()
        self._live: Live | None = None
        self._plain: ConsoleProgress | None = None
        self._now = StepEvent("")
        self._phase, self._total, self._many, self._here, self._spoke = "", 0, False, True, time.monotonic()

    def __enter__(self) -> "RunConsole":
        """Start drawing."""
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
        """Draw for the last time; unfinished work stays visible.

        Args:
            kind: Type of the exception that ends the block, or None.
            error: That exception.
            trace: Its traceback.
        """
        if self._live is not None:
            self._live.stop()
        if self._plain is not None:
            self._plain.__exit__(kind, error, trace)

    def expect(self, scenes: Sequence[str], steps: Mapping[str, int], workers: int) -> None:
        """Set the work to do.

        Args:
            scenes: Numbers of the scenes.
            steps: Name of each stage to the number of its results in one scene.
            workers: Number of scenes processed in parallel by other processes; 0: by this one.
        """
        with self._lock:
            self._table.expect(scenes, steps, workers)
            self._many, self._here = len(scenes) > 1, workers == 0

    def tell(self, event: StepEvent) -> None:
        """Add an event.

        Args:
            event: The event.
        """
        with self._lock:
            self._table.tell(event)
            if event.state == "begun" and event.stage:
                self._now = event
            if self._plain is not None and self._many and not event.stage:
                self._say_now_and_then()

    def stage(self, name: str, total: int) -> None:
        """Begin a phase of the current step.

        Args:
            name: What is being done.
            total: How many units it has; 0 when unknown.
        """
        with self._lock:
            self._phase, self._total = name, total
            if not self._here:
                return  # the table shows it
            if self._plain is not None:
                self._plain.stage(name, total)
            elif self._now.stage:
                self._table.tell(detailed(self._now, name, 0, 0))

    def advance(self, done: int) -> None:
        """Report the progress of the phase.

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
