"""Reading what a command wrote: an output that is being put into place is finished first, and no half is ever seen."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from groundwork.errors import InputError
from groundwork.files import space_errors
from groundwork.marks import MARK, NEXT, is_work, read_listing
from groundwork.output_lock import leave, lock_if_free
from groundwork.output_swap import discard, is_ready, roll_forward

_Stamp = tuple[int, int, int]


@contextmanager
def reading(*paths: Path) -> Iterator[None]:
    """Read outputs of ours inside: they are whole when it begins, and the same when it ends.

    For what is not an output of ours, such as a user's folder or a run's store, only the parent folders are looked at.

    Args:
        paths: Files and folders that are read, anywhere in an output or out of any.

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
    """List the outputs that a path lies in, or is; what is being made in `.next` is its writer's business."""
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
    """Finish what was being put into place, and tell which output it is now."""
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
    """Tell one finished output from another: each has a mark of its own, and during a swap there is none."""
    try:
        found = (place / MARK).stat()
    except OSError:
        return None
    return found.st_ino, found.st_mtime_ns, found.st_size
