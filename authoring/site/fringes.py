"""Tall grass along the borders of fields, yards and river banks, where no mower and no plough comes."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from authoring.site.grid import HeightField
from authoring.site.land import no_hills
from authoring.site.relief import draw_relief
from authoring.site.shape import Land

F64 = NDArray[np.float64]
B = NDArray[np.bool_]
Clear = Callable[[F64, F64], B]
BORDERED = ("ploughed", "crop", "ripe", "hay", "bank", "lot_asphalt", "lot_paved", "lot_gravel")  # covers
_DRAWN = 16  # places drawn for each that is wanted
_REACH = 3.0  # distance from a border within which a drawn place is moved to it [m]
_SURE, _LEVEL = 5.5, 0.15  # largest value [m] and least slope [1] of a field that tells where its border lies
_STEP = 0.2  # of the differences that tell where a border lies [m]
_NEAREST, _FARTHEST = 0.04, 0.40  # from a border, outside of the cover: nothing grows on tilled land [m]
_NEAR = 16.0  # distance from the deck's edge at which density has fallen to about a third [m]
_GAPS = ((9.0, 1.0), (3.0, 0.6))  # longest waves [m] and heights of what thins the grass
_LEAST = -0.9  # of these heights: grass stands along most of a border


def fringe_places(land: Land, ground: HeightField, count: int, rng: np.random.Generator, clear: Clear) -> F64:
    """Draw places along borders of covers, more of them near the bridge.

    Places are drawn evenly, and those near a border are moved to it down the slope of the distance to it.

    Args:
        land: The land.
        ground: The strip.
        count: Largest number of places.
        rng: Random stream.
        clear: Tells which places, by station and left [m], shape (N,) each, are off roads, water and the bridge.

    Returns:
        Station, left and ground height [m], shape (N, 3), float64.
    """
    drawn = _DRAWN * count
    station = rng.uniform(ground.stations[0] + 1.0, ground.stations[-1] - 1.0, drawn)
    left = rng.uniform(ground.lefts[0] + 1.0, ground.lefts[-1] - 1.0, drawn)
    chance, aside = rng.uniform(0.0, 1.0, drawn), rng.uniform(-_FARTHEST, -_NEAREST, drawn)
    thin = draw_relief(_GAPS, rng)
    beside = np.maximum(np.abs(left) - land.layout.width / 2, 0.0)
    kept = chance < np.exp(-beside / _NEAR)
    station, left, aside = station[kept], left[kept], aside[kept]
    away, ahead, across = _way(land, station, left)
    moved = np.flatnonzero(np.abs(away) < _REACH)
    step = aside[moved] - away[moved]
    station, left = station[moved] + step * ahead[moved], left[moved] + step * across[moved]
    stands = thin(station, left) > _LEAST
    stands &= (station > ground.stations[0] + 0.5) & (station < ground.stations[-1] - 0.5)
    stands &= (left > ground.lefts[0] + 0.5) & (left < ground.lefts[-1] - 0.5)
    stands &= clear(station, left)
    station, left = station[stands], left[stands]
    away, _, _ = _way(land, station, left)
    rows = np.flatnonzero((away < -0.5 * _NEAREST) & (away > -1.2 * _FARTHEST))[:count]
    return np.column_stack([station[rows], left[rows], ground(station[rows], left[rows])])


def _way(land: Land, station: F64, left: F64) -> tuple[F64, F64, F64]:
    """Estimate the distance to the border, positive within a cover [m], and the direction into it [1], shape (N,) each.

    The fields of the covers are no exact distances: they are divided by their slope.
    """
    inside = _inside(land, station, left)
    slopes = [(_inside(land, station + dx, left + dy) - inside) / _STEP for dx, dy in ((_STEP, 0.0), (0.0, _STEP))]
    steep = np.hypot(*slopes)
    known = (np.abs(inside) < _SURE) & (steep > _LEVEL)
    steep = np.where(known, steep, 1.0)
    return np.where(known, inside / steep, np.inf), slopes[0] / steep, slopes[1] / steep


def _inside(land: Land, station: F64, left: F64) -> F64:
    """Measure how far within the nearest of the covers each place lies, negative outside of all [m], shape (N,)."""
    covers = land.shape(station, left, no_hills).covers
    return np.max([covers[name] for name in BORDERED if name in covers], axis=0, initial=-9.0)
