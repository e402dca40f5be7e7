"""Thinning of grid lines: lines of the site's fine grid end where the land beyond does not need them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.site.grid import HeightField

B = NDArray[np.bool_]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

WIDTH = 0.08  # largest ratio of the spacing of lines to their distance from the site [1]
AGAIN = 1.22  # growth of the distance after which lines may end again [1]


@dataclass(frozen=True)
class Middle:
    """The site's lines within a terrain's.

    Attributes:
        stations: Number of its first and of its last station line.
        lefts: Number of its first and of its last left line.
    """

    stations: tuple[int, int]
    lefts: tuple[int, int]

    def sides(self) -> list[tuple[int, slice, slice]]:
        """List the four bands round the site: axis that leads outwards, lines inside the band, lines outwards.

        The bands beside the site reach over the whole length of the terrain; lines outwards begin with the border.
        """
        (first, last), (low, high) = self.stations, self.lefts
        inner = slice(low, high + 1)
        back = (slice(low, None, -1), slice(first, None, -1))
        return [
            (1, slice(None), back[0]),
            (1, slice(None), slice(high, None)),
            (0, inner, back[1]),
            (0, inner, slice(last, None)),
        ]


@dataclass(frozen=True)
class Demands:
    """Error limits of a coarser mesh.

    Attributes:
        heights: World heights [m], shape (S, L), float64.
        slack: Largest height error of the mesh [m], shape (S, L), float64.
        borders: Signed fields whose zero lines bound covers [m], each of shape (S, L), float64.
        shift: Largest error of such a field near its zero line [m], shape (S, L), float64.
    """

    heights: F64
    slack: F64
    borders: tuple[F64, ...]
    shift: F64


def thin_out(field: HeightField, middle: Middle, demands: Demands, wanted: tuple[I64, I64]) -> B:
    """Choose the nodes of a coarser mesh: all nodes along the site's border, fewer lines outwards.

    Args:
        field: The terrain on all its lines.
        middle: The site in it.
        demands: Error limits.
        wanted: Numbers of the station lines and of the left lines that never end, each of shape (K,), int64.

    Returns:
        Whether each node is kept, shape (S, L), bool; a line that ends does not continue farther out.
    """
    kept = np.ones(field.heights.shape, bool)
    for outward, inside, out in middle.sides():
        lines, ways = (field.lefts, field.stations)[::-1] if outward else (field.lefts, field.stations)
        own = np.zeros(len(lines), bool)
        own[wanted[1 - outward]] = True
        view = _band(demands, outward, inside, out)
        away = np.abs(ways[out] - ways[out][0])
        ends = _ends(lines[inside], away, own[inside], view)
        rows = np.arange(len(away)) < ends[:, None]
        part = kept if outward else kept.T
        part[inside, out] = rows
    return kept


def interpolated_heights(heights: F64, field: HeightField, middle: Middle, kept: B) -> F64:
    """Move the omitted nodes to the straight line between those that are kept.

    Args:
        heights: World heights [m], shape (S, L), float64.
        field: The lines.
        middle: The site in them.
        kept: Whether each node is kept, shape (S, L), bool.

    Returns:
        World heights [m], shape (S, L), float64.
    """
    found = heights.copy()
    for outward, inside, out in middle.sides():
        lines = (field.stations if outward else field.lefts)[inside]
        part, mask = (found, kept) if outward else (found.T, kept.T)
        strip, there = part[inside, out], mask[inside, out]
        for row in np.flatnonzero(~there.all(axis=0)):
            use = there[:, row]
            strip[:, row] = np.round(np.interp(lines, lines[use], strip[use, row]), 4)
    return found


def outer_triangles(middle: Middle, kept: B) -> I64:
    """Mesh the kept nodes round the site; it shares every node of its border.

    Args:
        middle: The site.
        kept: Whether each node is kept, shape (S, L), bool.

    Returns:
        Triangles, counter-clockwise from above: node numbers, shape (T, 3), int64.
    """
    numbers = np.arange(kept.size).reshape(kept.shape)
    faces = [np.zeros((0, 3), np.int64)]
    for outward, inside, out in middle.sides():
        own, mask = (numbers, kept) if outward else (numbers.T, kept.T)
        own, mask = own[inside, out], mask[inside, out]
        backwards = out.step == -1
        faces += [
            _ladder(own[:, row : row + 2], mask[:, row : row + 2], backwards, (outward == 1) != backwards)
            for row in range(own.shape[1] - 1)
        ]
    return np.concatenate(faces)


def _band(demands: Demands, outward: int, inside: slice, out: slice) -> Demands:
    def turned(values: F64) -> F64:
        return (values if outward else values.T)[inside, out]

    return Demands(
        turned(demands.heights), turned(demands.slack), tuple(map(turned, demands.borders)), turned(demands.shift)
    )


def _ends(lines: F64, away: F64, wanted: B, demands: Demands) -> I64:
    """Find at which row outwards each line ends, shape (N,), int64; the number of rows for those that go on."""
    ends = np.full(len(lines), len(away))
    kept, again = np.arange(len(lines)), 0.0
    wanted = wanted.copy()
    wanted[[0, -1]] = True
    for row in range(1, len(away)):
        if away[row] < again:
            continue
        again = AGAIN * away[row]
        fewer = _fewer(lines, kept, wanted, WIDTH * float(away[row]), demands, row)
        ends[np.setdiff1d(kept, fewer)] = row
        kept = fewer
    return ends


def _fewer(lines: F64, kept: I64, wanted: B, widest: float, demands: Demands, row: int) -> I64:
    """Remove every second unneeded line from a row outwards; return the numbers of the others."""
    drop = np.zeros(len(kept), bool)
    drop[1:-1:2] = ~wanted[kept[1:-1:2]]
    wide = lines[kept[2:]] - lines[kept[:-2]] > widest
    drop[1:-1] &= ~wide
    trial = kept[~drop]
    place = np.interp(lines, lines[trial], np.arange(len(trial)))
    low = np.minimum(place.astype(np.int64), len(trial) - 2)
    share = (place - low)[:, None]
    one, other = trial[low], trial[low + 1]

    def missed(values: F64) -> tuple[F64, F64]:
        straight = (1.0 - share) * values[one, row:] + share * values[other, row:]
        return np.abs(values[:, row:] - straight), straight

    bad = (missed(demands.heights)[0] > demands.slack[:, row:]).any(axis=1)
    for border in demands.borders:
        error, straight = missed(border)
        close = np.minimum(np.abs(border[:, row:]), np.abs(straight)) < demands.shift[:, row:]
        bad |= ((error > demands.shift[:, row:]) & close).any(axis=1)
    broken = np.zeros(len(trial), bool)
    broken[low[bad]] = True
    back = drop & broken[np.searchsorted(trial, kept, side="right") - 1]
    return np.sort(np.concatenate([trial, kept[back]]))


def _ladder(own: I64, mask: B, backwards: bool, upward: bool) -> I64:
    """Mesh the strip between a row and the next one outwards, whose nodes are some of its own; shape (T, 3)."""
    near, outer = own[mask[:, 0]].T
    far = np.flatnonzero(mask[mask[:, 0], 1])
    start, end = far[:-1], far[1:]
    hinge = np.where(end - start == 1, end if backwards else start, (start + end) // 2)  # the grid's own diagonals
    cell = np.repeat(np.arange(len(start)), end - start)
    apex = np.where(np.arange(len(near) - 1) < hinge[cell], outer[start[cell]], outer[end[cell]])
    fans = np.column_stack([near[:-1], near[1:], apex])
    faces = np.concatenate([fans, np.column_stack([near[hinge], outer[end], outer[start]])])
    return faces if upward else faces[:, ::-1]
