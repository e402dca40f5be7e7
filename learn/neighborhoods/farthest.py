"""Farthest point sampling: a subset in which every next point is the one farthest from those before it."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from groundwork.errors import InputError

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


def need_points(points: int, least: int) -> None:
    """Refuse a cloud that is too small for a network.

    Args:
        points: Number of its points [1].
        least: Number that the network needs [1].

    Raises:
        InputError: It has fewer.
    """
    if points < least:
        raise InputError(
            "too few points for this network",
            field="points",
            value=points,
            allowed=f"{least} or more",
            hint="Use larger tiles or a smaller model",
        )


def farthest_points(coord: F32, count: int) -> I64:
    """Choose points by farthest point sampling, always starting at point 0.

    The first point is fixed because a random one changes the score of a trained network as much as another training
    seed does. Distances are float64 and ties go to the lower index, so that every machine chooses the same points.

    Args:
        coord: Positions [m or 1], shape (N, 3), float32.
        count: Points to choose, 1 to N.

    Returns:
        Rows of the chosen points in the order of choice, shape (count,), int64.

    Raises:
        InputError: Fewer than `count` points.

    Source: Eldar et al., The farthest point strategy for progressive image sampling, 1997; PointNet++, section 3.2.
    """
    need_points(len(coord), max(count, 1))
    columns = np.ascontiguousarray(coord.T, dtype=np.float64)
    return _choose(columns[0], columns[1], columns[2], count)


@njit(cache=True)
def _choose(x: F64, y: F64, z: F64, count: int) -> I64:
    nearest = np.full(len(x), np.inf)
    chosen = np.zeros(count, np.int64)
    last = 0
    for step in range(1, count):
        best, best_distance = 0, -1.0
        for i in range(len(x)):
            dx, dy, dz = x[i] - x[last], y[i] - y[last], z[i] - z[last]
            distance = dx * dx + dy * dy + dz * dz
            if distance < nearest[i]:
                nearest[i] = distance
            if nearest[i] > best_distance:
                best, best_distance = i, nearest[i]
        last = best
        chosen[step] = best
    return chosen
