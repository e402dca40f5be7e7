"""Which training clouds are worth most: `falsework compare` on a small set of bridges, as a page.

Usage: python -m benchmarks.compare BRIDGE... -o OUT

A BRIDGE is a folder with the clouds `mesh`, `visible` and `tls` of one bridge, as `scenarios/learning.toml` makes them;
its folder's name is the bridge's. OUT keeps every result: the same command goes on where it was stopped. Writes
`docs/benchmarks/compare.md`.
"""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.files import read_json, write_text
from groundwork.slug import slug
from learn.compare.pieces import counts_of
from learn.compare.tables import page

F64 = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "benchmarks" / "compare.md"
EXPERIMENT = ROOT / "benchmarks" / "compare.toml"
LASER = "tls"


def main() -> None:
    """Compare, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bridges", nargs="+", type=Path)
    parser.add_argument("-o", "--output", required=True, type=Path)
    chosen = parser.parse_args()
    compare(chosen.bridges, chosen.output)
    pieces = sorted((chosen.output / "store" / "pieces").iterdir())
    record = read_json(chosen.output / "comparison.json")
    write_text(PAGE, benchmark_page(record, ground_offsets(pieces, record["settings"]["fewest"])))


def compare(bridges: Sequence[Path], output: Path) -> None:
    """Run the experiment of `benchmarks/compare.toml`.

    Args:
        bridges: A folder for each, with a folder for each of its clouds.
        output: Folder of the experiment.
    """
    from falsework.cli import main as falsework

    names = [word for bridge in bridges for word in ("--bridge", bridge.name)]
    try:
        falsework(["compare", *map(str, bridges), "-o", str(output), "--preset", str(EXPERIMENT), *names])
    except SystemExit as end:
        if end.code:
            raise


def ground_offsets(pieces: Sequence[Path], fewest: int) -> dict[str, tuple[float, float]]:
    """Tell how far the ground that each cloud shows lies above the one that the laser's shows, tile by tile.

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
    return {name: (float(np.median(rows)), float(np.quantile(rows, 0.1))) for name, rows in sorted(joined.items())}


def benchmark_page(record: Mapping[str, Any], grounds: Mapping[str, tuple[float, float]]) -> str:
    """Put the tables of an experiment below a sentence that says where they come from.

    Args:
        record: What `falsework compare` wrote.
        grounds: Of `ground_offsets` [m].

    Returns:
        Markdown.
    """
    heading, _, rest = page(record).partition("\n")
    about = (
        "`python -m benchmarks.compare BRIDGE... -o OUT` writes this page, from `benchmarks/compare.toml`. "
        "[How to read it](../comparisons.md). A forest on few bridges: the direction of a large difference is worth "
        "something, its size is not, and networks trained for longer may differ."
    )
    ground = (
        "Heights count from a ground that is estimated from each cloud's own points. A mesh shows footings, piles and "
        "whatever else stands in the ground, and its estimate sinks to them, so that a deck is higher in it than in a "
        "scan: that may be part of what it loses below, as may the faces that nobody can see."
    )
    rows = [f"| {name} | {middle:+.2f} m | {low:+.2f} m |" for name, (middle, low) in grounds.items()]
    table = ["| clouds | median | lowest tenth |", "|---|---|---|", *rows]
    what = "Estimate minus the laser's, over the tiles that all show:"
    lines = [heading, "", about, "", "## Where the ground is", "", ground, "", what, "", *table]
    return "\n".join(lines) + f"\n{rest}"


if __name__ == "__main__":
    main()
