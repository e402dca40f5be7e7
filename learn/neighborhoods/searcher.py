"""What searches neighborhoods: the processor, cloud by cloud, or torch, a batch at a time on any device."""

from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from learn.neighborhoods.farthest import farthest_points
from learn.neighborhoods.search import ball_query, nearest

F32 = NDArray[np.float32]
I32 = NDArray[np.int32]

Points = TypeVar("Points")
"""Positions [m or 1]: an array, shape (N, 3), or a tensor, shape (B, N, 3); float32."""
Rows = TypeVar("Rows", covariant=True)
"""Row numbers of points: an array, shape (M,) or (M, K), int32; or a tensor, shape (B, M) or (B, M, K), int64."""


class Searcher(Protocol[Points, Rows]):
    """A way to search the neighborhoods of clouds; all ways find the same rows, except among equal distances."""

    def count(self, coord: Points) -> int:
        """Count the points of a cloud.

        Args:
            coord: Positions [m or 1], shape (N, 3) or (B, N, 3), float32.
        """
        ...

    def take(self, coord: Points, rows: Any) -> Points:
        """Take some points of each cloud.

        Args:
            coord: Positions [m or 1], shape (N, 3) or (B, N, 3), float32.
            rows: Their row numbers, shape (M,) or (B, M).

        Returns:
            Their positions [m or 1], shape (M, 3) or (B, M, 3), float32.
        """
        ...

    def first(self, coord: Points, count: int) -> Rows:
        """Number the first points of each cloud.

        Args:
            coord: Positions [m or 1], shape (N, 3) or (B, N, 3), float32.
            count: How many.
        """
        ...

    def shuffled(self, coord: Points, count: int, seed: int) -> Rows:
        """Choose random points, the same rows in every cloud of N points.

        Args:
            coord: Positions [m or 1], shape (N, 3) or (B, N, 3), float32.
            count: How many.
            seed: Seed of the choice.
        """
        ...

    def farthest(self, coord: Points, count: int) -> Rows:
        """Choose points by `learn.neighborhoods.farthest.farthest_points`.

        Args:
            coord: Positions [m or 1], shape (N, 3) or (B, N, 3), float32.
            count: How many.
        """
        ...

    def ball(self, coord: Points, centers: Points, radius: float, count: int) -> Rows:
        """Search as `learn.neighborhoods.search.ball_query`.

        Args:
            coord: Positions [m or 1], shape (N, 3) or (B, N, 3), float32.
            centers: Centers [m or 1], shape (M, 3) or (B, M, 3), float32.
            radius: Of the balls [m or 1].
            count: Entries of a row.
        """
        ...

    def nearest(self, coord: Points, centers: Points, count: int) -> Rows:
        """Search as `learn.neighborhoods.search.nearest`.

        Args:
            coord: Positions [m or 1], shape (N, 3) or (B, N, 3), float32.
            centers: Centers [m or 1], shape (M, 3) or (B, M, 3), float32.
            count: Neighbors of each.
        """
        ...


@dataclass(frozen=True)
class OneCloud:
    """Searches in one cloud at a time, with trees, on the processor; a `Searcher`."""

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
        """Find the points within balls.

        Args:
            coord: Positions [m or 1], shape (N, 3), float32.
            centers: Centers [m or 1], shape (M, 3), float32.
            radius: Of the balls [m or 1].
            count: Entries of a row.

        Returns:
            Row numbers, shape (M, count), int32.
        """
        return ball_query(coord, centers, radius, count).astype(np.int32)

    def nearest(self, coord: F32, centers: F32, count: int) -> I32:
        """Find the nearest points.

        Args:
            coord: Positions [m or 1], shape (N, 3), float32.
            centers: Centers [m or 1], shape (M, 3), float32.
            count: Neighbors of each.

        Returns:
            Row numbers, shape (M, count), int32.
        """
        return nearest(coord, centers, count).astype(np.int32)
