"""Seat abutments: a wall with a bearing seat, the backwall behind the girders, and wing walls along the approach."""

from dataclasses import dataclass

import numpy as np

from authoring.alignment import Alignment
from authoring.component import F64
from authoring.parts.bearings import Bearings
from authoring.parts.drawing import Draws, draw, drawn
from authoring.parts.part import SUBSTRUCTURE, Part
from authoring.parts.piers import Ground
from authoring.parts.spans import ABUTMENT_BACK, Levels, Spans, level_at
from authoring.sections import cut_corners, rectangle
from authoring.sweep import prism
from groundwork.settings import Settings

_SIDE_STEP = 0.012  # [m] backwall behind the wall's side faces
_LAP = 0.03  # [m] backwall between the wing walls, and into the wall


class AbutmentSettings(Settings):
    """Walls of both abutments; what is left out is drawn."""

    seat_margin: float | None = drawn(0.15, 0.30, "Seat in front of the plinths [m]", ge=0.05, le=1.0)
    wing_length: float | None = drawn(6.0, 7.0, "Wing walls behind the wall [m]", le=12.0)
    wing_thickness: float | None = drawn(0.45, 0.60, "Thickness of the wing walls [m]", ge=0.45, le=1.2)
    founding: float | None = drawn(0.5, 1.0, "Walls below the lowest ground at them [m]", ge=0.3, le=3.0)
    chamfer: float | None = drawn(0.020, 0.030, "Leg of chamfers [m]", ge=0.0, le=0.05)


@dataclass(frozen=True)
class Abutments:
    """Both abutments of a bridge are of one kind.

    Attributes:
        front: From the bearing line to the wall's front face [m].
        wing_length: Wing walls behind the wall [m].
        wing_thickness: Thickness of the wing walls [m].
        founding: Walls below the lowest ground at them [m].
        chamfer: Leg of chamfers [m].
    """

    front: float
    wing_length: float
    wing_thickness: float
    founding: float
    chamfer: float


def draw_abutments(settings: AbutmentSettings, bearings: Bearings, draws: Draws) -> Abutments:
    """Draw the abutments.

    Args:
        settings: What the user fixed.
        bearings: What stands on the seats.
        draws: Random stream and profile of the bridge.
    """
    return Abutments(
        front=round(0.5 * bearings.plinth_length + draw(settings, "seat_margin", draws), 3),
        wing_length=draw(settings, "wing_length", draws),
        wing_thickness=draw(settings, "wing_thickness", draws),
        founding=draw(settings, "founding", draws),
        chamfer=draw(settings, "chamfer", draws),
    )


def approach_range(abutments: Abutments, spans: Spans, support: int) -> tuple[float, float]:
    """Find the stations from the expansion gap back to the wing walls' ends [m], the smaller first.

    Args:
        abutments: Dimensions.
        spans: Stations.
        support: Number of the abutment's support.
    """
    near, far = spans.backwall, ABUTMENT_BACK + abutments.wing_length
    if support == 0:
        return spans.supports[0] - far, spans.supports[0] - near
    return spans.supports[-1] + near, spans.supports[-1] + far


def abutment_parts(
    abutments: Abutments, width: float, spans: Spans, levels: Levels, place: Alignment, ground: Ground
) -> list[Part]:
    """Build wall, backwall and both wing walls of both abutments.

    Args:
        abutments: Dimensions.
        width: Deck width [m].
        spans: Stations.
        levels: Levels of the deck.
        place: Axis of the bridge.
        ground: Height of the ground [m], shape (N,), at plan positions [m], shape (N, 2).
    """
    parts = []
    for support, back in ((0, -1.0), (spans.count, 1.0)):
        station = spans.supports[support]
        level = level_at(place, station)
        parts += [
            _wall_part(abutments, width, support, station, back, levels, level, ground),
            _backwall_part(width, support, station, back, spans, levels, level),
            *_wing_parts(abutments, width, support, station, back, levels, place, ground),
        ]
    return parts


def _wall_part(
    abutments: Abutments, width: float, support: int, station: float, back: float, levels: Levels, level: Alignment,
    ground: Ground,
) -> Part:  # fmt: skip
    ends = sorted((station - back * abutments.front, station + back * ABUTMENT_BACK))
    bottom = _lowest(ground, level, (ends[0], ends[1]), (-0.5 * width, 0.5 * width)) - abutments.founding
    bottom = min(bottom, levels.seat - 1.5)
    outline = rectangle((ends[0], bottom), (ends[1], levels.seat))
    outline = cut_corners(outline, abutments.chamfer)
    surface = prism(outline, -0.5 * width, 0.5 * width, "left", level, abutments.chamfer)
    size: dict[str, object] = {
        "length": width, "thickness": ends[1] - ends[0], "height": levels.seat - bottom, "support": support,
    }  # fmt: skip
    name = f"Abutment_{support:03d}_Wall"
    return Part(name, "abutment_wall", "Role_AbutmentConcrete", SUBSTRUCTURE, surface, size)


def _backwall_part(
    width: float, support: int, station: float, back: float, spans: Spans, levels: Levels, level: Alignment
) -> Part:
    ends = sorted((station + back * spans.backwall, station + back * (ABUTMENT_BACK + _LAP)))
    outline = rectangle((ends[0], levels.seat - _LAP), (ends[1], -levels.surfacing))
    half = 0.5 * width - _SIDE_STEP
    surface = prism(outline, -half, half, "left", level)
    size: dict[str, object] = {
        "length": 2.0 * half, "thickness": ends[1] - ends[0], "height": -levels.surfacing - levels.seat,
        "support": support,
    }  # fmt: skip
    return Part(f"Abutment_{support:03d}_Backwall", "backwall", "Role_AbutmentConcrete", SUBSTRUCTURE, surface, size)


def _wing_parts(
    abutments: Abutments, width: float, support: int, station: float, back: float, levels: Levels, place: Alignment,
    ground: Ground,
) -> list[Part]:  # fmt: skip
    ends = sorted((station + back * ABUTMENT_BACK, station + back * (ABUTMENT_BACK + abutments.wing_length)))
    parts = []
    for side, sign in (("L", 1.0), ("R", -1.0)):
        outer, inner = sign * 0.5 * width, sign * (0.5 * width - abutments.wing_thickness)
        left = sorted((outer, inner))
        bottom = _lowest(ground, place, (ends[0], ends[1]), (left[0], left[1])) - abutments.founding
        bottom = min(bottom, levels.seat - 0.5)
        outline = rectangle((left[0], bottom), (left[1], -levels.surfacing))
        surface = prism(outline, ends[0], ends[1], "station", place, abutments.chamfer)
        size: dict[str, object] = {
            "length": abutments.wing_length, "thickness": abutments.wing_thickness,
            "height": -levels.surfacing - bottom, "support": support,
        }  # fmt: skip
        name = f"Abutment_{support:03d}_Wing_{side}"
        parts.append(Part(name, "wing_wall", "Role_AbutmentConcrete", SUBSTRUCTURE, surface, size))
    return parts


def _lowest(
    ground: Ground, place: Alignment, stations: tuple[float, float], left: tuple[float, float], beside: float = 0.3
) -> float:
    """Find the lowest ground under a rectangle and close beside it, above the finished deck surface [m]."""
    s, across = np.meshgrid(
        np.linspace(stations[0] - beside, stations[1] + beside, 25), np.linspace(left[0] - beside, left[1] + beside, 25)
    )
    axis: F64 = place.point(s.ravel(), across.ravel(), np.zeros(s.size))
    return float(np.min(ground(axis[:, :2]) - axis[:, 2]))
