"""Kernel locks on files, which are released when their process ends."""

import errno
import fcntl
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from groundwork.errors import FalseworkError, InputError

_NO_LOCKS = (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS)  # errors of file systems without locks


class BusyError(FalseworkError):
    """Another process holds a lock, and the caller does not wait for it."""


@contextmanager
def hold_lock(path: Path, *, wait: bool = True) -> Iterator[bool]:
    """Hold a kernel lock on a file; the holder may remove the file.

    A file system without locks is reported once. There, leftovers of other processes must not be removed, and new files
    need unique names.

    Args:
        path: The lock file; made if missing. Its folder must exist.
        wait: Wait until another holder releases it.

    Yields:
        True, or False on a file system without locks.

    Raises:
        BusyError: Another process holds it, and we do not wait.
        InputError: The path exists and is not a lock file.
    """
    try:
        handle, held = open_locked(path, wait=wait)
    except (IsADirectoryError, FileNotFoundError) as error:
        raise _in_the_way(path) from error
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise _in_the_way(path) from error
        raise
    if not held:
        _say_no_locks(_mount_point(path))
    try:
        yield held
    finally:
        os.close(handle)


def open_locked(path: Path, *, wait: bool = True) -> tuple[int, bool]:
    """Open a file and lock it; closing the handle releases the lock.

    Args:
        path: The lock file; made if missing, and never a link.
        wait: Wait until another holder releases it.

    Returns:
        A handle of the file at this path, and whether it is locked: False on a file system without locks.

    Raises:
        BusyError: Another process holds it, and we do not wait.
        OSError: It cannot be opened.
    """
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
            if _is_at(handle, path):
                return handle, True
        except BlockingIOError:
            os.close(handle)
            raise BusyError(f"{path}: another process holds this lock") from None
        except OSError as error:
            if error.errno in _NO_LOCKS:
                return handle, False
            os.close(handle)
            raise
        except BaseException:  # interrupted while it waited
            os.close(handle)
            raise
        os.close(handle)  # its holder removed it between our two calls


def _is_at(handle: int, path: Path) -> bool:
    """Tell whether an open file still has its name."""
    try:
        return os.path.samestat(os.fstat(handle), path.stat())
    except FileNotFoundError:
        return False


def _in_the_way(path: Path) -> InputError:
    return InputError("not a lock file of Falsework, but at its place", where=path, hint="Move it elsewhere")


def _mount_point(path: Path) -> Path:
    """Name the file system that a path lies on by its uppermost folder."""
    folder = path.resolve().parent
    while not folder.is_mount():
        folder = folder.parent
    return folder


@cache
def _say_no_locks(mount: Path) -> None:
    sys.stderr.write(
        f"falsework: {mount}: this file system has no file locks: several processes may make the same result, and "
        "leftovers of killed processes stay\n"
    )
