"""Compare ways to structure from motion on the same photographs, and write `docs/benchmarks/recon.md`.

Usage: python -m benchmarks.recon.sfm [CAPTURE] [--images 60 200 400] [--ways NAME …] [--openmvg PYTHON] [--work DIR]

CAPTURE is a capture with truth; without it, the flight of the first scene of `scenarios/paper-global.toml` is rendered
with 400 images. Each count takes the first images of the flight. Each way runs in children, whose processor time is
taken, all threads together. PYTHON is an interpreter that has openmvg-rs. Every pair of 400 images takes hours, so
finished rows stay in a folder beside the page, for this flight and this kind of processor: the same command goes on
after an interruption, and another count or way, on another day, adds its rows. A row of ours that earlier code measured
is measured again where it is asked for; elsewhere it stays, with a mark, and the page states no code.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
from dataclasses import asdict, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from benchmarks.page import words_of, write_page
from benchmarks.recon.colmap_defaults import Found
from benchmarks.recon.sfm_page import LIMIT, Row, of_earlier_code, render_page
from benchmarks.recon.sfm_ways import TITLES, WAYS, Run, nothing, with_openmvg
from benchmarks.speed_unit import this_machine
from falsework.platform import processor
from falsework.scenario import load_scenario, scene_seed
from falsework.stages import STAGES
from groundwork.canonical import digest, file_digest
from groundwork.errors import ChildError, RejectedSceneError
from groundwork.files import read_json, write_json, write_text
from groundwork.progress import SILENT
from recon.placing.align import Target, align
from recon.settings import AlignmentSettings
from render.capture import CAMERAS, Capture, Truth, read_capture, read_truth
from tests.provenance import digest_of

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "benchmarks" / "recon.md"
SCENARIO = ROOT / "scenarios" / "paper-global.toml"
FLIGHT = 400  # images of the flight that is rendered where no capture is named
_FAILED = "failed"  # in the place of a number of pairs
_VERSION = 1  # raised when rows of an earlier version of this benchmark no longer compare


def main() -> None:
    """Measure every way at every count, and write the page after each."""
    asked = _arguments()
    ways = WAYS | ({"openmvg": with_openmvg(asked.openmvg)} if asked.openmvg else {})
    source = asked.capture or _rendered(asked.work / "rendered", FLIGHT)
    capture = read_capture(source)
    truth = read_truth(capture)
    if truth is None:
        sys.exit(f"{source}: the capture has no truth to compare with")
    if len(capture.images) < max(asked.images):
        sys.exit(f"{source}: {len(capture.images)} images, {max(asked.images)} wanted. Lower --images")
    flight = digest([file_digest(source / CAMERAS), file_digest(source / "truth" / "poses.json")])[:12]
    work = asked.work / flight
    words = f"The first photographs, {capture.size[0]} x {capture.size[1]} px, of one flight."
    rows = _Rows(asked.page.with_suffix("") / flight, asked.page, words, digest_of(Path(__file__).resolve()))
    for count in sorted(set(asked.images)):
        for name, run in ways.items():
            if name in asked.ways and not rows.has(name, count):
                rows.add(_measured(name, run, _first(source, count, work / f"images{count}"), truth, work))
        shutil.rmtree(work / f"steps{count}", ignore_errors=True)
    rows.write_page()


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", nargs="?", type=Path)
    parser.add_argument("--images", nargs="+", type=int, default=[60], metavar="N")
    parser.add_argument(
        "--ways",
        nargs="+",
        default=list(TITLES),
        choices=list(TITLES),
        metavar="NAME",
        help=f"ways to go: {', '.join(TITLES)}; all of them by default",
    )
    parser.add_argument("--openmvg", type=Path, metavar="PYTHON")
    parser.add_argument("--work", type=Path, default=Path(tempfile.gettempdir()) / "falsework-bench-recon")
    parser.add_argument("--page", type=Path, default=PAGE)
    return parser.parse_args()


class _Rows:
    """The finished rows: a file each, so that none is measured twice; and the page that they make."""

    def __init__(self, folder: Path, page: Path, source: str, code: str) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder, self._page, self._source, self._code = folder, page, source, code
        self._failed: list[Row] = []

    def has(self, way: str, count: int) -> bool:
        path = self._path(way, count)
        return path.is_file() and not of_earlier_code(Row(**read_json(path)), self._code)

    def add(self, row: Row) -> None:
        """Keep a row and rewrite the page; one that failed is shown, and tried again by the next run."""
        if row.pairs == _FAILED:
            self._failed.append(row)
        else:
            write_json(self._path(row.way, row.images), asdict(replace(row, code=self._code)))
        sys.stderr.write(f"{row.title}, {row.images} images: {row.total:.0f} s, {row.registered:.0%} registered\n")
        self.write_page()

    def write_page(self) -> None:
        keys = {self._key(way) for way in TITLES}
        found = [path for path in self._folder.iterdir() if path.stem.rpartition("-")[0] in keys]
        rows = [Row(**read_json(path)) for path in found] + self._failed
        rows.sort(key=lambda row: (row.images, list(TITLES).index(row.way)))
        write_page(self._page, render_page(rows, self._source, this_machine(), self._code), __file__)
        if any(of_earlier_code(row, self._code) for row in rows):
            write_text(self._page, f"{words_of(self._page).rstrip()}\n")

    def _path(self, way: str, count: int) -> Path:
        return self._folder / f"{self._key(way)}-{count}.json"

    def _key(self, way: str) -> str:
        return f"{way}-{digest([_VERSION, version('pycolmap'), processor()])[:8]}"


def _measured(name: str, run: Run, capture: Capture, truth: Truth, work: Path) -> Row:
    """Run one method; a failed one gets a row with its failure, and the others continue."""
    steps = work / f"steps{len(capture.images)}"
    steps.mkdir(exist_ok=True)
    title = TITLES[name]
    try:
        found = run(capture, steps)
    except (ChildError, subprocess.TimeoutExpired) as error:
        title, found = f"{title}: {error}", nothing(_FAILED, {})
    return _judged(name, title, capture, found, truth)


def _judged(name: str, title: str, capture: Capture, found: Found, truth: Truth) -> Row:
    count = len(capture.images)
    row_of = {image.file: row for row, image in enumerate(capture.images)}
    rows = np.array([row_of[file] for file in found.names], np.int64)
    target = Target("truth", truth.poses[:count, :3, 3], truth.poses[:count, :3, :3], LIMIT)
    try:
        errors = align(found.poses, rows, target, AlignmentSettings(), np.random.default_rng(0)).center_errors
        good = errors[errors <= LIMIT]
    except RejectedSceneError:  # nothing to align, or nothing that fits
        good = np.zeros(0)
    median, p95 = (float(np.quantile(good, share)) if len(good) else None for share in (0.5, 0.95))
    return Row(
        name,
        title,
        count,
        dict(found.seconds),
        found.pairs,
        found.points,
        len(rows) / count,
        len(good) / count,
        median,
        p95,
        found.thrice,
    )


def _rendered(folder: Path, count: int) -> Path:
    """Render the flight of the paper's first global scene with a number of images; resumes after interruption."""
    scenario = load_scenario(SCENARIO)
    flight = scenario.survey[0].model_copy(update={"images": count})
    scenario = scenario.model_copy(update={"survey": (flight,)})
    stage, shots, seed = folder / f"stage{count}", folder / f"capture{count}", scene_seed(scenario.seed, 0)
    if not (stage / "scene.usda").is_file():
        shutil.rmtree(stage, ignore_errors=True)
        partial = stage.with_suffix(".partial")
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir(parents=True)
        STAGES["stage"].run({"seed": seed, "authoring": scenario.authoring()}, {}, partial, SILENT)
        partial.rename(stage)
    if not (shots / "truth" / "render.json").is_file():  # written last
        shots.mkdir(exist_ok=True)
        request = {"seed": seed, "survey": flight.id, "render": scenario.rendering()}
        STAGES["capture"].run(request, {"stage": stage}, shots, SILENT)
    return shots


def _first(source: Path, count: int, folder: Path) -> Capture:
    """Take the first images of a flight, without its truth."""
    (folder / "images").mkdir(parents=True, exist_ok=True)
    stored = read_json(source / CAMERAS)
    chosen = stored["images"][:count]
    for image in chosen:
        (folder / image["file"]).unlink(missing_ok=True)
        (folder / image["file"]).symlink_to((source / image["file"]).resolve())
    write_json(folder / CAMERAS, {**stored, "images": chosen})
    return read_capture(folder)


if __name__ == "__main__":
    main()
