"""Spread footings: blocks in the ground, with bottoms below it everywhere and tops that may be visible."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.shapes.component import F64
from authoring.shapes.sections import cut_corners, rectangle
from authoring.solids.extrusion import Prism
from authoring.solids.sweep import Surface

Ground = Callable[[F64], F64]

_LEAST_SHAFT = 0.5  # [m] least height between a footing and the member on its shafts
_BESIDE = 0.3  # [m] around a block where the ground is sampled


@dataclass(frozen=True)
class Founding:
    """Foundation depth of a block of an arch bridge.

    Attributes:
        place: Level frame, or axis of the bridge, that heights count in.
        ground: Height of the ground [m], shape (N,), at plan positions [m], shape (N, 2).
        depth: Bottom of a block below the lowest ground at it [m].
    """

    place: Alignment
    ground: Ground
    depth: float

    def ground_range(self, stations: tuple[float, float], left: tuple[float, float]) -> tuple[float, float]:
        """Find the lowest and the highest ground under a rectangle and close beside it.

        Args:
            stations: From and to [m].
            left: From and to, to the left of the axis [m].

        Returns:
            Heights above the frame's finished surface [m].
        """
        s, across = np.meshgrid(
            np.linspace(stations[0] - _BESIDE, stations[1] + _BESIDE, 13),
            np.linspace(left[0] - _BESIDE, left[1] + _BESIDE, 13),
        )
        points = self.place.point(s.ravel(), across.ravel(), np.zeros(s.size))
        heights = self.ground(points[:, :2]) - points[:, 2]
        return float(heights.min()), float(heights.max())

    def bottom(self, stations: tuple[float, float], left: tuple[float, float], ceiling: float) -> float:
        """Find the bottom of a block [m].

        Args:
            stations: From and to [m].
            left: From and to, to the left of the axis [m].
            ceiling: Upper limit of the ground's height, so that the block has some height [m].
        """
        return min(self.ground_range(stations, left)[0], ceiling) - self.depth


def footing_top(lowest: float, highest: float, rise: float) -> float:
    """Find the top of a footing [m].

    Args:
        lowest: Lowest ground at it [m].
        highest: Highest ground at it [m].
        rise: Above the highest ground; below zero: under the lowest [m].
    """
    return highest + rise if rise >= 0.0 else lowest + rise


def footing_heights(
    half: F64, station: float, ceiling: float, level: Alignment, ground: Ground, reach: tuple[float, float]
) -> tuple[float, float]:
    """Find bottom and top of a footing above the finished deck surface [m].

    Args:
        half: Half its size along and across the bridge [m], shape (2,), float64.
        station: Its middle [m].
        ceiling: Underside of the member on its shafts [m].
        level: Level frame of the support.
        ground: Height of the ground [m], shape (N,), at plan positions [m], shape (N, 2).
        reach: Its top above the highest ground at it, below zero under the lowest; its bottom below the lowest ground
            and below its top [m].
    """
    s, left = (g.ravel() for g in np.meshgrid(np.linspace(-1.0, 1.0, 9), np.linspace(-1.0, 1.0, 17), indexing="ij"))
    corners = level.point(station + s * half[0], left * half[1], np.zeros(len(s)))
    heights = ground(corners[:, :2]) - corners[:, 2]
    top = min(footing_top(float(heights.min()), float(heights.max()), reach[0]), ceiling - _LEAST_SHAFT)
    return min(float(heights.min()), top) - reach[1], top


def footing_surface(half: F64, station: float, low: float, high: float, level: Alignment, chamfer: float) -> Surface:
    """Build a footing.

    Args:
        half: Half its size along and across the bridge [m], shape (2,), float64.
        station: Its middle [m].
        low: Its bottom above the finished deck surface [m].
        high: Its top [m].
        level: Level frame of the support.
        chamfer: Leg of chamfers [m].
    """
    outline = rectangle((station - half[0], -half[1]), (station + half[0], half[1]))
    return Prism(cut_corners(outline, chamfer), low, high, "above", level, chamfer).surface
