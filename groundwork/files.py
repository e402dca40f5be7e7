"""Atomic writing of files and folders, and the manifest that verifies a folder."""

import ctypes
import errno
import json
import os
import secrets
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

from groundwork.canonical import canonical_json, file_digest
from groundwork.errors import InputError, OutOfSpaceError, show_place
from groundwork.foreign_file import MOST_TEXT, parse_json, read_regular
from groundwork.marks import TEMPORARY, content_files

MANIFEST = "artefact.json"  # a scene folder has a manifest.json of its own
_HERE, _EXCHANGE = -100, 2  # AT_FDCWD and RENAME_EXCHANGE of renameat2


def write_bytes(path: Path, data: bytes, *, durable: bool = True) -> None:
    """Write a file atomically: a reader sees the old content or the new, never a part.

    Args:
        path: Where to write; its folder must exist.
        data: The whole content.
        durable: Wait until it is on the disk; otherwise a power cut may leave an empty file.

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
    """Choose a unique temporary name beside a file; `sweep` finds leftovers of killed writers.

    Args:
        path: The file that will be replaced.
        suffix: Suffix of the name.
    """
    return path.with_name(f"{TEMPORARY}{secrets.token_hex(8)}{suffix}")


def sweep(folder: Path) -> None:
    """Remove the temporary files that killed writers left below a folder.

    Args:
        folder: An unfinished folder that no other process writes into now.
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


@contextmanager
def writing(path: Path) -> Iterator[BinaryIO]:
    """Open a file to be written piece by piece, to save memory.

    Args:
        path: A new file in a folder that no other process reads: a kill leaves it incomplete.

    Yields:
        The open file.

    Raises:
        OutOfSpaceError: The disk is full.
    """
    with space_errors(path), path.open("wb") as file:
        yield file


def write_text(path: Path, text: str) -> None:
    """Write UTF-8 text atomically with Unix line ends.

    Args:
        path: Where to write.
        text: The whole content.
    """
    write_bytes(path, text.encode("utf-8"))


def write_json(path: Path, value: object) -> None:
    """Write readable JSON: sorted keys, two spaces, a final line end.

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
    """Convert OSErrors of a full disk or a folder without permission to our errors.

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
                f"{where}: no space left on the disk. Free some space, then run the same command again"
            ) from None
        if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
            raise InputError(
                "not writable", where=where, hint="Choose another folder with -o, or change its permissions"
            ) from None
        if error.errno == errno.ENAMETOOLONG:
            raise InputError("a name or path that is too long", where=where, hint="Choose a shorter one") from None
        raise


@contextmanager
def whole_file(path: Path, check: Callable[[], object] | None = None) -> Iterator[Path]:
    """Write a large file piece by piece; it gets its name only when it is complete.

    Args:
        path: Where it will be; its folder must exist.
        check: Called before the file gets its name; if it raises, an existing file is not changed.

    Yields:
        An empty file beside it, of the same suffix, to write meanwhile.

    Raises:
        OutOfSpaceError: The disk is full.
        InputError: Not writable.
    """
    partial = temporary_name(path, path.suffix)
    with space_errors(path):
        os.close(os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
        try:
            yield partial
            sync(partial)
            if check is not None:
                check()
            partial.replace(path)
            sync(path.parent)
        except BaseException as error:
            show_place(error, partial, path)
            partial.unlink(missing_ok=True)
            raise


@contextmanager
def whole_folder(place: Path) -> Iterator[Path]:
    """Fill a folder with a unique name, then replace an existing one by it.

    Args:
        place: Its final path; parent folders are made.

    Yields:
        An empty folder beside it.

    Raises:
        OutOfSpaceError: The disk is full; a former folder stays.
        InputError: Not writable.
    """
    fresh = temporary_name(place, f"-{place.name}")
    with space_errors(place):
        fresh.mkdir(parents=True)
        try:
            yield fresh
            put_in_place(fresh, place)
        except BaseException as error:
            show_place(error, fresh, place)
            shutil.rmtree(fresh, ignore_errors=True)
            raise


def put_in_place(fresh: Path, place: Path) -> None:
    """Replace a folder by a finished one; if killed at any moment, one of them exists.

    If the file system cannot exchange two names (old NFS, some overlays), there is a moment without either.

    Args:
        fresh: The finished folder, beside its place.
        place: Its name from now on.

    Raises:
        OutOfSpaceError: The disk is full; a former folder stays.
    """
    with space_errors(place):
        sync_tree(fresh)
        if exchange(fresh, place):
            sync(place.parent)
            shutil.rmtree(fresh, ignore_errors=True)
            return
        former = temporary_name(place, f"-{place.name}")
        while True:
            with suppress(FileNotFoundError):
                place.rename(former)
            try:
                fresh.rename(place)
                break
            except OSError as error:
                if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                    raise
            finally:
                shutil.rmtree(former, ignore_errors=True)
        sync(place.parent)


def exchange(one: Path, other: Path) -> bool:
    """Exchange the names of two files or folders atomically.

    Args:
        one: The first.
        other: The second, on the same file system.

    Returns:
        Whether it succeeded; not if one of them is missing, or the system does not support it.
    """
    try:
        rename = ctypes.CDLL(None).renameat2
    except AttributeError:  # a C library from before 2018
        return False
    return rename(_HERE, os.fsencode(one), _HERE, os.fsencode(other), _EXCHANGE) == 0


def sweep_folders(folder: Path, name: str = "*") -> None:
    """Remove leftovers of killed calls of `whole_folder`.

    Args:
        folder: Folder of the complete ones; no other process may be filling one of that name.
        name: Name of the complete one, or a pattern.
    """
    for left in folder.glob(f"{TEMPORARY}*-{name}"):
        if left.is_dir() and not left.is_symlink():
            shutil.rmtree(left, ignore_errors=True)


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


def commit_folder(partial: Path, final: Path) -> None:
    """Rename a finished folder to its final name, durable against power loss.

    Args:
        partial: The finished folder, on the same file system.
        final: Its final path; must not exist.
    """
    with space_errors(final):
        sweep(partial)
        sync_tree(partial)
        final.parent.mkdir(parents=True, exist_ok=True)
        partial.rename(final)
        sync(final.parent)


def sync_tree(folder: Path) -> None:
    """Wait until a folder and everything below it is on the disk; links are not followed.

    Args:
        folder: A finished folder.

    Raises:
        OSError: The disk did not take a file; that file is removed, since its content may be incomplete.
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
