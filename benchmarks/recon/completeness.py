"""Completeness of a cloud: samples of the true surface that the cameras saw, and the nearest point to each."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from render.capture import Truth

F64 = NDArray[np.float64]

_STRIDE = 4  # [px] every fourth pixel of each image is a sample
_CELL = 0.1  # [m] one sample per cell, so that surfaces that fill the images do not dominate the figures
_SAME = 0.02  # [1] a camera sees a sample whose depth differs from its true depth image by no more than this share


@dataclass(frozen=True)
class Completeness:
    """Share of the surface that a cloud covers, and the accuracy of its points.

    Attributes:
        samples: Samples of the true surface that count.
        share: Share of them with a point within the reach [1].
        median: Median distance of the cloud's near points to the true surface [m].
        points: Number of those points.
    """

    samples: int
    share: float
    median: float
    points: int


def visible_surface(truth: Truth, far: float, min_views: int) -> tuple[F64, NDArray[np.uint8]]:
    """Sample the true surface that several cameras see from a short distance.

    Args:
        truth: True depth and label images.
        far: Largest depth in a camera that counts [m].
        min_views: Cameras that must see a sample no farther away than that.

    Returns:
        World positions [m], shape (N, 3), float64, one in each cell of 0.1 m, and their class ids, shape (N,), uint8.
    """
    camera = truth.camera
    column, row = np.meshgrid(
        np.arange(_STRIDE // 2, camera.width, _STRIDE), np.arange(_STRIDE // 2, camera.height, _STRIDE)
    )
    places, labels = [], []
    for image in range(len(truth.names)):
        depth, semantic = truth.depth(image)[row, column], truth.semantic(image)[row, column]
        near = depth <= far
        pixels = np.column_stack([column[near], row[near]]).astype(np.float64) + 0.5
        places.append(truth.surface_points(image, pixels, depth[near].astype(np.float64)))
        labels.append(semantic[near])
    points, classes = np.concatenate(places), np.concatenate(labels)
    _, first = np.unique(np.floor(points / _CELL).astype(np.int64), axis=0, return_index=True)
    points, classes = points[np.sort(first)], classes[np.sort(first)]
    seen = count_cameras(points, truth, far) >= min_views
    return points[seen], classes[seen]


def count_cameras(points: F64, truth: Truth, far: float) -> NDArray[np.int64]:
    """Count the cameras that see points from a short distance.

    Args:
        points: World positions on the true surface [m], shape (N, 3), float64.
        truth: True depth images.
        far: Largest depth that counts [m].

    Returns:
        Cameras of each point, shape (N,), int64.
    """
    camera, counts = truth.camera, np.zeros(len(points), np.int64)
    for image, pose in enumerate(truth.poses):
        local = (points - pose[:3, 3]) @ pose[:3, :3]
        front = np.flatnonzero((local[:, 2] > 0.0) & (local[:, 2] <= far))
        straight = local[front, :2] / local[front, 2:]
        front, straight = front[(abs(straight) < 2.0).all(axis=1)], straight[(abs(straight) < 2.0).all(axis=1)]
        column, row = (
            np.floor(truth.distortion.distort(straight) * [camera.fx, camera.fy] + [camera.cx, camera.cy])
            .astype(np.int64)
            .T
        )
        inside = (column >= 0) & (column < camera.width) & (row >= 0) & (row < camera.height)
        there = truth.depth(image)[row[inside], column[inside]]
        depth = local[front[inside], 2]
        counts[front[inside][abs(there - depth) <= _SAME * depth]] += 1
    return counts


def measure_completeness(
    points: F64, surface_distance: NDArray[np.float32], nearest_depth: F64, samples: F64, reach: float, far: float
) -> Completeness:
    """Compare a cloud with the surface that it should show.

    Args:
        points: World positions of the cloud [m], shape (N, 3), float64.
        surface_distance: Their distance to the true surface [m], shape (N,), float32.
        nearest_depth: Smallest depth of each in the views that made it [m], shape (N,), float64.
        samples: World positions of the surface [m], shape (M, 3), float64.
        reach: Distance within which a point covers a sample [m].
        far: Depth up to which a point counts as near [m].

    Returns:
        The comparison.
    """
    distance, _ = KDTree(points).query(samples, distance_upper_bound=reach)
    near = surface_distance[nearest_depth <= far]
    return Completeness(
        len(samples), float(np.mean(np.isfinite(distance))), float(np.median(near)) if len(near) else np.nan, len(near)
    )
