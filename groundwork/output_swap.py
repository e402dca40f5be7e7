"""Putting a finished output in the place of the former one: made ready once, then rolled forward, however often killed.

In `OUT/.next` lie the new files, the list of those that they replace, and last of all `ready`, which is the mark that
the output will have. From then on nothing can be lost: whoever comes next moves what has not been moved yet. The
former mark goes before the first file and the new one comes after the last, so that an output with a mark is whole.
"""

import errno
import os
import shutil
from contextlib import suppress
from pathlib import Path

from groundwork.errors import InputError
from groundwork.files import sync, sync_tree, write_bytes
from groundwork.marks import MARK, NEXT, TEMPORARY, Listing, list_folder, read_listing
from groundwork.output_lock import LOCK

FILES = "files"  # what the new output will hold
READY = f"{TEMPORARY}ready"
_STAYS = (errno.ENOTEMPTY, errno.EEXIST, errno.ENOENT, errno.ENOTDIR)  # others have something there, or it is gone
REPLACED = f"{TEMPORARY}replaced"


def make_ready(place: Path, former: Listing, kind: str, is_marked: bool) -> None:
    """Bring a finished output to the disk and say that it may be put into its place.

    Args:
        place: Folder of the output.
        former: What it holds of ours.
        kind: What the new output is.
        is_marked: Whether it stays ours.
    """
    work = place / NEXT
    sync_tree(work / FILES)
    write_bytes(work / REPLACED, former.as_text().encode())
    sync(work)
    write_bytes(work / READY, list_folder(work / FILES, kind, is_marked=is_marked).as_text().encode())
    sync(work)


def roll_forward(place: Path) -> None:
    """Put a ready output in the place of the former one, or go on with that; call it under the lock.

    Args:
        place: Folder of the output.

    Raises:
        InputError: A file that we did not write stands where a new one goes; nothing has been moved then.
    """
    work = place / NEXT
    new, former = read_listing(work / READY), read_listing(work / REPLACED)
    waiting = [name for name in new.files if os.path.lexists(work / FILES / name)]
    _refuse_strangers(place, new, waiting, former)
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
        shutil.rmtree(work / FILES)
        (work / MARK).unlink(missing_ok=True)  # before `ready`: what is the user's now is nobody's unfinished work
        (work / READY).unlink()
    sync(work)


def is_ready(place: Path) -> bool:
    """Tell whether an output waits to be put, or is being put, into its place.

    Args:
        place: Folder of the output.
    """
    return (place / NEXT / READY).is_file()


def discard(work: Path) -> None:
    """Take everything out of the folder in which an output is made, but for the lock.

    Args:
        work: The folder `.next`; its mark goes last, since without it the rest would be somebody else's.
    """
    for path in sorted(work.iterdir(), key=lambda path: path.name == MARK):
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        elif path.name != LOCK:
            path.unlink()


def _clear_away(place: Path, former: Listing, new: Listing) -> None:
    """Remove what the former output has and the new one has not; a folder stays while others have something in it."""
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


def _refuse_strangers(place: Path, new: Listing, waiting: list[str], former: Listing) -> None:
    """Refuse to put a file or folder where one that Falsework did not write is."""
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
        "is in the way, and Falsework did not write it",
        where=path,
        hint="Move it elsewhere, then run the same command again: the finished work waits",
    )


def _is_below(folder: Path, place: Path) -> bool:
    """Tell whether a folder is reached from the output without a link, which would lead to files of others."""
    return Path(os.path.realpath(folder)) == folder and (folder == place or place in folder.parents)
