"""How sure the place of a point is, told from its rays alone: no truth is needed."""

import numpy as np
from numpy.typing import NDArray

from recon.points.observations import Observations

F64 = NDArray[np.float64]

_CHUNK = 200_000  # observations, of some 400 bytes each
_PRIOR_COUNT = 100  # numbers that say one pixel before any point has: a handful of points proves no better keypoints
_COMMON = 6  # numbers that all points together are worth beside a point's own: a point of two views has but one
_SQUARE = 4.0 / np.pi  # mean square of distances over the square of their mean, where both axes deviate alike
_SEVERAL = 3  # views from which on a point's residuals check its place; two rays always nearly meet


def keypoint_noise(errors: F64, views: NDArray[np.int64]) -> F64:
    """Tell how far the keypoints of each point deviate: from what all points leave over, and what it leaves itself.

    A point of n views leaves 2n - 3 numbers of its 2n. Those of all points give the common variance, and a point's own
    move it as far as they are many: who matches worse than others is less sure than others.

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
    """Tell how far the keypoints' noise spreads each point along its worst direction, mostly that of its rays.

    A keypoint that is off by one pixel moves its ray by d / f at the distance d; rays hold a point across
    themselves, never along. The information of all rays is the sum of (f / d)^2 (I - u u^T), and the least of its
    eigenvalues is that of the worst direction. Poses are taken as known.

    Source: Hartley and Zisserman, Multiple View Geometry, 2nd edition, section 5.2.3 (backward propagation of
    covariance).

    Args:
        points: World positions [m], shape (N, 3), float64.
        centers: Camera centres by row of the capture [m], shape (K, 3), float64.
        focal: Focal length [px].
        seen: Who saw the points.

    Returns:
        Standard deviation for keypoints that deviate by one pixel [m], shape (N,), float64; inf on parallel rays.
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
