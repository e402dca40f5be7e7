"""Texels of an atlas that each triangle covers."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Bools = NDArray[np.bool_]

_TINY = 1e-12  # [px^2] twice the area of the largest triangles that are not drawn
_AT_ONCE = 2_000_000  # texels in the boxes around the triangles that are processed together


@dataclass(frozen=True, eq=False)
class Cover:
    """Pairs of triangles and texels, triangle by triangle.

    Attributes:
        triangle: Row of each triangle, shape (N,), int64.
        texel: Row of each texel in the flat atlas, shape (N,), int64.
        weights: Share of each corner at its middle [1], shape (N, 3), float64.
        thin: Whether the triangle covers no texel center, and this texel contains it, shape (N,), bool.
    """

    triangle: I64
    texel: I64
    weights: F64
    thin: Bools


def covers(corners: F64, texels: int) -> Iterator[Cover]:
    """Find the texels whose middles lie in triangles.

    Args:
        corners: Triangles on the atlas [px], shape (T, 3, 2), float64, v downwards.
        texels: Texels along a side of the atlas [px].

    Yields:
        Texels of consecutive triangles; those of no area are left out.
    """
    low = np.clip(np.floor(corners.min(axis=1) - 0.5), 0, texels - 1).astype(np.int64)
    high = np.clip(np.ceil(corners.max(axis=1) + 0.5), 1, texels).astype(np.int64)
    one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    drawn = np.flatnonzero((np.abs(area) >= _TINY) & (high > low).all(axis=1))
    ends = np.cumsum((high[drawn] - low[drawn]).prod(axis=1))
    start = 0
    while start < len(drawn):
        before = ends[start - 1] if start else 0
        stop = max(int(np.searchsorted(ends, before + _AT_ONCE, side="right")), start + 1)
        yield _cover(corners, drawn[start:stop], low, high, texels)
        start = stop


def _cover(corners: F64, rows: I64, low: I64, high: I64, texels: int) -> Cover:
    size = high[rows] - low[rows]
    count = size.prod(axis=1)
    which = np.repeat(np.arange(len(rows)), count)
    step = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    column = low[rows, 0][which] + step % size[which, 0]
    line = low[rows, 1][which] + step // size[which, 0]
    first = corners[rows, 0]
    one, two = corners[rows, 1] - first, corners[rows, 2] - first
    area = (one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])[which]
    x, y = column + 0.5 - first[which, 0], line + 0.5 - first[which, 1]
    second = (x * two[which, 1] - y * two[which, 0]) / area
    third = (one[which, 0] * y - one[which, 1] * x) / area
    inside = (second >= 0) & (third >= 0) & (second + third <= 1)
    second, third = second[inside], third[inside]
    thin = np.setdiff1d(np.arange(len(rows)), which[inside])
    middle = np.clip(corners[rows[thin]].mean(axis=1).astype(np.int64), 0, texels - 1)
    return Cover(
        rows[np.concatenate([which[inside], thin])],
        np.concatenate([line[inside] * texels + column[inside], middle[:, 1] * texels + middle[:, 0]]),
        np.concatenate([np.stack([1 - second - third, second, third], axis=-1), np.full((len(thin), 3), 1 / 3)]),
        np.repeat([False, True], [len(second), len(thin)]),
    )
