"""One spelling for every value: canonical JSON and the hashes taken from it."""

import hashlib
import json
from pathlib import Path

from pydantic import BaseModel

from groundwork.marks import content_files


def canonical_json(value: object) -> str:
    """Spell a value as JSON in one way only: sorted keys, no spaces, no NaN.

    Args:
        value: Nested dicts, lists, tuples, strings, numbers, booleans, None, paths and pydantic models.

    Returns:
        ASCII text without a line end.

    Raises:
        ValueError: A number is not finite.
        TypeError: A value has no JSON form.
    """
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False, default=_plain)


def digest(value: object) -> str:
    """Hash a value by its canonical JSON.

    Args:
        value: As for `canonical_json`.

    Returns:
        SHA-256 in 64 hexadecimal digits.
    """
    return hashlib.sha256(canonical_json(value).encode()).hexdigest()


def file_digest(path: Path) -> str:
    """Hash the bytes of one file.

    Args:
        path: File to read.

    Returns:
        SHA-256 in 64 hexadecimal digits.
    """
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def folder_digest(folder: Path) -> str:
    """Hash every file below a folder, names included, in sorted order; marks of outputs do not count.

    Args:
        folder: Folder to read; links are followed.

    Returns:
        SHA-256 in 64 hexadecimal digits.
    """
    files = {path.relative_to(folder).as_posix(): file_digest(path) for path in content_files(folder)}
    return digest(files)


def _plain(value: object) -> object:
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json")
    if isinstance(value, Path):
        return value.as_posix()
    raise TypeError(f"{type(value).__name__} has no canonical form")
