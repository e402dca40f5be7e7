"""Voxel grids: one point for each cube, independent of the chunks in which the points are read."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_BITS = 21  # bits of each axis in a key
_MOST_CELLS = 1 << _BITS


@dataclass(frozen=True, eq=False)
class VoxelGrid:
    """A grid of cubes over a cloud.

    Attributes:
        origin: Lower corner of the first cube, in whole meters [m], shape (3,), float64.
        size: Side of a cube [m].
    """

    origin: F64
    size: float

    def keys(self, coord: F64) -> I64:
        """Compute the keys of the points' cubes.

        Args:
            coord: Positions [m], shape (N, 3), float64, none below the origin.

        Returns:
            Key of each cube, shape (N,), int64.
        """
        cell = np.floor((coord - self.origin) / self.size).astype(np.int64)
        return (cell[:, 0] << 2 * _BITS) | (cell[:, 1] << _BITS) | cell[:, 2]


def lay_grid(low: F64, high: F64, size: float, where: object = None) -> VoxelGrid:
    """Make a grid of cubes over a box.

    Args:
        low: Lower corner of the cloud [m], shape (3,), float64.
        high: Upper corner [m], shape (3,), float64.
        size: Side of a cube [m].
        where: The cloud, for the error message.

    Raises:
        InputError: More cubes along an axis than can be numbered.
    """
    origin = np.floor(low)
    most = _MOST_CELLS * size
    if ((high - origin) >= most).any():
        raise InputError(
            f"the points extend over {float((high - low).max()):.0f} m",
            where=where,
            field="voxel",
            value=size,
            allowed=f"at most {most:.0f} m with cubes of this size",
            hint="Remove stray points, or check the unit",
        )
    return VoxelGrid(origin, size)


@dataclass(frozen=True, eq=False)
class VoxelCloud:
    """The first point, in the order of the file, in every cube that holds points.

    Attributes:
        grid: The cubes.
        keys: Key of each cube, ascending, shape (V,), int64.
        coord: Position of its point [m], shape (V, 3), float64.
        columns: Further columns of these points, shape (V,) or (V, C) each.
    """

    grid: VoxelGrid
    keys: I64
    coord: F64
    columns: Mapping[str, NDArray[Any]]

    def __len__(self) -> int:
        """Count the cubes."""
        return len(self.keys)

    def find(self, coord: F64) -> I64:
        """Find the cubes of points; each must be in a known cube.

        Args:
            coord: Positions [m], shape (N, 3), float64.

        Returns:
            Row of each, shape (N,), int64.
        """
        return np.searchsorted(self.keys, self.grid.keys(coord))


def empty_cloud(grid: VoxelGrid) -> VoxelCloud:
    """Make a cloud without points.

    Args:
        grid: The cubes.
    """
    return VoxelCloud(grid, np.zeros(0, np.int64), np.zeros((0, 3)), {})


def add_points(cloud: VoxelCloud, coord: F64, columns: Mapping[str, NDArray[Any]]) -> VoxelCloud:
    """Add the next points of a file; points in cubes that already have one are skipped.

    Args:
        cloud: The cloud so far.
        coord: Positions [m], shape (N, 3), float64.
        columns: Further columns, the same in every call, shape (N,) or (N, C) each.
    """
    keys, first = np.unique(cloud.grid.keys(coord), return_index=True)
    at = np.searchsorted(cloud.keys, keys)
    known = np.zeros(len(keys), bool)
    inside = at < len(cloud.keys)
    known[inside] = cloud.keys[at[inside]] == keys[inside]
    keys, first = keys[~known], first[~known]
    if not len(cloud):
        return VoxelCloud(cloud.grid, keys, coord[first], {name: values[first] for name, values in columns.items()})
    merged = np.concatenate([cloud.keys, keys])
    order = np.argsort(merged, kind="stable")
    return VoxelCloud(
        cloud.grid,
        merged[order],
        np.concatenate([cloud.coord, coord[first]])[order],
        {name: np.concatenate([cloud.columns[name], values[first]])[order] for name, values in columns.items()},
    )
