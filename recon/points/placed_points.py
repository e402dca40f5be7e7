"""Reconstructed points in the world, sparse or dense: what is known of them without any truth."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import RejectedSceneError
from recon.dense.points import DensePoints
from recon.placing.align import Similarity
from recon.points.observations import Observations, select_dense, select_points
from recon.points.precision import deviations
from recon.settings import ReconSettings
from recon.sfm.colmap_model import SparseModel

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class PlacedPoints:
    """N points that valid cameras saw.

    Attributes:
        coord: World positions [m], shape (N, 3), float64.
        normal: Unit normals, shape (N, 3), float32.
        color: sRGB colours, shape (N, 3), uint8.
        reprojection_error: Mean distance between keypoints and reprojected point [px], shape (N,), float32; NaN where
            no keypoint was found, as of dense points.
        seen: Who saw them, and where.
    """

    coord: F64
    normal: F32
    color: NDArray[np.uint8]
    reprojection_error: F32
    seen: Observations


def place_sparse(
    model: SparseModel, rows: I64, valid: Mask, similarity: Similarity, settings: ReconSettings, *, metric: bool
) -> PlacedPoints:
    """Carry the points of structure from motion into the world.

    Args:
        model: Reconstruction.
        rows: Row in the capture of each image of the model, shape (I,), int64.
        valid: Whether a camera of the capture is valid, shape (K,), bool.
        similarity: From the model into the world.
        settings: `max_reprojection_error`, `min_views`, `sure_views` and `max_deviation` say which points stay.
        metric: Whether the world is in metres; else `max_deviation` tells nothing, and is not asked.

    Returns:
        Those seen well enough; their normals point to the mean of their cameras.

    Raises:
        RejectedSceneError: `no_points`.
    """
    kept, seen = select_points(model, rows, valid, settings.max_reprojection_error, settings.min_views)
    centres = np.full((len(valid), 3), np.nan)
    centres[rows] = similarity.move(model.poses[:, :3, 3])
    _check_some(kept)
    if metric:
        rays = seen.once()
        sure = rays.counts >= settings.sure_views
        points = similarity.move(model.points[kept][~sure])
        sure[~sure] = deviations(points, centres, model.camera_params[0], rays.of(~sure)) <= settings.max_deviation
        if not sure.any():
            raise RejectedSceneError(
                "no_points", f"all {len(sure):,} points were seen by fewer than {settings.sure_views} cameras and may "
                f"be off by more than {settings.max_deviation:g} m: raise [recon] max_deviation, or set sure_views = 2",
            )  # fmt: skip
        kept[kept], seen = sure, seen.of(sure)
    coord = similarity.move(model.points[kept])
    normal = np.add.reduceat(centres[seen.image], seen.start[:-1]) / seen.counts[:, None] - coord
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return PlacedPoints(
        coord, normal.astype(np.float32), model.colors[kept], model.errors[kept].astype(np.float32), seen
    )


def place_dense(points: DensePoints, rows: I64, valid: Mask, similarity: Similarity, min_views: int) -> PlacedPoints:
    """Carry dense points into the world.

    Args:
        points: Points in the model's units.
        rows: Row in the capture of each image of the model, shape (I,), int64.
        valid: Whether a camera of the capture is valid, shape (K,), bool.
        similarity: From the model into the world.
        min_views: Valid views that a point needs.

    Returns:
        Those seen by enough valid cameras.

    Raises:
        RejectedSceneError: `no_points`.
    """
    kept, seen = select_dense(points, rows, valid, min_views)
    _check_some(kept)
    normal = points.normals[kept] @ similarity.rotation.T
    unknown = np.full(int(kept.sum()), np.nan, np.float32)
    return PlacedPoints(
        similarity.move(points.points[kept]), normal.astype(np.float32), points.colors[kept], unknown, seen
    )


def _check_some(kept: Mask) -> None:
    if not kept.any():
        raise RejectedSceneError("no_points", "no point was seen well enough by valid cameras")
