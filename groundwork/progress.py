"""How long-running work reports where it is: a protocol that is passed in, and plain implementations."""

from typing import Protocol


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
        """Pass on one line for people (a warning, a figure).

        Args:
            message: One line of text.
        """
        ...


class Silent:
    """A listener that listens to nothing."""

    def stage(self, name: str, total: int) -> None:
        """Ignore the beginning of a stage."""

    def advance(self, done: int) -> None:
        """Ignore a step."""

    def note(self, message: str) -> None:
        """Ignore a line."""


class DistinctNotes:
    """A listener that passes everything on to another one, but each note only once."""

    def __init__(self, progress: Progress) -> None:
        """Pass on from now.

        Args:
            progress: The other listener.
        """
        self._progress, self._said = progress, set[str]()

    def stage(self, name: str, total: int) -> None:
        """Pass on the beginning of a stage.

        Args:
            name: What is being done.
            total: How many units it has; 0 when unknown.
        """
        self._progress.stage(name, total)

    def advance(self, done: int) -> None:
        """Pass on a step.

        Args:
            done: Units finished so far.
        """
        self._progress.advance(done)

    def note(self, message: str) -> None:
        """Pass on a line that was not said yet.

        Args:
            message: One line of text.
        """
        if message not in self._said:
            self._said.add(message)
            self._progress.note(message)


SILENT: Progress = Silent()
