"""Estimation of the ground height below each part of a cloud, from its points only."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

F64 = NDArray[np.float64]

CELL = 5.0  # [m] wide enough to hold some ground beside a pier, narrow enough to follow a bank
_LOW = 0.05  # quantile of the heights in a cell: fewer points than that are stray ones below the ground
_LOWEST = 0.2  # quantile of the cells around a place: at least a fifth of them show the ground
_FEWEST = 8  # least number of points of a cell


@dataclass(frozen=True, eq=False)
class Ground:
    """Low heights on a grid.

    Attributes:
        places: Centers of the cells that hold enough points [m], shape (C, 2), float64.
        heights: A low height in each [m], shape (C,), float64.
        fallback: Height where no cell is near [m].
    """

    places: F64
    heights: F64
    fallback: float

    def below(self, places: F64, reach: float) -> F64:
        """Estimate the height of the ground at some places.

        Args:
            places: Horizontal positions [m], shape (P, 2), float64.
            reach: Distance within which cells are used [m].

        Returns:
            Heights [m], shape (P,), float64.
        """
        found = np.full(len(places), self.fallback)
        if len(self.places):
            for row, near in enumerate(KDTree(self.places).query_ball_point(places, reach)):
                if near:
                    found[row] = np.quantile(self.heights[near], _LOWEST)
        return found

    def heights_above(self, coord: F64, reach: float) -> F64:
        """Estimate the height of each point above the ground.

        The ground is estimated at the corners of the cells that hold points, and bilinear within each.

        Args:
            coord: Positions [m], shape (N, 3), float64, at least one.
            reach: Distance within which cells are used [m].

        Returns:
            Heights above the ground [m], shape (N,), float32.
        """
        place = coord[:, :2] / CELL
        cell = np.floor(place).astype(np.int64)
        low = cell.min(axis=0)
        width = int(np.ptp(cell[:, 1])) + 2
        cells, of_point = np.unique((cell - low) @ np.array([width, 1]), return_inverse=True)
        corner = cells[:, None] + np.array([0, 1, width, width + 1])
        keys = np.unique(corner)
        heights = self.below((np.stack([keys // width, keys % width], axis=1) + low) * CELL, reach)
        at = heights[np.searchsorted(keys, corner)][of_point]
        s, t = (place - cell).T
        ground = (1.0 - s) * ((1.0 - t) * at[:, 0] + t * at[:, 1]) + s * ((1.0 - t) * at[:, 2] + t * at[:, 3])
        return (coord[:, 2] - ground).astype(np.float32)


def estimate_ground(coord: F64) -> Ground:
    """Take a low quantile of the heights in every cell.

    Args:
        coord: Positions, evenly thinned [m], shape (N, 3), float64, z up, at least one.
    """
    cell = np.floor(coord[:, :2] / CELL).astype(np.int64)
    low = cell.min(axis=0)
    key = (cell[:, 0] - low[0]) * (int(np.ptp(cell[:, 1])) + 1) + cell[:, 1] - low[1]
    order = np.lexsort((coord[:, 2], key))
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    count = np.diff(np.append(first, len(order)))
    kept = count >= _FEWEST
    rows = order[first[kept] + (_LOW * count[kept]).astype(np.int64)]
    fallback = float(np.quantile(coord[:, 2], _LOW))
    return Ground((cell[rows].astype(np.float64) + 0.5) * CELL, coord[rows, 2], fallback)
