"""Cards: flat pieces of a plant whose outline is cut out of a texture, and their cells on the sheet of sprays."""

import numpy as np
from numpy.typing import NDArray

from authoring.shapes.component import Mesh

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

ROWS = 4  # cells along a side of the sheet
CELL = 1.0  # side of a cell [m of `st`]
# Cells of the sheet, counted from its lower left corner, row by row. A branch points up in its cell, from the lower
# edge.
SPRAYS: dict[str, tuple[int, ...]] = {
    "oak": (0, 1, 2),
    "lime": (3, 4),
    "willow": (5, 6),
    "scrub": (7,),
    "spruce": (8, 9),
    "pine": (10,),
    "twigs": (11,),
    "grass": (12, 13),
    "herbs": (14,),
    "reed": (15,),
}
LIFT = 0.003  # of each side from the middle of a card, so that the near one hides the far one [m]
INSET = 0.006  # of a cell, so that filtering does not reach its neighbor [m of `st`]


def cards(middle: F64, across: F64, up: F64, cells: I64, normals: F64) -> Mesh:
    """Make a card at each place, a face for each of its sides: both are lit alike, because light passes through leaves.

    Args:
        middle: Middles of the cards [m], shape (N, 3), float64.
        across: From the middle to the right edge [m], shape (N, 3), float64.
        up: From the middle to the upper edge [m], shape (N, 3), float64.
        cells: Cells of the sheet, shape (N,), int64.
        normals: Unit normals for shading, at each corner of each card [1], shape (N, 4, 3), float64.

    Returns:
        Two quads for each, back to back.
    """
    corner = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    points = middle[:, None] + corner[:, :1] * across[:, None] + corner[:, 1:] * up[:, None]
    inside = np.where(corner > 0, CELL - INSET, INSET)
    st = CELL * np.column_stack([cells % ROWS, cells // ROWS])[:, None] + inside
    facing = _unit(np.cross(across, up))[:, None] * LIFT
    points = np.concatenate([points + facing, (points - facing)[:, ::-1]], axis=1)
    return Mesh(
        points=points.reshape(-1, 3),
        face_counts=np.full(2 * len(middle), 4, np.int32),
        corners=np.arange(8 * len(middle), dtype=np.int32),
        normals=np.concatenate([normals, normals[:, ::-1]], axis=1).reshape(-1, 3).astype(np.float32),
        st=np.concatenate([st, st[:, ::-1]], axis=1).reshape(-1, 2).astype(np.float32),
    )


def spray(rng: np.random.Generator, kind: str, count: int) -> I64:
    """Draw cells of a kind.

    Args:
        rng: Random stream.
        kind: A row of `SPRAYS`.
        count: Number.

    Returns:
        Cells, shape (count,), int64.
    """
    return np.array(SPRAYS[kind], np.int64)[rng.integers(0, len(SPRAYS[kind]), count)]


def crown(
    rng: np.random.Generator, middle: F64, half: F64, mass: tuple[F64, F64], count: int, *, kind: str, size: float
) -> Mesh:
    """Cover a lobe of a crown with sprays, most of them near its surface; shaded as one round mass.

    Args:
        rng: Random stream.
        middle: Its middle [m], shape (3,), float64.
        half: Its half axes [m], shape (3,), float64.
        mass: Middle and half axes of the whole crown [m], shapes (3,), float64.
        count: Number of cards.
        kind: A row of `SPRAYS`.
        size: Side of a card [m].

    Returns:
        Cards that face outwards, each turned and tilted at random.
    """
    outward = _spread(rng, count)
    lumps = 1.0 + 0.16 * np.sin(outward @ rng.normal(0.0, 2.6, (3, 5)) + rng.uniform(0.0, 6.28, 5)).sum(1) / 2.2
    depth = (0.97 - 0.42 * rng.random(count) ** 1.6) * lumps
    facing = _unit(outward + rng.uniform(-0.75, 0.75, (count, 3)))
    upright = _unit(np.cross(facing, rng.normal(size=(count, 3))))
    across = np.cross(upright, facing)
    reach = 0.5 * size * rng.uniform(0.78, 1.22, count)[:, None]
    at = middle + half * outward * depth[:, None]
    corner = at[:, None] + reach[:, None] * (
        np.array([[-1], [1], [1], [-1]]) * across[:, None] + np.array([[-1], [-1], [1], [1]]) * upright[:, None]
    )
    whole = (corner - mass[0]) / mass[1]
    normals = _unit(_unit((corner - middle) / half) + 0.8 * whole + 0.25 * facing[:, None] + np.array([0.0, 0.0, 0.15]))
    return cards(at, reach * across, reach * upright, spray(rng, kind, count), normals)


def tuft(rng: np.random.Generator, kind: str, count: int, width: float) -> Mesh:
    """Make a tuft 1 m high of upright cards that cross in its middle.

    Args:
        rng: Random stream.
        kind: A row of `SPRAYS`.
        count: Number of cards.
        width: Width of a card [m].

    Returns:
        The cards; their lower edges must be in the ground.
    """
    turn = np.pi * (np.arange(count) + rng.uniform(-0.3, 0.3, count)) / count
    across = 0.5 * width * np.column_stack([np.cos(turn), np.sin(turn), np.zeros(count)])
    lean = np.column_stack([rng.uniform(-0.16, 0.16, (count, 2)), np.full(count, 0.5)])
    aside = np.column_stack([-np.sin(turn), np.cos(turn), np.zeros(count)]) * rng.uniform(-0.2, 0.2, (count, 1)) * width
    middle = aside + lean - np.array([0.0, 0.0, 0.14])
    normals = np.tile(_unit(np.array([0.0, 0.0, 1.0]) + 0.25 * rng.normal(size=(count, 1, 3))), (1, 4, 1))
    return cards(middle, across, lean, spray(rng, kind, count), normals)


def _spread(rng: np.random.Generator, count: int) -> F64:
    """Distribute directions evenly over a sphere except its lowest part, shape (count, 3), float64."""
    turn = np.pi * (1.0 + np.sqrt(5.0)) * (np.arange(count) + rng.uniform(0.0, 0.7, count))
    height = 1.0 - 1.82 * (np.arange(count) + rng.uniform(0.1, 0.9, count)) / count
    ring = np.sqrt(np.maximum(1.0 - height * height, 0.0))
    return np.stack([ring * np.cos(turn), ring * np.sin(turn), height], 1)


def _unit(vectors: F64) -> F64:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)
