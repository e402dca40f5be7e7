"""Observations of points in images, in CSR order, and reductions of their values to points."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.dense.points import DensePoints
from recon.sfm.colmap_model import SparseModel

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


@dataclass(frozen=True)
class Observations:
    """Observations sorted by point; every point has at least one.

    Attributes:
        start: First observation of each point and the end, shape (N + 1,), int64.
        image: Row of the image in the capture, shape (M,), int64.
        uv: Keypoint [px], shape (M, 2), float64, pixel centers at +0.5.
    """

    start: I64
    image: I64
    uv: F64

    @property
    def counts(self) -> I64:
        """Count the observations of each point, shape (N,), int64."""
        return np.diff(self.start)

    @property
    def point(self) -> I64:
        """Return the point of each observation, shape (M,), int64."""
        return np.repeat(np.arange(len(self.start) - 1), self.counts)

    def of(self, points: NDArray[np.bool_]) -> "Observations":
        """Select the observations of some points.

        Args:
            points: Which, shape (N,), bool.
        """
        chosen = np.repeat(points, self.counts)
        start = np.concatenate([[0], np.cumsum(self.counts[points])]).astype(np.int64)
        return Observations(start, self.image[chosen], self.uv[chosen])

    def once(self) -> "Observations":
        """Keep the first observation of each point and image: a track may hold two keypoints of one image."""
        points = self.point
        order = np.lexsort((self.image, points))
        image, point = self.image[order], points[order]
        repeated = np.zeros(len(order), bool)
        repeated[1:] = (np.diff(image) == 0) & (np.diff(point) == 0)
        chosen = np.ones(len(order), bool)
        chosen[order[repeated]] = False
        start = np.concatenate([[0], np.cumsum(np.bincount(points[chosen], minlength=len(self.counts)))])
        return Observations(start.astype(np.int64), self.image[chosen], self.uv[chosen])

    @cached_property
    def by_image(self) -> list[tuple[int, I64]]:
        """List the images in ascending order, each with the rows of its observations, ascending, shape (n,), int64."""
        short = self.image.astype(np.uint16 if self.image.max(initial=0) < 2**16 else np.int64)  # radix sort
        order = np.argsort(short, kind="stable")
        groups = np.split(order, np.flatnonzero(np.diff(short[order])) + 1)
        return [(int(self.image[rows[0]]), rows) for rows in groups if len(rows)]

    def for_each_image(self, work: Callable[[int, I64], None], threads: int) -> None:
        """Call a function for the observations of each image, several images in parallel.

        Args:
            work: Takes an image and the rows of its observations, and changes values of these rows only.
            threads: Number of threads.

        Raises:
            Exception: What `work` raised for the first image in order.
        """
        with ThreadPoolExecutor(threads) as pool:
            for done in [pool.submit(work, image, rows) for image, rows in self.by_image]:
                done.result()

    @property
    def pixel(self) -> I64:
        """Return column and row of the pixel of each keypoint, shape (M, 2), int64."""
        return np.floor(self.uv).astype(np.int64)


def select_points(
    model: SparseModel, rows: I64, valid: NDArray[np.bool_], max_error: float, min_views: int
) -> tuple[NDArray[np.bool_], Observations]:
    """Select the points that enough valid cameras saw with a small reprojection error.

    Args:
        model: Reconstruction.
        rows: Row in the capture of each image of the model, shape (I,), int64.
        valid: Whether a camera of the capture is valid, shape (K,), bool.
        max_error: Largest mean reprojection error of a point [px].
        min_views: Valid observations that a point needs.

    Returns:
        Which points of the model are kept, shape (P,), bool, and the valid observations of those.
    """
    image = rows[model.obs_image]
    counted = valid[image]
    views = np.bincount(model.obs_point[counted], minlength=len(model.points))
    kept = (views >= min_views) & (model.errors <= max_error)
    chosen = counted & kept[model.obs_point]
    start = np.concatenate([[0], np.cumsum(views[kept])]).astype(np.int64)
    return kept, Observations(start, image[chosen], model.obs_uv[chosen])


def select_dense(
    points: DensePoints, rows: I64, valid: NDArray[np.bool_], min_views: int
) -> tuple[NDArray[np.bool_], Observations]:
    """Select the dense points that enough valid cameras contributed to.

    Args:
        points: Dense points.
        rows: Row in the capture of each image of the model, shape (I,), int64.
        valid: Whether a camera of the capture is valid, shape (K,), bool.
        min_views: Valid views that a point needs.

    Returns:
        Which points are kept, shape (N,), bool, and the valid observations of those.
    """
    image = rows[points.image]
    point = np.repeat(np.arange(len(points.counts)), points.counts)
    counted = valid[image]
    views = np.bincount(point[counted], minlength=len(points.counts))
    kept = views >= min_views
    chosen = counted & kept[point]
    start = np.concatenate([[0], np.cumsum(views[kept])]).astype(np.int64)
    return kept, Observations(start, image[chosen], points.uv[chosen].astype(np.float64))


def median_per_point(values: F64, observations: Observations) -> F64:
    """Compute the median of each point's values; of an even number, the mean of the middle two.

    Args:
        values: One value per observation [any unit], shape (M,), float64; may be +inf.
        observations: The observations, which name their points.

    Returns:
        Medians [any unit], shape (N,), float64.
    """
    return _medians(values, observations.start, np.empty(observations.counts.max(initial=0)))


@njit(cache=True, nogil=True)
def _medians(values: F64, start: I64, ordered: F64) -> F64:
    """Sort by insertion into `ordered`, which has room for the most values of a point: a point has few.

    What NumPy does in one call takes Numba seconds to compile, so there is none here.
    """
    result = np.empty(len(start) - 1)
    for point in range(len(result)):
        count = start[point + 1] - start[point]
        for at in range(count):
            value, hole = values[start[point] + at], at
            while hole > 0 and ordered[hole - 1] > value:
                ordered[hole] = ordered[hole - 1]
                hole -= 1
            ordered[hole] = value
        result[point] = 0.5 * (ordered[(count - 1) // 2] + ordered[count // 2])
    return result
