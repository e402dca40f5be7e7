"""Compose the picture of what a model says of scans whose classes are known: truth, prediction, and what is wrong.

Usage: python -m docs.prediction_picture CLOUD… [--model FOLDER] [--table kim2023] [--out picture.png]
"""

import argparse
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.shipped.scan_scores import TABLES, Labelled, label_scan, read_labelled_scan
from docs.sampling_picture import GAP, PANEL, draw
from groundwork.files import write_bytes
from learn.datasets.class_tables import class_table
from learn.metrics import scores
from learn.predict.model import named_model

U8 = NDArray[np.uint8]

PICTURE = Path(__file__).resolve().parent / "images" / "prediction.png"
EYE = np.array([-0.45, -0.75, 0.22])  # from the middle, in lengths of the bridge
RIGHT, WRONG = (205, 205, 205), (214, 39, 40)


def panels(found: Labelled, table: str, title: str) -> U8:
    """Draw truth, prediction and errors of one scan side by side.

    Args:
        found: What a model says of the scan.
        table: Classes.
        title: Name of the scan.

    Returns:
        sRGB colours, shape (H, W, 3), uint8.
    """
    palette = np.zeros((256, 3), np.uint8)
    palette[: len(class_table(table).colors)] = class_table(table).colors
    palette[255] = 255
    truth, said = found.truth[table], found.found[table]
    on_bridge = (found.truth["falsework"] != 0) & (found.truth["falsework"] != 255)
    low, high = (np.quantile(found.place[on_bridge], q, axis=0) for q in (0.005, 0.995))
    result = scores(found.matrix(table))
    paints = {
        f"{title}: truth": palette[truth],
        f"prediction, mean IoU {result.mean_iou:.2f}": palette[said],
        f"wrong: {1 - result.overall_accuracy:.1%}": np.where((truth == said)[:, None], RIGHT, WRONG).astype(np.uint8),
    }
    row = []
    for words, colors in paints.items():
        order = np.argsort(truth != said, kind="stable") if words.startswith("wrong") else np.arange(len(truth))
        panel = draw(found.place[order], colors[order], EYE, low, high)
        cv2.putText(panel, words, (10, 22), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (40, 40, 40), 1, cv2.LINE_AA)
        row += [panel, np.full((PANEL[1], GAP, 3), 255, np.uint8)]
    return np.concatenate(row[:-1], axis=1)


def main() -> None:
    """Write the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clouds", type=Path, nargs="+")
    parser.add_argument("--model", default="")
    parser.add_argument("--table", choices=TABLES, default="falsework")
    parser.add_argument("--out", type=Path, default=PICTURE)
    given = parser.parse_args()
    model, rows = named_model(given.model), []
    for path in given.clouds:
        found = label_scan(read_labelled_scan(path), model)
        rows.append(panels(found, given.table, f"{path.parent.name} {path.name}"))
    _, data = cv2.imencode(".png", np.concatenate(rows)[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])
    write_bytes(given.out, data.tobytes())


if __name__ == "__main__":
    main()
