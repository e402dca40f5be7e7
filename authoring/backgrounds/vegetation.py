"""Trees of a few species at life size, near ones in detail, far ones plainer, and where they grow."""

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.parcels import Parcel, clear_of, open_land
from authoring.backgrounds.terrain import Terrain
from authoring.shapes.component import Mesh, Scatter
from authoring.site.covers import to_world
from authoring.site.growth import faceted, leaf_mass, stem
from authoring.site.relief import draw_relief
from authoring.site.ways import merged

F64 = NDArray[np.float64]
Tree = tuple[tuple[str, Mesh], ...]
NEAR = 165.0  # distance from the site's middle up to which trees are modelled in detail [m]
DISTANT = 150.0  # distance from the site from which trees are the simplest [m]
SPECIES = 4
SUNK = 0.25  # trunks go on below the ground [m]


def broadleaf(rng: np.random.Generator, height: float, width: float, clumps: int) -> Tree:
    """Model a broadleaved tree.

    Args:
        rng: Random stream.
        height: Height [m].
        width: Width of the crown [m].
        clumps: Clumps of leaves; the more, the more detail in the trunk as well.

    Returns:
        Bark and foliage.
    """
    low = 0.2 * height
    middle = np.array([0.0, 0.0, (low + height) / 2])
    half = np.array([width, width, height - low]) / 2
    clump = 1.15 * np.cbrt(np.prod(half)) / np.sqrt(clumps)
    crown = leaf_mass(rng, middle, 0.9 * half, clumps, 0, 1.45 * clump)
    return ("bark", stem(0.6 * height, 0.020 * height + 0.08, 7 if clumps > 12 else 5, rng)), ("foliage", crown)


def conifer(rng: np.random.Generator, height: float, width: float, tiers: int, spokes: int) -> Tree:
    """Model a spruce: whorls of drooping branches, each a closed star that narrows to the stem.

    Args:
        rng: Random stream.
        height: Height [m].
        width: Width of the lowest whorl [m].
        tiers: Whorls.
        spokes: Branches in a whorl.

    Returns:
        Bark and foliage.
    """
    pieces = []
    for tier in range(tiers):
        share = tier / tiers
        foot = height * (0.10 + 0.86 * share)
        top = min(height, foot + height * (0.34 - 0.12 * share))
        reach = width / 2 * (1.0 - share) ** 0.85 * rng.uniform(0.9, 1.08)
        angle = 2 * np.pi * (np.arange(2 * spokes) / (2 * spokes)) + rng.uniform(0.0, 6.0)
        long = np.where(
            np.arange(2 * spokes) % 2 == 0, rng.uniform(0.85, 1.15, 2 * spokes), rng.uniform(0.45, 0.62, 2 * spokes)
        )
        rim = np.column_stack([reach * long * np.cos(angle), reach * long * np.sin(angle), foot - 0.22 * reach * long])
        points = np.vstack([rim, [0.0, 0.0, top], [0.0, 0.0, foot + 0.12 * reach]])
        ahead = np.arange(2 * spokes)
        behind = (ahead + 1) % (2 * spokes)
        tip, hub = np.full(2 * spokes, 2 * spokes), np.full(2 * spokes, 2 * spokes + 1)
        faces = np.concatenate([np.column_stack([ahead, behind, tip]), np.column_stack([behind, ahead, hub])])
        pieces.append(faceted(points, faces, 0.35))
    return ("bark", stem(0.5 * height, 0.012 * height + 0.06, 5, rng)), ("foliage", merged(pieces))


def species(rng: np.random.Generator) -> tuple[tuple[Tree, ...], tuple[Tree, ...]]:
    """Model every species, in detail, and plain as well as for the distance: oak, lime, poplar, spruce in this order.

    Args:
        rng: Random stream.

    Returns:
        Detailed trees, species by species; plain ones likewise, then those for the distance.
    """
    shapes = ((11.0, 10.5), (13.0, 8.5), (17.0, 4.8))
    detailed = [broadleaf(rng, *shape, 38) for shape in shapes]
    plain = [*(broadleaf(rng, *shape, 13) for shape in shapes), conifer(rng, 15.0, 6.2, 5, 5)]
    distant = [*(broadleaf(rng, *shape, 5) for shape in shapes), conifer(rng, 15.0, 6.2, 3, 4)]
    return (*detailed, conifer(rng, 15.0, 6.2, 8, 8)), (*plain, *distant)


def graded(which: NDArray[np.int32], away: F64) -> NDArray[np.int32]:
    """Let plain trees far away be those for the distance.

    Args:
        which: Number of the species of each plain tree, shape (N,), int32.
        away: Distance to the site [m], shape (N,), float64.

    Returns:
        Number of the tree among the plain ones and those for the distance, shape (N,), int32.
    """
    return np.where(away > DISTANT, which + SPECIES, which).astype(np.int32)


def plant_trees(
    terrain: Terrain, parcels: tuple[Parcel, ...], taken: F64, count: int, rng: np.random.Generator, first_id: int
) -> tuple[Scatter, ...]:
    """Plant hedgerow trees, woods, riverside trees and solitary ones.

    Args:
        terrain: The terrain.
        parcels: The fields, with trees along some of their borders.
        taken: Station, left and radius of what stands already [m], shape (K, 3), float64.
        count: Trees wanted.
        rng: Random stream.
        first_id: Instance id of the first run.

    Returns:
        Runs of detailed and of plain trees.
    """
    places = _places(terrain, parcels, count, rng)
    clear = open_land(terrain, places[:, 0], places[:, 1]) > 0.5
    clear &= clear_of(terrain.land.layout.alignment, places[:, :2], taken, 3.5)
    places = places[clear & (terrain.beyond(places[:, 0], places[:, 1]) < 950.0)]
    places = places[_spaced(places[:, :2], 4.0)][:count]
    height = terrain.height(places[:, 0], places[:, 1]) - SUNK
    positions = to_world(terrain.land.layout.alignment, np.column_stack([places[:, :2], height]))
    scale = rng.uniform(0.62, 1.18, len(places))[:, None] * rng.uniform(0.93, 1.07, (len(places), 3))
    yaw = rng.uniform(0.0, 2 * np.pi, len(places))
    away = terrain.beyond(places[:, 0], places[:, 1])
    near = away < NEAR - 80.0
    runs = []
    for name, chosen, prototypes in zip(("NearTrees", "FarTrees"), (near, ~near), species(rng), strict=True):
        if chosen.any():
            which, ids = places[chosen, 2].astype(np.int32), (first_id + len(runs),)
            which = which if name == "NearTrees" else graded(which, away[chosen])
            place = (positions[chosen], yaw[chosen], scale[chosen])
            runs.append(Scatter(f"Countryside_{name}", "tree", "Plants", prototypes, which, *place, ids))
    return tuple(runs)


def _places(terrain: Terrain, parcels: tuple[Parcel, ...], count: int, rng: np.random.Generator) -> F64:
    """Draw more places than needed: station, left and species, shape (N, 3), float64, in random order."""
    land = terrain.land
    rows = []
    for parcel in parcels:
        if rng.uniform() < 0.42:
            line = parcel.outline(9.0)
            line = line[rng.uniform(0.0, 1.0, len(line)) < rng.uniform(0.10, 0.55)]
            kind = rng.choice((0, 0, 1), len(line))
            rows.append(np.column_stack([line + rng.uniform(-1.0, 1.0, line.shape), kind]))
    left = rng.choice((-1.0, 1.0), count) * rng.uniform(84.0, 420.0, count)
    bank = rng.choice((-1.0, 1.0), count) * (land.crossing.half_width + rng.uniform(14.0, 20.0, count))
    keep = rng.uniform(0.0, 1.0, count) < 0.35
    river = np.column_stack(
        [land.crossing.centre(left) + bank * land.crossing.stretch(left), left, rng.choice((1, 2), count)]
    )
    rows.append(river[keep])
    woods = draw_relief(((150.0, 1.0), (60.0, 0.35)), rng)
    spread = rng.uniform(-620.0, 620.0, (14 * count, 2))
    spread[:, 0] += (terrain.inner[0] + terrain.inner[1]) / 2
    dense = woods(spread[:, 0], spread[:, 1]) > 0.52
    spread = spread[dense | (rng.uniform(0.0, 1.0, len(spread)) < 0.006)]
    kind = np.where(woods(spread[:, 1], spread[:, 0]) > 0.0, 3, rng.choice((0, 1), len(spread)))
    rows.append(np.column_stack([spread, kind])[: 2 * count])
    places = np.concatenate(rows)
    far = np.hypot(places[:, 0] - terrain.inner[0], places[:, 1])
    return places[np.argsort(far * rng.uniform(0.25, 1.0, len(places)), kind="stable")]


def _spaced(places: F64, gap: float) -> NDArray[np.bool_]:
    """Drop every place closer than a gap to one before it, shape (N,), bool."""
    kept = np.ones(len(places), bool)
    for row in range(1, len(places)):
        before = places[:row][kept[:row]]
        kept[row] = not (np.abs(before - places[row]).max(axis=1) < gap).any() if len(before) else True
    return kept
