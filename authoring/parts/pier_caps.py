"""Pier caps: the beams across the bridge that transfer the bearings' loads to the shafts."""

from dataclasses import dataclass

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.shapes.component import F64
from authoring.shapes.sections import cut_corners, mirrored
from authoring.solids.extrusion import Prism
from authoring.solids.sweep import Surface, turned

_KNEE = 0.35  # ratio of the haunch between leg and beam of a frame to the beam's depth
_INTO_LEG = 0.005  # [m] embedment of a haunch in its leg


@dataclass(frozen=True)
class CapShape:
    """One cap.

    Attributes:
        kind: `drop`, `tapered`, `inverted_t`, `cantilevered` or `integral`.
        length: Across the bridge [m].
        width: Along the bridge [m].
        depth: Over the columns [m].
        end_depth: At both ends [m].
        flat: From the axis to where the underside begins to rise [m].
        leg_face: From the axis to the inner face of a frame's leg [m]; 0 without a frame.
        upstand: Width of an inverted T's stem [m]; 0 for none.
        chamfer: Leg of chamfers [m].
    """

    kind: str
    length: float
    width: float
    depth: float
    end_depth: float
    flat: float
    leg_face: float
    upstand: float
    chamfer: float


def cap_outline(cap: CapShape, top: float) -> F64:
    """Draw the elevation of a cap.

    A drop cap is a rectangle; the underside of a tapered one rises in a line from the outer columns to the ends, that
    of a cantilevered one in a curve; the beam of a frame has haunches beside its legs.

    Args:
        cap: Dimensions.
        top: Height of its top [m].

    Returns:
        Outline (left, above) [m], shape (P, 2), float64.
    """
    half, bottom, end = 0.5 * cap.length, top - cap.depth, top - cap.end_depth
    flat = min(cap.flat, half - 0.2)
    legs = [cap.chamfer, cap.chamfer]
    match cap.kind:
        case "tapered":
            right = [(flat, bottom), (half, end)]
            legs = [0.0, cap.chamfer]
        case "cantilevered":
            share = np.linspace(0.0, 1.0, 7)
            # A parabola that is steep at the column: depth follows the cantilever's moment.
            drop = (cap.depth - cap.end_depth) * (1.0 - share) ** 2
            right = [(float(x), float(end - d)) for x, d in zip(flat + share * (half - flat), drop, strict=True)]
            legs = [0.0] * 6 + [cap.chamfer]
        case "integral":
            right, legs = _frame_underside(cap, bottom, half)
        case _:
            right = [(half, bottom)]
            legs = [cap.chamfer]
    legs = [*legs, cap.chamfer]
    return cut_corners(mirrored([*right, (half, top)]), np.array(legs + legs[::-1]))


def _frame_underside(cap: CapShape, bottom: float, half: float) -> tuple[list[tuple[float, float]], list[float]]:
    face = cap.leg_face + _INTO_LEG
    knee = min(_KNEE * cap.depth, 0.6 * face)
    return [(face - knee, bottom), (face, bottom - knee), (face, bottom), (half, bottom)], [0.0, 0.0, 0.0, cap.chamfer]


def cap_surface(cap: CapShape, station: float, top: float, rise: float, level: Alignment) -> Surface:
    """Build a cap.

    Args:
        cap: Dimensions.
        station: Its middle [m].
        top: Height of the bearing seats above the finished deck surface [m].
        rise: Of an inverted T's stem above that [m].
        level: Level frame of the support.
    """
    half = 0.5 * cap.width
    if cap.upstand == 0.0:
        return turned(
            Prism(cap_outline(cap, top), station - half, station + half, "station", level, cap.chamfer).surface
        )
    outline = inverted_t_outline(cap, top, rise) + np.array([station, 0.0])
    return Prism(outline, -0.5 * cap.length, 0.5 * cap.length, "left", level, cap.chamfer).surface


def inverted_t_outline(cap: CapShape, top: float, rise: float) -> F64:
    """Draw the section of an inverted T: ledges for the bearings, and a stem that rises between their rows.

    Args:
        cap: Dimensions.
        top: Height of the ledges [m].
        rise: Height of the stem above them [m].

    Returns:
        Outline (station, above) [m], shape (P, 2), float64.
    """
    half, stem = 0.5 * cap.width, 0.5 * cap.upstand
    right = [(half, top - cap.depth), (half, top), (stem, top), (stem, top + rise)]
    legs = [cap.chamfer, cap.chamfer, 0.0, cap.chamfer]
    return cut_corners(mirrored(right), np.array(legs + legs[::-1]))
