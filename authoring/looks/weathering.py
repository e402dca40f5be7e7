"""What years of weather do to a bridge as a whole: the macro texture on the `st1` atlas, and patches on open ground."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from authoring.looks.arrises import arris_distance
from authoring.looks.charts import Charts, draw_charts, spread
from authoring.looks.noise import I32, Floats, Tile, draw, fractal, ramp
from authoring.looks.runoff import Stains, direction, map_stains
from authoring.shapes.component import Component, Scatter

_FIELD_METRES = 32.0
_FIELD_PIXELS = 1024
_ROWS = 128  # rows of the atlas worked on at once, so that they stay in the cache
_SOOT = np.array([0.54, 0.535, 0.51], np.float32)
_LIME = np.array([1.38, 1.37, 1.34], np.float32)
_RUST = np.array([0.95, 0.62, 0.42], np.float32)
_MUD = np.array([0.74, 0.70, 0.62], np.float32)
_MOSS = np.array([0.70, 0.72, 0.60], np.float32)
_WET = np.array([0.46, 0.45, 0.41], np.float32)  # algae where water runs


@dataclass(frozen=True)
class _Members:
    """Facts of each component that weathering looks at, one row a component."""

    low: Floats
    high: Floats
    tone: Floats
    shift: I32
    lifts: Floats
    steel: Floats
    ground: Floats
    road: Floats
    deck: Floats
    lane: Floats


@dataclass(frozen=True)
class _Fields:
    """Noise on a vertical or level plane of 32 m that repeats: clouds, patches, streaks."""

    clouds: Floats
    patches: Floats
    streaks: Floats


def weather(pieces: Iterable[Component | Scatter], pixels: int, age: float, rng: np.random.Generator) -> Floats:
    """Draw the factors that age multiplies the base colour with; their mean over the surface of each role is 1.

    Args:
        pieces: Parts of a bridge; those with charts on `st1` are weathered, all may drip.
        pixels: Texels along a side of the atlas.
        age: 0 for new, 1 for decades of weather, more for many [1].
        rng: Random stream.

    Returns:
        Factors [1], shape (pixels, pixels, 3), float32.
    """
    pieces = tuple(pieces)
    components = [piece for piece in pieces if isinstance(piece, Component) and len(piece.mesh.st1)]
    charts = draw_charts(components, pixels)
    edges = arris_distance(components, pixels)
    members, fields, stains = _members(components, age, rng), _fields(rng), map_stains(pieces)
    factors = np.ones((pixels, pixels, 3), np.float32)
    for top in range(0, pixels, _ROWS):
        block = charts.triangle[top : top + _ROWS]
        row, column = np.nonzero(block >= 0)
        if len(row):
            triangle = block[row, column]
            spot = _spots(charts, triangle, column, row + top, edges)
            factors[row + top, column] = _aged(spot, members, fields, stains, np.float32(age))
    factors *= _mottle(pixels, age, rng)
    covered = charts.triangle >= 0
    roles = sorted({component.role for component in components})
    role = np.array([roles.index(component.role) for component in components], np.int32)
    mine = role[charts.owner][charts.triangle[covered]]
    # One mean for the three channels: a mossy top must not turn the soffit of the same role violet.
    total = np.bincount(mine, factors[covered].sum(axis=1, dtype=np.float64), len(roles))
    mean = total / np.maximum(3 * np.bincount(mine, minlength=len(roles)), 1)
    factors[covered] /= mean.astype(np.float32)[mine][:, None]
    factors = spread(factors, covered)
    factors[:: pixels - 1, :: pixels - 1] = 1  # parts without a chart look up the corner (0, 0)
    return factors


def _mottle(pixels: int, age: float, rng: np.random.Generator) -> Floats:
    """Draw blotches of a few texels that occur once on the whole bridge, so that sheets never repeat exactly."""
    tile = Tile(pixels, 1.0, rng)
    blotches = fractal(tile, 96.0 / pixels, 2.5 / pixels, slope=0.5)
    return (1 + np.float32(0.07 + 0.10 * min(age, 1.0)) * np.clip(blotches, -2.6, 2.6))[..., None]


def ground_patches(pixels: int, rng: np.random.Generator) -> Floats:
    """Draw moist, dry and trodden patches for open ground; the factors are 1 along the atlas's border.

    Args:
        pixels: Texels along a side.
        rng: Random stream.

    Returns:
        Factors with mean 1 [1], shape (pixels, pixels, 3), float32.
    """
    tile = Tile(pixels, 160.0, rng)
    broad, small = fractal(tile, 60.0, 3.0), fractal(tile, 9.0, 0.4, slope=0.8)
    moist, dry = ramp(broad, 0.2, 1.8), ramp(-broad + 0.4 * small, 0.5, 2.2)
    steps = (np.arange(pixels, dtype=np.float32) + np.float32(0.5)) / pixels
    inside = ramp(np.minimum(steps, 1 - steps), 0.004, 0.05)
    inside = (inside[:, None] * inside[None, :])[..., None]
    factors = 1 + 0.10 * small[..., None] * np.array([1, 1, 1], np.float32)
    factors = factors * (1 + moist[..., None] * np.array([-0.34, -0.20, -0.26], np.float32))
    factors = factors * (1 + dry[..., None] * np.array([0.42, 0.22, 0.10], np.float32))
    weight = np.mean(inside, dtype=np.float64)
    mean = np.mean(factors * inside, axis=(0, 1), dtype=np.float64) / weight
    return (1 + (factors / mean.astype(np.float32) - 1) * inside).astype(np.float32)


def _members(components: list[Component], age: float, rng: np.random.Generator) -> _Members:
    count = len(components)
    low = np.array([component.mesh.points.min(axis=0) for component in components])
    high = np.array([component.mesh.points.max(axis=0) for component in components])
    wide = [_width(component) for component in components]
    role = [component.role for component in components]
    ground = [component.group == "Substructure" for component in components]
    tone = (draw(rng, (count,)) - 0.5) * np.float32(0.04 + 0.12 * min(age, 1.0))  # 8 % to either side at most
    return _Members(
        low=low[:, 2].astype(np.float32),
        high=high[:, 2].astype(np.float32),
        tone=tone,
        shift=(draw(rng, (count, 2)) * _FIELD_PIXELS).astype(np.int32),
        lifts=(draw(rng, (count, 64)) - 0.5).astype(np.float32),
        steel=np.array(["Steel" in name for name in role], np.float32),
        ground=np.array([on and "Concrete" in name for on, name in zip(ground, role, strict=True)], np.float32),
        road=np.array([name in ("Role_DeckAsphalt", "Role_RoadMarking") for name in role], np.float32),
        deck=np.array([name in ("Role_DeckConcrete", "Role_ParapetConcrete") for name in role], np.float32),
        lane=(np.array(wide) / 4).astype(np.float32),
    )


def _fields(rng: np.random.Generator) -> _Fields:
    tile = Tile(_FIELD_PIXELS, _FIELD_METRES, rng)
    return _Fields(
        clouds=fractal(tile, 5.0, 0.10),
        patches=fractal(tile, 1.6, 0.07, slope=1.2),
        streaks=fractal(tile, 1.2, 0.07, slope=0.7, stretch=(1.0, 14.0)),
    )


def _width(component: Component) -> float:
    """Extent in plan across the longer direction, of a bend no more than a chord sees [m]."""
    points = component.mesh.points
    x, y = direction(points)
    aside, along = points[:, :2] @ np.array([-y, x]), points[:, :2] @ np.array([x, y])
    start = along < along.min() + 0.05 * np.ptp(along)
    return float(np.ptp(aside[start])) if start.sum() > 1 else float(np.ptp(aside))


@dataclass(frozen=True)
class _Spots:
    """What is known of some texels, one row each."""

    owner: I32
    normal: Floats
    place: Floats
    edge: Floats


def _spots(charts: Charts, triangle: I32, column: np.ndarray, row: np.ndarray, edges: Floats) -> _Spots:
    x, y = (column + 0.5).astype(np.float32)[:, None], (row + 0.5).astype(np.float32)[:, None]
    across = charts.across[triangle]
    place = charts.place[triangle] + across * x + charts.down[triangle] * y
    metres = np.sqrt((across * across).sum(axis=1))  # of a texel
    return _Spots(charts.owner[triangle], charts.normal[triangle], place, edges[row, column] * metres)


def _aged(spots: _Spots, members: _Members, fields: _Fields, stains: tuple[Stains, Stains], age: np.float32) -> Floats:
    """Factors at some texels, shape (N, 3)."""
    owner, normal, place = spots.owner, spots.normal, spots.place
    wall = ramp(np.abs(normal[:, 2]), 0.75, 0.45)
    clouds, patches, streaks = _look_up(fields, members, spots)
    rise = place[:, 2] - members.low[owner]
    steel, road = members.steel[owner], members.road[owner]
    under, above = ramp(-normal[:, 2], 0.5, 0.8), ramp(normal[:, 2], 0.5, 0.8)
    factors = np.repeat((1 + members.tone[owner] + 0.09 * age * clouds * (1 - 0.5 * steel))[:, None], 3, axis=1)
    factors *= _pours(rise, owner, members, age)[:, None]
    factors = _washed(factors, spots, members, wall, clouds, streaks, age)
    splash = wall * members.ground[owner] * ramp(rise + 0.35 * clouds, 1.7, 0.3)
    factors = _toward(factors, 0.8 * age * splash, _MUD)
    wet, rusty = (stain.below(place) for stain in stains)
    drawn = 0.45 + 0.55 * ramp(streaks, -0.8, 1.4)
    factors = _toward(factors, age * wet * drawn * np.maximum(wall, 0.5 * under), _WET)
    factors = _toward(factors, 0.8 * age * rusty * drawn, _RUST)
    factors = _toward(factors, 0.7 * age * under * ramp(patches, 1.3, 2.4) * (1 - steel), _LIME)
    factors = _toward(factors, 0.7 * age * under * ramp(-patches, 1.0, 2.4), _SOOT)
    factors = _toward(factors, age * above * (1 - road) * (0.25 + 0.6 * ramp(patches, 0.5, 2.0)), _MOSS)
    factors = _edged(factors, spots, members, wall, under, patches, age)
    return factors * _wheel_tracks(spots, members, age)[:, None]


def _look_up(fields: _Fields, members: _Members, spots: _Spots) -> tuple[Floats, Floats, Floats]:
    """Clouds, patches and streaks: on a wall along it and up, else along x and y."""
    owner, normal, place = spots.owner, spots.normal, spots.place
    side = np.maximum(np.sqrt(normal[:, 0] ** 2 + normal[:, 1] ** 2), np.float32(0.05))
    along = (normal[:, 0] * place[:, 1] - normal[:, 1] * place[:, 0]) / side
    upright = np.abs(normal[:, 2]) < np.float32(0.6)
    texels = np.float32(_FIELD_PIXELS / _FIELD_METRES)
    u = np.where(upright, along, place[:, 0]) * texels
    v = np.where(upright, place[:, 2], place[:, 1]) * texels
    cell_u = (np.floor(u).astype(np.int32) + members.shift[owner, 0]) % _FIELD_PIXELS
    cell_v = (np.floor(v).astype(np.int32) + members.shift[owner, 1]) % _FIELD_PIXELS
    return fields.clouds[cell_v, cell_u], fields.patches[cell_v, cell_u], fields.streaks[cell_v, cell_u]


def _washed(
    factors: Floats, spots: _Spots, members: _Members, wall: Floats, clouds: Floats, streaks: Floats, age: np.float32
) -> Floats:
    """Runs from the top of every wall: soot and lime on concrete, rust on steel."""
    steel = members.steel[spots.owner]
    depth = members.high[spots.owner] - spots.place[:, 2]
    run = wall * ramp(depth, np.maximum(2.2 + 1.2 * clouds, 0.3), 0.0) * ramp(clouds, -1.8, 0.6)
    soot = age * run * ramp(streaks, 0.5, 2.1)
    factors = _toward(factors, soot * (1 - steel), _SOOT)
    factors = _toward(factors, 0.8 * soot * steel, _RUST)
    return _toward(factors, age * run * ramp(-streaks, 1.3, 2.4) * (1 - steel), _LIME)


def _edged(
    factors: Floats, spots: _Spots, members: _Members, wall: Floats, under: Floats, patches: Floats, age: np.float32
) -> Floats:
    """Along arrises: rust on steel, worn corners on concrete, the drip edge of soffits and the lime behind it."""
    steel = members.steel[spots.owner]
    broken = 0.35 + 0.65 * ramp(patches, -0.6, 1.2)
    near = ramp(spots.edge, 0.09, 0.02)
    factors = _toward(factors, 0.75 * age * near * steel * broken, _RUST)
    factors = _toward(factors, 0.35 * age * near * wall * (1 - steel) * ramp(patches, 0.0, 1.4), _SOOT)
    drip = under * (1 - steel) * members.deck[spots.owner]
    factors = _toward(factors, 0.55 * age * drip * ramp(spots.edge, 0.30, 0.10) * broken, _WET)
    behind = ramp(spots.edge, 0.20, 0.40) * ramp(spots.edge, 1.1, 0.5)
    return _toward(factors, 0.6 * age * drip * behind * ramp(patches, 0.3, 1.5), _LIME)


def _toward(factors: Floats, amount: Floats, goal: Floats) -> Floats:
    return factors * (1 + np.minimum(amount, 1)[:, None] * (goal - 1))


def _pours(rise: Floats, owner: I32, members: _Members, age: np.float32) -> Floats:
    """Lifts of 2.4 m with a tone of their own and a dark line between them."""
    lift = np.maximum(rise, 0) * np.float32(1 / 2.4)
    number = np.minimum(lift.astype(np.int32), 63)
    line = ramp(np.abs(lift - np.round(lift)) * np.float32(2.4), 0.05, 0.02) * (lift > 0.5)
    return 1 + members.ground[owner] * ((0.05 + 0.07 * age) * members.lifts[owner, number] - 0.22 * age * line)


def _wheel_tracks(spots: _Spots, members: _Members, age: np.float32) -> Floats:
    """Two dark tracks in each of two lanes, and the oil between them; they follow the edge of the road."""
    off = np.abs(spots.edge - members.lane[spots.owner])
    track = ramp(np.abs(off - np.float32(0.88)), 0.45, 0.10) + 0.5 * ramp(off, 0.40, 0.05)
    return 1 - members.road[spots.owner] * np.minimum(age * 0.16 * track, 0.5)
