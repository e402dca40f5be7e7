"""Safe file names from names in untrusted files: plain characters, unique, and inside a folder."""

import hashlib
import re
from collections.abc import Iterable
from pathlib import Path

from groundwork.errors import InputError

_LONGEST = 80  # [bytes] with room for prefixes and suffixes; file systems allow 255
_LONGEST_NAME = 255  # [bytes] of a file or folder on any file system
_LONGEST_FILE = 200  # [bytes] longest name of a photograph that is kept unchanged
_OTHER = re.compile(r"[^A-Za-z0-9._-]+")
_TAIL = 8  # hexadecimal digits of the hash in a changed name


def slug(name: str) -> str:
    """Convert any text to a file name that is also an HTML id without quotes.

    A name of letters, digits, `.`, `_` and `-` that begins with a letter or digit is kept. Any other is simplified and
    ends with a part of its hash, so that two names never become one.

    Args:
        name: Text from a file: the name of a class, a survey, an image …

    Returns:
        1 to 80 ASCII characters of `[A-Za-z0-9._-]`, the first a letter or digit.
    """
    plain = _OTHER.sub("-", name).lstrip("._-")[:_LONGEST]
    if plain == name and name:
        return name
    tail = hashlib.sha256(name.encode("utf-8", "surrogatepass")).hexdigest()[:_TAIL]
    return f"{plain[: _LONGEST - _TAIL - 1].rstrip('._-') or 'unnamed'}-{tail}"


def inside(folder: Path, *parts: str, where: object = None) -> Path:
    """Join a path that must stay inside a folder, with links resolved.

    Args:
        folder: An existing folder, or one to be made.
        parts: Names from a file.
        where: File of the names, for the error message.

    Returns:
        The path, not resolved.

    Raises:
        InputError: It is the folder itself, leaves it, or has an invalid name.
    """
    path = folder.joinpath(*parts)
    try:
        home, target = folder.resolve(), path.resolve()
    except (OSError, RuntimeError, ValueError):  # too long, circular links, or NUL
        home = target = folder
    long = any(len(part.encode("utf-8", "surrogatepass")) > _LONGEST_NAME for part in path.parts)
    if target == home or long or not target.is_relative_to(home):
        raise InputError(
            "a name that leads out of its folder",
            where=where,
            value="/".join(parts)[:200],
            allowed="a name of letters, digits, '.', '_' and '-'",
        )
    return path


def flat_names(files: Iterable[str]) -> dict[str, str]:
    """Flatten the paths of photographs to unique names in one folder: `images/` is removed, and slashes become `_`.

    Args:
        files: Paths relative to the folder of a capture, with slashes.

    Returns:
        Each path to a name without a slash, all different.

    Raises:
        InputError: Two photographs would have one name.
    """
    names: dict[str, str] = {}
    for file in files:
        name = Path(file).as_posix().removeprefix("images/").replace("/", "_")
        stem, suffix = Path(name).stem, Path(name).suffix
        if name in ("", ".", "..") or "\0" in name or len(name.encode("utf-8", "surrogatepass")) > _LONGEST_FILE:
            name = slug(stem) + slug_suffix(suffix)
        names[file] = name
    if len(set(names.values())) < len(names):
        listed = list(names.values())
        twice = next(name for name in listed if listed.count(name) > 1)
        raise InputError("two photographs would get the same name", value=twice, hint="Rename one of them")
    return names


def slug_suffix(suffix: str) -> str:
    """Return the suffix of a file name if it is a plain one.

    Args:
        suffix: With its dot, or empty.
    """
    return suffix if re.fullmatch(r"\.[A-Za-z0-9]{1,8}", suffix) else ""
