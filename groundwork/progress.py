"""Progress reporting of long work: the listener protocol, and simple implementations."""

from typing import Protocol

_PRECISE, _SHORT = 10.0, 120.0  # [s] times that are shorter when rounded are shown in tenths, and in seconds
_LONG = 120  # [min] those shorter than this in minutes


class Progress(Protocol):
    """Listener for the progress of one piece of work."""

    def stage(self, name: str, total: int) -> None:
        """Begin a stage.

        Args:
            name: What is being done, e.g. `render`.
            total: How many units it has; 0 when unknown.
        """
        ...

    def advance(self, done: int) -> None:
        """Report how far the current stage is.

        Args:
            done: Units finished so far.
        """
        ...

    def note(self, message: str) -> None:
        """Report one line for people (a warning, a figure).

        Args:
            message: One line of text.
        """
        ...


class Silent:
    """A listener that ignores everything."""

    def stage(self, name: str, total: int) -> None:
        """Ignore the beginning of a stage."""

    def advance(self, done: int) -> None:
        """Ignore a step."""

    def note(self, message: str) -> None:
        """Ignore a line."""


class DistinctNotes:
    """A listener that forwards everything to another one, but each note only once."""

    def __init__(self, progress: Progress) -> None:
        """Forward to another listener.

        Args:
            progress: The other listener.
        """
        self._progress, self._said = progress, set[str]()

    def stage(self, name: str, total: int) -> None:
        """Forward the beginning of a stage.

        Args:
            name: What is being done.
            total: How many units it has; 0 when unknown.
        """
        self._progress.stage(name, total)

    def advance(self, done: int) -> None:
        """Forward a step.

        Args:
            done: Units finished so far.
        """
        self._progress.advance(done)

    def note(self, message: str) -> None:
        """Forward a line that was not reported yet.

        Args:
            message: One line of text.
        """
        if message not in self._said:
            self._said.add(message)
            self._progress.note(message)


SILENT: Progress = Silent()


def duration(seconds: float) -> str:
    """Format a duration for people.

    Args:
        seconds: The time [s].
    """
    if round(seconds, 1) < _PRECISE:
        return f"{seconds:.1f} s"
    if round(seconds) < _SHORT:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < _LONG else f"{seconds / 3600.0:.1f} h"
