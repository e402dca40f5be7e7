"""Projection of a pinhole camera to clip space, and frustum culling.

Image rows run downwards both in memory and in clip space, so that images need no flip. Depth is reversed and has no far
plane: 1 at the near plane, 0 at infinity.
"""

import numpy as np
from numpy.typing import NDArray

from usd_schemas.pinhole import Pinhole

F64 = NDArray[np.float64]
F32 = NDArray[np.float32]


def clip_from_camera(camera: Pinhole, near: float) -> F64:
    """Build the projection; pixel position (u, v) becomes (2u/W - 1, 2v/H - 1).

    Args:
        camera: Intrinsics.
        near: Near plane [m].

    Returns:
        Clip from camera axes right, down, forward [1], shape (4, 4), float64, for column vectors.
    """
    return np.array(
        [
            [2 * camera.fx / camera.width, 0, 2 * camera.cx / camera.width - 1, 0],
            [0, 2 * camera.fy / camera.height, 2 * camera.cy / camera.height - 1, 0],
            [0, 0, 0, near],
            [0, 0, 1, 0],
        ],
        np.float64,
    )


def clip_from_relative(camera: Pinhole, camera_to_world: F64, near: float) -> F32:
    """Build the projection of positions relative to the camera center, in world axes.

    The center is subtracted in float64 before anything becomes float32, so that coordinates of millions of meters
    lose no precision.

    Args:
        camera: Intrinsics.
        camera_to_world: Camera pose [m], shape (4, 4), float64.
        near: Near plane [m].

    Returns:
        Clip from camera-relative positions [1], shape (4, 4), float32.
    """
    turn = np.eye(4)
    turn[:3, :3] = camera_to_world[:3, :3].T
    return (clip_from_camera(camera, near) @ turn).astype(np.float32)


def visible_boxes(lower: F64, upper: F64, camera: Pinhole, camera_to_world: F64) -> NDArray[np.int64]:
    """Find the boxes that may be in view, nearest first; large ones later, because the ground hides little of the rest.

    Args:
        lower: Lower corners [m], shape (D, 3), float64.
        upper: Upper corners [m], shape (D, 3), float64.
        camera: Intrinsics.
        camera_to_world: Camera pose [m], shape (4, 4), float64.

    Returns:
        Rows, ordered by distance from the camera plus half the diagonal, equal ones by row; shape (N,), int64.
    """
    eye = camera_to_world[:3, 3]
    planes = _frustum_planes(camera) @ camera_to_world[:3, :3].T
    center, half = (lower + upper) / 2 - eye, (upper - lower) / 2
    reach = center @ planes.T + half @ np.abs(planes).T
    rows = np.flatnonzero(np.all(reach >= 0.0, axis=1))
    gap = np.maximum(np.abs(center[rows]) - half[rows], 0.0)
    return rows[np.lexsort((rows, np.linalg.norm(gap, axis=1) + np.linalg.norm(half[rows], axis=1)))]


def _frustum_planes(camera: Pinhole) -> F64:
    """Inward normals of the four sides and the front in camera axes, all through the center, shape (5, 3)."""
    return np.array(
        [
            [camera.fx, 0.0, camera.cx],
            [-camera.fx, 0.0, camera.width - camera.cx],
            [0.0, camera.fy, camera.cy],
            [0.0, -camera.fy, camera.height - camera.cy],
            [0.0, 0.0, 1.0],
        ]
    )
