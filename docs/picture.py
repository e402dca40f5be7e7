"""Compose the picture of the README from a finished run: frames, labels, depth, and the cloud by class.

Usage: python -m docs.picture demo-out
"""

import sys
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from falsework.report.pictures import paint_depth, paint_labels
from groundwork.files import write_bytes
from recon.cloud import Cloud, read_cloud
from render.capture import load_image, read_capture, read_truth
from usd_schemas.pinhole import Pinhole, look_at, project

PICTURE = Path(__file__).resolve().parent / "images" / "chain.png"
FRAME = (320, 240)  # [px]
U8 = NDArray[np.uint8]
GAP = 6  # [px]


def main(run: Path) -> None:
    """Write the picture.

    Args:
        run: Output folder of a run with one scene.
    """
    scene = run / "scenes" / "0000"
    capture = read_capture(next(iter(sorted(scene.glob("capture/*")))))
    truth = read_truth(capture)
    if truth is None:
        sys.exit("the capture has no truth")
    rows = []
    for index in np.linspace(0, len(capture.images), 3, endpoint=False).astype(int) + len(capture.images) // 6:
        painted = (
            load_image(capture, int(index)),
            paint_labels(truth.semantic(int(index)), truth.classes),
            paint_depth(truth.depth(int(index))),
        )
        rows.append(
            _join([cv2.resize(image, FRAME, interpolation=cv2.INTER_AREA).astype(np.uint8) for image in painted])
        )
    width = rows[0].shape[1]
    rows.append(cloud_view(read_cloud(next(iter(sorted(scene.glob("cloud/*"))))), width, 420))
    sheet = np.concatenate([part for row in rows for part in (row, np.full((GAP, width, 3), 255, np.uint8))][:-1])
    _, data = cv2.imencode(".png", sheet[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])
    PICTURE.parent.mkdir(exist_ok=True)
    write_bytes(PICTURE, data.tobytes())


def cloud_view(cloud: Cloud, width: int, height: int) -> U8:
    """Draw the points of a cloud by class, nearer ones over farther ones.

    Args:
        cloud: A cloud.
        width: Image width [px].
        height: Image height [px].

    Returns:
        sRGB colors, shape (height, width, 3), uint8.
    """
    palette = np.zeros((256, 3), np.uint8)
    for row in cloud.classes:
        palette[row.id] = row.color
    points, segment = cloud.columns["coord"], cloud.columns["segment"]
    bridge = points[segment != 0]
    low, high = np.percentile(bridge, 2, axis=0), np.percentile(bridge, 98, axis=0)
    middle, size = (low + high) / 2, float(np.linalg.norm(high - low))
    camera = Pinhole(width, height, width * 1.05, width * 1.05, width / 2, height / 2)
    pose = look_at(middle + size * np.array([-0.42, -1.02, 0.5]), middle + np.array([0, 0, -0.03 * size]))
    pixels, depth = project(points, camera, pose)
    near = np.argsort(-depth)
    image = np.full((height, width, 3), 255, np.uint8)
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        column, line = np.floor(pixels[near] + [dx, dy]).astype(int).T
        seen = (column >= 0) & (column < width) & (line >= 0) & (line < height) & (depth[near] > 0)
        image[line[seen], column[seen]] = palette[segment[near][seen]]
    return image


def _join(images: list[U8]) -> U8:
    gap = np.full((FRAME[1], GAP, 3), 255, np.uint8)
    return np.concatenate([images[0], gap, images[1], gap, images[2]], axis=1)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
