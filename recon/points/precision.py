"""How sure the place of a point is, told from its rays alone: no truth is needed."""

import numpy as np
from numpy.typing import NDArray

from recon.points.observations import Observations

F64 = NDArray[np.float64]

_CHUNK = 200_000  # observations, of some 400 bytes each


def deviations(points: F64, centres: F64, focal: float, seen: Observations) -> F64:
    """Tell how far the keypoints' noise spreads each point along its worst direction, mostly that of its rays.

    A keypoint that is off by one pixel moves its ray by d / f at the distance d; rays hold a point across
    themselves, never along. The information of all rays is the sum of (f / d)^2 (I - u u^T), and the least of its
    eigenvalues is that of the worst direction. Poses are taken as known.

    Source: Hartley and Zisserman, Multiple View Geometry, 2nd edition, section 5.2.3 (backward propagation of
    covariance).

    Args:
        points: World positions [m], shape (N, 3), float64.
        centres: Camera centres by row of the capture [m], shape (K, 3), float64.
        focal: Focal length [px].
        seen: Who saw the points.

    Returns:
        Standard deviation for keypoints that deviate by one pixel [m], shape (N,), float64; inf on parallel rays.
    """
    found = np.empty(len(points))
    first = 0
    while first < len(points):
        end = max(first + 1, int(np.searchsorted(seen.start, seen.start[first] + _CHUNK, "right")) - 1)
        found[first:end] = _of_some(points, centres, focal, seen, first, end)
        first = end
    return found


def _of_some(points: F64, centres: F64, focal: float, seen: Observations, first: int, end: int) -> F64:
    start = seen.start[first : end + 1]
    image, counts = seen.image[start[0] : start[-1]], np.diff(start)
    rays = np.repeat(points[first:end], counts, axis=0) - centres[image]
    square = np.einsum("ni,ni->n", rays, rays)[:, None, None]
    across = np.eye(3) - rays[:, :, None] * rays[:, None, :] / square
    information = np.add.reduceat(focal**2 / square * across, start[:-1] - start[0])
    least = np.linalg.eigvalsh(information)[:, 0]
    parallel = least <= 1e-12 * np.trace(information, axis1=1, axis2=2)
    return np.where(parallel, np.inf, 1.0 / np.sqrt(np.where(parallel, 1.0, least)))
