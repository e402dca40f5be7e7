"""Data for weathering: each member of a bridge, each texel on it, and the noise that breaks up its marks."""

from dataclasses import dataclass

import numpy as np

from authoring.looks.arrises import ROADS
from authoring.looks.charts import Charts
from authoring.looks.noise import I32, Floats, Tile, draw, fractal, standard
from authoring.looks.runoff import direction
from authoring.shapes.component import Component

_FIELD_METERS = 32.0
_FIELD_PIXELS = 1024
_SWERVE = 0.35  # shift of a run over the deviation of the patches below it [texels of the fields]
_STANDING = ("column", "wall_pier", "abutment_wall", "wing_wall", "pier_footing", "abutment_footing", "pylon", "tower")


@dataclass(frozen=True)
class Members:
    """Facts of each component, one row per component.

    Attributes:
        low: Lowest height [m], shape (M,), float32.
        high: Highest height [m], shape (M,), float32.
        tone: Difference of its tone from its role's [1], shape (M,), float32.
        shift: Its origin in the fields [texels], shape (M, 2), int32.
        lifts: Drawn from -0.5 to 0.5 for each lift, bay or patch of it [1], shape (M, 64), float32.
        steel: 1 for steel [1], shape (M,), float32.
        cast: 1 for concrete below the bearings, which is cast in lifts [1], shape (M,), float32.
        foot: 1 for concrete that stands in the ground [1], shape (M,), float32.
        road: 1 for surfacing and its markings [1], shape (M,), float32.
        deck: 1 for slabs and parapets [1], shape (M,), float32.
        girder: 1 for members with flanges [1], shape (M,), float32.
        lane: A quarter of the width [m], shape (M,), float32.
        along: The longer direction in plan [1], shape (M, 2), float32.
        start: Its start in that direction [m], shape (M,), float32.
    """

    low: Floats
    high: Floats
    tone: Floats
    shift: I32
    lifts: Floats
    steel: Floats
    cast: Floats
    foot: Floats
    road: Floats
    deck: Floats
    girder: Floats
    lane: Floats
    along: Floats
    start: Floats


@dataclass(frozen=True)
class Spots:
    """Some texels, one row each, all on members that are steel, all on roads, or all on others.

    Attributes:
        owner: Row of the member, shape (N,), int32.
        normal: Unit normal, world axes [1], shape (N, 3), float32.
        place: World position [m], shape (N, 3), float32.
        edge: Distance to the nearest arris [m], shape (N,), float32.
        clouds: Slow changes of tone over 1 to 12 m [1], shape (N,), float32.
        patches: Changes over 0.1 to 2.5 m [1], shape (N,), float32.
        streaks: Noise stretched along the direction of runoff [1], shape (N,), float32.
        stains: Few and ragged marks of 0.2 to 1 m, dark below 0 and pale above [1], shape (N,), float32.
        dry: Height above the river around piers, inf where none stands in it [m], shape (N,), float32.
    """

    owner: I32
    normal: Floats
    place: Floats
    edge: Floats
    clouds: Floats
    patches: Floats
    streaks: Floats
    stains: Floats
    dry: Floats


@dataclass(frozen=True)
class Fields:
    """Noise on a plane of 32 m that repeats.

    Attributes:
        clouds: Slow changes of tone [1], shape (P, P), float32.
        patches: Patches [1], shape (P, P), float32.
        streaks: Streaks that run down [1], shape (P, P), float32.
        stains: Few ragged stains [1], shape (P, P), float32.
    """

    clouds: Floats
    patches: Floats
    streaks: Floats
    stains: Floats


def read_members(components: list[Component], age: float, rng: np.random.Generator) -> Members:
    """Collect the data that weathering uses.

    Args:
        components: Components with `st1`.
        age: 0 for new, 1 for decades of weather, more for many [1].
        rng: Random stream.
    """
    count = len(components)
    low = np.array([component.mesh.points.min(axis=0) for component in components]).reshape(count, 3)
    high = np.array([component.mesh.points.max(axis=0) for component in components]).reshape(count, 3)
    wide = [_width(component) for component in components]
    along = np.array([direction(component.mesh.points) for component in components]).reshape(count, 2)
    starts = [(c.mesh.points[:, :2] @ axis).min() for c, axis in zip(components, along, strict=True)]
    role = [component.role for component in components]
    concrete = np.array(["Concrete" in name for name in role], bool)
    below = np.array([component.group == "Substructure" for component in components], bool)
    tone = (draw(rng, (count,)) - 0.5) * np.float32(0.04 + 0.12 * min(age, 1.0))  # 8 % to either side at most

    def share(values: list[bool] | np.ndarray) -> Floats:
        return np.asarray(values).astype(np.float32)

    return Members(
        low=low[:, 2].astype(np.float32),
        high=high[:, 2].astype(np.float32),
        tone=tone,
        shift=(draw(rng, (count, 2)) * _FIELD_PIXELS).astype(np.int32),
        lifts=(draw(rng, (count, 64)) - 0.5).astype(np.float32),
        steel=share(["Steel" in name for name in role]),
        cast=share(concrete & below),
        foot=share(concrete & np.array([component.kind in _STANDING for component in components], bool)),
        road=share([name in ROADS for name in role]),
        deck=share([name in ("Role_DeckConcrete", "Role_ParapetConcrete") for name in role]),
        girder=share([name == "Role_GirderSteel" for name in role]),
        lane=(np.array(wide) / 4).astype(np.float32),
        along=along.astype(np.float32),
        start=np.array(starts).astype(np.float32),
    )


def draw_fields(rng: np.random.Generator) -> Fields:
    """Draw the noise that makes the edges of stains irregular.

    Args:
        rng: Random stream.
    """
    tile = Tile(_FIELD_PIXELS, _FIELD_METERS, rng)
    ragged = fractal(tile, 1.0, 0.18, slope=0.6, stretch=(1.0, 1.8))
    return Fields(
        clouds=fractal(tile, 12.0, 0.9, slope=1.2),
        patches=fractal(tile, 2.5, 0.07, slope=1.1),
        streaks=fractal(tile, 1.4, 0.07, slope=0.5, stretch=(1.0, 16.0)),
        stains=standard(np.clip(standard(ragged * ragged * ragged), -3.5, 3.5)),
    )


def read_spots(
    charts: Charts,
    members: Members,
    fields: Fields,
    texels: tuple[I32, np.ndarray, np.ndarray],
    edges: Floats,
    waterline: float | None = None,
) -> Spots:
    """Return the data of some texels.

    Args:
        charts: The atlas.
        members: Facts of the members.
        fields: Noise.
        texels: Triangle, column and row of each [texels], shape (N,) each.
        edges: Distance of each to the nearest arris [texels], shape (N,), float32.
        waterline: Height of the river around piers [m]; None where none stands in it.
    """
    triangle, column, row = texels
    across = charts.across[triangle]
    place = across * (column + 0.5).astype(np.float32)[:, None]
    place += charts.down[triangle] * (row + 0.5).astype(np.float32)[:, None]
    place += charts.place[triangle]
    meters = np.sqrt((charts.across * charts.across).sum(axis=1))[triangle]  # of a texel
    owner, normal = charts.owner[triangle], charts.normal[triangle]
    dry = np.full(len(place), np.inf, np.float32) if waterline is None else place[:, 2] - np.float32(waterline)
    return Spots(owner, normal, place, edges * meters, *_look_up(fields, members, owner, normal, place), dry=dry)


def _look_up(fields: Fields, members: Members, owner: I32, normal: Floats, place: Floats) -> tuple[Floats, ...]:
    """Look up each field: on a wall along it and up, else across the member and along it."""
    side = np.maximum(np.sqrt(normal[:, 0] ** 2 + normal[:, 1] ** 2), np.float32(0.05))
    upright = np.abs(normal[:, 2]) < np.float32(0.6)
    axis = members.along[owner]
    aside = (normal[:, 0] * place[:, 1] - normal[:, 1] * place[:, 0]) / side
    texels = np.float32(_FIELD_PIXELS / _FIELD_METERS)
    u = np.where(upright, aside, axis[:, 0] * place[:, 1] - axis[:, 1] * place[:, 0]) * texels
    v = np.where(upright, place[:, 2], axis[:, 0] * place[:, 0] + axis[:, 1] * place[:, 1]) * texels
    row = ((np.floor(v).astype(np.int32) + members.shift[owner, 1]) & (_FIELD_PIXELS - 1)) * _FIELD_PIXELS
    first = members.shift[owner, 0]
    cell = row + ((np.floor(u).astype(np.int32) + first) & (_FIELD_PIXELS - 1))
    clouds, patches, stains = (np.take(one.ravel(), cell) for one in (fields.clouds, fields.patches, fields.stains))
    # Water swerves; between two cells, upright steps of 3 cm would be as long as a run.
    u = u + np.float32(_SWERVE) * np.clip(patches, -2.5, 2.5)
    left = np.floor(u).astype(np.int32)
    part, left = (u - left).astype(np.float32), left + first
    one, two = (np.take(fields.streaks.ravel(), row + ((left + k) & (_FIELD_PIXELS - 1))) for k in (0, 1))
    return clouds, patches, one + part * (two - one), stains


def _width(component: Component) -> float:
    """Compute the width in plan across the longer direction [m]; on a curve, only that within a chord."""
    points = component.mesh.points
    x, y = direction(points)
    aside, along = points[:, :2] @ np.array([-y, x]), points[:, :2] @ np.array([x, y])
    start = along < along.min() + 0.05 * np.ptp(along)
    return float(np.ptp(aside[start])) if start.sum() > 1 else float(np.ptp(aside))
