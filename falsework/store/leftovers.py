"""Leftovers of killed processes in a run's folder: found and measured first, then removed under locks."""

import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from falsework.store.failures import read_failure
from falsework.store.textures import POOL
from falsework.store.workroom import DAMAGED, LINKS, plain_files, remove, set_aside, work_folder
from groundwork.errors import InputError
from groundwork.files import MANIFEST
from groundwork.locks import BusyError, hold_lock
from groundwork.marks import TEMPORARY

KEY = re.compile(r"[0-9a-f]{64}")
TEMPORARY_NAME = re.compile(rf"{re.escape(TEMPORARY)}[0-9a-f]{{16}}(\.\w+)?")


@dataclass(frozen=True)
class Leftover:
    """Something in a run's folder that is not needed.

    Attributes:
        about: Description for people.
        paths: Its files, links and folders; of a stored result its folder, and then the links to it.
        key: Key of the result whose lock must be held during the removal; empty for none.
        is_result: Whether it is a stored result, which must disappear at once.
    """

    about: str
    paths: tuple[Path, ...]
    key: str = ""
    is_result: bool = False


def abandoned(root: Path) -> list[Leftover]:
    """Find leftovers of killed processes: unfinished results, temporary files, and records with a later result.

    Args:
        root: Output folder of a run.
    """
    temporaries = [
        path
        for folder in (root, root / "failed", *sorted((root / "evicted").glob("*/")))
        for path in sorted(folder.glob(f"{TEMPORARY}*"))
        if _is_temporary(path)
    ]
    found = [one for one in _rooms(root) if not is_held(root / "work" / f"{one.key}.lock")]
    if not is_in_use(root):  # checked after listing them, so that their writers have ended
        found += [Leftover("temporary file", (path,)) for path in temporaries]
    present = {path.parent.name for path in root.glob(f"store/*/*/{MANIFEST}")}
    for path in sorted(root.glob("failed/*.json")):
        if path.stem in present and read_failure(path) is not None:
            found.append(Leftover("record of a failure that no longer occurs", (path,), path.stem))
    return found


def is_in_use(root: Path, *, unknown: bool = True) -> bool:
    """Tell whether a process is working in a run's folder.

    Args:
        root: Output folder of a run.
        unknown: The answer for a file that may be locked on a file system without locks.
    """
    locks = sorted((root / "work").glob("*.lock"))
    return any(is_held(path, unknown=unknown) for path in (*locks, root / "run" / "scenario.lock"))


def refuse_in_use(root: Path, *, unknown: bool = True) -> None:
    """Refuse a run's folder in which a process is working.

    Args:
        root: Output folder of a run.
        unknown: Whether to refuse one that may be in use, on a file system without locks.

    Raises:
        InputError: A process is working in it.
    """
    if is_in_use(root, unknown=unknown):
        raise InputError("a run is in progress in this folder", where=root, hint="Wait until it ends, or stop it")


def is_held(lock: Path, *, unknown: bool = True) -> bool:
    """Tell whether another process holds a lock.

    Args:
        lock: The lock file; if it is missing, no process holds it.
        unknown: The answer on a file system without locks.
    """
    if not lock.is_file():
        return lock.is_symlink() or lock.exists()
    try:
        with hold_lock(lock, wait=False) as held:
            return unknown and not held
    except (BusyError, InputError):
        return True


def remove_leftover(root: Path, leftover: Leftover) -> bool:
    """Remove a leftover, unless a process has begun to work on it.

    Args:
        root: Output folder of the run.
        leftover: The leftover.

    Returns:
        Whether it was removed.
    """
    if not leftover.key:
        for path in leftover.paths:
            remove(path)
        return True
    try:
        if leftover.key == LINKS:
            lock = root / "work" / f"{LINKS}.lock"
            with hold_lock(lock, wait=False) as held:
                return held and _remove_all((*leftover.paths, lock))
        with work_folder(root, leftover.key, wait=False) as work:
            if work.name != leftover.key:
                return False  # no locks here
            if not leftover.is_result:
                return _remove_all(leftover.paths)
            set_aside(leftover.paths[0], work)
            for link in leftover.paths[1:]:
                link.unlink(missing_ok=True)
                for folder in list(link.parents)[:2]:  # `scenes/0000/capture`, `scenes/0000`
                    if folder != root / "scenes" and not any(folder.iterdir()):
                        folder.rmdir()
            return True
    except (BusyError, InputError):
        return False


def unshared_textures(root: Path, leftovers: Iterable[Leftover]) -> list[Leftover]:
    """Find the textures of the run that no scene uses after a removal.

    Args:
        root: Output folder of the run.
        leftovers: What will be removed.
    """
    links = _links(leftovers)
    found = []
    for path in sorted((root / "store" / POOL).glob("*")):
        if KEY.fullmatch(path.name) and path.is_file() and not path.is_symlink():
            seen = path.stat()
            if seen.st_nlink == links[(seen.st_dev, seen.st_ino)] + 1:
                found.append(Leftover("texture that no scene uses", (path,)))
    return found


def bytes_freed(leftovers: Iterable[Leftover]) -> int:
    """Measure the space that becomes free [bytes]: a file with several links counts if all are removed.

    Args:
        leftovers: What will be removed.
    """
    leftovers = list(leftovers)
    links = _links(leftovers)
    files = {(seen.st_dev, seen.st_ino): seen for seen in _files(leftovers)}
    return sum(seen.st_size for identity, seen in files.items() if links[identity] >= seen.st_nlink)


def _rooms(root: Path) -> Iterator[Leftover]:
    """List the folders in `work/` with our names, by key; on a file system without locks a folder has an owner."""
    room = root / "work"
    names = {path.name.partition(".")[0] for path in room.iterdir()} if room.is_dir() else set()
    for key in sorted(names):
        if key == LINKS:
            paths = [path for path in sorted(room.glob(f"{LINKS}.*")) if path.is_symlink()]
        elif KEY.fullmatch(key):
            folders = (room / key, room / f"{key}.{DAMAGED}")
            paths = [path for path in folders if path.is_dir() and not path.is_symlink()]
        else:
            continue
        lock = room / f"{key}.lock"
        paths += [lock] if lock.is_file() and not lock.is_symlink() else []
        if paths:
            yield Leftover("unfinished result", tuple(paths), key)


def _is_temporary(path: Path) -> bool:
    return bool(TEMPORARY_NAME.fullmatch(path.name)) and path.is_file() and not path.is_symlink()


def _remove_all(paths: tuple[Path, ...]) -> bool:
    for path in paths:
        remove(path)
    return True


def _links(leftovers: Iterable[Leftover]) -> Counter[tuple[int, int]]:
    return Counter((seen.st_dev, seen.st_ino) for seen in _files(leftovers))


def _files(leftovers: Iterable[Leftover]) -> Iterator[os.stat_result]:
    for leftover in leftovers:
        for path in leftover.paths:
            yield from plain_files(path)
