"""Time the demo stage by stage, and write `docs/benchmarks/chain.md`.

Usage: python -m benchmarks.falsework.chain
"""

import os
import resource
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.page import write_page
from benchmarks.speed_unit import slower, this_machine
from falsework.execution.events import read_events
from falsework.pipeline import Outcome, run_scenario
from falsework.platform import render_platform
from falsework.scenario import demo_scenario
from groundwork.progress import SILENT
from recon.cloud import read_cloud

PAGE = Path(__file__).resolve().parents[2] / "docs" / "benchmarks" / "chain.md"
_LIMIT = 240.0  # [s] on the reference machine


def main() -> None:
    """Run the demo twice into a fresh folder, the second time to see that nothing is made again."""
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch) / "demo"
        begin = time.perf_counter()
        outcome = run_scenario(demo_scenario(), out, SILENT)
        first = time.perf_counter() - begin
        begin = time.perf_counter()
        again = run_scenario(demo_scenario(), out, SILENT)
        second = time.perf_counter() - begin
        size = sum(path.stat().st_size for path in out.rglob("*") if path.is_file() and not path.is_symlink())
        PAGE.parent.mkdir(parents=True, exist_ok=True)
        write_page(PAGE, _page(out, outcome, again, (first, second), size), __file__)


def _page(out: Path, outcome: Outcome, again: Outcome, walls: tuple[float, float], size: int) -> str:
    events = sorted(read_events(out), key=lambda event: event["end"])
    cloud = read_cloud(outcome.clouds[0])
    statistics: dict[str, Any] = dict(cloud.statistics)
    peak = max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)) / 1e6
    cores = len(os.sched_getaffinity(0))
    limit = _LIMIT * slower("numpy")
    lines = [
        "# The demo, stage by stage",
        "",
        f"The demo takes {walls[0]:.0f} s here; its limit of {_LIMIT:.0f} s on the reference machine is {limit:.0f} s "
        "here.",
        "",
        f"Written by `make bench`. {cores} cores of {this_machine()}, {render_platform()['gl_renderer']}.",
        "",
        "| stage | wall [s] |",
        "|---|---|",
        *(f"| {event['stage']} | {event['seconds']:.1f} |" for event in events if event["made"]),
        f"| all | {walls[0]:.1f} |",
        f"| again, with {again.made} results made | {walls[1]:.1f} |",
        "",
        "| figure | value |",
        "|---|---|",
        f"| greatest resident memory of one process [GB] | {peak:.2f} |",
        f"| output on disk [MB] | {size / 1e6:.0f} |",
        f"| images | {len(cloud.cameras)} |",
        f"| cameras registered and within limits | {np.mean([row['status'] == 'ok' for row in cloud.cameras]):.1%} |",
        f"| median camera center error [mm] | {1000 * statistics['center_error_median']:.1f} |",
        f"| points | {len(cloud):,} |",
        f"| points within 0.1 m of the true surface | {statistics['within_0.1m_share']:.1%} |",
        f"| of these, with the class of that surface | {statistics['right_class_share']:.2%} |",
        "",
        "What became of the pixels of the depth maps, by the class that the photograph shows there: part of a point,",
        "no depth, too few photographs that agree; the rest is seen through by others, or at too small an angle.",
        "",
        "| class | points | pixels | in points | no depth | too few agree |",
        "|---|---|---|---|---|---|",
        *(_fates(name, count, statistics["pixels"].get(name, {})) for name, count in _ordered(statistics["classes"])),
        "",
    ]
    return "\n".join(lines)


def _ordered(classes: dict[str, Any]) -> list[tuple[str, int]]:
    """Give each class and its number of points, the largest number first."""
    return sorted(((name, row["kept"]) for name, row in classes.items()), key=lambda row: -row[1])


def _fates(name: str, count: int, fates: dict[str, int]) -> str:
    """Write the row of a class."""
    pixels = sum(fates.values())
    shares = (f"{fates.get(fate, 0) / max(pixels, 1):.0%}" for fate in ("in_points", "no_depth", "views"))
    return f"| {name} | {count:,} | {pixels:,} | {' | '.join(shares)} |"


if __name__ == "__main__":
    main()
