"""Checks of an output's path: it must not be, be inside, or contain an input, or be inside a store."""

import errno
import os
from collections.abc import Iterable
from pathlib import Path

from groundwork.errors import InputError
from groundwork.files import MANIFEST
from groundwork.marks import MARK, read_listing

RUN = "run"  # kind of the only output whose folder several processes share
# Names that a run writes at the top of its folder.
_OF_A_RUN = ("store", "work", "scenes", "failed", "run", "evicted", "foreign")
_LONGEST = 255  # [bytes] longest name on any file system in use
_ELSEWHERE = "Choose another place with -o"


def output_place(path: Path, inputs: Iterable[Path] = ()) -> Path:
    """Resolve the path of an output, and refuse harmful places.

    Args:
        path: File or folder that the user named; links in it are followed.
        inputs: Files and folders that the output is made from.

    Returns:
        The path, with links resolved.

    Raises:
        InputError: The path is, contains or is inside an input; is inside a store; has an invalid name; or is not
            writable.
    """
    _check_names(path)
    place = Path(os.path.realpath(path))
    for folder in (place, *place.parents):
        if os.path.islink(folder):  # noqa: PTH114 - a path that is too long is no link, and no error here
            raise InputError("is a link that leads to itself", where=folder, hint=_ELSEWHERE)
    for given in inputs:
        source = Path(os.path.realpath(given))
        if place == source:
            raise InputError("is an input of this command", where=path, hint=_ELSEWHERE)
        if source in place.parents:
            raise InputError("lies inside an input of this command", where=path, value=str(given), hint=_ELSEWHERE)
        if place in source.parents:
            raise InputError("contains an input of this command", where=path, value=str(given), hint=_ELSEWHERE)
    _check_writable(place)
    _refuse_stores(place, path)
    return place


def _check_names(path: Path) -> None:
    for name in path.parts:
        try:
            length = len(os.fsencode(name))
        except UnicodeEncodeError:
            raise InputError("not a valid file name", where=repr(str(path)), hint=_ELSEWHERE) from None
        if "\0" in name:
            raise InputError("a name with a null character", where=repr(str(path)), hint=_ELSEWHERE)
        if length > _LONGEST:
            raise InputError(
                "a name that is too long",
                where=path,
                value=f"{length} bytes",
                allowed=f"up to {_LONGEST} bytes",
                hint="Choose a shorter one with -o",
            )


def _refuse_stores(place: Path, path: Path) -> None:
    for folder in (place, *place.parents):
        if (folder / MANIFEST).is_file():
            raise InputError("lies in a stored result, which is never changed", where=path, hint=_ELSEWHERE)
        mark = folder / MARK
        if folder != place and mark.is_file() and read_listing(mark).kind == RUN:
            top = place.relative_to(folder).parts[0]
            if top in _OF_A_RUN:
                raise InputError(f"lies in {top}/ of a run, where only the run writes", where=path, hint=_ELSEWHERE)


def _check_writable(place: Path) -> None:
    parent = place
    try:
        while not parent.exists():
            parent = parent.parent
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise InputError("a path that is too long", where=place, hint="Choose a shorter one with -o") from None
        raise InputError("cannot be reached", where=place, hint=_ELSEWHERE) from None
    if parent != place and not parent.is_dir():
        raise InputError("is a file, not a folder", where=parent, hint="Choose another folder with -o")
    if not os.access(parent, os.W_OK):
        raise InputError("not writable", where=parent, hint="Choose another folder with -o, or change its permissions")
