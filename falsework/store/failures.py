"""Records of rejected and failed tasks, so that they are not repeated in vain."""

import json
import re
import traceback
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from groundwork.canonical import digest
from groundwork.errors import ChildError, FalseworkError, InputError, RejectedSceneError
from groundwork.files import read_json, write_json
from groundwork.marks import TEMPORARY

FORMAT_VERSION = 2  # 1 held only rejections, and no digest
ATTEMPTS = 3  # attempts of a task whose process was killed from outside, such as for lack of memory
LAST_LINES, LINE_LENGTH = 20, 300
STOPPED = ("SIGINT", "SIGTERM", "SIGHUP")  # stopped by a user: not an error of the task
KILLED = "SIGKILL"
RECORD = f"{TEMPORARY}record"  # name in a work folder before it is moved


class QuarantinedError(FalseworkError):
    """A task failed in an earlier run; it is retried only on request."""

    exit_code = 3


@dataclass(frozen=True)
class Failure:
    """Reason why a task has no result.

    Attributes:
        kind: `rejected` (a valid result: the scene does not suffice for a cloud) or `failed`.
        reason: Short code: that of the rejection, or `input`, `child`, `killed` or `internal`.
        message: One line for people.
        signal: Name of the signal that its process died of, or empty.
        last_lines: Last lines of its process on standard error.
        attempts: Number of attempts.
    """

    kind: str
    reason: str
    message: str
    signal: str = ""
    last_lines: tuple[str, ...] = ()
    attempts: int = 1

    @property
    def final(self) -> bool:
        """Whether the next run skips the task."""
        return self.reason != "killed" or self.attempts >= ATTEMPTS

    def as_error(self) -> FalseworkError:
        """Return the error to raise instead of repeating the work."""
        if self.kind == "rejected":
            return RejectedSceneError(self.reason, self.message)
        return QuarantinedError(f"{self.message} (failed before; `falsework run --retry-failed` tries it again)")


def failure_of(error: Exception, attempts: int, root: Path) -> Failure | None:
    """Describe an error; paths below the run become relative to its root, so that the run can be moved.

    Args:
        error: The exception.
        attempts: Number of attempts, this one included.
        root: Output folder of the run.

    Returns:
        The failure; None if a user stopped the process, by one of the signals `STOPPED`.
    """

    def plain(text: str) -> str:
        for place in (str(root.resolve()), str(root)):
            text = _whole(place).sub("OUT", text) if place not in {".", "/"} else text
        return text

    if isinstance(error, RejectedSceneError):
        return Failure("rejected", error.reason, plain(str(error)), attempts=attempts)
    if isinstance(error, ChildError):
        if error.signal in STOPPED:
            return None
        lines = tuple(plain(line)[:LINE_LENGTH] for line in error.last_lines[-LAST_LINES:])
        reason = "killed" if error.signal == KILLED else "child"
        return Failure("failed", reason, plain(str(error)), error.signal, lines, attempts)
    if isinstance(error, InputError):
        return Failure("failed", "input", plain(str(error)), attempts=attempts)
    frames = traceback.extract_tb(error.__traceback__)[-LAST_LINES:]
    lines = tuple(f"{Path(frame.filename).name}:{frame.lineno} {frame.name}" for frame in frames)
    said = " ".join(f"{type(error).__name__}: {plain(str(error))}".split())
    return Failure("failed", "internal", said[:LINE_LENGTH], last_lines=lines, attempts=attempts)


def _whole(place: str) -> re.Pattern[str]:
    """Match a folder's path where it is not part of another name; a relative one, perhaps a word, where it goes on."""
    before, after = (r"(?<![\w.-])", r"(?![\w-]|\.\w)") if place.startswith("/") else (r"(?<![\w./-])", r"(?=/)")
    return re.compile(before + re.escape(place) + after)


def write_failure(path: Path, task: dict[str, Any], failure: Failure, work: Path) -> None:
    """Write a record.

    Args:
        path: File to write.
        task: Stage, version, settings and inputs.
        failure: The failure.
        work: Locked work folder of the task; leftovers of a killed process there are removed.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.is_dir():
        raise InputError("is at the place of a record of Falsework", where=path, hint="Move it elsewhere")
    record = json.loads(json.dumps({"format_version": FORMAT_VERSION, **task, **asdict(failure)}))
    write_json(work / RECORD, {**record, "digest": digest(record)})
    (work / RECORD).replace(path)


def read_failure(path: Path) -> Failure | None:
    """Read a record.

    Args:
        path: Its file.

    Returns:
        The failure; None if there is no record or it is damaged: the task is then retried.
    """
    try:
        record = read_json(path)
        if record.get("format_version", 1) == 1:
            return Failure("rejected", str(record["reason"]), str(record["message"]))
        said = record.pop("digest")
        if said != digest(record):
            return None
        values = {name: record[name] for name in Failure.__dataclass_fields__}
        return Failure(**{**values, "last_lines": tuple(values["last_lines"])})
    except (InputError, OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None
