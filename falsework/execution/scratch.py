"""The folder that Dask's workers need beside the results: in the temporary folder, removed also after a kill."""

import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from groundwork.errors import InputError
from groundwork.locks import BusyError, hold_lock

PREFIX, LOCK = "falsework-workers-", "run.lock"
_YOUNG = 60.0  # [s] age up to which a folder may be one whose run is about to lock it


@contextmanager
def scratch_folder() -> Iterator[str]:
    """Make a folder that is removed at the end; those that killed runs of this user left are removed first."""
    _sweep(Path(tempfile.gettempdir()))
    # The sweep of another run may lock the folder, and make the lock's file again, while this run removes it.
    removed = tempfile.TemporaryDirectory(prefix=PREFIX, ignore_cleanup_errors=True)
    with removed as scratch, hold_lock(Path(scratch) / LOCK):
        yield scratch


def _sweep(parent: Path) -> None:
    for folder in sorted(parent.glob(f"{PREFIX}*")):
        with suppress(OSError, BusyError, InputError):  # in use, of another user, or gone meanwhile
            seen = folder.lstat()
            lock = folder / LOCK
            if seen.st_uid != os.getuid() or time.time() - seen.st_mtime < _YOUNG or not lock.is_file():
                continue
            with hold_lock(lock, wait=False) as held:
                if held:
                    shutil.rmtree(folder)
