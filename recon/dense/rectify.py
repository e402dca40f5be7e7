"""Rectification of two views; if the camera moved forwards, of the part of the image beside its path."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usd_schemas.pinhole import Pinhole

F64 = NDArray[np.float64]

_MIN_ANGLE = 12.0  # [deg] of the views' mean axis to the baseline: at smaller angles, no plane faces both
_MIN_SHARE = 0.35  # least share of an image: a motion within 15 degrees of the axis leaves less, and little parallax
_MAX_SLOPE = np.tan(np.radians(60.0))  # of a ray to the plane's axis: beyond, the image is stretched too much
_GRID = 33  # rays per side that sample an image
_MAX_PARALLAX = 0.7  # disparity over focal length: on the plane's axis 35 degrees, at which two views look different
_MOST_DISPARITIES = 2032  # OpenCV's sixteenths of a pixel are 16-bit numbers


@dataclass(frozen=True)
class RectifiedPair:
    """The common image plane of two views; the reference is the left one.

    A point at (x, y) in the left image lies at (x - d, y) in the right one, and its depth along the common axis is
    `focal * baseline / (d + infinity)`.

    Attributes:
        size: Width and height of both rectified images [px].
        focal: Focal length [px].
        left_center: Principal point of the left image [px].
        right_center: Principal point of the right image [px]; its row is the left one's.
        left: Rotation from the reference's camera axes into the common ones [1], shape (3, 3), float64.
        right: Rotation from the source's camera axes into the common ones [1], shape (3, 3), float64.
        baseline: Distance of the camera centers [model units].
        disparities: Number of disparities to search, from 0, a multiple of 16.
        infinity: Disparity of infinity, negated [px].
        share: Share of the reference's picture, or of the source's where that is less, on the common plane [1].
    """

    size: tuple[int, int]
    focal: float
    left_center: tuple[float, float]
    right_center: tuple[float, float]
    left: F64
    right: F64
    baseline: float
    disparities: int
    infinity: float
    share: float


def rectify(camera: Pinhole, reference: F64, source: F64, near: float, far: float) -> RectifiedPair | None:
    """Find the common image plane of two views.

    The rows run along the baseline, from the reference to the source, whatever its direction: with a source above, rows
    run upwards; with one on the left, both images are upside down. Rays at more than 60 degrees to the plane's axis,
    along the rows or across them, are left out: if the camera moves partly forwards or backwards, that is the part of
    the image along its path.

    Source: Fusiello, Trucco, Verri, A compact algorithm for rectification of stereo pairs (2000).

    Args:
        camera: Intrinsics of both views.
        reference: camera_to_world of the reference [model units], shape (4, 4), float64.
        source: camera_to_world of the source [model units], shape (4, 4), float64.
        near: Smallest depth of the reference to cover [model units].
        far: Largest depth of the reference to cover [model units].

    Returns:
        The pair, or None if it cannot be rectified: too little of either image falls on the plane, the two look in
        different directions, or the disparity of the whole scene is below a pixel.
    """
    offset = source[:3, 3] - reference[:3, 3]
    baseline = float(np.linalg.norm(offset))
    if baseline == 0.0:
        return None
    across = offset / baseline
    forward = reference[:3, 2] / 2 + source[:3, 2] / 2
    forward = forward - (forward @ across) * across
    if np.linalg.norm(forward) < np.sin(np.radians(_MIN_ANGLE)) or reference[:3, 2] @ source[:3, 2] <= 0.0:
        return None
    forward /= np.linalg.norm(forward)
    common = np.stack([across, np.cross(forward, across), forward])
    left, right = common @ reference[:3, :3], common @ source[:3, :3]
    rays = _rays(camera)
    held = [_on_plane(rays @ turn.T) for turn in (left, right)]
    share = min(float(mask.mean()) for mask in held)
    if share < _MIN_SHARE:
        return None
    focal = (camera.fx + camera.fy) / 2
    seen = (rays @ left.T)[held[0]]
    slopes = seen[:, :2] / seen[:, 2:]
    low, high = slopes.min(axis=0) * focal, slopes.max(axis=0) * focal
    # Depth along the common axis differs from the reference's own by the axis's rotation: the widest range is used.
    turned = seen[:, 2]
    nearest, farthest = near * float(turned.min()), far * float(turned.max())
    width, height = int(np.ceil(high[0] - low[0])), int(np.ceil(high[1] - low[1]))
    reach = focal * baseline
    span = min(reach / nearest - reach / farthest, _MAX_PARALLAX * focal)
    if span < 1.0:
        return None
    disparities = min(16 * int(np.ceil((span + 1.0) / 16)), _MOST_DISPARITIES)
    infinity = reach / farthest
    left_center = (disparities - float(low[0]), -float(low[1]))
    right_center = (left_center[0] + infinity, left_center[1])
    size = (width + disparities, height)
    return RectifiedPair(size, focal, left_center, right_center, left, right, baseline, disparities, infinity, share)


def source_maps(pair: RectifiedPair, camera: Pinhole, right: bool) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Find the source position of each rectified pixel, in OpenCV's pixel coordinates.

    Args:
        pair: Rectified pair.
        camera: Intrinsics of the view.
        right: Of the right image instead of the left one.

    Returns:
        Columns and rows in the view [px], from the center of its top-left pixel, shape (H, W) each, float32.
    """
    width, height = pair.size
    center, turn = (pair.right_center, pair.right) if right else (pair.left_center, pair.left)
    column, row = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    rays = np.stack([(column - center[0]) / pair.focal, (row - center[1]) / pair.focal, np.ones_like(column)], axis=-1)
    local = rays @ turn  # the rotation's transpose leads back into the view
    depth = np.where(local[..., 2] > 1e-6, local[..., 2], np.nan)
    across = local[..., 0] / depth * camera.fx + camera.cx - 0.5
    down = local[..., 1] / depth * camera.fy + camera.cy - 0.5
    outside = -10.0  # a ray from behind falls outside the image
    return np.nan_to_num(across, nan=outside).astype(np.float32), np.nan_to_num(down, nan=outside).astype(np.float32)


def _rays(camera: Pinhole) -> F64:
    """Rays through a grid over the image, its rim included, shape (N, 3), with a third component of 1."""
    column, row = np.meshgrid(np.linspace(0, camera.width, _GRID), np.linspace(0, camera.height, _GRID))
    x, y = (column - camera.cx) / camera.fx, (row - camera.cy) / camera.fy
    return np.column_stack([x.ravel(), y.ravel(), np.ones(x.size)])


def _on_plane(rays: F64) -> NDArray[np.bool_]:
    """Tell which rays in the common axes point forwards and are within 60 degrees of the plane's axis."""
    return (rays[:, 2] > 0.0) & (np.abs(rays[:, :2]).max(axis=1) <= _MAX_SLOPE * rays[:, 2])
