"""One point left in each cube, chosen at random: thins the many points near a scanner and keeps the few far away."""

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


def one_in_each_cube(points: F64, size: float, ranks: F64) -> I64:
    """Choose of the points of each cube the one of lowest rank; cubes are those of a grid through the origin.

    What is chosen of several parts and then of what was chosen is what would be chosen of the whole at once.

    Args:
        points: Positions [m], shape (N, 3), float64.
        size: Edge of the cubes [m].
        ranks: A number for each point, drawn at random [1], shape (N,), float64.

    Returns:
        Rows of the points that stay, ascending, shape (M,), int64.
    """
    cells = np.floor(points / size)
    order = np.lexsort((ranks, cells[:, 2], cells[:, 1], cells[:, 0]))
    ordered = cells[order]
    first = np.ones(len(order), bool)
    first[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    return np.sort(order[first])
