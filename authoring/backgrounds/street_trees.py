"""Trees of a town: along kerbs, beside the site, on lawns, and on the land beyond."""

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.kerbs import Spots, beside_approaches, joined, kerbside
from authoring.backgrounds.pavements import KERB
from authoring.backgrounds.streets import KERB_GAP, STRIP, Block, TownPlan
from authoring.backgrounds.terrain import Terrain
from authoring.backgrounds.vegetation import graded, species
from authoring.shapes.component import Scatter
from authoring.site.covers import to_world
from authoring.site.plants import Plant

F64 = NDArray[np.float64]

DETAILED = 60.0  # distance to the site up to which trees are modeled in detail [m]
_SUNK = 0.25  # depth of trunks below the ground [m]
_WIDEST = 1.07  # largest ratio of a tree's width to its stated size [1]
_LEAST = 0.4  # scale below which trees that would reach into the site are left out [1]


def street_trees(
    plan: TownPlan, terrain: Terrain, lawns: list[Block], count: int, rng: np.random.Generator
) -> list[Scatter]:
    """Plant trees along the kerbs, beside the site, on lawns and beyond the town.

    Args:
        plan: The town.
        terrain: The terrain.
        lawns: Lawns in grid coordinates.
        count: Largest number of trees.
        rng: Random stream.

    Returns:
        Runs of detailed and of simple trees.
    """
    rows = [kerbside(plan, 0.95, 12.5, 7.0, 420.0)]
    rows[0] = rows[0].only(rng.uniform(size=len(rows[0].yaw)) < 0.5)
    rows += [
        spots.only(rng.uniform(size=len(spots.yaw)) < 0.7)
        for spots in beside_approaches(plan, terrain, KERB_GAP + 1.0, 11.0)
    ]
    rows.append(_beside_site(terrain, rng))
    rows += [_on_lawn(plan, lawn, rng) for lawn in lawns]
    small = np.concatenate(
        [np.ones(len(spots.yaw)) if number < 3 else np.zeros(len(spots.yaw)) for number, spots in enumerate(rows)]
    )
    spots = joined(rows)
    away = plan.land.look(plan.land.away, spots.places[:, :2], 1e4)
    order = np.argsort(away * rng.uniform(0.6, 1.4, len(away)), kind="stable")[:count]
    spots, small, away = Spots(spots.places[order], spots.yaw[order]), small[order] > 0.5, away[order]
    far = _country(plan, terrain, rng)
    kinds = np.where(small, 1, rng.choice((0, 0, 0, 1, 1, 2), len(order)))
    size = np.where(small, rng.uniform(0.48, 0.66, len(order)), rng.uniform(0.6, 1.05, len(order)))
    detailed, plain = species(rng)
    widest = _WIDEST * np.array([_reach(tree) for tree in detailed])
    size = np.minimum(size, _room(terrain, spots.places) / widest[kinds])
    grown = size > _LEAST
    spots, size, kinds, away = spots.only(grown), size[grown], kinds[grown], away[grown]
    runs = []
    near = away < DETAILED
    for name, models, chosen in (("NearTrees", detailed, near), ("FarTrees", plain, ~near)):
        places, scale, which = spots.places[chosen], size[chosen], kinds[chosen]
        if name == "FarTrees":
            places = np.concatenate([places, far.places])
            scale = np.concatenate([scale, rng.uniform(0.8, 1.3, len(far.yaw))])
            which = graded(
                np.concatenate([which, rng.choice((0, 0, 1, 3), len(far.yaw))]).astype(np.int32),
                np.concatenate([away[chosen], np.full(len(far.yaw), np.inf)]),
            )
        if len(places):
            yaw, sizes = (
                rng.uniform(0.0, 2 * np.pi, len(places)),
                scale[:, None] * rng.uniform(0.93, _WIDEST, (len(places), 3)),
            )
            sunk = places - [0.0, 0.0, _SUNK]
            runs.append(
                Scatter(f"City_{name}", "tree", "Plants", models, which.astype(np.int32), sunk, yaw, sizes, (0,))
            )
    return runs


def _room(terrain: Terrain, places: F64) -> F64:
    """Measure the distance from places to the site and its keep-out volumes [m], shape (N,), float64."""
    axis = terrain.land.layout.alignment
    station, left = axis.locate(places)
    # Stations are oblique to the plan: a circle in plan spans more of them.
    return np.minimum(np.cos(axis.skew) * terrain.beyond(station, left), terrain.clear(station, left))


def _reach(tree: Plant) -> float:
    """Compute the radius of a tree about its trunk's axis [m]."""
    return max(float(np.hypot(mesh.points[:, 0], mesh.points[:, 1]).max()) for _, mesh in tree)


def _on_lawn(plan: TownPlan, lawn: Block, rng: np.random.Generator) -> Spots:
    """Scatter trees over a lawn, one for each 190 square meters."""
    area = (lawn.high[0] - lawn.low[0]) * (lawn.high[1] - lawn.low[1])
    spread = rng.uniform(0.12, 0.88, (int(area / 190.0) + 1, 2)) * np.subtract(lawn.high, lawn.low) + lawn.low
    spread = plan.to_world(spread)
    good = plan.land.room(spread) > 1.5
    return Spots(np.column_stack([spread, plan.land.ground(spread) + KERB])[good], np.zeros(int(good.sum())))


def _beside_site(terrain: Terrain, rng: np.random.Generator) -> Spots:
    """Plant a loose row of trees in the strip between the site and the town."""
    first, last, low, high = terrain.inner
    along = np.arange(first, last, 9.0)
    rows = [np.column_stack([along, np.full(len(along), side)]) for side in (low - 0.75 * STRIP, high + 0.75 * STRIP)]
    across = np.arange(low, high, 9.0)
    rows += [
        np.column_stack([np.full(len(across), end), across]) for end in (first - 0.75 * STRIP, last + 0.75 * STRIP)
    ]
    places = np.concatenate(rows) + rng.uniform(-0.7, 0.7, (sum(map(len, rows)), 2))
    land = terrain.land
    clear = land.crossing.distance(places[:, 0], places[:, 1]) > land.crossing.half_width + 9.0
    clear &= terrain.clear(places[:, 0], places[:, 1]) > 6.0
    for approach in land.approaches:
        clear &= np.abs(places[:, 1] - approach.center(places[:, 0])) > approach.half_width + 8.0
    places = places[clear & (rng.uniform(size=len(places)) < 0.6)]
    level = terrain.height(places[:, 0], places[:, 1])
    return Spots(to_world(land.layout.alignment, np.column_stack([places, level])), np.zeros(len(places)))


def _country(plan: TownPlan, terrain: Terrain, rng: np.random.Generator) -> Spots:
    """Scatter trees over the land beyond the town."""
    turn, away = rng.uniform(0.0, 2 * np.pi, 260), plan.reach + rng.uniform(10.0, 480.0, 260)
    clumps = plan.origin + away[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    places = np.concatenate(
        [clumps, clumps + rng.normal(0.0, 9.0, clumps.shape), clumps + rng.normal(0.0, 14.0, clumps.shape)]
    )
    station, left = terrain.land.layout.alignment.locate(places)
    land = terrain.land
    clear = land.crossing.distance(station, left) > land.crossing.half_width + 16.0
    for approach in land.approaches:
        clear &= np.abs(left - approach.center(station)) > approach.half_width + 14.0
    level = terrain.height(station, left)
    return Spots(np.column_stack([places, level]), np.zeros(len(places))).only(clear)
