"""Compare ways to dense depth on the same photographs and poses, and write `docs/benchmarks/dense.md`.

Usage: python -m benchmarks.dense CAPTURE CLOUD [--quality medium high] [--methods sgm patchmatch] [--filter moderate]

CAPTURE is a capture with truth, CLOUD its reconstruction, whose COLMAP model in metres gives the poses. Each way runs
in a child, whose processor time is taken, all threads together.
"""

import argparse
import resource
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from falsework.platform import processor
from groundwork.files import write_text
from groundwork.progress import SILENT
from recon.annotate import annotate, gather, vote
from recon.colmap_model import SparseModel, read_model
from recon.completeness import Completeness, measure_completeness, visible_surface
from recon.dense import run_dense
from recon.dense_points import DensePoints
from recon.observations import Observations
from recon.settings import DenseSettings, Quality, ReconSettings
from recon.sparse import Sparse
from recon.surface_distance import nearest_surface
from recon.uncertainty import depths, measure
from render.capture import Truth, read_capture, read_truth

F64 = NDArray[np.float64]

PAGE = Path(__file__).resolve().parents[1] / "docs" / "benchmarks" / "dense.md"
FAR, VIEWS, REACH, ON, CLEAR = 15.0, 3, 0.05, 0.1, 3.0  # [m], cameras, [m], [m], [px]
LOOPED = 20_000  # observations that the plain loop votes on


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes:
        name: Method and quality.
        seconds: Processor time per image [s].
        points: Points of the cloud.
        found: How much of the near surface is there, and how exact.
        wrong: Share of points within 0.1 m of the surface that have another label than it [1].
        wrong_clear: The same of those 3 px from label edges [1].
        kept: Share of the points within 0.1 m that are those [1].
    """

    name: str
    seconds: float
    points: int
    found: Completeness
    wrong: float
    wrong_clear: float
    kept: float


def main() -> None:
    """Measure every way, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("capture", type=Path)
    parser.add_argument("cloud", type=Path)
    parser.add_argument("--quality", nargs="+", default=["medium"])
    parser.add_argument("--methods", nargs="+", default=["sgm", "patchmatch"])
    parser.add_argument("--filter", default="moderate")
    asked = parser.parse_args()
    capture = read_capture(asked.capture)
    truth, model = read_truth(capture), read_model(asked.cloud / "sparse")
    if truth is None:
        parser.error("the capture has no truth")
    samples, _ = visible_surface(truth, FAR, VIEWS)
    sparse = Sparse(model, asked.cloud / "sparse", "benchmark", {}, {})
    rows, speed = [], ""
    for quality in asked.quality:
        for method in asked.methods:
            with tempfile.TemporaryDirectory() as scratch:
                settings = _settings(method, quality, asked.filter)
                begin = _child_seconds()
                points, _ = run_dense(capture, sparse, Path(scratch), settings, SILENT)
                seconds = (_child_seconds() - begin) / len(capture.images)
            rows.append(_judge(f"{method}, {quality}", seconds, points, model, truth, samples))
            speed = annotation_speed(points, model, truth)
            write_text(PAGE, _page(rows, speed, len(samples), capture.size, asked.filter))


def _settings(method: str, quality: Quality, chosen: str) -> ReconSettings:
    return ReconSettings.model_validate(
        {
            "mode": "dense",
            "quality": quality,
            "filter": chosen,
            "dense": DenseSettings.model_validate({"method": method}),
        }
    )


def _child_seconds() -> float:
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


def _seen(points: DensePoints, count: int) -> Observations:
    start = np.concatenate([[0], np.cumsum(points.counts[:count])]).astype(np.int64)
    return Observations(start, points.image[: start[-1]].astype(np.int64), points.uv[: start[-1]].astype(np.float64))


def _judge(name: str, seconds: float, points: DensePoints, model: SparseModel, truth: Truth, samples: F64) -> Row:
    """Measure one cloud; the model's images are the capture's, in its order."""
    seen = _seen(points, len(points.counts))
    depth = depths(points.points, model.poses, seen)
    observed = gather(truth, seen)
    verdict = annotate(observed, np.abs(observed.depth - depth), seen)
    distance, nearest = nearest_surface(points.points, truth)
    closest = np.minimum.reduceat(depth, seen.start[:-1])
    found = measure_completeness(points.points, distance.astype(np.float32), closest, samples, REACH, FAR)
    on, wrong = distance <= ON, verdict.label != nearest
    clear = on & (verdict.margin >= CLEAR)
    return Row(
        name, seconds, len(points.points), found, float(wrong[on].mean()), float(wrong[clear].mean()),
        float(clear.sum() / on.sum()),
    )  # fmt: skip


def annotation_speed(points: DensePoints, model: SparseModel, truth: Truth) -> str:
    """Time labels and uncertainty of up to a million points, and the vote against a plain loop.

    Args:
        points: Dense points.
        model: Their cameras.
        truth: Their truth.

    Returns:
        A sentence for the page.
    """
    count = min(1_000_000, len(points.counts))
    seen, few = _seen(points, count), _seen(points, min(1000, count))
    for part in (few, seen):  # the first call loads compiled code
        begin = time.process_time()
        observed = gather(truth, part)
        depth = depths(points.points, model.poses, part)
        error, _ = measure(points.points, depth, observed.depth.astype(np.float64), truth, part)
        annotate(observed, error, part)
        seconds = time.process_time() - begin
    label, point = observed.label.astype(np.int64), seen.point
    begin = time.process_time()
    vote(point, label, error)
    fast = (time.process_time() - begin) / len(point)
    begin = time.process_time()
    looped = int(np.searchsorted(seen.start, min(LOOPED, len(point)), side="right")) - 1
    for number in range(looped):
        mine = slice(seen.start[number], seen.start[number + 1])
        names, votes = np.unique(label[mine], return_counts=True)
        max(zip(votes, -names, strict=True))
    slow = (time.process_time() - begin) / max(int(seen.start[looped]), 1)
    return (
        f"Labels, uncertainty and displacement of {count:,} points ({len(point):,} observations) take {seconds:.1f} s "
        f"of processor time; the vote is {slow / fast:.0f} times faster than a plain loop over points."
    )


def _page(rows: list[Row], speed: str, samples: int, size: tuple[int, int], chosen: str) -> str:
    return "\n".join([
        "# Dense depth: ways compared",
        "",
        f"Written by `python -m benchmarks.dense`. Photographs of {size[0]} x {size[1]} px, poses from structure from "
        f"motion, filter {chosen}; processor time of {processor()}. Completeness: share of {samples:,} samples of the "
        f"true surface, at most {FAR:.0f} m from {VIEWS} cameras, with a point within {100 * REACH:.0f} cm.",
        "",
        "| way | CPU-s an image | points | complete | median distance [mm] | wrong label | 3 px from edges | kept |",
        "|---|---|---|---|---|---|---|---|",
        *(
            f"| {row.name} | {row.seconds:.1f} | {row.points:,} | {row.found.share:.1%} "
            f"| {1000 * row.found.median:.1f} | {row.wrong:.2%} | {row.wrong_clear:.2%} | {row.kept:.1%} |"
            for row in rows
        ),
        "",
        speed,
        "",
    ])  # fmt: skip


if __name__ == "__main__":
    main()
