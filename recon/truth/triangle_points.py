"""The point of a triangle that is nearest to a given point, in double precision."""

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

_ROWS = 1 << 17  # points at a time: intermediate results take some hundred bytes each


def nearest_on_triangles(points: F64, corners: F64, rows: NDArray[np.int64]) -> F64:
    """Find the nearest point of one triangle for each point.

    It is the foot of the perpendicular if that is inside, else the nearest point of the three edges; this also holds
    for triangles without area.

    Args:
        points: Query positions [m], shape (N, 3), float64.
        corners: Corner positions of each triangle [m], shape (T, 3, 3), float64.
        rows: Triangle of each point, shape (N,), int64.

    Returns:
        Nearest points [m], shape (N, 3), float64.
    """
    found = np.empty((len(points), 3))
    for first in range(0, len(points), _ROWS):
        part = slice(first, first + _ROWS)
        found[part] = _nearest(points[part], corners[rows[part]])
    return found


def _nearest(points: F64, corners: F64) -> F64:
    """Find the nearest points of as many triangles, shape (N, 3)."""
    best, least = np.empty_like(points), np.full(len(points), np.inf)
    for edge in range(3):
        start, along = corners[:, edge], corners[:, (edge + 1) % 3] - corners[:, edge]
        length = np.einsum("ij,ij->i", along, along)
        share = np.einsum("ij,ij->i", points - start, along) / np.where(length > 0.0, length, 1.0)
        foot = start + np.clip(share, 0.0, 1.0)[:, None] * along
        far = ((points - foot) ** 2).sum(axis=1)
        nearer = far < least
        best[nearer], least[nearer] = foot[nearer], far[nearer]
    one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(one, other)
    area = np.einsum("ij,ij->i", normal, normal)
    inside = area > 0.0
    arm = points - corners[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        first = np.einsum("ij,ij->i", np.cross(arm, other), normal) / area
        second = np.einsum("ij,ij->i", np.cross(one, arm), normal) / area
        inside &= (first >= 0.0) & (second >= 0.0) & (first + second <= 1.0)
        foot = points - (np.einsum("ij,ij->i", arm, normal) / area)[:, None] * normal
    best[inside] = foot[inside]
    return best
