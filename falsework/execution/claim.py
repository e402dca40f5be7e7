"""Claiming of a run's output folder, which several processes may share."""

import os
import re
from pathlib import Path

from falsework.scenario import Scenario, given_files
from falsework.stages import STAGES
from falsework.store.textures import POOL
from groundwork.errors import InputError
from groundwork.files import space_errors, write_text
from groundwork.foreign_file import is_regular, read_regular
from groundwork.locks import hold_lock
from groundwork.marks import MARK, TEMPORARY
from groundwork.output import folder as output_folder

_FOLDERS = ("store", "work", "run", "failed", "scenes", "evicted", "foreign")  # that a run makes
_FILES = ("scenario.toml", "run/report.html")
_LEFT = re.compile(re.escape(TEMPORARY) + "[0-9a-f]{16}")  # temporary names of groundwork.files


def claim_run(out: Path, scenario: Scenario) -> None:
    """Make and mark the output folder of a run, or join the processes that share it.

    Args:
        out: Output folder: absent, empty, or of a run.
        scenario: The scenario; stored in the folder with paths relative to it.

    Raises:
        InputError: Falsework did not write the folder, or it is not writable.
    """
    inputs = run_inputs(scenario)
    try:
        output_folder.claim_run(out, inputs)
    except (InputError, FileNotFoundError):  # or another process removed our unfinished mark as a leftover
        if not is_regular(out / MARK):
            raise
        output_folder.claim_run(out, inputs)  # another process has marked it meanwhile
    with space_errors(out):
        _check_folders(out, scenario.scenes)
        for name in ("run", "scenes"):  # also where every scene fails, so that the folder is that of a run
            (out / name).mkdir(exist_ok=True)
        text = scenario.as_toml(out)
        with hold_lock(out / "run" / "scenario.lock") as held:
            if held:
                _sweep_names(out)
            if not _says(out / "scenario.toml", text):
                write_text(out / "scenario.toml", text)


def _check_folders(out: Path, scenes: int) -> None:
    """Refuse what would be in the way after hours of work."""
    inner = [f"{name}/{stage}" for name in ("store", "evicted") for stage in (*STAGES, POOL)]
    there = sorted(path.name for path in (out / "scenes").iterdir()) if (out / "scenes").is_dir() else []
    ours = [f"scenes/{name}" for name in there if name.isdecimal() and int(name) < scenes]
    inner += [
        name for scene in ours for name in (scene, *(f"{scene}/{kind}" for kind in ("capture", "model", "cloud")))
    ]
    for path in (out / name for name in (*_FOLDERS, *inner)):
        if os.path.lexists(path) and not path.is_dir():
            raise InputError("is in the way of a folder", where=path, hint="Move it elsewhere")
    for path in (out / name for name in _FILES):
        if path.is_dir():
            raise InputError("is in the way of a file", where=path, hint="Move it elsewhere")


def run_inputs(scenario: Scenario) -> list[Path]:
    """List the external files and folders of a run.

    Args:
        scenario: What to make.
    """
    return [*given_files(scenario).values(), *([Path(scenario.stage.path)] if scenario.stage else [])]


def _sweep_names(out: Path) -> None:
    """Remove temporary files of processes that were killed while they wrote the mark or the scenario."""
    for path in sorted(out.glob(f"{TEMPORARY}*")):
        if _LEFT.fullmatch(path.name) and path.is_file() and not path.is_symlink():
            path.unlink(missing_ok=True)


def _says(path: Path, text: str) -> bool:
    try:
        return read_regular(path) == text.encode()
    except InputError:
        return False
