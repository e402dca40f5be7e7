"""Compare ways to dense depth on the same photographs and poses, and write `docs/benchmarks/dense.md`.

Usage: python -m benchmarks.recon.dense CAPTURE CLOUD [--ways sgm:medium patchmatch:medium sgm:high] [--filter moderate]

CAPTURE is a capture with truth, CLOUD its reconstruction, whose COLMAP model in meters gives the poses. Each way runs
in children, whose processor time is taken, all threads together, and the memory of the largest of them. Waiting times
mean something only where nothing else runs.
"""

import argparse
import os
import resource
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.page import write_page
from benchmarks.recon.completeness import Completeness, measure_completeness, visible_surface
from benchmarks.recon.plain_vote import plain_verdict
from benchmarks.speed_unit import slower, this_machine
from groundwork.progress import SILENT
from recon.dense.dense import run_dense
from recon.dense.points import DensePoints
from recon.points.observations import Observations
from recon.settings import DenseSettings, ReconSettings
from recon.sfm.colmap_model import SparseModel, read_model
from recon.sfm.sparse import Sparse
from recon.truth.annotate import ObservedTruth, annotate, gather
from recon.truth.surface_distance import nearest_surface
from recon.truth.uncertainty import depths, measure
from render.capture import Capture, Truth, read_capture, read_truth

F64 = NDArray[np.float64]

PAGE = Path(__file__).resolve().parents[2] / "docs" / "benchmarks" / "dense.md"
WAYS = ["sgm:medium", "patchmatch:medium", "sgm:high"]
FAR, VIEWS, REACH, ON, CLEAR = 15.0, 3, 0.05, 0.1, 3.0  # [m], cameras, [m], [m], [px]
ROUNDS = 3  # of the labels: the least is given, and the greatest beside it
MOST_MINUTES, MOST_MEMORY, MOST_SECONDS, FEW_SECONDS = 6.0, 2.0, 3.0, 1.0  # [min], [GB], [s], [s]
LOOPED = 20_000  # observations that the plain loop votes on


@dataclass(frozen=True)
class Cost:
    """What a step took.

    Attributes:
        cpu: Processor time per image [s].
        wall: Waiting time for all images [s].
        memory: Most memory of one process [GB].
    """

    cpu: float
    wall: float
    memory: float


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes:
        name: Method and quality.
        cost: What the dense step took.
        points: Points of the cloud.
        found: How much of the near surface is there, and how exact.
        wrong: Share of points within 0.1 m of the surface that have another label than it [1].
        wrong_clear: The same of those 3 px from label edges [1].
        kept: Share of the points within 0.1 m that are those [1].
        by_class: Right points of each class within 0.1 m of the surface, by its name.
    """

    name: str
    cost: Cost
    points: int
    found: Completeness
    wrong: float
    wrong_clear: float
    kept: float
    by_class: dict[str, int]


def main() -> None:
    """Measure every way, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("capture", type=Path)
    parser.add_argument("cloud", type=Path)
    parser.add_argument("--ways", nargs="+", default=WAYS, metavar="METHOD:QUALITY")
    parser.add_argument("--filter", default="moderate")
    asked = parser.parse_args()
    capture = read_capture(asked.capture)
    truth, model = read_truth(capture), read_model(asked.cloud / "sparse")
    if truth is None:
        parser.error("the capture has no truth")
    samples, _ = visible_surface(truth, FAR, VIEWS)
    rows, speed = [], ""
    for method, _, quality in (way.partition(":") for way in asked.ways):
        settings = _settings(method, quality, asked.filter)
        with ProcessPoolExecutor(1, get_context("spawn")) as pool:  # whose children are those of this way alone
            points, cost = pool.submit(dense_points, asked.capture, asked.cloud, settings).result()
        rows.append(_judge(f"{method}, {quality}", cost, points, model, truth, samples))
        speed = annotation_speed(points, model, truth)
        write_page(PAGE, _page(rows, speed, len(samples), capture, asked.filter), __file__)


def dense_points(folder: Path, cloud: Path, settings: ReconSettings) -> tuple[DensePoints, Cost]:
    """Run the dense step in a process that has no other children.

    Args:
        folder: Capture.
        cloud: Its reconstruction.
        settings: Method, quality and filter.
    """
    capture = read_capture(folder)
    sparse = Sparse(read_model(cloud / "sparse"), cloud / "sparse", "benchmark", {}, {})
    with tempfile.TemporaryDirectory() as scratch:
        begin = time.perf_counter()
        points, _, _ = run_dense(capture, sparse, Path(scratch), settings, SILENT)
        wall = time.perf_counter() - begin
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = (spent.ru_utime + spent.ru_stime) / len(capture.images)
    return points, Cost(cpu, wall, spent.ru_maxrss * 1024 / 1e9)


def _settings(method: str, quality: str, chosen: str) -> ReconSettings:
    return ReconSettings.model_validate(
        {
            "mode": "dense",
            "quality": quality,
            "filter": chosen,
            "dense": DenseSettings.model_validate({"method": method}),
        }
    )


def _seen(points: DensePoints, rows: NDArray[np.int64]) -> Observations:
    """Take the observations of some points."""
    counts = points.counts.astype(np.int64)
    start = np.concatenate([[0], np.cumsum(counts[rows])])
    first = np.cumsum(counts) - counts
    taken = np.arange(start[-1]) + np.repeat(first[rows] - start[:-1], counts[rows])
    return Observations(start, points.image[taken].astype(np.int64), points.uv[taken].astype(np.float64))


def _judge(name: str, cost: Cost, points: DensePoints, model: SparseModel, truth: Truth, samples: F64) -> Row:
    """Measure one cloud; the model's images are the capture's, in its order."""
    seen = _seen(points, np.arange(len(points.counts)))
    depth = depths(points.points, model.poses, seen)
    observed = gather(truth, seen)
    verdict = annotate(observed, np.abs(observed.depth - depth), seen)
    distance, nearest = nearest_surface(points.points, truth)
    closest = np.minimum.reduceat(depth, seen.start[:-1])
    found = measure_completeness(points.points, distance.astype(np.float32), closest, samples, REACH, FAR)
    on, wrong = distance <= ON, verdict.label != nearest
    clear = on & (verdict.margin >= CLEAR)
    return Row(
        name,
        cost,
        len(points.points),
        found,
        float(wrong[on].mean()),
        float(wrong[clear].mean()),
        float(clear.sum() / on.sum()),
        {row.name: int((on & ~wrong & (nearest == row.id)).sum()) for row in truth.classes},
    )


def annotation_speed(points: DensePoints, model: SparseModel, truth: Truth) -> str:
    """Time labels and uncertainty of up to a million points of all images, and the vote against a plain loop.

    Args:
        points: Dense points.
        model: Their cameras.
        truth: Their truth.

    Returns:
        Sentences for the page.
    """
    views = float(points.counts.mean())
    few = _label(points, round(250_000 / views), model, truth)
    many = _label(points, 1_000_000, model, truth)
    begin = time.perf_counter()
    nearest_surface(many.places, truth)
    surface = time.perf_counter() - begin
    return " ".join(
        [
            many.sentence(MOST_SECONDS, "a million points"),
            few.sentence(FEW_SECONDS, "250,000 observations"),
            f"The true surface distance of {len(many.places):,} points takes another {surface:.2f} s.",
            f"The vote is {_vote_speed(many):.0f} times faster than a plain loop over points, with the same verdicts.",
        ]
    )


@dataclass(frozen=True)
class _Labeled:
    """Labels of some points, several times over.

    Attributes:
        places: The points [m], shape (N, 3), float64.
        seen: Observations of the points.
        observed: Truth there.
        error: Depth error of each observation [m], shape (M,), float64.
        waited: Time that each round took [s].
        spent: Its processor time [s].
    """

    places: F64
    seen: Observations
    observed: ObservedTruth
    error: F64
    waited: tuple[float, ...]
    spent: tuple[float, ...]

    def sentence(self, most: float, name: str) -> str:
        """Format the time that it took."""
        return (
            f"Labels, uncertainty and displacement of {len(self.seen.counts):,} points ({len(self.error):,} "
            f"observations) take {min(self.waited):.2f} s ({max(self.waited):.2f} at most in {len(self.waited)} "
            f"rounds), {min(self.spent):.1f} s of processor time (limit: {most * slower('numpy'):.1f} s for {name})."
        )


def _label(points: DensePoints, count: int, model: SparseModel, truth: Truth) -> _Labeled:
    """Label some of the points, spread over all images."""
    every, cores = len(points.counts), len(os.sched_getaffinity(0))
    rows = np.linspace(0, every - 1, min(count, every)).astype(np.int64)
    places, waited, spent = points.points[rows], list[float](), list[float]()
    while True:
        seen = _seen(points, rows)
        used, begin = time.process_time(), time.perf_counter()
        observed = gather(truth, seen, cores)
        depth = depths(places, model.poses, seen)
        error, _ = measure(places, depth, observed.depth.astype(np.float64), truth, seen, cores)
        annotate(observed, error, seen)
        waited.append(time.perf_counter() - begin)
        spent.append(time.process_time() - used)
        if len(waited) > ROUNDS:  # the first one loads compiled code
            return _Labeled(places, seen, observed, error, tuple(waited[1:]), tuple(spent[1:]))


def _vote_speed(many: _Labeled) -> float:
    """Give the time of a plain loop over the time of the vote, per observation."""
    seen, observed, error = many.seen, many.observed, many.error
    begin = time.process_time()
    verdict = annotate(observed, error, seen)
    fast = (time.process_time() - begin) / len(error)
    looped = int(np.searchsorted(seen.start, min(LOOPED, len(error)), side="right")) - 1
    label, instance, margin, errors = (
        column[: seen.start[looped]].tolist() for column in (observed.label, observed.instance, observed.margin, error)
    )
    begin, bounds, twins = time.process_time(), seen.start.tolist(), list[tuple[int, int, float, float]]()
    for number in range(looped):
        mine = slice(bounds[number], bounds[number + 1])
        twins.append(plain_verdict(label[mine], instance[mine], margin[mine], errors[mine]))
    slow = (time.process_time() - begin) / len(label)
    found = zip(verdict.label[:looped].tolist(), verdict.instance[:looped].tolist(), strict=True)
    assert list(found) == [twin[:2] for twin in twins]
    return slow / fast


def _page(rows: list[Row], speed: str, samples: int, capture: Capture, chosen: str) -> str:
    width, height = capture.size
    lines = [
        "# Dense depth: ways compared",
        "",
        f"Written by `python -m benchmarks.recon.dense`. {len(capture.images)} photographs of {width} x {height} px,",
        f"poses from structure from motion, filter {chosen}; {len(os.sched_getaffinity(0))} cores of {this_machine()}. "
        f"Limit: {MOST_MINUTES * slower('numpy'):.1f} minutes for 75 photographs of 1280 x 960 px in quality high, "
        f"and {MOST_MEMORY:.0f} GB.",
        f"Completeness: share of {samples:,} samples of the true surface, at most {FAR:.0f} m from {VIEWS} cameras,",
        f"with a point within {100 * REACH:.0f} cm.",
        "",
        "| way | CPU-s an image | minutes in all | memory [GB] | points | complete | median distance [mm] "
        "| wrong label | 3 px from edges | kept |",
        "|---|---|---|---|---|---|---|---|---|---|",
        *map(_line, rows),
        "",
        "Points within 0.1 m of the surface that have its class, class by class:",
        "",
        f"| class | {' | '.join(row.name for row in rows)} |",
        "|---|" + "---|" * len(rows),
        *(
            f"| {name} | {' | '.join(f'{row.by_class[name]:,}' for row in rows)} |"
            for name in rows[0].by_class
            if any(row.by_class[name] for row in rows)
        ),
        "",
        speed,
        "",
    ]
    return "\n".join(lines)


def _line(row: Row) -> str:
    cost, found = row.cost, row.found
    return (
        f"| {row.name} | {cost.cpu:.1f} | {cost.wall / 60:.1f} | {cost.memory:.1f} | {row.points:,} "
        f"| {found.share:.1%} | {1000 * found.median:.1f} | {row.wrong:.2%} | {row.wrong_clear:.2%} | {row.kept:.1%} |"
    )


if __name__ == "__main__":
    main()
