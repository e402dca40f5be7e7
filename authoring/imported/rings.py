"""Polygons in space, with holes, as triangles."""

import numpy as np
from numpy.typing import NDArray

from authoring.shapes.sections import plane_cross
from usd_schemas.triangulate import clip_ears

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_NARROW = 1e-12  # [m2], twice the area below which a triangle is degenerate


def ring_triangles(rings: list[F64]) -> F64:
    """Cut a plane polygon in space into triangles with the orientation of its outer ring.

    Holes are joined to the outer ring by cuts from their rightmost corners.

    Source: D. Eberly, Triangulation by Ear Clipping, 2002.

    Args:
        rings: Outer ring, then holes [m], each of shape (P, 3), float64; the first corner is not repeated.

    Returns:
        Corners [m], shape (T, 3, 3), float64; none where the polygon has no area.
    """
    normal = _newell(rings[0])
    if not normal.any():
        return np.zeros((0, 3, 3))
    if len(rings) == 1 and len(rings[0]) == 3:
        return rings[0][None]
    flat = [ring @ _plane(normal).T for ring in rings]
    corners = np.concatenate(rings)
    plan = np.concatenate(flat)
    order = list(range(len(rings[0])))
    begin = len(rings[0])
    holes = []
    for ring in flat[1:]:
        holes.append(np.arange(begin, begin + len(ring)))
        begin += len(ring)
    for hole in sorted(holes, key=lambda hole: -plan[hole, 0].max()):
        order = _joined(plan, order, hole)
    found = clip_ears(plan[order])
    # Triangles without area, or facing backwards because the ring crosses itself, are left out.
    a, b, c = plan[order][found].transpose(1, 0, 2)
    return corners[order][found[plane_cross(b - a, c - b) > _NARROW]]


def _newell(ring: F64) -> F64:
    centered = ring - ring[0]
    normal = np.cross(centered, np.roll(centered, -1, axis=0)).sum(axis=0)
    length = np.linalg.norm(normal)
    return normal / length if length > _NARROW else np.zeros(3)


def _plane(normal: F64) -> F64:
    """Return two directions of a plane that turn counter-clockwise about its normal, shape (2, 3), float64."""
    helper = np.eye(3)[int(np.argmin(np.abs(normal)))]
    first = np.cross(helper, normal)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)])


def _joined(plan: F64, order: list[int], hole: I64) -> list[int]:
    """Join a hole to the polygon by a cut from its rightmost corner to a visible corner."""
    start = int(np.argmax(plan[hole, 0]))
    turned = np.roll(hole, -start)
    area = _twice_area(plan[turned])
    if area > 0.0:  # a hole has the opposite orientation
        turned = np.concatenate([turned[:1], turned[:0:-1]])
    tip = plan[turned[0]]
    outline = plan[order]
    near = np.argsort(np.linalg.norm(outline - tip, axis=1), kind="stable")
    place = next((int(k) for k in near if _sees(outline, tip, outline[k])), int(near[0]))
    around = [int(corner) for corner in turned]
    return [*order[: place + 1], *around, around[0], order[place], *order[place + 1 :]]


def _twice_area(ring: F64) -> float:
    return float(np.sum(plane_cross(ring, np.roll(ring, -1, axis=0))))


def _sees(outline: F64, start: F64, end: F64) -> bool:
    """Check that a segment crosses no side of an outline."""
    a, b = outline, np.roll(outline, -1, axis=0)
    first, second = plane_cross(end - start, a - start), plane_cross(end - start, b - start)
    third, fourth = plane_cross(b - a, start - a), plane_cross(b - a, end - a)
    return not bool(((first * second < -_NARROW) & (third * fourth < -_NARROW)).any())
