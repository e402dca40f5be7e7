"""Free space of a drone: the cells of a box that are far enough from bridge and ground, and paths between them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, sparse
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree

from authoring.surveys.box import OrientedBox
from authoring.surveys.subject import Subject

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Cells = NDArray[np.bool_]

# One of each pair of opposite neighbors among the 26 of a cell.
NEIGHBORS = tuple((i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1) if (i, j, k) > (0, 0, 0))


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """The cells of a box.

    Attributes:
        box: The box.
        edge: Length of a cell's edge [m].
        clearance: Distance of each cell's middle to the nearest surface, rounded to centimeters [m], shape (X, Y, Z).
        free: Whether the whole cell is at a safe distance, and is in the largest connected part, shape (X, Y, Z).
        cut_off: Whether it is at a safe distance, but not connected, shape (X, Y, Z).
    """

    box: OrientedBox
    edge: float
    clearance: F64
    free: Cells
    cut_off: Cells

    def middles(self, cells: I64) -> F64:
        """Find the middles of cells.

        Args:
            cells: Numbers along the box's axes, shape (N, 3), int64.

        Returns:
            World positions [m], shape (N, 3), float64.
        """
        return self.box.to_world((cells + 0.5) * self.edge - 0.5 * self.edge * np.array(self.free.shape))


def cut_free_space(box: OrientedBox, subject: Subject, edge: float, safety: float, over_ground: float) -> FreeSpace:
    """Find the cells of a box in which a drone is at a safe distance.

    Source: Shi 2024, local scenario: voxels of the local bounding box, dilated by a safety radius; its values are
        unknown.

    Args:
        box: Box of the flight.
        subject: Bridge and site.
        edge: Length of a cell's edge [m].
        safety: Least distance to bridge and site, anywhere in a free cell [m].
        over_ground: Least height of a cell's middle over ground or water [m].
    """
    shape = tuple(int(count) for count in np.maximum(np.floor(2.0 * box.half / edge + 1e-9), 1.0))
    nothing = np.zeros(shape, bool)
    space = FreeSpace(box, edge, np.zeros(shape), nothing, nothing)
    cells = np.stack(np.meshgrid(*(np.arange(count) for count in shape), indexing="ij"), axis=-1).reshape(-1, 3)
    middles = space.middles(cells)
    clearance = np.round(subject.clearance(middles), 2)
    far = clearance > safety + 0.5 * np.sqrt(3.0) * edge  # no corner of the cell is nearer
    columns = space.middles(np.column_stack([cells[:: shape[2], :2], np.zeros(len(cells) // shape[2], np.int64)]))
    ground = np.repeat(subject.ground_height(columns[:, :2]), shape[2])
    free = (far & (middles[:, 2] > ground + over_ground) & np.isfinite(ground)).reshape(shape)
    largest = largest_part(free)
    return FreeSpace(box, edge, clearance.reshape(shape), largest, free & ~largest)


def gap_between(space: FreeSpace) -> F64 | None:
    """Find the middle between the largest part of the free space and the nearest part that is not connected to it.

    Args:
        space: The cells.

    Returns:
        A world position [m], shape (3,), float64, or None where all free cells are connected.
    """
    if not space.cut_off.any():
        return None
    inside, outside = (space.middles(np.argwhere(cells)) for cells in (space.free, space.cut_off))
    away, rows = (np.asarray(found) for found in KDTree(inside).query(outside))
    nearest = int(np.argmin(away))
    return 0.5 * (outside[nearest] + inside[int(rows[nearest])])


def largest_part(free: Cells) -> Cells:
    """Keep the largest connected group of cells, diagonals included.

    Args:
        free: Cells at a safe distance, shape (X, Y, Z).

    Returns:
        Those of them that are connected, shape (X, Y, Z), bool.
    """
    parts = np.asarray(ndimage.label(free, structure=np.ones((3, 3, 3)))[0])  # pyright: ignore[reportIndexIssue]
    sizes = np.bincount(parts.ravel())
    sizes[0] = 0
    return free & (parts == int(np.argmax(sizes)))


@dataclass(frozen=True, eq=False)
class Ways:
    """The graph of the free cells.

    Attributes:
        costs: Cost of a step from one free cell to a neighbor [m].
    """

    costs: sparse.csr_matrix

    def between(self, start: int, end: int) -> I64:
        """Find the cheapest way.

        Args:
            start: Row of the first cell.
            end: Row of the last cell.

        Returns:
            Rows of the cells on the way, shape (M,), int64.
        """
        _, before = dijkstra(self.costs, directed=False, indices=start, return_predecessors=True)
        way = [end]
        while way[-1] != start:
            way.append(int(before[way[-1]]))
        return np.array(way[::-1], np.int64)


def link_cells(space: FreeSpace, weight: F64) -> Ways:
    """Link the free cells with all of their free neighbors.

    Args:
        space: The cells.
        weight: Cost per meter in each cell [1], shape (X, Y, Z), float64.
    """
    number = np.full(space.free.shape, -1, np.int64)
    count = int(space.free.sum())
    number[space.free] = np.arange(count)
    rows, columns, costs = [], [], []
    for step in NEIGHBORS:
        here = tuple(slice(max(0, -s), n - max(0, s)) for s, n in zip(step, space.free.shape, strict=True))
        there = tuple(slice(max(0, s), n - max(0, -s)) for s, n in zip(step, space.free.shape, strict=True))
        both = space.free[here] & space.free[there]
        rows.append(number[here][both])
        columns.append(number[there][both])
        costs.append(np.linalg.norm(step) * space.edge * 0.5 * (weight[here][both] + weight[there][both]))
    pairs = (np.concatenate(costs), (np.concatenate(rows), np.concatenate(columns)))
    return Ways(sparse.csr_matrix(pairs, shape=(count, count)))


def smooth_field(shape: tuple[int, ...], cells: float, rng: np.random.Generator) -> F64:
    """Draw a random field of mean 0 and deviation 1 with a correlation length.

    Args:
        shape: Its shape.
        cells: Length over which it changes [cells].
        rng: Random stream.

    Returns:
        Values [1], shape (...) as wanted, float64.
    """
    field = ndimage.gaussian_filter(rng.random(shape) - 0.5, 0.5 * cells, mode="reflect")
    return (field - field.mean()) / max(float(field.std()), 1e-12)
