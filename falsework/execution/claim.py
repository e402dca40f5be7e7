"""The output folder of a run belongs to several processes at once: each claims it, and none stumbles over another."""

from pathlib import Path

from falsework.scenario import Scenario, given_files
from groundwork import output_folder
from groundwork.errors import InputError
from groundwork.files import space_errors, write_text
from groundwork.locks import hold_lock
from groundwork.marks import MARK


def claim_run(out: Path, scenario: Scenario) -> None:
    """Make and mark the output folder of a run, or join the processes that share it.

    Args:
        out: Output folder: absent, empty, or of a run.
        scenario: What to make; kept in the folder with paths that hold from there.

    Raises:
        InputError: The folder is not ours or not writable.
    """
    inputs = run_inputs(scenario)
    try:
        output_folder.claim_run(out, inputs)
    except InputError:
        if not (out / MARK).is_file():
            raise
        output_folder.claim_run(out, inputs)  # another process has made its mark while we looked
    with space_errors(out):
        (out / "run").mkdir(exist_ok=True)
        text = scenario.as_toml(out)
        with hold_lock(out / "run" / "scenario.lock"):
            if not _says(out / "scenario.toml", text):
                write_text(out / "scenario.toml", text)


def run_inputs(scenario: Scenario) -> list[Path]:
    """Name the files and folders from outside that a run is made from.

    Args:
        scenario: What to make.
    """
    return [*given_files(scenario).values(), *([Path(scenario.stage.path)] if scenario.stage else [])]


def _says(path: Path, text: str) -> bool:
    try:
        return path.read_text(encoding="utf-8") == text
    except (OSError, UnicodeDecodeError):
        return False
