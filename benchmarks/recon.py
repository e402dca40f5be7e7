"""Compare ways to structure from motion on the same photographs, and write `docs/benchmarks/recon.md`.

Usage: python -m benchmarks.recon [CAPTURE] [--images 60 200] [--openmvg PYTHON]

CAPTURE is a capture with truth; without it the demo is rendered with as many images as the largest count. Each way runs
in children, whose processor time is taken, all threads together. PYTHON is an interpreter that has openmvg-rs.
"""

import argparse
import resource
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.colmap_defaults import STEPS, Found, found_in, run_defaults
from falsework.pipeline import run_scenario
from falsework.platform import processor
from falsework.scenario import demo_scenario
from groundwork.errors import RejectedSceneError
from groundwork.files import read_json, write_json, write_text
from groundwork.progress import SILENT, Silent
from recon.align import Target, align
from recon.settings import AlignmentSettings, ReconSettings, SparseSettings
from recon.sparse import run_sparse
from render.capture import CAMERAS, Capture, read_capture, read_truth

PAGE = Path(__file__).resolve().parents[1] / "docs" / "benchmarks" / "recon.md"
LIMIT = 0.5  # [m] a camera farther off does not count as right


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes:
        name: The way.
        images: Number of photographs.
        found: What it made of them, the time of steps that were taken over included.
        registered: Share of the photographs in the largest model [1].
        median: Median distance of right camera centres to the truth [m].
        p95: Their 95 % quantile [m].
    """

    name: str
    images: int
    found: Found
    registered: float
    median: float
    p95: float


Run = Callable[[Capture, Path], Found]


def main() -> None:
    """Measure every way at every count, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("capture", nargs="?", type=Path)
    parser.add_argument("--images", nargs="+", type=int, default=[60])
    parser.add_argument("--openmvg", type=Path)
    asked = parser.parse_args()
    ways = WAYS | ({"openmvg-rs, SIFT": _peer(asked.openmvg)} if asked.openmvg else {})
    with tempfile.TemporaryDirectory() as scratch:
        source = asked.capture or _rendered(Path(scratch), max(asked.images))
        rows: list[Row] = []
        for count in asked.images:
            for row in _compare(ways, source, count, Path(scratch)):
                rows.append(row)
                write_text(PAGE, _page(rows))  # hours may lie between two rows


def _compare(ways: dict[str, Run], source: Path, count: int, scratch: Path) -> Iterator[Row]:
    """Go every way with the same photographs; our ways share their keypoints, and pay for them each."""
    capture, work = _first(source, count, scratch / f"images{count}"), scratch / f"work{count}"
    work.mkdir()
    paid: dict[str, float] = {}
    for name, run in ways.items():
        found = run(capture, work)
        if name in OURS:
            paid |= found.seconds
            found = replace(found, seconds=dict(paid))
        yield _judged(name, capture, found, source)


def _with(**changes: object) -> Run:
    """Reconstruct with our settings and some of them changed."""

    def run(capture: Capture, work: Path) -> Found:
        settings, meter = ReconSettings(sparse=SparseSettings.model_validate(changes)), Meter()
        try:
            found = run_sparse(capture, work, settings, meter)
        except RejectedSceneError as error:
            return Found((), np.zeros((0, 4, 4)), 0, error.reason, meter.finished())
        return found_in(found.model, found.facts["pairs"], meter.finished())

    return run


class Meter(Silent):
    """Takes the processor time of each step: of the children that have ended when the next one says that it begins."""

    def __init__(self) -> None:
        """Start the clock."""
        self._last, self._name, self._seconds = _children(), "", dict[str, float]()

    def stage(self, name: str, total: int) -> None:
        """Close the step before and open another."""
        name = name.partition(",")[0]
        if name in STEPS and name != self._name:
            self._close()
            self._name = name

    def finished(self) -> dict[str, float]:
        """Close the last step and return the processor time of each [s]."""
        self._close()
        return self._seconds

    def _close(self) -> None:
        now = _children()
        if self._name:
            self._seconds[self._name] = now - self._last
            self._last = now


def _children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


OURS: dict[str, Run] = {
    "ours: nearest 20 by GPS, incremental": _with(mapper="incremental"),
    "ours: nearest 20 by GPS, global": _with(mapper="global"),
    "no GPS: next 10 and leaps, incremental": _with(pairing="sequential", mapper="incremental"),
    "every pair, incremental": _with(pairing="exhaustive", mapper="incremental"),
}
WAYS: dict[str, Run] = {**OURS, "pycolmap's defaults": run_defaults}


def _peer(python: Path) -> Run:
    """Reconstruct with openmvg-rs in an interpreter that has it."""

    def run(capture: Capture, work: Path) -> Found:
        answer = work / "openmvg.json"
        script = Path(__file__).resolve().parent / "peers" / "in_openmvg.py"
        subprocess.run([python, script, capture.folder / "images", answer], check=True)
        found = read_json(answer)
        poses = np.tile(np.eye(4), (len(found["views"]), 1, 1))
        poses[:, :3, :3] = np.array([view["rotation"] for view in found["views"]]).transpose(0, 2, 1)
        poses[:, :3, 3] = [view["center"] for view in found["views"]]
        names = tuple(f"images/{view['name']}" for view in found["views"])
        return Found(names, poses, found["points"], "its own", {"all": found["seconds"]})

    return run


def _rendered(scratch: Path, count: int) -> Path:
    scenario = demo_scenario()
    flight = scenario.survey[0].model_copy(update={"images": count})
    outcome = run_scenario(scenario.model_copy(update={"survey": (flight,)}), scratch / "run", SILENT)
    return outcome.clouds[0].parents[1] / "capture" / outcome.clouds[0].name


def _first(source: Path, count: int, folder: Path) -> Capture:
    """Take the first images of a flight, without its truth."""
    if not folder.is_dir():
        (folder / "images").mkdir(parents=True)
        stored = read_json(source / CAMERAS)
        chosen = stored["images"][:count]
        for image in chosen:
            (folder / image["file"]).symlink_to((source / image["file"]).resolve())
        write_json(folder / CAMERAS, {**stored, "images": chosen})
    return read_capture(folder)


def _judged(name: str, capture: Capture, found: Found, source: Path) -> Row:
    count = len(capture.images)
    if not found.names:
        return Row(name, count, found, 0.0, np.nan, np.nan)
    truth = read_truth(read_capture(source))
    if truth is None:
        raise ValueError("a capture without truth")
    row_of = {image.file: row for row, image in enumerate(capture.images)}
    rows = np.array([row_of[file] for file in found.names], np.int64)
    target = Target("truth", truth.poses[:count, :3, 3], truth.poses[:count, :3, :3], LIMIT)
    errors = align(found.poses, rows, target, AlignmentSettings(), np.random.default_rng(0)).centre_errors
    good = errors[errors <= LIMIT]
    return Row(name, count, found, len(rows) / count, float(np.median(good)), float(np.quantile(good, 0.95)))


def _page(rows: list[Row]) -> str:
    lines = [
        "# Structure from motion, several ways",
        "",
        f"Written by `python -m benchmarks.recon`. Processor time, all threads together, of {processor()}; the same "
        "photographs for all, the same keypoints for all but the defaults. Centre errors after alignment to the truth, "
        f"of cameras within {LIMIT} m.",
        "",
        "| way | images | pairs | features [s] | matching [s] | mapping [s] | all [s] | registered "
        "| centre error, median [mm] | 95 % [mm] | points |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
        *(_line(row) for row in rows),
        "",
    ]
    return "\n".join(lines)


def _line(row: Row) -> str:
    seconds = row.found.seconds
    times = " | ".join(f"{seconds[step]:.0f}" if step in seconds else "" for step in STEPS)
    return (
        f"| {row.name} | {row.images} | {row.found.pairs} | {times} | {sum(seconds.values()):.0f} | "
        f"{row.registered:.0%} | {1000 * row.median:.1f} | {1000 * row.p95:.1f} | {row.found.points:,} |"
    )


if __name__ == "__main__":
    main()
