"""`OUT/work`: one locked folder for each unfinished result; those without a holder are removed."""

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

LINKS = "link"  # stands where a key stands, for links that are about to replace others
DAMAGED = "aside"  # what follows the key of a result that was set aside


@contextmanager
def work_folder(root: Path, key: str, *, wait: bool = True) -> Iterator[Path]:
    """Give the folder to make a result in, under a lock: one process makes a result.

    Args:
        root: Output folder of the run.
        key: Key of the result.
        wait: Wait for another process that makes it.

    Yields:
        `work/<key>`, in which an interrupted try may have left something; on a file system without locks one that
        nobody else knows.

    Raises:
        BusyError: Another process makes it, and we do not wait.
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
    """Remove what killed processes left and no process can resume.

    Args:
        root: Output folder of the run.
        finished: Tells of a key whether its result is there, or will never be.
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
        except (BusyError, InputError):  # somebody works there; or something stands there that is not ours
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
    """Take a stored result away: gone at once, its bytes a little later.

    Args:
        folder: The result, or whatever stands in its place.
        work: The work folder of its key, in our hands.
    """
    aside = work.with_name(f"{work.name}.{DAMAGED}")
    remove(aside)
    folder.rename(aside)
    remove(aside)


def plain_files(path: Path) -> Iterator[os.stat_result]:
    """Describe each plain file of a folder, or that file alone; what goes meanwhile is left out, as are links.

    Args:
        path: File or folder; need not be there.
    """
    tops = [str(path)] if not path.is_dir() else []
    names = (os.path.join(folder, name) for folder, _, files in os.walk(path) for name in files)  # noqa: PTH118
    for name in chain(tops, () if path.is_symlink() else names):
        with suppress(FileNotFoundError):
            found = os.lstat(name)
            if stat.S_ISREG(found.st_mode):
                yield found


def remove(path: Path) -> None:
    """Remove a file, link or folder, or nothing.

    Args:
        path: What shall not be there.
    """
    if path.is_symlink() or path.is_file():
        path.unlink(missing_ok=True)
    elif path.exists():
        shutil.rmtree(path)
