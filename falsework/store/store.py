"""The artifact store: a folder per result, named by the hash of everything it depends on; present means complete."""

import os
import secrets
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from falsework.stops import stop_behind
from falsework.store.artefact import Hashes, file_faults, read_manifest, seal, task_key
from falsework.store.failures import ATTEMPTS, RECORD, Failure, failure_of, read_failure, write_failure
from falsework.store.foreign import move_away, move_foreign
from falsework.store.textures import STAGE, share_textures
from falsework.store.verification import verify
from falsework.store.workroom import LINKS, remove, set_aside, sweep, work_folder
from groundwork.errors import FalseworkError, InputError, OutOfSpaceError, RejectedSceneError, passing_code
from groundwork.files import MANIFEST, commit_folder, space_errors, write_text
from groundwork.locks import BusyError, hold_lock


@dataclass(frozen=True)
class Task:
    """Description of one result as plain data, so that any worker can make it.

    Attributes:
        stage: Name of the stage that makes it, a row of `falsework.stages.STAGES`.
        version: Version of that stage's code.
        settings: JSON settings that the result depends on, seeds and platform included.
        inputs: Name of each input to the key of the task (or the content hash of the foreign folder) that made it.
        manner: JSON settings of the work (number of processes …) that change no byte of the result.
    """

    stage: str
    version: int
    settings: dict[str, Any]
    inputs: dict[str, str]
    manner: dict[str, Any] = field(default_factory=dict)

    @cached_property
    def key(self) -> str:
        """Hash of everything that the result depends on, 64 hexadecimal digits."""
        return task_key(self.stage, self.version, self.settings, self.inputs)

    @property
    def record(self) -> dict[str, Any]:
        """The data that the key is the hash of."""
        return {"stage": self.stage, "version": self.version, "settings": self.settings, "inputs": self.inputs}


class Store:
    """Results below one folder: `store/<stage>/<key>/`, work in `work/<key>/`, failures in `failed/<key>.json`."""

    def __init__(self, root: Path) -> None:
        """Open a run's output folder.

        Args:
            root: The folder; sub-folders are made as needed.
        """
        self.root = root
        self._hashes: Hashes | None = Hashes()

    def folder(self, task: Task) -> Path:
        """Return the folder of a task's result, whether it exists or not.

        Args:
            task: The task.
        """
        return self.root / "store" / task.stage / task.key

    def has(self, task: Task) -> bool:
        """Tell whether a result exists; a folder with its final name is always complete.

        Args:
            task: The task.
        """
        return (self.folder(task) / MANIFEST).is_file()

    def produce(
        self,
        task: Task,
        make: Callable[[Path], None],
        *,
        resume: bool = False,
        wait: bool = True,
        quarantine: bool = False,
        retry: bool = False,
    ) -> bool:
        """Make a result unless it exists; safe with other processes and against kills.

        Args:
            task: The task.
            make: Function that fills an empty folder.
            resume: Call it with the folder of an interrupted run of the same task instead.
            wait: Wait for another process that is making the same result.
            quarantine: Write a record also of an error, so that the next run skips the task.
            retry: Retry what failed before, except rejections.

        Returns:
            True if it was made, False if it existed.

        Raises:
            RejectedSceneError: The scene was rejected, now or in an earlier run.
            QuarantinedError: It failed in an earlier run.
            BusyError: Another process is making it, and we do not wait.
        """
        if self.has(task):
            return False
        with space_errors(self.root / "work"), work_folder(self.root, task.key, wait=wait) as work:
            if self.has(task):
                return False
            former = self.raise_former_failure(task, retry)
            if not resume or work.is_symlink() or not work.is_dir():
                remove(work)
            work.mkdir(exist_ok=resume)
            try:
                make(work)
            except OutOfSpaceError:
                raise
            except Exception as error:
                if stop := stop_behind(error):
                    raise stop from None
                if isinstance(error, RejectedSceneError) or (quarantine and _is_of_the_task(error)):
                    self._keep_failure(task, work, error, 1 if former is None else former.attempts + 1)
                raise
            manifest = seal(work, task.record)
            if task.stage == STAGE:
                share_textures(self.root, work, manifest["files"])
            self._failure_file(task).unlink(missing_ok=True)
            self._commit(task, work)
        return True

    def faults(self, task: Task) -> list[str]:
        """Compare one stored result with its manifest before it is used: sizes always, hashes once for each file.

        Args:
            task: What made it.

        Returns:
            One line for each fault.
        """
        folder = self.folder(task)
        try:
            manifest = read_manifest(folder / MANIFEST)
        except InputError as error:
            return [str(error)]
        if manifest["key"] != task.key:
            return [f"{folder / MANIFEST}: belongs to another result"]
        return [f"{folder}/{line}" for line in file_faults(folder, manifest["files"], self._hashes)]

    def discard(self, task: Task) -> bool:
        """Remove a damaged result, so that it is remade; files of the user in it are moved to `OUT/foreign`.

        Args:
            task: What made it.

        Returns:
            Whether it was damaged.
        """
        folder = self.folder(task)
        with work_folder(self.root, task.key) as work:
            if not os.path.lexists(folder) or not self.faults(task):
                return False
            move_foreign(self.root, f"{task.stage}/{task.key}")
            set_aside(folder, work)
        return True

    def failure(self, task: Task) -> Failure | None:
        """Return the failure of a task in an earlier run, or None.

        Args:
            task: The task.
        """
        return read_failure(self._failure_file(task))

    def raise_former_failure(self, task: Task, retry: bool = False) -> Failure | None:
        """Refuse a task that was rejected or failed in an earlier run.

        Args:
            task: The task.
            retry: Refuse rejections only.

        Returns:
            The record of an earlier attempt that may be repeated, or None.

        Raises:
            RejectedSceneError: It was rejected.
            QuarantinedError: It failed.
        """
        former = self.failure(task)
        if former is not None and former.final and not (retry and former.kind == "failed"):
            raise former.as_error()
        return former

    def blame(self, task: Task, message: str) -> None:
        """Record that every process which made a result died; the next run skips it.

        Nothing is recorded if the result exists or another process is making it.

        Args:
            task: The task.
            message: One line for people.

        Raises:
            OutOfSpaceError: The disk is full.
        """
        space = space_errors(self.root / "failed")
        with space, suppress(BusyError), work_folder(self.root, task.key, wait=False) as work:
            if self.has(task):
                return
            work.mkdir(exist_ok=True)
            dead = Failure("failed", "killed", message, attempts=ATTEMPTS)
            write_failure(self._failure_file(task), task.record, dead, work)
            remove(work)

    def files(self, task: Task) -> dict[str, Any] | None:
        """Return size and hash of each file of a result; None if its manifest is damaged.

        Args:
            task: What made it.
        """
        try:
            return read_manifest(self.folder(task) / MANIFEST)["files"]
        except InputError:
            return None

    def link(self, name: str, task: Task, file: str = "") -> None:
        """Link a readable name to a stored result with a relative link, replacing an older link atomically.

        Args:
            name: Path below the run's folder, e.g. `scenes/0000/stage`.
            task: What made the result.
            file: File of the result to link to; empty for its folder.

        Raises:
            InputError: The name exists and is not a link.
        """
        link = self.root / name
        text = os.path.relpath(self.folder(task) / file, link.parent)
        with space_errors(link):
            link.parent.mkdir(parents=True, exist_ok=True)
            try:
                link.symlink_to(text)
            except FileExistsError:
                if not link.is_symlink():
                    raise InputError(
                        "is at the place of a link to the store", where=link, hint="Move it elsewhere"
                    ) from None
                self._replace_link(link, text)

    def unlink(self, name: str) -> None:
        """Remove a readable name if it is a link.

        Args:
            name: Path below the run's folder.
        """
        if (self.root / name).is_symlink():
            (self.root / name).unlink(missing_ok=True)

    def evict(self, task: Task, link: str) -> None:
        """Evict a result that was only needed for others; its hashes are recorded, files of the user moved away.

        Args:
            task: What made it.
            link: Readable name of it, path below the run's folder.
        """
        folder, record = self.folder(task), self._eviction(task)
        with space_errors(record), work_folder(self.root, task.key) as work:
            if not self.has(task):
                return  # another process, for which this one waited, has evicted it
            text = (folder / MANIFEST).read_text(encoding="utf-8")
            record.parent.mkdir(parents=True, exist_ok=True)
            work.mkdir(exist_ok=True)
            write_text(work / RECORD, text)
            (work / RECORD).replace(record)
            remove(work)
            (self.root / link).unlink(missing_ok=True)
            move_foreign(self.root, f"{task.stage}/{task.key}")
            set_aside(folder, work)

    def evicted_files(self, task: Task) -> dict[str, Any] | None:
        """Return size and hash of each file of an evicted result; None if it was not evicted.

        Args:
            task: What made it.
        """
        try:
            return read_manifest(self._eviction(task))["files"]
        except InputError:
            return None

    def sweep(self) -> None:
        """Remove leftovers of killed processes that cannot be resumed."""
        present = {path.parent.name for path in self.root.glob(f"store/*/*/{MANIFEST}")}
        for path in sorted(self.root.glob("failed/*.json")):
            if path.stem in present:  # killed between the two
                path.unlink(missing_ok=True)
        failures = ((path.stem, read_failure(path)) for path in self.root.glob("failed/*.json"))
        hopeless = {key for key, failure in failures if failure is not None and failure.final}
        sweep(self.root, lambda key: key in present or key in hopeless)

    def verify(self) -> list[str]:
        """Verify all stored results against their manifests and against links and records.

        Returns:
            One line per file, result, link or record that is missing, changed, misplaced or foreign.
        """
        return verify(self.root)

    def _commit(self, task: Task, work: Path) -> None:
        folder = self.folder(task)
        if os.path.lexists(folder) and not self.has(task):
            if folder.is_symlink() or not folder.is_dir():
                move_away(self.root, folder)
            else:
                move_foreign(self.root, f"{task.stage}/{task.key}")
                remove(folder)  # a result without its manifest does not count
        try:
            commit_folder(work, folder)
        except OSError as error:
            if isinstance(error, FalseworkError) or not self.has(task):
                raise
            remove(work)  # without locks another process was faster, with the same bytes

    def _replace_link(self, link: Path, text: str) -> None:
        if str(link.readlink()) == text:
            return
        room = self.root / "work"
        room.mkdir(parents=True, exist_ok=True)
        lock = room / f"{LINKS}.lock"
        with hold_lock(lock) as held:
            fresh = room / f"{LINKS}.{secrets.token_hex(8)}"
            fresh.symlink_to(text)
            fresh.replace(link)
            if held:
                lock.unlink(missing_ok=True)

    def _eviction(self, task: Task) -> Path:
        return self.root / "evicted" / task.stage / f"{task.key}.json"

    def _failure_file(self, task: Task) -> Path:
        return self.root / "failed" / f"{task.key}.json"

    def _keep_failure(self, task: Task, work: Path, error: Exception, attempts: int) -> None:
        failure = failure_of(error, attempts, self.root)
        if failure is None:
            return
        write_failure(self._failure_file(task), task.record, failure, work)
        if failure.final:
            remove(work)


def _is_of_the_task(error: Exception) -> bool:
    """Tell whether a retry must fail in the same way; after system errors (network down …) it may not."""
    return not passing_code(error) and (
        isinstance(error, FalseworkError) or not isinstance(error, OSError | MemoryError)
    )
