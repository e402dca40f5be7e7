"""Files that are whole or absent: atomic writes, atomic folders, and the manifest that proves a folder whole."""

import errno
import fcntl
import json
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from groundwork.canonical import canonical_json, file_digest
from groundwork.errors import InputError, OutOfSpaceError

MANIFEST = "artefact.json"  # a scene folder has a manifest.json of its own
MARK = ".falsework"


def write_bytes(path: Path, data: bytes, *, durable: bool = True) -> None:
    """Write a file so that a reader sees the old content or the new, never a part.

    Args:
        path: Where to write; its folder must exist.
        data: The whole content.
        durable: Wait until it is on the disk; a power cut may otherwise leave an empty file under its name.

    Raises:
        OutOfSpaceError: The disk is full.
    """
    partial = path.with_name(f".{path.name}.partial")
    with space_errors(path):
        with partial.open("wb") as file:
            file.write(data)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        partial.replace(path)


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
        InputError: Missing or not JSON.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError("no such file", where=path) from None
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise InputError(f"not readable as JSON: {error}", where=path, mend="Write it anew") from None


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
        raise


@contextmanager
def fresh_file(path: Path) -> Iterator[Path]:
    """Write a large file piece by piece; it appears under its name when it is whole, or not at all.

    Args:
        path: Where it will be; its folder must exist.

    Yields:
        The file to write meanwhile, beside it.

    Raises:
        OutOfSpaceError: The disk is full.
        InputError: Not writable.
    """
    partial = path.with_name(f".{path.name}.partial")
    with space_errors(path):
        try:
            yield partial
            _sync(partial)
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
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path != folder / name)
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
    table = read_json(folder / name)["files"]
    present = {p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()} - {name}
    wrong = [f"{file}: missing" for file in sorted(table.keys() - present)]
    wrong += [f"{file}: not in the manifest" for file in sorted(present - table.keys())]
    wrong += [
        f"{file}: changed"
        for file in sorted(present & table.keys())
        if file_digest(folder / file) != table[file]["sha256"]
    ]
    return wrong


def commit_folder(partial: Path, final: Path) -> None:
    """Make a finished folder appear under its final name with one rename, durable against power loss.

    Args:
        partial: The finished folder, on the same file system.
        final: Its name from now on; must not exist.
    """
    with space_errors(final):
        for path in sorted(partial.rglob("*")):
            _sync(path)
        _sync(partial)
        final.parent.mkdir(parents=True, exist_ok=True)
        partial.rename(final)
        _sync(final.parent)


def fresh_output(folder: Path, kind: str, write: Callable[[Path], None], *, resume: bool = False) -> None:
    """Write a plain output folder as a whole: beside it first, then one rename over a former one of ours.

    Args:
        folder: The folder that the user named.
        kind: What is in it, e.g. `capture`; kept in a hidden mark so that only our own folders are ever replaced.
        write: Called with an empty folder to fill.
        resume: Call it with what an interrupted run left instead; it then checks what of that is still right.

    Raises:
        InputError: The folder holds something that Falsework did not write, is not writable, is being written, or
            is the one that the command was called in.
    """
    folder = Path(os.path.realpath(folder))  # a link stays, what it leads to is replaced
    here = Path.cwd()
    if folder in (here, *here.parents):  # it is replaced as a whole, and the shell would go on in the former one
        raise InputError("is the folder that you are in", where=folder, mend="Choose another folder with -o")
    claim_output(folder, kind)
    partial, former = (folder.with_name(f".{folder.name}.{end}") for end in ("partial", "former"))
    with space_errors(folder), sole_writer(folder):
        if partial.is_symlink():
            partial.unlink()  # whoever made it did not mean us to empty what it leads to
        partial.mkdir(exist_ok=True)
        if not resume:
            _empty(partial)
        write(partial)
        write_text(partial / MARK, kind + "\n")
        claim_output(folder, kind)  # it may have been filled meanwhile
        shutil.rmtree(former, ignore_errors=True)
        if folder.exists():
            folder.rename(former)
        commit_folder(partial, folder)
        shutil.rmtree(former, ignore_errors=True)


@contextmanager
def sole_writer(folder: Path) -> Iterator[None]:
    """Hold a kernel lock beside a folder: two commands that write one folder would undo each other's work.

    Args:
        folder: The folder to be written; what it lies in is made.

    Raises:
        InputError: Another command holds it, or nothing can be written beside the folder.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    path = folder.with_name(f".{folder.name}.lock")
    try:
        handle = _locked(path)
    except FileNotFoundError:  # such as /proc: its rights say that one may write, and one may not
        raise InputError("not writable", where=folder.parent, mend="Choose another folder with -o") from None
    if handle is None:
        raise InputError("another command is writing this folder", where=folder,
                         mend="Wait for it to end, or choose another folder with -o")  # fmt: skip
    try:
        yield
    finally:
        path.unlink(missing_ok=True)
        os.close(handle)


def _locked(path: Path) -> int | None:
    """Open a lock file and lock it; None when another process has it."""
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(handle)
            return None
        except OSError:  # a file system without locks
            return handle
        if path.exists() and os.path.samestat(os.fstat(handle), path.stat()):
            return handle
        os.close(handle)  # its former holder removed it between our two calls


def _empty(folder: Path) -> None:
    for path in folder.iterdir():
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink()


def claim_output(folder: Path, kind: str) -> None:
    """Refuse an output folder that is not ours before any work is done.

    Args:
        folder: The folder that the user named; absent, empty, or ours with the same kind.
        kind: What will be in it.

    Raises:
        InputError: It is a file, holds foreign files, holds another kind, or is not writable.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError("is a file, not a folder", where=folder, mend="Choose another folder with -o")
    if folder.is_dir() and any(folder.iterdir()):
        mark = folder / MARK
        found = mark.read_text(encoding="utf-8").strip() if mark.is_file() else "files that Falsework did not write"
        if found != kind:
            raise InputError(
                f"the output folder holds {found}", where=folder, allowed=f"an empty folder or a former {kind}",
                mend="Choose another folder with -o",
            )  # fmt: skip
    parent = folder
    while not parent.exists():
        if Path(os.path.realpath(parent)).is_symlink():
            raise InputError("is a link that leads to itself", where=parent, mend="Choose another folder with -o")
        parent = parent.parent
    if not parent.is_dir():
        raise InputError("is a file, not a folder", where=parent, mend="Choose another folder with -o")
    if not os.access(parent, os.W_OK):
        raise InputError("not writable", where=parent, mend="Choose another folder with -o, or change its rights")


@contextmanager
def folder_lock(path: Path) -> Iterator[None]:
    """Hold a kernel lock on a file; it falls with the process, however that ends.

    Args:
        path: Lock file, created when absent; its folder must exist.
    """
    with path.open("a") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _sync(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
