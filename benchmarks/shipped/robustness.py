"""Robustness of a model to other scans: mean IoU lost where unit, axes, place, density, extent or level differ.

Usage: python -m benchmarks.shipped.robustness CLOUD… [--model FOLDER] [--length METERS] [--out FILE]

CLOUDs are scans of bridges that the model never saw, with their truth. Each is labeled as it is, a quarter of its
points left, and then again changed; every pair of scores is over the same points. `docs/benchmarks/robustness.md`.
"""

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from benchmarks.page import write_page
from benchmarks.shipped.model import bridge_of
from benchmarks.shipped.scan_scores import TABLES, Labeled, Scan, label_scan, mean_iou_of_seen, read_labeled_scan
from learn.datasets.class_tables import class_table
from learn.datasets.scan_units import UNITS
from learn.datasets.varied import tilt_about
from learn.metrics import confusion
from learn.predict.model import PointModel, named_model
from learn.predict.settings import PredictSettings

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Bools = NDArray[np.bool_]
Inside = Callable[[F64], Bools]

PAGE = Path(__file__).resolve().parents[2] / "docs" / "benchmarks" / "robustness.md"
SHARE, TENTH, FAR, TILT = 0.25, 0.1, 1e6, 3.0
NEAR = 12.0  # [m] about the bridge's box: as far as the scan without wide surroundings reaches
ALLOWED, ALLOWED_FALSE = 0.05, 0.02  # [1] mean IoU lost, and share of points falsely on a bridge
SURROUNDINGS = "surroundings of 40 m"
_AXES_TO_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True)
class Row:
    """One row of the table.

    Attributes:
        title: What differs.
        lost: Mean IoU lost in each table, one a scan [1].
    """

    title: str
    lost: Mapping[str, Sequence[float]]


def on_bridge(scan: Scan) -> Bools:
    """Find the points on the bridge.

    Args:
        scan: The scan.

    Returns:
        Whether each is, shape (N,), bool.
    """
    return (scan.labels["falsework"] != 0) & (scan.labels["falsework"] != 255)


def near_bridge(scan: Scan, reach: float) -> Inside:
    """Make the box about the bridge.

    Args:
        scan: The scan.
        reach: How far it goes beyond the bridge [m].
    """
    mine = scan.place[on_bridge(scan)]
    low, high = mine.min(axis=0) - reach, mine.max(axis=0) + reach
    return lambda place: ((place[:, :2] >= low[:2]) & (place[:, :2] <= high[:2])).all(axis=1)


def stretch(scan: Scan, low: float, high: float) -> Inside:
    """Cut a stretch out of a bridge, across its longer horizontal direction.

    Args:
        scan: The scan.
        low: Where it begins, from the middle of the bridge [m].
        high: Where it ends [m].
    """
    mine = scan.place[on_bridge(scan)][:, :2]
    middle = 0.5 * (mine.min(axis=0) + mine.max(axis=0))
    axis = np.linalg.eigh(np.cov((mine - middle).T))[1][:, 1]
    return lambda place: ((place[:, :2] - middle) @ axis >= low) & ((place[:, :2] - middle) @ axis <= high)


def tilted(scan: Scan) -> Scan:
    """Tilt a scan about its middle.

    Args:
        scan: The scan.
    """
    turn = tilt_about(0.25 * np.pi, np.radians(TILT))
    middle = scan.coord.mean(axis=0)
    return replace(scan, coord=(scan.coord - middle) @ turn.T + middle)


@dataclass(frozen=True, eq=False)
class Changed:
    """A scan that differs from the usual one, and the points that both have.

    Attributes:
        scan: The changed scan.
        usual: Rows of the common points in the usual scan, shape (M,), int64.
        mine: Rows of the same points in the changed scan, shape (M,), int64.
    """

    scan: Scan
    usual: I64
    mine: I64


def part_of(usual: Scan, rows: I64) -> Changed:
    """Make a scan of some points of the usual one.

    Args:
        usual: The usual scan.
        rows: Which points, shape (M,), int64.
    """
    return Changed(usual.take(rows), rows, np.arange(len(rows)))


def changes_of(scan: Scan, taken: I64, few: I64) -> dict[str, Changed]:
    """Change a scan in every way of the table.

    Args:
        scan: The scan with all of its points.
        taken: Rows of the usual scan's points in it, ascending, shape (N,), int64.
        few: A tenth of the rows of the usual scan, shape (M,), int64.

    Returns:
        By title. The last one is what wide surroundings are compared with: the usual scan without them.
    """
    usual = scan.take(taken)
    every = np.arange(len(taken))
    half, near = stretch(scan, -np.inf, 0.0), near_bridge(scan, NEAR)
    feet, y_up = PredictSettings(unit="ft"), PredictSettings(unit="m", up="y")
    return {
        "feet": Changed(replace(usual, coord=usual.coord / UNITS["ft"], settings=feet), every, every),
        "y up": Changed(replace(usual, coord=usual.coord @ _AXES_TO_Y_UP.T, settings=y_up), every, every),
        "moved by 1,000 km": Changed(replace(usual, coord=usual.coord + np.array([FAR, FAR, 0.0])), every, every),
        "a tenth of the points": part_of(usual, np.sort(few)),
        "four times the points": Changed(scan, every, taken),
        "half of the bridge": part_of(usual, np.flatnonzero(half(usual.place))),
        f"tilted by {TILT:g}°": Changed(tilted(usual), every, every),
        SURROUNDINGS: part_of(usual, np.flatnonzero(near(usual.place))),
    }


def rows_of(scan: Scan, model: PointModel) -> tuple[dict[str, dict[str, float]], dict[str, float], float]:
    """Label a scan in every way.

    Args:
        scan: The scan with all of its points.
        model: What knows the classes.

    Returns:
        For each way the mean IoU lost in each table [1]; the mean IoU of the scan as it is [1]; the share of points
        called bridge where there is none [1].
    """
    rng = np.random.default_rng(0)
    order = rng.permutation(len(scan.coord))
    taken = np.sort(order[: round(SHARE * len(order))])
    few = rng.permutation(len(taken))[: round(TENTH * len(taken))]
    usual = scan.take(taken)
    plain = label_scan(usual, model)
    lost = {}
    for title, changed in changes_of(scan, taken, few).items():
        lost[title] = lost_by(usual, plain, changed, label_scan(changed.scan, model), model.tile.voxel)
    lost[SURROUNDINGS] = {table: -value for table, value in lost[SURROUNDINGS].items()}
    mean = {table: mean_iou_of_seen(plain.matrix(table)) for table in TABLES}
    empty = label_scan(usual.take(~on_bridge(usual)), model)
    return lost, mean, float((empty.found["falsework"] != 0).mean())


def lost_by(usual: Scan, plain: Labeled, changed: Changed, found: Labeled, size: float) -> dict[str, float]:
    """Compare two labelings of a scan over points that both have, one in each cube.

    A scan with more points also has points in places that the other one does not show, such as far or shaded ones:
    scores over all points of each would compare the places, too.

    Args:
        usual: The usual scan.
        plain: Its labels.
        changed: The changed scan.
        found: Its labels.
        size: Side of a cube [m].

    Returns:
        Mean IoU that the change loses, in each table [1].
    """
    place = usual.place[changed.usual]
    one = np.unique(np.floor(place / size).astype(np.int64), axis=0, return_index=True)[1]
    before, after = plain.cube[changed.usual[one]], found.cube[changed.mine[one]]
    lost = {}
    for table in TABLES:
        truth, count = usual.labels[table][changed.usual[one]].astype(np.int64), len(class_table(table).names)
        told = (labeled.found[table][rows] for labeled, rows in ((plain, before), (found, after)))
        scores = [mean_iou_of_seen(confusion(truth, labels, count)) for labels in told]
        lost[table] = scores[0] - scores[1]
    return lost


def page(scans: Mapping[str, Scan], model: PointModel, name: str) -> str:
    """Write the page.

    Args:
        scans: Scans by name.
        model: What knows the classes.
        name: Name of the model.
    """
    found = {title: rows_of(scan, model) for title, scan in scans.items()}
    ways = next(iter(found.values()))[0]
    lines = [
        "# Robustness of the model to other scans",
        "",
        f"Written by `python -m benchmarks.shipped.robustness`. Model: {name}. Mean IoU of the thinned points over the",
        "classes that it has, in the tables `falsework` (sixteen classes) and `kim2023` (four). A scan as it is has a",
        "quarter of the points that were measured. Each row changes one thing, and compares both labelings at the",
        "same points: those that both scans have, one in each cube of the model.",
        "",
        "## As they are",
        "",
        "| scan | points | falsework | kim2023 |",
        "|---|---|---|---|",
    ]
    for title, (_, mean, _) in found.items():
        count = round(SHARE * len(scans[title].coord))
        lines.append(f"| {title} | {count} | {mean['falsework']:.3f} | {mean['kim2023']:.3f} |")
    lines += [
        "",
        "## Mean IoU lost",
        "",
        f"Goal: at most {ALLOWED:g}; negative: gained. Over the scans: mean, and the worst.",
        "",
        "| what differs | falsework | worst | kim2023 | worst | within |",
        "|---|---|---|---|---|---|",
    ]
    for way in ways:
        values = {table: np.array([lost[way][table] for lost, _, _ in found.values()]) for table in TABLES}
        cells = [f"{v.mean():+.3f} | {v.max():+.3f}" for v in values.values()]
        kept = all(v.mean() <= ALLOWED for v in values.values())
        lines.append(f"| {way} | {' | '.join(cells)} | {'yes' if kept else '**no**'} |")
    lines += ["| no color | 0 | 0 | 0 | 0 | by construction: the model sees positions alone |"]
    lines += [
        "",
        "## Where there is no bridge",
        "",
        f"The same scans without the points of their bridges: share of points called bridge, the wish is at most "
        f"{ALLOWED_FALSE:.0%}.",
        "",
        "| scan | falsely bridge |",
        "|---|---|",
    ]
    lines += [f"| {title} | {false:.1%} |" for title, (_, _, false) in found.items()]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clouds", type=Path, nargs="+")
    parser.add_argument("--model", default="")
    parser.add_argument("--length", type=float, default=np.inf, help="longest stretch of a bridge that is taken [m]")
    parser.add_argument("--out", type=Path, default=PAGE)
    given = parser.parse_args()
    torch.set_num_threads(1)  # several wait for each other where others work, too
    scans: dict[str, Scan] = {}
    for path in given.clouds:
        scan = read_labeled_scan(path)
        rows = stretch(scan, -0.5 * given.length, 0.5 * given.length)(scan.place)
        scans[f"{bridge_of(path)[:8]} {path.name}"] = scan.take(rows)
    name = Path(given.model).name if given.model else "that of the package (`learn/shipped`)"
    if len(scans) < len(given.clouds):
        parser.error("two of the clouds are of one bridge and of one name; allowed: each once")
    write_page(given.out, page(scans, named_model(given.model), name), __file__)


if __name__ == "__main__":
    main()
