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

from groundwork.files import read_json, write_text
from learn.compare.tables import page

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "benchmarks" / "compare.md"
EXPERIMENT = ROOT / "benchmarks" / "compare.toml"


def main() -> None:
    """Compare, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bridges", nargs="+", type=Path)
    parser.add_argument("-o", "--output", required=True, type=Path)
    chosen = parser.parse_args()
    compare(chosen.bridges, chosen.output)
    write_text(PAGE, benchmark_page(read_json(chosen.output / "comparison.json")))


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


def benchmark_page(record: Mapping[str, Any]) -> str:
    """Put the tables of an experiment below a sentence that says where they come from.

    Args:
        record: What `falsework compare` wrote.

    Returns:
        Markdown.
    """
    heading, _, rest = page(record).partition("\n")
    about = (
        "`python -m benchmarks.compare BRIDGE... -o OUT` writes this page, from `benchmarks/compare.toml`. "
        "[How to read it](../comparisons.md). A forest on few bridges: the direction of a large difference is worth "
        "something, its size is not, and networks trained for longer may differ."
    )
    return f"{heading}\n\n{about}\n{rest}"


if __name__ == "__main__":
    main()
