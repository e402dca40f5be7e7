"""Which model comes with the package: candidates on whole scans of the bridges that nothing was trained on.

What counts is mean IoU, and how much of the surroundings, far from the bridge, is called a part of one.

Usage: python -m benchmarks.shipped.selection NAME=MODEL... --clouds CLOUD... [--reach METERS] [--page FILE]

MODEL is a folder of a training, CLOUD the folder of a cloud. `python -m benchmarks.shipped.model … --candidate NAME`
makes candidates of one data set. Writes `docs/benchmarks/selection.md`.
"""

import argparse
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from benchmarks.shipped.model import STRIDE
from benchmarks.shipped.robustness import near_bridge
from benchmarks.shipped.scan_scores import TABLES, Scan, label_scan, read_labelled_scan
from groundwork.files import write_text
from learn.metrics import scores
from learn.predict.trained_model import TrainedModel, read_trained_model
from learn.scoring.table import table
from learn.trained import WEIGHTS
from recon.cloud import read_cloud

I64 = NDArray[np.int64]

APART = 30.0  # [m] from the box of a bridge: more than the diagonal of a tile
PAGE = Path(__file__).resolve().parents[2] / "docs" / "benchmarks" / "selection.md"


@dataclass(frozen=True)
class Row:
    """What a candidate did.

    Attributes:
        network: What it is.
        size: Of its weights [MB].
        matrices: For each kind of sensor and each table the confusion, summed over the scans, shape (C, C), int64.
        seconds: Processor time for two million points [s].
        apart: For each kind of sensor the thinned points far from the bridge: those called a part of one, and all.
    """

    network: str
    size: float
    matrices: Mapping[str, Mapping[str, I64]]
    seconds: float
    apart: Mapping[str, tuple[int, int]]


def overlapping(folder: Path) -> TrainedModel:
    """Read a candidate as it would be shipped: with tiles that overlap.

    Args:
        folder: What a training has written.
    """
    read = read_trained_model(folder)
    tile = read.tile.model_copy(update={"stride": STRIDE})
    return TrainedModel(read.trained, read.settings.model_copy(update={"tile": tile}))


def within(scan: Scan, reach: float) -> Scan:
    """Keep what is near the bridge of a scan.

    Args:
        scan: The scan.
        reach: How far beyond the box of its bridge [m].
    """
    return scan.take(near_bridge(scan, reach)(scan.place)) if np.isfinite(reach) else scan


def judge(model: TrainedModel, size: float, clouds: Sequence[Path], reach: float = np.inf) -> Row:
    """Label every cloud with a candidate.

    Args:
        model: The candidate.
        size: Of its weights [MB].
        clouds: Folders of clouds.
        reach: How far beyond a bridge they are labelled [m].
    """
    matrices: dict[str, dict[str, I64]] = {}
    apart: dict[str, tuple[int, int]] = {}
    points, seconds = 0, 0.0
    for path in clouds:
        scan = within(read_labelled_scan(path), reach)
        before = time.process_time()
        found = label_scan(scan, model)
        points, seconds = points + len(scan.coord), seconds + time.process_time() - before
        kind = read_cloud(path).source
        own = matrices.setdefault(kind, {})
        for name in TABLES:
            own[name] = own.get(name, np.int64(0)) + found.matrix(name)
        far = ~near_bridge(scan, APART)(found.place) & (found.truth["falsework"] == 0)
        false, count = apart.get(kind, (0, 0))
        apart[kind] = (false + int((found.found["falsework"][far] != 0).sum()), count + int(far.sum()))
    return Row(model.trained.facts.network, size, matrices, seconds * 2e6 / points, apart)


def page(rows: Mapping[str, Row], clouds: int, reach: float = np.inf) -> str:
    """Write the page.

    Args:
        rows: Candidates by name.
        clouds: How many scans they were judged on.
        reach: How far beyond a bridge they were labelled [m].
    """
    whole, around = ("whole ", "") if np.isinf(reach) else ("", f"up to {reach:g} m round each, ")
    kinds = sorted({kind for row in rows.values() for kind in row.matrices})
    lines = [
        "# Which model comes with the package",
        "",
        f"Written by `python -m benchmarks.shipped.selection`. Mean IoU of the thinned points of {clouds}",
        f"{whole}scans of bridges that training held back, {around}labelled as `falsework predict` does; classes that",
        "do not occur have no part in it. *All* sums the scans first. The time is that of a processor's core for two",
        "million points, without reading and writing.",
    ]
    for name in TABLES:
        cells = []
        for title, row in rows.items():
            total = np.sum([found[name] for found in row.matrices.values()], axis=0)
            parts = [scores(row.matrices[kind][name]).mean_iou if kind in row.matrices else np.nan for kind in kinds]
            values = [*parts, scores(total).mean_iou]
            said = ["-" if np.isnan(value) else f"{value:.3f}" for value in values]
            cells.append([title, row.network, f"{row.size:.1f}", *said, f"{row.seconds:.0f}"])
        lines += ["", f"Table `{name}`:", ""]
        lines += table(["candidate", "network", "MB", *kinds, "all", "CPU-s for 2 M points"], cells)
    lines += ["", "## Where there is no bridge", ""]
    lines += [
        f"Share of the points of the surroundings that are called a part of a bridge, more than {APART:g} m from its",
        "box: tiles there hold no point of a bridge. The wish is at most 2 %.",
        "",
    ]
    cells = [
        [title, *(_false(row.apart, (kind,)) for kind in kinds), _false(row.apart, kinds)]
        for title, row in rows.items()
    ]
    lines += table(["candidate", *kinds, "all"], cells)
    return "\n".join(lines) + "\n"


def _false(apart: Mapping[str, tuple[int, int]], kinds: Sequence[str]) -> str:
    false, count = (sum(apart.get(kind, (0, 0))[i] for kind in kinds) for i in (0, 1))
    return f"{false / count:.1%}" if count else "-"


def main() -> None:
    """Judge and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("models", nargs="+", metavar="NAME=MODEL")
    parser.add_argument("--clouds", nargs="+", type=Path, required=True)
    parser.add_argument("--reach", type=float, default=np.inf, help="how far round a bridge scans are labelled [m]")
    parser.add_argument("--page", type=Path, default=PAGE)
    given = parser.parse_args()
    torch.set_num_threads(1)
    rows = {}
    for word in given.models:
        name, _, folder = word.partition("=")
        rows[name] = judge(
            overlapping(Path(folder)), (Path(folder) / WEIGHTS).stat().st_size / 1e6, given.clouds, given.reach
        )
    write_text(given.page, page(rows, len(given.clouds), given.reach))


if __name__ == "__main__":
    main()
