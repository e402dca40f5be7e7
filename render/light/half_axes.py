"""Irradiance as a function of a surface's normal: one value for each half axis of the world, and the mean.

A thin slab is lit on one side and dark on the other. Where one set of spherical harmonics would have to serve both
sides, opposite normals share none of these values but the mean, which does not count along an axis. For light of the
first two bands of spherical harmonics the result is the same. The shader reads as many texels as for those.
"""

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

HALF_AXES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], np.float64)
MEAN = 6  # place of the mean among the coefficients
COUNT = 7  # coefficients


def project(directions: F64, radiance: F32) -> F64:
    """Compute the irradiance of surfaces that face along each half axis, and its mean over all normals.

    Args:
        directions: Evenly distributed directions [1], shape (N, 3), float64.
        radiance: Radiance from each of them [1], shape (P, N, 3), float32.

    Returns:
        Coefficients [1], shape (P, 7, 3), float64.
    """
    cosine = np.maximum(directions @ HALF_AXES.T, 0.0)
    share = np.column_stack([cosine, np.ones(len(directions))])
    return np.einsum("nk,pnc->pkc", np.pi * share / share.sum(axis=0), radiance)


def weigh(normals: F64) -> tuple[I64, F64]:
    """List the coefficients that the irradiance of a surface consists of.

    Args:
        normals: Unit normals [1], shape (N, 3), float64.

    Returns:
        Numbers of the four coefficients, shape (N, 4), int64, and their weights [1], shape (N, 4), float64.
    """
    share = np.abs(normals)
    number = np.column_stack([(normals < 0) + np.array([0, 2, 4]), np.full(len(normals), MEAN)])
    return number, np.column_stack([share, 1.0 - share.sum(axis=1)])
