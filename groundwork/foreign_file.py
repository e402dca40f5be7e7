"""Safe opening of untrusted files: only regular files, up to a size, and checks before text is parsed.

Every file named by a user, or by such a file, is read by this module, or checked with `check_regular` before its path
is passed to a library.
"""

import json
import math
import os
import re
import stat
import tomllib
from io import BufferedReader
from pathlib import Path
from typing import Any, NoReturn

from groundwork.errors import InputError, MissingError

MOST_BYTES = 4_000_000_000  # [bytes] largest file that is read at once
MOST_TEXT = 1_000_000_000  # [bytes] of JSON: parsed, it takes some ten times as much memory
MOST_TOML = 10_000_000  # [bytes] a scenario has some thousands
_PICTURES = (b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\n", b"II*\0", b"MM\0*", b"RIFF", b"BM")  # signatures of image files
_ESCAPE = re.compile(rb"\\u(?:0000|[dD][89a-fA-F])|\0")  # of what `_check_strings` refuses in JSON
_HUGE = re.compile(rb"[eE]\+?\d{3}|\d{300}")  # what a number beyond double precision has
_MOST_DIGITS, _MOST_BITS = 20, 64  # of an integer
_KINDS = {
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFDIR: "a folder",
}


def open_regular(path: Path, most: int | None = None) -> BufferedReader:
    """Open a regular file for reading; a pipe or a device is refused without waiting.

    Args:
        path: File to read; links are followed.
        most: Largest size [bytes]; None: no limit.

    Raises:
        MissingError: There is no such file.
        InputError: An invalid name, not a regular file, not readable, or too large.
    """
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except (OSError, ValueError) as error:
        _refuse_name(path, error)
    found = os.fstat(handle)
    if not stat.S_ISREG(found.st_mode) or (most is not None and found.st_size > most):
        os.close(handle)
        _refuse_kind(path, found, most)
    return os.fdopen(handle, "rb")


def check_regular(path: Path, most: int | None = None) -> int:
    """Check a file before a library opens it by its name.

    Args:
        path: File to check; links are followed.
        most: Largest size [bytes]; None: no limit.

    Returns:
        Its size [bytes].

    Raises:
        MissingError: There is no such file.
        InputError: An invalid name, not a regular file, or too large.
    """
    try:
        found = Path(path).stat()
    except (OSError, ValueError) as error:
        _refuse_name(path, error)
    if not stat.S_ISREG(found.st_mode) or (most is not None and found.st_size > most):
        _refuse_kind(path, found, most)
    return found.st_size


def is_regular(path: Path) -> bool:
    """Tell whether a path is a regular file; invalid names are not an error.

    Args:
        path: Any path, also from a file.
    """
    try:
        return stat.S_ISREG(Path(path).stat().st_mode)
    except (OSError, ValueError):
        return False


def read_regular(path: Path, most: int = MOST_BYTES) -> bytes:
    """Read all bytes of a regular file.

    Args:
        path: File to read; links are followed.
        most: Largest size [bytes].

    Raises:
        MissingError: There is no such file.
        InputError: As for `open_regular`.
    """
    with open_regular(path, most) as file:
        return file.read()


def read_picture(path: Path) -> bytes:
    """Read the bytes of an image file to copy it; a file that is not an image is refused.

    Args:
        path: JPEG, PNG, TIFF, WebP or BMP; links are followed.

    Raises:
        MissingError: There is no such file.
        InputError: As for `open_regular`, or the file does not begin as an image does.
    """
    data = read_regular(path)
    if not data.startswith(_PICTURES):
        raise InputError("not an image", where=path, allowed="JPEG, PNG, TIFF, WebP or BMP", hint="Leave it out")
    return data


def parse_json(text: str | bytes, where: object) -> Any:
    """Parse untrusted JSON.

    Args:
        text: The document.
        where: Its file, for the error message.

    Raises:
        InputError: Not JSON, not UTF-8, nested too deeply, a number that is not finite or beyond 64 bits, or NUL.
    """
    try:
        data = text if isinstance(text, bytes) else text.encode("utf-8", "surrogatepass")
        real = _finite if _HUGE.search(data) else None  # a check of each number takes a third more time
        value = json.loads(text, parse_constant=_refuse_constant, parse_int=_integer, parse_float=real)
        if _ESCAPE.search(data):
            _check_strings(value)
        return value
    except RecursionError:
        reason = "nested too deeply"
    except ValueError as error:  # also for invalid UTF-8, and integers beyond Python's limit
        reason = _first_sentence(error)
    raise InputError(f"not readable as JSON: {reason}", where=where, hint="Write the file again")


def parse_toml(text: bytes, where: object) -> dict[str, Any]:
    """Parse untrusted TOML.

    Args:
        text: The document, UTF-8.
        where: Its file, for the error message.

    Raises:
        InputError: Not TOML, not UTF-8, nested too deeply, or a number of thousands of digits.
    """
    try:
        value = tomllib.loads(text.decode("utf-8"))
        _check_strings(value)
        return value
    except RecursionError:
        reason = "nested too deeply"
    except ValueError as error:
        reason = _first_sentence(error)
    raise InputError(f"not readable as TOML: {reason}", where=where, hint="Correct this line")


def _integer(text: str) -> int:
    if len(text) > _MOST_DIGITS:
        raise ValueError(f"a number of {len(text)} digits")
    return int(text)


def _finite(text: str) -> float:
    if math.isinf(value := float(text)):
        raise ValueError(f"{text[:40]} is not a finite number")
    return value


def _check_strings(value: object) -> None:
    """Refuse NUL and invalid Unicode in strings, and integers beyond 64 bits, anywhere in nested values.

    Args:
        value: Nested dicts and lists.

    Raises:
        ValueError: NUL or an unpaired surrogate in a string, or such an integer.
    """
    pending = [value]
    while pending:
        one = pending.pop()
        if isinstance(one, dict):
            pending += [*one.keys(), *one.values()]
        elif isinstance(one, list):
            pending += one
        elif isinstance(one, str) and ("\0" in one or any("\ud800" <= letter <= "\udfff" for letter in one)):
            raise ValueError("a text with a null character or an unpaired surrogate")
        elif isinstance(one, int) and one.bit_length() > _MOST_BITS:
            raise ValueError("an integer of more than 64 bits")


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a JSON number")


def _first_sentence(error: ValueError) -> str:
    """Remove Python's advice on its digit limit, which names a function that a user cannot call."""
    return str(error).partition("; use sys.")[0]


def _refuse_name(path: Path, error: OSError | ValueError) -> NoReturn:
    if isinstance(error, FileNotFoundError | NotADirectoryError):
        raise MissingError("no such file", where=path, hint="Check the path") from None
    shown = str(path).replace("\0", "\\0")
    if len(shown) > 300:
        shown = f"{shown[:100]} … {shown[-100:]}"
    reason = error.strerror if isinstance(error, OSError) else "its name has a null character"
    raise InputError(f"cannot be opened: {reason}", where=shown, hint="Check the path") from None


def _refuse_kind(path: Path, found: os.stat_result, most: int | None) -> NoReturn:
    kind = _KINDS.get(stat.S_IFMT(found.st_mode))
    if kind is not None:
        raise InputError(f"is {kind}, not a file", where=path, allowed="regular files")
    raise InputError(f"too large: {found.st_size / 1e9:.1f} GB", where=path, allowed=f"up to {(most or 0) / 1e9:g} GB")
