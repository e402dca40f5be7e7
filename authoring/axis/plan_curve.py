"""The axis of a bridge in plan: lines, arcs and clothoids one after the other, straight on beyond both ends."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
# Gauss-Legendre nodes: exact to the last digit or two while the heading turns by less than a radian in an element.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(10)
_FEW = 512  # stations


@dataclass(frozen=True)
class Element:
    """A piece of the axis whose curvature changes in proportion to its length: a line, an arc or a clothoid.

    Attributes:
        length: Along the axis [m], over 0.
        begin: Curvature where it begins, positive to the left [1/m].
        end: Curvature where it ends [1/m].
    """

    length: float
    begin: float = 0.0
    end: float = 0.0


@dataclass(frozen=True)
class PlanCurve:
    """Elements one after the other; stations count from the first one's beginning, which lies at the origin.

    Attributes:
        elements: At least one.
        heading: Direction of the chord from beginning to end, counter-clockwise from +x [rad].
    """

    elements: tuple[Element, ...]
    heading: float = 0.0

    @cached_property
    def knots(self) -> F64:
        """Stations where elements begin, and where the last ends [m], shape (E + 1,), float64."""
        return np.concatenate([[0.0], np.cumsum([element.length for element in self.elements])])

    @cached_property
    def _curvatures(self) -> F64:
        """Curvature where each element begins and how fast it changes, shape (E, 2), float64."""
        return np.array([(e.begin, (e.end - e.begin) / e.length) for e in self.elements])

    @cached_property
    def _turns(self) -> F64:
        """Headings at the knots, relative to the first [rad], shape (E + 1,), float64."""
        return np.concatenate([[0.0], np.cumsum([0.5 * (e.begin + e.end) * e.length for e in self.elements])])

    @cached_property
    def _places(self) -> F64:
        """Positions of the knots where the first heading is 0 [m], shape (E + 1, 2), float64."""
        chords = self._run(np.arange(len(self.elements)), np.diff(self.knots))
        return np.concatenate([np.zeros((1, 2)), np.cumsum(chords, axis=0)])

    @cached_property
    def first_heading(self) -> float:
        """Direction of the axis at station 0, counter-clockwise from +x [rad]."""
        return self.heading - float(np.arctan2(self._places[-1, 1], self._places[-1, 0]))

    @cached_property
    def _turn(self) -> F64:
        """Rotates rows of positions from a first heading of 0 to the axis's own, shape (2, 2), float64."""
        cosine, sine = np.cos(self.first_heading), np.sin(self.first_heading)
        return np.array([[cosine, sine], [-sine, cosine]])

    @property
    def largest_turn(self) -> float:
        """Largest angle between the axis and its chord [rad]."""
        inner = np.concatenate([np.linspace(low, high, 33) for low, high in pairwise(self.knots)])
        return float(np.abs(self.headings(inner) - self.heading).max())

    def headings(self, station: F64) -> F64:
        """Find the direction of the axis, counter-clockwise from +x.

        Args:
            station: Distance along the axis [m], shape (...), float64.

        Returns:
            Headings [rad], the same shape (...), float64.
        """
        number, local, _ = self._split(station)
        begin, change = np.moveaxis(self._curvatures[number], -1, 0)
        return self.first_heading + (self._turns[number] + local * (begin + 0.5 * change * local))

    def curvatures(self, station: F64) -> F64:
        """Find the curvature, positive to the left, 0 beyond the ends.

        Args:
            station: Distance along the axis [m], shape (...), float64.

        Returns:
            Curvatures [1/m], the same shape (...), float64.
        """
        number, local, beyond = self._split(station)
        begin, change = np.moveaxis(self._curvatures[number], -1, 0)
        return np.where(beyond == 0.0, begin + change * local, 0.0)

    def points(self, station: F64) -> F64:
        """Find positions on the axis.

        Args:
            station: Distance along the axis [m], shape (N,), float64.

        Returns:
            World positions in plan [m], shape (N, 2), float64.
        """
        return self.frames(station)[0]

    def frames(self, station: F64) -> tuple[F64, F64]:
        """Find positions on the axis and its direction there.

        Rings of many members share their stations: earlier results are cached, and in a long list each different
        station is integrated once.

        Args:
            station: Distance along the axis [m], shape (N,), float64.

        Returns:
            Positions in plan [m], shape (N, 2), and unit vectors ahead [1], shape (N, 2), float64, both read-only.
        """
        if len(station) <= _FEW:
            return self._known(station.tobytes())
        different, row = np.unique(station, return_inverse=True)
        positions, ahead = self._integrated(different)
        return positions.take(row, axis=0), ahead.take(row, axis=0)

    @cached_property
    def _known(self) -> Callable[[bytes], tuple[F64, F64]]:
        """`frames` of few stations, float64, with a cache of the last results."""
        return lru_cache(maxsize=256)(lambda stations: self._integrated(np.frombuffer(stations)))

    def _integrated(self, station: F64) -> tuple[F64, F64]:
        number, local, beyond = self._split(station)
        begin, change = self._curvatures.take(number, axis=0).T
        heading = self.first_heading + (self._turns[number] + local * (begin + 0.5 * change * local))
        ahead = np.stack([np.cos(heading), np.sin(heading)], axis=1)
        inner = self._places[number] + self._run(number, local)
        turned = inner @ self._turn
        if beyond.any():
            turned += beyond[:, None] * ahead
        return turned, ahead

    def _split(self, station: F64) -> tuple[NDArray[np.int64], F64, F64]:
        """Find each station's element, the distance from its beginning, and the signed distance beyond the ends."""
        inside = np.minimum(np.maximum(station, 0.0), self.knots[-1])
        number = np.searchsorted(self.knots[1:-1], inside, side="right")
        return number, inside - self.knots[number], station - inside

    def _run(self, number: NDArray[np.int64], local: F64) -> F64:
        """Integrate along elements from their beginnings, where the first heading is 0 [m], shape (N, 2), float64."""
        begin, change = (value[:, None] for value in self._curvatures[number].T)
        along = 0.5 * local[:, None] * (_NODES + 1.0)
        angle = self._turns[number][:, None] + along * (begin + 0.5 * change * along)
        half = 0.5 * local
        return np.stack([half * (np.cos(angle) @ _WEIGHTS), half * (np.sin(angle) @ _WEIGHTS)], axis=1)


def sine_elements(amplitude: float, scale: float, length: float) -> tuple[Element, ...]:
    """Follow the wave y = a sin(x / b) from its zero, in elements of at most 2 m.

    Source: the public Random Bridge Generator of Shi, Kim and Narazaki, whose trajectories are such waves.

    Args:
        amplitude: a [m].
        scale: b [m]: the wave repeats after 2 pi b.
        length: Length along the wave [m].

    Returns:
        Elements with the wave's curvature at their ends.
    """
    x = np.linspace(0.0, length, max(2, int(np.ceil(length / 0.02))))
    slope = amplitude / scale * np.cos(x / scale)
    speed = np.sqrt(1.0 + slope * slope)
    along = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(x))])
    knots = np.linspace(0.0, length, max(1, int(np.ceil(length / 2.0))) + 1)
    at = np.interp(knots, along, x)
    slope = amplitude / scale * np.cos(at / scale)
    curvature = -amplitude / scale**2 * np.sin(at / scale) / (1.0 + slope * slope) ** 1.5
    pieces = zip(np.diff(knots), curvature[:-1], curvature[1:], strict=True)
    return tuple(Element(float(size), float(begin), float(end)) for size, begin, end in pieces)
