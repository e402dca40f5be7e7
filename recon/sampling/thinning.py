"""Voxel thinning: keep one random point per cube, so that dense points are thinned and sparse ones kept."""

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


def one_in_each_cube(points: F64, size: float, ranks: F64) -> I64:
    """Keep the point of lowest rank in each cube of a grid through the origin.

    Thinning parts, and then their union, gives the same points as thinning the whole.

    Args:
        points: Positions [m], shape (N, 3), float64.
        size: Edge of the cubes [m].
        ranks: A random number for each point [1], shape (N,), float64.

    Returns:
        Rows of the points kept, ascending, shape (M,), int64.
    """
    cells = np.floor(points / size)
    order = np.lexsort((ranks, cells[:, 2], cells[:, 1], cells[:, 0]))
    ordered = cells[order]
    first = np.ones(len(order), bool)
    first[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    return np.sort(order[first])
