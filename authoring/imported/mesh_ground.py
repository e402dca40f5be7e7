"""Detection of the ground triangles of an imported world.

The lowest surface over each cell of a grid is opened with increasingly wide windows: a cell that is higher than the
ground may rise within a window counts as built. A triangle is ground if it is no steeper than a bank and all of it is
close to the remaining surface. The rule needs no names, closed solids or face orientations, which photogrammetry does
not have.

Source: K. Zhang et al., A Progressive Morphological Filter for Removing Nonground Measurements from Airborne LIDAR
Data, IEEE TGRS 41(4), 2003 (on surfaces instead of points; the values are ours).
"""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, grey_opening, map_coordinates, median_filter
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from authoring.imported.model import face_normals

F64 = NDArray[np.float64]

CELL = 1.5  # [m], wider if the grid would have too many cells
MOST_CELLS = 1500  # along a side
WINDOWS = (6.0, 15.0, 30.0, 60.0, 120.0)  # [m]
SLOPE = 0.3  # largest slope of the ground within a window [1]
STEP, MOST_STEP = 0.6, 4.0  # [m] by which a cell may be higher in any window
TALL = 0.9  # [m] largest height of a ground triangle above it
FLATTEST = 0.3  # least |rise of the normal| of a triangle of the ground [1]
_SPIKE = 8.0  # [m] depth below the surroundings from which on a cell is noise
_WELD = 1000.0  # corners within 1 mm are merged [1/m]
_SAMPLES = 6_000_000


def ground_triangles(triangles: F64) -> NDArray[np.bool_]:
    """Find which triangles are ground.

    Args:
        triangles: Corners [m], z up, shape (T, 3, 3), float64.

    Returns:
        Whether each is, shape (T,), bool.
    """
    points = triangles.reshape(-1, 3)
    low, size = points.min(axis=0)[:2], np.ptp(points, axis=0)[:2]
    cell = max(CELL, float(size.max()) / MOST_CELLS)
    width, height = (int(n) + 1 for n in size / cell)
    heights = opened(_filled(lowest(triangles, low, cell, (width, height))), cell)
    row, column = ((points[:, axis] - low[axis]) / cell - 0.5 for axis in (1, 0))
    over = points[:, 2] - map_coordinates(heights, [row, column], order=1, mode="nearest")
    level = np.abs(face_normals(triangles)[:, 2]) > FLATTEST
    return level & (over.reshape(-1, 3).max(axis=1) < TALL)


def lowest(triangles: F64, low: F64, cell: float, shape: tuple[int, int]) -> F64:
    """Find the lowest surface over each cell.

    Args:
        triangles: Corners [m], shape (T, 3, 3), float64.
        low: Lowest corner of the grid in plan [m], shape (2,), float64.
        cell: Size of its cells [m].
        shape: Number of cells along x and y.

    Returns:
        Heights, rows along y [m], shape (H, W), float64; infinite where there is no surface.
    """
    width, height = shape
    grid = np.full(height * width, np.inf)
    spread = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2)[:, :].max(axis=1)
    steps = np.clip(np.ceil(spread / cell), 1, 400).astype(int)
    while np.sum((steps + 1.0) * (steps + 2.0) / 2.0) > _SAMPLES and steps.max() > 1:
        steps = np.maximum(steps // 2, 1)
    for count in np.unique(steps):
        a, b = (line.ravel() for line in np.meshgrid(*(np.arange(count + 1),) * 2))
        inside = a + b <= count
        share = np.stack([count - a - b, a, b], axis=1)[inside] / count
        spots = (share @ triangles[steps == count]).reshape(-1, 3)
        column, row = (
            np.clip(((spots[:, k] - low[k]) / cell).astype(int), 0, most - 1) for k, most in ((0, width), (1, height))
        )
        np.minimum.at(grid, row * width + column, spots[:, 2])
    return grid.reshape(height, width)


def _filled(grid: F64) -> F64:
    """Fill cells without a surface with the height of the nearest one [m], shape (H, W), float64."""
    nearest = distance_transform_edt(~np.isfinite(grid), return_distances=False, return_indices=True)
    return grid[tuple(np.asarray(nearest))]


def opened(heights: F64, cell: float) -> F64:
    """Remove objects that rise above a surface.

    Args:
        heights: Heights [m], shape (H, W), float64.
        cell: Size of the cells [m].

    Returns:
        Heights of the ground [m], shape (H, W), float64.
    """
    typical = median_filter(heights, size=9, mode="nearest")
    ground = np.where(heights < typical - _SPIKE, typical, heights)
    before = 0.0
    for window in WINDOWS:
        size = 2 * int(np.ceil(0.5 * window / cell)) + 1
        lower = grey_opening(ground, size=(size, size), mode="nearest")
        allowed = min(STEP + SLOPE * 0.5 * (window - before), MOST_STEP)
        ground, before = np.where(ground - lower > allowed, lower, ground), window
    return ground


def objects_of(triangles: F64) -> NDArray[np.int32]:
    """Group triangles that share corners.

    Args:
        triangles: Corners [m], shape (T, 3, 3), float64.

    Returns:
        Number of each triangle's object, numbered from 0 in their order, shape (T,), int32.
    """
    if not len(triangles):
        return np.zeros(0, np.int32)
    keys = np.round(triangles.reshape(-1, 3) * _WELD).astype(np.int64)
    _, vertex = np.unique(keys, axis=0, return_inverse=True)
    corner = vertex.reshape(-1, 3)
    count = int(corner.max()) + 1
    first, second = corner[:, [0, 1]].ravel(), corner[:, [1, 2]].ravel()
    links = coo_matrix((np.ones(len(first), bool), (first, second)), shape=(count, count))
    _, group = connected_components(links, directed=False)
    _, place, number = np.unique(group[corner[:, 0]], return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(place, kind="stable"), kind="stable")
    return rank[number.reshape(-1)].astype(np.int32)
