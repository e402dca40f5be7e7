"""Fewer triangles for display: whole objects are left out, and large surfaces are coarsened, so that none has holes."""

import numpy as np
from numpy.typing import NDArray

LAND = 30.0  # [m] what extends so far in plan is a surface that others stand on, whatever it is called
LAND_PARTS = ("ground", "road", "rail_bed", "water", "embankment", "riverbank")  # component kinds that are one, too
NEAR = 10.0  # [m] distances below this from the most important part count as equal
SIDES = 24  # of the outline of the land
CELL = 0.25  # [m] width near the most important part of the first cells in which corners are merged
GROWTH = 2**0.5  # of the cells from one attempt to the next
LEAST_LAND = 0.2  # share of all triangles that land may always have: with fewer it would be in tatters [1]
COARSEST = 50.0  # [m] land that is still too much with such cells near the most important part is left out

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


def shown_triangles(
    corners: F64,
    level: I64,
    draw: NDArray[np.uint32],
    most: int,
    reach: float = np.inf,
    known: NDArray[np.bool_] | None = None,
) -> tuple[F64, I64]:
    """Choose what is shown: the most important objects, then the land, then other objects as long as they fit.

    A triangle that is left out alone is a hole in a surface. Hence objects are left out as a whole, those first that
    appear smallest from the most important ones, and of land that does not fit corners are merged.

    Args:
        corners: Corner positions [m], shape (T, 3, 3), float64.
        level: 0 for the most important objects, shape (T,), int64.
        draw: Number of the object of each triangle, shape (T,), uint32.
        most: Largest number of triangles; land may have a fifth of it beyond that.
        reach: Largest distance of others to the box of the most important ones [m]; land is cut there.
        known: Triangles that are known to be land, shape (T,), bool; None: those of wide objects alone are.

    Returns:
        Corner positions [m], shape (K, 3, 3), float64; row of each triangle in `corners`, shape (K,), int64.
    """
    if not len(corners):
        return corners, np.zeros(0, np.int64)
    first = level == level.min()
    low, high = corners[first].min(axis=(0, 1)), corners[first].max(axis=(0, 1))
    away = _away(corners.mean(axis=1), low, high)
    objects, number = np.unique(draw, return_inverse=True)
    land = _wide(corners, number, len(objects))[number]
    land = ~first & (land if known is None else land | known)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    weight = area / (away**2 + NEAR**2)

    rows = _whole(np.flatnonzero(first), number, weight, level, most)
    ground, of_ground = _cut(corners[land], np.flatnonzero(land), low, high, reach)
    kept = _coarsened(ground, low, high, max(most - len(rows), round(LEAST_LAND * most)))
    others = np.flatnonzero(~first & ~land)
    outside = np.bincount(number, away, len(objects)) > reach * np.bincount(number, minlength=len(objects))
    others = others[~outside[number[others]]]
    rows = np.concatenate([rows, _whole(others, number, weight, level, max(most - len(rows) - len(kept[0]), 0))])
    return np.concatenate([corners[rows], kept[0]]), np.concatenate([rows, of_ground[kept[1]]])


def _away(places: F64, low: F64, high: F64) -> F64:
    """Measure the distance of places to a box [m], shape (N,)."""
    return np.linalg.norm(np.maximum(np.maximum(low - places, places - high), 0.0), axis=-1)


def _wide(corners: F64, number: I64, count: int) -> NDArray[np.bool_]:
    """Tell which objects extend far in plan, shape (count,), bool."""
    low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    np.minimum.at(low, number, corners[..., :2].min(axis=1))
    np.maximum.at(high, number, corners[..., :2].max(axis=1))
    return (high - low).max(axis=1) >= LAND


def _whole(rows: I64, number: I64, weight: F64, level: I64, most: int) -> I64:
    """Take whole objects, by their level and then by how large they appear, as long as they fit; their rows."""
    objects, inverse, counts = np.unique(number[rows], return_inverse=True, return_counts=True)
    if not len(objects):
        return rows
    level_of = np.zeros(len(objects), np.int64)
    level_of[inverse] = level[rows]
    order = np.lexsort((objects, -np.bincount(inverse, weight[rows]), level_of))
    fits, left = np.zeros(len(objects), bool), most
    for one in order:
        if counts[one] <= left:
            fits[one], left = True, left - counts[one]
    return rows[fits[inverse]]


def _cut(corners: F64, rows: I64, low: F64, high: F64, reach: float) -> tuple[F64, I64]:
    """Cut triangles at an outline about a box in plan; what is left, and the row of each."""
    if np.isinf(reach):
        return corners, rows
    for turn in np.arange(SIDES) * (2.0 * np.pi / SIDES):
        normal = np.array([np.cos(turn), np.sin(turn)])
        end = np.where(normal > 0.0, high[:2], low[:2]) @ normal + reach
        beyond = corners[..., :2] @ normal - end
        inside = beyond <= 0.0
        count = inside.sum(axis=1)
        parts, sources = [corners[count == 3]], [rows[count == 3]]
        for some in (1, 2):  # corners inside; the one that is alone on its side comes first
            mine = np.flatnonzero(count == some)
            lone = np.argmax(inside[mine] == (some == 1), axis=1)
            turned = (lone[:, None] + np.arange(3)) % 3
            a, b, c = np.moveaxis(corners[mine[:, None], turned], 1, 0)
            far, second, third = np.moveaxis(beyond[mine[:, None], turned], 1, 0)
            ab = _between(a, b, far, second)
            ac = _between(a, c, far, third)
            parts += [np.stack([a, ab, ac], 1)] if some == 1 else [np.stack([ab, b, c], 1), np.stack([ab, c, ac], 1)]
            sources += [rows[mine]] * some
        corners, rows = np.concatenate(parts), np.concatenate(sources)
    return corners, rows


def _between(a: F64, b: F64, beyond_a: F64, beyond_b: F64) -> F64:
    """Find where edges cross a plane, from the inner end, so that both triangles at an edge get the same place."""
    swap = (beyond_a > beyond_b)[:, None]
    inner, outer = np.where(swap, b, a), np.where(swap, a, b)
    low, high = np.minimum(beyond_a, beyond_b), np.maximum(beyond_a, beyond_b)
    return inner + (outer - inner) * (low / np.where(low < high, low - high, 1.0))[:, None]


def _coarsened(corners: F64, low: F64, high: F64, most: int) -> tuple[F64, I64]:
    """Merge corners in cells that grow with their distance to a box until few enough triangles are left.

    All corners in a cell go to the same place, whichever triangle they belong to: no gap opens between neighbors.
    """
    rows, cell, merged = np.arange(len(corners)), CELL, corners
    flat = corners.reshape(-1, 3)
    grade = np.floor(np.log2(np.maximum(_away(flat, low, high) / NEAR, 1.0)))
    while len(rows) > most:
        if cell > COARSEST:
            return corners[:0], rows[:0]
        keys = np.column_stack([grade, np.floor(flat / (cell * 2.0**grade)[:, None])]).astype(np.int64)
        _, place = np.unique(keys, axis=0, return_inverse=True)
        place = place.reshape(-1)
        counts = np.bincount(place)
        middle = np.stack([np.bincount(place, flat[:, k]) / counts for k in range(3)], axis=-1)
        of = place.reshape(-1, 3)
        rows = np.flatnonzero((of[:, 0] != of[:, 1]) & (of[:, 1] != of[:, 2]) & (of[:, 2] != of[:, 0]))
        merged = middle[of[rows]]
        cell *= GROWTH
    return merged, rows
