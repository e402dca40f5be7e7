"""Nearest points: those in a ball, and the k nearest."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from groundwork.errors import InputError

F32 = NDArray[np.float32]
I64 = NDArray[np.int64]


def ball_query(coord: F32, centers: F32, radius: float, count: int) -> I64:
    """Find the points within a ball about each center.

    Nearest first; if a ball holds more than `count` points, the nearest are kept. (The published code keeps those with
    the lowest indices, which depend on the order of the file.) If it holds fewer, the row is filled up with its first
    entry, as published: repeats do not change a maximum over the row.

    Args:
        coord: Positions [m or 1], shape (N, 3), float32.
        centers: Centers [m or 1], shape (M, 3), float32.
        radius: Of the balls, points on the surface included [m or 1].
        count: Entries of a row.

    Returns:
        Rows of `coord`, shape (M, count), int64; for an empty ball the nearest point, repeated.
    """
    tree = KDTree(coord)
    bound = float(np.nextafter(radius, np.inf))
    _, found = tree.query(centers, k=count, distance_upper_bound=bound)
    rows = np.array(found, dtype=np.int64).reshape(len(centers), count)  # scipy drops the axis of a single neighbour
    empty = rows[:, 0] == len(coord)
    if empty.any():
        rows[empty, 0] = tree.query(centers[empty], k=1)[1]
    return np.where(rows == len(coord), rows[:, :1], rows)


def nearest(coord: F32, centers: F32, count: int) -> I64:
    """Find the k nearest points of each center, nearest first.

    Args:
        coord: Positions [m or 1], shape (N, 3), float32.
        centers: Centers [m or 1], shape (M, 3), float32.
        count: Neighbors k; a center that is one of the points is its own first neighbor.

    Returns:
        Rows of `coord`, shape (M, count), int64.

    Raises:
        InputError: Fewer points than neighbors.
    """
    if len(coord) < count:
        raise InputError(
            "fewer points than neighbors",
            field="points",
            value=len(coord),
            allowed=f"{count} or more",
            hint="Use larger tiles or a smaller model",
        )
    _, found = KDTree(coord).query(centers, k=count)
    return np.array(found, dtype=np.int64).reshape(len(centers), count)
