"""What runs of many scenes cost beside the scenes, and what many cores would make of them.

Usage: python -m benchmarks.falsework.scale [--small] [--run OUT]

Writes `docs/benchmarks/scale.md`. Some twenty minutes, on a machine with nothing else to do; `--small` takes two, and
the page says so. `--run` names a finished run whose results tell the bytes of a scene; without it they are
the demo's, which `plan` starts from, too.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean

from benchmarks.page import write_page
from benchmarks.speed_unit import this_machine
from falsework.execution.costs import DEFAULT_BYTES, Costs
from falsework.execution.events import read_events
from groundwork.files import read_json, write_text

ROOT = Path(__file__).resolve().parents[2]
PROOF = ROOT / "docs" / "proof.json"
PAGE = ROOT / "docs" / "benchmarks" / "scale.md"
START = 3.0  # [s] of a run that are no overhead
MOST_OVERHEAD, LEAST_SPEEDUP = 0.02, 1.8  # [1]
CORES = (2, 64, 1000)
SETS = ("paper-local", "paper-global")
KINDS = ("stage", "capture", "cloud")
KEEPS = (
    ("stage", "capture", "model", "cloud", "report"),  # the default
    ("stage", "cloud"),
    ("capture", "cloud"),
    ("cloud",),
)
_MB, _HOUR = 1e6, 3600.0


@dataclass(frozen=True)
class Size:
    """How much is measured.

    Attributes:
        scenes: Scenes that wait.
        seconds: Time of each [s].
        busy_scenes: Scenes that compute.
        busy_seconds: Time of each [s].
        simulated: Scenes of the simulated run.
    """

    scenes: int
    seconds: float
    busy_scenes: int
    busy_seconds: float
    simulated: int


WHOLE = Size(20, 30.0, 8, 8.0, 10_000)
SMALL = Size(3, 1.0, 2, 1.0, 200)


@dataclass(frozen=True)
class Timed:
    """How long a run took.

    Attributes:
        wall: From the command to its end [s].
        span: From the beginning of the first result to the end of the last one [s].
        processor: Of the command and its workers, all threads together [s].
    """

    wall: float
    span: float
    processor: float


def main() -> None:
    """Measure, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--small", action="store_true")
    parser.add_argument("--run", type=Path, default=None)
    asked = parser.parse_args()
    size = SMALL if asked.small else WHOLE
    load = os.getloadavg()[0]
    one = fake_run(1, size.seconds, "wait", 0)
    waited = {workers: fake_run(size.scenes, size.seconds, "wait", workers) for workers in (0, 2)}
    each = (waited[0].processor - one.processor) / (size.scenes - 1)
    rate = work_rate()
    bare = {count: bare_span(size, rate, count) for count in (1, 2)}
    busy = {workers: fake_run(size.busy_scenes, size.busy_seconds, "work", workers, rate) for workers in (1, 2)}
    parts = {name: part(name, size.simulated) for name in ("plan", "schedule")}
    costs = _bytes_of(asked.run)
    lines = [
        *_head(load, asked.small),
        *_overhead(size, waited, each),
        *_speedup(size, busy, bare),
        *_simulated(size, parts),
        *_projected(each),
        *_disk(costs, asked.run),
    ]
    write_page(PAGE, "\n".join(lines) + "\n", __file__)


def fake_run(scenes: int, seconds: float, kind: str, workers: int, rate: float = 1.0) -> Timed:
    """Run scenes of fake stages.

    Args:
        scenes: How many.
        seconds: Time of each [s].
        kind: `wait` or `work`.
        workers: Worker processes; 0 for none beside the command.
        rate: Matrix products in a second.
    """
    alone = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    faked = {"FAKE_SECONDS": str(seconds), "FAKE_KIND": kind, "FAKE_RATE": str(rate)}
    with tempfile.TemporaryDirectory() as scratch:
        out, scenario = Path(scratch) / "out", Path(scratch) / "s.toml"
        write_text(scenario, f'scenes = {scenes}\n[[survey]]\nkind = "global"\n')
        words = ["run", str(scenario), "-o", str(out), "--workers", str(workers)]
        begin, before = time.perf_counter(), os.times()
        subprocess.run(
            [sys.executable, "-m", "benchmarks.falsework.fake_run", *words],
            cwd=ROOT,
            env={**os.environ, **alone, **faked},
            capture_output=True,
            check=True,
        )
        wall, after = time.perf_counter() - begin, os.times()
        events = list(read_events(out))
    span = max(one["end"] for one in events) - min(one["end"] - one["seconds"] for one in events)
    spent = after.children_user + after.children_system - before.children_user - before.children_system
    return Timed(wall, span, spent)


def part(name: str, number: int) -> dict[str, float]:
    """Measure one part in a process of its own.

    Args:
        name: Row of `benchmarks.falsework.scale_part`.
        number: Of scenes, or of matrix products.
    """
    return _told(_begin(name, number))


def work_rate(least: float = 0.5) -> float:
    """Measure how many matrix products a second of processor time holds here, NumPy on one thread.

    Args:
        least: Processor time to measure for [s].
    """
    rate = 200.0
    for _ in range(2):
        times = round(max(least * rate, 1.0))
        rate = times / part("work", times)["processor"]
    return rate


def bare_span(size: Size, rate: float, count: int) -> float:
    """Do the computing scenes' work in plain processes at once, without an engine; the longest one counts [s].

    Args:
        size: How much.
        rate: Matrix products in a second.
        count: How many processes share it.
    """
    times = round(size.busy_scenes * size.busy_seconds * rate / count)
    return max(_told(one)["seconds"] for one in [_begin("work", times) for _ in range(count)])


def _begin(name: str, number: int) -> subprocess.Popen[bytes]:
    alone = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-m", "benchmarks.falsework.scale_part", name, str(number)]
    return subprocess.Popen(command, cwd=ROOT, env=alone, stdout=subprocess.PIPE)


def _told(process: subprocess.Popen[bytes]) -> dict[str, float]:
    said, _ = process.communicate()
    if process.returncode:
        raise RuntimeError(f"a part ended with {process.returncode}")
    return json.loads(said.splitlines()[-1])


def _head(load: float, small: bool) -> list[str]:
    cores = len(os.sched_getaffinity(0))
    busy = "The machine was busy with other work: wall times are too long; only processor times are valid. "
    return [
        "# Many scenes",
        "",
        f"Written by `python -m benchmarks.falsework.scale{' --small' * small}`. {cores} cores of {this_machine()}; "
        f"load when it began {load:.1f}. {busy * (load > 1.0)}What is compared was measured in this one run.",
    ]


def _overhead(size: Size, waited: dict[int, Timed], each: float) -> list[str]:
    lines = [
        "",
        "## What the engine adds",
        "",
        f"{size.scenes} scenes of {size.seconds:g} s each, in which every stage waits and writes a few small files: "
        f"time beyond the simulated work is the overhead of the engine. Limit: {MOST_OVERHEAD:.0%} of the whole beyond "
        f"{START:g} s for the start.",
        "",
        "| workers | waiting [s] | whole [s] | more [s] | beyond the start | first to last [s] | processor [s] |",
        "|---|---|---|---|---|---|---|",
    ]
    for workers, one in waited.items():
        ideal = size.scenes * size.seconds / max(workers, 1)
        more = one.wall - ideal
        share = max(0.0, more - START) / one.wall
        name = "none: this process" if workers == 0 else str(workers)
        lines.append(
            f"| {name} | {ideal:.1f} | {one.wall:.1f} | {more:.1f} | {share:.1%} | {one.span:.1f} "
            f"| {one.processor:.1f} |"
        )
    return [*lines, "", f"A further scene costs the engine {1000 * each:.0f} ms of processor time."]


def _speedup(size: Size, busy: dict[int, Timed], bare: dict[int, float]) -> list[str]:
    engine = busy[1].span / busy[2].span
    return [
        "",
        "## Two workers against one",
        "",
        f"{size.busy_scenes} scenes that multiply matrices for {size.busy_seconds:g} s of processor time each, every "
        f"worker on one thread. Limit: {LEAST_SPEEDUP:g} times as fast. The last row is the same work in plain "
        "processes: what this machine's second core is worth.",
        "",
        "| | one [s] | two [s] | times as fast |",
        "|---|---|---|---|",
        f"| first result to last | {busy[1].span:.1f} | {busy[2].span:.1f} | **{engine:.2f}** |",
        f"| the whole command | {busy[1].wall:.1f} | {busy[2].wall:.1f} | {busy[1].wall / busy[2].wall:.2f} |",
        f"| plain processes | {bare[1]:.1f} | {bare[2]:.1f} | {bare[1] / bare[2]:.2f} |",
    ]


def _simulated(size: Size, parts: dict[str, dict[str, float]]) -> list[str]:
    names = {"plan": "`falsework plan`, nothing there yet", "schedule": "two Dask workers that do nothing with a scene"}
    rows = [
        f"| {names[name]} | {one['seconds']:.1f} | {one['processor']:.1f} "
        f"| {1000 * one['seconds'] / size.simulated:.2f} | {one['before']:.0f} | {one['memory']:.0f} |"
        for name, one in parts.items()
    ]
    return [
        "",
        f"## A simulated run of {size.simulated:,} scenes",
        "",
        "The scenes of `scenarios/paper-local.toml`; the command's process, which is the scheduler's, too.",
        "",
        "| what | seconds | processor [s] | a scene [ms] | memory before [MB] | at most [MB] |",
        "|---|---|---|---|---|---|",
        *rows,
    ]


def _projected(overhead: float) -> list[str]:
    rows = read_json(PROOF)["rows"]
    lines = [
        "",
        "## Projected",
        "",
        "From the rows of [proof.json](../proof.json): processor time of a scene from its seed to its annotated cloud. "
        "Assumed: each core does what one core did there, and the work of a scene stays on one; scenes need nothing of "
        f"each other; the engine adds {1000 * overhead:.0f} ms to each, as above; 4 GB of memory a core; and "
        "a shared disk that takes what is written (stage, photographs and cloud of the measured scenes, textures "
        "counted whole). Not measured on more than two cores.",
        "",
        "| data set | cores | scenes an hour | annotated points an hour [million] | written a scene [MB] | stays [MB] "
        "| written [MB/s] |",
        "|---|---|---|---|---|---|---|",
    ]
    for name in SETS:
        measured = [row for row in rows if row["name"].startswith(f"{name}: ") and "cloud_mb" in row["figures"]]
        if not measured:
            lines.append(f"| {name} | no scene of the code of today has been measured | | | | | |")
            continue
        seconds = fmean(row["figures"]["cpu_s"] for row in measured) + overhead
        points = fmean(row["count"] for row in measured)
        stage, capture, cloud = (fmean(row["figures"][f"{kind}_mb"] for row in measured) for kind in KINDS)
        for cores in CORES:
            scenes = cores * _HOUR / seconds
            lines.append(
                f"| {name} | {cores:,} | {scenes:,.0f} | {scenes * points / 1e6:,.1f} | {stage + capture + cloud:,.0f} "
                f"| {stage + cloud:,.0f} | {scenes * (stage + capture + cloud) / _HOUR:.1f} |"
            )
    return lines


def _disk(costs: dict[str, float], run: Path | None) -> list[str]:
    source = "the demo's scene" if run is None else "the scenes of a finished run"
    lines = [
        "",
        "## Bytes on disk",
        "",
        f"Of {source}, a stage's textures counted whole; those that scenes have in common are one file in a run.",
        "",
        "| `keep` | a scene [MB] | 10,000 scenes [TB] |",
        "|---|---|---|",
    ]
    for keep in KEEPS:
        each = sum(costs[stage] for stage in keep)
        spelled = ", ".join(f'"{stage}"' for stage in keep)
        lines.append(f"| `[{spelled}]` | {each / _MB:.0f} | {each * 10_000 / 1e12:.2f} |")
    return lines


def _bytes_of(run: Path | None) -> dict[str, float]:
    if run is None:
        return DEFAULT_BYTES
    costs = Costs(run)
    return {stage: costs.bytes_each(stage) for stage in DEFAULT_BYTES}


if __name__ == "__main__":
    main()
