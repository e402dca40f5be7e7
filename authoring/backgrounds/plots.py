"""Plots of buildings on sloping land: rectangles that do not overlap, on land that may be built on."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.terrain import Terrain
from authoring.site.covers import to_world

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
B = NDArray[np.bool_]

DEEP = 4.2  # a building's plinth reaches this far below its floor, and a little more [m]
SILL = 0.35  # largest height of the ground above the floor, at the upper corners [m]


@dataclass(frozen=True, eq=False)
class Plots:
    """Places of buildings.

    Attributes:
        places: Station, left and height of the floor [m], shape (N, 3), float64.
        heading: Direction of the front's x axis from the axis [rad], shape (N,), float64.
        which: Number of the building's design, shape (N,), int32.
        half: Half the length and the depth of each [m], shape (N, 2), float64.
    """

    places: F64
    heading: F64
    which: I32
    half: F64

    def taken(self) -> F64:
        """List station, left and radius of each [m], shape (N, 3), float64."""
        return np.column_stack([self.places[:, :2], np.hypot(*self.half.T)])


@dataclass(frozen=True, eq=False)
class Candidates:
    """Candidate places of buildings.

    Attributes:
        wanted: Station [m], left [m], heading from the axis [rad] and design [1] of each, shape (K, 4), float64.
        halves: Half the length and depth of each design [m], shape (D, 2), float64.
        room: Distance of each to land that must stay empty [m], shape (K,), float64.
        level: Height of the terrace under each [m], shape (K,), float64; None: all stand on the ground.
    """

    wanted: F64
    halves: F64
    room: F64
    level: F64 | None = None


def place_plots(
    terrain: Terrain,
    candidates: Candidates,
    count: int,
    *,
    gap: float = 3.0,
    standing: Plots | None = None,
    deepest: float = DEEP,
) -> Plots:
    """Choose places for buildings, in the order of the candidates.

    Args:
        terrain: The terrain.
        candidates: Candidate places.
        count: Largest number of buildings.
        gap: Between two buildings [m].
        standing: Existing buildings; they are not part of the result.
        deepest: Largest depth of the ground below a floor [m].

    Returns:
        Buildings that do not overlap, on ground within the depth of their plinths.
    """
    wanted, level = candidates.wanted, candidates.level
    which = wanted[:, 3].astype(np.int32)
    half = candidates.halves[which]
    floor, drop = _floors(terrain, wanted, half)
    if level is not None:
        floor, drop = np.round(level + 0.12, 3), np.zeros(len(level))
    fits = (candidates.room > np.hypot(*half.T)) & (drop < deepest)
    world = to_world(terrain.land.layout.alignment, np.column_stack([wanted[:, :2], floor]))
    yaw = wanted[:, 2] + terrain.land.layout.alignment.heading_at(wanted[:, 0])
    rows = [] if standing is None else rectangles(terrain, standing)
    before = len(rows)
    kept = []
    for row in np.flatnonzero(fits):
        if len(kept) == count:
            break
        one = np.array([*world[row, :2], yaw[row], *(half[row] + gap / 2)])
        if not rows or not overlap(one, np.array(rows)).any():
            rows.append(one)
            kept.append(int(row))
    del rows[:before]
    return Plots(np.column_stack([wanted[kept, :2], floor[kept]]), wanted[kept, 2], which[kept], half[kept])


def chosen(plots: Plots, kept: B) -> Plots:
    """Keep some places.

    Args:
        plots: The places.
        kept: Which of them are kept, shape (N,), bool.
    """
    return Plots(plots.places[kept], plots.heading[kept], plots.which[kept], plots.half[kept])


def joined(plots: tuple[Plots, ...]) -> Plots:
    """Concatenate lists of places."""
    return Plots(
        np.concatenate([part.places for part in plots]),
        np.concatenate([part.heading for part in plots]),
        np.concatenate([part.which for part in plots]),
        np.concatenate([part.half for part in plots]),
    )


def downhill(terrain: Terrain, station: F64, left: F64, reach: float = 12.0) -> tuple[F64, F64]:
    """Find the direction of the steepest descent, and its slope.

    Args:
        terrain: The terrain.
        station: Distance along the axis [m], shape (N,), float64.
        left: Distance to the left of the axis [m], shape (N,), float64.
        reach: Half the distance over which the slope is measured [m].

    Returns:
        Direction from the axis [rad] and slope [1], shapes (N,), float64.
    """
    ahead = (terrain.height(station + reach, left) - terrain.height(station - reach, left)) / (2 * reach)
    aside = (terrain.height(station, left + reach) - terrain.height(station, left - reach)) / (2 * reach)
    return np.arctan2(-aside, -ahead), np.hypot(ahead, aside)


def rectangles(terrain: Terrain, plots: Plots) -> list[F64]:
    """List middles [m], turns [rad] and half sizes [m] of buildings in plan.

    Args:
        terrain: The terrain.
        plots: Their places.

    Returns:
        x, y [m], turn [rad] and half sizes [m], one row for each, of shape (5,), float64.
    """
    axis = terrain.land.layout.alignment
    world, yaw = to_world(axis, plots.places), plots.heading + axis.heading_at(plots.places[:, 0])
    return [np.array([*p[:2], a, *h]) for p, a, h in zip(world, yaw, plots.half, strict=True)]


def overlap(one: F64, others: F64) -> B:
    """Find which rectangles a rectangle touches: no side of either of them separates them.

    Args:
        one: Middle [m], turn [rad] and half sizes [m] of the rectangle, shape (5,), float64.
        others: Middles [m], turns [rad] and half sizes [m] of others, shape (N, 5), float64.

    Returns:
        Whether it touches each, shape (N,), bool.

    Source: S. Gottschalk, M. Lin, D. Manocha, OBBTree, 1996 (separating axes).
    """
    offset = others[:, :2] - one[:2]
    touch = np.hypot(*offset.T) < np.hypot(*one[3:]) + np.hypot(others[:, 3], others[:, 4])
    for turn in (np.full(len(others), one[2]), others[:, 2]):
        for quarter in (0.0, np.pi / 2):
            x, y = np.cos(turn + quarter), np.sin(turn + quarter)
            apart = np.abs(offset[:, 0] * x + offset[:, 1] * y)
            reach = _shadow(one[None], x, y) + _shadow(others, x, y)
            touch &= apart < reach
    return touch


def _floors(terrain: Terrain, wanted: F64, half: F64) -> tuple[F64, F64]:
    """Find the height of floors, and how far the ground falls below them [m], shapes (K,), float64."""
    cosine, sine = np.cos(wanted[:, 2]), np.sin(wanted[:, 2])
    heights = []
    for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1), (0, -1), (0, 1), (1, 0), (-1, 0), (0, 0)):
        along, aside = x * half[:, 0], y * half[:, 1]
        heights.append(
            terrain.height(wanted[:, 0] + along * cosine - aside * sine, wanted[:, 1] + along * sine + aside * cosine)
        )
    ground = np.array(heights)
    floor = np.round(ground.max(axis=0) - SILL + 0.5 * np.exp(-np.ptp(ground, axis=0)), 3)
    return floor, floor - ground.min(axis=0)


def _shadow(rows: F64, x: F64, y: F64) -> F64:
    """Project half a rectangle on directions [m], shape (N,), float64."""
    cosine, sine = np.cos(rows[:, 2]), np.sin(rows[:, 2])
    return rows[:, 3] * np.abs(cosine * x + sine * y) + rows[:, 4] * np.abs(cosine * y - sine * x)
