"""Land that rises towards the abutments of a high bridge, so that no high embankments are needed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.axis.alignment import Layout

F64 = NDArray[np.float64]
HIGH = 9.0  # [m] height of the deck above which the land rises towards the abutments
STEEPEST = 0.90  # [1] of a valley's sides
_FRONT = 2.0  # [m] from the bearing line forward to the top of the valley's side
_USUAL = 0.55  # [1] usual slope of a side
_ROUND = 1.6  # [m] over which the edges of a valley are rounded
_STOOP = (1.2, 2.2)  # [m] depth of the land at the abutments below their bearing seats
_SHELF = 1.5  # [m] level land behind a bridge's own foot on the side


@dataclass(frozen=True)
class Valley:
    """Heights of the land along the axis; across it they follow the curves of the crossing.

    Attributes:
        stations: Knots, rising [m].
        heights: Large-scale heights of the land there [m].
    """

    stations: tuple[float, ...]
    heights: tuple[float, ...]

    def __call__(self, station: F64, shift: F64) -> F64:
        """Find the height of the land [m], same shape as `station`, float64.

        Args:
            station: Distance along the axis [m], any shape, float64.
            shift: Shift of the valley along the axis there [m], the same shape, float64.
        """
        total = np.zeros(np.broadcast(station, shift).shape)
        for offset in (-0.75, -0.25, 0.25, 0.75):
            total += np.interp(station - shift + offset * _ROUND, self.stations, self.heights)
        return total / 4.0

    @property
    def ends(self) -> tuple[float, float]:
        """Height of the land beyond either end [m]."""
        return self.heights[0], self.heights[-1]


def floor_room(layout: Layout, station: float) -> float:
    """Find the widest floor of a valley from which its sides still reach the land at the abutments [m], half of it.

    Args:
        layout: The bridge.
        station: Middle of the floor [m].

    Returns:
        Half the width [m]; infinite under a low bridge, whose land does not rise.
    """
    decks = layout.alignment.height(np.array([layout.supports[0], layout.supports[-1]]))
    if decks.max() <= HIGH:
        return float("inf")
    rises = np.maximum(decks - layout.depth - _STOOP[0], 0.0)
    reach = np.abs(np.array([layout.supports[0], layout.supports[-1]]) - station) - _FRONT
    return float(np.min(reach - rises / STEEPEST))


def draw_valley(layout: Layout, station: float, floor: float, deep: bool, rng: np.random.Generator) -> Valley | None:
    """Draw the sides of a valley.

    Args:
        layout: The bridge.
        station: Where the crossing meets the axis [m].
        floor: Half the width that the crossing needs at the bottom [m].
        deep: Whether the crossing is a valley: low bridges then get one, too.
        rng: Random stream.

    Returns:
        The valley, or None under a low bridge.
    """
    shares = rng.random(4)
    decks = layout.alignment.height(np.array([layout.supports[0], layout.supports[-1]]))
    if not deep and decks.max() <= HIGH:
        return None
    sides = []
    for end, sign in ((0, -1.0), (1, 1.0)):
        stoop = _STOOP[0] + (_STOOP[1] - _STOOP[0]) * shares[end]
        rim = max(float(decks[end]) - layout.depth - stoop, 0.0)
        reach = abs(layout.supports[-end] - station) - _FRONT
        lowest = min(floor, reach)
        slack = max(reach - lowest - rim / _USUAL, 0.0)
        begin = lowest + (0.2 + 0.6 * shares[2 + end]) * slack
        knots = [(begin, 0.0), *_feet(layout, station, sign, (begin, reach), rim)]
        knots.append((reach, min(rim, knots[-1][1] + STEEPEST * (reach - knots[-1][0]))))
        sides.append([(float(station + sign * away), float(height)) for away, height in knots])
    knots = [*sides[0][::-1], *sides[1]]
    return Valley(tuple(round(s, 3) for s, _ in knots), tuple(round(h, 3) for _, h in knots))


def _feet(
    layout: Layout, station: float, sign: float, side: tuple[float, float], rim: float
) -> list[tuple[float, float]]:
    """List the ground that a bridge needs on one side: level shelves at its feet, by distance and height [m]."""
    knots, lowest = [], 0.0
    for away, height in sorted((sign * (foot - station), height) for foot, height in layout.feet):
        if not side[0] < away < side[1] - _SHELF:
            continue
        level = lowest = min(max(height, lowest), rim)
        knots += [(away, level), (away + _SHELF, level)]
    return knots
