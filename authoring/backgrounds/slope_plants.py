"""Plants on slopes above water: woods on the mountains, gardens at the houses, trees in rows along a quay."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from authoring.backgrounds.forests import WOOD
from authoring.backgrounds.lanes import lane_room
from authoring.backgrounds.parcels import clear_of, open_land
from authoring.backgrounds.plots import Plots
from authoring.backgrounds.shore_town import Town, Waterside
from authoring.backgrounds.terrain import Terrain
from authoring.backgrounds.waters import Basin
from authoring.backgrounds.woods import CYPRESS, LIME, SPRUCE, clear_ground, shrub_run, spaced, tree_runs
from authoring.shapes.component import Scatter
from authoring.site.covers import Cover
from authoring.site.plants import bush
from authoring.site.relief import Relief, draw_relief, smoothstep

F64 = NDArray[np.float64]
CRAG = Cover("crag", "Crag", "rock", "cliff")
CLEARING = 17.0  # from a building's middle to the wood [m]
CRAGGY, SCREE = 1.25, 0.62  # slopes above which rock is visible below the tree line, and 220 m above it [1]
TREE_LINE = (330.0, 85.0)  # height of the tree line above the water, and how much it varies [m]


@dataclass(frozen=True, eq=False)
class Woods:
    """Distribution of woods.

    Attributes:
        stands: Relief of their density.
        line: Distances from the axis between which a slope becomes completely wooded [m].
        species: Broadleaved and garden species to draw from.
        spread: Distance of trees from the site's middle along the axis, standard deviation [m].
        columns: Share of the gardens with a row of cypresses [1].
        bare: Width of the strip behind the shore without trees [m].
        trees: Number of trees, including those of a promenade [1].
    """

    stands: Relief
    line: tuple[float, float]
    species: tuple[int, ...]
    spread: float
    columns: float
    bare: float
    trees: int


def mountain_covers(
    terrain: Terrain, lake: Basin, plots: Plots, woods: Woods, rng: np.random.Generator
) -> tuple[tuple[Cover, F64], ...]:
    """Evaluate the extents of woods and rock on the mountains.

    Args:
        terrain: The terrain.
        lake: The lake.
        plots: The buildings, which have clearings.
        woods: Distribution of woods.
        rng: Random stream.

    Returns:
        Each cover with its signed field at the terrain's nodes [m], shape (S, L), float64; roughly a distance to its
        border.
    """
    station, left = terrain.nodes()
    heights = terrain.field.heights
    along = np.gradient(heights, terrain.field.stations, axis=0)
    across = np.gradient(heights, terrain.field.lefts, axis=1)
    slope = np.hypot(along, across)
    away = terrain.beyond(station, left)
    ragged = draw_relief(((210.0, 0.28), (90.0, 0.30)), rng)(station, left)
    over = heights - lake.level - TREE_LINE[0] - TREE_LINE[1] * 2.0 * ragged
    rocky = CRAGGY - (CRAGGY - SCREE) * smoothstep(-40.0, 220.0, over)
    crag = np.minimum(25.0 * (slope + ragged - rocky), 0.02 * (away - 500.0))
    wood = np.minimum(25.0 * _wooded(terrain, lake, woods, station, left), -0.03 * over)
    if len(plots.places):
        nearest, _ = KDTree(plots.places[:, :2]).query(np.stack([station, left], axis=-1), distance_upper_bound=60.0)
        wood = np.minimum(wood, np.minimum(nearest, 60.0) - CLEARING)
    return (CRAG, np.clip(crag, -9.0, 9.0)), (WOOD, np.clip(wood, -9.0, 9.0))


def green_runs(
    place: Waterside, town: Town, woods: Woods, promenade: F64, rng: np.random.Generator, first_id: int
) -> list[Scatter]:
    """Place all trees and shrubs.

    Args:
        place: The land and its water.
        town: The buildings and streets there.
        woods: Distribution of woods, and number of trees.
        promenade: Station, left and height of the places on the promenade [m], shape (N, 3), float64.
        rng: Random stream.
        first_id: Instance id of the first run.

    Returns:
        Runs of trees and shrubs.
    """
    terrain, lake, plots, lanes = place.terrain, place.basin, town.plots, (*town.lanes, *town.terraces)
    kind = (LIME, woods.species[-1])[int(rng.integers(0, 2))]
    row = np.column_stack([promenade[:, :2], np.full(len(promenade), kind), rng.uniform(0.55, 0.75, len(promenade))])
    gardens, hedges = _gardens(plots, woods, rng)
    trees = np.concatenate([gardens, _woods(terrain, lake, woods, rng)])
    dry = lake.inside(trees[:, 0], trees[:, 1]) < -woods.bare
    dry &= lane_room(lanes, trees[:, 0], trees[:, 1]) > 0.8
    trees = trees[dry & clear_ground(terrain, trees[:, :2], plots, 1.6)]
    axis = terrain.land.layout.alignment
    trees = trees[clear_of(axis, trees[:, :2], town.drives, 1.0)]
    trees = trees[spaced(trees[:, :2], 3.4)]
    away = terrain.beyond(trees[:, 0], trees[:, 1])
    trees = trees[np.argsort(away * rng.uniform(0.35, 1.0, len(away)), kind="stable")][: max(woods.trees - len(row), 0)]
    runs = tree_runs(terrain, place.prefix, np.concatenate([row, trees]), rng, first_id)
    hedges = hedges[clear_ground(terrain, hedges[:, :2], plots, 0.9)]
    hedges = hedges[clear_of(axis, hedges[:, :2], town.drives, 0.4)]
    hedges = hedges[lane_room(lanes, hedges[:, 0], hedges[:, 1]) > 0.6]
    hedges = hedges[(terrain.beyond(hedges[:, 0], hedges[:, 1]) < 260.0)][:900]
    bushes = tuple(bush(rng, leaves) for leaves in (34, 34, 34, 12, 12, 12))
    return runs + shrub_run(terrain, place.prefix, hedges, bushes, rng, first_id + len(runs))


def draw_stands(rng: np.random.Generator) -> Relief:
    """Draw the distribution of woods, positive inside them.

    Args:
        rng: Random stream.
    """
    return draw_relief(((260.0, 0.8), (90.0, 0.45)), rng)


def _wooded(terrain: Terrain, lake: Basin, woods: Woods, station: F64, left: F64) -> F64:
    """Compute the density of woods: positive inside them [1], same shape, float64."""
    away, out = terrain.beyond(station, left), lake.side * left
    inland = np.maximum(-out, 0.0)
    across = smoothstep(120.0, 600.0, out - lake.near(station))
    dense = -0.25 + 1.5 * smoothstep(*woods.line, inland) + 1.5 * across
    free = open_land(terrain, station, left) / 40.0
    shore = (-lake.inside(station, left) - 22.0) / 60.0
    return np.minimum(np.minimum(woods.stands(station, left) + dense, free), np.minimum(shore, (away - 25.0) / 40.0))


def _woods(terrain: Terrain, lake: Basin, woods: Woods, rng: np.random.Generator) -> F64:
    """Draw trees of the woods, and solitary ones on open land: station, left, species, size, shape (N, 4), float64."""
    kinds = draw_relief(((210.0, 1.0),), rng)
    middle = (terrain.inner[0] + terrain.inner[1]) / 2
    many = 6 * woods.trees
    station = middle + rng.normal(0.0, woods.spread, many)
    left = np.where(
        rng.random(many) < 0.72,
        -lake.side * (84.0 + 900.0 * rng.random(many) ** 1.3),
        lake.side * rng.uniform(84.0, 260.0, many),
    )
    wooded = _wooded(terrain, lake, woods, station, left)
    kept = (wooded > 0.0) | (rng.random(many) < np.where(lake.side * left > 0.0, 0.22, 0.05))
    station, left, wooded = station[kept], left[kept], wooded[kept]
    mix = kinds(station, left)
    kind = np.where(mix > 0.25, SPRUCE, rng.choice(woods.species[:3], len(station)))
    lone = wooded <= 0.0
    kind[lone] = rng.choice(woods.species, int(lone.sum()))
    return np.column_stack([station, left, kind, rng.uniform(0.6, 1.15, len(station))])


def _gardens(plots: Plots, woods: Woods, rng: np.random.Generator) -> tuple[F64, F64]:
    """Draw cypress rows and garden trees, and hedges, round the buildings."""
    trees, hedges = [np.zeros((0, 4))], [np.zeros((0, 3))]
    for place, turn, half in zip(plots.places, plots.heading, plots.half, strict=True):
        x, y = half + rng.uniform(3.0, 6.5, 2)
        c, s = np.cos(turn), np.sin(turn)
        to_plan = np.array([[c, s], [-s, c]])
        if rng.random() < woods.columns:
            line = np.arange(-y, y, 2.3)
            side = rng.choice((-1.0, 1.0))
            local = np.column_stack([np.full(len(line), side * x), line])
            size = rng.uniform(0.55, 0.95) * np.ones(len(line))
            trees.append(np.column_stack([local @ to_plan + place[:2], np.full(len(line), CYPRESS), size]))
        spots = rng.uniform(-1.0, 1.0, (4, 2)) * (np.array([x, y]) + 5.0)
        kinds = rng.choice(woods.species, 4)
        trees.append(np.column_stack([spots @ to_plan + place[:2], kinds, rng.uniform(0.45, 0.8, 4)]))
        if rng.random() < 0.75:
            edge = np.arange(-x, x, 1.25)
            local = np.concatenate(
                [
                    np.column_stack([edge, np.full(len(edge), -y - 1.5)]),
                    np.column_stack([np.full(len(edge), x + 1.2), edge * y / x]),
                ]
            )
            hedges.append(np.column_stack([local @ to_plan + place[:2], rng.uniform(1.1, 1.5, len(local))]))
    return np.concatenate(trees), np.concatenate(hedges)
