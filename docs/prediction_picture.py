"""Compose a picture of a model's predictions for clouds of known classes: truth, prediction, and errors.

Usage: python -m docs.prediction_picture CLOUD… [--model FOLDER] [--table falsework] [--out picture.png]

Without `--model`, the model of the package.
"""

import argparse
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.shipped.scan_scores import TABLES, Labeled, label_scan, read_labeled_scan
from docs.sampling_picture import GAP, PANEL, draw
from groundwork.files import write_bytes
from learn.datasets.class_tables import ClassTable, class_table
from learn.metrics import scores
from learn.predict.model import named_model
from recon.cloud import read_cloud

U8 = NDArray[np.uint8]
I64 = NDArray[np.int64]

PICTURE = Path(__file__).resolve().parent / "images" / "prediction.png"
EYE = np.array([-0.54, -0.9, 0.3])  # from the middle, in lengths of the bridge
RIGHT, WRONG = (205, 205, 205), (214, 39, 40)
INK = (40, 40, 40)
KINDS = {
    "lidar-terrestrial": "laser on a tripod",
    "lidar-mobile": "laser on a vehicle",
    "lidar-airborne": "laser on an aircraft",
    "mesh": "sampled on the mesh",
    "sfm-dense": "photographs, dense",
    "sfm-sparse": "photographs, sparse",
}
_LETTERS, _LINE = 0.5, 26  # of captions; height of a line of the legend [px]


def panels(found: Labeled, table: str, title: str) -> U8:
    """Draw truth, prediction and errors of one cloud side by side.

    Args:
        found: A model's predictions for the cloud.
        table: Classes.
        title: What made the cloud.

    Returns:
        sRGB colors, shape (H, W, 3), uint8.
    """
    palette = np.full((256, 3), 255, np.uint8)
    palette[: len(class_table(table).colors)] = class_table(table).colors
    truth, said = found.truth[table], found.found[table]
    on_bridge = (found.truth["falsework"] != 0) & (found.truth["falsework"] != 255)
    low, high = (np.quantile(found.place[on_bridge], q, axis=0) for q in (0.005, 0.995))
    result = scores(found.matrix(table))
    paints = {
        f"{title}: true classes": palette[truth],
        f"predicted, mean IoU {result.mean_iou:.2f}": palette[said],
        f"red: wrong, {1 - result.overall_accuracy:.0%} of the points": np.where(
            (truth == said)[:, None], RIGHT, WRONG
        ).astype(np.uint8),
    }
    row = []
    for words, colors in paints.items():
        panel = draw(found.place, colors, EYE, low, high)
        _write(panel, words, 10)
        row += [panel, np.full((PANEL[1], GAP, 3), 255, np.uint8)]
    return np.concatenate(row[:-1], axis=1)


def legend(table: ClassTable, labels: I64, width: int) -> U8:
    """Name the classes that occur, each beside its color.

    Args:
        table: Classes.
        labels: Labels that were drawn, shape (N,), int64.
        width: Of the picture [px].

    Returns:
        sRGB colors, shape (H, W, 3), uint8.
    """
    lines, left = [np.full((_LINE, width, 3), 255, np.uint8)], 10
    for label in np.unique(labels[labels < len(table.names)]).tolist():
        name = table.names[label]
        (letters, _), _ = cv2.getTextSize(name, cv2.FONT_HERSHEY_SIMPLEX, _LETTERS, 1)
        if left + 20 + letters > width - 10:
            lines, left = [*lines, np.full((_LINE, width, 3), 255, np.uint8)], 10
        lines[-1][7:19, left : left + 12] = table.colors[label]
        _write(lines[-1], name, left + 18, 18)
        left += letters + 40
    return np.concatenate(lines)


def main() -> None:
    """Write the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clouds", type=Path, nargs="+")
    parser.add_argument("--model", default="")
    parser.add_argument("--table", choices=TABLES, default="falsework")
    parser.add_argument("--out", type=Path, default=PICTURE)
    given = parser.parse_args()
    model, rows, labels = named_model(given.model), list[U8](), list[I64]()
    for path in given.clouds:
        found = label_scan(read_labeled_scan(path), model)
        source = read_cloud(path).source
        rows.append(panels(found, given.table, KINDS.get(source, source)))
        labels += [found.truth[given.table], found.found[given.table]]
    rows.append(legend(class_table(given.table), np.concatenate(labels), rows[0].shape[1]))
    _, data = cv2.imencode(".png", np.concatenate(rows)[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])
    write_bytes(given.out, data.tobytes())


def _write(image: U8, words: str, left: int, base: int = 22) -> None:
    cv2.putText(image, words, (left, base), cv2.FONT_HERSHEY_SIMPLEX, _LETTERS, INK, 1, cv2.LINE_AA)


if __name__ == "__main__":
    main()
