"""Errors of a step's child process that ran out of disk, memory or time: one line that says what to change."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from groundwork.errors import ChildError, OutOfSpaceError

_NOTHING_LEFT = 8e6  # [bytes] with less free space than this, any of COLMAP's errors is reported as a full disk
_DISK_SIGNS = (
    "no space left",
    "No space left",
    "disk I/O error",
    "database or disk is full",
    "File too large",
)


@contextmanager
def plain_shortage(folder: Path, section: str, more: str = "") -> Iterator[None]:
    """Replace a child's error by one line that says what to change: its own message may only name a line of C++.

    Args:
        folder: Folder that the child writes to; its parent exists.
        section: Part of the settings that holds `memory_limit` and `seconds_per_image`.
        more: Further advice for saving memory.

    Raises:
        OutOfSpaceError: The disk is full.
        ChildError: Any other cause.
    """
    try:
        yield
    except ChildError as error:
        text = str(error)
        full = shutil.disk_usage(folder.parent).free < _NOTHING_LEFT
        if full or any(sign in text for sign in _DISK_SIGNS):
            raise OutOfSpaceError(
                f"{folder.parent}: no space left on the disk. Free some space, then run the same command again"
            ) from None
        if "of memory" in text:
            raise ChildError(f"{text}: [{section}] memory_limit{more}") from None
        if "ran longer" in text:
            raise ChildError(f"{text}: [{section}] seconds_per_image; what is finished stays") from None
        raise


def check_space(folder: Path, needed: int, what: str) -> None:
    """Refuse to begin a step if the disk has too little space.

    Args:
        folder: Existing folder on that disk.
        needed: Upper limit of what the step writes [bytes].
        what: The step, for the message.

    Raises:
        OutOfSpaceError: Less is free.
    """
    free = shutil.disk_usage(folder).free
    if free < needed:
        raise OutOfSpaceError(
            f"{folder}: {free / 1e9:.1f} GB are free, {what} may need {needed / 1e9:.1f} GB. "
            "Free some space, then run the same command again"
        )
