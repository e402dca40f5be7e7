"""Distance of each texel of the `st1` atlas to the nearest sharp edge of its component."""

import numpy as np
from numpy.typing import NDArray

from authoring.looks.noise import Floats
from authoring.looks.runoff import direction
from authoring.shapes.component import Component, Mesh

ROADS = ("Role_DeckAsphalt", "Role_RoadMarking")

_SHARP = 0.85  # cosine of the angle between two faces, some 30 degrees
_WELD = 1e-3  # [m]; adjacent faces may have separate vertices
_ALONG = 0.7  # cosine between a road and its longer edges; its ends are skewed by less than 45 degrees
_SUBTEXEL = 4  # bits behind the point in the coordinates of lines


def arris_distance(components: list[Component], pixels: int) -> Floats:
    """Measure the distance to the nearest arris; seams of charts on round members, and ends of a road, do not count.

    Args:
        components: Components with `st1`.
        pixels: Texels along a side of the atlas.

    Returns:
        Distance [texels], shape (pixels, pixels), float32.
    """
    import cv2

    image = np.full((pixels, pixels), 255, np.uint8)
    for component in components:
        mesh = component.mesh
        one, two = _sharp_sides(mesh)
        if component.role in ROADS:
            run = (mesh.points[mesh.corners[two]] - mesh.points[mesh.corners[one]])[:, :2]
            kept = np.abs(run @ np.array(direction(mesh.points))) > _ALONG * np.sqrt((run * run).sum(axis=1))
            one, two = one[kept], two[kept]
        ends = np.stack([mesh.st1[one], mesh.st1[two]], axis=1).astype(np.float64)
        place = np.stack([ends[..., 0] * pixels, (1 - ends[..., 1]) * pixels], axis=-1) - 0.5
        lines = np.round(place * (1 << _SUBTEXEL)).astype(np.int32)
        cv2.polylines(image, list(lines), False, 0, 1, cv2.LINE_8, _SUBTEXEL)
    return np.asarray(cv2.distanceTransform(image, cv2.DIST_L2, 3), np.float32)


def _sharp_sides(mesh: Mesh) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Find the corners at the two ends of every side of a face that is an arris."""
    starts = np.cumsum(mesh.face_counts) - mesh.face_counts
    face = np.repeat(np.arange(len(mesh.face_counts)), mesh.face_counts)
    one = np.arange(len(mesh.corners))
    two = one + 1
    two[starts + mesh.face_counts - 1] = starts
    welded = np.unique(np.round(mesh.points / _WELD).astype(np.int64), axis=0, return_inverse=True)[1].reshape(-1)
    ends = np.sort(np.stack([welded[mesh.corners[one]], welded[mesh.corners[two]]], axis=1), axis=1)
    _, side, count = np.unique(ends[:, 0] * len(mesh.points) + ends[:, 1], return_inverse=True, return_counts=True)
    side = side.reshape(-1)
    points = mesh.points.astype(np.float64)
    a, b, c = (points[mesh.corners[starts + k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.sqrt((normal * normal).sum(axis=1, keepdims=True)), 1e-12)
    total = np.zeros((len(count), 3))
    np.add.at(total, side, normal[face])
    # Two unit normals at an angle have a sum whose squared length is 2 + 2 cos.
    sharp = (count == 2) & ((total * total).sum(axis=1) < 2 + 2 * _SHARP)
    chosen = np.flatnonzero(sharp[side])
    return one[chosen], two[chosen]
