"""The artefact store: a folder per result, named by the hash of everything it depends on; present means complete."""

import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from groundwork.canonical import digest
from groundwork.errors import InputError, RejectedSceneError
from groundwork.files import (
    MANIFEST,
    check_manifest,
    commit_folder,
    folder_lock,
    read_json,
    space_errors,
    write_json,
    write_manifest,
)

FORMAT_VERSION = 1


@dataclass(frozen=True)
class Task:
    """One result that shall exist: plain data, so that any worker can take it.

    Attributes:
        stage: Name of the stage that makes it, a row of `falsework.stages.STAGES`.
        version: Version of that stage's code.
        settings: JSON settings that the result depends on, seeds and platform included.
        inputs: Name of each input to the key of the task (or the content hash of the foreign folder) that made it.
        manner: JSON settings of how the work is done (number of processes …) that change no byte of the result.
    """

    stage: str
    version: int
    settings: dict[str, Any]
    inputs: dict[str, str]
    manner: dict[str, Any] = field(default_factory=dict)

    @property
    def key(self) -> str:
        """Hash of everything that the result depends on, 64 hexadecimal digits."""
        return digest([self.stage, self.version, self.settings, self.inputs])


class Store:
    """Results below one folder: `store/<stage>/<key>/`, work in `work/<key>/`, rejections in `failed/<key>.json`."""

    def __init__(self, root: Path) -> None:
        """Point at a run's output folder.

        Args:
            root: The folder; sub-folders are made as needed.
        """
        self.root = root

    def folder(self, task: Task) -> Path:
        """Tell where a task's result stands, or will stand.

        Args:
            task: The task.
        """
        return self.root / "store" / task.stage / task.key

    def has(self, task: Task) -> bool:
        """Tell whether a result is there; a folder under its final name is always whole.

        Args:
            task: The task.
        """
        return (self.folder(task) / MANIFEST).is_file()

    def produce(self, task: Task, make: Callable[[Path], None], *, resume: bool = False) -> bool:
        """Make a result unless it is there already; safe against other processes and against being killed.

        Args:
            task: What to make.
            make: Called with an empty folder to fill.
            resume: Call it with what an interrupted run of the same task left instead.

        Returns:
            True when it was made now, False when it was there.

        Raises:
            RejectedSceneError: The scene was rejected, now or in an earlier run.
        """
        if self.has(task):
            return False
        work = self.root / "work" / task.key
        lock = work.with_name(f"{task.key}.lock")
        with space_errors(work):
            work.parent.mkdir(parents=True, exist_ok=True)
            with folder_lock(lock):
                if self.has(task):
                    return False
                self._raise_former_rejection(task)
                if not resume:
                    shutil.rmtree(work, ignore_errors=True)
                work.mkdir(exist_ok=resume)
                try:
                    make(work)
                except RejectedSceneError as error:
                    self._keep_rejection(task, error)
                    shutil.rmtree(work, ignore_errors=True)
                    raise
                write_manifest(work, {"format_version": FORMAT_VERSION, "key": task.key, **_record(task)})
                for path in work.rglob("*"):
                    if path.is_file():
                        path.chmod(0o444)  # a stored result is never edited in place
                commit_folder(work, self.folder(task))
                lock.unlink()
        return True

    def verify(self) -> list[str]:
        """Compare every stored result with its manifest.

        Returns:
            One line per file that is missing, changed or extra.
        """
        folders = sorted(path.parent for path in self.root.glob(f"store/*/*/{MANIFEST}"))
        return [f"{folder.relative_to(self.root)}/{line}" for folder in folders for line in check_manifest(folder)]

    def _failure(self, task: Task) -> Path:
        return self.root / "failed" / f"{task.key}.json"

    def _raise_former_rejection(self, task: Task) -> None:
        path = self._failure(task)
        if path.is_file():
            record = read_json(path)
            raise RejectedSceneError(record["reason"], record["message"])

    def _keep_rejection(self, task: Task, error: RejectedSceneError) -> None:
        path = self._failure(task)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_json(path, {**_record(task), "reason": error.reason, "message": str(error)})


def link_result(link: Path, target: Path) -> None:
    """Point a readable name at a stored result with a relative link, replacing an older one at once.

    Args:
        link: The name, e.g. `scenes/0000/stage`.
        target: The stored folder or file.

    Raises:
        InputError: Something that is not a link stands there.
    """
    link.parent.mkdir(parents=True, exist_ok=True)
    if link.exists() and not link.is_symlink():
        raise InputError("is in the way of a link to the store", where=link, mend="Move it elsewhere")
    fresh = link.with_name(f".{link.name}.link")
    fresh.unlink(missing_ok=True)
    fresh.symlink_to(os.path.relpath(target, link.parent))
    fresh.replace(link)


def _record(task: Task) -> dict[str, Any]:
    return {"stage": task.stage, "version": task.version, "settings": task.settings, "inputs": task.inputs}
