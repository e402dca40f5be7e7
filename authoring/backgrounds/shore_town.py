"""Common parts of backgrounds at the water: places beside roads, cars on the shore road, vessels on the water."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.boats import Vessel
from authoring.backgrounds.dwellings import Design
from authoring.backgrounds.lanes import Lane, along_lanes
from authoring.backgrounds.parcels import open_land
from authoring.backgrounds.plots import Candidates, Plots, place_plots
from authoring.backgrounds.shore_quay import street_places
from authoring.backgrounds.terrain import Terrain
from authoring.backgrounds.vehicles import vehicle_models
from authoring.backgrounds.waters import Basin
from authoring.shapes.component import Scatter
from authoring.site.covers import to_world

F64 = NDArray[np.float64]
MOST = 150  # cars
_SMALL = ("saloon", "estate", "van")  # vehicles that fit in a parking bay


@dataclass(frozen=True, eq=False)
class Waterside:
    """Land beside open water, with its quays.

    Attributes:
        terrain: The terrain.
        basin: The water.
        reaches: Stations of the cross-sections of each stretch of quay [m], each of shape (N,), float64.
        prefix: Prefix of the names of these components.
    """

    terrain: Terrain
    basin: Basin
    reaches: list[F64]
    prefix: str


@dataclass(frozen=True, eq=False)
class Town:
    """The buildings and streets on such land.

    Attributes:
        designs: Designs of its buildings.
        plots: Places of buildings, and the design of each.
        lanes: Lanes and streets with cars at their edges.
        terraces: Terraces with houses.
        drives: Station, left and radius of circles over drives, where nothing grows [m], shape (K, 3), float64.
    """

    designs: tuple[Design, ...]
    plots: Plots
    lanes: tuple[Lane, ...]
    terraces: tuple[Lane, ...] = ()
    drives: F64 = field(default_factory=lambda: np.zeros((0, 3)))

    def taken(self) -> F64:
        """List station, left and radius of circles over buildings and drives [m], shape (K, 3), float64."""
        return np.concatenate([self.plots.taken(), self.drives])


def beside_roads(terrain: Terrain, span: tuple[float, float], rng: np.random.Generator) -> F64:
    """List places beside the approach roads.

    Args:
        terrain: The terrain.
        span: Range of distances from the road's edge [m].
        rng: Random stream.

    Returns:
        Station and left [m], shape (N, 2), float64.
    """
    rows = []
    for approach in terrain.land.approaches:
        station = approach.back + approach.sign * np.arange(75.0, 620.0, 7.0)
        for side in (-1.0, 1.0):
            aside = side * (approach.half_width + rng.uniform(*span, len(station)))
            rows.append(np.column_stack([station, approach.center(station) + aside]))
    return np.concatenate(rows)


def land_room(terrain: Terrain, basin: Basin, wanted: F64) -> F64:
    """Compute the distance of places to roads and rivers, site and water, minus margins.

    Args:
        terrain: The terrain.
        basin: The water.
        wanted: Station and left in the first columns [m], shape (N, ...), float64.

    Returns:
        Distances [m], shape (N,), float64.
    """
    free = open_land(terrain, wanted[:, 0], wanted[:, 1]) + 4.0
    return np.minimum(free, -basin.inside(wanted[:, 0], wanted[:, 1]) - 12.0)


def anchored(
    place: Waterside, wanted: F64, shapes: tuple[Vessel, ...], half: F64, count: int, first_id: int
) -> list[Scatter]:
    """Place vessels on the water, without overlaps.

    Args:
        place: The land and its water.
        wanted: Station [m], left [m], heading from the axis [rad] and shape number [1] of each candidate, shape (K, 4),
            float64.
        shapes: The vessels.
        half: Half the length and width of each shape [m], shape (D, 2), float64.
        count: Largest number of vessels.
        first_id: Instance id of the first.

    Returns:
        One run, or none.
    """
    candidates = Candidates(wanted, half, np.full(len(wanted), 1e3))
    afloat = place_plots(place.terrain, candidates, count, gap=1.0, deepest=1e3)
    total = len(afloat.which)
    if not total:
        return []
    axis = place.terrain.land.layout.alignment
    places = np.column_stack([afloat.places[:, :2], np.full(total, place.basin.level)])
    yaw = afloat.heading + axis.heading_at(places[:, 0])
    ids = tuple(range(first_id, first_id + total))
    return [
        Scatter(
            f"{place.prefix}_Boats",
            "vessel",
            "Shore",
            shapes,
            afloat.which,
            to_world(axis, places),
            yaw,
            np.ones((total, 3)),
            ids,
        )
    ]


def street_cars(place: Waterside, lanes: tuple[Lane, ...], rng: np.random.Generator, first_id: int) -> list[Scatter]:
    """Place driving cars on the right of the shore road, and parked ones beside it and on lanes.

    Args:
        place: The land and its quays.
        lanes: Lanes with cars at their edges.
        rng: Random stream.
        first_id: Instance id of the first.

    Returns:
        One run, or none.
    """
    terrain, basin = place.terrain, place.basin
    shapes = tuple(model for kind, model in vehicle_models() if kind in _SMALL)
    rows = []
    for aside, step, share, turn in ((1.6, 31.0, 0.55, np.pi), (-1.6, 34.0, 0.5, 0.0), (4.1, 6.2, 0.5, np.pi)):
        places = street_places(terrain, basin, place.reaches, aside, step)
        places = places[rng.random(len(places)) < share]
        if abs(aside) > 3.0:
            places[:, 2] = terrain.height(places[:, 0], places[:, 1])
        turns = np.full(len(places), turn if basin.side > 0 else turn + np.pi)
        rows.append(np.column_stack([places, turns]))
    for lane in lanes:
        for side in (-1.0, 1.0):
            places = along_lanes((lane,), np.array([side * (lane.half - 1.1)]), 13.0, rng)
            places = places[rng.random(len(places)) < 0.3]
            rows.append(np.column_stack([places, np.full(len(places), np.pi if side * lane.uphill > 0 else 0.0)]))
    cars = rng.permutation(np.concatenate(rows))[:MOST]
    if not len(cars):
        return []
    axis = terrain.land.layout.alignment
    yaw = cars[:, 3] + axis.heading_at(cars[:, 0])
    which = rng.integers(0, len(shapes), len(cars)).astype(np.int32)
    ids = tuple(range(first_id, first_id + len(cars)))
    spots = (to_world(axis, cars[:, :3]), yaw, np.ones((len(cars), 3)))
    return [Scatter(f"{place.prefix}_Vehicles", "vehicle", "Shore", shapes, which, *spots, ids)]
