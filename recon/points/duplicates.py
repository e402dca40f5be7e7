"""Merging of duplicate points: a keypoint with several orientations starts several tracks with the same views."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from recon.sfm.colmap_model import SparseModel

I64 = NDArray[np.int64]

_SAME = 1e-9  # share of the model's extent below which only rounding differs


def merge_duplicates(model: SparseModel) -> tuple[SparseModel, I64]:
    """Merge all points at the same position, and all seen by the same cameras at the same keypoints.

    Args:
        model: Reconstruction.

    Returns:
        The model with the first of each set of equal points, in the same order, with the views of all, each once;
        number of points merged into each, shape (N,), int64.
    """
    count = len(model.points)
    if not count:
        return model, np.ones(0, np.int64)
    place, views = _by_place(model), _by_views(model)
    links = coo_matrix((np.ones(count, bool), (place, views + count)), shape=(2 * count, 2 * count))
    group = connected_components(links, directed=False)[1][place]
    kept = np.sort(np.unique(group, return_index=True)[1])
    alike = np.bincount(group)[group[kept]].astype(np.int64)
    if len(kept) == count:
        return model, alike
    renamed = np.zeros(2 * count, np.int64)
    renamed[group[kept]] = np.arange(len(kept))
    point = renamed[group][model.obs_point]
    seen = np.column_stack([point, model.obs_image, np.ascontiguousarray(model.obs_uv).view(np.int64)])
    once = np.sort(np.unique(seen, axis=0, return_index=True)[1])
    order = once[np.argsort(point[once], kind="stable")]
    merged = replace(
        model,
        points=model.points[kept],
        colors=model.colors[kept],
        errors=model.errors[kept],
        obs_point=point[order],
        obs_image=model.obs_image[order],
        obs_uv=model.obs_uv[order],
    )
    return merged, alike


def _by_place(model: SparseModel) -> I64:
    """Give points at the same position the same number, shape (P,)."""
    extent = max(float(np.ptp(np.quantile(model.points, [0.05, 0.95], axis=0), axis=0).max()), 1e-300)
    cells = np.round(model.points / (_SAME * extent))
    return np.unique(cells + 0.0, axis=0, return_inverse=True)[1].reshape(-1).astype(np.int64)


def _by_views(model: SparseModel) -> I64:
    """Give points of the same keypoints the same number, shape (P,): by the sum of hashes of the keypoints."""
    count = len(model.points)
    keys = np.column_stack([model.obs_image, np.ascontiguousarray(model.obs_uv).view(np.int64)])
    keypoint = np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1)
    lots = np.random.default_rng(0).integers(1, 2**63, (int(keypoint.max(initial=-1)) + 1, 2), np.uint64)
    sums = np.zeros((count, 2), np.uint64)
    np.add.at(sums, model.obs_point, lots[keypoint])
    return np.unique(sums, axis=0, return_inverse=True)[1].reshape(-1).astype(np.int64)
