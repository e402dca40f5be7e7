"""`OUT/work`: one locked folder for each unfinished result; folders that no run can resume are removed."""

import os
import secrets
import shutil
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import chain
from pathlib import Path

from groundwork.errors import InputError
from groundwork.locks import BusyError, hold_lock

LINKS = "link"  # in place of a key, for links that replace others
DAMAGED = "aside"  # suffix of the key of a result that was set aside


@contextmanager
def work_folder(root: Path, key: str, *, wait: bool = True) -> Iterator[Path]:
    """Yield the locked folder in which a result is made, so that only one process makes it.

    Args:
        root: Output folder of the run.
        key: Key of the result.
        wait: Wait for another process that is making it.

    Yields:
        `work/<key>`, which may hold files of an interrupted attempt; on a file system without locks a folder with a
        unique name.

    Raises:
        BusyError: Another process is making it, and we do not wait.
    """
    room = root / "work"
    room.mkdir(parents=True, exist_ok=True)
    lock = room / f"{key}.lock"
    with hold_lock(lock, wait=wait) as held:
        try:
            yield room / (key if held else f"{key}.{secrets.token_hex(8)}")
        finally:
            if held:
                lock.unlink(missing_ok=True)


def sweep(root: Path, finished: Callable[[str], bool]) -> None:
    """Remove leftovers of killed processes that cannot be resumed.

    Args:
        root: Output folder of the run.
        finished: Tells whether the result of a key exists, or will never exist.
    """
    room = root / "work"
    if not room.is_dir():
        return
    for key in sorted({path.name.partition(".")[0] for path in room.iterdir()}):
        lock = room / f"{key}.lock"
        try:
            with hold_lock(lock, wait=False) as held:
                if held:
                    _sweep_one(room, key, finished)
                    lock.unlink(missing_ok=True)
        except (BusyError, InputError):  # another process holds it, or it is not ours
            continue


def _sweep_one(room: Path, key: str, finished: Callable[[str], bool]) -> None:
    remove(room / f"{key}.{DAMAGED}")
    if key == LINKS:
        for path in sorted(room.glob(f"{LINKS}.*")):
            if path.is_symlink():
                path.unlink()
    elif finished(key):
        remove(room / key)


def set_aside(folder: Path, work: Path) -> None:
    """Remove a stored result: its name at once, its files afterwards.

    Args:
        folder: The result, or anything else in its place.
        work: The locked work folder of its key.
    """
    aside = work.with_name(f"{work.name}.{DAMAGED}")
    remove(aside)
    folder.rename(aside)
    remove(aside)


def plain_files(path: Path) -> Iterator[os.stat_result]:
    """Describe each regular file of a folder, or a single file; links and files that disappear meanwhile are skipped.

    Args:
        path: File or folder; it need not exist.
    """
    tops = [str(path)] if not path.is_dir() else []
    names = (os.path.join(folder, name) for folder, _, files in os.walk(path) for name in files)  # noqa: PTH118
    for name in chain(tops, () if path.is_symlink() else names):
        with suppress(FileNotFoundError):
            found = os.lstat(name)
            if stat.S_ISREG(found.st_mode):
                yield found


def remove(path: Path) -> None:
    """Remove a file, link or folder, if it exists.

    Args:
        path: Path to remove.
    """
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
