"""Compiled geometry of triangles: distance, winding number, common area. Loops that numpy cannot do without copies."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Bools = NDArray[np.bool_]
Row = Any  # a whole number; numpy's stubs take an element of an array for an array
_APART = 1e-6  # [m] that rounding may move a sheared corner, with room to spare
Vector = Any  # three numbers: a tuple, which costs nothing where an array would be allocated, or a row of an array


@njit(cache=True, error_model="numpy")
def _row(t: F64, n: Row) -> Vector:
    return t[n, 0], t[n, 1], t[n, 2]


@njit(cache=True, error_model="numpy")
def _from(a: Vector, b: Vector) -> Vector:
    return b[0] - a[0], b[1] - a[1], b[2] - a[2]


@njit(cache=True, error_model="numpy")
def _plus(a: Vector, b: Vector, k: float) -> Vector:
    return a[0] + b[0] * k, a[1] + b[1] * k, a[2] + b[2] * k


@njit(cache=True, error_model="numpy")
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, error_model="numpy")
def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True, error_model="numpy")
def point_to_triangle(p: Vector, t: F64) -> float:
    """Squared distance from a point to a triangle [m2] (Ericson, Real-Time Collision Detection, 5.1.5)."""
    a, b, c = _row(t, 0), _row(t, 1), _row(t, 2)
    ab, ac, ap = _from(a, b), _from(a, c), _from(a, p)
    d1, d2 = _dot(ab, ap), _dot(ac, ap)
    if d1 <= 0.0 and d2 <= 0.0:
        return _dot(ap, ap)
    bp = _from(b, p)
    d3, d4 = _dot(ab, bp), _dot(ac, bp)
    if d3 >= 0.0 and d4 <= d3:
        return _dot(bp, bp)
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        off = _plus(ap, ab, -d1 / (d1 - d3))
        return _dot(off, off)
    cp = _from(c, p)
    d5, d6 = _dot(ab, cp), _dot(ac, cp)
    if d6 >= 0.0 and d5 <= d6:
        return _dot(cp, cp)
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        off = _plus(ap, ac, -d2 / (d2 - d6))
        return _dot(off, off)
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        off = _plus(bp, _from(b, c), -(d4 - d3) / ((d4 - d3) + (d5 - d6)))
        return _dot(off, off)
    scale = 1.0 / (va + vb + vc)
    off = _plus(_plus(ap, ab, -vb * scale), ac, -vc * scale)
    return _dot(off, off)


@njit(cache=True, error_model="numpy")
def _segments(p1: Vector, q1: Vector, p2: Vector, q2: Vector) -> float:
    """Squared distance of two segments [m2] (Ericson, 5.1.9)."""
    d1, d2, r = _from(p1, q1), _from(p2, q2), _from(p2, p1)
    a, e, f = _dot(d1, d1), _dot(d2, d2), _dot(d2, r)
    b, c = _dot(d1, d2), _dot(d1, r)
    denominator = a * e - b * b
    s = min(max((b * f - c * e) / denominator, 0.0), 1.0) if denominator > 1e-15 else 0.0
    t = (b * s + f) / e
    if t < 0.0:
        t, s = 0.0, min(max(-c / a, 0.0), 1.0)
    elif t > 1.0:
        t, s = 1.0, min(max((b - c) / a, 0.0), 1.0)
    off = _plus(_plus(r, d1, s), d2, -t)
    return _dot(off, off)


@njit(cache=True, error_model="numpy")
def _pierces(p: Vector, q: Vector, t: F64) -> bool:
    """Whether a segment passes through a triangle."""
    a = _row(t, 0)
    one, two, run = _from(a, _row(t, 1)), _from(a, _row(t, 2)), _from(p, q)
    h = _cross(run, two)
    det = _dot(one, h)
    if abs(det) < 1e-18:
        return False
    s = _from(a, p)
    u = _dot(s, h) / det
    if u < 0.0 or u > 1.0:
        return False
    k = _cross(s, one)
    v = _dot(run, k) / det
    if v < 0.0 or u + v > 1.0:
        return False
    w = _dot(two, k) / det
    return 0.0 <= w <= 1.0


@njit(cache=True, error_model="numpy")
def _triangles_within(one: F64, two: F64, reach: float) -> bool:
    limit = reach * reach
    for i in range(3):
        if point_to_triangle(_row(one, i), two) <= limit or point_to_triangle(_row(two, i), one) <= limit:
            return True
    for i in range(3):
        p, q = _row(one, i), _row(one, (i + 1) % 3)
        for j in range(3):
            if _segments(p, q, _row(two, j), _row(two, (j + 1) % 3)) <= limit:
                return True
    pierced = False
    for i in range(3):
        mine, theirs = _row(one, i), _row(two, i)
        pierced |= _pierces(mine, _row(one, (i + 1) % 3), two) or _pierces(theirs, _row(two, (i + 1) % 3), one)
    return pierced


@njit(cache=True, error_model="numpy")
def _in_box(low: F64, high: F64, first: Row, last: Row, box_low: F64, box_high: F64) -> I64:
    found = np.empty(last - first, np.int64)
    count = 0
    for t in range(first, last):
        if (
            low[t, 0] <= box_high[0]
            and high[t, 0] >= box_low[0]
            and low[t, 1] <= box_high[1]
            and high[t, 1] >= box_low[1]
            and low[t, 2] <= box_high[2]
            and high[t, 2] >= box_low[2]
        ):
            found[count] = t
            count += 1
    return found[:count]


@njit(cache=True, error_model="numpy")
def touching(corners: F64, low: F64, high: F64, first: I64, boxes: F64, pairs: I64, reach: float) -> Bools:
    """Tell which pairs of solids come within a reach of each other.

    Args:
        corners: Triangle corners, solid after solid [m], shape (T, 3, 3), float64.
        low: Least corner of each triangle [m], shape (T, 3), float64.
        high: Largest corner of each triangle [m], shape (T, 3), float64.
        first: Row of each solid's first triangle, and T, shape (N + 1,), int64.
        boxes: Least and largest corner of each solid [m], shape (N, 2, 3), float64.
        pairs: Solids to compare, shape (P, 2), int64.
        reach: Distance that still counts as touching [m].
    """
    out = np.zeros(len(pairs), np.bool_)
    for k in range(len(pairs)):
        i, j = pairs[k, 0], pairs[k, 1]
        box_low = np.maximum(boxes[i, 0], boxes[j, 0]) - reach
        box_high = np.minimum(boxes[i, 1], boxes[j, 1]) + reach
        mine = _in_box(low, high, first[i], first[i + 1], box_low, box_high)
        theirs = _in_box(low, high, first[j], first[j + 1], box_low, box_high)
        for a in mine:
            for b in theirs:
                if (
                    low[a, 0] <= high[b, 0] + reach
                    and low[b, 0] <= high[a, 0] + reach
                    and low[a, 1] <= high[b, 1] + reach
                    and low[b, 1] <= high[a, 1] + reach
                    and low[a, 2] <= high[b, 2] + reach
                    and low[b, 2] <= high[a, 2] + reach
                    and _triangles_within(corners[a], corners[b], reach)
                ):
                    out[k] = True
                    break
            if out[k]:
                break
    return out


@njit(cache=True, error_model="numpy")
def winding(points: F64, corners: F64, first: Row, last: Row) -> I64:
    """Count how often a solid's surface wraps each point: 0 outside, 1 inside (crossings of a slanting ray).

    Args:
        points: Positions [m], shape (N, 3), float64.
        corners: Triangle corners [m], shape (T, 3, 3), float64.
        first: Row of the solid's first triangle.
        last: Row after its last.
    """
    # A shear turns the slanting ray upright; its slope is no ratio of anything that is built.
    slope_x, slope_y = 0.0137910234, 0.0094730817
    out = np.zeros(len(points), np.int64)
    low_x, low_y, low_z, high_x, high_y = np.inf, np.inf, np.inf, -np.inf, -np.inf
    for n in range(len(points)):  # all rays together run in a narrow shaft
        x, y = points[n, 0] - slope_x * points[n, 2], points[n, 1] - slope_y * points[n, 2]
        low_x, high_x, low_y, high_y = min(low_x, x), max(high_x, x), min(low_y, y), max(high_y, y)
        low_z = min(low_z, points[n, 2])
    low_x, low_y, high_x, high_y = low_x - _APART, low_y - _APART, high_x + _APART, high_y + _APART
    for t in range(first, last):
        a, b, c = _row(corners[t], 0), _row(corners[t], 1), _row(corners[t], 2)
        xa, xb, xc = a[0] - slope_x * a[2], b[0] - slope_x * b[2], c[0] - slope_x * c[2]
        ya, yb, yc = a[1] - slope_y * a[2], b[1] - slope_y * b[2], c[1] - slope_y * c[2]
        if (
            min(xa, xb, xc) > high_x
            or max(xa, xb, xc) < low_x
            or min(ya, yb, yc) > high_y
            or max(ya, yb, yc) < low_y
            or max(a[2], b[2], c[2]) < low_z
        ):
            continue
        for n in range(len(points)):
            p = _row(points, n)
            ax, ay = a[0] - p[0] - slope_x * (a[2] - p[2]), a[1] - p[1] - slope_y * (a[2] - p[2])
            bx, by = b[0] - p[0] - slope_x * (b[2] - p[2]), b[1] - p[1] - slope_y * (b[2] - p[2])
            cx, cy = c[0] - p[0] - slope_x * (c[2] - p[2]), c[1] - p[1] - slope_y * (c[2] - p[2])
            u, v, w = bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx
            if (u >= 0.0 and v >= 0.0 and w >= 0.0) or (u <= 0.0 and v <= 0.0 and w <= 0.0):
                total = u + v + w
                if total != 0.0 and (u * (a[2] - p[2]) + v * (b[2] - p[2]) + w * (c[2] - p[2])) / total > 0.0:
                    out[n] += 1 if total > 0.0 else -1
    return out


@njit(cache=True, error_model="numpy")
def depth_in(points: F64, corners: F64, first: Row, last: Row) -> F64:
    """Distance from points to a solid's surface [m], shape (N,).

    Args:
        points: Positions [m], shape (N, 3), float64.
        corners: Triangle corners [m], shape (T, 3, 3), float64.
        first: Row of the solid's first triangle.
        last: Row after its last.
    """
    out = np.full(len(points), np.inf)
    for n in range(len(points)):
        p = _row(points, n)
        for t in range(first, last):
            if _box_away(p, corners[t]) < out[n]:
                out[n] = min(out[n], point_to_triangle(p, corners[t]))
    return np.sqrt(out)


@njit(cache=True, error_model="numpy")
def _box_away(p: Vector, t: F64) -> float:
    """Squared distance from a point to a triangle's box, and a little less [m2]."""
    total = 0.0
    for k in range(3):
        gap = max(min(t[0, k], t[1, k], t[2, k]) - p[k], p[k] - max(t[0, k], t[1, k], t[2, k]), 0.0)
        total += gap * gap
    return total * (1.0 - 1e-12)


@njit(cache=True, error_model="numpy")
def _clip(subject: F64, triangle: F64, normal: F64) -> F64:
    """Cut a polygon down to what lies over a triangle, seen along its normal (Sutherland, Hodgman 1974)."""
    polygon = subject
    for k in range(3):
        edge = _row(triangle, k)
        inward = _cross(normal, _from(edge, _row(triangle, (k + 1) % 3)))
        kept = np.empty((len(polygon) + 3, 3))
        count = 0
        for n in range(len(polygon)):
            p, q = polygon[n], polygon[(n + 1) % len(polygon)]
            here, there = _dot(_from(edge, p), inward), _dot(_from(edge, q), inward)
            if here >= 0.0:
                kept[count] = p
                count += 1
            if here * there < 0.0:
                kept[count] = p + (q - p) * (here / (here - there))
                count += 1
        polygon = kept[:count]
        if count < 3:
            return polygon[:0]
    return polygon


@njit(cache=True, error_model="numpy")
def _boxes_meet(low: F64, high: F64, a: Row, b: Row, reach: float) -> bool:
    meet = True
    for k in range(3):
        meet &= low[a, k] <= high[b, k] + reach and low[b, k] <= high[a, k] + reach
    return meet


@njit(cache=True, error_model="numpy")
def common_faces(
    corners: F64, normals: F64, low: F64, high: F64, first: I64, boxes: F64, pairs: I64, apart: float, least: float
) -> tuple[I64, F64]:
    """Find faces of two solids that look the same way from within a hair of one plane and cover each other.

    Args:
        corners: Triangle corners [m], shape (T, 3, 3), float64.
        normals: Unit normal of each triangle [1], shape (T, 3), float64.
        low: Least corner of each triangle [m], shape (T, 3), float64.
        high: Largest corner of each triangle [m], shape (T, 3), float64.
        first: Row of each solid's first triangle, and T, shape (N + 1,), int64.
        boxes: Least and largest corner of each solid [m], shape (N, 2, 3), float64.
        pairs: Solids to compare, shape (P, 2), int64.
        apart: Planes closer than this count as one [m].
        least: Area that counts [m2].

    Returns:
        Row of `pairs` of each find, shape (K,), int64; middle [m], normal [1] and area [m2] of what they share,
        shape (K, 7), float64.
    """
    rows = np.empty(10_000, np.int64)
    finds = np.empty((10_000, 7))
    count = 0
    for k in range(len(pairs)):
        i, j = pairs[k, 0], pairs[k, 1]
        box_low = np.maximum(boxes[i, 0], boxes[j, 0]) - apart
        box_high = np.minimum(boxes[i, 1], boxes[j, 1]) + apart
        mine = _in_box(low, high, first[i], first[i + 1], box_low, box_high)
        theirs = _in_box(low, high, first[j], first[j + 1], box_low, box_high)
        for a in mine:
            for b in theirs:
                if _dot(normals[a], normals[b]) < 0.9995 or not _boxes_meet(low, high, a, b, 2.0 * apart):
                    continue  # what they share is within `apart` of both
                if abs(_dot(_from(corners[b, 0], corners[a, 0]), normals[b])) > 0.1:
                    continue
                polygon = _clip(corners[a], corners[b], normals[b])
                if len(polygon) < 3:
                    continue
                farthest, area = 0.0, 0.0
                middle = np.zeros(3)
                for n in range(len(polygon)):
                    farthest = max(farthest, abs(_dot(_from(corners[b, 0], polygon[n]), normals[b])))
                    middle += polygon[n] / len(polygon)
                    if n >= 2:
                        piece = _cross(_from(polygon[0], polygon[n - 1]), _from(polygon[0], polygon[n]))
                        area += 0.5 * _dot(piece, normals[b])
                if farthest <= apart and area > least and count < 10_000:
                    rows[count] = k
                    finds[count, :3], finds[count, 3:6], finds[count, 6] = middle, normals[b], area
                    count += 1
    return rows[:count], finds[:count]


@njit(cache=True, error_model="numpy")
def covered_twice(charts: F64, texels: int) -> tuple[I64, I64]:
    """Draw charts on an atlas and find the texels that two triangles claim.

    Args:
        charts: Atlas corners of each triangle [1], shape (T, 3, 2), float64.
        texels: Texels along a side.

    Returns:
        Earlier and later triangle of each texel claimed twice, shape (K,) each, int64 (the first 1,000).
    """
    owner = np.full((texels, texels), -1, np.int64)
    earlier, later = np.empty(1000, np.int64), np.empty(1000, np.int64)
    count = 0
    for t in range(len(charts)):
        p = charts[t] * texels - 0.5  # texel k has its middle at k
        one, two = p[1] - p[0], p[2] - p[0]
        area = one[0] * two[1] - one[1] * two[0]
        if abs(area) < 1e-9:
            continue
        # Half of a thousandth of a texel inside each side: single precision places corners no better.
        inside_u = 5e-4 * np.hypot(two[0], two[1]) / abs(area)
        inside_v = 5e-4 * np.hypot(one[0], one[1]) / abs(area)
        inside_w = 5e-4 * np.hypot(two[0] - one[0], two[1] - one[1]) / abs(area)
        for x in range(int(np.ceil(p[:, 0].min())), int(np.floor(p[:, 0].max())) + 1):
            for y in range(int(np.ceil(p[:, 1].min())), int(np.floor(p[:, 1].max())) + 1):
                dx, dy = x - p[0, 0], y - p[0, 1]
                u, v = (dx * two[1] - dy * two[0]) / area, (one[0] * dy - one[1] * dx) / area
                if u > inside_u and v > inside_v and u + v < 1.0 - inside_w and 0 <= x < texels and 0 <= y < texels:
                    if owner[y, x] >= 0 and count < 1000:
                        earlier[count], later[count] = owner[y, x], t
                        count += 1
                    owner[y, x] = t
    return earlier[:count], later[:count]
