"""Two views turned so that the same point lies on the same row of both: any motion but one towards the scene."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usd_schemas.pinhole import Pinhole

F64 = NDArray[np.float64]

_MIN_EPIPOLE = 12.0  # [deg] rays closer than this to the baseline measure no depth
_MAX_TURN = 60.0  # [deg] a ray farther off the rectified axis than this is stretched too much to be compared
_MAX_PARALLAX = 0.7  # disparity over focal length: what two views see under more than 35 degrees looks different


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
        left: Rotation from the reference's camera axes into the common ones, shape (3, 3), float64.
        right: Rotation from the source's camera axes into the common ones, shape (3, 3), float64.
        baseline: Distance of the camera centres [model units].
        disparities: Number of disparities to search, from 0, a multiple of 16.
        infinity: Disparity of infinity, negated [px].
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


def rectify(camera: Pinhole, reference: F64, source: F64, near: float, far: float) -> RectifiedPair | None:
    """Find the common image plane of two views.

    The rows run along the baseline, from the reference to the source, whichever way that is: a source above gives
    upright rows, one on the left turns both images upside down.

    Source: Fusiello, Trucco, Verri, A compact algorithm for rectification of stereo pairs (2000).

    Args:
        camera: Intrinsics of both views.
        reference: camera_to_world of the reference, shape (4, 4), float64.
        source: camera_to_world of the source, shape (4, 4), float64.
        near: Smallest depth of the reference that matters.
        far: Largest depth of the reference that matters.

    Returns:
        The pair, or None where it cannot be rectified: the epipole of either view lies in its image or near it, the
        two look different ways, or the disparity of the whole scene is below a pixel.
    """
    offset = source[:3, 3] - reference[:3, 3]
    baseline = float(np.linalg.norm(offset))
    if baseline == 0.0:
        return None
    across = offset / baseline
    forward = reference[:3, 2] / 2 + source[:3, 2] / 2
    forward = forward - (forward @ across) * across
    if np.linalg.norm(forward) < np.sin(np.radians(_MIN_EPIPOLE)) or reference[:3, 2] @ source[:3, 2] <= 0.0:
        return None
    forward /= np.linalg.norm(forward)
    common = np.stack([across, np.cross(forward, across), forward])
    left, right = common @ reference[:3, :3], common @ source[:3, :3]
    rays = _rim(camera)
    if min(_epipole_angle(rays @ turn.T) for turn in (left, right)) < _MIN_EPIPOLE:
        return None
    focal = (camera.fx + camera.fy) / 2
    slope = _slopes(rays @ left.T)
    if slope is None:
        return None
    low, high = slope * focal
    # Depth along the common axis differs from the reference's own by the turn of the axis: take the widest range.
    turned = (rays @ left.T)[:, 2]
    nearest, farthest = near * max(float(turned.min()), 0.2), far * float(turned.max())
    width, height = int(np.ceil(high[0] - low[0])), int(np.ceil(high[1] - low[1]))
    reach = focal * baseline
    span = min(reach / nearest - reach / farthest, _MAX_PARALLAX * focal)
    if span < 1.0:
        return None
    disparities = 16 * int(np.ceil((span + 1.0) / 16))
    infinity = reach / farthest
    left_center = (disparities - float(low[0]), -float(low[1]))
    right_center = (left_center[0] + infinity, left_center[1])
    size = (width + disparities, height)
    return RectifiedPair(size, focal, left_center, right_center, left, right, baseline, disparities, infinity)


def source_maps(pair: RectifiedPair, camera: Pinhole, right: bool) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Find where each rectified pixel comes from, counted as OpenCV counts.

    Args:
        pair: Rectified pair.
        camera: Intrinsics of the view.
        right: Of the right image instead of the left one.

    Returns:
        Columns and rows in the view [px], from the centre of its top-left pixel, shape (H, W), float32.
    """
    width, height = pair.size
    center, turn = (pair.right_center, pair.right) if right else (pair.left_center, pair.left)
    column, row = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    rays = np.stack([(column - center[0]) / pair.focal, (row - center[1]) / pair.focal, np.ones_like(column)], axis=-1)
    local = rays @ turn  # the turn's transpose leads back into the view
    depth = np.where(local[..., 2] > 1e-6, local[..., 2], np.nan)
    across = local[..., 0] / depth * camera.fx + camera.cx - 0.5
    down = local[..., 1] / depth * camera.fy + camera.cy - 0.5
    outside = -10.0  # a ray from behind falls outside the image
    return np.nan_to_num(across, nan=outside).astype(np.float32), np.nan_to_num(down, nan=outside).astype(np.float32)


def _rim(camera: Pinhole) -> F64:
    """Rays through the image's rim, shape (N, 3), with a third component of 1."""
    column, row = np.linspace(0, camera.width, 33), np.linspace(0, camera.height, 33)
    rim = np.concatenate([
        np.column_stack([column, np.zeros(33)]), np.column_stack([column, np.full(33, camera.height)]),
        np.column_stack([np.zeros(33), row]), np.column_stack([np.full(33, camera.width), row]),
    ])  # fmt: skip
    return np.column_stack([(rim - [camera.cx, camera.cy]) / [camera.fx, camera.fy], np.ones(len(rim))])


def _epipole_angle(rays: F64) -> float:
    """Measure the smallest angle between the image's rays and the baseline [deg]; 0 with the epipole inside.

    The rim of the image goes round the epipole exactly when the directions about the baseline take every angle.
    """
    about = np.sort(np.arctan2(rays[:, 1], rays[:, 2]))
    widest_gap = np.max(np.diff(np.concatenate([about, about[:1] + 2 * np.pi])))
    if widest_gap < np.pi * 0.9:
        return 0.0
    cosine = np.abs(rays[:, 0]) / np.linalg.norm(rays, axis=1)
    return float(np.degrees(np.arccos(np.clip(cosine.max(), -1.0, 1.0))))


def _slopes(rays: F64) -> F64 | None:
    """Bound the slopes x/z and y/z of the image's rays, cut off where they are turned too far, shape (2, 2)."""
    limit = np.tan(np.radians(_MAX_TURN))
    front = rays[rays[:, 2] > 1e-3]
    if len(front) < 3:
        return None
    slopes = front[:, :2] / front[:, 2:]
    low, high = np.maximum(slopes.min(axis=0), -limit), np.minimum(slopes.max(axis=0), limit)
    return np.stack([low, high]) if (high - low > 0.05).all() else None
