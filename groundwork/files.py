"""Files that are whole or absent: atomic writes, atomic folders, and the manifest that proves a folder whole."""

import errno
import fcntl
import json
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from groundwork.canonical import canonical_json, file_digest
from groundwork.errors import InputError, OutOfSpaceError
from groundwork.foreign_file import MOST_TEXT, parse_json, read_regular
from groundwork.marks import TEMPORARY, content_files

MANIFEST = "artefact.json"  # a scene folder has a manifest.json of its own


def write_bytes(path: Path, data: bytes, *, durable: bool = True) -> None:
    """Write a file so that a reader sees the old content or the new, never a part.

    Args:
        path: Where to write; its folder must exist.
        data: The whole content.
        durable: Wait until it is on the disk; a power cut may otherwise leave an empty file under its name.

    Raises:
        OutOfSpaceError: The disk is full.
    """
    temporary = temporary_name(path)
    with space_errors(path):
        try:
            _write(temporary, data, durable)
            temporary.replace(path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise


def temporary_name(path: Path, suffix: str = "") -> Path:
    """Choose a name beside a file that nobody else chooses; `sweep` finds what a killed writer left.

    Args:
        path: The file that will be replaced.
        suffix: How the name shall end.
    """
    return path.with_name(f"{TEMPORARY}{secrets.token_hex(8)}{suffix}")


def sweep(folder: Path) -> None:
    """Remove the temporary files that killed writers left below a folder.

    Args:
        folder: A folder in the making that nobody else writes into now.
    """
    for path in folder.rglob(f"{TEMPORARY}*"):
        if not path.is_dir():
            path.unlink()


def _write(path: Path, data: bytes, durable: bool) -> None:
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
    try:
        left = memoryview(data)
        while left:
            left = left[os.write(handle, left) :]
        if durable:
            os.fsync(handle)
    finally:
        os.close(handle)


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 text atomically with Unix line ends.

    Args:
        path: Where to write.
        text: The whole content.
    """
    write_bytes(path, text.encode("utf-8"))


def write_json(path: Path, value: object) -> None:
    """Write JSON for people and programs: sorted keys, two spaces, a final line end.

    Args:
        path: Where to write.
        value: Anything with a canonical JSON form.
    """
    write_text(path, json.dumps(json.loads(canonical_json(value)), sort_keys=True, indent=2) + "\n")


def read_json(path: Path) -> Any:
    """Read a JSON file.

    Args:
        path: File to read.

    Raises:
        MissingError: There is no such file.
        InputError: Not a regular file, too large, or not JSON.
    """
    return parse_json(read_regular(path, MOST_TEXT), path)


@contextmanager
def space_errors(where: Path) -> Iterator[None]:
    """Turn a full disk or a forbidden folder into an error that says so.

    Args:
        where: What was being written.

    Raises:
        OutOfSpaceError: No space left, or over a quota or file-size limit.
        InputError: Not writable.
    """
    try:
        yield
    except OSError as error:
        if isinstance(error, OutOfSpaceError | InputError):
            raise
        if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
            raise OutOfSpaceError(
                f"{where}: no space left on the disk. Free some, then run the same command again"
            ) from None
        if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
            raise InputError(
                "not writable", where=where, mend="Choose another folder with -o, or change its rights"
            ) from None
        if error.errno == errno.ENAMETOOLONG:
            raise InputError("a name or path that is too long", where=where, mend="Choose a shorter one") from None
        raise


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Write a large file piece by piece; it appears under its name when it is whole, or not at all.

    Args:
        path: Where it will be; its folder must exist.

    Yields:
        The file to write meanwhile, beside it.

    Raises:
        OutOfSpaceError: The disk is full.
        InputError: Not writable.
    """
    partial = temporary_name(path, path.suffix)
    with space_errors(path):
        try:
            yield partial
            sync(partial)
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)


def write_manifest(folder: Path, record: dict[str, Any], name: str = MANIFEST) -> None:
    """Write a manifest: the record plus size and SHA-256 of every other file of the folder.

    Args:
        folder: A finished folder.
        record: Stable facts about how it was made; no clock, host or absolute path.
        name: File name of the manifest.
    """
    sweep(folder)
    files = [path for path in content_files(folder) if path != folder / name]
    table = {
        path.relative_to(folder).as_posix(): {"bytes": path.stat().st_size, "sha256": file_digest(path)}
        for path in files
    }
    write_json(folder / name, {**record, "files": table})


def check_manifest(folder: Path, name: str = MANIFEST) -> list[str]:
    """Compare a folder with its manifest.

    Args:
        folder: Folder that should hold a manifest.
        name: File name of the manifest.

    Returns:
        One line per missing, changed or extra file; empty when all is well.
    """
    table = _files_of(folder / name)
    present = {path.relative_to(folder).as_posix() for path in content_files(folder)} - {name}
    wrong = [f"{file}: missing" for file in sorted(table.keys() - present)]
    wrong += [f"{file}: not in the manifest" for file in sorted(present - table.keys())]
    wrong += [
        f"{file}: changed"
        for file in sorted(present & table.keys())
        if file_digest(folder / file) != table[file]["sha256"]
    ]
    return wrong


def _files_of(path: Path) -> dict[str, dict[str, Any]]:
    """Read the table of a manifest."""
    record = read_json(path)
    table = record.get("files") if isinstance(record, dict) else None
    if not isinstance(table, dict) or not all(isinstance(row, dict) and "sha256" in row for row in table.values()):
        raise InputError("not a manifest", where=path, field="files", mend="Make the folder anew")
    return table


def commit_folder(partial: Path, final: Path) -> None:
    """Make a finished folder appear under its final name with one rename, durable against power loss.

    Args:
        partial: The finished folder, on the same file system.
        final: Its name from now on; must not exist.
    """
    with space_errors(final):
        sweep(partial)
        sync_tree(partial)
        final.parent.mkdir(parents=True, exist_ok=True)
        partial.rename(final)
        sync(final.parent)


def sync_tree(folder: Path) -> None:
    """Wait until a folder and everything below it is on the disk; where links lead is not looked at.

    Args:
        folder: A finished folder.

    Raises:
        OSError: The disk did not take a file; that file is removed, since nobody knows what of it will last.
    """
    for home, _, names in os.walk(folder, topdown=False):
        for name in sorted(names):
            path = Path(home, name)
            if path.is_symlink() or not path.is_file():
                continue
            try:
                sync(path)
            except OSError:
                path.unlink()
                raise
        sync(Path(home))


def sync(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the disk.

    Args:
        path: File or folder.
    """
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@contextmanager
def folder_lock(path: Path) -> Iterator[None]:
    """Hold a kernel lock on a file; it falls with the process, however that ends.

    Args:
        path: Lock file, created when absent; its folder must exist.
    """
    with path.open("a") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
