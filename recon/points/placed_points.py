"""Reconstructed points in the world, sparse or dense, with what is known of them without truth."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import RejectedSceneError
from recon.dense.points import DensePoints
from recon.placing.align import Similarity
from recon.points.fates import DEVIATION, FEW_VIEWS, KEPT, REPROJECTION
from recon.points.observations import Observations, select_dense, select_points
from recon.points.precision import deviations, keypoint_noise
from recon.settings import ReconSettings
from recon.sfm.colmap_model import SparseModel

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class PlacedPoints:
    """N points that valid cameras saw, including those that are removed later.

    Attributes:
        judged: Which of the reconstructed points these are, shape (P,), bool.
        fate: Fate of each, a number of `FATES`, shape (N,), uint8.
        coord: World positions [m], shape (N, 3), float64.
        normal: Unit normals [1], shape (N, 3), float32.
        color: sRGB colors, shape (N, 3), uint8.
        reprojection_error: Mean distance between keypoints and reprojected point [px], shape (N,), float32; NaN where
            there is no keypoint, as for dense points.
        seen: Their observations.
    """

    judged: Mask
    fate: NDArray[np.uint8]
    coord: F64
    normal: F32
    color: NDArray[np.uint8]
    reprojection_error: F32
    seen: Observations


def place_sparse(
    model: SparseModel, rows: I64, valid: Mask, similarity: Similarity, settings: ReconSettings, *, metric: bool
) -> PlacedPoints:
    """Transform the points of structure from motion to the world.

    Args:
        model: Reconstruction.
        rows: Row in the capture of each image of the model, shape (I,), int64.
        valid: Whether a camera of the capture is valid, shape (K,), bool.
        similarity: From the model into the world.
        settings: `max_reprojection_error`, `min_views`, `sure_views` and `max_deviation` decide which points are kept.
        metric: Whether the world is in meters; else `max_deviation` has no meaning and is not used.

    Returns:
        The points that any valid camera saw; normals point to the mean of the cameras.

    Raises:
        RejectedSceneError: `no_points`.
    """
    judged, seen = select_points(model, rows, valid, np.inf, 1)
    _check_some(judged)
    centers = np.full((len(valid), 3), np.nan)
    centers[rows] = similarity.move(model.poses[:, :3, 3])
    coord, errors, fate = similarity.move(model.points[judged]), model.errors[judged], _all_kept(judged)
    if metric:
        rays, poor = seen.once(), errors > settings.max_reprojection_error
        noise = keypoint_noise(errors, np.where(poor, 0, rays.counts))
        unsure = noise * deviations(coord, centers, model.camera_params[0], rays) > settings.max_deviation
        if settings.sure_views is not None:
            unsure &= rays.counts < settings.sure_views
        fate[unsure] = DEVIATION
    fate[errors > settings.max_reprojection_error] = REPROJECTION
    fate[seen.counts < settings.min_views] = FEW_VIEWS
    if (fate == DEVIATION).any() and not (fate == KEPT).any():
        raise RejectedSceneError(
            "no_points",
            f"all {len(fate):,} points may be off by more than {settings.max_deviation:g} m: raise "
            "[recon] max_deviation, or set sure_views = 2",
        )
    _check_some(fate == KEPT)
    normal = np.add.reduceat(centers[seen.image], seen.start[:-1]) / seen.counts[:, None] - coord
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return PlacedPoints(
        judged, fate, coord, normal.astype(np.float32), model.colors[judged], errors.astype(np.float32), seen
    )


def place_dense(points: DensePoints, rows: I64, valid: Mask, similarity: Similarity, min_views: int) -> PlacedPoints:
    """Transform dense points to the world.

    Args:
        points: Points in the model's units.
        rows: Row in the capture of each image of the model, shape (I,), int64.
        valid: Whether a camera of the capture is valid, shape (K,), bool.
        similarity: From the model into the world.
        min_views: Valid views that a point needs.

    Returns:
        The points that any valid camera saw.

    Raises:
        RejectedSceneError: `no_points`.
    """
    judged, seen = select_dense(points, rows, valid, 1)
    _check_some(judged)
    fate = _all_kept(judged)
    fate[seen.counts < min_views] = FEW_VIEWS
    _check_some(fate == KEPT)
    normal = points.normals[judged] @ similarity.rotation.T
    unknown = np.full(len(fate), np.nan, np.float32)
    return PlacedPoints(
        judged,
        fate,
        similarity.move(points.points[judged]),
        normal.astype(np.float32),
        points.colors[judged],
        unknown,
        seen,
    )


def _all_kept(judged: Mask) -> NDArray[np.uint8]:
    return np.full(int(judged.sum()), KEPT, np.uint8)


def _check_some(kept: Mask) -> None:
    if not kept.any():
        raise RejectedSceneError("no_points", "no point was seen well enough by valid cameras")
