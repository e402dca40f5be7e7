"""Coordinate frames between two planes that are not parallel, for members with a level foot and a sloping head."""

from dataclasses import dataclass, fields, replace

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.shapes.component import F64

Slope = tuple[float, float]
"""Rise per meter along and across a frame [1]."""
FLAT: Slope = (0.0, 0.0)


@dataclass(frozen=True)
class Wedge(Alignment):
    """A frame whose horizontal planes rotate about its origin, from one slope to another between two heights.

    Verticals stay vertical, so that the vertical sides of a prism stay plane for any slopes of its ends.

    Attributes:
        low: Height of the lower plane [m].
        high: Height of the upper plane [m].
        low_slope: Of the lower plane.
        high_slope: Of the upper plane.
        twist: Change of the upper plane's slope across for each meter along [1/m].
    """

    low: float = 0.0
    high: float = 1.0
    low_slope: Slope = FLAT
    high_slope: Slope = FLAT
    twist: float = 0.0

    @property
    def affine(self) -> bool:
        """Whether parallel lines stay parallel: only if both planes have the same slope."""
        return False

    def point(self, station: F64, left: F64, above: F64) -> F64:
        """Find world positions from coordinates in the frame.

        Args:
            station: Distance along the frame [m], shape (N,), float64.
            left: Distance to the left [m], shape (N,), float64.
            above: Height at the origin [m], shape (N,), float64.

        Returns:
            World positions [m], shape (N, 3), float64.
        """
        share = np.clip((above - self.low) / (self.high - self.low), 0.0, 1.0)
        slope = [(1.0 - share) * a + share * b for a, b in zip(self.low_slope, self.high_slope, strict=True)]
        return super().point(
            station, left, above + slope[0] * station + (slope[1] + share * self.twist * station) * left
        )


def wedge(
    frame: Alignment,
    spot: tuple[float, float],
    heights: tuple[float, float],
    *,
    low: Slope = FLAT,
    high: Slope = FLAT,
    twist: float = 0.0,
) -> Alignment:
    """Set the origin of a level frame to the point about which its planes rotate.

    Args:
        frame: A level, right-angled frame.
        spot: Station and distance to the left [m].
        heights: Of the lower and the upper plane at the spot [m].
        low: Slope of the lower plane.
        high: Slope of the upper plane.
        twist: Change of the upper plane's slope across for each meter along [1/m].
    """
    x, y, _ = frame.point(*(np.array([value]) for value in (*spot, 0.0)))[0]
    frame = replace(frame, origin=(float(x), float(y)))
    if low == FLAT and high == FLAT and twist == 0.0:
        return frame
    values = {field.name: getattr(frame, field.name) for field in fields(Alignment)}
    return Wedge(**values, low=heights[0], high=heights[1], low_slope=low, high_slope=high, twist=twist)


def road_slope(place: Alignment, station: float) -> Slope:
    """Find how the deck slopes in the right-angled frame of a support line.

    Args:
        place: Axis of the bridge.
        station: Station [m].

    Returns:
        Rise per meter perpendicular to the support line and along it, to the left [1].
    """
    at = np.array([station])
    grade, fall = float(place.grade_at(at)[0]), float(place.crossfall(at)[0])
    return _turned(grade, fall, place.skew)


def seat_slope(place: Alignment, support: float) -> Slope:
    """Find how a seat slopes in the right-angled frame of its support line: with the crossfall, without the grade.

    Args:
        place: Axis of the bridge.
        support: Station of the support [m].
    """
    return _turned(0.0, float(place.crossfall(np.array([support]))[0]), place.skew)


def _turned(grade: float, fall: float, skew: float) -> Slope:
    """Convert a slope in skewed coordinates to the frame that is rotated clockwise by the skew."""
    aside = fall - np.tan(skew) * grade  # perpendicular to the axis, to the left
    cosine, sine = float(np.cos(skew)), float(np.sin(skew))
    return float(grade * cosine - aside * sine), float(grade * sine + aside * cosine)
