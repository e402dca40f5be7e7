"""Which image saw which point where: observations in CSR order, and reductions of their values to points."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.colmap_model import SparseModel

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


@dataclass(frozen=True)
class Observations:
    """Observations sorted by point; every point has one at least.

    Attributes:
        start: First observation of each point and the end, shape (N + 1,), int64.
        image: Row of the image in the capture, shape (M,), int64.
        uv: Keypoint [px], shape (M, 2), float64, pixel centres at +0.5.
    """

    start: I64
    image: I64
    uv: F64

    @property
    def counts(self) -> I64:
        """Number of observations of each point, shape (N,), int64."""
        return np.diff(self.start)

    @property
    def point(self) -> I64:
        """Point of each observation, shape (M,), int64."""
        return np.repeat(np.arange(len(self.start) - 1), self.counts)

    @property
    def pixel(self) -> I64:
        """Column and row of the pixel that holds each keypoint, shape (M, 2), int64."""
        return np.floor(self.uv).astype(np.int64)


def select_points(
    model: SparseModel, rows: I64, valid: NDArray[np.bool_], max_error: float, min_views: int
) -> tuple[NDArray[np.bool_], Observations]:
    """Keep the points that enough valid cameras saw well.

    Args:
        model: Reconstruction.
        rows: Row in the capture of each image of the model, shape (I,), int64.
        valid: Whether a camera of the capture is valid, shape (K,), bool.
        max_error: Largest mean reprojection error of a point [px].
        min_views: Valid observations that a point needs.

    Returns:
        Which points of the model stay, shape (P,), bool, and the valid observations of those.
    """
    image = rows[model.obs_image]
    counted = valid[image]
    views = np.bincount(model.obs_point[counted], minlength=len(model.points))
    kept = (views >= min_views) & (model.errors <= max_error)
    chosen = counted & kept[model.obs_point]
    start = np.concatenate([[0], np.cumsum(views[kept])]).astype(np.int64)
    return kept, Observations(start, image[chosen], model.obs_uv[chosen])


def median_per_point(values: F64, observations: Observations) -> F64:
    """Take the median of each point's values; of an even number, the mean of the middle two.

    Args:
        values: One value per observation, shape (M,), float64; may be +inf.
        observations: Their points.

    Returns:
        Medians, shape (N,), float64.
    """
    ordered = values[np.lexsort((values, observations.point))]
    first, counts = observations.start[:-1], observations.counts
    return 0.5 * (ordered[first + (counts - 1) // 2] + ordered[first + counts // 2])
