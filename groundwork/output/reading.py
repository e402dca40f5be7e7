"""Consistent reading of outputs: an interrupted replacement is finished first, so that no mixture is read."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from groundwork.errors import InputError
from groundwork.files import space_errors
from groundwork.marks import MARK, NEXT, is_work, read_listing
from groundwork.output.lock import leave, lock_if_free
from groundwork.output.swap import discard, is_ready, roll_forward

_Stamp = tuple[int, int, int]


@contextmanager
def reading(*paths: Path) -> Iterator[None]:
    """Guard the reading of outputs: they are complete at the start of the block, and unchanged at its end.

    For other paths, such as a user's folder or a run's store, only the parent folders are checked.

    Args:
        paths: Files and folders that are read, inside or outside of outputs.

    Raises:
        InputError: One is not finished, is being replaced, or was replaced meanwhile.
    """
    stamps = {place: _open(place) for path in paths for place in _outputs_over(path)}
    try:
        yield
    except Exception as error:
        _compare(stamps, error)
        raise
    _compare(stamps, None)


def _compare(stamps: dict[Path, _Stamp | None], cause: Exception | None) -> None:
    for place, stamp in stamps.items():
        if _stamp(place) != stamp or is_ready(place):
            raise InputError(
                "was replaced while it was read", where=place, hint="Run the same command again"
            ) from cause


def _outputs_over(path: Path) -> list[Path]:
    """List the outputs that contain a path, or are it; unfinished ones in `.next` are ignored."""
    here = Path(os.path.realpath(path))
    found = []
    for folder in (here, *here.parents):
        if is_work(folder):
            break
        if is_work(folder / NEXT) or (folder / MARK).is_file():
            found.append(folder)
    if found[:1] == [here] and not (here / MARK).exists() and not is_ready(here):
        kind = read_listing(here / NEXT / MARK).kind
        raise InputError(f"an unfinished {kind}", where=path, hint="Run the command that writes it again")
    return found


def _open(place: Path) -> _Stamp | None:
    """Finish an interrupted replacement, and identify the output."""
    stamp = _stamp(place)
    if not is_ready(place):
        return stamp
    work = place / NEXT
    handle = lock_if_free(work)
    if handle is None:
        raise InputError("is being replaced by another command", where=place, hint="Wait until it is finished")
    try:
        with space_errors(place):
            if is_ready(place):
                roll_forward(place)
                discard(work)
    finally:
        leave(work, handle)
    return _stamp(place)


def _stamp(place: Path) -> _Stamp | None:
    """Identify a finished output by its mark; during a replacement there is none."""
    try:
        found = (place / MARK).stat()
    except OSError:
        return None
    return found.st_ino, found.st_mtime_ns, found.st_size
