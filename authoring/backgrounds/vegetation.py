"""Trees of a few species at full scale, detailed near the site, simpler farther away, and their places."""

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.parcels import Parcel, clear_of, open_land
from authoring.backgrounds.terrain import Terrain
from authoring.shapes.component import Scatter
from authoring.site.covers import to_world
from authoring.site.growth import stem
from authoring.site.plants import Plant, branches, cone, foliage, limbs
from authoring.site.relief import draw_relief
from authoring.site.shape import Hills
from authoring.site.ways import merged

F64 = NDArray[np.float64]
MOST_NEAR = 99  # trees that are modeled in detail; the nearest
NEAR = 165.0  # distance up to which trees are modeled in detail, from a place 80 m inside the site's border [m]
DISTANT = 150.0  # distance from the site from which trees are the simplest [m]
SPECIES = 5
OAK, LIME, POPLAR, SPRUCE, BIRCH = range(SPECIES)
SUNK = 0.25  # depth of trunks below the ground [m]
_SIZES = {"oak": (11.5, 11.0), "lime": (14.0, 8.8), "poplar": (19.0, 4.2), "spruce": (16.0, 6.4), "birch": (14.5, 5.4)}


def broadleaf(rng: np.random.Generator, form: str, height: float, width: float, count: int) -> Plant:
    """Model a broadleaved tree.

    Args:
        rng: Random stream.
        form: Its habit: `oak` spreads, `lime` is a high dome, `poplar` a column, `birch` airy and hanging.
        height: Height [m].
        width: Width of the crown [m].
        count: Number of cards with leaves; it also determines the detail of trunk and branches.

    Returns:
        Bark, opaque cores of the crown, and leaves.
    """
    lobes = _habit(rng, form, height, width)
    lobes = lobes if count > 30 else lobes[: max(len(lobes) // 2, 2)] * [1.0, 1.0, 1.0, 1.22, 1.22, 1.12]
    airy = form == "birch"
    kind = {"oak": "oak", "lime": "lime", "poplar": "willow"}.get(form, "lime")
    crown = foliage(
        rng, lobes, count, kind, 1.7 if airy else 2.5, hearts=0 if airy else 2 if count < 20 else len(lobes)
    )
    radius = (0.012 if airy else 0.017) * height + 0.07
    wood = stem((0.9 if airy else 0.62) * height, radius, 7 if count > 90 else 4, rng)
    if count > 90:
        wood = merged([wood, limbs(rng, lobes, 0.26 * height, 0.5 * radius)])
    return ("bark", wood), *crown


def _habit(rng: np.random.Generator, form: str, height: float, width: float) -> F64:
    """Draw the lobes of a crown, the greatest first: middle and half axes [m], shape (K, 6), float64."""
    rows = []
    if form in ("poplar", "birch"):
        for share in (0.36, 0.62, 0.22, 0.80, 0.50, 0.93):
            wide = 0.5 * width * (1.0 - 0.85 * abs(share - 0.42) ** 1.3) * rng.uniform(0.8, 1.1)
            wide *= 0.62 if share > 0.9 else 1.0
            off = (0.22 if form == "birch" else 0.07) * width * rng.normal(size=2)
            rows.append([*off, share * height, wide, wide, (0.16 if share < 0.9 else 0.09) * height])
        return np.array(rows)
    low, spread = (0.24, 0.50) if form == "oak" else (0.17, 0.36)
    rows.append([0.0, 0.0, 0.64 * height, 0.32 * width, 0.32 * width, 0.30 * height])
    many = 6 if form == "oak" else 5
    for number, turn in enumerate(2 * np.pi * (np.arange(many) + rng.uniform(-0.3, 0.3, many)) / many):
        reach = spread * width * rng.uniform(0.48, 0.70)
        wide, high = width * rng.uniform(0.20, 0.28), height * rng.uniform(0.14, 0.20)
        at = height * (low + 0.17 + rng.uniform(0.0, 0.24) + (0.08 if form == "lime" else 0.0) * (number % 2))
        rows.append([reach * np.cos(turn), reach * np.sin(turn), at, wide, wide, high])
    rows.append([0.1 * width, -0.06 * width, height - 0.17 * height, 0.21 * width, 0.21 * width, 0.17 * height])
    return np.array(rows)


def conifer(rng: np.random.Generator, height: float, width: float, tiers: int, spokes: int) -> Plant:
    """Model a spruce: whorls of drooping branches around a dark opaque core.

    Args:
        rng: Random stream.
        height: Height [m].
        width: Width of the lowest whorl [m].
        tiers: Whorls.
        spokes: Branches in the lowest whorl.

    Returns:
        Bark, the core, and branches.
    """
    heart = cone(0.97 * height, 0.13 * height, 0.26 * width, 6 if tiers > 6 else 4)
    wood = stem(0.5 * height, 0.012 * height + 0.06, 5, rng)
    return ("bark", wood), ("foliage", heart), ("leaves", branches(rng, height, 0.5 * width, tiers, spokes))


def species(rng: np.random.Generator) -> tuple[tuple[Plant, ...], tuple[Plant, ...]]:
    """Model every species, detailed, simple, and for the distance: oak, lime, poplar, spruce, birch.

    Args:
        rng: Random stream.

    Returns:
        Detailed trees, species by species; simple ones likewise, then those for the distance.
    """
    grades = []
    for count, tiers, spokes in ((150, 13, 8), (54, 8, 6), (18, 5, 5)):
        trees = [broadleaf(rng, form, *_SIZES[form], count) for form in ("oak", "lime", "poplar")]
        trees.append(conifer(rng, *_SIZES["spruce"], tiers, spokes))
        trees.append(broadleaf(rng, "birch", *_SIZES["birch"], count))
        grades.append(tuple(trees))
    detailed, plain, distant = grades
    return detailed, (*plain, *distant)


def graded(which: NDArray[np.int32], away: F64) -> NDArray[np.int32]:
    """Replace simple trees far away by those for the distance.

    Args:
        which: Number of the species of each plain tree, shape (N,), int32.
        away: Distance to the site [m], shape (N,), float64.

    Returns:
        Number of the tree among the plain ones and those for the distance, shape (N,), int32.
    """
    return np.where(away > DISTANT, which + SPECIES, which).astype(np.int32)


def plant_trees(
    terrain: Terrain,
    parcels: tuple[Parcel, ...],
    taken: F64,
    count: int,
    rng: np.random.Generator,
    first_id: int,
    *,
    outside: Hills | None = None,
) -> tuple[Scatter, ...]:
    """Plant hedgerow trees, woods, riverside trees and solitary ones.

    Args:
        terrain: The terrain.
        parcels: The fields, with trees along some of their borders.
        taken: Station, left and radius of existing objects [m], shape (K, 3), float64.
        count: Number of trees.
        rng: Random stream.
        first_id: Instance id of the first run.
        outside: Distance of a place to a forest's border, positive inside [m]; the canopy is part of the terrain, so it
            has no trees.

    Returns:
        Runs of detailed and of plain trees.
    """
    places = _places(terrain, parcels, count, rng)
    clear = open_land(terrain, places[:, 0], places[:, 1]) > 0.5
    clear &= clear_of(terrain.land.layout.alignment, places[:, :2], taken, 3.5)
    if outside is not None:
        clear &= outside(places[:, 0], places[:, 1]) < 0.0
    places = places[clear & (terrain.beyond(places[:, 0], places[:, 1]) < 950.0)]
    places = places[spaced(places[:, :2], 4.0)][:count]
    scale = rng.uniform(0.62, 1.18, len(places))
    return tree_runs(terrain, np.column_stack([places[:, :3], scale]), rng, first_id)


def tree_runs(terrain: Terrain, places: F64, rng: np.random.Generator, first_id: int) -> tuple[Scatter, ...]:
    """Plant trees.

    Args:
        terrain: The terrain.
        places: Station [m], left [m], species [1] and scale [1] of each, shape (N, 4), float64.
        rng: Random stream.
        first_id: Instance id of the first run.

    Returns:
        Runs of detailed and of plain trees.
    """
    height = terrain.height(places[:, 0], places[:, 1]) - SUNK
    positions = to_world(terrain.land.layout.alignment, np.column_stack([places[:, :2], height]))
    scale = places[:, 3:] * rng.uniform(0.93, 1.07, (len(places), 3))
    yaw = rng.uniform(0.0, 2 * np.pi, len(places))
    away = terrain.beyond(places[:, 0], places[:, 1])
    near = away < NEAR - 80.0
    near[np.argsort(away, kind="stable")[MOST_NEAR:]] = False
    runs = []
    for name, chosen, prototypes in zip(("NearTrees", "FarTrees"), (near, ~near), species(rng), strict=True):
        if chosen.any():
            which, ids = places[chosen, 2].astype(np.int32), (first_id + len(runs),)
            which = which if name == "NearTrees" else graded(which, away[chosen])
            place = (positions[chosen], yaw[chosen], scale[chosen])
            runs.append(Scatter(f"Countryside_{name}", "tree", "Plants", prototypes, which, *place, ids))
    return tuple(runs)


def _places(terrain: Terrain, parcels: tuple[Parcel, ...], count: int, rng: np.random.Generator) -> F64:
    """Draw more places than needed, those near the bridge rather first: station, left, species, shape (N, 3)."""
    land = terrain.land
    rows = []
    for parcel in parcels:
        if rng.uniform() < 0.42:
            line = parcel.outline(9.0)
            line = line[rng.uniform(0.0, 1.0, len(line)) < rng.uniform(0.10, 0.55)]
            kind = rng.choice((0, 0, 1, 4), len(line))
            rows.append(np.column_stack([line + rng.uniform(-1.0, 1.0, line.shape), kind]))
    left = rng.choice((-1.0, 1.0), count) * rng.uniform(84.0, 420.0, count)
    bank = rng.choice((-1.0, 1.0), count) * (land.crossing.half_width + rng.uniform(14.0, 20.0, count))
    keep = rng.uniform(0.0, 1.0, count) < 0.35
    river = np.column_stack(
        [land.crossing.center(left) + bank * land.crossing.stretch(left), left, rng.choice((1, 2, 2, 4), count)]
    )
    rows.append(river[keep])
    woods = draw_relief(((150.0, 1.0), (60.0, 0.35)), rng)
    spread = rng.uniform(-620.0, 620.0, (14 * count, 2))
    spread[:, 0] += (terrain.inner[0] + terrain.inner[1]) / 2
    dense = woods(spread[:, 0], spread[:, 1]) > 0.52
    spread = spread[dense | (rng.uniform(0.0, 1.0, len(spread)) < 0.006)]
    kind = np.where(woods(spread[:, 1], spread[:, 0]) > 0.0, 3, rng.choice((0, 1, 4), len(spread)))
    rows.append(np.column_stack([spread, kind])[: 2 * count])
    places = np.concatenate(rows)
    far = np.hypot(places[:, 0] - np.clip(places[:, 0], *terrain.inner[:2]), places[:, 1])
    return places[np.argsort(far * rng.uniform(0.25, 1.0, len(places)), kind="stable")]


def spaced(places: F64, gap: float) -> NDArray[np.bool_]:
    """Remove every place closer than a gap to an earlier one.

    Args:
        places: Positions in plan [m], shape (N, 2), float64.
        gap: Least distance, along at least one axis [m].

    Returns:
        Which places are kept, shape (N,), bool.
    """
    kept = np.ones(len(places), bool)
    for row in range(1, len(places)):
        before = places[:row][kept[:row]]
        kept[row] = not (np.abs(before - places[row]).max(axis=1) < gap).any() if len(before) else True
    return kept
