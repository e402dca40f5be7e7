"""Which model comes with the package: candidates on whole scans of the bridges that nothing was trained on.

What counts is mean IoU, and how much of the surroundings, far from the bridge, is called a part of one.

Usage: python -m benchmarks.shipped.selection NAME=MODEL... --clouds CLOUD... [--reach METERS] [--work FOLDER]

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

from benchmarks.page import write_page
from benchmarks.shipped.model import STRIDE
from benchmarks.shipped.robustness import near_bridge
from benchmarks.shipped.scan_scores import TABLES, Scan, label_scan, mean_iou_of_seen, read_labeled_scan
from groundwork.canonical import digest, file_digest
from groundwork.files import read_json, write_json
from learn.predict.trained_model import TrainedModel, read_trained_model
from learn.scoring.table import table
from learn.trained import WEIGHTS, read_facts
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


@dataclass(frozen=True)
class Found:
    """What a candidate did on one cloud.

    Attributes:
        kind: Kind of its sensor.
        matrices: For each table the confusion, shape (C, C), int64.
        apart: The thinned points far from the bridge: those called a part of one, and all.
        points: Points of the scan.
        seconds: Processor time [s].
    """

    kind: str
    matrices: Mapping[str, I64]
    apart: tuple[int, int]
    points: int
    seconds: float


def judge_cloud(model: TrainedModel, path: Path, reach: float) -> Found:
    """Label a cloud with a candidate.

    Args:
        model: The candidate.
        path: Folder of the cloud.
        reach: How far beyond its bridge it is labeled [m].
    """
    scan = within(read_labeled_scan(path), reach)
    before = time.process_time()
    found = label_scan(scan, model)
    seconds = time.process_time() - before
    far = ~near_bridge(scan, APART)(found.place) & (found.truth["falsework"] == 0)
    false = int((found.found["falsework"][far] != 0).sum())
    matrices = {name: found.matrix(name) for name in TABLES}
    return Found(read_cloud(path).source, matrices, (false, int(far.sum())), len(scan.coord), seconds)


def judge_kept(work: Path | None, folder: Path, path: Path, reach: float) -> Found:
    """Label a cloud with a candidate, or read what was found before.

    Args:
        work: Folder that keeps what is found; None for none.
        folder: The candidate.
        path: Folder of the cloud.
        reach: How far beyond its bridge it is labeled [m].
    """
    if work is None:
        return judge_cloud(overlapping(folder), path, reach)
    asked = [file_digest(folder / WEIGHTS), file_digest(path / "cloud.json"), str(path), str(reach)]
    kept = work / f"{digest(asked)[:16]}.json"
    if not kept.is_file():
        found = judge_cloud(overlapping(folder), path, reach)
        work.mkdir(parents=True, exist_ok=True)
        matrices = {name: matrix.tolist() for name, matrix in found.matrices.items()}
        write_json(kept, {**vars(found), "matrices": matrices})
    read = read_json(kept)
    matrices = {name: np.array(matrix, np.int64) for name, matrix in read["matrices"].items()}
    return Found(**{**read, "matrices": matrices, "apart": tuple(read["apart"])})


def joined(network: str, size: float, found: Sequence[Found]) -> Row:
    """Sum what a candidate did.

    Args:
        network: What it is.
        size: Of its weights [MB].
        found: For each cloud.
    """
    matrices: dict[str, dict[str, I64]] = {}
    apart: dict[str, tuple[int, int]] = {}
    for one in found:
        own = matrices.setdefault(one.kind, {})
        for name in TABLES:
            own[name] = own.get(name, np.int64(0)) + one.matrices[name]
        false, count = apart.get(one.kind, (0, 0))
        apart[one.kind] = (false + one.apart[0], count + one.apart[1])
    seconds = sum(one.seconds for one in found) * 2e6 / sum(one.points for one in found)
    return Row(network, size, matrices, seconds, apart)


def page(rows: Mapping[str, Row], clouds: int, reach: float = np.inf) -> str:
    """Write the page.

    Args:
        rows: Candidates by name.
        clouds: How many scans they were judged on.
        reach: How far beyond a bridge they were labeled [m].
    """
    whole, around = ("whole ", "") if np.isinf(reach) else ("", f"up to {reach:g} m round each, ")
    kinds = sorted({kind for row in rows.values() for kind in row.matrices})
    lines = [
        "# Which model comes with the package",
        "",
        f"Written by `python -m benchmarks.shipped.selection`. Mean IoU of the thinned points of {clouds}",
        f"{whole}scans of bridges that training held back, {around}labeled as `falsework predict` does, over the",
        "classes that they have. *All* sums the scans first. The time is that of a processor's core for two",
        "million points, without reading and writing.",
    ]
    for name in TABLES:
        cells = []
        for title, row in rows.items():
            total = np.sum([found[name] for found in row.matrices.values()], axis=0)
            parts = [mean_iou_of_seen(row.matrices[kind][name]) if kind in row.matrices else np.nan for kind in kinds]
            values = [*parts, mean_iou_of_seen(total)]
            said = ["-" if np.isnan(value) else f"{value:.3f}" for value in values]
            cells.append([title, row.network, f"{row.size:.1f}", *said, f"{row.seconds:.0f}"])
        lines += ["", f"Table `{name}`:", ""]
        lines += table(["candidate", "network", "MB", *kinds, "all", "CPU-s for 2 M points"], cells)
    lines += ["", "## Where there is no bridge", ""]
    lines += [
        f"Share of the points of the surroundings that are called a part of a bridge, more than {APART:g} m from its",
        "box: tiles there hold no point of a bridge. Goal: at most 2 %.",
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
    parser.add_argument("--reach", type=float, default=np.inf, help="how far round a bridge scans are labeled [m]")
    parser.add_argument("--page", type=Path, default=PAGE)
    parser.add_argument("--work", type=Path, help="keeps what was found: a second call goes on")
    given = parser.parse_args()
    torch.set_num_threads(1)
    rows = {}
    for word in given.models:
        name, _, folder = word.partition("=")
        found = [judge_kept(given.work, Path(folder), cloud, given.reach) for cloud in given.clouds]
        network, size = read_facts(Path(folder)).network, (Path(folder) / WEIGHTS).stat().st_size / 1e6
        rows[name] = joined(network, size, found)
    write_page(given.page, page(rows, len(given.clouds), given.reach), __file__)


if __name__ == "__main__":
    main()
