"""How large the pages of reports are, and how long a browser takes to open each kind.

Usage: python -m benchmarks.falsework.reports KIND=PATH[,PATH] …

KIND is one of `scene`, `run`, `dataset`, `training`, `comparison` (what `falsework report` takes), `view` (a scene,
for `falsework view --save`) and `flights` (a stage, for `falsework survey score -o`); `training` takes a model and its
scores. Each page is written anew and opened some times in a headless Chromium with WebGL in software, its cache empty.
Time counts from the start of the navigation to the second picture after the page has loaded: figures and the first
view in space are drawn by then. Writes `docs/benchmarks/reports.md`; without any KIND it says there that nothing has
been measured. Needs the extra view and a Chromium.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

from benchmarks.page import write_page
from groundwork.errors import InputError

if TYPE_CHECKING:
    from tests.falsework.live_browser import Tab

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "benchmarks" / "reports.md"
ROUNDS = 5  # a browser of its own for each
MOST_MEGABYTES, MOST_SECONDS = 10.0, 3.0  # what is promised of a page
VERBS: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(("scene", "run", "dataset", "training", "comparison"), ("report", "-o")),
    "view": ("view", "--save"),
    "flights": ("survey score", "-o"),
}
_READY = """
addEventListener("load", () => requestAnimationFrame(() => requestAnimationFrame(() => {
  window.opened = performance.now();
})));
"""


@dataclass(frozen=True)
class Opened:
    """What a kind of page costs.

    Attributes:
        kind: A key of `VERBS`.
        size: Size of its file [bytes].
        seconds: Time of each opening [s].
    """

    kind: str
    size: int
    seconds: tuple[float, ...]


def main(words: Sequence[str]) -> None:
    """Write each page, open it some times, and write the table.

    Args:
        words: `KIND=PATH[,PATH]` each.
    """
    from benchmarks.speed_unit import this_machine

    with tempfile.TemporaryDirectory() as scratch:
        rows = [measure(kind, places, Path(scratch)) for kind, places in asked(words)]
    machine = f"One of {len(os.sched_getaffinity(0))} cores of {this_machine()}" if rows else ""
    write_page(PAGE, "\n".join(page_lines(rows, machine)) + "\n", __file__)


def asked(words: Sequence[str]) -> list[tuple[str, list[Path]]]:
    """Take the words of the command line apart.

    Args:
        words: `KIND=PATH[,PATH]` each.

    Raises:
        InputError: No such kind, or no path.
    """
    found: list[tuple[str, list[Path]]] = []
    for word in words:
        kind, _, places = word.partition("=")
        if kind not in VERBS or not places:
            raise InputError("not KIND=PATH", value=word, allowed=", ".join(VERBS))
        found.append((kind, [Path(place) for place in places.split(",")]))
    return found


def measure(kind: str, places: Sequence[Path], folder: Path) -> Opened:
    """Write a page and open it some times.

    Args:
        kind: A key of `VERBS`.
        places: What it is of.
        folder: Folder for the page and the browsers' profiles.
    """
    page = folder / f"{kind}.html"
    verb, option = VERBS[kind]
    command = [sys.executable, "-m", "falsework", *verb.split(), *map(str, places), option, str(page)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    times = [open_once(page, folder / f"profile-{kind}-{number}") for number in range(ROUNDS)]
    return Opened(kind, page.stat().st_size, tuple(times))


def open_once(page: Path, profile: Path) -> float:
    """Open a page in a new browser, and measure how long it took [s].

    Args:
        page: HTML file.
        profile: Folder for the browser's profile; its cache is empty.
    """
    from tests.falsework.live_browser import open_tab

    with open_tab("about:blank", profile) as tab:
        return _navigated(tab, page)


def _navigated(tab: "Tab", page: Path) -> float:
    tab.tell("Page.addScriptToEvaluateOnNewDocument", source=_READY)
    tab.tell("Page.navigate", url=page.absolute().as_uri())
    tab.wait_for("window.opened > 0")
    return float(tab.ask("window.opened")) / 1000.0


def page_lines(rows: Sequence[Opened], machine: str) -> list[str]:
    """Write the page.

    Args:
        rows: What was measured.
        machine: What it ran on.
    """
    lines = [
        "# Opening the pages of reports",
        "",
        "Written by `python -m benchmarks.falsework.reports KIND=PATH …`: size of each kind of page, and the time",
        "from the start of the navigation to the second picture after it has loaded, in a headless Chromium with",
        "WebGL in software and an empty cache.",
        f"Limits: less than {MOST_MEGABYTES:.0f} MB and {MOST_SECONDS:.0f} s.",
        "",
    ]
    if not rows:
        return [*lines, "Not measured yet: measure on an idle machine."]
    lines += [
        f"{machine}; {len(rows[0].seconds)} openings each.",
        "",
        "| page | size [MB] | to open, median [s] | least | most | within limits |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        kept = row.size < MOST_MEGABYTES * 1e6 and median(row.seconds) < MOST_SECONDS
        lines.append(
            f"| {row.kind} | {row.size / 1e6:.1f} | {median(row.seconds):.2f} | {min(row.seconds):.2f} | "
            f"{max(row.seconds):.2f} | {'yes' if kept else 'no'} |"
        )
    return lines


if __name__ == "__main__":
    main(sys.argv[1:])
