"""Hangers under an arch: a socket on the floor beam or tie, the rod, and an anchorage under the rib."""

from dataclasses import dataclass

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.arch_axis import Rib
from authoring.parts.part import SUPERSTRUCTURE, Part
from authoring.shapes.component import F64
from authoring.shapes.sections import circle
from authoring.solids.extrusion import Prism
from authoring.solids.sweep import Surface

GRIP = 0.020  # [m] embedment of the rod in socket and anchorage
EMBEDDED = 0.005  # [m] embedment of the socket in its support, and of the anchorage in the rib
SOCKET_HEIGHT, ANCHOR_HEIGHT = 0.35, 0.40  # [m]
SHORTEST = 0.25  # [m] least visible length of the rod
_SIDES = 12


@dataclass(frozen=True)
class Hangers:
    """One kind of hanger for the whole bridge.

    Attributes:
        diameter: Of the rod or strand [m].
        socket: Diameter of the socket [m].
        anchor_length: Anchorage along the bridge [m].
        anchor_width: Anchorage across the bridge [m].
    """

    diameter: float
    socket: float
    anchor_length: float
    anchor_width: float


def needed_height() -> float:
    """Find the least height between deck and rib for a hanger [m]."""
    return SOCKET_HEIGHT + SHORTEST + ANCHOR_HEIGHT + 0.10


@dataclass(frozen=True)
class RibAbove:
    """A rib above one station, in the level frame there.

    Attributes:
        rib: Axis and depths.
        station: Station [m].
        level: Level frame at the station.
        lift: Offset from the rib's heights to heights in that frame [m].
    """

    rib: Rib
    station: float
    level: Alignment
    lift: float

    def soffit(self, stations: F64) -> F64:
        """Find heights of the rib's soffit in the level frame.

        Args:
            stations: Where [m], shape (N,), float64.

        Returns:
            Heights [m], shape (N,), float64.
        """
        return self.rib.intrados(stations) + self.lift


def hanger_parts(hangers: Hangers, name: str, above: RibAbove, line: float, foot: float) -> list[Part]:
    """Build a hanger with its socket and its anchorage.

    Args:
        hangers: Dimensions.
        name: Ending of the names, e.g. `004_L`.
        above: Its upper support, and the position there.
        line: Distance to the left of the axis [m].
        foot: Height of the surface under the socket [m].
    """
    h, station, level = hangers, above.station, above.level
    center = np.array([station, line])
    soffit = float(above.soffit(np.array([station]))[0])
    low, high = foot + SOCKET_HEIGHT - GRIP, soffit - ANCHOR_HEIGHT + GRIP
    socket = Prism(circle(h.socket, _SIDES) + center, foot - EMBEDDED, foot + SOCKET_HEIGHT, "above", level, 0.015)
    rod = Prism(circle(h.diameter, _SIDES) + center, low, high, "above", level)
    anchor = bracket_surface(above, line, (h.anchor_length, h.anchor_width), soffit - ANCHOR_HEIGHT)
    length = soffit - foot - SOCKET_HEIGHT - ANCHOR_HEIGHT
    facts: dict[str, object] = {"diameter": h.diameter, "length": length, "station": station}
    seat: dict[str, object] = {"diameter": h.socket, "height": SOCKET_HEIGHT}
    block: dict[str, object] = {"length": h.anchor_length, "width": h.anchor_width, "height": ANCHOR_HEIGHT}
    steel = "Role_CableSteel"
    return [
        Part(f"Hanger_Base_{name}", "cable_socket", steel, SUPERSTRUCTURE, socket, seat),
        Part(f"Hanger_{name}", "hanger", steel, SUPERSTRUCTURE, rod, facts),
        Part(f"Hanger_Top_{name}", "upper_anchorage", steel, SUPERSTRUCTURE, anchor, block),
    ]


def bracket_surface(above: RibAbove, line: float, size: tuple[float, float], bottom: float) -> Surface:
    """Build a block under a rib: its top follows the rib's soffit.

    Args:
        above: The rib; the block's middle is at that station.
        line: Distance of its middle to the left of the axis [m].
        size: Along and across the bridge [m].
        bottom: Height of its underside [m].
    """
    ends = np.array([above.station - 0.5 * size[0], above.station + 0.5 * size[0]])
    top = above.soffit(ends) + EMBEDDED
    outline = np.array([(ends[0], bottom), (ends[1], bottom), (ends[1], top[1]), (ends[0], top[0])])
    return Prism(outline, line - 0.5 * size[1], line + 0.5 * size[1], "left", above.level).surface
