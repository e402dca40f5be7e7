"""Metric tiles of a cloud, cut by the same code for training and for prediction, from points only.

A tile is a square of fixed size. Its positions are relative to its center and to the ground, which is estimated from
the points; labels, the axis of the bridge and the stage are not needed.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from learn.datasets.ground import estimate_ground
from learn.datasets.labeled_cloud import HEIGHT
from learn.datasets.settings import TileSettings
from learn.datasets.voxels import VoxelCloud, add_points, empty_cloud, lay_grid

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Tile:
    """A square of a cloud.

    Attributes:
        place: Index of the square along x and y.
        rows: Its points in the voxel cloud, ascending, shape (N,), int64.
        origin: Center of the square, at the height of the ground [m], shape (3,), float64.
    """

    place: tuple[int, int]
    rows: I64
    origin: F64

    @property
    def seed(self) -> int:
        """Compute the seed of the draws from this tile from its place, so that training and prediction agree."""
        return ((self.place[0] + (1 << 20)) << 21) | (self.place[1] + (1 << 20))


def thin(coord: F64, columns: Mapping[str, NDArray[Any]], settings: TileSettings) -> VoxelCloud:
    """Keep one point in each cube of a cloud in memory.

    Args:
        coord: Positions [m], shape (N, 3), float64, at least one.
        columns: Further columns, shape (N,) or (N, C) each.
        settings: Size of the cubes.
    """
    grid = lay_grid(coord.min(axis=0), coord.max(axis=0), settings.voxel)
    return add_points(empty_cloud(grid), coord, columns)


def with_heights(cloud: VoxelCloud, settings: TileSettings) -> VoxelCloud:
    """Add the height of every point above the estimated ground, which on slopes differs from z.

    Args:
        cloud: Thinned points, at least one.
        settings: Distance within which the ground is estimated.

    Returns:
        The cloud with a column `height` [m], shape (V,), float32.
    """
    heights = estimate_ground(cloud.coord).heights_above(cloud.coord, settings.height_reach)
    return VoxelCloud(cloud.grid, cloud.keys, cloud.coord, {**cloud.columns, HEIGHT: heights})


def cut_tiles(cloud: VoxelCloud, settings: TileSettings) -> Iterator[Tile]:
    """Cut a thinned cloud into overlapping tiles, row by row; every point is in the same number of tiles.

    Args:
        cloud: Thinned points, at least one.
        settings: Size, distance and ground.

    Yields:
        The tiles that hold points.
    """
    times = round(settings.size / settings.stride)
    cell = np.floor((cloud.coord[:, :2] - cloud.grid.origin[:2]) / settings.stride).astype(np.int64)
    width = int(cell[:, 1].max()) + 1
    key = cell[:, 0] * width + cell[:, 1]
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    runs = np.split(order, first[1:])
    cells = {(int(k) // width, int(k) % width): run for k, run in zip(key[order][first], runs, strict=True)}
    steps = range(times)
    places = sorted({(i - a, j - b) for i, j in cells for a in steps for b in steps})
    centers = cloud.grid.origin[:2] + np.array(places) * settings.stride + 0.5 * settings.size
    heights = estimate_ground(cloud.coord).below(centers, settings.ground_reach)
    for (i, j), center, height in zip(places, centers, heights, strict=True):
        inside = [cells[i + a, j + b] for a in steps for b in steps if (i + a, j + b) in cells]
        yield Tile((i, j), np.sort(np.concatenate(inside)), np.array([*center, height]))
