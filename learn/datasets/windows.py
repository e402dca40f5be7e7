"""The paper's windows along a bridge; their boxes are computed from the labels, so only labeled clouds have them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from learn.datasets.labeled_cloud import LabeledCloud
from learn.datasets.settings import WindowSettings
from usd_schemas.components import UNLABELED

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_EDGES = 0.5, 99.5  # percentiles between which the deck lies: stray points must not widen it
_GROUND, _TOP = 1.0, 99.9  # percentiles of the heights of background and bridge
_FEWEST_DECK = 10  # least number of deck points for the width of a window


@dataclass(frozen=True, eq=False)
class Window:
    """Points in a box across the bridge.

    Attributes:
        number: Number of the window along the bridge.
        rows: Its points, ascending, shape (N,), int64.
        origin: Center of its box, at the lower end [m], shape (3,), float64.
    """

    number: int
    rows: I64
    origin: F64


@dataclass(frozen=True, eq=False)
class WindowBox:
    """A box across the bridge.

    Attributes:
        number: Number of the window along the bridge.
        axis: Direction of the bridge [1], shape (2,), float64.
        along: Its start and end along the axis [m].
        beside: Its start and end across the axis, positive to the left [m].
        height: Its lower and upper end [m].
        origin: Its center, at the lower end [m], shape (3,), float64.
    """

    number: int
    axis: F64
    along: tuple[float, float]
    beside: tuple[float, float]
    height: tuple[float, float]
    origin: F64

    def holds(self, coord: F64) -> NDArray[np.bool_]:
        """Tell which points lie in the box.

        Args:
            coord: Positions [m], shape (N, 3), float64.

        Returns:
            Whether each does, shape (N,), bool.
        """
        across = np.array([-self.axis[1], self.axis[0]])
        inside = (coord[:, 2] >= self.height[0]) & (coord[:, 2] <= self.height[1])
        for values, (low, high) in ((coord[:, :2] @ self.axis, self.along), (coord[:, :2] @ across, self.beside)):
            inside &= (values >= low) & (values <= high)
        return inside


def cut_windows(cloud: LabeledCloud, settings: WindowSettings, where: object) -> Iterator[Window]:
    """Cut a cloud into boxes along the bridge.

    Args:
        cloud: Labeled points.
        settings: Sizes.
        where: Source, for the error.

    Yields:
        The windows that hold deck and points.

    Raises:
        InputError: No point of the deck is labeled.
    """
    for box, rows in _lay(cloud, settings, where):
        yield Window(box.number, rows, box.origin)


def lay_windows(cloud: LabeledCloud, settings: WindowSettings, where: object) -> list[WindowBox]:
    """Compute the boxes of `cut_windows`, for other clouds of the same bridge.

    Args:
        cloud: Labeled points.
        settings: Sizes.
        where: Source, for the error.

    Raises:
        InputError: No point of the deck is labeled.
    """
    return [box for box, _ in _lay(cloud, settings, where)]


def _lay(cloud: LabeledCloud, settings: WindowSettings, where: object) -> Iterator[tuple[WindowBox, I64]]:
    """Lay out boxes along the bridge; with each, its points.

    The axis is the longer horizontal direction of the deck. Each box is as wide as the deck there plus a margin, and
    extends from below the ground to above the bridge.

    Source: the local data set of the method; margins as in its text.
    """
    deck = np.flatnonzero(cloud.deck)
    if len(deck) < _FEWEST_DECK:
        raise InputError(
            "has no labeled deck for windows along the bridge",
            where=where,
            value=len(deck),
            allowed=f"at least {_FEWEST_DECK} points of the deck",
            hint="Use --mode metric",
        )
    axis = _long_axis(cloud.coord[deck, :2])
    across = np.array([-axis[1], axis[0]])
    along, beside, height = cloud.coord[:, :2] @ axis, cloud.coord[:, :2] @ across, cloud.coord[:, 2]
    low, high = np.percentile(along[deck], _EDGES)
    step = settings.length * (1.0 - settings.overlap)
    order = np.argsort(along, kind="stable")
    deck_order = deck[np.argsort(along[deck], kind="stable")]
    for number in range(int(max(high - low - settings.length, 0.0) / step + 1e-9) + 1):
        start = low + number * step
        mine = _between(along, deck_order, start, start + settings.length)
        rows = _between(along, order, start, start + settings.length)
        if len(mine) < _FEWEST_DECK:
            continue
        left, right = np.percentile(beside[mine], _EDGES)
        middle, half = 0.5 * (left + right), 0.5 * (right - left + settings.beside)
        rows = rows[np.abs(beside[rows] - middle) <= half]
        bottom, top = _heights(cloud, rows, height)
        bottom, top = bottom - settings.below, top + settings.above
        rows = np.sort(rows[(height[rows] >= bottom) & (height[rows] <= top)])
        center = (start + 0.5 * settings.length) * axis + middle * across
        yield (
            WindowBox(
                number,
                axis,
                (float(start), float(start + settings.length)),
                (float(middle - half), float(middle + half)),
                (bottom, top),
                np.array([*center, bottom]),
            ),
            rows,
        )


def _long_axis(points: F64) -> F64:
    """Find the longer horizontal direction, towards +x (or +y), shape (2,)."""
    _, vectors = np.linalg.eigh(np.cov(points.T))
    axis = vectors[:, 1]
    return axis if (axis[0] > 0 or (axis[0] == 0 and axis[1] > 0)) else -axis


def _between(along: F64, order: I64, start: float, end: float) -> I64:
    first, last = np.searchsorted(along[order], [start, end])
    return order[first:last]


def _heights(cloud: LabeledCloud, rows: I64, height: F64) -> tuple[float, float]:
    """Find the height of the ground and of the bridge's top among some points."""
    bridge = cloud.bridge[rows]
    rest = rows[~bridge & (cloud.base[rows] != UNLABELED)]
    lowest = np.percentile(height[rest], _GROUND) if len(rest) else height[rows].min()
    return float(min(lowest, height[rows[bridge]].min())), float(np.percentile(height[rows[bridge]], _TOP))
