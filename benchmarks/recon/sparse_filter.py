"""Which points a sparse cloud keeps, and how good they are: the rule by precision beside the one by views.

Usage: python -m benchmarks.recon.sparse_filter WORK

Makes the demo and close flights of four of the bridges of `benchmarks.recon.accuracy`, sparse, in WORK, which keeps
what was made. All points of each model are tested by the rules, side by side in `docs/benchmarks/sparse_filter.md`.
"""

import argparse
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import falsework
from benchmarks.page import write_page
from benchmarks.recon.accuracy_rows import ROWS, Row, scenario_of_row
from falsework.commands.console import ConsoleProgress
from falsework.scenario import demo_scenario
from groundwork.errors import InputError
from recon.placing.align import OK
from recon.placing.place import Registered, place
from recon.points.duplicates import merge_duplicates
from recon.points.observations import select_points
from recon.points.precision import deviations, keypoint_noise
from recon.settings import ReconSettings
from recon.sfm.colmap_model import SparseModel, read_model
from recon.truth.annotate import annotate, gather
from recon.truth.statistics import NEAR
from recon.truth.surface_distance import nearest_surface
from recon.truth.uncertainty import depths, measure
from render.capture import Capture, Truth, read_capture, read_truth

PAGE = Path(__file__).resolve().parents[2] / "docs" / "benchmarks" / "sparse_filter.md"
SETTINGS = ReconSettings()
WORTH = ("kept", "off", "wrong", "noisy")
BRIDGES = [Row(family, "road", "local") for family in ("beam", "girder", "suspension", "cable_stayed")]
SURE = 4  # views from which on the former rule asked nothing

Mask = NDArray[np.bool_]
F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Judged:
    """All points of a model that two valid cameras saw, what rules look at, and the truth about them.

    Attributes:
        views: Cameras of each, shape (N,), int64.
        errors: Mean distance between keypoints and reprojected point [px], shape (N,), float64.
        deviation: Standard deviation along the worst direction for keypoints off by one pixel [m], shape (N,), float64.
        noise: Standard deviation of its keypoints [px], shape (N,), float64.
        segment: Class id by vote, shape (N,), uint8.
        right: Whether that is the class of the nearest surface, shape (N,), bool.
        distance: Distance to that surface [m], shape (N,), float64.
        uncertainty: Median depth error [m], shape (N,), float64.
    """

    views: NDArray[np.int64]
    errors: F64
    deviation: F64
    noise: F64
    segment: NDArray[np.uint8]
    right: Mask
    distance: F64
    uncertainty: F64


def scenarios() -> dict[str, dict[str, Any]]:
    """Write the scenarios of the page.

    Returns:
        Scenario by name; each keeps its capture and its model.
    """
    demo = demo_scenario().model_dump(mode="json", exclude_unset=True)
    rows = {row.family: scenario_of_row(row, number) for number, row in enumerate(ROWS, 4001) if row in BRIDGES}
    recon = {"mode": "sparse"}
    return {
        name: {**told, "recon": recon, "keep": ["capture", "model"]} for name, told in {"demo": demo, **rows}.items()
    }


def main() -> None:
    """Make what is missing, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("work", type=Path)
    told = parser.parse_args()
    parts: list[str] = []
    for name, scenario in scenarios().items():
        with ConsoleProgress() as progress:
            falsework.run(scenario, told.work / name, progress=progress)
        (capture,), (model,) = (list(told.work.glob(f"{name}/scenes/0000/{part}/*")) for part in ("capture", "model"))
        opened = read_capture(capture)
        truth = read_truth(opened)
        if truth is None:
            raise InputError("has no truth", where=capture)
        judged = judge(read_model(model / "sparse"), opened, truth)
        parts.append(scene_part(name, judged, {row.id: row.name for row in truth.classes}))
    write_page(PAGE, "\n".join([*HEAD, *(f"{part}\n" for part in parts)]), __file__)


HEAD = [
    "# Which points a sparse cloud keeps",
    "",
    "Written by `python -m benchmarks.recon.sparse_filter WORK`, which makes the models: the demo, and close flights",
    "of road bridges of [the page about accuracy](accuracy.md). Every point of a model is tested by three rules, all",
    f"after a mean reprojection error of {SETTINGS.max_reprojection_error:g} px at most and {SETTINGS.min_views} valid "
    "views:",
    "",
    "- *all*: nothing more;",
    f"- *by views*, the rule of former versions: {SURE} views, or a place that would move by at most "
    f"{SETTINGS.max_deviation:g} m",
    "  (a standard deviation, in the direction that its rays determine worst) if its keypoints were off by a pixel;",
    "- *by precision*, `[recon] max_deviation` as it is: the same of every point, however many views it has, if its",
    "  keypoints are off by as much as the residuals of all points, and its own, show. Many views from one place count",
    "  little, two from far apart much.",
    "",
    f"*Good* points lie within {NEAR:g} m of the true surface. *Kept* is the share of the good points that stay; *off*",
    "the share of those that stay which lie farther away; *wrong* the share of the good ones that stay with another",
    f"class than the surface; *noisy* the share of those that stay whose uncertainty exceeds {NEAR:g} m.",
    "",
]


def judge(model: SparseModel, capture: Capture, truth: Truth) -> Judged:
    """Place a model by its truth, and look at every point.

    Args:
        model: Reconstruction.
        capture: Its photographs.
        truth: Their truth.
    """
    model, _ = merge_duplicates(model)
    row_of = {image.file: row for row, image in enumerate(capture.images)}
    rows = np.array([row_of[name] for name in model.names])
    alignment, _ = place(Registered(model.poses, rows), capture, truth, SETTINGS.alignment, np.random.default_rng(0))
    valid = np.array([code == OK for code in alignment.status])
    poses = np.full((len(capture.images), 4, 4), np.nan)
    poses[rows] = alignment.similarity.move_poses(model.poses)
    kept, seen = select_points(model, rows, valid, SETTINGS.max_reprojection_error, SETTINGS.min_views)
    points, errors, rays = alignment.similarity.move(model.points[kept]), model.errors[kept], seen.once()
    observed = gather(truth, seen, SETTINGS.dense.threads)
    depth = depths(points, poses, seen)
    depth_error, measured = measure(points, depth, observed.depth.astype(float), truth, seen, SETTINGS.dense.threads)
    segment = annotate(observed, depth_error, seen).label
    distance, nearest = nearest_surface(points, truth)
    return Judged(
        rays.counts,
        errors,
        deviations(points, poses[:, :3, 3], model.camera_params[0], rays),
        keypoint_noise(errors, rays.counts),
        segment,
        segment == nearest,
        distance,
        measured.median,
    )


def rules(judged: Judged) -> dict[str, Mask]:
    """Give what each rule keeps.

    Args:
        judged: The points.
    """
    limit = SETTINGS.max_deviation
    return {
        "all": np.ones(len(judged.views), bool),
        "by views": (judged.views >= SURE) | (judged.deviation <= limit),
        "by precision": judged.noise * judged.deviation <= limit,
    }


def scene_part(name: str, judged: Judged, classes: Mapping[int, str]) -> str:
    """Write the table of one scene.

    Args:
        name: Its name.
        judged: Its points.
        classes: Name of each class by its id.
    """
    kept = rules(judged)
    heads = [f"{rule}: {what}" for rule in kept for what in WORTH if (rule, what) != ("all", "kept")]
    common = np.sqrt(np.median(judged.noise**2))
    lines = [
        f"## {name}",
        "",
        f"{len(judged.views):,} points, {np.mean(judged.views == 2):.0%} of them of two views; keypoints deviate by "
        f"{common:.2f} px (median).",
        "",
        f"| class | good points | {' | '.join(heads)} |",
        "|---|---|" + "---|" * len(heads),
    ]
    present = [number for number in sorted(classes) if (judged.segment == number).any()]
    for label, mine in [(classes[number], judged.segment == number) for number in present] + [
        ("**all**", np.ones(len(judged.views), bool))
    ]:
        cells = [cell for rule, mask in kept.items() for cell in _cells(judged, mine, mask)[rule == "all" :]]
        lines.append(f"| {label} | {int((mine & (judged.distance <= NEAR)).sum()):,} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _cells(judged: Judged, mine: Mask, mask: Mask) -> list[str]:
    good = mine & (judged.distance <= NEAR)
    stays, stays_good = mine & mask, good & mask
    return [
        _percent(stays_good.sum(), good.sum(), 0),
        _percent((stays & ~good).sum(), stays.sum()),
        _percent((stays_good & ~judged.right).sum(), stays_good.sum()),
        _percent((stays & (judged.uncertainty > NEAR)).sum(), stays.sum()),
    ]


def _percent(part: int, whole: int, digits: int = 1) -> str:
    return f"{part / whole:.{digits}%}" if whole else "none"


if __name__ == "__main__":
    main()
