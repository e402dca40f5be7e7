"""Neighborhoods of one cloud at a time, with trees on the processor."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from learn.neighborhoods.farthest import farthest_points, need_points

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]


@dataclass(frozen=True)
class Trees:
    """Searches in one cloud at a time; a `learn.neighborhoods.searcher.Searcher`."""

    def count(self, coord: F32) -> int:
        """Count the points of a cloud.

        Args:
            coord: Positions [m or 1], shape (N, 3), float32.
        """
        return len(coord)

    def take(self, coord: F32, rows: I32) -> F32:
        """Take some points.

        Args:
            coord: Positions [m or 1], shape (N, 3), float32.
            rows: Their row numbers, shape (M,), int32.

        Returns:
            Their positions [m or 1], shape (M, 3), float32.
        """
        return coord[rows]

    def first(self, coord: F32, count: int) -> I32:
        """Number the first points.

        Args:
            coord: Positions [m or 1], shape (N, 3), float32.
            count: How many.

        Returns:
            Row numbers, shape (count,), int32.
        """
        return np.arange(min(count, len(coord)), dtype=np.int32)

    def shuffled(self, coord: F32, count: int, seed: int) -> I32:
        """Choose random points.

        Args:
            coord: Positions [m or 1], shape (N, 3), float32.
            count: How many.
            seed: Seed of the choice.

        Returns:
            Row numbers, shape (count,), int32.
        """
        return np.random.default_rng([seed, len(coord)]).permutation(len(coord))[:count].astype(np.int32)

    def farthest(self, coord: F32, count: int) -> I32:
        """Choose points by farthest point sampling.

        Args:
            coord: Positions [m or 1], shape (N, 3), float32.
            count: How many.

        Returns:
            Row numbers, shape (count,), int32.
        """
        return farthest_points(coord, count).astype(np.int32)

    def ball(self, coord: F32, centers: F32, radius: float, count: int) -> I32:
        """Find the points within a ball about each center, nearest first; missing ones are the first one again.

        Args:
            coord: Positions [m or 1], shape (N, 3), float32.
            centers: Centers [m or 1], shape (M, 3), float32.
            radius: Of the balls, points on the surface included [m or 1].
            count: Entries of a row.

        Returns:
            Rows of `coord`, shape (M, count), int32; for an empty ball the nearest point, repeated.
        """
        tree = KDTree(coord)
        bound = float(np.nextafter(radius, np.inf))
        _, found = tree.query(centers, k=count, distance_upper_bound=bound)
        rows = np.array(found, dtype=np.int32).reshape(len(centers), count)  # scipy drops the axis of a single neighbor
        empty = rows[:, 0] == len(coord)
        if empty.any():
            rows[empty, 0] = tree.query(centers[empty], k=1)[1]
        return np.where(rows == len(coord), rows[:, :1], rows)

    def nearest(self, coord: F32, centers: F32, count: int) -> I32:
        """Find the k nearest points of each center, nearest first.

        Args:
            coord: Positions [m or 1], shape (N, 3), float32.
            centers: Centers [m or 1], shape (M, 3), float32.
            count: Neighbors k; a center that is one of the points is its own first neighbor.

        Returns:
            Rows of `coord`, shape (M, count), int32.

        Raises:
            InputError: Fewer points than neighbors.
        """
        need_points(len(coord), count)
        _, found = KDTree(coord).query(centers, k=count)
        return np.array(found, dtype=np.int32).reshape(len(centers), count)
