"""Atomic writing of single output files, which never overwrites a file that Falsework did not write."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from groundwork.errors import InputError
from groundwork.files import space_errors, whole_file
from groundwork.output.place import output_place

SIGNATURE = "made by falsework"  # signature in every single file that we write, if its format has room for it
_FORMER = "· Falsework</title>"  # in pages before signatures were introduced
_ENDS = 1 << 16  # [bytes] searched at the beginning and at the end of a file, where formats have comments

IsOurs = Callable[[Path], bool]


def is_signed(path: Path) -> bool:
    """Tell whether a file has our signature near its beginning or its end.

    Args:
        path: Any file.
    """
    with path.open("rb") as file:
        begin = file.read(_ENDS)
        file.seek(max(0, path.stat().st_size - _ENDS))
        ends = begin + b"\0" + file.read(_ENDS)
    return SIGNATURE.encode() in ends or _FORMER.encode() in ends


def check_output_file(path: Path, inputs: Iterable[Path] = (), is_ours: IsOurs = is_signed) -> Path:
    """Refuse to overwrite a file that Falsework did not write, before any work is done.

    Args:
        path: The file that the user named.
        inputs: Files and folders that it is made from.
        is_ours: Tells an earlier file of Falsework from other files.

    Returns:
        The path of the file, with links resolved.

    Raises:
        InputError: It is a folder or a device, a file that Falsework did not write, or in a place that is not allowed.
    """
    place = output_place(path, inputs)
    if place.is_dir():
        raise InputError("is a folder, not a file", where=path, hint="Name a file with -o")
    if place.exists() and not place.is_file():
        raise InputError("is not a regular file", where=path, hint="Name another file with -o")
    with space_errors(place):
        if place.exists() and place.stat().st_size and not is_ours(place):
            raise InputError(
                "is a file that Falsework did not write", where=path, hint="Remove it, or name another file with -o"
            )
    return place


@contextmanager
def fresh_file(path: Path, inputs: Iterable[Path] = (), is_ours: IsOurs = is_signed) -> Iterator[Path]:
    """Write a file atomically: yield a temporary file beside it, and rename it afterwards.

    Args:
        path: The file that the user named; parent folders are made.
        inputs: Files and folders that it is made from.
        is_ours: Tells an earlier file of ours, which is replaced, from other files, which are not.

    Returns:
        An empty file beside it, of the same suffix.

    Raises:
        InputError: As `check_output_file`.
        OutOfSpaceError: The disk is full; an earlier file is kept.
    """
    inputs = tuple(inputs)
    place = check_output_file(path, inputs, is_ours)
    with space_errors(place), suppress(FileNotFoundError):
        place.parent.mkdir(parents=True, exist_ok=True)
    with ExitStack() as held:
        # Checked again before the rename: another file may have appeared meanwhile.
        writer = whole_file(place, lambda: check_output_file(path, inputs, is_ours))
        try:
            temporary = held.enter_context(writer)
        except FileNotFoundError:  # such as /proc: not writable despite its permissions
            raise InputError("not writable", where=place.parent, hint="Name another file with -o") from None
        yield temporary


def write_fresh_file(path: Path, data: bytes, inputs: Iterable[Path] = (), is_ours: IsOurs = is_signed) -> None:
    """Write a file atomically, as `fresh_file` does.

    Args:
        path: The file that the user named.
        data: Its content.
        inputs: Files and folders that it is made from.
        is_ours: Tells an earlier file of Falsework from other files.
    """
    with fresh_file(path, inputs, is_ours) as temporary:
        temporary.write_bytes(data)  # inside an atomic folder: a temporary name
