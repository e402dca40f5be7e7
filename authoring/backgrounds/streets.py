"""A town's plan: a grid of streets in the world's plan, its blocks, and the land that may be built on."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from authoring.backgrounds.terrain import Terrain
from authoring.site.land import no_hills

F64 = NDArray[np.float64]

CELL = 4.0  # spacing of the map of free land [m]
STRIP = 10.0  # from the site's border to the first kerb [m]
KERB_GAP = 2.4  # from the edge of a through road to the kerb beside it [m]
QUAY = 8.5  # from the water's edge to the first kerb [m]
RAIL_GAP = 7.0  # from a railway's ballast to the first kerb [m]
STEEPEST = 0.10  # largest slope of the ground under streets and blocks [1]
AVENUES, STREETS = (17.0, 23.0), (12.0, 16.0)  # widths from kerb to kerb [m]
LONG, SHORT = (84.0, 142.0), (58.0, 84.0)  # sides of blocks [m]


@dataclass(frozen=True, eq=False)
class FreeLand:
    """Land on which a town may be built, as a map over the world's plan.

    Attributes:
        corner: World position of the first cell [m], shape (2,), float64.
        free: Distance to land that must stay empty, negative on it [m], shape (X, Y), float64.
        height: Ground [m], shape (X, Y), float64.
        away: Distance to the site [m], shape (X, Y), float64.
    """

    corner: F64
    free: F64
    height: F64
    away: F64

    def look(self, layer: F64, places: F64, outside: float) -> F64:
        """Look up places in a layer of the map.

        Args:
            layer: `free`, `height` or `away` [m], shape (X, Y), float64.
            places: World positions in plan [m], shape (N, 2), float64.
            outside: Value beyond the map [m].

        Returns:
            Values [m], shape (N,), float64.
        """
        at = ((places - self.corner) / CELL).T
        return map_coordinates(layer, at, order=1, mode="constant", cval=outside)

    def room(self, places: F64) -> F64:
        """Look up the distance to land that must stay empty.

        Args:
            places: World positions in plan [m], shape (N, 2), float64.

        Returns:
            Distances; -100 beyond the map [m], shape (N,), float64.
        """
        return self.look(self.free, places, -100.0)

    def ground(self, places: F64) -> F64:
        """Find the height of the ground.

        Args:
            places: World positions in plan [m], shape (N, 2), float64.

        Returns:
            Heights; 0 beyond the map [m], shape (N,), float64.
        """
        return self.look(self.height, places, 0.0)


@dataclass(frozen=True)
class Block:
    """A rectangle between streets, in grid coordinates.

    Attributes:
        low: First u and v [m].
        high: Last u and v [m].
    """

    low: tuple[float, float]
    high: tuple[float, float]

    def spots(self, step: float, inset: float = 0.0) -> F64:
        """Distribute places over the block, including its corners.

        Args:
            step: Largest distance of neighboring places [m].
            inset: Distance from the block's edge [m].

        Returns:
            Places in grid coordinates [m], shape (N, 2), float64.
        """
        lines = [
            np.linspace(a + inset, b - inset, max(int(np.ceil((b - a - 2 * inset) / step)), 1) + 1)
            for a, b in zip(self.low, self.high, strict=True)
        ]
        return np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2)


@dataclass(frozen=True)
class Street:
    """A straight street, in grid coordinates.

    Attributes:
        axis: 0 where it runs along u, 1 along v.
        middle: The other coordinate of its center line [m].
        width: From kerb to kerb [m].
    """

    axis: int
    middle: float
    width: float


@dataclass(frozen=True, eq=False)
class TownPlan:
    """Streets and blocks.

    Attributes:
        origin: World position of the grid's origin [m], shape (2,), float64.
        heading: Direction of u, counter-clockwise from +x [rad].
        streets: All streets.
        blocks: Blocks with free land.
        reach: Distance of the town's border from the origin [m].
        land: Land that may be built on.
    """

    origin: F64
    heading: float
    streets: tuple[Street, ...]
    blocks: tuple[Block, ...]
    reach: float
    land: FreeLand

    def to_world(self, grid: F64) -> F64:
        """Turn grid coordinates into world positions in plan.

        Args:
            grid: Grid coordinates [m], shape (..., 2), float64.

        Returns:
            World positions [m], shape (..., 2), float64.
        """
        cosine, sine = np.cos(self.heading), np.sin(self.heading)
        return grid @ np.array([[cosine, sine], [-sine, cosine]]) + self.origin


def map_land(terrain: Terrain, reach: float) -> FreeLand:
    """Map the land that may be built on: away from site, crossing, approach roads with their fills, and slopes.

    Args:
        terrain: The terrain.
        reach: Distance from the site that the map covers [m].

    Returns:
        The map.
    """
    axis = terrain.land.layout.alignment
    first, last, low, high = terrain.inner
    rim = np.linspace(first, last, 9)
    rows = [axis.point(rim, np.full(9, side), np.zeros(9))[:, :2] for side in (low, high)]
    corners = np.concatenate(rows)
    start = np.floor((corners.min(axis=0) - reach) / CELL) * CELL
    count = np.ceil((corners.max(axis=0) + reach - start) / CELL).astype(int) + 1
    x, y = (start[k] + CELL * np.arange(count[k]) for k in range(2))
    plan = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    station, left = axis.locate(plan.reshape(-1, 2))
    height = terrain.height(station, left).reshape(plan.shape[:2])
    away = terrain.beyond(station, left).reshape(plan.shape[:2])
    free = open_ground(terrain, station, left).reshape(plan.shape[:2])
    slope = np.hypot(*np.gradient(height, CELL))
    free = np.minimum(free, (STEEPEST - slope) * 160.0)
    return FreeLand(start, free, height, away)


def open_ground(terrain: Terrain, station: F64, left: F64) -> F64:
    """Measure the distance to the site and to the roads and rivers beyond it, minus the strip that each keeps clear.

    Args:
        terrain: The terrain.
        station: Distance along the axis [m], shape (N,), float64.
        left: Distance to the left of the axis [m], shape (N,), float64.

    Returns:
        Distances, negative where building is not allowed [m], shape (N,), float64.
    """
    strip = np.minimum(terrain.beyond(station, left) - STRIP, terrain.clear(station, left) - 4.0)
    return np.minimum(strip, beside_ways(terrain, station, left))


def beside_ways(terrain: Terrain, station: F64, left: F64) -> F64:
    """Measure the distance to roads with their fills, railways and rivers, minus the strip that each keeps clear.

    Args:
        terrain: The terrain.
        station: Distance along the axis [m], shape (N,), float64.
        left: Distance to the left of the axis [m], shape (N,), float64.

    Returns:
        Distances, negative on a way and beside it [m], shape (N,), float64.
    """
    land = terrain.land
    gap = {"river": QUAY, "rail": RAIL_GAP}.get(land.crossing.kind, KERB_GAP)
    free = land.crossing.distance(station, left) - land.crossing.half_width - gap
    for approach in land.approaches:
        natural = 0.0 if land.valley is None else land.valley(station, np.zeros_like(station))
        fill = np.abs(approach.level(land.layout, no_hills, station) - natural - 0.5)
        aside = np.abs(left - approach.center(station)) / approach.stretch(station)
        aside = aside - approach.half_width - KERB_GAP - 1.9 * np.maximum(fill - 0.15, 0.0)
        free = np.minimum(free, np.where(approach.along(station) > -20.0, aside, 1e3))
    return free


def draw_plan(terrain: Terrain, reach: float, turned: float, rng: np.random.Generator) -> TownPlan:
    """Draw the streets of a town: aligned with the bridge's axis, or with the whole grid rotated.

    Args:
        terrain: The terrain.
        reach: Distance of the town's border from the site [m].
        turned: Largest rotation of the grid [rad]; about half of the towns are aligned with the axis.
        rng: Random stream.

    Returns:
        The plan.
    """
    axis = terrain.land.layout.alignment
    first, last = terrain.inner[:2]
    ends = axis.point(np.array([first, last]), np.zeros(2), np.zeros(2))[:, :2]
    chord = float(np.arctan2(*(ends[1] - ends[0])[::-1]))
    swing = rng.uniform(-turned, turned)
    heading = chord + (swing if rng.uniform() < 0.5 else 0.0)
    land, size = map_land(terrain, reach), reach + 0.5 * float(np.linalg.norm(ends[1] - ends[0]))
    avenue = 2.0 * (terrain.land.approaches[0].half_width + KERB_GAP)
    columns, along = _lines(size, (LONG, STREETS), rng, None)
    rows, across = _lines(size, (SHORT, AVENUES), rng, avenue)
    streets = [Street(1, middle, width) for middle, width in columns]
    streets += [Street(0, middle, width) for middle, width in rows]
    plan = TownPlan(ends.mean(axis=0), heading, tuple(streets), (), size, land)
    blocks = []
    for u in along:
        for v in across:
            block = Block((u[0], v[0]), (u[1], v[1]))
            middle = np.array([sum(u) / 2, sum(v) / 2])
            if np.hypot(*middle) < size - 20.0 and (land.room(plan.to_world(block.spots(9.0))) > 3.0).any():
                blocks.append(block)
    return TownPlan(plan.origin, heading, tuple(streets), tuple(blocks), size, land)


def _lines(
    size: float, ranges: tuple[tuple[float, float], tuple[float, float]], rng: np.random.Generator, first: float | None
) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    """Place streets from the middle outwards: center and width of each, and the ends of the blocks between them [m]."""
    width = first if first is not None else float(rng.uniform(*ranges[1]))
    middle = 0.0 if first is not None else float(rng.uniform(-40.0, 40.0))
    streets, blocks = [(middle, width)], []
    for sign in (-1.0, 1.0):
        edge = middle + sign * width / 2
        while abs(edge) < size:
            deep, wide = float(np.round(rng.uniform(*ranges[0]), 2)), float(np.round(rng.uniform(*ranges[1]), 2))
            blocks.append(tuple(sorted((edge, edge + sign * deep))))
            edge += sign * deep
            streets.append((edge + sign * wide / 2, wide))
            edge += sign * wide
    return sorted(streets), sorted(blocks)
