"""Which training clouds are worth most: `falsework compare` on a small set of bridges, as pages.

Usage: python -m benchmarks.learn.experiments RUN… -o OUT [--only NAME…] [--set KEY=VALUE…]

A RUN is the output folder of a run of `scenarios/learning.toml`. OUT keeps every result: the same command goes on where
it was stopped. Writes `docs/experiments/NAME.md` for each experiment of `benchmarks/learn/experiment`. Networks may be
trained on another machine first: `benchmarks.learn.remote_training`, with OUT/NAME and the same `--set`.
"""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.page import write_page
from groundwork.files import read_json
from groundwork.slug import slug
from learn.compare.pieces import counts_of
from learn.compare.tables import page

F64 = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[2]
PAGES = ROOT / "docs" / "experiments"
EXPERIMENTS = ROOT / "benchmarks" / "learn" / "experiment"
LASER = "tls"
SENSORS = "sensors"  # the experiment whose arms may differ by where they find the ground


def main() -> None:
    """Run the experiments, and write their pages."""
    names = sorted(path.stem for path in EXPERIMENTS.glob("*.toml"))
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("runs", nargs="+", type=Path)
    parser.add_argument("-o", "--output", required=True, type=Path)
    parser.add_argument("--only", nargs="+", choices=names, default=names, metavar="NAME")
    parser.add_argument("--set", nargs="+", default=[], metavar="KEY=VALUE", help="settings that differ")
    chosen = parser.parse_args()
    for name in chosen.only:
        output = chosen.output / name
        compare(chosen.runs, name, output, chosen.set)
        record = read_json(output / "comparison.json")
        pieces = sorted((output / "store" / "pieces").iterdir())
        grounds = ground_offsets(pieces, record["settings"]["fewest"]) if name == SENSORS else {}
        write_page(PAGES / f"{name}.md", experiment_page(record, name, grounds), __file__)


def compare(runs: Sequence[Path], name: str, output: Path, changed: Sequence[str] = ()) -> None:
    """Run an experiment.

    Args:
        runs: Output folders of runs.
        name: Name of the experiment's file.
        output: Folder of the experiment.
        changed: Settings that differ from the file's, key=value.
    """
    from falsework.cli import main as falsework

    words = [word for setting in changed for word in ("--set", setting)]
    preset = str(EXPERIMENTS / f"{name}.toml")
    try:
        falsework(["compare", *map(str, runs), "-o", str(output), "--preset", preset, *words])
    except SystemExit as end:
        if end.code:
            raise


def ground_offsets(pieces: Sequence[Path], fewest: int) -> dict[str, tuple[float, float]]:
    """Compute how far the ground of each cloud lies above that of the laser scan, tile by tile.

    Args:
        pieces: Folders of cut bridges.
        fewest: Points that every cloud must have in a tile.

    Returns:
        Name of each cloud to the median and the lowest tenth of the differences over all bridges [m].
    """
    found: dict[str, list[F64]] = {}
    for folder in pieces:
        counts = counts_of(folder)
        valid = np.all([np.array(row.quiet) >= fewest for row in counts.values()], axis=0)
        heights = {name: np.load(folder / slug(name) / "origins.npy")[valid, 2] for name in counts}
        for name, own in heights.items():
            found.setdefault(name, []).append(own - heights[LASER])
    joined = {name: np.concatenate(rows) for name, rows in found.items() if name != LASER}
    return {
        name: (float(np.median(rows)), float(np.quantile(rows, 0.1)))
        for name, rows in sorted(joined.items())
        if len(rows)
    }


def experiment_page(record: Mapping[str, Any], name: str, grounds: Mapping[str, tuple[float, float]]) -> str:
    """Put the tables of an experiment below a sentence about their source.

    Args:
        record: What `falsework compare` wrote.
        name: Name of the experiment's file.
        grounds: Of `ground_offsets` [m]; none where the arms do not differ by it.

    Returns:
        Markdown.
    """
    path = (EXPERIMENTS / f"{name}.toml").relative_to(ROOT).as_posix()
    heading, _, rest = page(record).replace(f"--preset {name}.toml", f"--preset {path}").partition("\n")
    about = (
        f"`python -m benchmarks.learn.experiments RUN… -o OUT --only {name}` writes this page, from "
        f"`benchmarks/learn/experiment/{name}.toml`. [How to read it](../comparisons.md). Trainings are short: the "
        "sign of a large difference is reliable, its size is not, and models that train for longer may "
        "differ."
    )
    lines = [heading, "", about, *_ground_lines(grounds)]
    return "\n".join(lines) + f"\n{rest}"


def _ground_lines(grounds: Mapping[str, tuple[float, float]]) -> list[str]:
    if not grounds:
        return []
    ground = (
        "Heights count from a ground that is estimated from each cloud's own points. A mesh shows footings, piles and "
        "whatever else stands in the ground, so the ground estimated from a mesh is lower, and a deck is higher above "
        "it than in a scan: that may be part of what it loses below, as may the faces that nobody can see."
    )
    rows = [f"| {name} | {middle:+.2f} m | {low:+.2f} m |" for name, (middle, low) in grounds.items()]
    what = "Estimate minus the laser's, over the tiles that all show:"
    table = ["| clouds | median | lowest tenth |", "|---|---|---|", *rows]
    return ["", "## Where the ground is", "", ground, "", what, "", *table]


if __name__ == "__main__":
    main()
