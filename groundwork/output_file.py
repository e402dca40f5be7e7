"""Single files for the user: made beside their name, put there with one rename, and never over a file of others."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from groundwork.errors import InputError
from groundwork.files import space_errors, whole_file
from groundwork.output_place import output_place

SIGNATURE = "made by falsework"  # stands in every single file that we write, where its format has room for it
_FORMER = "· Falsework</title>"  # in pages of the version before signatures
_ENDS = 1 << 16  # [byte] at the beginning and at the end of a file, where formats have their remarks

IsOurs = Callable[[Path], bool]


def is_signed(path: Path) -> bool:
    """Tell whether a file carries our signature near its beginning or its end.

    Args:
        path: Any file.
    """
    with path.open("rb") as file:
        begin = file.read(_ENDS)
        file.seek(max(0, path.stat().st_size - _ENDS))
        ends = begin + b"\0" + file.read(_ENDS)
    return SIGNATURE.encode() in ends or _FORMER.encode() in ends


def check_output_file(path: Path, inputs: Iterable[Path] = (), is_ours: IsOurs = is_signed) -> Path:
    """Refuse to write a file over anything that we did not write, before any work is done.

    Args:
        path: The file that the user named.
        inputs: Files and folders that it is made from.
        is_ours: Tells a former one of ours from a file of others.

    Returns:
        The place of the file, free of links.

    Raises:
        InputError: It is a folder or a device, a file that Falsework did not write, or lies where no output may.
    """
    place = output_place(path, inputs)
    if place.is_dir():
        raise InputError("is a folder, not a file", where=path, hint="Name a file with -o")
    if place.exists() and not place.is_file():
        raise InputError("is not a plain file", where=path, hint="Name another file with -o")
    with space_errors(place):
        if place.exists() and place.stat().st_size and not is_ours(place):
            raise InputError(
                "is a file that Falsework did not write", where=path, hint="Remove it, or name another file with -o"
            )
    return place


@contextmanager
def fresh_file(path: Path, inputs: Iterable[Path] = (), is_ours: IsOurs = is_signed) -> Iterator[Path]:
    """Write a file as a whole: give a name beside it to write to, and put it in its place afterwards.

    Args:
        path: The file that the user named; folders above it are made.
        inputs: Files and folders that it is made from.
        is_ours: Tells a former one of ours, which is replaced, from a file of others, which is not.

    Returns:
        An empty file beside it, of the same suffix.

    Raises:
        InputError: As `check_output_file`.
        OutOfSpaceError: The disk is full; a former file stays.
    """
    inputs = tuple(inputs)
    place = check_output_file(path, inputs, is_ours)
    with space_errors(place), suppress(FileNotFoundError):
        place.parent.mkdir(parents=True, exist_ok=True)
    with ExitStack() as held:
        # Once more before it gets its name: somebody may have put a file there meanwhile.
        writer = whole_file(place, lambda: check_output_file(path, inputs, is_ours))
        try:
            temporary = held.enter_context(writer)
        except FileNotFoundError:  # such as /proc: its rights say that one may write, and one may not
            raise InputError("not writable", where=place.parent, hint="Name another file with -o") from None
        yield temporary


def write_fresh_file(path: Path, data: bytes, inputs: Iterable[Path] = (), is_ours: IsOurs = is_signed) -> None:
    """Write a file as a whole, as `fresh_file` does.

    Args:
        path: The file that the user named.
        data: All of it.
        inputs: Files and folders that it is made from.
        is_ours: Tells a former one of ours from a file of others.
    """
    with fresh_file(path, inputs, is_ours) as temporary:
        temporary.write_bytes(data)  # inside an atomic folder: the name is nobody's yet
