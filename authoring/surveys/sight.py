"""Visibility of a bridge's members in a camera: the samples of their surface, and the pixels that they cover."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import KDTree

from authoring.surveys.framing import Eye
from authoring.surveys.surface_samples import SurfaceSamples
from authoring.surveys.targets import Targets
from usd_schemas.raycast import RayScene

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

TOUCH = 0.01  # [m] distance before its target sample at which a ray may end
SQUARE = np.cos(np.radians(60.0))  # least cosine between a surface's normal and the line to a camera, for a good view
_BATCH = 200_000  # rays cast at once


@dataclass(frozen=True, eq=False)
class Sight:
    """Visibility in views.

    Attributes:
        pixels: Pixels that each member covers in each view [px], shape (V, K), float64.
        squarely: Samples of each stretch that each view sees at 60 degrees or less from the normal, within reach, shape
            (V, S), int64.
    """

    pixels: sparse.csr_matrix
    squarely: sparse.csr_matrix


def sample_pixels(toward: F64, depth: F64, samples: SurfaceSamples, rows: I64, eye: Eye) -> F64:
    """Compute the pixels that the surface around samples covers: a small surface under a perspective projection.

    Args:
        toward: From each sample to the camera [m], shape (M, 3), float64.
        depth: Planar depth of each sample [m], shape (M,), float64.
        samples: Samples of surfaces.
        rows: Rows of the samples, shape (M,), int64.
        eye: The camera; its distortion hardly changes an area.

    Returns:
        Areas [px], shape (M,), float64; 0 for surfaces seen from behind.
    """
    facing = np.maximum(np.sum(toward * samples.normals[rows], axis=1), 0.0)
    return eye.camera.fx * eye.camera.fy * samples.areas[rows] * facing / depth**3


def visible_samples(places: F64, samples: SurfaceSamples, reach: float, obstacles: RayScene) -> tuple[I64, I64]:
    """Find the samples visible from places in any direction: within reach, from the front, not occluded.

    Args:
        places: Camera centers [m], shape (P, 3), float64.
        samples: Samples of surfaces.
        reach: Greatest distance [m].
        obstacles: Bridge and site.

    Returns:
        Rows of places, rising, and of samples, each of shape (M,), int64.
    """
    tree = KDTree(samples.points)
    near = tree.query_ball_point(places, reach, return_sorted=True)
    owners = np.repeat(np.arange(len(places)), [len(rows) for rows in near])
    rows = np.concatenate([np.asarray(found, np.int64) for found in near]) if len(near) else np.zeros(0, np.int64)
    kept = []
    for begin in range(0, len(rows), _BATCH):
        part = slice(begin, begin + _BATCH)
        toward = places[owners[part]] - samples.points[rows[part]]
        facing = np.flatnonzero(np.sum(toward * samples.normals[rows[part]], axis=1) > 0.0)
        toward = toward[facing]
        distance, _, _ = obstacles.cast(places[owners[part][facing]], -toward)
        clear = distance >= 1.0 - TOUCH / np.maximum(np.linalg.norm(toward, axis=1), TOUCH)
        kept.append(begin + facing[clear])
    chosen = np.concatenate(kept) if kept else np.zeros(0, np.int64)
    return owners[chosen], rows[chosen]


def sight_of(poses: F64, eye: Eye, targets: Targets, reach: float, obstacles: RayScene) -> Sight:
    """Compute the visibility of members and stretches in views.

    Args:
        poses: camera_to_world [m], shape (V, 4, 4), float64.
        eye: The camera.
        targets: Members and stretches.
        reach: Greatest distance [m].
        obstacles: Bridge and site.
    """
    places, place = np.unique(poses[:, :3, 3], axis=0, return_inverse=True)
    owners, rows = visible_samples(places, targets.samples, reach, obstacles)
    starts = np.searchsorted(owners, np.arange(len(places) + 1))
    parts = [
        _seen_by(view, pose, eye, targets.samples, rows[starts[at] : starts[at + 1]])
        for view, (pose, at) in enumerate(zip(poses, place.reshape(-1), strict=True))
    ]
    views, seen, pixels, square = (np.concatenate(column) for column in zip(*parts, strict=True))
    return gather_sight(len(poses), targets, (views, seen, pixels, square))


def gather_sight(count: int, targets: Targets, seen: tuple[I64, I64, F64, NDArray[np.bool_]]) -> Sight:
    """Sum the visibility of samples by member and by stretch.

    Args:
        count: Number of views.
        targets: Members and stretches.
        seen: Row of the view, row of the sample, pixels [px], and whether it is seen at 60 degrees or less from its
            normal, each of shape (M,).
    """
    views, rows, pixels, square = seen
    members = (pixels, (views, targets.samples.component[rows]))
    squarely = (np.ones(int(square.sum()), np.int64), (views[square], targets.stretch[rows[square]]))
    return Sight(
        sparse.csr_matrix(members, shape=(count, len(targets.samples.ids))),
        sparse.csr_matrix(squarely, shape=(count, len(targets.stretch_member))),
    )


def _seen_by(
    view: int, pose: F64, eye: Eye, samples: SurfaceSamples, rows: I64
) -> tuple[I64, I64, F64, NDArray[np.bool_]]:
    toward = pose[:3, 3] - samples.points[rows]
    local = -toward @ pose[:3, :3]
    framed = eye.framed_local(local)
    rows, toward, local = rows[framed], toward[framed], local[framed]
    pixels = sample_pixels(toward, local[:, 2], samples, rows, eye)
    square = np.sum(toward * samples.normals[rows], axis=1) >= SQUARE * np.linalg.norm(toward, axis=1)
    return np.full(len(rows), view), rows, pixels, square
