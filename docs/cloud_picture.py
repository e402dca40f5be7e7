"""Compose the picture of a reconstructed cloud: by color, class, instance, uncertainty, and with three thresholds.

The lower row is the paper's Figure 18: points whose uncertainty is above 100, 1 and 0.01 m as the class noisy_point.

Usage: python -m docs.cloud_picture CLOUD [picture.png]
"""

import sys
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from docs.sampling_picture import GAP, PANEL, draw
from groundwork.files import write_bytes
from recon.cloud import Cloud, read_cloud, segment_with_noise
from usd_schemas.components import NOISY_POINT

U8 = NDArray[np.uint8]

PICTURE = Path(__file__).resolve().parent / "images" / "dense_cloud.png"
THRESHOLDS = (100.0, 1.0, 0.01)  # [m] of the paper's Figure 18
EYE = np.array([-0.45, -0.75, 0.22])  # from the middle, in lengths of the bridge
DARKEST, BRIGHTEST = 1e-3, 1.0  # [m] of the scale of uncertainty


def main(folder: Path, picture: Path) -> None:
    """Write the picture.

    Args:
        folder: An annotated cloud.
        picture: PNG to write.
    """
    cloud = read_cloud(folder)
    palette = np.zeros((256, 3), np.uint8)
    for row in cloud.classes:
        palette[row.id] = row.color
    palette[NOISY_POINT] = (255, 0, 255)
    views = {
        "color": cloud.columns["color"],
        "class": palette[cloud.columns["segment"]],
        "instance": paint_instances(cloud),
        "uncertainty, 1 mm to 1 m": paint_uncertainty(cloud),
    }
    noisy = {f"noisy above {limit:g} m": palette[segment_with_noise(cloud, limit)] for limit in THRESHOLDS}
    noisy["without them"] = palette[cloud.columns["segment"]]
    sure = cloud.columns["uncertainty"] <= THRESHOLDS[-1]
    points, on_bridge = cloud.columns["coord"], cloud.columns["segment"] > 0
    low, high = np.quantile(points[on_bridge], 0.005, axis=0), np.quantile(points[on_bridge], 0.995, axis=0)
    rows = []
    for paints in (views, noisy):
        panels = []
        for title, colors in paints.items():
            shown = sure if title == "without them" else np.ones(len(points), bool)
            panel = draw(points[shown], colors[shown], EYE, low, high)
            cv2.putText(panel, title, (10, 22), cv2.FONT_HERSHEY_SIMPLEX, 0.55, (40, 40, 40), 1, cv2.LINE_AA)
            panels += [panel, np.full((PANEL[1], GAP, 3), 255, np.uint8)]
        rows += [np.concatenate(panels[:-1], axis=1), np.full((GAP, len(paints) * (PANEL[0] + GAP) - GAP, 3), 225)]
    sheet = np.concatenate(rows[:-1]).astype(np.uint8)
    _, data = cv2.imencode(".png", sheet[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])
    write_bytes(picture, data.tobytes())


def paint_instances(cloud: Cloud) -> U8:
    """Give every component a color of its own; no component is gray.

    Args:
        cloud: A cloud.

    Returns:
        sRGB colors, shape (N, 3), uint8.
    """
    ids = cloud.columns["instance"].astype(np.uint64)
    mixed = (ids * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(40)
    colors = np.stack([(mixed >> np.uint64(shift)) % np.uint64(200) + np.uint64(30) for shift in (0, 8, 16)], axis=1)
    return np.where(ids[:, None] == 0, 190, colors).astype(np.uint8)


def paint_uncertainty(cloud: Cloud) -> U8:
    """Paint the uncertainty on a logarithmic scale, blue to red.

    Args:
        cloud: A cloud.

    Returns:
        sRGB colors, shape (N, 3), uint8.
    """
    value = np.clip(cloud.columns["uncertainty"].astype(np.float64), DARKEST, BRIGHTEST)
    share = np.log(value / DARKEST) / np.log(BRIGHTEST / DARKEST)
    codes = (255 * np.nan_to_num(share, nan=1.0)).astype(np.uint8)
    return cv2.applyColorMap(codes[:, None], cv2.COLORMAP_TURBO)[:, 0, ::-1].astype(np.uint8)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else PICTURE)
