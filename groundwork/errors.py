"""Errors that Falsework raises on purpose, each with its exit code of the command line."""

import errno
from pathlib import PurePath
from typing import ClassVar

_PASSING = frozenset(
    (
        *(errno.EIO, errno.ENXIO, errno.ENODEV, errno.EREMOTEIO, errno.ESTALE, errno.ENOLCK, errno.EROFS),
        *(errno.ETIMEDOUT, errno.ECONNRESET, errno.ENETDOWN, errno.ENETUNREACH, errno.EHOSTDOWN, errno.EHOSTUNREACH),
        *(errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.EAGAIN, errno.EINTR, errno.ENOSPC, errno.EDQUOT),
    )
)
_LONGEST, _LONGEST_LINE = 400, 3000  # characters of a value in an error, and of an error


class FalseworkError(Exception):
    """Base of every error that Falsework raises on purpose.

    Its text is one line that a user can act on: what happened, where, and a hint.
    """

    exit_code: ClassVar[int] = 1


class InputError(FalseworkError, ValueError):
    """Bad input: names the file, the field, the value, what is allowed, and a hint, all in one line.

    Attributes:
        where: File, folder or stage that holds it; None while unknown.
    """

    exit_code: ClassVar[int] = 2

    def __init__(
        self,
        what: str,
        *,
        where: object = None,
        field: str | None = None,
        value: object = None,
        allowed: str | None = None,
        hint: str | None = None,
    ) -> None:
        """Combine the parts in a fixed order.

        Args:
            what: What is wrong, a short sentence without a full stop.
            where: File, folder or stage that holds it.
            field: Key, prim path or column.
            value: The value found.
            allowed: The values that would be right.
            hint: What to do about it.
        """
        parts = [str(where)] if where is not None else []
        if field is not None:
            parts.append(field)
        sentence = what if value is None else f"{what} (found {_shown(value)})"
        if allowed is not None:
            sentence += f"; allowed: {allowed}"
        if hint is not None:
            sentence += f". {hint}"
        parts.append(sentence)
        self.where = where
        super().__init__(_one_line(": ".join(parts)))

    def found_in(self, where: object) -> None:
        """Set the file that the value came from, unless it is known.

        Args:
            where: File, folder or stage that holds it.
        """
        if self.where is None:
            self.where, self.args = where, (_one_line(f"{where}: {self}"),)


class MissingError(InputError, FileNotFoundError):
    """A file or folder that was named does not exist."""


class OutOfSpaceError(FalseworkError, OSError):
    """The disk is full, or would be."""

    exit_code: ClassVar[int] = 4


class ChildError(FalseworkError, RuntimeError):
    """A child process failed, was stopped at a limit, or died of a signal.

    Attributes:
        signal: Name of the signal that it died of, such as `SIGABRT`, or empty.
        last_lines: Its last lines on standard error.
    """

    def __init__(self, text: str, *, signal: str = "", last_lines: tuple[str, ...] = ()) -> None:
        """Store the message with its circumstances.

        Args:
            text: One line for people.
            signal: Name of the signal that it died of, or empty.
            last_lines: Its last lines on standard error.
        """
        super().__init__(text)
        self.signal, self.last_lines = signal, last_lines


class RejectedSceneError(FalseworkError):
    """A scene does not suffice for a cloud (too few cameras, no texture …): a counted result, not a crash.

    Attributes:
        reason: Short reason code, e.g. `too_few_cameras`.
    """

    exit_code: ClassVar[int] = 3  # of a single verb; `run` counts rejections and ends with 0

    def __init__(self, reason: str, message: str) -> None:
        """Store the message with its reason code.

        Args:
            reason: Short reason code in snake_case.
            message: One line for people.
        """
        super().__init__(message)
        self.reason = reason

    def __reduce__(self) -> tuple[type["RejectedSceneError"], tuple[str, str]]:
        return type(self), (self.reason, str(self))  # so that a worker's error reaches the process that asked


def passing_code(error: BaseException) -> int:
    """Find a temporary system error (device, network, full system table) behind an error: a retry may succeed.

    Args:
        error: The exception, raised from or while handling another error.

    Returns:
        The system's error number; 0 if a retry must fail in the same way.
    """
    seen: set[int] = set()
    behind: BaseException | None = error
    while behind is not None and id(behind) not in seen:
        seen.add(id(behind))
        if isinstance(behind, OSError) and behind.errno in _PASSING:
            return behind.errno
        behind = behind.__cause__ or behind.__context__
    return 0


def show_place(error: BaseException, work: object, place: object) -> None:
    """Let an error name the place that the user chose, where it names the temporary one in which we worked.

    Args:
        error: Any exception; only ours are changed.
        work: Temporary file or folder, which does not exist when the user reads the error.
        place: Its final place.
    """
    if isinstance(error, FalseworkError):
        error.args = tuple(
            part.replace(str(work), str(place)) if isinstance(part, str) else part for part in error.args
        )
    if isinstance(error, InputError) and isinstance(error.where, str | PurePath):
        error.where = type(error.where)(str(error.where).replace(str(work), str(place)))


def _shown(value: object) -> str:
    """Format a value; of a very long one, only its two ends."""
    try:
        text = repr(value)
    except ValueError:  # an integer of more digits than Python spells
        return "a number of thousands of digits"
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST // 2]} … {text[-_LONGEST // 2 :]}"


def _one_line(text: str) -> str:
    """Join the words by single blanks; control characters and invalid UTF-8 become question marks."""
    words = " ".join(text.split())
    if len(words) > _LONGEST_LINE:
        words = f"{words[: _LONGEST_LINE // 2]} … {words[-_LONGEST_LINE // 3 :]}"
    return words if words.isprintable() else "".join(one if one.isprintable() else "?" for one in words)
