"""Precision of a point's position, estimated from its rays, without truth."""

import numpy as np
from numpy.typing import NDArray

from recon.points.observations import Observations

F64 = NDArray[np.float64]

_CHUNK = 200_000  # observations at a time, of some 400 bytes each
_PRIOR_COUNT = 100  # weight of the prior of one pixel: a few points do not prove better keypoints
_COMMON = 6  # weight of the common variance beside a point's own residuals: a point of two views has only one residual
_SQUARE = 4.0 / np.pi  # mean square of distances over the square of their mean, if both axes have the same deviation
_SEVERAL = 3  # least number of views whose residuals check a position; two rays nearly always meet


def keypoint_noise(errors: F64, views: NDArray[np.int64]) -> F64:
    """Estimate the standard deviation of each point's keypoints from the residuals of all points and its own.

    A point of n views has 2n coordinates and 2n - 3 degrees of freedom. The residuals of all points give the common
    variance, and the more residuals a point has, the more they change it: a point with larger residuals is less
    precise.

    Source: Gelman et al., Bayesian Data Analysis, 3rd edition, section 2.6 (scaled inverse chi-squared prior).

    Args:
        errors: Mean distance between keypoints and reprojected point [px], shape (N,), float64.
        views: Cameras of each point, shape (N,), int64.

    Returns:
        Standard deviation of a keypoint along either axis [px], shape (N,), float64.
    """
    squares, freedom = _SQUARE * views * errors**2, np.maximum(2 * views - 3, 0)
    checked = views >= _SEVERAL
    common = (_PRIOR_COUNT + squares[checked].sum()) / (_PRIOR_COUNT + freedom[checked].sum())
    return np.sqrt((_COMMON * common + squares) / (_COMMON + freedom))


def deviations(points: F64, centers: F64, focal: float, seen: Observations) -> F64:
    """Propagate the keypoints' noise to each point's worst direction, mostly that of its rays.

    A keypoint error of one pixel moves its ray by d / f at the distance d; a ray constrains a point perpendicular to
    itself, not along. The information matrix of all rays is the sum of (f / d)^2 (I - u u^T); its smallest eigenvalue
    is that of the worst direction. Poses are assumed exact.

    Source: Hartley and Zisserman, Multiple View Geometry, 2nd edition, section 5.2.3 (backward propagation of
    covariance).

    Args:
        points: World positions [m], shape (N, 3), float64.
        centers: Camera centers by row of the capture [m], shape (K, 3), float64.
        focal: Focal length [px].
        seen: Observations of the points.

    Returns:
        Standard deviation if keypoints deviate by one pixel [m], shape (N,), float64; inf for parallel rays.
    """
    found = np.empty(len(points))
    first = 0
    while first < len(points):
        end = max(first + 1, int(np.searchsorted(seen.start, seen.start[first] + _CHUNK, "right")) - 1)
        found[first:end] = _of_some(points, centers, focal, seen, first, end)
        first = end
    return found


def _of_some(points: F64, centers: F64, focal: float, seen: Observations, first: int, end: int) -> F64:
    start = seen.start[first : end + 1]
    image, counts = seen.image[start[0] : start[-1]], np.diff(start)
    rays = np.repeat(points[first:end], counts, axis=0) - centers[image]
    square = np.einsum("ni,ni->n", rays, rays)[:, None, None]
    across = np.eye(3) - rays[:, :, None] * rays[:, None, :] / square
    information = np.add.reduceat(focal**2 / square * across, start[:-1] - start[0])
    least = np.linalg.eigvalsh(information)[:, 0]
    parallel = least <= 1e-12 * np.trace(information, axis1=1, axis2=2)
    return np.where(parallel, np.inf, 1.0 / np.sqrt(np.where(parallel, 1.0, least)))
