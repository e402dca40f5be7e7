"""Fields on the flat land of valleys, between a site, the houses and the woods on the slopes."""

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.lanes import Lane, lane_room
from authoring.backgrounds.parcels import Parcel, crop_fields, draw_parcels, uncropped
from authoring.backgrounds.terrain import Terrain
from authoring.backgrounds.waters import Basin
from authoring.site.covers import Cover

F64 = NDArray[np.float64]

REACH = (1500.0, 700.0)  # extent of fields along the axis and to its sides [m]
STEEPEST = 0.24  # largest slope of fields [1]
SHORE = 26.0  # distance of fields from the shore [m]


def valley_fields(
    terrain: Terrain, basin: Basin, taken: F64, lanes: tuple[Lane, ...], rng: np.random.Generator
) -> tuple[tuple[Parcel, ...], tuple[tuple[Cover, F64], ...]]:
    """Place fields where the land is flat and dry, and nothing is built.

    Args:
        terrain: The terrain.
        basin: The open water.
        taken: Station, left and radius of circles that cover buildings and drives [m], shape (K, 3), float64; a field
            that one touches has no crop, because the mesh is coarser than a drive is wide.
        lanes: Lanes and streets.
        rng: Random stream.

    Returns:
        The fields; each cover with its signed field at the terrain's nodes [m], shape (S, L).
    """
    parcels = uncropped(draw_parcels(terrain, rng, REACH), taken)
    station, left = terrain.nodes()
    field = terrain.field
    slope = np.hypot(
        np.gradient(field.heights, field.stations, axis=0), np.gradient(field.heights, field.lefts, axis=1)
    )
    free = np.minimum(60.0 * (STEEPEST - slope), -basin.inside(station, left) - SHORE)
    free = np.minimum(free, lane_room(lanes, station.ravel(), left.ravel()).reshape(station.shape) - 1.0)
    return parcels, tuple((cover, np.minimum(values, free)) for cover, values in crop_fields(terrain, parcels))
