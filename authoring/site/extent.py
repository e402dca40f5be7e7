"""The extent of a site: its outline, the ground along it, and the box that backgrounds leave empty."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.axis.alignment import Alignment
from authoring.site.covers import to_world
from authoring.site.grid import HeightField

F64 = NDArray[np.float64]
AIR = 120.0  # height of the keep-out volume above the deck [m]


@dataclass(frozen=True)
class Box:
    """An upright box that may be rotated about the vertical.

    Attributes:
        center: World position [m].
        half: Half its size along, left of and above its rotated axes [m].
        heading: Direction of its first axis, counter-clockwise from +x [rad].
    """

    center: tuple[float, float, float]
    half: tuple[float, float, float]
    heading: float

    def contains(self, points: F64, margin: float = 0.0) -> NDArray[np.bool_]:
        """Find which world positions lie inside.

        Args:
            points: World positions [m], shape (N, 3), float64.
            margin: Least distance inside its faces [m].

        Returns:
            Whether they do, shape (N,), bool.
        """
        offset = points - np.asarray(self.center)
        cosine, sine = np.cos(self.heading), np.sin(self.heading)
        along, left = offset[:, 0] * cosine + offset[:, 1] * sine, offset[:, 1] * cosine - offset[:, 0] * sine
        size = np.asarray(self.half) - margin
        return (np.abs(along) < size[0]) & (np.abs(left) < size[1]) & (np.abs(offset[:, 2]) < size[2])


def strip_edge(alignment: Alignment, ground: HeightField) -> F64:
    """List the ground nodes along the border, counter-clockwise from the lowest station and left.

    Args:
        alignment: Axis of the bridge.
        ground: The strip.

    Returns:
        World positions [m], shape (B, 3), float64; the first is not repeated.
    """
    nodes = ground.nodes().reshape(*ground.heights.shape, 3)
    sides = (nodes[:-1, 0], nodes[-1, :-1], nodes[:0:-1, -1], nodes[0, :0:-1])
    return to_world(alignment, np.concatenate(sides))


def strip_corners(alignment: Alignment, ground: HeightField) -> F64:
    """List the corners of the strip in plan, counter-clockwise [m], shape (4, 2), float64."""
    (first, last), (low, high) = ground.stations[[0, -1]], ground.lefts[[0, -1]]
    corners = np.array([[first, low, 0], [last, low, 0], [last, high, 0], [first, high, 0]], np.float64)
    return to_world(alignment, corners)[:, :2]


def keep_out(alignment: Alignment, ground: HeightField) -> Box:
    """Bound the strip from below its ground to well above the deck."""
    corners = strip_corners(alignment, ground)
    low, high = float(ground.heights.min()) - 1.0, alignment.level + AIR
    center = corners.mean(axis=0)
    half = ((ground.stations[-1] - ground.stations[0]) / 2, (ground.lefts[-1] - ground.lefts[0]) / 2)
    if not alignment.square:  # the box is aligned with the chord, around the curved strip
        turned = np.array(
            [
                [np.cos(alignment.heading), -np.sin(alignment.heading)],
                [np.sin(alignment.heading), np.cos(alignment.heading)],
            ]
        )
        border = strip_edge(alignment, ground)[:, :2] @ turned
        center, half = turned @ (border.min(axis=0) + border.max(axis=0)) / 2, tuple(np.ptp(border, axis=0) / 2)
    return Box(
        (float(center[0]), float(center[1]), (low + high) / 2),
        (float(half[0]), float(half[1]), (high - low) / 2),
        alignment.heading,
    )
