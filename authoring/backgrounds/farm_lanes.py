"""Lanes of a hamlet: they leave a road, or come from far off where there is none, and end at a farm."""

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.byways import (
    HIGHEST,
    UNDER,
    Byway,
    frontages,
    ground,
    laid,
    located,
    resampled,
    road_distance,
)
from authoring.backgrounds.terrain import Terrain
from authoring.shapes.component import Mesh
from authoring.site.covers import to_world

F64 = NDArray[np.float64]

HALF = 1.9  # half the width of a lane [m]
FLARE = 2.2  # added to it at the mouth [m]
LENGTHS = (150.0, 240.0)  # [m]
APART = 95.0  # least distance between two mouths, and of a lane to any other road than its own [m]
STEEPEST = 0.14  # largest grade [1]
FAR = 900.0  # distance from the site at which a lane begins where no road is near [m]
STEP_AFAR = 5.0  # distance between the points of a lane from there [m]
REACH = 300.0  # distance from the site's middle within which lanes leave roads [m]
AT_ENDS = 95.0  # distance from the ends of a long site within which they leave roads even beyond that reach [m]


def draw_farm_lanes(
    terrain: Terrain, roads: list[Byway], count: int, rng: np.random.Generator
) -> list[tuple[Mesh, Byway]]:
    """Draw lanes that leave the roads at about a right angle, or where there is none, lanes from far off.

    Args:
        terrain: The terrain.
        roads: The roads of the world.
        count: Lanes wanted; fewer where the land has no room.
        rng: Random stream.

    Returns:
        Surface and edges of each.
    """
    lanes: list[tuple[Mesh, Byway]] = []
    for row in rng.permutation(joints(terrain, roads, 8.0, 40.0, REACH)):
        bend, length = rng.normal(0.0, 0.0035), rng.uniform(*LENGTHS)
        if len(lanes) == count:
            break
        path = _curve(
            row[:2] - UNDER * row[3:], float(np.arctan2(row[4], row[3]) + rng.normal(0.0, 0.12)), bend, length
        )
        others = [lane for _, lane in lanes]
        apart = np.minimum(road_distance(others, path), road_distance(roads, path) + np.where(_far(path), 0.0, 1e3))
        if apart.min() > APART and _passable(terrain, path):
            lanes.append(laid(terrain, path, HALF, float(row[2]) - 0.03, FLARE))
    return lanes if lanes or roads else _from_afar(terrain, count, rng)


def joints(terrain: Terrain, roads: list[Byway], step: float, nearest: float, reach: float) -> F64:
    """List places on the edges of roads where something may join them: level with the land, away from the site.

    Args:
        terrain: The terrain.
        roads: The roads.
        step: Distance between places [m].
        nearest: Least distance from the site [m].
        reach: Largest distance from its middle [m]; beyond the ends of a long site it is `AT_ENDS`.

    Returns:
        World position of the edge [m] and unit vector away from the road [1], shape (N, 5), float64.
    """
    if not roads:
        return np.zeros((0, 5))
    rows = np.concatenate([frontages(road, step) for road in roads])
    station, left = located(terrain, rows[:, :2])
    middle = 0.5 * (terrain.inner[0] + terrain.inner[1])
    kept = (terrain.beyond(station, left) > nearest) & (terrain.clear(station, left) > nearest)
    kept &= np.hypot(station - middle, left) < max(reach, 0.5 * (terrain.inner[1] - terrain.inner[0]) + AT_ENDS)
    rows = rows[kept]
    beside = ground(terrain, rows[:, :2] + 7.0 * rows[:, 3:])
    return rows[np.abs(rows[:, 2] - beside) < HIGHEST]


def way_room(terrain: Terrain, places: F64) -> F64:
    """Measure the distance of places to the crossing, the approaches and the site.

    Args:
        terrain: The terrain.
        places: World positions in plan [m], shape (N, 2), float64.

    Returns:
        Distances to the edges of roads; to those of rivers and railways, and to the site, they are shortened, because
        more room is needed there [m], shape (N,), float64.
    """
    land = terrain.land
    station, left = located(terrain, places)
    needed = {"road": 0.0, "rail": 6.0}.get(land.crossing.kind, 14.0)
    room = land.crossing.distance(station, left) - land.crossing.half_width - needed
    for approach in land.approaches:
        aside = np.abs(left - approach.center(station)) / approach.stretch(station) - approach.half_width
        aside -= 0.0 if land.layout.track is None else 6.0
        room = np.minimum(room, np.where(approach.along(station) > -20.0, aside, 60.0))
    return np.minimum(room, np.minimum(terrain.beyond(station, left), terrain.clear(station, left)) - 3.0)


def _curve(start: F64, heading: float, bend: float, length: float) -> F64:
    """Draw an arc from a place: points in equal steps [m], shape (N, 2), float64."""
    along = np.linspace(0.0, length, int(length) + 1)
    turn = heading + bend * along
    steps = np.column_stack([np.cos(turn), np.sin(turn)])[:-1] * (along[1] - along[0])
    return resampled(np.concatenate([start[None], start + np.cumsum(steps, axis=0)]))


def _far(path: F64) -> NDArray[np.bool_]:
    """Find the points of a lane that are so far along it that it must have left its own road, shape (N,), bool."""
    return np.hypot(*(path - path[0]).T) > APART + 10.0


def _passable(terrain: Terrain, path: F64) -> bool:
    """Check that a lane leaves the ways and the site, and is nowhere steep, along or across."""
    inner = path[12:]
    if way_room(terrain, inner).min() < 9.0:
        return False
    height = ground(terrain, path)
    ahead: F64 = np.asarray(np.gradient(path, axis=0))
    aside = np.column_stack([-ahead[:, 1], ahead[:, 0]]) / np.linalg.norm(ahead, axis=1, keepdims=True)
    tilt = ground(terrain, path + 4.0 * aside) - ground(terrain, path - 4.0 * aside)
    grade = np.abs(np.diff(height[4:])) / np.hypot(*np.diff(path[4:], axis=0).T)
    return bool(grade.max() < STEEPEST and np.abs(tilt[4:]).max() < 8.0 * STEEPEST)


def _from_afar(terrain: Terrain, count: int, rng: np.random.Generator) -> list[tuple[Mesh, Byway]]:
    """Draw at most two lanes beside the axis that come from far off and end near the crossing."""
    lanes: list[tuple[Mesh, Byway]] = []
    crossing, axis = terrain.land.crossing, terrain.land.layout.alignment
    for _ in range(40):
        side, end = rng.choice((-1.0, 1.0), 2)
        left = side * (max(abs(terrain.inner[2]), terrain.inner[3]) + rng.uniform(45.0, 110.0))
        middle = float(crossing.center(np.array([left]))[0])
        edge = terrain.inner[1] if end > 0 else terrain.inner[0]
        first = edge + end * FAR
        last = middle + end * (crossing.half_width + rng.uniform(45.0, 80.0))
        at = np.linspace(first, last, max(int(abs(first - last) / STEP_AFAR), 2))
        swing = rng.uniform(6.0, 14.0) * np.sin((at - first) / rng.uniform(70.0, 130.0))
        path = resampled(to_world(axis, np.column_stack([at, left + swing, np.zeros(len(at))]))[:, :2])
        others = [lane for _, lane in lanes]
        if len(lanes) < min(count, 2) and road_distance(others, path).min() > APART and _passable(terrain, path):
            lanes.append(laid(terrain, path, HALF, None))
    return lanes
