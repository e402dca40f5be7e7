"""Stones, shrubs and tufts of grass: small objects repeated over the site, denser near the bridge."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from authoring.shapes.component import Mesh, Scatter
from authoring.site.covers import to_world
from authoring.site.fringes import fringe_places
from authoring.site.grid import HeightField
from authoring.site.growth import pebble
from authoring.site.hedges import hedge_places
from authoring.site.land import no_hills
from authoring.site.plants import bush
from authoring.site.relief import draw_relief
from authoring.site.shape import SHOULDER, WING_WALL, Land
from authoring.site.sprays import tuft
from groundwork.settings import Settings

F64 = NDArray[np.float64]
B = NDArray[np.bool_]
Prototypes = tuple[tuple[tuple[str, Mesh], ...], ...]
DETAILED = 22.0  # distance from the bridge's edge up to which plants are modeled in detail [m]
_TILLED = ("ploughed", "crop", "ripe", "lot_asphalt", "lot_paved", "lot_gravel")  # covers without wild plants
_BESIDE = 0.25  # distance of wild plants from their borders [m]
_FRINGES = 0.8  # tufts along borders for each other one [1]
SMALL = 0.2  # size of stones that need no detail [m]
SHRUBS = ("scrub", "willow", "lime")  # the models of shrubs, in this order, in detail and then plain
NEAR = 28.0  # distance from the axis or the crossing at which density has fallen to about a third [m]


class ScatterSettings(Settings):
    """How much is strewn over the site."""

    stones: int = Field(
        default=420,
        ge=0,
        le=20_000,
        description="Number of stones; those that fall on a road, water or other unsuitable ground are left out [1]",
    )
    shrubs: int = Field(
        default=230, ge=0, le=5_000, description="Number of shrubs; those on unsuitable ground are left out [1]"
    )
    hedges: int = Field(
        default=420, ge=0, le=10_000, description="Largest number of bushes in hedges between fields [1]"
    )
    reeds: int = Field(
        default=420,
        ge=0,
        le=20_000,
        description="Number of clumps of reed at a river; those on unsuitable ground are left out [1]",
    )
    tufts: int = Field(
        default=5200,
        ge=0,
        le=50_000,
        description="Number of tufts of grass; those on unsuitable ground are left out. Up to four fifths as many "
        "stand along the borders of fields, yards and river banks, too [1]",
    )


@dataclass(frozen=True)
class _Gaps:
    """Least distances of repeats: from the bridge's outline, and from roads and the water's edge [m].

    `near` is the distance from the axis or the crossing at which density has fallen to about a third [m]; `clumps` the
    share of repeats in thickets [1].
    """

    bridge: float
    edge: float
    near: float = NEAR
    clumps: float = 0.0


@dataclass(frozen=True, eq=False)
class _Run:
    """Repeats of one kind: models near the bridge and far from it, least and largest size [m], places (N, 3)."""

    name: str
    kind: str
    detailed: Prototypes
    plain: Prototypes
    size: tuple[float, float]
    places: F64


def scatter_plants(
    settings: ScatterSettings, land: Land, ground: HeightField, rng: np.random.Generator, first_id: int
) -> tuple[Scatter, ...]:
    """Scatter stones, shrubs and tufts; none on roads, in water or at the bridge.

    Args:
        settings: Number of each.
        land: The land.
        ground: The strip.
        rng: Random stream.
        first_id: Instance id of the first run.

    Returns:
        One run of each kind that has any.
    """
    stones = tuple((("rock", pebble(rng)),) for _ in range(4))
    shrubs = tuple(bush(rng, 60, kind) for kind in SHRUBS)
    tufts = tuple((("leaves", tuft(rng, kind, 3, 1.5)),) for kind in ("grass", "grass", "grass", "herbs"))
    reeds = tuple((("leaves", tuft(rng, "reed", 3, 0.8)),) for _ in range(3))
    more = rng.spawn(1)[0]
    plain_stones = tuple((("rock", pebble(more, 0)),) for _ in stones)
    hedges = tuple(bush(more, 40, kind) for kind in ("scrub", "oak", "scrub"))
    plain_hedges = tuple(bush(more, 20, kind) for kind in ("scrub", "oak", "scrub"))
    plain_shrubs = tuple(bush(more, 22, kind) for kind in SHRUBS)
    plain_tufts = tuple((("leaves", tuft(more, kind, 2, 1.7)),) for kind in ("grass", "grass", "grass", "herbs"))
    plain_reeds = tuple((("leaves", tuft(more, "reed", 2, 0.85)),) for _ in reeds)
    stony = _places(land, ground, settings.stones, _Gaps(0.3, 0.4), rng, 0.75)
    shrubby = _places(land, ground, settings.shrubs, _Gaps(3.0, 1.4, clumps=0.9), rng)
    grassy = _places(land, ground, settings.tufts, _Gaps(0.12, 0.15, 13.0), rng)
    hedged = hedge_places(land, ground, settings.hedges, more)
    shore = _shore_places(land, ground, settings.reeds, rng)
    most, apart = round(_FRINGES * settings.tufts), rng.spawn(1)[0]
    fringes = fringe_places(land, ground, most, apart, lambda station, left: clear(land, station, left, 0.12, 0.15))
    runs = (
        _Run("Site_Stones", "rock", stones, plain_stones, (0.08, 0.55), stony),
        _Run("Site_Shrubs", "shrub", shrubs, plain_shrubs, (0.6, 2.0), shrubby),
        _Run("Site_Tufts", "vegetation", tufts, plain_tufts, (0.2, 0.52), grassy),
        _Run("Site_Hedges", "shrub", hedges, plain_hedges, (1.2, 1.75), hedged),
        _Run("Site_Reeds", "vegetation", reeds, plain_reeds, (0.8, 1.9), shore),
        _Run("Site_Fringes", "vegetation", plain_tufts, plain_tufts, (0.14, 0.5), fringes),
    )
    scatters: list[Scatter] = []
    for run in runs:
        scatter = _strewn(run, land, rng, first_id + len(scatters))
        scatters += [] if scatter is None else [scatter]
    return tuple(scatters)


def _strewn(run: _Run, land: Land, rng: np.random.Generator, number: int) -> Scatter | None:
    """Draw size, heading and model at each place; the random stream advances even if there is none."""
    places, count = run.places, len(run.detailed)
    scale = np.exp(rng.uniform(np.log(run.size[0]), np.log(run.size[1]), len(places)))
    scales = scale[:, None] * rng.uniform(0.8, 1.2, (len(places), 3))
    yaw, chosen = rng.uniform(0.0, 2 * np.pi, len(places)), rng.integers(0, count, len(places))
    far = np.abs(places[:, 1]) > 0.5 * land.layout.width + DETAILED
    far |= (scale < SMALL) if run.kind == "rock" else False
    if not len(places):
        return None
    one = run.plain is run.detailed
    models = np.where(far & (not one), chosen + count, chosen).astype(np.int32)
    prototypes = run.detailed if one else (*run.detailed, *run.plain)
    positions = to_world(land.layout.alignment, places)
    return Scatter(run.name, run.kind, "Plants", prototypes, models, positions, yaw, scales, (number,))


def _places(
    land: Land,
    ground: HeightField,
    count: int,
    gaps: _Gaps,
    rng: np.random.Generator,
    by_crossing: float = 0.0,
) -> F64:
    """Draw bridge coordinates with ground heights, shape (N, 3), more of them near the axis and the crossing.

    `by_crossing` is the share of the places far from the crossing that is left out [1].
    """
    border = gaps.edge + 0.5
    station = rng.uniform(ground.stations[0] + border, ground.stations[-1] - border, 6 * count)
    left = rng.uniform(ground.lefts[0] + border, ground.lefts[-1] - border, 6 * count)
    beside = np.abs(left) - land.layout.width / 2
    nearest = np.maximum(np.minimum(beside, 1.5 * land.crossing.distance(station, left)), 0.0)
    wanted = rng.uniform(0.0, 1.0, 6 * count) < np.exp(-nearest / gaps.near)
    free = wanted & clear(land, station, left, gaps.bridge, gaps.edge)
    if gaps.clumps > 0:
        thick = draw_relief(((17.0, 1.0), (6.0, 0.5)), rng)(station, left)
        free &= (thick > 0.38) | (rng.uniform(0.0, 1.0, 6 * count) > gaps.clumps)
    if by_crossing > 0:
        shore = land.crossing.distance(station, left) < land.crossing.half_width + 5.0
        free &= shore | (rng.uniform(0.0, 1.0, 6 * count) > by_crossing)
    rows = np.flatnonzero(free)[: 2 * count]
    rows = rows[_untilled(land, station[rows], left[rows])][:count]
    height = ground(station[rows], left[rows])
    return np.column_stack([station[rows], left[rows], height])


def _untilled(land: Land, station: F64, left: F64) -> B:
    """Find which places are not on a crop, ploughed land or yard, shape (N,), bool."""
    covers = land.shape(station, left, no_hills).covers
    taken = [covers[name] > -_BESIDE for name in _TILLED if name in covers]
    return ~np.any(taken, axis=0) if taken else np.ones(len(station), bool)


def _shore_places(land: Land, ground: HeightField, count: int, rng: np.random.Generator) -> F64:
    """Draw places in clusters along both banks of a river, shape (N, 3)."""
    crossing = land.crossing
    if crossing.kind != "river":
        return np.zeros((0, 3))
    clusters = rng.uniform(ground.lefts[0] + 4.0, ground.lefts[-1] - 4.0, max(count // 14, 1))
    left = clusters[rng.integers(0, len(clusters), count)] + rng.normal(0.0, 1.3, count)
    bank = np.where(np.sin(7.0 * clusters[rng.integers(0, len(clusters), count)]) > 0, 1.0, -1.0)
    away = crossing.half_width + rng.uniform(0.1, 1.0, count)
    station = crossing.center(left) + bank * away * crossing.stretch(left)
    free = clear(land, station, left, 1.0, -0.45) & (np.abs(left) < ground.lefts[-1] - 0.5)
    return np.column_stack([station, left, ground(station, left)])[free]


def clear(land: Land, station: F64, left: F64, bridge_gap: float, edge_gap: float) -> B:
    """Find places away from roads, water and bridge.

    Args:
        land: The land.
        station: Distance along the axis [m], shape (N,), float64.
        left: Distance to the left of the axis [m], shape (N,), float64.
        bridge_gap: Distance to keep from the bridge's outline [m].
        edge_gap: Distance to keep from roads, their shoulders and the water's edge [m].

    Returns:
        Whether each is free, shape (N,), bool.
    """
    half = land.layout.width / 2
    first, last = (approach.back for approach in land.approaches)
    beside = np.maximum(np.abs(left) - half, 0.0)
    wings = max(WING_WALL, land.layout.wings)
    beyond = np.maximum(np.maximum(first - wings - station, station - last - wings), 0.0)
    free = np.hypot(beside, beyond) > bridge_gap
    for low, high, right, leftmost in land.layout.blocks:
        aside = np.maximum(right - left, left - leftmost)
        free &= np.maximum(np.maximum(low - station, station - high), aside) > bridge_gap
    verge = SHOULDER if land.crossing.kind == "road" else 0.5
    free &= land.crossing.distance(station, left) > land.crossing.half_width + verge + edge_gap
    for approach in land.approaches:
        across = np.abs(left - approach.center(station))
        free &= (approach.along(station) < -1.0) | (across > approach.half_width + SHOULDER + edge_gap)
    return free
