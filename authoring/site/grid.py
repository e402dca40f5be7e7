"""A height field on a graded tensor grid in bridge coordinates: lines, heights, exact interpolation, normals."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
STEEP = 1.0  # faces steeper than this are retained by walls, and do not contribute to the normals of their neighbors


@dataclass(frozen=True)
class HeightField:
    """Heights on a tensor grid; each cell is two triangles that meet on the diagonal from its low to its high corner.

    Attributes:
        stations: Grid lines along the axis [m], rising, shape (S,), float64.
        lefts: Grid lines to the left of the axis [m], rising, shape (L,), float64.
        heights: World heights [m], shape (S, L), float64.
    """

    stations: F64
    lefts: F64
    heights: F64

    def __call__(self, station: F64, left: F64) -> F64:
        """Interpolate the triangles exactly; outside the grid, the height of the nearest edge is used.

        Args:
            station: Distance along the axis [m], shape (N,), float64.
            left: Distance to the left of the axis [m], shape (N,), float64.

        Returns:
            World heights [m], shape (N,), float64.
        """
        row, along = _cell(self.stations, station)
        column, across = _cell(self.lefts, left)
        low, high = self.heights[row, column], self.heights[row + 1, column + 1]
        ahead, beside = self.heights[row + 1, column], self.heights[row, column + 1]
        first = low + along * (ahead - low) + across * (high - ahead)
        second = low + across * (beside - low) + along * (high - beside)
        return np.where(along >= across, first, second)

    def nodes(self) -> F64:
        """List the nodes in bridge coordinates: station, left, height [m], shape (S * L, 3), float64."""
        station, left = np.meshgrid(self.stations, self.lefts, indexing="ij")
        return np.stack([station, left, self.heights], axis=-1).reshape(-1, 3)

    def triangles(self) -> I64:
        """List the triangles, counter-clockwise from above: node numbers, shape (2 * (S-1) * (L-1), 3), int64."""
        numbers = np.arange(self.heights.size).reshape(self.heights.shape)
        low, ahead = numbers[:-1, :-1], numbers[1:, :-1]
        beside, high = numbers[:-1, 1:], numbers[1:, 1:]
        pairs = np.stack([np.stack([low, ahead, high], -1), np.stack([low, high, beside], -1)], axis=2)
        return pairs.reshape(-1, 3)


def surface_normals(nodes: F64, faces: I64) -> F64:
    """Average the face normals at each node, weighted by plan area; near-vertical faces do not count.

    Args:
        nodes: Positions, z up [m], shape (N, 3), float64.
        faces: Triangles seen counter-clockwise from above, shape (T, 3), int64.

    Returns:
        Unit normals [1], shape (N, 3), float64.
    """
    corner = nodes[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    slope = np.hypot(normal[:, 0], normal[:, 1]) / normal[:, 2]
    weight = np.where(slope > STEEP, 1e-6, 1.0)
    total = np.zeros_like(nodes)
    for vertex in range(3):
        for axis in range(3):
            total[:, axis] += np.bincount(faces[:, vertex], normal[:, axis] * weight, len(nodes))
    return total / np.linalg.norm(total, axis=1, keepdims=True)


def graded_lines(fixed: tuple[float, ...], fine: tuple[float, float], spacing: float, coarse: float) -> F64:
    """Place grid lines: equally fine in the middle, increasingly wide towards both ends.

    Args:
        fixed: Lines that must exist [m]; the first and last bound the grid.
        fine: Range with at most `spacing` [m].
        spacing: Largest distance between lines there [m].
        coarse: Largest distance anywhere [m].

    Returns:
        Lines [m], rising, shape (N,), float64.
    """
    low, high = max(fine[0], min(fixed)), min(fine[1], max(fixed))
    inner = sorted({low, high, *(value for value in fixed if low < value < high)})
    pieces = [np.linspace(a, b, int(np.ceil((b - a) / spacing - 1e-9)) + 1) for a, b in pairwise(inner)]
    ahead = growing_steps(max(fixed) - high, spacing, coarse)
    behind = growing_steps(low - min(fixed), spacing, coarse)
    lines = np.concatenate([low - behind[::-1], *pieces, high + ahead])
    return np.unique(np.round(lines, 4))


def growing_steps(reach: float, first: float, largest: float, ratio: float = 1.24) -> F64:
    """Count outwards in steps that grow by a constant ratio up to a largest step, and end exactly at `reach`.

    Args:
        reach: Distance of the last line [m].
        first: Size of the step before the first [m].
        largest: Largest step [m].
        ratio: Growth from step to step [1].

    Returns:
        Distances [m], rising, the last equal to `reach`, shape (N,), float64; empty when `reach` is 0.
    """
    if reach <= 0:
        return np.zeros(0)
    steps, total = [], 0.0
    while total < reach:
        steps.append(min(first * ratio ** (len(steps) + 1), largest))
        total += steps[-1]
    distances = np.cumsum(steps) * (reach / total)
    distances[-1] = reach
    return distances


def _cell(lines: F64, value: F64) -> tuple[I64, F64]:
    index = np.clip(np.searchsorted(lines, value, side="right") - 1, 0, len(lines) - 2)
    share = (value - lines[index]) / (lines[index + 1] - lines[index])
    return index, np.clip(share, 0.0, 1.0)
