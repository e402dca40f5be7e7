"""Trees in groups, as people plant and leave them: rows along fields and ways, copses, stands of conifers, orchards."""

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.byways import Byway, frontages, located
from authoring.backgrounds.homesteads import Homestead
from authoring.backgrounds.parcels import Parcel, clear_of, open_land
from authoring.backgrounds.terrain import Terrain
from authoring.backgrounds.vegetation import BIRCH, LIME, OAK, POPLAR, SPRUCE, spaced
from authoring.site.shape import Hills

F64 = NDArray[np.float64]

FARTHEST = 700.0  # distance from the site up to which groups stand [m]
ROW_STEP = (8.0, 12.0)  # distance between the trees of a row [m]
COPSE_STEP, STAND_STEP = 6.2, 4.6  # distance between the trees of a copse, and of a stand of conifers [m]
RADII = (9.0, 21.0)  # of copses [m]
COPSES, LINED = 0.5, 0.5  # shares of the fields with a copse at a corner, and with a row along a side [1]
CONIFERS = 0.3  # share of the copses that are stands of conifers [1]
SOLITARY = 0.06  # share of the fields with one old tree in them [1]
WAYSIDE = 15.2  # distance of a row of trees from the edge of the crossing way [m]
VERGE = 4.4  # distance of a row of trees from the edge of a lane; below 4 m it would be cleared with the lane [m]
GAP = 3.6  # least distance between two trees [m]


def garden_trees(terrain: Terrain, homesteads: tuple[Homestead, ...], rng: np.random.Generator) -> F64:
    """List the trees of gardens and orchards.

    Args:
        terrain: The terrain.
        homesteads: The homesteads.
        rng: Random stream.

    Returns:
        Station [m], left [m], species [1] and scale [1] of each, shape (N, 4), float64.
    """
    rows: list[F64] = [np.zeros((0, 4))]
    for home in homesteads:
        places = home.world(np.array(home.plan.trees).reshape(-1, 2))
        orchard = len(places) > 5
        kinds = np.full(len(places), OAK, np.int64) if orchard else rng.choice((OAK, OAK, LIME, BIRCH), len(places))
        scale = rng.uniform(0.34, 0.42, len(places)) if orchard else rng.uniform(0.36, 0.62, len(places))
        rows.append(np.column_stack([*located(terrain, places), kinds.astype(np.float64), scale]))
    return np.concatenate(rows)


def draw_groves(
    terrain: Terrain,
    parcels: tuple[Parcel, ...],
    lanes: list[Byway],
    taken: F64,
    count: int,
    rng: np.random.Generator,
    *,
    outside: Hills,
) -> F64:
    """Draw groups of trees; groups are kept or left out as a whole, the nearer ones first.

    Args:
        terrain: The terrain.
        parcels: The fields.
        lanes: Lanes of a hamlet.
        taken: Station, left and radius of existing objects [m], shape (K, 3), float64.
        count: Largest number of trees.
        rng: Random stream.
        outside: Distance of a place to a forest's border, positive inside [m]; its canopy has no single trees.

    Returns:
        Station [m], left [m], species [1] and scale [1] of each, shape (N, 4), float64.
    """
    groups = [*_rows(parcels, rng), *_copses(parcels, rng), *_wayside(terrain, rng), *_lane_rows(terrain, lanes, rng)]
    axis = terrain.land.layout.alignment
    ranked: list[tuple[float, F64]] = []
    for group in groups:
        station, left = group[:, 0], group[:, 1]
        free = (open_land(terrain, station, left) > 0.5) & (outside(station, left) < 0.0)
        free &= clear_of(axis, group[:, :2], taken, 2.5)
        away = terrain.beyond(station, left)
        kept = group[free & (away < FARTHEST)]
        if len(kept) >= max(1, min(3, len(group))):
            ranked.append((float(away.min()) * rng.uniform(0.4, 1.0), kept))
    chosen = [np.zeros((0, 4))]
    for _, group in sorted(ranked, key=lambda pair: pair[0]):
        if sum(map(len, chosen)) + len(group) <= count:
            chosen.append(group)
    trees = np.concatenate(chosen)
    return trees[spaced(trees[:, :2], GAP)]


def _grown(places: F64, kinds: NDArray[np.int64], rng: np.random.Generator, size: tuple[float, float]) -> F64:
    return np.column_stack([places, kinds.astype(np.float64), rng.uniform(*size, len(places))])


def _rows(parcels: tuple[Parcel, ...], rng: np.random.Generator) -> list[F64]:
    """Draw rows along one side of about half of the fields, and a few old trees within fields."""
    groups = []
    for parcel in parcels:
        if rng.random() < SOLITARY:
            spot = np.array([parcel.center]) + rng.uniform(-15.0, 15.0, (1, 2))
            tree = _grown(spot, np.array([rng.choice((OAK, LIME))]), rng, (1.0, 1.2))
            groups.append(tree[parcel.side * tree[:, 1] >= 0.0])
        if rng.random() > LINED:
            continue
        line = parcel.outline(float(rng.uniform(*ROW_STEP)))
        cosine, sine = np.cos(parcel.heading), np.sin(parcel.heading)
        local = (line - np.asarray(parcel.center)) @ np.array([[cosine, -sine], [sine, cosine]])
        side = int(rng.integers(0, 4))
        edge = (parcel.half[side // 2] - np.abs(local[:, side // 2])) < 0.5
        edge &= np.sign(local[:, side // 2]) == (1.0 if side % 2 else -1.0)
        line = line[edge & (rng.random(len(line)) < 0.88)]
        kind = rng.choice((OAK, LIME, LIME, BIRCH, POPLAR))
        kinds = np.where(rng.random(len(line)) < 0.85, kind, OAK)
        groups.append(_grown(line + rng.uniform(-0.7, 0.7, line.shape), kinds, rng, (0.7, 1.0)))
    return groups


def _copses(parcels: tuple[Parcel, ...], rng: np.random.Generator) -> list[F64]:
    """Draw copses at corners of fields: dense, of one to three species, or of spruces in rows."""
    groups = []
    for parcel in parcels:
        if rng.random() > COPSES:
            continue
        radius = float(rng.uniform(*RADII))
        corner = np.array(parcel.half) * rng.choice((-1.0, 1.0), 2)
        cosine, sine = np.cos(parcel.heading), np.sin(parcel.heading)
        middle = np.array(parcel.center) + corner @ np.array([[cosine, sine], [-sine, cosine]])
        stand = rng.random() < CONIFERS
        step = STAND_STEP if stand else COPSE_STEP
        at = np.arange(-radius, radius + step, step)
        grid = np.stack(np.meshgrid(at, at), axis=-1).reshape(-1, 2)
        grid = grid + rng.uniform(-0.12, 0.12, grid.shape) * step * (1.0 if stand else 2.4)
        long = rng.uniform(0.7, 1.0, 2)  # an ellipse with a ragged edge
        far = np.hypot(*(grid / long).T) + rng.uniform(-0.12, 0.12, len(grid)) * radius
        grid = grid[far < radius]
        place = middle + grid @ np.array([[cosine, sine], [-sine, cosine]])
        mixed = rng.choice((OAK, LIME, BIRCH), 2)
        kinds = np.full(len(place), SPRUCE) if stand else rng.choice(mixed, len(place))
        inner = 1.0 - 0.3 * np.clip(np.hypot(*grid.T) / radius, 0.0, 1.0)  # lower at the edge
        trees = _grown(place, kinds, rng, (0.75, 1.05))
        trees[:, 3] *= inner
        trees = trees[parcel.side * trees[:, 1] >= 0.0]
        groups.append(trees)
    return groups


def _wayside(terrain: Terrain, rng: np.random.Generator) -> list[F64]:
    """Draw rows along stretches of the crossing way: an avenue beside a road, loose groups on the banks of a river."""
    crossing = terrain.land.crossing
    river = crossing.kind in ("river", "harbour")
    groups = []
    for low, high in ((terrain.inner[3] + 12.0, 420.0), (-420.0, terrain.inner[2] - 12.0)):
        for side in (-1.0, 1.0):
            start = low + rng.uniform(0.0, 40.0)
            while start < high - 40.0:
                stop = min(start + rng.uniform(50.0, 130.0), high)
                left = np.arange(start, stop, float(rng.uniform(*ROW_STEP)) * (0.75 if river else 1.0))
                loose = rng.uniform(0.0, 5.0, len(left)) if river else rng.uniform(0.0, 0.4, len(left))
                away = side * (crossing.half_width + WAYSIDE + loose)
                station = crossing.center(left) + away * crossing.stretch(left)
                kind = rng.choice((POPLAR, LIME, OAK))
                kinds = rng.choice((LIME, POPLAR, POPLAR, BIRCH), len(left)) if river else np.full(len(left), kind)
                groups.append(_grown(np.column_stack([station, left]), kinds, rng, (0.75, 1.0)))
                start = stop + rng.uniform(25.0, 150.0)
    return groups


def _lane_rows(terrain: Terrain, lanes: list[Byway], rng: np.random.Generator) -> list[F64]:
    """Draw a row of trees along some lanes, on one side."""
    groups = []
    for lane in lanes:
        edges = frontages(lane, float(rng.uniform(*ROW_STEP)))
        half = edges[: len(edges) // 2] if rng.random() < 0.5 else edges[len(edges) // 2 :]
        places = half[:, :2] + VERGE * half[:, 3:]
        kinds = np.full(len(places), rng.choice((LIME, BIRCH, OAK)))
        groups.append(_grown(np.column_stack(located(terrain, places)), kinds, rng, (0.5, 0.7)))
    return groups
