"""Polygons in space, with holes, cut into triangles."""

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_NARROW = 1e-12  # [m2], twice the area of an ear that is none


def ring_triangles(rings: list[F64]) -> F64:
    """Cut a plane polygon in space into triangles that face the way its outer ring turns.

    Holes are joined to the outer ring by cuts, then ears are clipped.

    Source: D. Eberly, Triangulation by Ear Clipping, 2002 (holes joined by their rightmost corner).

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
    return corners[_ears(plan, order)]


def _newell(ring: F64) -> F64:
    centred = ring - ring[0]
    normal = np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0)
    length = np.linalg.norm(normal)
    return normal / length if length > _NARROW else np.zeros(3)


def _plane(normal: F64) -> F64:
    """Give two directions of a plane that turn counter-clockwise about its normal, shape (2, 3), float64."""
    helper = np.eye(3)[int(np.argmin(np.abs(normal)))]
    first = np.cross(helper, normal)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)])


def _joined(plan: F64, order: list[int], hole: I64) -> list[int]:
    """Join a hole to the polygon by a cut from its rightmost corner to a corner that it sees."""
    start = int(np.argmax(plan[hole, 0]))
    turned = np.roll(hole, -start)
    area = _twice_area(plan[turned])
    if area > 0.0:  # a hole runs the other way round
        turned = np.concatenate([turned[:1], turned[:0:-1]])
    tip = plan[turned[0]]
    outline = plan[order]
    near = np.argsort(np.linalg.norm(outline - tip, axis=1), kind="stable")
    place = next((int(k) for k in near if _sees(outline, tip, outline[k])), int(near[0]))
    around = [int(corner) for corner in turned]
    return [*order[: place + 1], *around, around[0], order[place], *order[place + 1 :]]


def _twice_area(ring: F64) -> float:
    return float(np.sum(_cross(ring, np.roll(ring, -1, axis=0))))


def _sees(outline: F64, start: F64, end: F64) -> bool:
    """Tell whether a segment properly crosses no side of an outline."""
    a, b = outline, np.roll(outline, -1, axis=0)
    first, second = _cross(end - start, a - start), _cross(end - start, b - start)
    third, fourth = _cross(b - a, start - a), _cross(b - a, end - a)
    return not bool(((first * second < -_NARROW) & (third * fourth < -_NARROW)).any())


def _ears(plan: F64, order: list[int]) -> I64:
    left, found = list(order), []
    while len(left) > 3:
        tip = next((k for k in range(len(left)) if _is_ear(plan, left, k)), None)
        if tip is None:  # a ring that crosses itself: what is left of it is given up
            return np.array(found, np.int64).reshape(-1, 3)
        found.append((left[tip - 1], left[tip], left[(tip + 1) % len(left)]))
        left.pop(tip)
    return np.array([*found, left], np.int64)


def _is_ear(plan: F64, left: list[int], k: int) -> bool:
    corner = (left[k - 1], left[k], left[(k + 1) % len(left)])
    a, b, c = plan[list(corner)]
    if _cross(b - a, c - b) <= _NARROW:
        return False
    others = plan[[i for i in left if i not in corner]]
    # Corners doubled by a cut lie on the ear's own corners: they do not count as inside.
    others = others[(np.abs(others[:, None] - np.stack([a, b, c])).max(axis=2) > 0.0).all(axis=1)]
    inside = np.ones(len(others), bool)
    for start, end in ((a, b), (b, c), (c, a)):
        inside &= _cross(end - start, others - start) >= -_NARROW
    return not bool(inside.any())


def _cross(a: F64, b: F64) -> F64:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
