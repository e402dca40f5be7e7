"""Distance of reconstructed points to the true surface, and the class of that surface."""

import numpy as np
from numpy.typing import NDArray

from recon.truth.triangle_points import nearest_on_triangles
from render.capture import Truth
from usd_schemas.components import UNLABELED

F64 = NDArray[np.float64]


def nearest_surface(points: F64, truth: Truth) -> tuple[F64, NDArray[np.uint8]]:
    """Find the nearest true surface of each point.

    The nearest triangle is found in single precision, the distance to it in double precision: for long thin triangles
    the nearest point of the engine may be centimeters off.

    Args:
        points: World positions [m], shape (N, 3), float64.
        truth: Truth that holds the surface.

    Returns:
        Distance [m], shape (N,), float64, and class id of the nearest triangle, shape (N,), uint8.
    """
    from usd_schemas.raycast import RayScene  # loads open3d

    corners, instances, labels = truth.surface()
    _, triangle = RayScene(corners, instances).nearest(points)
    points = np.asarray(points, np.float64)
    foot = nearest_on_triangles(points, np.asarray(corners, np.float64), triangle)
    return np.linalg.norm(points - foot, axis=1), labels[triangle]


def without_moving(
    instance: NDArray[np.uint32], truth: Truth, distance: NDArray[np.float64], nearest: NDArray[np.uint8]
) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """Mark the surface distance of points on moving objects as unknown: the true surface is that of the first image.

    Args:
        instance: Instance id of each point, shape (N,), uint32.
        truth: The truth; its table marks moving instances.
        distance: Distance of each point to the true surface [m], shape (N,), float64.
        nearest: Class of that surface, shape (N,), uint8.

    Returns:
        Distances [m], NaN on moving objects, shape (N,), float64; classes, 255 on moving objects, shape (N,), uint8.
    """
    moving = np.isin(instance, [row.id for row in truth.instances if row.moves])
    return np.where(moving, np.nan, distance), np.where(moving, np.uint8(UNLABELED), nearest)
