"""What a set of bridges to learn from holds: bridges, photographs, points of each class, hours and disk space.

Usage: python -m benchmarks.learn.working_set RUN…

A RUN is the output folder of a run of `scenarios/learning.toml`, or of another scenario with clouds. Writes
`docs/experiments/bridges.md`.
"""

import argparse
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.page import write_page
from falsework.execution.events import read_events
from groundwork.files import read_json

PAGE = Path(__file__).resolve().parents[2] / "docs" / "experiments" / "bridges.md"


@dataclass(frozen=True)
class BridgeRow:
    """A bridge of a run.

    Attributes:
        name: Number of its scene.
        family: Family of the bridge.
        photographs: Photographs of all flights.
        registered: Those in the model.
        points: Name of each cloud to its points of each class.
    """

    name: str
    family: str
    photographs: int
    registered: int
    points: Mapping[str, Mapping[str, int]]


def read_bridge(scene: Path) -> BridgeRow:
    """Read the clouds of a scene.

    Args:
        scene: Its folder in a run.
    """
    points: dict[str, dict[str, int]] = {}
    taken, kept = 0, 0
    for path in sorted((scene / "cloud").iterdir()):
        record = read_json(path / "cloud.json")
        names = {row["id"]: row["name"] for row in record["classes"]}
        ids, counts = np.unique(np.load(path / "segment.npy"), return_counts=True)
        points[path.name] = {names[number]: int(count) for number, count in zip(ids.tolist(), counts, strict=True)}
        if path.name.endswith("+dense"):
            taken += len(record["cameras"])
            kept += sum(row["status"] == "ok" for row in record["cameras"])
    return BridgeRow(scene.name, family_of(scene / "stage" / "bridge" / "bridge.usda"), taken, kept, points)


def family_of(layer: Path) -> str:
    """Read the family of a bridge.

    Args:
        layer: Its root layer in a scene.
    """
    from pxr import Usd

    stage = Usd.Stage.Open(str(layer), Usd.Stage.LoadNone)
    return str(stage.GetDefaultPrim().GetAttribute("falsework:bridge:family").Get())


def hours_and_bytes(runs: Iterable[Path]) -> dict[str, tuple[int, float, float]]:
    """Sum what each stage took.

    Args:
        runs: Output folders.

    Returns:
        Name of each stage to its results, hours of one worker [h], and size [GB].
    """
    found: dict[str, tuple[int, float, float]] = {}
    for run in runs:
        for event in read_events(run):
            if event.get("made"):
                count, hours, size = found.get(event["stage"], (0, 0.0, 0.0))
                found[event["stage"]] = (count + 1, hours + event["seconds"] / 3600.0, size + event["bytes"] / 1e9)
    return found


def page(rows: Sequence[BridgeRow], stages: Mapping[str, tuple[int, float, float]]) -> str:
    """Write the page.

    Args:
        rows: The bridges.
        stages: Of `hours_and_bytes`.
    """
    clouds = list(dict.fromkeys(name for row in rows for name in row.points))
    classes = sorted({name for row in rows for own in row.points.values() for name in own})
    families: dict[str, list[BridgeRow]] = {}
    for row in rows:
        families.setdefault(row.family, []).append(row)
    lines = [
        "# Bridges to learn from",
        "",
        "`python -m benchmarks.learn.working_set RUN…` writes this page, from a run of `scenarios/learning.toml`. "
        "[Comparisons](../comparisons.md) are trained and tested on these bridges.",
        "",
        f"{len(rows)} bridges have all of their clouds.",
        "",
        "| family | bridges | photographs | registered |",
        "|---|---|---|---|",
        *(
            f"| {name} | {len(own)} | {sum(row.photographs for row in own)} | {sum(row.registered for row in own)} |"
            for name, own in sorted(families.items())
        ),
        "",
        "## Points of each class",
        "",
        "All bridges together; in brackets the number of bridges that show the class with 50 points or more.",
        "",
        f"| class | {' | '.join(clouds)} |",
        "|---" * (1 + len(clouds)) + "|",
        *(f"| {name} | {' | '.join(cell(rows, cloud, name) for cloud in clouds)} |" for name in classes),
        "",
        "## Hours and disk space",
        "",
        "Hours of one of two workers on two cores. Photographs and models are removed when their clouds are made.",
        "",
        "| stage | results | hours | GB |",
        "|---|---|---|---|",
        *(f"| {name} | {count} | {hours:.1f} | {size:.1f} |" for name, (count, hours, size) in stages.items()),
    ]
    return "\n".join([*lines, ""])


def cell(rows: Sequence[BridgeRow], cloud: str, name: str) -> str:
    """Count the points of a class in one kind of cloud, and the bridges that show it.

    Args:
        rows: The bridges.
        cloud: Name of the clouds.
        name: Name of the class.
    """
    counts = [row.points.get(cloud, {}).get(name, 0) for row in rows]
    return f"{sum(counts):,} ({sum(count >= 50 for count in counts)})" if any(counts) else "-"


def main() -> None:
    """Read the runs, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("runs", nargs="+", type=Path)
    runs: list[Path] = parser.parse_args().runs
    scenes = [scene for run in runs for scene in sorted((run / "scenes").iterdir()) if (scene / "cloud").is_dir()]
    rows = [read_bridge(scene) for scene in scenes]
    most = max(len(row.points) for row in rows)
    write_page(PAGE, page([row for row in rows if len(row.points) == most], hours_and_bytes(runs)), __file__)


if __name__ == "__main__":
    main()
