"""Accuracy of the clouds: every family, road and rail, close and whole flights, sparse and dense, class by class.

Usage: python -m benchmarks.recon.accuracy WORK [--only NAME…] [--page] [--samples] [--note TEXT]

Makes a bridge for every row, flies, renders and reconstructs it, and writes `docs/benchmarks/accuracy.md`. WORK keeps
what was made: a second call goes on. `--page` writes the page of what is there. A row takes some twelve processor
minutes. With `--samples`, all but the rail bridges of whole flights are sampled on their mesh and by a tripod's laser,
too, for `benchmarks.shipped`. Rows of `inspection` are short bridges whose every member is flown at, for the class
that has fewest points: dense alone, and no samples.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

import falsework
from benchmarks.page import write_page
from benchmarks.recon.accuracy_rows import MODES, ROWS, SURVEYS, Row, scenario_of_row
from benchmarks.recon.by_distance import distance_lines, nearest_camera
from benchmarks.recon.judged_cloud import (
    ALL_RIGHT,
    CLEAR,
    FEWEST,
    PRECISE,
    Bools,
    Judged,
    fewest,
    instances_right,
    judge,
)
from falsework.commands.console import ConsoleProgress
from groundwork.files import read_json
from recon.cloud import read_cloud
from recon.sampling.scene_surface import lay_out
from recon.truth.statistics import NEAR
from usd_schemas.reading.scene_cache import load_scene

PAGE = Path(__file__).resolve().parents[2] / "docs" / "benchmarks" / "accuracy.md"


def row_line(row: Row, mode: str, judged: Judged) -> str:
    """Write the line of a cloud.

    Args:
        row: Bridge and flight.
        mode: sparse or dense.
        judged: The cloud.
    """
    figures = judged.cloud.statistics
    right, instances = instances_right(judged)
    least = fewest(judged.cloud)
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
        _share(judged.clear.sum(), judged.near.sum()),
        f"{right} of {instances}",
        f"{least[0]}: {least[1]:,}" if least else "",
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
        clear = sum(int((one & judged.clear).sum()) for one, judged in zip(mine, clouds, strict=True))
        agreed = _right_among([one & judged.agreed for one, judged in zip(mine, clouds, strict=True)], clouds)
        precise = _right_among([one & judged.precise for one, judged in zip(mine, clouds, strict=True)], clouds)
        whole = [instances_right(judged, one) for one, judged in zip(mine, clouds, strict=True)]
        good, counted = sum(a for a, _ in whole), sum(b for _, b in whole)
        instances = f"{good} of {counted}" if counted else ""
        shares = [_share(near, points), _share(right, near), agreed[0], precise[0], precise[1], _share(clear, near)]
        lines.append(f"| {' | '.join([name, f'{points:,}', *shares, instances])} |")
    return lines


def _right_among(taken: Sequence[Bools], clouds: Sequence[Judged]) -> tuple[str, str]:
    """Give the share of some near points that are right, and the number of those points."""
    near = [one & judged.near for one, judged in zip(taken, clouds, strict=True)]
    right = sum(int((one & judged.right).sum()) for one, judged in zip(near, clouds, strict=True))
    count = sum(int(one.sum()) for one in near)
    return _share(right, count), f"{count:,}"


def summary(found: Mapping[Row, Mapping[str, Judged]]) -> str:
    """Write the page in a sentence or two, which README repeats.

    Args:
        found: For each row its clouds by mode.
    """
    counts = [sum(row.survey == survey for row in found) for survey in SURVEYS]
    parts = []
    for mode in MODES:
        shares = [each.right.sum() / each.near.sum() for by in found.values() if (each := by.get(mode))]
        parts += [f"{100 * min(shares):.1f} to {100 * max(shares):.1f} % ({mode})"] if shares else []
    clear = max((each.clear.sum() / each.near.sum() for by in found.values() for each in by.values()), default=0.0)
    inspections = [each.cloud for row, by in found.items() if row.survey == "inspection" for each in by.values()]
    points = min((least[1] for cloud in inspections if (least := fewest(cloud))), default=None)
    inspected = "" if points is None else f" An inspection gives every class of its bridge at least {points:,} points."
    return (
        f"{counts[0]} bridges with a close flight of a part, {counts[1]} with a flight of the whole, {counts[2]} with "
        f"an inspection of every member: {' and '.join(parts)} of the points near a surface have the right class, and "
        f"at most {100 * clear:.1f} % are more than {1000 * CLEAR:.0f} mm nearer to another class than to their own."
        f"{inspected}"
    )


def accuracy_page(found: Mapping[Row, Mapping[str, Judged]], rejected: Mapping[Row, str], note: str = "") -> str:
    """Write the page.

    Args:
        found: For each row its clouds by mode.
        rejected: For each row whose scene was rejected, why.
        note: A line of its own, such as which code made the clouds; empty for none.
    """
    lines = [
        "# Accuracy of the clouds",
        "",
        summary(found),
        "",
        "Written by `python -m benchmarks.recon.accuracy WORK`. One bridge per row, 960 x 720 px, sensor noise,",
        f"countryside, quality `medium`; both clouds come from one model. *Near*: within {NEAR:g} m of the true",
        "surface. *Right*: of these, with the class of that surface. *Clearly wrong*: with another class, and the",
        f"nearest surface of their own lies more than {1000 * CLEAR:.0f} mm farther: where rails and sleepers are a",
        "few centimeters high, a point that is 20 mm off lies nearer to the neighbor of what its photographs show.",
        "*Center*: median error of camera centers. An *instance* is right",
        f"where {ALL_RIGHT:.0%} of its near points have its class; those with fewer than {FEWEST} do not count.",
        "*Fewest points*: the class that has fewest, of those that the bridge has where the flight saw it.",
        "*Confidence* is the share of the views of a point that show its class. *Precise*: with a measured uncertainty",
        f"of at most {1000 * PRECISE:g} mm. Most clearly wrong points of slabs, sleepers and rails lie higher or lower",
        "than what their photographs show by more than such a member is high: their class is what the pixels show,",
        "their position is not. The uncertainty finds them, the confidence does not.",
        *(["", note] if note else []),
        "",
        *_rows(found),
    ]
    if rejected:
        lines += ["", "Rejected, and so without a cloud:", ""]
        lines += [f"- {row.name}: {reason}" for row, reason in rejected.items()]
    missing = [row.name for row in ROWS if row not in found and row not in rejected]
    if missing:
        lines += ["", f"Not made: {', '.join(missing)}."]
    for mode in MODES:
        judged = [by[mode] for by in found.values() if mode in by]
        lines += ["", f"## By distance from the nearest camera, {mode}", "", "| distance | points | near | right |"]
        lines += ["|---|---|---|---|", *distance_lines([(each.distance, each.near, each.right) for each in judged])]
    head = (
        "| class | points | near | right | right where confidence is 1 | right where precise | precise points "
        "| clearly wrong | instances right |"
    )
    for mode in MODES:
        lines += ["", f"## By class, {mode}", "", head]
        lines += [
            "|---|---|---|---|---|---|---|---|---|",
            *class_lines([by[mode] for by in found.values() if mode in by]),
        ]
    return "\n".join([*lines, ""])


def _rows(found: Mapping[Row, Mapping[str, Judged]]) -> list[str]:
    """Write the table of clouds."""
    return [
        "| family | service | flight | cloud | cameras | center [mm] | points | near | right | clearly wrong "
        "| instances right | fewest points |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|",
        *(
            row_line(row, mode, found[row][mode])
            for row in ROWS
            if row in found
            for mode in MODES
            if mode in found[row]
        ),
    ]


def main() -> None:
    """Make what is missing, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("work", type=Path)
    parser.add_argument("--only", nargs="+", default=[row.name for row in ROWS], metavar="NAME")
    parser.add_argument("--page", action="store_true", help="make nothing more")
    parser.add_argument("--samples", action="store_true", help="sample meshes and lasers, too")
    parser.add_argument("--note", default="", help="a line for the page")
    given = parser.parse_args()
    for number, row in enumerate(ROWS, 4001):
        if row.name in given.only and not given.page:
            with ConsoleProgress() as progress:
                scenario = scenario_of_row(row, number, given.samples)
                outcome = falsework.run(scenario, given.work / row.name, progress=progress)
            sys.stdout.write(f"{row.name}: {outcome.made} made\n")
    found = {row: clouds for row in ROWS if (clouds := _clouds(given.work / row.name))}
    rejected = {row: why for row in ROWS if row not in found and (why := _rejection(given.work / row.name))}
    write_page(PAGE, accuracy_page(found, rejected, given.note), __file__)


def _clouds(run: Path) -> dict[str, Judged]:
    found: dict[str, Judged] = {}
    for record in sorted(run.glob("scenes/*/cloud/*/cloud.json")):
        mode = str(read_json(record)["source"]).removeprefix("sfm-")
        if mode in MODES:  # the others are samples
            surface = lay_out(load_scene(record.parents[2] / "stage" / "scene.usda"))
            cloud = read_cloud(record.parent)
            distance = nearest_camera(record.parent, cloud)
            found[mode] = judge(cloud, distance, surface.corners, surface.labels)
    return found


def _rejection(run: Path) -> str:
    records = [read_json(path) for path in sorted(run.glob("failed/*.json"))]
    return next((f"{record['reason']}, {record['message']}." for record in records if record["kind"] == "rejected"), "")


def _share(part: float, whole: float) -> str:
    return f"{part / whole:.1%}" if whole else ""


if __name__ == "__main__":
    main()
