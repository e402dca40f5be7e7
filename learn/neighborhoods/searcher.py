"""Interface of what searches neighborhoods: `Trees` on the processor, cloud by cloud, or `Batches` with torch."""

from typing import Any, Protocol, TypeVar

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
        """Find the points within a ball about each center, nearest first.

        If a ball holds more than `count` points, the nearest are kept. (The published code keeps those with the lowest
        indices, which depend on the order of the file.) If it holds fewer, the row is filled up with its first entry,
        as published: repeats do not change a maximum over the row.

        Args:
            coord: Positions [m or 1], shape (N, 3) or (B, N, 3), float32.
            centers: Centers [m or 1], shape (M, 3) or (B, M, 3), float32.
            radius: Of the balls, points on the surface included [m or 1].
            count: Entries of a row.

        Returns:
            Rows of `coord`, shape (M, count) or (B, M, count); for an empty ball the nearest point, repeated.
        """
        ...

    def nearest(self, coord: Points, centers: Points, count: int) -> Rows:
        """Find the k nearest points of each center, nearest first.

        Args:
            coord: Positions [m or 1], shape (N, 3) or (B, N, 3), float32.
            centers: Centers [m or 1], shape (M, 3) or (B, M, 3), float32.
            count: Neighbors k; a center that is one of the points is its own first neighbor.

        Returns:
            Rows of `coord`, shape (M, count) or (B, M, count).

        Raises:
            InputError: Fewer points than neighbors.
        """
        ...
