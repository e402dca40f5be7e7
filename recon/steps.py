"""The steps of a reconstruction on disk: one folder per step, named by a hash of its inputs, so that none is repeated.

A finished step has the name `<step>-<recipe>`; an interrupted one has the suffix `.partial`. Both are in the work
folder of the unfinished cloud, which is removed when the cloud is finished.
"""

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from groundwork.canonical import digest
from groundwork.files import commit_folder, read_json, space_errors, write_json

_RESULT = "result.json"
_DIGITS = 16  # of the recipe's hash in a folder's name


@dataclass(frozen=True)
class Step:
    """A finished step.

    Attributes:
        folder: Its files.
        recipe: Hash of everything that they depend on; part of the recipe of the step that follows.
        result: JSON value that it returned.
    """

    folder: Path
    recipe: str
    result: Any


def take_step(work: Path, name: str, recipe: object, make: Callable[[Path], Any]) -> Step:
    """Reuse a finished step of this recipe, or run it; remove the results of other recipes.

    Args:
        work: Existing work folder.
        name: Name of the step.
        recipe: JSON value that holds everything the result depends on, including the recipe of the step before.
        make: Runs the step in a folder and returns JSON. The folder may hold files of an interrupted run of the same
            recipe: the function continues from them, or removes them.

    Returns:
        The finished step.

    Raises:
        OutOfSpaceError: The disk is full; finished steps stay.
    """
    key = digest([name, recipe])
    final = work / f"{name}-{key[:_DIGITS]}"
    partial = final.with_name(f"{final.name}.partial")
    for other in sorted(work.glob(f"{name}-*")):
        if other not in (final, partial):
            shutil.rmtree(other, ignore_errors=True)
    if not final.is_dir():
        with space_errors(partial):
            partial.mkdir(exist_ok=True)
            write_json(partial / _RESULT, make(partial))
            commit_folder(partial, final)
    return Step(final, key, read_json(final / _RESULT))


def enter_work(folder: Path) -> Path:
    """Open the work folder of an unfinished cloud, and remove everything else that an interrupted run left.

    Args:
        folder: The cloud's folder: empty, or left by an interrupted run.

    Returns:
        Work folder; finished steps of an earlier run are in it.
    """
    work = folder / "work"
    for path in sorted(folder.iterdir()):
        if path != work:
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    work.mkdir(exist_ok=True)
    return work


def leave_work(work: Path) -> None:
    """Remove the work folder; it is renamed first, so that a half-deleted folder is never taken for a complete one.

    Args:
        work: Work folder of a finished cloud.
    """
    discarded = work.with_name("discarded")
    work.rename(discarded)
    shutil.rmtree(discarded)
