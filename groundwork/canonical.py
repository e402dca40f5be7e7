"""Canonical JSON, and hashes of values, files and source code."""

import ast
import hashlib
import json
import os
from pathlib import Path

from pydantic import BaseModel

from groundwork.foreign_file import open_regular
from groundwork.marks import content_files, linked_folders, outputs_below


def canonical_json(value: object) -> str:
    """Encode a value as canonical JSON: sorted keys, no spaces, no NaN.

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
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def folder_digest(folder: Path, without: str = "", within: tuple[Path, ...] | None = None) -> str:
    """Hash every file below a folder, including names, in sorted order; marks of outputs are ignored.

    Args:
        folder: Folder to read; links are followed. A linked folder that is hashed already, or in which the link is,
            counts by its name.
        without: Kind of the outputs below it that are ignored, such as `run`; empty for none.
        within: Folders in which linked folders must be to count; None: all count.

    Returns:
        SHA-256 in 64 hexadecimal digits.
    """
    found: dict[str, str] = {}
    entered = {Path(os.path.realpath(folder)): Path()}
    places = [(Path(), folder)]
    for name, place in places:  # linked folders are appended
        apart = outputs_below(place, without) if without else set()
        counted = (path for path in content_files(place) if apart.isdisjoint(path.parents))
        found |= {(name / path.relative_to(place)).as_posix(): file_digest(path) for path in counted}
        for link in linked_folders(place):
            if not apart.isdisjoint((link, *link.parents)):
                continue
            inner, real = name / link.relative_to(place), Path(os.path.realpath(link))
            if within is not None and not any(real.is_relative_to(os.path.realpath(top)) for top in within):
                continue
            if known := _known_name(real, Path(os.path.realpath(link.parent)), entered):
                found[inner.as_posix()] = f"-> {known}"
            else:
                entered[real] = inner
                places.append((inner, link))
    return digest(found)


def _known_name(real: Path, home: Path, entered: dict[Path, Path]) -> str:
    """Name a linked folder that is inside an entered one or contains the link; empty for any other."""
    for top, name in entered.items():
        if real.is_relative_to(top):
            return (name / real.relative_to(top)).as_posix()
    return os.path.relpath(real, home) if home.is_relative_to(real) else ""


def source_digest(files: list[Path]) -> str:
    """Hash the behavior of Python modules: independent of their paths, of import paths, docstrings and comments.

    So a module may be moved, and its documentation improved, without invalidating its results.

    Args:
        files: Modules to read; their order and names do not matter, and empty ones are ignored.

    Returns:
        SHA-256 in 64 hexadecimal digits.
    """
    texts = [file.read_text(encoding="utf-8") for file in files]
    return digest(sorted(_behavior(ast.parse(text)) for text in texts if text.strip()))


def _behavior(tree: ast.Module) -> str:
    """Dump a module without docstrings and with its imports reduced to the names that they bind."""
    bound: set[tuple[str, str]] = set()
    for node in ast.walk(tree):
        for block in ("body", "orelse", "finalbody"):
            statements = getattr(node, block, None)
            if isinstance(statements, list):
                imports = [one for one in statements if isinstance(one, ast.Import | ast.ImportFrom)]
                bound |= {(name.name.rpartition(".")[2], name.asname or "") for one in imports for name in one.names}
                setattr(node, block, [one for one in statements if one not in imports and not _is_text(one)])
    return ast.dump(tree) + canonical_json(sorted(bound))


def _is_text(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)


def _plain(value: object) -> object:
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json")
    if isinstance(value, Path):
        return value.as_posix()
    raise TypeError(f"{type(value).__name__} has no canonical form")
