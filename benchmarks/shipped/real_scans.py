"""Label real scans without point labels, and count the points whose predicted class is possible there.

Usage: python -m benchmarks.shipped.real_scans FOLDER [--model FOLDER]

FOLDER holds checkouts of the public repositories that `SCANS` names; none of their files is committed. Writes
`docs/benchmarks/real_scans.md` and `docs/images/real_scans.png`.
"""

import argparse
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

from benchmarks.page import write_page
from benchmarks.shipped.scan_scores import Labeled, label_scan
from benchmarks.shipped.scan_scores import Scan as LabeledScan
from docs.sampling_picture import GAP, PANEL, draw
from groundwork.files import write_bytes
from learn.datasets.class_tables import class_table
from learn.predict.model import PointModel, named_model
from learn.predict.settings import PredictSettings
from recon.formats.scan import read_scan

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]

DOCS = Path(__file__).resolve().parents[2] / "docs"
TABLE = "falsework"
CIVIL_STRUCTURE = 26  # class of the Dutch height model (AHN): bridges, viaducts, locks
ABOVE = ("deck", "girder", "beam", "slab", "parapet", "track", "sleeper")
BELOW = ("column", "pier_cap", "abutment", "bearing", "arch")
EYE = np.array([-0.5, -0.8, 0.35])  # from the middle, in lengths of the scan


@dataclass(frozen=True)
class RealScan:
    """A real scan, and what is known of it.

    Attributes:
        title: Name in the table.
        source: Repository and path.
        path: Below the folder of the checkouts.
        plausible: Classes that a point of the bridge can have.
        code: The scan's own number of the points on a bridge; None where all of it is one.
    """

    title: str
    source: str
    path: str
    plausible: tuple[str, ...]
    code: int | None = None


SCANS = (
    RealScan(
        "pier 1",
        "TaoYang-code/SKG-BridgePointCloud-Classification",
        "data/mydataset/pier/Area_1_bridge3_Lu_Pier_1.txt",
        BELOW,
    ),
    RealScan(
        "pier 2",
        "TaoYang-code/SKG-BridgePointCloud-Classification",
        "data/mydataset/pier/Area_1_bridge3_Lu_Pier_2.txt",
        BELOW,
    ),
    RealScan(
        "deck with its supports",
        "UT-Team-Chun/Pointcloud-bridge",
        "Partsize-identical/output-deck-test.las",
        ABOVE + BELOW,
    ),
    RealScan(
        "airborne tile 1",
        "tudelft3d/3dfier",
        "example_data/ahn3/ahn3_cropped_1.laz",
        ABOVE + BELOW,
        CIVIL_STRUCTURE,
    ),
    RealScan(
        "airborne tile 2",
        "tudelft3d/3dfier",
        "example_data/ahn3/ahn3_cropped_2.laz",
        ABOVE + BELOW,
        CIVIL_STRUCTURE,
    ),
)


@dataclass(frozen=True)
class Figures:
    """A model's predictions for a real scan.

    Attributes:
        points: Points after thinning.
        on_bridge: How many of them are known to be on a bridge.
        plausible: Share of these with a class that they can have [1].
        any_part: Share of these with any class of a bridge [1].
        false: Share of the others that are called a part of a bridge; NaN where there is no other [1].
        most: The classes that the bridge's points were given most, with their shares [1].
    """

    points: int
    on_bridge: int
    plausible: float
    any_part: float
    false: float
    most: Mapping[str, float]


def label_real_scan(path: Path, code: int | None, model: PointModel) -> Labeled:
    """Label a scan; what its owner knows stands in the place of the truth: 1 on a bridge, 0 elsewhere.

    Args:
        path: The scan, in meters with z up.
        code: The scan's own number of the points on a bridge; None where all of it is one.
        model: What knows the classes.
    """
    scan = read_scan(path)
    mine = np.ones(len(scan.coord), np.uint8)
    if code is not None:
        if scan.classification is None:
            raise ValueError(f"{path} carries no classes")
        mine = (scan.classification == code).astype(np.uint8)
    labels = {"falsework": mine, "kim2023": mine}
    return label_scan(LabeledScan(scan.coord, scan.coord, labels, PredictSettings(unit="m")), model)


def figures_of(found: Labeled, plausible: tuple[str, ...]) -> Figures:
    """Count.

    Args:
        found: What `label_real_scan` gives.
        plausible: Classes that a point of the bridge can have.
    """
    names = class_table(TABLE).names
    mine = found.truth[TABLE] == 1
    said = found.found[TABLE]
    rows = [names.index(name) for name in plausible]
    shares = np.bincount(said[mine], minlength=len(names)) / max(1, mine.sum())
    order = [int(i) for i in np.argsort(-shares, kind="stable")[:3] if shares[i] > 0]
    return Figures(
        len(said),
        int(mine.sum()),
        float(shares[rows].sum()),
        float(1.0 - shares[names.index("background")]),
        float((said[~mine] != names.index("background")).mean()) if (~mine).any() else float("nan"),
        {names[i]: float(shares[i]) for i in order},
    )


def panel(found: Labeled, title: str) -> U8:
    """Draw a scan by the classes that it was given.

    Args:
        found: What `label_real_scan` gives.
        title: Name of the scan.

    Returns:
        sRGB colors, shape (H, W, 3), uint8.
    """
    palette = np.zeros((256, 3), np.uint8)
    palette[: len(class_table(TABLE).colors)] = class_table(TABLE).colors
    mine = found.truth[TABLE] == 1
    low, high = (np.quantile(found.place[mine], q, axis=0) for q in (0.01, 0.99))
    picture = draw(found.place, palette[found.found[TABLE]], EYE, low, high)
    cv2.putText(picture, title, (10, 22), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (40, 40, 40), 1, cv2.LINE_AA)
    return picture


def page(rows: Mapping[str, tuple[RealScan, Figures]], name: str) -> str:
    """Write the page.

    Args:
        rows: Each scan and what came of it.
        name: Name of the model.
    """
    lines = [
        "# A model on real scans",
        "",
        f"Written by `python -m benchmarks.shipped.real_scans`. Model: {name}. Nobody labeled these scans point by",
        "point; *plausible* is the share of the points of a bridge that got a class they can have (a pier: column,",
        "pier cap, abutment, bearing or arch), *any part* the share that got any class of a bridge, *false* the share",
        "of all other points that were called a part of one. The airborne tiles know their bridges as class 26 (civil",
        "structure).",
        "",
        "![Each scan by the classes that it was given](../images/real_scans.png)",
        "",
        "| scan | thinned points | of a bridge | plausible | any part | false | mostly |",
        "|---|---|---|---|---|---|---|",
    ]
    for title, (_, row) in rows.items():
        mostly = ", ".join(f"{name} {share:.0%}" for name, share in row.most.items())
        false = "-" if np.isnan(row.false) else f"{row.false:.1%}"
        lines.append(
            f"| {title} | {row.points:,} | {row.on_bridge:,} | {row.plausible:.0%} | {row.any_part:.0%} "
            f"| {false} | {mostly} |"
        )
    lines += ["", "| scan | from |", "|---|---|"]
    lines += [f"| {title} | {scan.source}: `{scan.path}` |" for title, (scan, _) in rows.items()]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Label, count and draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--model", default="")
    given = parser.parse_args()
    torch.set_num_threads(1)  # several wait for each other where others work, too
    model = named_model(given.model)
    rows: dict[str, tuple[RealScan, Figures]] = {}
    panels = []
    for scan in SCANS:
        found = label_real_scan(given.folder / scan.source.rpartition("/")[2] / scan.path, scan.code, model)
        rows[scan.title] = (scan, figures_of(found, scan.plausible))
        panels.append(panel(found, f"{scan.title}: {rows[scan.title][1].plausible:.0%} plausible"))
    panels += [np.full((PANEL[1], PANEL[0], 3), 255, np.uint8)] * (-len(panels) % 3)
    gap = np.full((PANEL[1], GAP, 3), 255, np.uint8)
    bands = [
        np.concatenate([p for one in panels[i : i + 3] for p in (one, gap)][:-1], 1) for i in range(0, len(panels), 3)
    ]
    _, data = cv2.imencode(".png", np.concatenate(bands)[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])
    write_bytes(DOCS / "images" / "real_scans.png", data.tobytes())
    name = Path(given.model).name if given.model else "that of the package (`learn/shipped`)"
    write_page(DOCS / "benchmarks" / "real_scans.md", page(rows, name), __file__)


if __name__ == "__main__":
    main()
