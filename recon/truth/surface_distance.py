"""Distance of reconstructed points to the true surface, and what that surface is."""

import numpy as np
from numpy.typing import NDArray

from recon.truth.triangle_points import nearest_on_triangles
from render.capture import Truth
from usd_schemas.components import UNLABELED

F64 = NDArray[np.float64]


def nearest_surface(points: F64, truth: Truth) -> tuple[F64, NDArray[np.uint8]]:
    """Find the nearest true surface of each point.

    Which triangle is nearest, an engine of single precision tells; how far it is, is found in double precision: of long
    thin triangles the engine's own nearest point may be centimetres off.

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
    """Mark the surface distance of points on moving things as unknown: the true surface is that of the first image.

    Args:
        instance: Instance id of each point, shape (N,), uint32.
        truth: The truth, whose table marks what moves.
        distance: Distance of each point to the true surface [m], shape (N,), float64.
        nearest: Class of that surface, shape (N,), uint8.

    Returns:
        The same, NaN and 255 on things that move, shape (N,) each.
    """
    moving = np.isin(instance, [row.id for row in truth.instances if row.moves])
    return np.where(moving, np.nan, distance), np.where(moving, np.uint8(UNLABELED), nearest)
