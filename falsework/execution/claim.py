"""The output folder of a run belongs to several processes at once: each claims it, and none stumbles over another."""

import os
from pathlib import Path

from falsework.execution.locks import exclusive
from falsework.scenario import Scenario
from groundwork.errors import InputError
from groundwork.files import MARK, claim_output, space_errors, write_text

KIND = "run"


def claim_run(out: Path, scenario: Scenario) -> None:
    """Make and mark the output folder of a run, or join the processes that share it.

    Args:
        out: Output folder: absent, empty, or of a run.
        scenario: What to make; kept in the folder with paths that hold from there.

    Raises:
        InputError: The folder is not ours or not writable.
    """
    try:
        claim_output(out, KIND)
    except InputError:
        if not _being_claimed(out):
            raise
    with space_errors(out):
        Path(os.path.realpath(out)).mkdir(parents=True, exist_ok=True)  # `out` may be a link to what is not yet
        handle = os.open(out / MARK, os.O_WRONLY | os.O_CREAT | os.O_NOFOLLOW, 0o644)
        try:
            os.pwrite(handle, f"{KIND}\n".encode(), 0)  # the same few bytes, whoever comes first
        finally:
            os.close(handle)
        (out / "run").mkdir(exist_ok=True)
        text = scenario.as_toml(out)
        with exclusive(out / "run" / "scenario.lock"):
            if not _says(out / "scenario.toml", text):
                write_text(out / "scenario.toml", text)


def _being_claimed(out: Path) -> bool:
    """Whether another process has only just made the mark, or has finished it since we looked."""
    mark = out / MARK
    if not mark.is_file():
        return False
    found = mark.read_text(encoding="utf-8", errors="replace").strip()
    return found == KIND or (found == "" and [path.name for path in out.iterdir()] == [MARK])


def _says(path: Path, text: str) -> bool:
    try:
        return path.read_text(encoding="utf-8") == text
    except (OSError, UnicodeDecodeError):
        return False
