"""Plane outlines of members: closed polygons in meters, counter-clockwise, and operations on them."""

import numpy as np

from authoring.shapes.component import F64, I32
from usd_schemas.triangulate import clip_ears

Triangle = tuple[int, int, int]

_IN_CIRCLE = 1e-12  # [1] share of a determinant's scale that counts as rounding error


def rectangle(low: tuple[float, float], high: tuple[float, float]) -> F64:
    """Draw an upright rectangle.

    Args:
        low: Lower left corner [m].
        high: Upper right corner [m].

    Returns:
        Outline [m], shape (4, 2), float64.
    """
    return np.array([low, (high[0], low[1]), high, (low[0], high[1])], dtype=np.float64)


def circle(diameter: float, sides: int) -> F64:
    """Draw a regular polygon inscribed in a circle around the origin.

    Args:
        diameter: Diameter of the circle [m].
        sides: Number of sides.

    Returns:
        Outline [m], shape (sides, 2), float64.
    """
    angle = 2.0 * np.pi * (np.arange(sides) + 0.5) / sides
    return 0.5 * diameter * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def mirrored(right_half: list[tuple[float, float]]) -> F64:
    """Complete an outline that is symmetric about x = 0.

    Args:
        right_half: Corners with x > 0, from the bottom to the top [m].

    Returns:
        Outline [m], shape (2 * len(right_half), 2), float64.
    """
    half = np.array(right_half, dtype=np.float64)
    return np.concatenate([half, half[::-1] * (-1.0, 1.0)])


def on_side(outline: F64, sign: float) -> F64:
    """Return an outline of the left side as it is, or mirrored to the right side.

    Args:
        outline: Corners [m], shape (N, 2), float64, counter-clockwise.
        sign: 1 for left, -1 for right [1].

    Returns:
        Corners [m], shape (N, 2), float64, counter-clockwise.
    """
    return outline if sign > 0.0 else (outline * (-1.0, 1.0))[::-1]


def area(outline: F64) -> float:
    """Measure the signed area of an outline, positive when counter-clockwise.

    Args:
        outline: Corners [m], shape (P, 2), float64.

    Returns:
        Area [m2].
    """
    x, y = outline.T
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def cut_corners(outline: F64, leg: float | F64) -> F64:
    """Chamfer the corners of an outline.

    Args:
        outline: Corners [m], shape (P, 2), float64.
        leg: Length taken from both sides of each corner [m], one value or shape (P,); 0 leaves a corner sharp.

    Returns:
        Outline [m], shape (Q, 2), float64: two corners for each cut one.
    """
    legs = np.broadcast_to(np.asarray(leg, dtype=np.float64), (len(outline),))[:, None]
    before, after = _preceding(outline) - outline, _following(outline) - outline
    before /= np.sqrt(np.sum(before * before, axis=1, keepdims=True))
    after /= np.sqrt(np.sum(after * after, axis=1, keepdims=True))
    both = np.stack([outline + before * legs, outline + after * legs], axis=1)
    return both[np.concatenate([np.ones(legs.shape, bool), legs > 0.0], axis=1)]


def inset(outline: F64, distance: float) -> F64:
    """Move every side of an outline inward; sides stay parallel to themselves.

    Args:
        outline: Corners, counter-clockwise [m], shape (P, 2), float64.
        distance: Distance [m]; so small that no side vanishes.

    Returns:
        Outline [m], shape (P, 2), float64.
    """
    return outline + distance * miters(outline)


def miters(outlines: F64) -> F64:
    """Find how corners move when all sides move inward by one meter.

    Args:
        outlines: Corners, counter-clockwise [m], shape (..., P, 2), float64.

    Returns:
        For each corner the vector whose component along both neighboring inward normals is one [1], the same shape
        (..., P, 2), float64.
    """
    along = _following(outlines) - outlines
    along /= np.sqrt(np.sum(along * along, axis=-1, keepdims=True))
    inward = np.stack([-along[..., 1], along[..., 0]], axis=-1)
    previous = _preceding(inward)
    return (previous + inward) / (1.0 + np.sum(previous * inward, axis=-1, keepdims=True))


def is_convex(outlines: F64) -> bool:
    """Check whether counter-clockwise outlines never turn right.

    Args:
        outlines: Corners [m], shape (..., P, 2), float64.
    """
    side = _following(outlines) - outlines
    return bool(np.all(plane_cross(_preceding(side), side) >= -1e-12))


def _following(rows: F64) -> F64:
    return np.concatenate([rows[..., 1:, :], rows[..., :1, :]], axis=-2)


def _preceding(rows: F64) -> F64:
    return np.concatenate([rows[..., -1:, :], rows[..., :-1, :]], axis=-2)


def triangulate(outline: F64) -> I32:
    """Triangulate a simple polygon: ear clipping, then edge flips to the constrained Delaunay triangulation.

    Clipping alone may connect corners that happen to be collinear; the constrained Delaunay triangulation has the
    largest possible smallest angle.

    Source: C. Lawson, Software for C1 surface interpolation, Mathematical Software III, 1977.

    Args:
        outline: Corners, counter-clockwise [m], shape (P, 2), float64.

    Returns:
        Corner numbers, shape (P - 2, 3), int32.
    """
    ears = [(int(a), int(b), int(c)) for a, b, c in clip_ears(outline)]
    return np.array(_flipped(ears, outline.tolist()), dtype=np.int32)


def _flipped(triangles: list[Triangle], points: list[list[float]]) -> list[Triangle]:
    """Flip the diagonal of every two triangles if the other one gives larger angles, until there are none."""
    beside = {(t[k - 1], t[k]): (row, t[k - 2]) for row, t in enumerate(triangles) for k in range(3)}
    waiting = sorted(edge for edge in beside if edge[0] < edge[1] and edge[::-1] in beside)
    while waiting:
        a, b = waiting.pop()
        if (a, b) not in beside or (b, a) not in beside:
            continue
        (row, c), (other, d) = beside[a, b], beside[b, a]
        if not _in_circle(points[a], points[b], points[c], points[d]):
            continue
        del beside[a, b], beside[b, a]
        for number, (p, q, r) in ((row, (a, d, c)), (other, (d, b, c))):
            triangles[number] = (p, q, r)
            beside |= {(p, q): (number, r), (q, r): (number, p), (r, p): (number, q)}
        waiting += [(b, c), (c, a), (a, d), (d, b)]
    return triangles


def _in_circle(a: list[float], b: list[float], c: list[float], d: list[float]) -> bool:
    """Whether d lies inside the circle through the counter-clockwise a, b, c; on it counts as outside."""
    (ax, ay), (bx, by), (cx, cy) = ((p[0] - d[0], p[1] - d[1]) for p in (a, b, c))
    aa, bb, cc = ax * ax + ay * ay, bx * bx + by * by, cx * cx + cy * cy
    inside = aa * (bx * cy - cx * by) - bb * (ax * cy - cx * ay) + cc * (ax * by - bx * ay)
    return inside > _IN_CIRCLE * (aa + bb + cc) ** 2


def plane_cross(a: F64, b: F64) -> F64:
    """Find the cross products of vectors in the plane: positive where the second lies to the left of the first.

    Args:
        a: Vectors [any unit], shape (..., 2), float64.
        b: Vectors [any unit], the same shape (..., 2), float64.

    Returns:
        Their products [any unit²], shape (...), float64.
    """
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
