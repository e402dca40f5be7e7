"""How soon a run ends when it is told to, whatever it is doing, and that the next one finishes the same bytes.

Usage: python -m benchmarks.falsework.stops [--seed NUMBER]

A small scenario of one scene is run, with and without workers, and stopped again and again after a random time: by
one SIGINT, or by two. The same command goes on each time until the run is done; then every file outside `run/` is
compared with those of a run that nobody stopped. Writes `docs/benchmarks/stops.md`; some ten minutes, on a machine with
nothing else to do.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import tomli_w

from benchmarks.page import write_page
from benchmarks.speed_unit import this_machine
from groundwork.canonical import file_digest
from groundwork.files import write_text

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "benchmarks" / "stops.md"
SCENARIO: dict[str, Any] = {
    "seed": 5,
    "bridge": {"family": "beam", "service": "road", "beam": {"spans": [12.0]}},
    "background": {"name": "none"},
    "look": {"texels": 512},
    "light": {"sky_height": 64},
    "site": {"half_width": 40, "run_out": 40},
    "survey": [{"kind": "global", "images": 16, "spacing": 6.0, "width": 480, "height": 360}],
    "recon": {"mode": "both", "quality": "medium"},
}
ONCE, TWICE = 10.0, 1.0  # [s] within which all processes have to be gone
BETWEEN = 0.3  # [s] from the first signal to the second
LEAST, MOST = 1.0, 20.0  # [s] after which a run is stopped; the longest step that starts anew must fit
STOPPED = (130, -signal.SIGINT)  # exit codes: a shell says 130 of both; the second if it was about to end anyway
_POLL = 0.02  # [s]
_HERE = "falsework"  # what works where there is no child


@dataclass(frozen=True)
class Stop:
    """A run that was stopped.

    Attributes:
        workers: Its worker processes; 0 for none beside the command.
        signals: How many it was sent.
        doing: Modules of its child processes when the first one came.
        code: Its exit code.
        seconds: From the last signal until all of its processes were gone [s].
    """

    workers: int
    signals: int
    doing: tuple[str, ...]
    code: int
    seconds: float


def main() -> None:
    """Stop runs, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    rng = random.Random(parser.parse_args().seed)
    load = os.getloadavg()[0]
    stops: list[Stop] = []
    with tempfile.TemporaryDirectory() as scratch:
        scenario = Path(scratch) / "s.toml"
        write_text(scenario, tomli_w.dumps(SCENARIO))
        calm = Path(scratch) / "calm"
        _begin(scenario, calm, 0).wait()
        equal = []
        for workers in (0, 1):
            out = Path(scratch) / f"stopped-{workers}"
            stops += stopped_until_done(scenario, out, workers, rng)
            equal.append(tree(out) == tree(calm))
    write_page(PAGE, stops_page(stops, all(equal), load), __file__)


def stopped_until_done(scenario: Path, out: Path, workers: int, rng: random.Random) -> list[Stop]:
    """Run a scenario to its end, stopped on the way as often as it takes.

    Args:
        scenario: Its file.
        out: Output folder.
        workers: Worker processes; 0 for none beside the command.
        rng: Draws when each run is stopped, and by how many signals.
    """
    stops: list[Stop] = []
    while True:
        process = _begin(scenario, out, workers)
        until = time.monotonic() + rng.uniform(LEAST, MOST)
        while process.poll() is None and time.monotonic() < until:
            time.sleep(_POLL)
        if process.poll() is not None:
            if process.returncode:
                raise RuntimeError(f"a run ended with {process.returncode}")
            return stops
        stops.append(_stop(process, workers, rng.choice((1, 2))))


def _begin(scenario: Path, out: Path, workers: int) -> subprocess.Popen[bytes]:
    words = ["run", str(scenario), "-o", str(out), "--workers", str(workers)]
    return subprocess.Popen(
        [sys.executable, "-m", "falsework", *words],
        cwd=ROOT,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def _stop(process: subprocess.Popen[bytes], workers: int, signals: int) -> Stop:
    """Send the signals, and wait until no process of the session is left."""
    doing = tuple(sorted({module for _, module in _alive(process.pid)} - {_HERE}))
    process.send_signal(signal.SIGINT)
    begin = time.monotonic()
    if signals == 2:
        time.sleep(BETWEEN)
        process.send_signal(signal.SIGINT)
        begin = time.monotonic()
    while process.poll() is None or _alive(process.pid):
        time.sleep(_POLL)
    return Stop(workers, signals, doing, process.returncode, time.monotonic() - begin)


def _alive(session: int) -> list[tuple[int, str]]:
    """List the processes of a session that have not ended, with the modules that they run."""
    found = []
    for folder in Path("/proc").iterdir():
        if not folder.name.isdigit():
            continue
        try:
            fields = (folder / "stat").read_text(encoding="utf-8").rpartition(")")[2].split()
            words = (folder / "cmdline").read_text(encoding="utf-8").split("\0")
        except OSError:  # it has just ended
            continue
        if int(fields[3]) == session and fields[0] != "Z":
            module = words[words.index("-m") + 1] if "-m" in words[:-1] else _HERE
            found.append((int(folder.name), module))
    return found


def tree(out: Path) -> dict[str, str]:
    """Give the hash of every file of a run but those about its own times.

    Args:
        out: Output folder.
    """
    files = sorted(path for path in out.rglob("*") if path.is_file())
    return {
        path.relative_to(out).as_posix(): file_digest(path) for path in files if path.relative_to(out).parts[0] != "run"
    }


def stops_page(stops: Sequence[Stop], equal: bool, load: float) -> str:
    """Write the page.

    Args:
        stops: Every stop.
        equal: Whether the finished files are those of a run that nobody stopped.
        load: Load of the machine when it began [1].
    """
    cores = len(os.sched_getaffinity(0))
    lines = [
        "# How soon a run stops",
        "",
        f"Written by `python -m benchmarks.falsework.stops`. {cores} cores of {this_machine()}; load when it began "
        f"{load:.1f}. One scene, with and without a worker, stopped {len(stops)} times at random moments by SIGINT and",
        "run on by the same",
        f"command. Limits: no process is left {ONCE:g} s after one signal, nor {TWICE:g} s after a second one that",
        f"follows {BETWEEN:g} s later; exit code {STOPPED[0]}, as a shell says it.",
        "",
        "| workers | what its children ran | stops | seconds, median | longest | stopped twice | longest |",
        "|---|---|---|---|---|---|---|",
    ]
    for workers, doing in sorted({(stop.workers, stop.doing) for stop in stops}):
        mine = [stop for stop in stops if (stop.workers, stop.doing) == (workers, doing)]
        cells = [str(workers or "none"), ", ".join(f"`{module}`" for module in doing) or "nothing: no child"]
        for count in (1, 2):
            times = [stop.seconds for stop in mine if stop.signals == count]
            cells += [str(len(times)), *([f"{median(times):.1f}"] if count == 1 and times else [""] * (count == 1))]
            cells += [f"{max(times):.1f}" if times else ""]
        lines.append(f"| {' | '.join(cells)} |")
    late = [stop for stop in stops if stop.seconds > (ONCE if stop.signals == 1 else TWICE)]
    odd = [stop for stop in stops if stop.code not in STOPPED]
    return "\n".join(
        [
            *lines,
            "",
            "| limit | measured | |",
            "|---|---|---|",
            f"| stops that took longer | {len(late)} of {len(stops)} | {_held(not late)} |",
            f"| other exit codes | {len(odd)} of {len(stops)} | {_held(not odd)} |",
            f"| files as without a stop | {'all' if equal else 'not all'} | {_held(equal)} |",
        ]
    )


def _held(good: bool) -> str:
    return "held" if good else "**missed**"


if __name__ == "__main__":
    main()
