"""How well a flight sees a bridge, found by casting rays before anything is rendered."""

import numpy as np
from numpy.typing import NDArray

from authoring.surveys.path import CameraPath
from authoring.surveys.subject import Subject
from usd_schemas.pinhole import Pinhole, project, unproject

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

STRIDE = 4  # [px] between the rays of an image; a ray stands for STRIDE x STRIDE pixels


def visible_pixels(path: CameraPath, subject: Subject) -> tuple[I64, I64]:
    """Count the pixels that each instance covers in each image.

    Args:
        path: Cameras to look through.
        subject: Bridge and site.

    Returns:
        Instance ids of the bridge, ascending, shape (K,), and pixel counts [px], shape (N, K), int64.
    """
    ids = np.unique(subject.bridge_ids).astype(np.int64)
    counts = np.zeros((len(path.poses), len(ids)), np.int64)
    for row, pose in enumerate(path.poses):
        hits = _look(path.calibration, pose, subject)[1]
        column = np.searchsorted(ids, hits)
        known = (column < len(ids)) & (ids[np.minimum(column, len(ids) - 1)] == hits)
        counts[row] = np.bincount(column[known], minlength=len(ids)) * STRIDE**2
    return ids, counts


def neighbor_overlap(path: CameraPath, subject: Subject) -> F64:
    """Find the share of what each image sees that the next one sees as well, the last followed by the first.

    Args:
        path: Cameras to look through.
        subject: Bridge and site.

    Returns:
        Shares of the pixels that see a surface [1], shape (N,), float64.
    """
    shares = np.zeros(len(path.poses))
    for row, pose in enumerate(path.poses):
        points = _look(path.calibration, pose, subject)[0]
        other = path.poses[(row + 1) % len(path.poses)]
        pixels, depth = project(points, path.calibration, other)
        inside = (pixels >= 0) & (pixels < [path.calibration.width, path.calibration.height])
        framed = (depth > 0) & inside.all(axis=1)
        rays = points[framed] - other[:3, 3]
        reach, _, _ = subject.obstacles.cast(np.broadcast_to(other[:3, 3], rays.shape), rays)
        shares[row] = (reach > 0.99).sum() / max(len(points), 1)
    return shares


def views_per_instance(counts: I64, least: int) -> I64:
    """Count the images in which each instance is large enough to be matched.

    Args:
        counts: Pixels of each instance in each image [px], shape (N, K), int64.
        least: Pixels that it needs [px].

    Returns:
        Number of images, shape (K,), int64.
    """
    return (counts >= least).sum(axis=0)


def _look(camera: Pinhole, pose: F64, subject: Subject) -> tuple[F64, I64]:
    """Cast the rays of an image: the points hit, shape (M, 3), and their instance ids, shape (M,)."""
    grid = np.mgrid[STRIDE // 2 : camera.height : STRIDE, STRIDE // 2 : camera.width : STRIDE][::-1]
    pixels = grid.reshape(2, -1).T.astype(np.float64)
    directions = unproject(pixels, np.ones(len(pixels)), camera, pose) - pose[:3, 3]
    origins = np.broadcast_to(pose[:3, 3], directions.shape)
    reach, _, ids = subject.obstacles.cast(origins, directions)
    hit = np.isfinite(reach)
    return origins[hit] + directions[hit] * reach[hit, None], ids[hit].astype(np.int64)
