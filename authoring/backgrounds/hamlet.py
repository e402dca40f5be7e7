"""Choice of places for homesteads: along roads and lanes, on fairly level ground, clear of all else."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.buildings import house_pieces
from authoring.backgrounds.byways import Byway, located, resampled, road_distance
from authoring.backgrounds.farm_lanes import joints, way_room
from authoring.backgrounds.homesteads import Homestead, Plan, draw_cottage, draw_farm, facing, settle
from authoring.backgrounds.plots import overlap
from authoring.backgrounds.terrain import Terrain
from authoring.shapes.component import Component, Mesh
from authoring.site.covers import to_world, turn

F64 = NDArray[np.float64]
FARTHEST = 360.0  # of a drive from the bridge's middle [m]
FARMS = 0.14  # share of the buildings that belong to farms, each a farmhouse and a barn [1]
TRIALS = 3  # plans of a house that are tried at each place
ROOM = 7.5  # least distance of a lot to the ways that are not its own lane [m]
HEDGE = 2.0  # least distance between two lots, and of a lot to a lane [m]


def draw_hamlet(
    terrain: Terrain, roads: list[Byway], lanes: list[Byway], count: int, rng: np.random.Generator
) -> tuple[Homestead, ...]:
    """Choose places for homesteads: farms along the lanes, then houses, most of them close to a lane's mouth.

    Args:
        terrain: The terrain.
        roads: The roads of the world.
        lanes: The lanes of the hamlet.
        count: Buildings wanted, without garages; fewer where the land has no room.
        rng: Random stream.

    Returns:
        Homesteads that keep a distance from each other and from roads, river and site.
    """
    found: list[Homestead] = []
    farms, built = round(FARMS * count / 2), 0
    sides = [(lane, 4.0) for lane in lanes] + [(road, 6.0) for road in roads]
    fronts = [
        np.column_stack([rows := joints(terrain, [way], step, 14.0, FARTHEST), np.full(len(rows), way.verge)])
        for way, step in sides
    ]
    places = np.concatenate([np.zeros((0, 6)), *fronts])
    mouths = np.array([lane.middle[0] for lane in lanes]).reshape(-1, 2)
    near = np.full(len(places), 1.0)
    for mouth in mouths:
        near = np.minimum(near, np.hypot(*(places[:, :2] - mouth).T) / FARTHEST)
    beside = places[:, 5] < ROOM
    for row in rng.permutation(np.flatnonzero(beside) if beside.any() else np.arange(len(places))):
        if farms > 0 and count - built > 2:
            farm = _placed(terrain, draw_farm, places[row], (roads, lanes), found, rng)
            if farm is not None:
                found.append(farm)
                farms, built = farms - 1, built + 2
    order = np.argsort(near * rng.uniform(0.3, 1.0, len(near)), kind="stable")
    for row in np.tile(order, TRIALS):
        if built < count:
            house = _placed(terrain, draw_cottage, places[row], (roads, lanes), found, rng)
            if house is not None:
                found.append(house)
                built += 1
    return tuple(found)


def hamlet_components(
    terrain: Terrain, homesteads: tuple[Homestead, ...], rng: np.random.Generator, first_id: int
) -> list[Component]:
    """Build the buildings.

    Args:
        terrain: The terrain.
        homesteads: The homesteads.
        rng: Random stream.
        first_id: Instance id of the first component.

    Returns:
        A component for each of their pieces.
    """
    axis = terrain.land.layout.alignment
    components = []
    for number, house in enumerate(house for home in homesteads for house in home.houses):
        frame = axis.frame_at(house.station, house.left)  # right angles of walls are kept where the axis is curved
        for name, kind, role, mesh in house_pieces(house, rng):
            normals = turn(frame, mesh.points[mesh.corners], mesh.normals.astype(np.float64)).astype(np.float32)
            placed = Mesh(to_world(frame, mesh.points), mesh.face_counts, mesh.corners, normals, mesh.st)
            prim = f"Countryside_House_{number:02d}_{name}"
            components.append(Component(prim, kind, role, "Buildings", placed, first_id + len(components)))
    return components


def occupied(terrain: Terrain, homesteads: tuple[Homestead, ...], lanes: list[Byway]) -> F64:
    """Cover lots, drives and lanes with circles, for what is placed after them.

    Args:
        terrain: The terrain.
        homesteads: The homesteads.
        lanes: The lanes.

    Returns:
        Station, left and radius of each circle [m], shape (K, 3), float64.
    """
    rows = [np.zeros((0, 3))]
    for home in homesteads:
        wide, deep = home.plan.size
        x, y = np.arange(-wide / 2 + 3.0, wide / 2, 6.0), np.arange(3.0, deep, 6.0)
        grid = home.world(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))
        rows.append(np.column_stack([grid, np.full(len(grid), 4.5)]))
        drive = resampled(home.driveway(), 2.5)
        rows.append(np.column_stack([drive, np.full(len(drive), 2.6)]))
    for lane in lanes:
        line = lane.middle[::2]
        rows.append(np.column_stack([line, np.full(len(line), 3.4)]))
    circles = np.concatenate(rows)
    return np.column_stack([*located(terrain, circles[:, :2]), circles[:, 2]])


def kept_off(terrain: Terrain, homesteads: tuple[Homestead, ...], lanes: list[Byway], gap: float) -> F64:
    """Measure the distance of the terrain's nodes to lots and lanes, minus a gap.

    Args:
        terrain: The terrain.
        homesteads: The homesteads.
        lanes: The lanes.
        gap: Distance to keep [m].

    Returns:
        Distances, at most 60 [m], shape (S, L), float64.
    """
    station, left = terrain.nodes()
    near = terrain.beyond(station, left) < 1.6 * FARTHEST
    axis = terrain.land.layout.alignment
    places = axis.point(station[near], left[near], np.zeros(int(near.sum())))[:, :2]
    apart = np.minimum(road_distance(lanes, places, reach=60.0), 60.0)
    for home in homesteads:
        apart = np.minimum(apart, -home.inside(places))
    free = np.full(station.shape, 60.0)
    free[near] = apart - gap
    return free


def _placed(
    terrain: Terrain,
    draw: Callable[[np.random.Generator], Plan],
    row: F64,
    ways: tuple[list[Byway], list[Byway]],
    found: list[Homestead],
    rng: np.random.Generator,
) -> Homestead | None:
    """Put a homestead at a front: edge, outward vector and verge of a road; None where there is no room."""
    home = facing(draw(rng), row[:5], float(row[5]))
    if found and overlap(home.row(HEDGE / 2), np.array([other.row(HEDGE / 2) for other in found])).any():
        return None
    drive = resampled(home.driveway(), 2.0)
    crossed = any((other.inside(drive) > -HEDGE).any() for other in found)
    if crossed or any((home.inside(resampled(other.driveway(), 2.0)) > -HEDGE).any() for other in found):
        return None
    wide, deep = home.plan.size
    x, y = np.linspace(-wide / 2, wide / 2, 9), np.linspace(0.0, deep, 9)
    grid = home.world(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))
    roads, lanes = ways
    near = row[5] < ROOM  # beside a lane
    if road_distance(lanes, grid).min() < HEDGE or (road_distance([*roads, *lanes], drive)[2:] <= 0.0).any():
        return None
    return settle(terrain, home) if way_room(terrain, grid).min() >= ROOM + 2.0 * near else None
