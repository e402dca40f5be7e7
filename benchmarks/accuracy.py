"""How true the clouds are: every family, road and rail, close and whole flights, sparse and dense, class by class.

Usage: python -m benchmarks.accuracy WORK [--only NAME…] [--page]

Makes a bridge for every row, flies, renders and reconstructs it, and writes `docs/benchmarks/accuracy.md`. WORK keeps
what was made: a second call goes on. `--page` writes the page of what is there. Some six processor minutes a row.
The same bridges are sampled on their mesh and by a tripod's laser, for `benchmarks.compare`.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import falsework
from falsework.commands.console import ConsoleProgress
from groundwork.files import read_json, write_text
from recon.cloud import Cloud, read_cloud
from recon.truth.statistics import NEAR

Bools = NDArray[np.bool_]

PAGE = Path(__file__).resolve().parents[1] / "docs" / "benchmarks" / "accuracy.md"
FAMILIES = ("slab", "beam", "girder", "arch", "suspension", "cable_stayed")
SERVICES = {"road": "road", "rail": "rail_double"}
SURVEYS: Mapping[str, Mapping[str, Any]] = {
    "local": {"kind": "local", "length": 20.0, "images": [50, 70]},
    "global": {"kind": "global", "images": 80},
}
MODES = ("sparse", "dense")
SAMPLES: tuple[Mapping[str, Any], ...] = (  # as in scenarios/learning.toml
    {"kind": "mesh", "density": 120.0, "reach": 12.0, "voxel": 0.05},
    {"kind": "mesh", "id": "visible", "density": 120.0, "reach": 12.0, "voxel": 0.05, "min_views": 3},
    {"kind": "terrestrial", "id": "tls", "reach": 40.0, "angular_step": 0.35, "voxel": 0.05},
)
FEWEST, ALL_RIGHT = 20, 0.95  # points of an instance that counts, and share of them that makes it right [1]


@dataclass(frozen=True)
class Row:
    """A bridge and a flight.

    Attributes:
        family: Family of the bridge.
        service: road or rail, a key of `SERVICES`.
        survey: A key of `SURVEYS`.
    """

    family: str
    service: str
    survey: str

    @property
    def name(self) -> str:
        """Name of its folder, and of it on the command line."""
        return f"{self.survey}-{self.family}-{self.service}"


ROWS = tuple(
    Row(family, service, survey)
    for survey in SURVEYS
    for family in FAMILIES
    for service in (SERVICES if survey == "local" else ("road",))
)


@dataclass(frozen=True, eq=False)
class Judged:
    """What is known of the points of a cloud.

    Attributes:
        cloud: The cloud.
        near: Whether each point is on the true surface, shape (N,), bool.
        right: Whether each is there and has the class of that surface, shape (N,), bool.
    """

    cloud: Cloud
    near: Bools
    right: Bools

    @property
    def classes(self) -> dict[int, str]:
        """Name of each class by its number."""
        return {row.id: row.name for row in self.cloud.classes}


def scenario_of_row(row: Row, seed: int) -> dict[str, Any]:
    """Write the scenario of a row.

    Args:
        row: Bridge and flight.
        seed: Seed of the scene.
    """
    return {
        "seed": seed,
        "bridge": {"family": row.family, "service": SERVICES[row.service]},
        "background": {"name": "countryside"},
        "look": {"name": "random", "texels": 1024},
        "survey": [{**SURVEYS[row.survey], "width": 960, "height": 720}],
        "sample": [dict(sample) for sample in SAMPLES],
        "sensor": {"noise": True},
        "recon": {"mode": "both", "quality": "medium"},
        "keep": ["stage", "cloud"],
    }


def judge(cloud: Cloud) -> Judged:
    """Compare a cloud with its truth.

    Args:
        cloud: A cloud of a capture with truth.
    """
    columns = cloud.columns
    near = columns["surface_distance"] <= NEAR
    return Judged(cloud, near, near & (columns["segment"] == columns["surface_class"]))


def instances_right(judged: Judged, within: Bools | None = None) -> tuple[int, int]:
    """Count instances that are labelled right, as a whole.

    Args:
        judged: The cloud.
        within: Points to look at, shape (N,), bool; all when None.

    Returns:
        Instances of which at least `ALL_RIGHT` of the points on the surface have its class, and instances with
        `FEWEST` such points.
    """
    taken = judged.near if within is None else judged.near & within
    instance = judged.cloud.columns["instance"]
    named = taken & (instance > 0)
    _, which, count = np.unique(instance[named], return_inverse=True, return_counts=True)
    share = np.bincount(which, weights=judged.right[named], minlength=len(count)) / np.maximum(count, 1)
    counts = count >= FEWEST
    return int((counts & (share >= ALL_RIGHT)).sum()), int(counts.sum())


def row_line(row: Row, mode: str, judged: Judged) -> str:
    """Write the line of a cloud.

    Args:
        row: Bridge and flight.
        mode: sparse or dense.
        judged: The cloud.
    """
    figures = judged.cloud.statistics
    right, instances = instances_right(judged)
    cells = [
        row.family,
        row.service,
        row.survey,
        mode,
        f"{figures['valid']} of {figures['images']}",
        f"{1000 * (figures['center_error_median'] or np.nan):.1f}",
        f"{len(judged.near):,}",
        _share(judged.near.sum(), len(judged.near)),
        _share(judged.right.sum(), judged.near.sum()),
        f"{right} of {instances}",
    ]
    return f"| {' | '.join(cells)} |"


def class_lines(clouds: Sequence[Judged]) -> list[str]:
    """Write a line for each class: of all clouds of one mode.

    Args:
        clouds: Clouds that share a class table.
    """
    lines = []
    for number, name in (clouds[0].classes if clouds else {}).items():
        mine = [judged.cloud.columns["segment"] == number for judged in clouds]
        points = sum(int(one.sum()) for one in mine)
        if not points or name == "unlabelled":
            continue
        near = sum(int((one & judged.near).sum()) for one, judged in zip(mine, clouds, strict=True))
        right = sum(int((one & judged.right).sum()) for one, judged in zip(mine, clouds, strict=True))
        whole = [instances_right(judged, one) for one, judged in zip(mine, clouds, strict=True)]
        good, counted = sum(a for a, _ in whole), sum(b for _, b in whole)
        instances = f"{good} of {counted}" if counted else ""
        lines.append(f"| {name} | {points:,} | {_share(near, points)} | {_share(right, near)} | {instances} |")
    return lines


def accuracy_page(found: Mapping[Row, Mapping[str, Judged]]) -> str:
    """Write the page.

    Args:
        found: For each row its clouds by mode.
    """
    lines = [
        "# How true the clouds are",
        "",
        "Written by `python -m benchmarks.accuracy WORK`. One bridge a row, 960 x 720 px, sensor noise, countryside,",
        f"quality `medium`; both clouds come from one model. *Near*: within {NEAR:g} m of the true surface. *Right*:",
        "of these, with the class of that surface. *Centre*: median error of camera centers. An *instance* is right",
        f"where {ALL_RIGHT:.0%} of its near points have its class; those with fewer than {FEWEST} do not count.",
        "",
        "| family | service | flight | cloud | cameras | centre [mm] | points | near | right | instances right |",
        "|---|---|---|---|---|---|---|---|---|---|",
        *(row_line(row, mode, clouds[mode]) for row, clouds in found.items() for mode in MODES if mode in clouds),
    ]
    missing = [row.name for row in ROWS if row not in found]
    if missing:
        lines += ["", f"Not made: {', '.join(missing)}."]
    for mode in MODES:
        lines += ["", f"## By class, {mode}", "", "| class | points | near | right | instances right |"]
        lines += ["|---|---|---|---|---|", *class_lines([by[mode] for by in found.values() if mode in by])]
    return "\n".join([*lines, ""])


def main() -> None:
    """Make what is missing, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("work", type=Path)
    parser.add_argument("--only", nargs="+", default=[row.name for row in ROWS], metavar="NAME")
    parser.add_argument("--page", action="store_true", help="make nothing more")
    given = parser.parse_args()
    for number, row in enumerate(ROWS, 4001):
        if row.name in given.only and not given.page:
            with ConsoleProgress() as progress:
                outcome = falsework.run(scenario_of_row(row, number), given.work / row.name, progress=progress)
            sys.stdout.write(f"{row.name}: {outcome.made} made\n")
    write_text(PAGE, accuracy_page({row: clouds for row in ROWS if (clouds := _clouds(given.work / row.name))}))


def _clouds(run: Path) -> dict[str, Judged]:
    found: dict[str, Judged] = {}
    for record in sorted(run.glob("scenes/*/cloud/*/cloud.json")):
        mode = str(read_json(record)["source"]).removeprefix("sfm-")
        if mode in MODES:  # the others are samples
            found[mode] = judge(read_cloud(record.parent))
    return found


def _share(part: float, whole: float) -> str:
    return f"{part / whole:.1%}" if whole else ""


if __name__ == "__main__":
    main()
