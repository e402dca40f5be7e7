"""The lock of an output folder, so that it has one writer at a time."""

import errno
import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from groundwork.errors import InputError
from groundwork.files import sync
from groundwork.locks import BusyError, open_locked
from groundwork.marks import MARK, NEXT, TEMPORARY

LOCK = f"{TEMPORARY}lock"
_TRIES = 100  # attempts while other commands create and remove the folder
_ELSEWHERE = "Choose another folder with -o"


@contextmanager
def sole_writer(place: Path) -> Iterator[Path]:
    """Make an output folder and the work folder inside it, and hold its lock.

    Folders that are empty afterwards are removed again.

    Args:
        place: Folder of the output, with links resolved.

    Returns:
        The folder `.next`, inside it.

    Raises:
        InputError: Another command holds the lock, or a file of the user is in the way.
    """
    made = [folder for folder in (place, *place.parents) if not folder.exists()]
    work = place / NEXT
    handle, is_held = _enter(place, work)
    if not is_held:
        sys.stderr.write(
            f"falsework: {place}: this file system has no file locks: start no second command on this folder\n"
        )
    try:
        for folder in made:
            sync(folder.parent)
        yield work
    finally:
        leave(work, handle, made)


def leave(work: Path, handle: int, made: Iterable[Path] = ()) -> None:
    """Release the lock, and remove the folder if it is empty.

    Args:
        work: The folder `.next`.
        handle: The lock.
        made: Parent folders to remove with it, innermost first.
    """
    try:
        with suppress(OSError):  # another process has added something
            if [path.name for path in work.iterdir()] == [LOCK]:
                (work / LOCK).unlink()
                for folder in (work, *made):
                    folder.rmdir()
    finally:
        os.close(handle)


def lock_if_free(work: Path) -> int | None:
    """Take the lock of an existing output, for a reader.

    Args:
        work: Its folder `.next`.

    Returns:
        A handle for `leave`, or None if another process holds the lock, or it cannot be locked.
    """
    try:
        handle, is_held = open_locked(work / LOCK, wait=False)
    except (OSError, BusyError):  # also on a read-only disk; or finished meanwhile
        return None
    if is_held:
        return handle
    os.close(handle)
    return None


def _enter(place: Path, work: Path) -> tuple[int, bool]:
    """Open the lock file and lock it; tell whether the file system supports locks."""
    for _ in range(_TRIES):
        try:
            place.mkdir(parents=True, exist_ok=True)
            _make_work(work)
            return open_locked(work / LOCK, wait=False)
        except FileNotFoundError:
            continue  # its holder removed it between our calls
        except BusyError:
            raise InputError(
                "another command is writing this folder",
                where=place,
                hint="Wait for it to end, or choose another folder with -o",
            ) from None
        except (IsADirectoryError, FileExistsError, NotADirectoryError):
            raise InputError(
                "is at the place of our work folder", where=work, hint=f"Move it elsewhere. {_ELSEWHERE}"
            ) from None
        except OSError as error:
            if error.errno != errno.ELOOP:
                raise
            raise InputError("is a link", where=work / LOCK, hint="Remove it") from None
    raise InputError("not writable", where=place.parent, hint=_ELSEWHERE)  # such as /proc, despite its permissions


def _make_work(work: Path) -> None:
    """Make the folder, or check that an existing one is ours: it has our mark, or is empty."""
    work.mkdir(exist_ok=True)
    if work.is_symlink():
        raise FileExistsError
    if not (work / MARK).is_file() and any(not path.name.startswith(TEMPORARY) for path in work.iterdir()):
        raise FileExistsError
