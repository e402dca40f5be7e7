"""What labeling a whole scan takes, from file to file: `python -m benchmarks.learn.predict WORK`.

The scans are the thinned clouds of `falsework train --demo`, set side by side until there are enough, and for a dense
scan again and again with small errors. Each is labeled by the command, with the model of the package.
"""

import argparse
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import laspy
import numpy as np
from numpy.typing import NDArray

from benchmarks.page import write_page
from benchmarks.speed_unit import this_machine
from groundwork.files import read_json
from learn.demo.clouds import demo_clouds

F64 = NDArray[np.float64]

PAGE = Path(__file__).resolve().parents[2] / "docs" / "benchmarks" / "predict.md"
APART = 400.0  # [m] between the clouds
ERROR = 0.02  # [m] standard deviation of the points of a dense scan
MILLION = 1_000_000
SCANS = (  # places, points at each
    (2 * MILLION, 1),
    (2 * MILLION, 25),
)


@dataclass(frozen=True)
class Cost:
    """What labeling a scan took.

    Attributes:
        points: Points of the scan.
        size: Of the file [MB].
        wall: Waiting time [s].
        cpu: Processor time of all threads [s].
        memory: Peak memory [GB].
        instances: Boxes that it found.
    """

    points: int
    size: float
    wall: float
    cpu: float
    memory: float
    instances: int


def main() -> None:
    """Write the scans, label them, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("work", type=Path)
    work = parser.parse_args().work
    work.mkdir(parents=True, exist_ok=True)
    costs = []
    for places, each in SCANS:
        scan = work / f"{places * each // MILLION}m.las"
        write_scan(scan, places, each)
        costs.append(label(scan, work / f"{scan.stem}_labeled.las"))
        scan.unlink()
    write_page(PAGE, page(costs), __file__)


def write_scan(path: Path, places: int, each: int) -> None:
    """Write a LAS file.

    Args:
        path: The file.
        places: How many places have points.
        each: Points at each place.
    """
    coord = places_of(places)
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = np.full(3, 0.001), coord.min(axis=0)
    rng = np.random.default_rng(0)
    with laspy.open(path, mode="w", header=header) as writer:
        for number in range(each):
            moved = coord + (ERROR * rng.standard_normal(coord.shape) if number else 0.0)
            record = laspy.ScaleAwarePointRecord.zeros(len(moved), header=header)
            record["x"], record["y"], record["z"] = moved.T
            writer.write_points(record)


def places_of(count: int) -> F64:
    """Set the clouds side by side.

    Args:
        count: How many points.

    Returns:
        Positions [m], shape (count, 3), float64.
    """
    clouds = [cloud.coord for cloud in demo_clouds()]
    rows: list[F64] = []
    while sum(map(len, rows)) < count:
        number = len(rows)
        rows.append(clouds[number % len(clouds)] + np.array([number % 10, number // 10, 0.0]) * APART)
    return np.concatenate(rows)[:count]


def label(scan: Path, out: Path) -> Cost:
    """Run `falsework predict` on a scan.

    Args:
        scan: The file.
        out: The labeled copy; removed again.
    """
    command = [sys.executable, "-m", "falsework", "predict", str(scan), "-o", str(out), "--unit", "m"]
    begun = time.perf_counter()
    child = subprocess.Popen(command)
    _, status, used = os.wait4(child.pid, 0)
    wall = time.perf_counter() - begun
    if status:
        raise SystemExit(f"{scan}: predict ended with status {status}")
    record = out.with_suffix(".instances.json")
    instances = len(read_json(record)["instances"])
    with laspy.open(out) as reader:
        points = reader.header.point_count
    out.unlink()
    record.unlink()
    cpu, memory = used.ru_utime + used.ru_stime, used.ru_maxrss * 1024 / 1e9
    return Cost(points, scan.stat().st_size / 1e6, wall, cpu, memory, instances)


def page(costs: list[Cost]) -> str:
    """Write the table.

    Args:
        costs: Of `label`.
    """
    lines = [
        "# Labeling a whole scan",
        "",
        f"Written by `python -m benchmarks.learn.predict WORK`. {len(os.sched_getaffinity(0))} cores of "
        f"{this_machine()}. The whole command, with reading, thinning to 0.15 m, and writing. Goals: 2 million points "
        "in 5 minutes on 2 cores, 50 million in 4 GB.",
        "",
        "| points [million] | file [MB] | waiting [s] | processor [s] | peak memory [GB] | instances |",
        "|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {cost.points / MILLION:.0f} | {cost.size:.0f} | {cost.wall:.0f} | {cost.cpu:.0f} | {cost.memory:.2f} | "
        f"{cost.instances:,} |"
        for cost in costs
    ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
