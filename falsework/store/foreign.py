"""`OUT/foreign`: files of the user that lay in a stored result when it was removed, or where only our files may be."""

import json
import os
from pathlib import Path
from typing import Any

from falsework.store.artefact import is_sealed
from groundwork.errors import InputError
from groundwork.files import MANIFEST, read_json, space_errors

FOREIGN = "foreign"  # folder of a run
_MOST = 10_000  # files of one name


def move_foreign(root: Path, place: str) -> None:
    """Move the files of a stored result that Falsework did not write to `OUT/foreign`, before the result is removed.

    Args:
        root: Output folder of the run.
        place: `<stage>/<key>` of the result. If its manifest cannot be parsed, everything is moved that is not a
            read-only file: a stored result consists of such files.
    """
    folder = root / "store" / place
    known = _listed(folder / MANIFEST)
    if folder.is_symlink() or not folder.is_dir():
        return
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if name == MANIFEST or (path.is_dir() and not path.is_symlink()):
            continue
        if name not in known if known is not None else not is_sealed(path):
            _move(path, root / FOREIGN / place / name)


def move_away(root: Path, path: Path) -> None:
    """Move a file, link or folder of the user to `OUT/foreign`; a relative link still leads to the same place.

    Args:
        root: Output folder of the run.
        path: What to move, below `root`.
    """
    home = root / FOREIGN / path.relative_to(root)
    if not path.is_symlink() or path.readlink().is_absolute():
        _move(path, home)
        return
    target = os.path.relpath(path.parent / path.readlink(), home.parent)
    with space_errors(home):
        _make_folder(home.parent)
        _free_name(home).symlink_to(target)
        path.unlink()


def _move(path: Path, home: Path) -> None:
    with space_errors(home):
        _make_folder(home.parent)
        path.rename(_free_name(home))


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise InputError(
            "a file is where a folder for your files must be made",
            where=folder,
            hint=f"Rename the file {FOREIGN}, or the one below it",
        ) from None


def _listed(manifest: Path) -> set[str] | None:
    """List the files of a manifest, also of one that was changed elsewhere."""
    try:
        table: Any = read_json(manifest)["files"]
    except (InputError, OSError, json.JSONDecodeError, KeyError, TypeError):
        return None
    return set(table) if isinstance(table, dict) else None


def _free_name(path: Path) -> Path:
    """Append a number to the name if an earlier file has it."""
    for number in range(_MOST):
        free = path.with_name(f"{path.name}.{number}") if number else path
        if not os.path.lexists(free):
            return free
    raise InputError("too many files of one name", where=path, hint="Move them elsewhere")
