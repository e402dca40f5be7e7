"""Every place around a whole bridge that is allowed and reachable for a drone."""

import numpy as np
from numpy.typing import NDArray

from authoring.surveys.box import OrientedBox, oriented_box
from authoring.surveys.freespace import largest_part
from authoring.surveys.subject import Subject

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Cells = NDArray[np.bool_]

BLOCK = 4  # cells along the edge of a block that one query may decide as a whole
MOST_CELLS = 4_000_000  # above it, cells are enlarged, to limit the memory for long bridges
FOOT = 0.5  # [m] depth of the box under the lowest ground


def free_places(
    subject: Subject, edge: float, reach: float, safety: float, over_ground: float, shift: F64 | None = None
) -> F64:
    """Divide the space around a bridge into cells; keep those that are far enough from everything, and connected.

    The distance to a surface changes by no more than the distance moved: the middle of a block of cells decides for
    most blocks that all of their cells are free, or too far from the bridge.

    Args:
        subject: Bridge and site.
        edge: Length of a cell's edge [m].
        reach: Greatest distance of a cell's middle to the bridge [m].
        safety: Least distance to bridge and site, anywhere in a cell [m].
        over_ground: Least height of a cell's middle over ground or water [m].
        shift: Shift of the cells, in edges [1], shape (3,), float64.

    Returns:
        Middles of the cells in the order of the box's axes [m], shape (N, 3), float64.
    """
    box = _box(subject, reach)
    edge = max(edge, float(np.prod(2.0 * box.half) / MOST_CELLS) ** (1.0 / 3.0))
    blocks = np.ceil(2.0 * box.half / (edge * BLOCK)).astype(np.int64) + 1
    corner = -box.half - edge * (np.ones(3) if shift is None else 1.0 + shift)
    free = _free_cells(subject, box, corner, blocks, edge, (reach, safety))
    columns = np.argwhere(free.any(axis=2))
    flat = np.column_stack([corner[:2] + (columns + 0.5) * edge, np.zeros(len(columns))])
    ground = np.full(free.shape[:2], np.inf)
    height = subject.ground_height(box.to_world(flat)[:, :2])
    ground[tuple(columns.T)] = np.where(np.isfinite(height), height, np.inf)
    levels = box.center[2] + corner[2] + (np.arange(free.shape[2]) + 0.5) * edge
    free &= levels[None, None, :] > ground[:, :, None] + over_ground
    if not free.any():
        return np.zeros((0, 3))
    return box.to_world(corner + (np.argwhere(largest_part(free)) + 0.5) * edge)


def _box(subject: Subject, reach: float) -> OrientedBox:
    box = oriented_box(subject.bridge.reshape(-1, 3))
    half = box.half + np.array([reach, reach, 0.0])
    plan = np.array([[x, y, 0.0] for x in np.linspace(-1, 1, 9) for y in np.linspace(-1, 1, 9)]) * half
    ground = subject.ground_height(box.to_world(plan)[:, :2])
    ground = ground[np.isfinite(ground)] - box.center[2]
    low = max(float(ground.min()) if len(ground) else -np.inf, -float(half[2]) - reach) - FOOT
    high = float(half[2]) + reach
    center = box.center + np.array([0.0, 0.0, 0.5 * (low + high)])
    return OrientedBox(center, box.axes, np.array([half[0], half[1], 0.5 * (high - low)]))


def _free_cells(
    subject: Subject, box: OrientedBox, corner: F64, blocks: I64, edge: float, distances: tuple[float, float]
) -> Cells:
    """Find which cells are at a safe distance and within reach of the bridge, shape (X, Y, Z), bool."""
    reach, safety = distances
    least = safety + 0.5 * np.sqrt(3.0) * edge  # no corner of the cell is nearer
    numbers = np.stack(np.meshgrid(*(np.arange(count) for count in blocks), indexing="ij"), axis=-1).reshape(-1, 3)
    middles = box.to_world(corner + (numbers + 0.5) * BLOCK * edge)
    spread = 0.5 * np.sqrt(3.0) * (BLOCK - 1) * edge + 0.01  # from a block's middle to those of its cells
    away, clear = subject.surface.distance(middles)[0], subject.clearance(middles)
    near, far_out = away <= reach + spread, (away <= reach - spread) & (clear > least + spread)
    near &= clear > least - spread
    free = np.zeros(tuple(blocks * BLOCK), bool)
    inner = np.stack(np.meshgrid(*(np.arange(BLOCK),) * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    settled = (numbers[far_out][:, None] * BLOCK + inner).reshape(-1, 3)
    free[tuple(settled.T)] = True
    open_cells = (numbers[near & ~far_out][:, None] * BLOCK + inner).reshape(-1, 3)
    places = box.to_world(corner + (open_cells + 0.5) * edge)
    within = np.round(subject.surface.distance(places)[0], 2) <= reach
    within[within] = np.round(subject.clearance(places[within]), 2) > least
    free[tuple(open_cells[within].T)] = True
    return free
