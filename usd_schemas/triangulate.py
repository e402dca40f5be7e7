"""Triangulation of polygons: triangles, quads and convex faces vectorized, concave faces by ear clipping."""

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

FLAT = 1e-12  # corners whose triangle has less than this share of the face's area count as straight [1]


def triangulate(points: F64, face_counts: I64, corners: I64) -> tuple[I64, I64]:
    """Split the faces of a mesh into triangles that keep the faces' winding and cover exactly their area.

    Args:
        points: Positions [any unit], shape (V, 3), float64.
        face_counts: Corners of each face, shape (F,), int64; faces with fewer than three give nothing.
        corners: Vertex number of each face corner, shape (C,), int64.

    Returns:
        Corner numbers (rows of `corners`), shape (T, 3), int64, and the face of each triangle, shape (T,), int64;
        triangles are in the order of the faces.
    """
    starts = np.cumsum(face_counts) - face_counts
    pieces, owners = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)]
    for count in np.unique(face_counts[face_counts >= 3]).tolist():
        faces = np.flatnonzero(face_counts == count)
        local = points[corners[starts[faces][:, None] + np.arange(count)]]
        triangles = starts[faces][:, None, None] + _split(local)
        pieces.append(triangles.reshape(-1, 3))
        owners.append(np.repeat(faces, count - 2))
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return np.concatenate(pieces)[order], owner[order]


def face_normals(points: F64, face_counts: I64, corners: I64) -> F64:
    """Compute the area vector of every face by Newell's method: normal to it, with twice its area as length.

    Args:
        points: Positions [any unit], shape (V, 3), float64.
        face_counts: Corners of each face, shape (F,), int64.
        corners: Vertex number of each face corner, shape (C,), int64.

    Returns:
        Area vectors [any unit²], shape (F, 3), float64.
    """
    starts = np.cumsum(face_counts) - face_counts
    face = np.repeat(np.arange(len(face_counts)), face_counts)
    following = np.arange(len(corners)) + 1
    ends = (starts + face_counts)[face_counts > 0]
    following[ends - 1] = starts[face_counts > 0]
    # Relative to the face's first corner, which keeps the precision of small faces far from the origin.
    origin = points[corners[starts[face]]]
    here, there = points[corners] - origin, points[corners[following]] - origin
    crossed = cross(here, there)
    return np.array([np.bincount(face, crossed[:, axis], len(face_counts)) for axis in range(3)], np.float64).T


def cross(a: F64, b: F64) -> F64:
    """Vector product, several times faster than numpy's on short arrays.

    Args:
        a: Vectors [any unit], shape (..., 3), float64.
        b: Vectors [any unit], shape (..., 3) or one that broadcasts with `a`, float64.

    Returns:
        Products [any unit²], shape (..., 3), float64.
    """
    result = np.empty(np.broadcast_shapes(a.shape, b.shape), np.float64)
    for axis, first, second in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        result[..., axis] = a[..., first] * b[..., second] - a[..., second] * b[..., first]
    return result


def _split(faces: F64) -> I64:
    """Split faces of one size, shape (F, N, 3): corner numbers within each face, shape (F, N - 2, 3)."""
    count = faces.shape[1]
    step = np.arange(count - 2)
    fan = np.stack([np.zeros_like(step), step + 1, step + 2], axis=1)
    result = np.repeat(fan[None], len(faces), axis=0)
    if count == 3:
        return result
    local = faces - faces[:, :1]
    following, previous = local[:, [*range(1, count), 0]], local[:, [-1, *range(count - 1)]]
    area = cross(local, following).sum(axis=1)
    before, after = local - previous, following - local
    turns = np.einsum("fnk,fk->fn", cross(before, after), area)
    least = FLAT * np.einsum("fk,fk->f", area, area)[:, None]
    if count == 4:
        # A quad with a reflex corner is split at that corner; the fan already does so at corners 0 and 2.
        result[np.any(turns[:, [1, 3]] < -least, axis=1)] = [[1, 2, 3], [1, 3, 0]]
        return result
    for row in np.flatnonzero(np.any(turns <= least, axis=1)):
        result[row] = clip_ears(_flatten(local[row], area[row]))
    return result


def _flatten(polygon: F64, normal: F64) -> F64:
    """Project a polygon, shape (N, 3), on the plane across its normal, so that it runs counter-clockwise: (N, 2)."""
    length = np.linalg.norm(normal)
    if length == 0.0:
        return polygon[:, :2]
    upright = normal / length
    first = cross(upright, np.eye(3)[np.argmin(abs(upright))])
    axes = np.array([first, cross(upright, first)], np.float64) / np.linalg.norm(first)
    return polygon @ axes.T


def clip_ears(polygon: F64) -> I64:
    """Triangulate a plane polygon by ear clipping, without new points.

    Our own implementation, because no library guarantees the same triangles in its next version, and stages must have
    the same bytes. Corners may lie on straight sides, and slits to holes may pass the same points in both directions.

    Source: G. H. Meisters, Polygons have ears, American Mathematical Monthly 82 (1975).

    Args:
        polygon: Corners, counter-clockwise [any unit], shape (N, 2), float64; N at least 3.

    Returns:
        Corner numbers, shape (N - 2, 3), int64. Together they cover exactly a polygon that does not cross itself; some
        may have no area.
    """
    ring = list(range(len(polygon)))
    least = FLAT * abs(float(np.ptp(polygon, axis=0).prod()))
    triangles = []
    place = 0
    while len(ring) > 3:
        tried = 0
        while tried < len(ring) and not _is_ear(polygon, ring, place, least):
            place = (place + 1) % len(ring)
            tried += 1
        # Every simple polygon has an ear; a self-intersecting one may have none, then any corner is cut.
        triangles.append([ring[place - 1], ring[place], ring[(place + 1) % len(ring)]])
        del ring[place]
        # Skipping the next corner distributes the cuts; otherwise a fan of slivers would result.
        place = (place + 1) % len(ring)
    triangles.append(ring)
    return np.array(triangles, np.int64)


def _is_ear(polygon: F64, ring: list[int], place: int, least: float) -> bool:
    """Tell whether the corner at a place of the remaining ring can be cut off."""
    a, b, c = polygon[ring[place - 1]], polygon[ring[place]], polygon[ring[(place + 1) % len(ring)]]
    if _turn(a, b, c) < -least:
        return False
    others = polygon[ring]
    inside = (_turn(a, b, others) >= 0) & (_turn(b, c, others) >= 0) & (_turn(c, a, others) >= 0)
    # Corners of the ear itself, and duplicates of them (a slit to a hole), are ignored.
    for corner in (a, b, c):
        inside &= np.any(others != corner, axis=1)
    return not bool(np.any(inside))


def _turn(a: F64, b: F64, c: F64) -> F64:
    """Twice the signed area of the triangles a, b, c; over 0 when counter-clockwise; c has shape (2,) or (N, 2)."""
    return (b[0] - a[0]) * (c[..., 1] - a[1]) - (b[1] - a[1]) * (c[..., 0] - a[0])
