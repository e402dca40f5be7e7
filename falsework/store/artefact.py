"""Manifest of a stored result: the task, every file's hash, and a digest of the manifest itself."""

import json
import os
import stat
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from groundwork.canonical import canonical_json, digest, file_digest
from groundwork.errors import InputError
from groundwork.files import MANIFEST, write_json, write_manifest

FORMAT_VERSION = 2  # 1 had no digest of the manifest
_SEALED = 0o444  # mode of the files of a stored result
LONGEST_MANIFEST = 64e6  # [bytes] largest manifest; 100,000 files need a fifth of it


def task_key(stage: str, version: int, settings: dict[str, Any], inputs: dict[str, str]) -> str:
    """Hash everything that a result depends on.

    Args:
        stage: Name of the stage.
        version: Version of the stage's code.
        settings: JSON settings.
        inputs: Name of each input to its key.

    Returns:
        64 hexadecimal digits.
    """
    return digest([stage, version, settings, inputs])


@dataclass
class Hashes:
    """Cache of file hashes, each computed once as long as the file's metadata does not change."""

    known: dict[tuple[int, ...], str] = field(default_factory=dict)

    def of(self, path: Path) -> str:
        """Return the hash of a file.

        Args:
            path: The file.

        Returns:
            SHA-256 in 64 hexadecimal digits.
        """
        found = path.stat()
        identity = (found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns)
        if identity not in self.known:
            self.known[identity] = file_digest(path)
        return self.known[identity]


def seal(folder: Path, record: dict[str, Any]) -> dict[str, Any]:
    """Write the manifest of a finished folder, and make every file read-only.

    Args:
        folder: The finished folder.
        record: The task: stage, version, settings and inputs.

    Returns:
        The manifest.
    """
    key = task_key(record["stage"], record["version"], record["settings"], record["inputs"])
    write_manifest(folder, {"format_version": FORMAT_VERSION, "key": key, **record})
    manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    write_json(folder / MANIFEST, {**manifest, "digest": digest(manifest)})
    for path, mode in _entries(folder):
        if stat.S_ISREG(mode):
            path.chmod(_SEALED)  # a stored result is never edited in place
    return manifest


def is_sealed(path: Path) -> bool:
    """Tell whether a file has the mode of the files of a stored result: regular and read-only.

    Args:
        path: The file.
    """
    return path.lstat().st_mode == stat.S_IFREG | _SEALED


def read_manifest(path: Path) -> dict[str, Any]:
    """Read the manifest of a stored result, and verify its digest.

    Args:
        path: The manifest, in the folder of its result or by itself.

    Returns:
        `format_version`, `key`, `stage`, `version`, `settings`, `inputs` and `files`.

    Raises:
        InputError: Missing, not a manifest, or changed.
    """
    try:
        if not path.is_file() or path.is_symlink():
            raise InputError("missing", where=path)
        if path.stat().st_size > LONGEST_MANIFEST:
            raise InputError("too long for a manifest", where=path)
        text = path.read_text(encoding="utf-8")
        manifest = json.loads(text)
        spelled = json.dumps(json.loads(canonical_json(manifest)), sort_keys=True, indent=2) + "\n"
    except (OSError, ValueError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError("not readable as a manifest", where=path) from None
    if not _is_manifest(manifest) or spelled != text:
        raise InputError("changed", where=path)
    said = manifest.pop("digest", None)
    if said != (None if manifest["format_version"] == 1 else digest(manifest)):
        raise InputError("changed", where=path)
    if manifest["key"] != task_key(*(manifest[name] for name in ("stage", "version", "settings", "inputs"))):
        raise InputError("its key is not the hash of its contents", where=path)
    return manifest


def file_faults(folder: Path, files: dict[str, dict[str, Any]], hashes: Hashes | None) -> list[str]:
    """Compare the files of a stored result with its manifest; links out of the folder are not followed.

    Files that another process removes meanwhile are missing.

    Args:
        folder: Folder of the result.
        files: Size and SHA-256 of each, from the manifest.
        hashes: Cache of hashes; None: compare only sizes.

    Returns:
        One line for each file that is missing, changed, extra, or not a regular file.
    """
    wrong, present = [], set()
    for path, mode in _entries(folder):
        name = path.relative_to(folder).as_posix()
        present.add(name)
        if name == MANIFEST:
            continue
        if name not in files:
            wrong.append(f"{name}: not in the manifest")
        elif not stat.S_ISREG(mode):
            wrong.append(f"{name}: not a regular file")
        else:
            try:
                wrong += [] if _is_as_written(path, files[name], hashes) else [f"{name}: changed"]
            except FileNotFoundError:
                present.discard(name)
    return sorted(wrong + [f"{name}: missing" for name in files.keys() - present])


def _is_as_written(path: Path, row: dict[str, Any], hashes: Hashes | None) -> bool:
    return path.stat().st_size == row["bytes"] and (hashes is None or hashes.of(path) == row["sha256"])


def _entries(folder: Path) -> Iterator[tuple[Path, int]]:
    """List the type of everything below a folder except folders; a link to a folder is one entry."""
    with suppress(FileNotFoundError), os.scandir(folder) as found:  # another process may remove the folder meanwhile
        for entry in sorted(found, key=lambda entry: entry.name):
            if entry.is_dir(follow_symlinks=False):
                yield from _entries(Path(entry.path))
            else:
                yield Path(entry.path), entry.stat(follow_symlinks=False).st_mode


def _is_manifest(value: object) -> bool:
    if not isinstance(value, dict) or not {"format_version", "key", "stage", "version", "files"} <= value.keys():
        return False
    tables = [value.get(name) for name in ("settings", "inputs", "files")]
    if value["format_version"] not in range(1, FORMAT_VERSION + 1) or not all(isinstance(t, dict) for t in tables):
        return False
    rows = value["files"].values()
    return all(isinstance(row, dict) and row.keys() == {"bytes", "sha256"} for row in rows) and all(
        isinstance(key, str) for key in value["inputs"].values()
    )
