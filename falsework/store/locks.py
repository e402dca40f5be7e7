"""One process at a time makes a result: kernel locks that fall with their holder, and can be asked without waiting."""

import errno
import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from groundwork.errors import FalseworkError, InputError

NO_LOCKS = (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS)


class BusyError(FalseworkError):
    """Another process is making this result.

    Attributes:
        made: How many results of the same scene had been made before.
    """

    made = 0


@contextmanager
def exclusive(path: Path, *, wait: bool = True) -> Iterator[bool]:
    """Hold a kernel lock; whoever holds it may remove the lock file.

    Args:
        path: The lock file; made where it is not there.
        wait: Wait for another holder to end.

    Yields:
        True, or False on a file system without locks.

    Raises:
        BusyError: Another process holds it, and we do not wait.
        InputError: Something else stands there.
    """
    handle, held = _locked(path, wait)
    try:
        yield held
    finally:
        os.close(handle)


def _locked(path: Path, wait: bool) -> tuple[int, bool]:
    while True:
        try:
            handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)
        except (IsADirectoryError, FileNotFoundError) as error:
            raise InputError("is in the way of a lock", where=path, mend="Move it elsewhere") from error
        except OSError as error:
            if error.errno == errno.ELOOP:
                raise InputError("is in the way of a lock", where=path, mend="Move it elsewhere") from error
            raise
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            os.close(handle)
            raise BusyError(f"{path}: another process is making this result") from None
        except OSError as error:
            if error.errno in NO_LOCKS:
                return handle, False
            os.close(handle)
            raise
        except BaseException:  # interrupted while it waited
            os.close(handle)
            raise
        try:
            if os.path.samestat(os.fstat(handle), path.stat()):
                return handle, True
        except FileNotFoundError:
            pass
        os.close(handle)  # its former holder removed it between our two calls
