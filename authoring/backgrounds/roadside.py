"""Objects along roads and fields: poles of an overhead line, and hedges."""

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.parcels import Parcel, clear_of, open_land
from authoring.backgrounds.solids import Frame, box
from authoring.backgrounds.terrain import Terrain
from authoring.shapes.component import Mesh, Scatter
from authoring.site.covers import to_world
from authoring.site.growth import stem
from authoring.site.plants import bush
from authoring.site.ways import merged

F64 = NDArray[np.float64]
POLE_STEP = 42.0  # distance between poles [m]
HEDGE_STEP = 2.6  # distance between bushes of a hedge [m]
NOTHING = np.zeros((0, 3))  # no existing objects
HEDGE_REACH = 150.0  # distance from the site within which hedges grow [m]


def plant_poles(terrain: Terrain, first_id: int, rng: np.random.Generator, taken: F64 = NOTHING) -> tuple[Scatter, ...]:
    """Place a row of poles beside both approach roads.

    Args:
        terrain: The terrain.
        first_id: Instance id of the run.
        rng: Random stream.
        taken: Station, left and radius of existing objects [m], shape (K, 3), float64.

    Returns:
        One run.
    """
    rows, turns = [], []
    side = rng.choice((-1.0, 1.0))
    for approach in terrain.land.approaches:
        far = abs((terrain.inner[0] if approach.sign < 0 else terrain.inner[1]) - approach.back)
        along = np.arange(far + 12.0, far + 620.0, POLE_STEP)
        station = approach.back + approach.sign * along
        left = approach.center(station) + side * (approach.half_width + 13.0)
        rows.append(np.column_stack([station, left, terrain.height(station, left)]))
        turns.append(terrain.land.layout.alignment.heading_at(station))
    places, yaw = np.concatenate(rows), np.concatenate(turns)
    apart = terrain.land.crossing.distance(places[:, 0], places[:, 1]) > terrain.land.crossing.half_width + 6.0
    apart &= terrain.clear(places[:, 0], places[:, 1]) > 3.0
    apart &= clear_of(terrain.land.layout.alignment, places[:, :2], taken, 0.3)
    places, yaw = places[apart], yaw[apart]
    positions = to_world(terrain.land.layout.alignment, places)
    which, scales = np.zeros(len(places), np.int32), np.ones((len(places), 3))
    return (Scatter("Countryside_Poles", "pole", "Plants", (_pole(rng),), which, positions, yaw, scales, (first_id,)),)


def plant_hedges(
    terrain: Terrain, parcels: tuple[Parcel, ...], taken: F64, count: int, rng: np.random.Generator, first_id: int
) -> tuple[Scatter, ...]:
    """Plant hedges along about half of the near fields.

    Args:
        terrain: The terrain.
        parcels: The fields.
        taken: Station, left and radius of existing objects [m], shape (K, 3), float64.
        count: Largest number of bushes.
        rng: Random stream.
        first_id: Instance id of the run.

    Returns:
        One run, or none if no field is near.
    """
    rows = []
    for parcel in parcels:
        line = parcel.outline(HEDGE_STEP)
        line = line + rng.uniform(-0.4, 0.4, line.shape)
        grown = rng.uniform() < 0.5
        if grown:
            rows.append(line[rng.uniform(0.0, 1.0, len(line)) < 0.85])
    places = np.concatenate([np.zeros((0, 2)), *rows])
    away = terrain.beyond(places[:, 0], places[:, 1])
    free = (open_land(terrain, places[:, 0], places[:, 1]) > 0.5) & (away < HEDGE_REACH)
    free &= clear_of(terrain.land.layout.alignment, places, taken, 2.0)
    places = places[free][np.argsort(away[free], kind="stable")][:count]
    if len(places) == 0:
        return ()
    height = terrain.height(places[:, 0], places[:, 1]) - 0.05
    positions = to_world(terrain.land.layout.alignment, np.column_stack([places, height]))
    bushes = tuple(bush(rng, 30) for _ in range(3))
    which = rng.integers(0, len(bushes), len(places)).astype(np.int32)
    scales = rng.uniform(1.5, 2.4, len(places))[:, None] * rng.uniform(0.85, 1.15, (len(places), 3))
    yaw = rng.uniform(0.0, 2 * np.pi, len(places))
    return (Scatter("Countryside_Hedges", "shrub", "Plants", bushes, which, positions, yaw, scales, (first_id,)),)


def _pole(rng: np.random.Generator) -> tuple[tuple[str, Mesh], ...]:
    """Make a timber pole with a crossarm and three insulators."""
    frame = Frame(0.0, 0.0, 0.0, 0.0)
    wood = merged([stem(8.6, 0.13, 7, rng), box(frame, (0.0, 0.0, 7.9), (0.06, 0.95, 0.06))])
    cups = [box(frame, (0.0, at, 8.05), (0.04, 0.04, 0.09)) for at in (-0.85, -0.35, 0.85)]
    return ("bark", wood), ("painted_metal", merged(cups))
