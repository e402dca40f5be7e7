"""The tight box of a bridge, aligned with it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

F64 = NDArray[np.float64]


@dataclass(frozen=True)
class OrientedBox:
    """An upright box.

    Attributes:
        center: Center [m], shape (3,), float64.
        axes: Unit vectors along, to the left and up, in rows [1], shape (3, 3), float64.
        half: Half of the length, width and height [m], shape (3,), float64.
    """

    center: F64
    axes: F64
    half: F64

    def to_world(self, local: F64) -> F64:
        """Convert box coordinates to world positions.

        Args:
            local: Offsets from the center along the axes [m], shape (N, 3), float64.

        Returns:
            World positions [m], shape (N, 3), float64.
        """
        return self.center + local @ self.axes

    def to_local(self, points: F64) -> F64:
        """Convert world positions to box coordinates.

        Args:
            points: World positions [m], shape (N, 3), float64.

        Returns:
            Offsets from the center along the axes [m], shape (N, 3), float64.
        """
        return (points - self.center) @ self.axes.T


def oriented_box(points: F64) -> OrientedBox:
    """Find the upright box of least area in plan, its longer side along.

    One side of such a rectangle lies on the hull, so that trying every edge of the hull finds it.

    Args:
        points: World positions [m], shape (N, 3), float64.
    """
    plan = points[:, :2]
    hull = plan[ConvexHull(plan).vertices]
    edges = np.roll(hull, -1, axis=0) - hull
    angles = np.unique(np.round(np.arctan2(edges[:, 1], edges[:, 0]) % (np.pi / 2), 6))
    sizes = [np.prod(np.ptp(hull @ _rotation(angle).T, axis=0)) for angle in angles]
    turn = _rotation(float(angles[int(np.argmin(sizes))]))
    if np.ptp(hull @ turn[1]) > np.ptp(hull @ turn[0]):
        turn = np.stack([turn[1], -turn[0]])
    if turn[0] @ [1.0, 1e-3] < 0:
        turn = -turn
    axes = np.eye(3)
    axes[:2, :2] = turn
    local = points @ axes.T
    low, high = local.min(axis=0), local.max(axis=0)
    return OrientedBox((low + high) / 2 @ axes, axes, (high - low) / 2)


def _rotation(angle: float) -> F64:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, sine], [-sine, cosine]])
