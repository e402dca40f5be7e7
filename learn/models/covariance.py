"""Covariance features of neighborhoods at several scales, for a forest."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from learn.neighborhoods.trees import Trees

F32 = NDArray[np.float32]

NAMES = ("linearity", "planarity", "scatter", "curvature", "verticality", "spread", "rise", "above", "below")


def covariance_features(coord: F32, scales: Sequence[int]) -> F32:
    """Describe each point by the covariances of its nearest neighbors; a repeated point counts once.

    Draws of small pieces are filled up with repetitions, which would be the nearest neighbors of each other.

    Args:
        coord: Positions, z up [m or 1], shape (N, 3), float32.
        scales: Numbers of neighbors; limited to the number of different points.

    Returns:
        Features [m or 1], shape (N, 9 x scales + 1), float32: for each scale `NAMES`, then the height above the lowest
        point.

    Source: Weinmann et al., Semantic point cloud interpretation based on optimal neighborhoods, 2015, section 3.2.
    """
    different, copies = np.unique(coord, axis=0, return_inverse=True)
    return (
        _of_different(coord, scales)
        if len(different) == len(coord)
        else _of_different(different, scales)[copies.reshape(-1)]
    )


def _of_different(coord: F32, scales: Sequence[int]) -> F32:
    points = coord.astype(np.float64)
    rows = Trees().nearest(coord, coord, min(max(scales), len(coord)))
    columns = []
    for scale in scales:
        near = points[rows[:, :scale]]
        offset = near - near.mean(axis=1, keepdims=True)
        covariance = np.einsum("nki,nkj->nij", offset, offset) / near.shape[1]
        values, vectors = np.linalg.eigh(covariance)
        third, second, first = np.maximum(values, 0.0).T
        longest, total = np.maximum(first, 1e-12), np.maximum(first + second + third, 1e-12)
        heights = near[:, :, 2]
        columns += [
            (first - second) / longest,
            (second - third) / longest,
            third / longest,
            third / total,
            1.0 - np.abs(vectors[:, 2, 0]),
            np.sqrt(total),
            np.sqrt(np.maximum(covariance[:, 2, 2], 0.0)),
            heights.max(axis=1) - points[:, 2],
            points[:, 2] - heights.min(axis=1),
        ]
    columns.append(points[:, 2] - points[:, 2].min())
    return np.stack(columns, axis=1).astype(np.float32)
