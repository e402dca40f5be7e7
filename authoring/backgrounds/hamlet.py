"""Choice of places for buildings: along the roads, away from the fields' centers, on fairly level ground."""

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.buildings import House, draw_house, house_pieces
from authoring.backgrounds.parcels import open_land
from authoring.backgrounds.terrain import Terrain
from authoring.shapes.component import Component, Mesh
from authoring.site.covers import to_world, turn

F64 = NDArray[np.float64]
RADIUS = 12.5  # circle that holds any building [m]
STEEPEST = 1.6  # largest height difference under a building [m]
FARTHEST = 300.0  # from the bridge's middle [m]


def draw_hamlet(terrain: Terrain, count: int, rng: np.random.Generator) -> tuple[House, ...]:
    """Choose places for buildings.

    Args:
        terrain: The terrain.
        count: Buildings wanted; fewer where the land has no room.
        rng: Random stream.

    Returns:
        Buildings that keep a distance from each other, of roads, river and site.
    """
    houses: list[House] = []
    places = _candidates(terrain, 40 * count, rng)
    free = open_land(terrain, places[:, 0], places[:, 1]) > RADIUS - 6.0
    free &= terrain.beyond(places[:, 0], places[:, 1]) > RADIUS + 2.0
    middle = np.array([(terrain.inner[0] + terrain.inner[1]) / 2, 0.0])
    free &= np.hypot(*(places[:, :2] - middle).T) < FARTHEST
    around = np.linspace(0.0, 2 * np.pi, 8, endpoint=False)
    world = to_world(terrain.land.layout.alignment, places)
    built: list[F64] = []
    for (station, left, heading), place in zip(places[free], world[free], strict=True):
        if len(houses) == count:
            break
        if any(np.hypot(*(other - place)[:2]) < 2 * RADIUS - 3.0 for other in built):
            continue
        reach = RADIUS * np.array([[0.3], [0.6], [0.9]])
        spots = (station + reach * np.cos(around)).ravel(), (left + reach * np.sin(around)).ravel()
        rim = terrain.height(*spots)
        if np.ptp(rim) < STEEPEST:
            floor, foot = np.round([rim.mean() + 0.15, rim.min() - 0.4], 3).tolist()
            houses.append(draw_house((station, left), float(heading), (floor, foot), rng))
            built.append(place)
    return tuple(houses)


def hamlet_components(
    terrain: Terrain, houses: tuple[House, ...], rng: np.random.Generator, first_id: int
) -> list[Component]:
    """Build the buildings.

    Args:
        terrain: The terrain.
        houses: The buildings.
        rng: Random stream.
        first_id: Instance id of the first component.

    Returns:
        A component for each of their pieces.
    """
    axis = terrain.land.layout.alignment
    components = []
    for number, house in enumerate(houses):
        frame = axis.frame_at(house.station, house.left)  # right angles of walls are kept where the axis is curved
        for name, kind, role, mesh in house_pieces(house, rng):
            normals = turn(frame, mesh.points[mesh.corners], mesh.normals.astype(np.float64)).astype(np.float32)
            placed = Mesh(to_world(frame, mesh.points), mesh.face_counts, mesh.corners, normals, mesh.st)
            prim = f"Countryside_House_{number:02d}_{name}"
            components.append(Component(prim, kind, role, "Buildings", placed, first_id + len(components)))
    return components


def _candidates(terrain: Terrain, count: int, rng: np.random.Generator) -> F64:
    """Draw stations, lefts and ridge headings, shape (N, 3), two thirds of them beside the approach roads."""
    land = terrain.land
    rows = []
    for approach in land.approaches:
        along = rng.uniform(72.0, 260.0, count // 3)
        station = approach.back + approach.sign * along
        aside = rng.choice((-1.0, 1.0), count // 3) * (approach.half_width + rng.uniform(24.0, 50.0, count // 3))
        heading = rng.choice((0.0, np.pi / 2), count // 3) + rng.normal(0.0, 0.06, count // 3)
        rows.append(np.column_stack([station, approach.center(station) + aside, heading]))
    left = rng.choice((-1.0, 1.0), count // 3) * rng.uniform(98.0, 270.0, count // 3)
    station = rng.uniform(terrain.inner[0] - 60.0, terrain.inner[1] + 60.0, count // 3)
    rows.append(np.column_stack([station, left, rng.uniform(-0.5, 0.5, count // 3)]))
    places = np.concatenate(rows)
    return places[rng.permutation(len(places))]
