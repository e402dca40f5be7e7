"""Pictures of the report: photographs, labels and depth as colored images, encoded for a page."""

import base64

import cv2
import numpy as np
from numpy.typing import NDArray

from usd_schemas.components import ClassRow

U8 = NDArray[np.uint8]

_NEAREST = 1e-3  # [m] what is nearer is painted alike


def paint_labels(labels: U8, classes: tuple[ClassRow, ...]) -> U8:
    """Color a label image.

    Args:
        labels: Class ids, shape (H, W), uint8.
        classes: Class table.

    Returns:
        sRGB colors, shape (H, W, 3), uint8.
    """
    palette = np.zeros((256, 3), np.uint8)
    for row in classes:
        palette[row.id] = row.color
    return palette[labels]


def paint_depth(depth: NDArray[np.float32]) -> U8:
    """Color a depth image on a logarithmic scale, near bright, sky black.

    Args:
        depth: Planar depth [m], shape (H, W), float32.

    Returns:
        sRGB colors, shape (H, W, 3), uint8.
    """
    ends = depth_range(depth)
    if ends is None:
        return np.zeros((*depth.shape, 3), np.uint8)
    seen = np.isfinite(depth)
    scale = np.log(np.maximum(np.where(seen, depth, 1.0), _NEAREST))
    near, far = np.log(ends)
    level = np.clip((far - scale) / max(far - near, 1e-6), 0, 1)
    painted = cv2.applyColorMap((level * 255).astype(np.uint8), cv2.COLORMAP_VIRIDIS)[..., ::-1]
    return np.where(seen[..., None], painted, 0).astype(np.uint8)


def depth_range(depth: NDArray[np.float32]) -> tuple[float, float] | None:
    """Tell which depths the ends of the color scale stand for.

    Args:
        depth: Planar depth [m], shape (H, W), float32.

    Returns:
        The hundredth of the pixels with a depth that is nearest ends at the first [m], the farthest begins at the
        second; None where there is none.
    """
    seen = depth[np.isfinite(depth)]
    if not len(seen):
        return None
    near, far = np.exp(np.percentile(np.log(np.maximum(seen, _NEAREST)), [1, 99]))
    return float(near), float(far)


def data_uri(pixels: U8, width: int, *, smooth: bool = True, quality: int = 85) -> str:
    """Encode a picture as a data URI.

    Args:
        pixels: sRGB colors, shape (H, W, 3), uint8.
        width: Width to which it is reduced [px].
        smooth: JPEG, reduced by averaging; else PNG, reduced to the nearest pixel, for labels.
        quality: Of the JPEG.
    """
    width = min(width, pixels.shape[1])
    height = max(round(pixels.shape[0] * width / pixels.shape[1]), 1)
    mode = cv2.INTER_AREA if smooth else cv2.INTER_NEAREST
    small = cv2.resize(pixels, (width, height), interpolation=mode)
    kind, options = (".jpg", [cv2.IMWRITE_JPEG_QUALITY, quality]) if smooth else (".png", [])
    _, data = cv2.imencode(kind, small[..., ::-1], options)
    return f"data:image/{'jpeg' if smooth else 'png'};base64,{base64.b64encode(data.tobytes()).decode()}"
