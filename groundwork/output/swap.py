"""Replacement of an output by a finished new one, which can be completed after any number of kills.

`OUT/.next` holds the new files, the list of those that they replace, and finally `ready`, the mark of the new output.
From then on nothing can be lost: the next process moves the remaining files. The old mark is removed before the first
file is moved, and the new one is added after the last, so that an output with a mark is complete.
"""

import errno
import os
import shutil
from contextlib import suppress
from pathlib import Path

from groundwork.errors import InputError
from groundwork.files import sync, sync_tree, write_bytes
from groundwork.marks import MARK, NEXT, TEMPORARY, Listing, list_folder, read_listing
from groundwork.output.lock import LOCK

FILES = "files"  # content of the new output
READY = f"{TEMPORARY}ready"
_STAYS = (errno.ENOTEMPTY, errno.EEXIST, errno.ENOENT, errno.ENOTDIR)  # not empty, or already removed
REPLACED = f"{TEMPORARY}replaced"


def make_ready(place: Path, former: Listing, kind: str, is_marked: bool) -> None:
    """Write a finished output to the disk and mark it as ready for the replacement.

    Args:
        place: Folder of the output.
        former: Our files in it.
        kind: Kind of the new output.
        is_marked: Whether it belongs to Falsework.
    """
    work = place / NEXT
    sync_tree(work / FILES)
    write_bytes(work / REPLACED, former.as_text().encode())
    sync(work)
    write_bytes(work / READY, list_folder(work / FILES, kind, is_marked=is_marked).as_text().encode())
    sync(work)


def roll_forward(place: Path) -> None:
    """Replace the old output by a ready one, or resume the replacement; the caller must hold the lock.

    Args:
        place: Folder of the output.

    Raises:
        InputError: A file that Falsework did not write is in the place of a new one; then nothing has been moved.
    """
    work = place / NEXT
    new, former = read_listing(work / READY), read_listing(work / REPLACED)
    waiting = [name for name in new.files if os.path.lexists(work / FILES / name)]
    _refuse_foreign_files(place, new, waiting, former)
    (place / MARK).unlink(missing_ok=True)
    sync(place)
    _clear_away(place, former, new)
    for name in new.folders:
        (place / name).mkdir(exist_ok=True)
    for name in waiting:
        (work / FILES / name).replace(place / name)
    for name in reversed(new.folders):
        sync(place / name)
    sync(place)
    if new.is_marked:
        (work / READY).replace(place / MARK)
        sync(place)
    else:
        if (work / FILES).is_dir():  # else a process was killed after its removal
            shutil.rmtree(work / FILES)
        (work / MARK).unlink(missing_ok=True)  # before `ready`: the output now belongs to the user
        (work / READY).unlink()
    sync(work)


def is_ready(place: Path) -> bool:
    """Tell whether a replacement is pending or interrupted.

    Args:
        place: Folder of the output.
    """
    return (place / NEXT / READY).is_file()


def discard(work: Path) -> None:
    """Remove everything from the work folder of an output except the lock.

    Args:
        work: The folder `.next`; its mark is removed last, because without it the rest would count as foreign.
    """
    for path in sorted(work.iterdir(), key=lambda path: path.name == MARK):
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        elif path.name != LOCK:
            path.unlink()


def _clear_away(place: Path, former: Listing, new: Listing) -> None:
    """Remove files of the old output that the new one lacks; folders with foreign files are kept."""
    kept, kept_folders = set(new.files), set(new.folders)
    touched: set[Path] = set()
    for name in former.files:
        path = place / name
        if name not in kept and _is_below(path.parent, place):
            with suppress(FileNotFoundError, NotADirectoryError, IsADirectoryError):
                path.unlink()
                touched.add(path.parent)
    for name in reversed(former.folders):
        path = place / name
        if name not in kept_folders and _is_below(path, place):
            try:
                path.rmdir()
            except OSError as error:
                if error.errno not in _STAYS:
                    raise
    for folder in sorted(touched):
        if folder.is_dir():
            sync(folder)


def _refuse_foreign_files(place: Path, new: Listing, waiting: list[str], former: Listing) -> None:
    """Refuse to replace a file or folder that Falsework did not write."""
    ours, folders = set(former.files), set(former.folders)
    for name in new.folders:
        path = place / name
        if name not in ours and (path.is_symlink() or (path.exists() and not path.is_dir())):
            _refuse(path)
    for name in waiting:
        path = place / name
        if path.is_dir() and not path.is_symlink():
            held = {f"{name}/{file}" for file in list_folder(path, "").files}
            if name not in folders or not held <= ours:
                _refuse(path)
        elif name not in ours and os.path.lexists(path):
            _refuse(path)


def _refuse(path: Path) -> None:
    raise InputError(
        "is at the place of the output, and Falsework did not write it",
        where=path,
        hint="Move it elsewhere, then run the same command again: the finished work is kept",
    )


def _is_below(folder: Path, place: Path) -> bool:
    """Tell whether a folder is reached from the output without a link, which could lead to foreign files."""
    return Path(os.path.realpath(folder)) == folder and (folder == place or place in folder.parents)
