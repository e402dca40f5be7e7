"""Distance of reconstructed points to the true surface, and what that surface is."""

import numpy as np
from numpy.typing import NDArray

from render.capture import Truth

F64 = NDArray[np.float64]


def nearest_surface(points: F64, truth: Truth) -> tuple[F64, NDArray[np.uint8]]:
    """Find the nearest true surface of each point.

    Args:
        points: World positions [m], shape (N, 3), float64.
        truth: Truth that holds the surface.

    Returns:
        Distance [m], shape (N,), float64, and class id of the nearest triangle, shape (N,), uint8.
    """
    from usd_schemas.raycast import RayScene  # loads open3d

    corners, instances, labels = truth.surface()
    distance, triangle = RayScene(corners, instances).distance(points)
    return np.asarray(distance, np.float64), labels[triangle]
