"""Choice of the source images and the depth range of each view, from sparse points and poses."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.dense.rectify import rectify
from recon.settings import DenseSettings
from recon.sfm.colmap_model import SparseModel
from usd_schemas.pinhole import Pinhole

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_MIN_SHARED = 12  # least number of points that two images must share
_BEST_ANGLE = 8.0  # [deg] wide enough for depth, narrow enough to look alike
_NEAR_PERCENTILE, _FAR_PERCENTILE = 0.5, 99.5
_NEAR_SLACK, _FAR_SLACK = 0.75, 3.0  # factors: surfaces without features may be nearer or farther
_ALIKE = 0.4  # factor for the weight of a view next to one already chosen [1]


@dataclass(frozen=True)
class View:
    """Source images and depth range of one image.

    Attributes:
        row: Row in the model.
        sources: Rows of the images that share its view, best first, shape (S,), int64.
        near: Smallest depth that is searched [model units].
        far: Largest depth that is searched [model units].
    """

    row: int
    sources: I64
    near: float
    far: float


def choose_views(model: SparseModel, settings: DenseSettings) -> tuple[View, ...]:
    """Choose for every image its neighbors and its range of depths.

    A pair is scored by the sparse points that both images see, each weighted by the angle between its two rays: with a
    small angle the depth is inexact, with a large one the images look too different to match.

    Args:
        model: Reconstruction.
        settings: Limits of the angle, number of neighbors.

    Returns:
        One view for each image of the model; without sources where no other image shares enough.
    """
    score = covisibility(model, settings)
    depth = np.einsum(
        "mi,mi->m",
        model.points[model.obs_point] - model.poses[model.obs_image, :3, 3],
        model.poses[model.obs_image, :3, 2],
    )
    views = []
    for row in range(len(model.names)):
        mine = depth[(model.obs_image == row) & (depth > 0)]
        if len(mine) < _MIN_SHARED:
            views.append(View(row, np.zeros(0, np.int64), 0.0, 0.0))
            continue
        near, far = np.percentile(mine, [_NEAR_PERCENTILE, _FAR_PERCENTILE])
        sources = _spread_out(score[row], model.poses[:, :3, 3], row, settings.fusion_neighbours)
        views.append(View(row, sources, float(near * _NEAR_SLACK), float(far * _FAR_SLACK)))
    return tuple(views)


def choose_sources(view: View, poses: F64, camera: Pinhole, wanted: int) -> tuple[int, ...]:
    """Choose the source images of a depth map.

    If the camera moved partly forwards or backwards, only the part of the image beside its path can be rectified. Such
    a pair counts only for that share, so that a view whose neighbors all lie ahead is matched with more of them.

    Args:
        view: The view and its neighbors.
        poses: camera_to_world [model units] of every image, shape (I, 4, 4), float64.
        camera: Working camera of all of them.
        wanted: Sum of shares to reach; at most twice as many images are taken.

    Returns:
        Rows of the images, best first; fewer where there are no more neighbors.
    """
    chosen: list[int] = []
    share = 0.0
    for source in view.sources:
        if share >= wanted or len(chosen) >= 2 * wanted:
            break
        pair = rectify(camera, poses[view.row], poses[source], view.near, view.far)
        if pair is not None:
            chosen.append(int(source))
            share += pair.share
    return tuple(chosen)


def covisibility(model: SparseModel, settings: DenseSettings) -> F64:
    """Score pairs of images by their common sparse points, weighted by the angle between the rays.

    Args:
        model: Reconstruction.
        settings: Limits of the angle.

    Returns:
        Score of every pair of images [1], shape (I, I), float64, symmetric; 0 where they share too little.
    """
    count = len(model.names)
    points = [np.unique(model.obs_point[model.obs_image == row]) for row in range(count)]
    centers = model.poses[:, :3, 3]
    score = np.zeros((count, count))
    seen = np.zeros(len(model.points), bool)
    for first in range(count):
        seen[points[first]] = True
        for second in range(first + 1, count):
            shared = points[second][seen[points[second]]]
            if len(shared) < _MIN_SHARED:
                continue
            a, b = centers[first] - model.points[shared], centers[second] - model.points[shared]
            along = np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1)
            cosine = np.einsum("ni,ni->n", a, b) / np.maximum(along[0] * along[1], 1e-300)
            angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
            alike = np.minimum(along[0], along[1]) / np.maximum(along[0], along[1])
            score[first, second] = score[second, first] = float((angle_weight(angle, settings) * alike**2).sum())
        seen[points[first]] = False
    return score


def angle_weight(angle: F64, settings: DenseSettings) -> F64:
    """Weigh the angle between two rays: 1 at the best, 0 below half the lower and above 1.5 times the upper limit.

    Args:
        angle: Angles [deg], shape (N,), float64.
        settings: Limits.

    Returns:
        Weights [1], shape (N,), float64.
    """
    low, high = settings.min_angle, settings.max_angle
    best = np.clip(_BEST_ANGLE, low, high)
    rising = np.clip((angle - 0.5 * low) / max(best - 0.5 * low, 1e-9), 0.0, 1.0)
    falling = np.exp(-0.5 * (np.maximum(angle - best, 0.0) / max(0.5 * (high - best), 1e-9)) ** 2)
    return np.where(angle < 1.5 * high, rising * falling, 0.0)


def _spread_out(score: F64, centers: F64, row: int, count: int) -> I64:
    """Take the best views one by one; a view close to a chosen one, as seen from here, loses weight."""
    left = score.copy()
    offset = centers - centers[row]
    reach = np.maximum(np.linalg.norm(offset, axis=1), 1e-300)
    chosen: list[int] = []
    while len(chosen) < count and left.max() > 0.0:
        best = int(np.argmax(left))
        chosen.append(best)
        left[best] = 0.0
        beside = np.linalg.norm(offset - offset[best], axis=1) < 0.5 * np.minimum(reach, reach[best])
        left[beside] *= _ALIKE
    return np.array(chosen, np.int64)
