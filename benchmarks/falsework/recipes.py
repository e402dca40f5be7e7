"""What the paper's two data sets give, scene by scene: `python -m benchmarks.falsework.recipes`.

The figures are those of the rows `paper-local` and `paper-global` of docs/proof.json, which `make proof` measures: it
makes the first scenes of both sets, from their seeds to their annotated clouds.
"""

from pathlib import Path
from statistics import fmean
from typing import Any

from authoring.families.bridge_settings import draw_layout
from authoring.streams import stream
from benchmarks.page import write_page
from falsework.platform import processor
from falsework.scenario import Scenario, load_scenario, scene_seed
from groundwork.errors import InputError
from groundwork.files import read_json

ROOT = Path(__file__).resolve().parents[2]
PROOF = ROOT / "docs" / "proof.json"
PAGE = ROOT / "docs" / "benchmarks" / "recipes.md"
MOST_REJECTED = {"paper-local": (3, 30), "paper-global": (1, 6)}  # limit, of the first scenes
CABLE_FAMILIES, CABLE_CLASSES = ("cable_stayed", "suspension"), ("cable_top", "cable_base")
GOALS = {  # what a scene should reach; the table names those that do not
    "label_error": ("wrong label", "at most", 0.015),
    "label_error_margin_3px": ("wrong label 3 px from an edge", "at most", 0.004),
    "completeness_5cm_bridge": ("completeness", "at least", 0.75),
}
ENOUGH = 20  # points of a class that a scene must have to count for it
_POINTS = "points_"

Scenes = dict[int, dict[str, Any]]


def main() -> None:
    """Write the page."""
    rows = read_json(PROOF)["rows"]
    scenes = {name: made for name in MOST_REJECTED if (made := _scenes(name, rows))}
    if not scenes:
        raise InputError("no scene has been measured", where=PROOF, hint="Run make proof")
    scenarios = {name: load_scenario(ROOT / "scenarios" / f"{name}.toml") for name in scenes}
    lines = [
        "# The paper's data sets, scene by scene",
        "",
        "Written by `python -m benchmarks.falsework.recipes` from the rows of [proof.json](../proof.json), measured on "
        f"{processor()}: the first scenes of `scenarios/paper-local.toml` and `scenarios/paper-global.toml`, none left "
        "out. Label errors are those of points within 0.1 m of a surface; completeness is the share of the bridge's "
        "surface, seen by 3 cameras within 15 m, that has a point within 5 cm.",
    ]
    for name, made in scenes.items():
        lines += ["", f"## {name}", "", _rejected(name, made), "", _within(made)]
        lines += ["", *_scene_table(scenarios[name], made)]
    lines += ["", "## Points of each class", "", *_class_table(scenes)]
    if "paper-global" in scenes:
        cables = _cables(scenarios["paper-global"], scenes["paper-global"])
        lines += ["", "## Ends of cables in the global set", "", *cables]
    else:
        lines += ["", "No scene of the global set has been measured yet."]
    write_page(PAGE, "\n".join(lines) + "\n", __file__)


def _scenes(name: str, rows: list[dict[str, Any]]) -> Scenes:
    """Take the figures of the scenes of one set, by their numbers; rows without counts of points are of older code."""
    begin = f"{name}: scene "
    found = {int(row["name"].removeprefix(begin)): row["figures"] for row in rows if row["name"].startswith(begin)}
    return {
        scene: figures
        for scene, figures in sorted(found.items())
        if "rejected" in figures or any(key.startswith(_POINTS) for key in figures)
    }


def _rejected(name: str, made: Scenes) -> str:
    most, count = MOST_REJECTED[name]
    reasons = {scene: one["rejected"] for scene, one in made.items() if "rejected" in one and scene < count}
    told = "".join(f" Scene {scene}: {reason}." for scene, reason in reasons.items())
    missing = sorted(set(range(count)) - set(made))
    also = f" Not measured yet: {', '.join(map(str, missing))}." if missing else ""
    first = sum(scene < count for scene in made)
    return f"Rejected: {len(reasons)} of the {first} first ones (limit: {most} of {count}).{told}{also}"


def _within(made: Scenes) -> str:
    """Count the scenes that reach every goal, and name the others with what they miss."""
    kept = {scene: figures for scene, figures in made.items() if "rejected" not in figures}
    missed = {}
    for scene, figures in kept.items():
        measured = {key: figures[key] for key in GOALS if key in figures}
        beyond = [f"{GOALS[key][0]} {value:.2%}" for key, value in measured.items() if not _reached(key, value)]
        if beyond:
            missed[scene] = ", ".join(beyond)
    keys = [key for key in GOALS if any(key in figures for figures in kept.values())]
    goals = ", ".join(f"{GOALS[key][0]} {GOALS[key][1]} {GOALS[key][2]:.1%}" for key in keys)
    told = "".join(f" Scene {scene}: {what}." for scene, what in missed.items())
    return f"Goals of a scene: {goals}. Reached by {len(kept) - len(missed)} of {len(kept)} scenes.{told}"


def _reached(key: str, value: float) -> bool:
    return value <= GOALS[key][2] if GOALS[key][1] == "at most" else value >= GOALS[key][2]


def _scene_table(scenario: Scenario, made: Scenes) -> list[str]:
    lines = [
        "| scene | family | length [m] | images | registered | points | wrong label | wrong label, 3 px from an edge | "
        "completeness | CPU-min |",
        "|---|" + "---|" * 9,
    ]
    kept = {scene: figures for scene, figures in made.items() if "rejected" not in figures}
    for scene, one in kept.items():
        family, length = _bridge(scenario, scene)
        complete = f"{one['completeness_5cm_bridge']:.0%}" if "completeness_5cm_bridge" in one else "-"
        lines.append(
            f"| {scene} | {family} | {length:.0f} | {one['images']} | {one['registered_share']:.1%} | "
            f"{_count(one):,} | {one['label_error']:.2%} | {one['label_error_margin_3px']:.2%} | {complete} | "
            f"{one['cpu_s'] / 60.0:.0f} |"
        )
    every = list(kept.values())
    if not every:
        return lines
    mean = {key: fmean(one[key] for one in every) for key in ("images", "registered_share", "cpu_s")}
    errors = [f"{fmean(one[key] for one in every):.2%}" for key in ("label_error", "label_error_margin_3px")]
    lines.append(
        f"| mean | | | {mean['images']:.0f} | {mean['registered_share']:.1%} | {fmean(map(_count, every)):,.0f} | "
        f"{errors[0]} | {errors[1]} | | {mean['cpu_s'] / 60.0:.0f} |"
    )
    return lines


def _class_table(scenes: dict[str, Scenes]) -> list[str]:
    lines = [
        "| class | " + " | ".join(f"{name}, points | scenes with >= {ENOUGH}" for name in scenes) + " |",
        "|---|" + "---|---|" * len(scenes),
    ]
    keys = {key: None for made in scenes.values() for one in made.values() for key in one if key.startswith(_POINTS)}
    for key in sorted(keys):
        cells = []
        for made in scenes.values():
            counts = [one.get(key, 0) for one in made.values() if "rejected" not in one]
            cells += [f"{sum(counts):,}", f"{sum(count >= ENOUGH for count in counts)} of {len(counts)}"]
        lines.append(f"| {key.removeprefix(_POINTS)} | {' | '.join(cells)} |")
    return lines


def _cables(scenario: Scenario, made: Scenes) -> list[str]:
    rows, enough = [], 0
    for scene, one in made.items():
        family, length = _bridge(scenario, scene)
        if family in CABLE_FAMILIES and "rejected" not in one:
            counts = [one.get(f"{_POINTS}{name}", 0) for name in CABLE_CLASSES]
            enough += min(counts) >= ENOUGH
            rows.append(f"| {scene} | {family} | {length:.0f} | {' | '.join(f'{count:,}' for count in counts)} |")
    head = f"| scene | family | length [m] | {' | '.join(CABLE_CLASSES)} |"
    told = f"Both have at least {ENOUGH} points in {enough} of {len(rows)} cable bridges (asked: half of at least 3)."
    return [told, "", head, "|---|---|---|---|---|", *rows]


def _bridge(scenario: Scenario, scene: int) -> tuple[str, float]:
    """Find the family and the length of a scene's bridge."""
    layout, drawn = draw_layout(scenario.bridge, stream(scene_seed(scenario.seed, scene), "bridge"))
    return drawn.family, layout.supports[-1] - layout.supports[0]


def _count(figures: dict[str, Any]) -> int:
    return sum(count for key, count in figures.items() if key.startswith(_POINTS))


if __name__ == "__main__":
    main()
