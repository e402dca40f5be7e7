"""Random land without a bridge as an airborne scan, made of simple shapes: slopes, ditches, quays, houses, crowns.

Our worlds have a few kinds of trees and houses, real scans have many more. A model trained only on our worlds takes
unknown kinds for the class that they resemble most. These squares are not realistic landscapes; they add variety.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]

KINDS = ("ground", "road", "water", "embankment", "tree", "shrub", "building", "roof", "vehicle", "pole", "fence")
_WATER = 0.03  # share of the pulses on water that return


@dataclass(eq=False)
class _Land:
    """Pulses over a square, and the highest solid surface under each; updated as shapes are added.

    Attributes:
        place: Horizontal position of each pulse [m], shape (N, 2), float64.
        height: Of the surface [m], shape (N,), float64.
        label: Of the surface, shape (N,), uint8.
        code: Label of each of `KINDS`.
        half: Half of the side of the square [m].
        density: Pulses on each square meter [1/m²].
        extra: Further points: positions [m] with x, y and z, and their labels.
    """

    place: F64
    height: F64
    label: U8
    code: Mapping[str, int]
    half: float
    density: float
    extra: list[tuple[F64, U8]]

    def cover(self, inside: NDArray[np.bool_], top: F64, kind: str) -> None:
        """Raise the surface to a higher one."""
        above = inside & (top > self.height)
        self.height = np.where(above, top, self.height)
        self.label = np.where(above, np.uint8(self.code[kind]), self.label)

    def ground_at(self, place: F64) -> float:
        """Height of the land near a place [m]."""
        low = np.isin(self.label, [self.code[kind] for kind in ("ground", "road", "embankment")])
        rows = np.flatnonzero(low) if low.any() else np.arange(len(self.place))
        return float(self.height[rows[np.argmin(((self.place[rows] - place) ** 2).sum(axis=1))]])

    def add(self, points: F64, kind: str) -> None:
        """Add further points."""
        self.extra.append((points, np.full(len(points), self.code[kind], np.uint8)))


def draw_clutter(
    size: float, voxel: float, code: Mapping[str, int], rng: np.random.Generator
) -> tuple[NDArray[np.float32], U8]:
    """Draw a square of land without a bridge.

    Args:
        size: Side of the square [m].
        voxel: One point is kept in each cube of this side [m].
        code: Label of each of `KINDS`.
        rng: Source of randomness.

    Returns:
        Positions relative to the center of the square and the general level of its ground [m], shape (N, 3), float32,
        and labels, shape (N,), uint8.
    """
    density = float(np.exp(rng.uniform(np.log(4.0), np.log(25.0))))
    place = _pulses(size, density, rng)
    count = len(place)
    land = _Land(place, np.zeros(count), np.full(count, code["ground"], np.uint8), code, 0.5 * size, density, [])
    _shape_land(land, rng)
    if rng.random() < 0.65:
        _build_houses(land, rng)
    for _ in range(rng.integers(0, 4)):
        _put_vehicle(land, rng)
    for _ in range(rng.poisson(0.7)):
        _put_line(land, rng)
    reached = np.ones(count, bool)
    if rng.random() < 0.75:
        reached = _grow_plants(land, rng)
    lost = (land.label == code["water"]) & (rng.random(count) > _WATER)
    kept = reached & ~lost
    solid = np.column_stack([land.place, land.height])[kept]
    parts = [(solid, land.label[kept]), *land.extra]
    points = np.concatenate([part for part, _ in parts]) + rng.normal(0.0, 0.02, (sum(len(p) for p, _ in parts), 3))
    labels = np.concatenate([part for _, part in parts])
    rows = np.flatnonzero((np.abs(points[:, :2]) <= 0.5 * size).all(axis=1))
    _, first = np.unique(np.floor(points[rows] / voxel).astype(np.int64), axis=0, return_index=True)
    rows = rows[np.sort(first)]
    return points[rows].astype(np.float32), labels[rows]


def _pulses(size: float, density: float, rng: np.random.Generator) -> F64:
    """Draw pulses over a square at random, or in the scan lines of one or two strips [m], shape (N, 2), float64."""
    if rng.random() < 0.3:
        return rng.uniform(-0.5 * size, 0.5 * size, (max(64, round(density * size * size)), 2))
    parts = []
    for _ in range(strips := int(rng.integers(1, 3))):
        step = 1.0 / np.sqrt(density / strips) * rng.uniform(0.6, 1.6)
        steps = np.array([step, strips / (density * step)])
        axes = [np.arange(-0.75 * size, 0.75 * size, one) + rng.uniform(0.0, one) for one in steps]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
        turn = rng.uniform(0.0, 2.0 * np.pi)
        grid = grid @ np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        parts.append(grid + rng.normal(0.0, 0.04, grid.shape))
    place = np.concatenate(parts)
    return place[(np.abs(place) <= 0.5 * size).all(axis=1)]


def _across(place: F64, rng: np.random.Generator, reach: float) -> F64:
    """Compute the signed distance of places from a random straight line in the square [m], shape (N,), float64."""
    turn = rng.uniform(0.0, 2.0 * np.pi)
    return place @ np.array([np.cos(turn), np.sin(turn)]) - rng.uniform(-reach, reach)


def _shape_land(land: _Land, rng: np.random.Generator) -> None:
    """Give the ground slope and waves, and sometimes a ditch or canal, a step or quay, a dike, a road."""
    x, y = land.place.T
    turn, slope = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.0, 0.08) if rng.random() < 0.5 else 0.0
    land.height += slope * (x * np.cos(turn) + y * np.sin(turn))
    for _ in range(3):
        wave = _across(land.place, rng, 10.0) * 2.0 * np.pi / rng.uniform(3.0, 30.0)
        land.height += rng.uniform(0.0, 0.12) * np.sin(wave)
    if rng.random() < 0.35:  # a step: quay, terrace, bank
        away = _across(land.place, rng, 0.8 * land.half)
        rise, width = rng.uniform(0.4, 4.0), rng.choice([0.05, rng.uniform(0.5, 8.0)])
        land.height -= rise * np.clip(0.5 - away / width, 0.0, 1.0)
        if rng.random() < 0.5:
            land.label[away < -0.5 * width] = land.code["water"]
            land.height[away < -0.5 * width] = -rise
    if rng.random() < 0.25:  # a ditch or canal
        away, half, depth = np.abs(_across(land.place, rng, land.half)), rng.uniform(0.5, 8.0), rng.uniform(0.4, 3.0)
        bank = rng.choice([0.05, rng.uniform(0.3, 3.0)])
        land.height -= depth * np.clip((half + bank - away) / bank, 0.0, 1.0)
        land.label[away < half] = land.code["water" if rng.random() < 0.7 else "ground"]
    if rng.random() < 0.2:  # a dike
        away, half, rise = np.abs(_across(land.place, rng, land.half)), rng.uniform(1.0, 7.0), rng.uniform(0.6, 7.0)
        bank = rise * rng.uniform(1.0, 4.0)
        lift = rise * np.clip((half + bank - away) / bank, 0.0, 1.0)
        land.height += lift
        land.label[lift > 0.05] = land.code["embankment"]
    if rng.random() < 0.4:
        away, half = np.abs(_across(land.place, rng, land.half)), rng.uniform(1.5, 9.0)
        land.label[(away < half) & (land.label == land.code["ground"])] = land.code["road"]


def _build_houses(land: _Land, rng: np.random.Generator) -> None:
    """Add single houses, a terrace of houses, or a hall that fills the square."""
    way = rng.uniform(0.0, np.pi)
    middle = rng.uniform(-land.half - 2.0, land.half + 2.0, 2)
    kind = rng.choice(["single", "row", "hall"], p=[0.4, 0.4, 0.2])
    high = rng.uniform(2.2, 6.5) if rng.random() < 0.6 else rng.uniform(5.0, 25.0)
    if kind == "hall":
        _build_house(land, middle, way, (rng.uniform(15.0, 50.0), rng.uniform(10.0, 40.0)), high, rng)
        return
    long, deep = rng.uniform(4.5, 14.0), rng.uniform(6.0, 14.0)
    for number in range(1 if kind == "single" else rng.integers(3, 8)):
        along = (number - 2) * long * np.array([np.cos(way), np.sin(way)])
        own = high * (rng.uniform(0.75, 1.3) if rng.random() < 0.6 else 1.0)
        _build_house(land, middle + along * (kind == "row"), way, (long, deep * rng.uniform(0.8, 1.2)), own, rng)
    if rng.random() < 0.5:  # sheds and additions
        beside = rng.uniform(-land.half, land.half, 2)
        _build_house(land, beside, way, (rng.uniform(2.0, 6.0), rng.uniform(2.0, 6.0)), rng.uniform(2.0, 3.2), rng)


def _build_house(
    land: _Land, middle: F64, way: float, plan: tuple[float, float], eaves: float, rng: np.random.Generator
) -> None:
    """Add one house: a roof of random form over partly visible walls."""
    base = land.ground_at(middle)
    turn = np.array([[np.cos(way), np.sin(way)], [-np.sin(way), np.cos(way)]])
    u, v = turn @ (land.place - middle).T
    a, b = 0.5 * plan[0], 0.5 * plan[1]
    inside = (np.abs(u) <= a) & (np.abs(v) <= b)
    pitch = np.tan(np.radians(rng.uniform(18.0, 58.0)))
    form = rng.choice(["gable", "cross", "hip", "shed", "flat", "mansard"], p=[0.3, 0.15, 0.15, 0.1, 0.2, 0.1])
    edge_u, edge_v = a - np.abs(u), b - np.abs(v)
    top = np.full(len(u), base + eaves)
    if form == "gable":
        top += pitch * edge_v
    elif form == "cross":
        top += pitch * edge_u
    elif form == "hip":
        top += pitch * np.minimum(edge_u, edge_v)
    elif form == "shed":
        top += rng.uniform(0.05, 0.5) * (v + b)
    elif form == "mansard":
        top += np.minimum(2.5 * np.minimum(edge_u, edge_v), rng.uniform(1.5, 3.5))
    else:
        rim = np.minimum(edge_u, edge_v) < 0.3
        top += np.where(rim, rng.uniform(0.0, 0.9), 0.0)
    land.cover(inside, np.minimum(top, base + eaves + 9.0), "roof")
    for _ in range(rng.integers(0, 4)):  # dormers, chimneys, boxes on flat roofs
        at, wide = np.array([rng.uniform(-a, a), rng.uniform(-b, b)]), rng.uniform(0.3, 2.5, 2)
        body = inside & (np.abs(u - at[0]) < wide[0]) & (np.abs(v - at[1]) < wide[1])
        if body.any():
            land.cover(body, np.full(len(u), float(top[body].mean()) + rng.uniform(0.3, 2.0)), "roof")
    _show_walls(land, middle, turn, (a, b, base, eaves), rng)


def _show_walls(
    land: _Land, middle: F64, turn: F64, box: tuple[float, float, float, float], rng: np.random.Generator
) -> None:
    """Add the points that oblique pulses hit on walls, on some sides none."""
    a, b, base, eaves = box
    for side in range(4):
        if rng.random() < 0.5:
            continue
        long = 2.0 * (a if side < 2 else b)
        count = int(long * eaves * land.density * rng.uniform(0.02, 0.5))
        along, high = rng.uniform(-0.5 * long, 0.5 * long, count), base + eaves * rng.random(count) ** 0.7
        sign = 1.0 if side % 2 else -1.0
        local = np.column_stack([along, np.full(count, sign * b)] if side < 2 else [np.full(count, sign * a), along])
        land.add(np.column_stack([local @ turn + middle, high]), "building")


def _put_vehicle(land: _Land, rng: np.random.Generator) -> None:
    """Add a car, a van or a lorry."""
    middle, way = rng.uniform(-land.half, land.half, 2), rng.uniform(0.0, np.pi)
    long, high = [(4.4, 1.5), (5.5, 2.3), (11.0, 3.7)][rng.choice(3, p=[0.7, 0.2, 0.1])]
    u, v = np.array([[np.cos(way), np.sin(way)], [-np.sin(way), np.cos(way)]]) @ (land.place - middle).T
    body = (np.abs(u) < 0.5 * long) & (np.abs(v) < 0.21 * long if long < 5 else np.abs(v) < 1.25)
    hood = np.where(np.abs(u) > 0.3 * long, 0.65, 1.0) if long < 5 else 1.0
    land.cover(body, land.ground_at(middle) + high * hood * np.ones(len(u)), "vehicle")


def _put_line(land: _Land, rng: np.random.Generator) -> None:
    """Add thin objects: a pole with or without wires, or a fence or free-standing wall."""
    start, way = rng.uniform(-land.half, land.half, 2), rng.uniform(0.0, 2.0 * np.pi)
    base, ahead = land.ground_at(start), np.array([np.cos(way), np.sin(way)])
    if rng.random() < 0.5:
        count = int(rng.uniform(1.0, 6.0) * land.density)
        along, high = rng.uniform(0.0, 30.0, count), rng.uniform(0.8, 2.4)
        land.add(np.column_stack([start + along[:, None] * ahead, base + high * rng.random(count)]), "fence")
        return
    high = rng.uniform(4.0, 14.0)
    count = int(rng.integers(4, 40))
    land.add(np.column_stack([np.tile(start, (count, 1)), base + high * rng.random(count)]), "pole")
    for _ in range(rng.integers(0, 4)):
        along = rng.uniform(0.0, 40.0, rng.integers(5, 60))
        sag = base + high - rng.uniform(0.0, 1.5) + 0.002 * (along - 20.0) ** 2 - 0.8
        land.add(np.column_stack([start + along[:, None] * ahead, sag]), "pole")


def _grow_plants(land: _Land, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Add single trees, rows or woods, and shrubs, with returns within their crowns; tell which pulses reach the land.

    A crown consists of ellipsoids. In each, the distance to the next leaf is exponentially distributed, and a pulse
    that has hit enough leaves does not reach the ground.
    """
    count = len(land.place)
    passed = np.ones(count, bool)
    most = int(rng.choice([2, 6, 18], p=[0.4, 0.4, 0.2]))
    wood, tall = rng.uniform(2.0, 24.0), rng.random() < 0.8
    line, start = rng.uniform(0.0, np.pi), rng.uniform(-land.half, land.half, 2)
    in_row = rng.random() < 0.35
    for number in range(rng.integers(1, most + 1)):
        foot = rng.uniform(-land.half - 3.0, land.half + 3.0, 2)
        if in_row:
            foot = start + (number - 3) * rng.uniform(3.0, 9.0) * np.array([np.cos(line), np.sin(line)])
        high = wood * rng.uniform(0.7, 1.3) if tall else rng.uniform(0.6, 3.0)
        wide = min(high * rng.uniform(0.12, 0.55), 9.0)
        base, low = land.ground_at(foot), high * (rng.uniform(0.0, 0.45) if high > 3.0 else 0.0)
        leafy, kind = rng.uniform(0.25, 2.0), "tree" if high > 3.0 else "shrub"
        for _ in range(rng.integers(1, 14)):
            axes = np.array([wide, wide, 0.5 * (high - low)]) * rng.uniform(0.2, 0.75, 3)
            room = np.array([wide, wide, 0.5 * (high - low)]) - axes
            middle = np.array([*foot, base + 0.5 * (high + low)]) + room * rng.uniform(-1.0, 1.0, 3)
            _pass_leaves(land, passed, (middle, axes), leafy, kind, rng)
        if kind == "tree" and rng.random() < 0.5:
            trunk = rng.integers(0, 1 + int(2.0 * land.density))
            around = rng.normal(0.0, 0.15, (trunk, 2))
            land.add(np.column_stack([foot + around, base + max(low, 1.0) * rng.random(trunk)]), kind)
    return passed


def _pass_leaves(
    land: _Land, passed: NDArray[np.bool_], body: tuple[F64, F64], leafy: float, kind: str, rng: np.random.Generator
) -> None:
    """Send the remaining pulses through one ellipsoid of leaves, and remove those that do not leave it below."""
    middle, axes = body
    flat = (((land.place - middle[:2]) / axes[:2]) ** 2).sum(axis=1)
    rows = np.flatnonzero((flat < 1.0) & passed)
    half = axes[2] * np.sqrt(1.0 - flat[rows])
    bottom = np.maximum(middle[2] - half, land.height[rows])
    at = middle[2] + half
    for number in range(2):
        at = at - rng.exponential(1.0 / leafy, len(rows)) - (0.8 if number else 0.0)
        met = at > bottom
        land.add(np.column_stack([land.place[rows[met]], at[met]]), kind)
    passed[rows] = ~(at > bottom) & (rng.random(len(rows)) < np.exp(-0.2 * leafy * half) + 0.05)
