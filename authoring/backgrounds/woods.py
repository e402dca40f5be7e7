"""Woods, rows and gardens on slopes: more species, four levels of detail, and places away from buildings."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from authoring.backgrounds.parcels import open_land
from authoring.backgrounds.plots import Plots
from authoring.backgrounds.terrain import Terrain
from authoring.backgrounds.vegetation import SUNK, broadleaf, conifer
from authoring.shapes.component import Scatter
from authoring.site.covers import to_world
from authoring.site.growth import faceted, stem
from authoring.site.plants import Plant, branches, cone, foliage
from authoring.site.ways import merged

F64 = NDArray[np.float64]
B = NDArray[np.bool_]

OAK, LIME, SPRUCE, CYPRESS, PALM = range(5)  # species
CLOSE, MIDDLE, FAR = 75.0, 210.0, 270.0  # distances from the site up to which trees have each level of detail [m]
FULL = 45.0  # distance from the site up to which shrubs are detailed [m]
MOST = 110, 640, 2000  # largest number of trees of the first level, of the first two, of the first three
_REMOTE = (  # kind of spray, height, width of the crown and height of its lower end [m], by species
    *(("oak", 11.0, 10.0, 2.2), ("lime", 13.5, 8.5, 2.0), ("spruce", 16.0, 6.2, 1.2)),
    *(("pine", 12.0, 2.2, 0.4), ("willow", 7.0, 4.4, 3.8)),
)
_SHAPES = {"oak": (11.0, 10.0), "lime": (13.5, 8.5), "spruce": (16.0, 6.2)}  # height and width [m]


def cypress(rng: np.random.Generator, height: float, width: float, count: int) -> Plant:
    """Model a columnar cypress.

    Args:
        rng: Random stream.
        height: Height [m].
        width: Width [m].
        count: Cards.

    Returns:
        Bark, opaque cores of the crown, and its branches.
    """
    lobes = [
        [0.0, 0.0, share * height, 0.5 * width * wide, 0.5 * width * wide, 0.17 * height]
        for share, wide in ((0.42, 1.0), (0.64, 0.78), (0.2, 0.8), (0.85, 0.42))
    ]
    return ("bark", stem(0.3 * height, 0.16, 5, rng)), *foliage(rng, np.array(lobes), count, "pine", 2.6)


def palm(rng: np.random.Generator, height: float, fronds: int) -> Plant:
    """Model a palm: a slim stem and a head of drooping fronds, each a folded blade.

    Args:
        rng: Random stream.
        height: Height of the stem [m].
        fronds: How many.

    Returns:
        Bark and foliage.
    """
    blades = []
    for turn in 2 * np.pi * (np.arange(fronds) + rng.uniform(-0.3, 0.3, fronds)) / fronds:
        lift, reach = rng.uniform(0.2, 1.5), rng.uniform(1.9, 2.7)
        line = np.array([[0.0, 0.0], [0.35 * reach, 0.5 * lift], [0.75 * reach, 0.4 * lift - 0.3], [reach, -0.9]])
        wide = np.array([0.08, 0.42, 0.36, 0.03])
        points = np.concatenate(
            [
                np.column_stack([line[:, 0], side * wide, line[:, 1] - drop])
                for side, drop in ((0.0, 0.0), (1.0, 0.14), (-1.0, 0.14))
            ]
        )
        c, s = np.cos(turn), np.sin(turn)
        points = points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + np.array([0.0, 0.0, height])
        k = np.arange(3)
        faces = np.concatenate(
            [
                np.column_stack([k, k + 1, k + 5]),
                np.column_stack([k, k + 5, k + 4]),
                np.column_stack([k, k + 9, k + 1]),
                np.column_stack([k, k + 8, k + 9]),
            ]
        )
        blades.append(faceted(points, faces, 0.3))
    return ("bark", stem(height, 0.19, 6, rng)), ("foliage", merged(blades))


def tree_runs(terrain: Terrain, prefix: str, places: F64, rng: np.random.Generator, first_id: int) -> list[Scatter]:
    """Place trees in four levels of detail.

    Args:
        terrain: The terrain.
        prefix: Put before the names of the runs.
        places: Station [m], left [m], species [1] and scale [1] of each tree, shape (N, 4), float64.
        rng: Random stream.
        first_id: Instance id of the first run.

    Returns:
        One run for each level of detail.
    """
    away = terrain.beyond(places[:, 0], places[:, 1])
    height = terrain.height(places[:, 0], places[:, 1]) - SUNK
    positions = to_world(terrain.land.layout.alignment, np.column_stack([places[:, :2], height]))
    scale = places[:, 3:] * rng.uniform(0.92, 1.08, (len(places), 3))
    yaw = rng.uniform(0.0, 2 * np.pi, len(places))
    rank = np.argsort(np.argsort(away, kind="stable"), kind="stable")  # the number of detailed trees is limited
    reach = (CLOSE, MIDDLE, FAR)
    fits = [(away < most) & (rank < count) for most, count in zip(reach, MOST, strict=True)]
    grade = np.select(fits, [0, 1, 2], 3)
    runs: list[Scatter] = []
    for number, (name, prototypes) in enumerate(zip(("Near", "Middle", "Far", "Remote"), _species(rng), strict=True)):
        chosen = grade == number
        if chosen.any():
            which = places[chosen, 2].astype(np.int32)
            place = (positions[chosen], yaw[chosen], scale[chosen])
            ids = (first_id + len(runs),)
            runs.append(Scatter(f"{prefix}_{name}Trees", "tree", "Plants", prototypes, which, *place, ids))
    return runs


def shrub_run(
    terrain: Terrain, prefix: str, places: F64, shapes: tuple[Plant, ...], rng: np.random.Generator, first_id: int
) -> list[Scatter]:
    """Plant shrubs.

    Args:
        terrain: The terrain.
        prefix: Put before the name of the run.
        places: Station [m], left [m] and scale [1] of each, shape (N, 3), float64.
        shapes: Their shapes, in detail and then as many plain ones.
        rng: Random stream.
        first_id: Instance id of the run.

    Returns:
        One run, or none without places.
    """
    if not len(places):
        return []
    height = terrain.height(places[:, 0], places[:, 1]) - 0.08
    positions = to_world(terrain.land.layout.alignment, np.column_stack([places[:, :2], height]))
    scale = places[:, 2:] * rng.uniform(0.85, 1.15, (len(places), 3))
    which = rng.integers(0, len(shapes) // 2, len(places)).astype(np.int32)
    far = terrain.beyond(places[:, 0], places[:, 1]) > FULL
    which = np.where(far, which + len(shapes) // 2, which).astype(np.int32)
    yaw = rng.uniform(0.0, 2 * np.pi, len(places))
    return [Scatter(f"{prefix}_Shrubs", "shrub", "Plants", shapes, which, positions, yaw, scale, (first_id,))]


def clear_ground(terrain: Terrain, places: F64, plots: Plots, gap: float) -> B:
    """Find where plants may grow: outside the ways, the site and the buildings.

    Args:
        terrain: The terrain.
        places: Station and left [m], shape (N, 2), float64.
        plots: The buildings.
        gap: Distance to keep from walls [m].

    Returns:
        Whether they may, shape (N,), bool.
    """
    free = open_land(terrain, places[:, 0], places[:, 1]) > 0.5
    axis = terrain.land.layout.alignment
    world = to_world(axis, np.column_stack([places, np.zeros(len(places))]))[:, :2]
    plot_centers = to_world(axis, plots.places)[:, :2]
    turn = plots.heading + axis.heading_at(plots.places[:, 0])
    around = KDTree(world).query_ball_point(plot_centers, np.hypot(*plots.half.T) + gap)
    for middle, yaw, half, close in zip(plot_centers, turn, plots.half, around, strict=True):
        near = np.array(close, np.int64)
        east, north = (world[near] - middle).T
        along = np.abs(east * np.cos(yaw) + north * np.sin(yaw))
        across = np.abs(north * np.cos(yaw) - east * np.sin(yaw))
        free[near] &= (along > half[0] + gap) | (across > half[1] + gap)
    return free


def spaced(places: F64, gap: float) -> B:
    """Keep at most one place in each square of a grid, the first.

    Args:
        places: Positions in plan [m], shape (N, 2), float64.
        gap: Side of the squares [m].

    Returns:
        Which places are kept, shape (N,), bool.
    """
    cell = np.floor(places / gap).astype(np.int64)
    kept = np.zeros(len(places), bool)
    kept[np.unique(cell, axis=0, return_index=True)[1]] = True
    return kept


def _species(rng: np.random.Generator) -> tuple[tuple[Plant, ...], ...]:
    """Model every species in four levels of detail."""
    grades = []
    for count, tiers, spokes, fronds in ((140, 12, 8, 13), (48, 7, 6, 9), (14, 4, 5, 6)):
        trees = [broadleaf(rng, form, *_SHAPES[form], count) for form in ("oak", "lime")]
        trees.append(conifer(rng, *_SHAPES["spruce"], tiers, spokes))
        trees.append(cypress(rng, 12.0, 2.2, max(2 * count // 3, 8)))
        trees.append(palm(rng, 5.5, fronds))
        grades.append(tuple(tree[1:] if count < 20 and row < 3 else tree for row, tree in enumerate(trees)))
    return (*grades, tuple(_remote(rng, *crown) for crown in _REMOTE))


def _remote(rng: np.random.Generator, kind: str, height: float, width: float, low: float) -> Plant:
    """Model a tree of some 20 triangles, for distances at which its crown is some 20 pixels wide.

    Args:
        rng: Random stream.
        kind: A row of `SPRAYS`.
        height: Height [m].
        width: Width of the crown [m].
        low: Height of its lower end [m].

    Returns:
        The opaque core of the crown, and leaves.
    """
    if kind == "spruce":
        heart = cone(height, low, 0.4 * width, 5)
        return ("foliage", heart), ("leaves", branches(rng, height, 0.55 * width, 1, 3))
    middle, half = 0.5 * (height + low), 0.5 * (height - low)
    lobe = np.array([[0.0, 0.0, middle, 0.46 * width, 0.46 * width, half]])
    return foliage(rng, lobe, 4, kind, 1.9)
