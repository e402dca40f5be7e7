"""Hedges on a site: on the grass between two plots, and along the road or river under the bridge."""

import numpy as np
from numpy.typing import NDArray

from authoring.site.fields import ASIDE
from authoring.site.grid import HeightField
from authoring.site.land import no_hills
from authoring.site.shape import STEEP, Land

F64 = NDArray[np.float64]

STEP = 0.95  # distance between the bushes of a hedge [m]
_GROWN = 0.62  # share of the lines with a hedge [1]
_APART = 14.0  # from the deck's edge to the first bush [m]
_GAP = 5.0  # width of a gate in a hedge [m]


def hedge_places(land: Land, ground: HeightField, count: int, rng: np.random.Generator) -> F64:
    """Draw the places of bushes.

    Args:
        land: The land; hedges are only planted where it is used as fields.
        ground: The strip.
        count: Largest number of bushes.
        rng: Random stream.

    Returns:
        Station, left and height [m], shape (N, 3), float64; none on a road or river, on a fill or beside the deck.
    """
    if land.plots is None or land.plots.land != "fields" or not count:
        return np.zeros((0, 3))
    low, high, wide = land.plots.bounds
    lines = []
    for split, side in zip(land.plots.splits, (-1.0, 1.0), strict=True):
        station = np.arange(low + 5.0, high - 5.0, STEP)
        swung = split + land.plots.shift(station, np.full(len(station), side))
        lines.append(np.column_stack([station, side * swung]))
        left = side * np.arange(0.5 * land.layout.width + _APART, wide - 5.0, STEP)
        for bank in (-1.0, 1.0):
            away = land.crossing.half_width + land.plots.aside - 2.0
            away = away + land.plots.bend(left, np.full(len(left), bank * ASIDE))
            lines.append(
                np.column_stack([land.crossing.center(left) + bank * away * land.crossing.stretch(left), left])
            )
    grown = []
    for line in lines:
        gate = line[rng.integers(0, len(line))]
        kept = np.abs(line - gate).max(axis=1) > 0.5 * _GAP
        kept &= rng.random(len(line)) < 0.93
        if rng.random() < _GROWN:
            grown.append((line + rng.uniform(-0.22, 0.22, line.shape))[kept])
    places = np.concatenate([np.zeros((0, 2)), *grown])
    station, left = places.T
    free = land.crossing.distance(station, left) > land.crossing.half_width + land.plots.aside - 3.0
    free &= np.abs(left) > 0.5 * land.layout.width + _APART - 1.0
    free &= land.steepness(station, left, no_hills) < STEEP
    for approach in land.approaches:
        aside = np.abs(left - approach.center(station)) - approach.half_width
        free &= (approach.along(station) < -10.0) | (aside > 9.0)
    places = places[free][:count]
    return np.column_stack([places, ground(places[:, 0], places[:, 1])])
