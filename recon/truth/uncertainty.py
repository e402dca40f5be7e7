"""Errors of each point, measured in three ways against the truth of the images that saw it."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recon.points.observations import Observations, median_per_point
from render.capture import Truth

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


@dataclass(frozen=True)
class Uncertainty:
    """Errors of each point; +inf where the truth is sky.

    Attributes:
        median: Median over its views of the depth error [m], shape (N,), float64.
        least: Smallest depth error [m], shape (N,), float64.
        greatest: Largest depth error [m], shape (N,), float64.
        relative: Median of depth error over reconstructed depth [1], shape (N,), float64.
        displacement: Median distance to the surface point that the true camera sees at the keypoint [m], shape (N,),
            float64.
    """

    median: F64
    least: F64
    greatest: F64
    relative: F64
    displacement: F64


def depths(points: F64, poses: F64, observations: Observations) -> F64:
    """Compute the planar depth of each observed point in the image that saw it.

    Args:
        points: World positions [m], shape (N, 3), float64.
        poses: camera_to_world of every image of the capture [m], shape (K, 4, 4), float64.
        observations: The images that saw each point.

    Returns:
        Depths [m], shape (M,), float64.
    """
    centers, forward = np.ascontiguousarray(poses[:, :3, 3]), np.ascontiguousarray(poses[:, :3, 2])
    return _depths(points, observations.start, observations.image, centers, forward)


@njit(cache=True, nogil=True)
def _depths(points: F64, start: I64, image: I64, centers: F64, forward: F64) -> F64:
    depth = np.empty(len(image))
    for point in range(len(start) - 1):
        for row in range(start[point], start[point + 1]):
            there, along, planar = centers[image[row]], forward[image[row]], 0.0
            for axis in range(3):
                planar += (points[point, axis] - there[axis]) * along[axis]
            depth[row] = planar
    return depth


def measure(
    points: F64, depth: F64, true_depth: F64, truth: Truth, observations: Observations, threads: int = 1
) -> tuple[F64, Uncertainty]:
    """Compare each observation with the truth.

    The depth error compares the reconstructed depth, in the aligned reconstructed pose, as in the paper: it is zero for
    a camera that drifted together with its points. The displacement uses the true pose, and shows the drift.

    Args:
        points: World positions [m], shape (N, 3), float64.
        depth: Reconstructed depth of each observation [m], shape (M,), float64.
        true_depth: True depth at its keypoint's pixel [m], shape (M,), float64, +inf for sky.
        truth: True cameras, including lens distortion and rolling shutter.
        observations: The images that saw each point.
        threads: How many images are compared at a time.

    Returns:
        Depth error of each observation [m], shape (M,), float64, and the errors of each point.
    """
    error = np.abs(true_depth - depth)
    sky = ~np.isfinite(true_depth)
    away = np.full(len(error), np.inf)
    point = observations.point

    def compare(image: int, rows: I64) -> None:
        seen = rows[~sky[rows]]
        surface = truth.surface_points(image, observations.uv[seen], true_depth[seen])
        surface -= points[point[seen]]
        away[seen] = np.sqrt(np.einsum("nk,nk->n", surface, surface))

    observations.for_each_image(compare, threads)
    first = observations.start[:-1]
    none = np.zeros(0)
    return error, Uncertainty(
        median=median_per_point(error, observations),
        least=np.minimum.reduceat(error, first) if len(first) else none,
        greatest=np.maximum.reduceat(error, first) if len(first) else none,
        relative=median_per_point(error / depth, observations),
        displacement=median_per_point(away, observations),
    )
