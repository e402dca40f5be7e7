"""Objects along the roads: pasture fences along the crossing, fences along the approaches, cars, vans and trucks."""

import numpy as np
from numpy.typing import NDArray

from authoring.axis.alignment import Alignment
from authoring.backgrounds.parcels import clear_of
from authoring.backgrounds.solids import Frame, box
from authoring.backgrounds.terrain import Terrain
from authoring.backgrounds.vehicles import vehicle_models
from authoring.shapes.component import Mesh, Scatter
from authoring.site.covers import to_world
from authoring.site.fences import AT_BORDER, PITCH, Piece, fence_meshes, fence_sides
from authoring.site.ways import merged

F64 = NDArray[np.float64]

PANEL = 3.0  # length of a fence's panel [m]
FENCED = 240.0  # distance from the site up to which fences run [m]
ASIDE = {"river": 19.0, "harbour": 19.0, "road": 8.5, "rail": 7.5}  # from the edge of the way to the fence [m]
BORDER = 6.0  # from the site's border to the fence beside it [m]
DRIVEN = (14.0, 420.0)  # distances from the site between which cars drive [m]
_CARS = ("saloon", "estate", "van", "truck")
_SHORTEST = 6  # posts of the shortest stretch of a fence along an approach
_GATE = 9  # panels from gap to gap, on the average


def plant_fences(terrain: Terrain, taken: F64, rng: np.random.Generator, first_id: int) -> tuple[Scatter, ...]:
    """Fence the pasture off from the crossing way and from the bridge's strip, on both sides, with gaps.

    Args:
        terrain: The terrain.
        taken: Station, left and radius of existing objects [m], shape (K, 3), float64.
        rng: Random stream.
        first_id: Instance id of the run.

    Returns:
        One run.
    """
    crossing, axis = terrain.land.crossing, terrain.land.layout.alignment
    away = crossing.half_width + ASIDE.get(crossing.kind, 12.0)
    steps = np.arange(4.0, FENCED, PANEL)
    left = np.concatenate([terrain.inner[3] + steps, terrain.inner[2] - steps])
    rows = []
    for side in (-1.0, 1.0):
        station = crossing.center(left) + side * away * crossing.stretch(left)
        ahead = np.column_stack([crossing.center(left + 1.0) - crossing.center(left - 1.0), np.full(len(left), 2.0)])
        rows.append(np.column_stack([station, left, ahead]))
    first, last, low, high = terrain.inner
    along = np.arange(first - 40.0, last + 40.0, PANEL)
    for side in (low - BORDER, high + BORDER):
        line = np.column_stack([along, np.full(len(along), side), np.full(len(along), 2.0), np.zeros(len(along))])
        rows.append(line[crossing.distance(line[:, 0], line[:, 1]) > away + PANEL])
    places = np.concatenate(rows)
    kept = (terrain.clear(places[:, 0], places[:, 1]) > 5.0) & (rng.random(len(places)) > 1.0 / _GATE)
    kept &= clear_of(axis, places[:, :2], taken, PANEL)
    places = places[kept]
    height = terrain.height(places[:, 0], places[:, 1])
    positions = to_world(axis, np.column_stack([places[:, :2], height]))
    beyond = to_world(axis, np.column_stack([places[:, :2] + 0.25 * places[:, 2:], height]))
    yaw = np.arctan2(*(beyond - positions)[:, 1::-1].T)
    which, scales = rng.integers(0, 2, len(places)).astype(np.int32), np.ones((len(places), 3))
    panels = (fence_panel(0.0), fence_panel(0.06))
    return (Scatter("Countryside_Fences", "fence", "Plants", panels, which, positions, yaw, scales, (first_id,)),)


def approach_fences(terrain: Terrain, taken: F64) -> dict[str, F64]:
    """Carry on the right-of-way fences of the site beside both approaches, with gaps at lanes and yards.

    They begin where the keep-out volume ends, which is larger than the strip of a skewed or curved bridge.

    Args:
        terrain: The terrain.
        taken: Station, left and radius of existing objects [m], shape (K, 3), float64.

    Returns:
        Station, left and world height of the ground at the posts of each fence [m], shape (N, 3), float64, by its name.
    """
    axis, crossing = terrain.land.layout.alignment, terrain.land.crossing
    fences = {}
    for number, side, offset in fence_sides(terrain.land):
        approach = terrain.land.approaches[number]
        border = terrain.inner[0] if approach.sign < 0 else terrain.inner[1]
        station = border + approach.sign * np.arange(AT_BORDER, FENCED, PITCH)
        left = approach.center(station) + offset
        free = clear_of(axis, np.column_stack([station, left]), taken, PITCH)
        free &= terrain.clear(station, left) > 0.5 * AT_BORDER
        free &= crossing.distance(station, left) > crossing.half_width + ASIDE.get(crossing.kind, 12.0) + PITCH
        fences[f"Fence_{number}_{side}"] = np.column_stack([station, left, terrain.height(station, left)])[free]
    return fences


def build_fences(axis: Alignment, fences: dict[str, F64]) -> list[Piece]:
    """Build fences, without stretches of fewer than `_SHORTEST` posts.

    Args:
        axis: Axis of the bridge.
        fences: As `approach_fences` gives them [m], each shape (N, 3).

    Returns:
        Leaf prim name, component kind, material recipe and mesh of each piece.
    """
    return [piece for name, posts in fences.items() for piece in fence_meshes(name, axis, posts, _SHORTEST)]


def drive_cars(terrain: Terrain, count: int, rng: np.random.Generator, first_id: int) -> tuple[Scatter, ...]:
    """Place cars on the approach roads, on the right; none if the bridge carries a railway.

    Args:
        terrain: The terrain.
        count: How many.
        rng: Random stream.
        first_id: Instance id of the run.

    Returns:
        One run, or none.
    """
    land = terrain.land
    if land.layout.track is not None or not count:
        return ()
    axis, rows = land.layout.alignment, []
    for number in range(count):
        approach = land.approaches[number % 2]
        border = terrain.inner[0] if approach.sign < 0 else terrain.inner[1]
        far = DRIVEN[0] + (DRIVEN[1] - DRIVEN[0]) * (number + rng.uniform(0.1, 0.9)) / count
        way = 1.0 if rng.random() < 0.5 else -1.0  # towards higher stations, or lower
        station = border + approach.sign * far
        at = np.array([station, station + 1.0])
        center = approach.center(at)
        rows.append((station, center[0] - way * 0.5 * approach.half_width, np.arctan(center[1] - center[0]), way))
    cars = np.array(rows)
    cars = cars[terrain.clear(cars[:, 0], cars[:, 1]) > 8.0]
    if not len(cars):
        return ()
    crown = np.array(
        [
            land.approaches[int(s > 0.5 * sum(terrain.inner[:2]))].level(land.layout, terrain.hills, np.array([s]))[0]
            for s in cars[:, 0]
        ]
    )
    height = np.maximum(crown, terrain.height(cars[:, 0], cars[:, 1]) + 0.05) - 0.02
    yaw = axis.heading_at(cars[:, 0]) + cars[:, 2] + np.where(cars[:, 3] > 0, 0.0, np.pi)
    shapes = tuple(model for kind, model in vehicle_models() if kind in _CARS)
    which = rng.integers(0, len(shapes), len(cars)).astype(np.int32)
    positions, scales = to_world(axis, np.column_stack([cars[:, :2], height])), np.ones((len(cars), 3))
    return (Scatter("Countryside_Vehicles", "vehicle", "Vehicles", shapes, which, positions, yaw, scales, (first_id,)),)


def fence_panel(sag: float) -> tuple[tuple[str, Mesh], ...]:
    """Make a post with three rails up to the next post.

    Args:
        sag: Depth that the rails have sunk [m].

    Returns:
        The panel, its post on the origin, its rails along x.
    """
    frame = Frame(0.0, 0.0, 0.0, 0.0)
    half = 0.5 * PANEL
    rails = [box(frame, (half, 0.04, height - sag), (half + 0.1, 0.018, 0.055)) for height in (0.38, 0.76, 1.14)]
    return (("timber", merged([box(frame, (0.0, 0.0, 0.45), (0.06, 0.06, 0.85)), *rails])),)
