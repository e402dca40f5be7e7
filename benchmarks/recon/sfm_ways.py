"""Ways from photographs to camera poses, functions of a capture and a work folder; their times outlive a kill."""

import resource
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.recon.colmap_defaults import STEPS, TIME_LIMIT, Found, found_in, run_defaults
from groundwork.errors import ChildError, RejectedSceneError
from groundwork.files import read_json, write_json
from groundwork.progress import Silent
from recon.settings import ReconSettings, SparseSettings
from recon.sfm.sparse import run_sparse
from render.capture import Capture

Run = Callable[[Capture, Path], Found]

_FOLDERS = dict(zip(STEPS, ("features", "matches", "model"), strict=True))  # as `recon.sfm.sparse` names the steps
_COST = "processor_seconds.json"  # in the folder of a finished step: what it cost
_LIMITS = {"seconds_per_image": 3600.0, "memory_limit": 24.0}  # every pair of 400 images takes hours


def with_settings(**changes: object) -> Run:
    """Reconstruct with our settings and some of them changed; ways share the steps that they have in common.

    Args:
        changes: Fields of `SparseSettings`.
    """

    def run(capture: Capture, work: Path) -> Found:
        settings = ReconSettings(sparse=SparseSettings.model_validate({**_LIMITS, **changes}))
        _clear_unpaid(work)
        meter = Meter(work)
        try:
            found = run_sparse(capture, work, settings, meter)
        except RejectedSceneError as error:
            meter.close()
            return nothing(error.reason, paid(work))
        meter.close()
        return found_in(found.model, found.facts["pairs"], paid(work))

    return run


def nothing(reason: str, seconds: dict[str, float]) -> Found:
    """Build the row of a method that made no model.

    Args:
        reason: Why.
        seconds: What that took.
    """
    return Found((), np.zeros((0, 4, 4)), 0, reason, seconds)


class Meter(Silent):
    """Notes the processor time of each step in its folder: of the children that end before the next one begins."""

    def __init__(self, work: Path) -> None:
        """Start the clock.

        Args:
            work: Where the steps' folders are.
        """
        self._work, self._last, self._name = work, _children(), ""

    def stage(self, name: str, total: int) -> None:
        """Close the step before and open another."""
        name = name.partition(",")[0]
        if name in STEPS and name != self._name:
            self.close()
            self._name = name

    def close(self) -> None:
        """Note what the last step cost."""
        now = _children()
        for folder in _finished(self._work, self._name):
            write_json(folder / _COST, now - self._last)
        self._last, self._name = now, ""


def paid(work: Path) -> dict[str, float]:
    """Read the recorded cost of the finished steps of a work folder.

    Args:
        work: Work folder.

    Returns:
        Processor time of each step [s].
    """
    return {step: read_json(folder / _COST) for step in STEPS for folder in _finished(work, step)}


def _finished(work: Path, step: str) -> list[Path]:
    if step not in STEPS:
        return []
    return [path for path in sorted(work.glob(f"{_FOLDERS[step]}-*")) if path.suffix != ".partial"]


def _clear_unpaid(work: Path) -> None:
    """Remove models, which each method makes again, and interrupted steps, whose cost is unknown."""
    for folder in sorted(work.glob("*-*")):
        if folder.name.startswith(_FOLDERS["mapping"]) or not (folder / _COST).is_file():
            shutil.rmtree(folder)


def _children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def with_openmvg(python: Path) -> Run:
    """Reconstruct with openmvg-rs.

    Args:
        python: An interpreter that has it.
    """

    def run(capture: Capture, work: Path) -> Found:
        answer, script = work / "openmvg.json", Path(__file__).resolve().parents[1] / "peers" / "in_openmvg.py"
        command = [python, script, capture.folder / "images", answer]
        done = subprocess.run(command, capture_output=True, text=True, timeout=TIME_LIMIT, check=False)
        if done.returncode:
            lines = [line for line in done.stderr.splitlines() if line.strip()]
            raise ChildError(f"openmvg-rs: {lines[-1] if lines else f'exit code {done.returncode}'}")
        found = read_json(answer)
        if not found["views"]:
            return nothing("no_model", {"all": found["seconds"]})
        poses = np.tile(np.eye(4), (len(found["views"]), 1, 1))
        poses[:, :3, :3] = np.array([view["rotation"] for view in found["views"]]).transpose(0, 2, 1)
        poses[:, :3, 3] = [view["center"] for view in found["views"]]
        names = tuple(f"images/{view['name']}" for view in found["views"])
        thrice = float(np.mean(np.array(found["track_lengths"]) >= 3))
        return Found(names, poses, found["points"], "its own", {"all": found["seconds"]}, thrice)

    return run


TITLES: dict[str, str] = {
    "spatial": "ours: nearest 20 by GPS, incremental",
    "global": "nearest 20 by GPS, global mapper",
    "sequential": "no GPS: next 10 and leaps, incremental",
    "exhaustive": "every pair, incremental",
    "defaults": "pycolmap's defaults",
    "openmvg": "openmvg-rs, SIFT, incremental",
}
"""What each way does, by its name."""

WAYS: dict[str, Run] = {
    "spatial": with_settings(mapper="incremental"),
    "global": with_settings(mapper="global"),
    "sequential": with_settings(pairing="sequential", mapper="incremental"),
    "exhaustive": with_settings(pairing="exhaustive", mapper="incremental"),
    "defaults": run_defaults,
}
"""How; the cheap ones first. openmvg-rs joins them where there is a Python that has it."""
