"""Seat abutments: a wall with a bearing seat, the backwall behind the girders, and wing walls along the approach."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.axis.road_section import ABUTMENT_BACK
from authoring.parts.bearings import Bearings
from authoring.parts.drawing import Draws, chosen, draw, draw_option, drawn
from authoring.parts.footings import footing_top
from authoring.parts.idle_settings import Use
from authoring.parts.part import SUBSTRUCTURE, Part
from authoring.parts.piers import Ground
from authoring.parts.spans import Levels, Spans, level_at
from authoring.parts.wedges import wedge
from authoring.shapes.component import F64
from authoring.shapes.sections import area, cut_corners, rectangle
from authoring.solids.extrusion import Prism
from groundwork.settings import Settings

_SIDE_STEP = 0.012  # [m] distance of the backwall's sides behind the wall's side faces
_LAP = 0.02  # [m] embedment of the backwall in the wing walls and the wall
_LOWER = 0.003  # [m] depth of the backwall's top below the wing walls' tops, so that their tops are not coplanar
_LEAST_WALL = 1.0  # [m] least height between seat and footing


class AbutmentSettings(Settings):
    """Walls of both abutments; omitted values are drawn at random."""

    uses: ClassVar = (
        Use("footing", (True,), ("footing_toe", "footing_top")),
        Use("battered", (True,), ("batter",)),
    )
    seat_margin: float | None = drawn(
        0.15, 0.30, "Width of the bearing seat in front of the plinths [m]", ge=0.05, le=1.0
    )
    wing_length: float | None = drawn(6.0, 7.0, "Length of the wing walls behind the abutment wall [m]", le=12.0)
    wing_thickness: float | None = drawn(0.45, 0.60, "Thickness of the wing walls [m]", ge=0.45, le=1.2)
    founding: float | None = drawn(
        0.5, 1.0, "Depth of the walls below the lowest ground beside them [m]", ge=0.3, le=3.0
    )
    chamfer: float | None = drawn(0.020, 0.030, "Leg length of the chamfers [m]", ge=0.0, le=0.05, paper=(0.0, 0.0))
    footing: bool | None = chosen({True: 50, False: 50}, "Visible footing in front of the wall", paper={False: 1})
    footing_toe: float | None = drawn(0.4, 0.9, "Length of the footing in front of the wall [m]", ge=0.1, le=2.0)
    footing_top: float | None = drawn(
        -0.60,
        -0.30,
        "Height of the footing's top: above 0, over the highest ground in front of it; below 0, under the lowest [m]",
        ge=-2.0,
        le=1.0,
        paper=(0.15, 0.40),
    )
    battered: bool | None = chosen({True: 30, False: 70}, "Battered front face of the wall", paper={False: 1})
    batter: float | None = drawn(0.02, 0.08, "Batter of the front face, horizontal over vertical [1]", ge=0.0, le=0.2)


@dataclass(frozen=True)
class Abutments:
    """Both abutments of a bridge are of one kind.

    Attributes:
        front: From the bearing line to the wall's front face [m].
        wing_length: Wing walls behind the wall [m].
        wing_thickness: Thickness of the wing walls [m].
        founding: Depth of the walls below the lowest ground at them [m].
        chamfer: Leg of chamfers [m].
        footing_toe: Footing in front of the wall [m]; 0 for none.
        footing_top: Footing above the highest ground before it; below zero under the lowest [m].
        batter: Batter of the wall's front [1].
    """

    front: float
    wing_length: float
    wing_thickness: float
    founding: float
    chamfer: float
    footing_toe: float = 0.0
    footing_top: float = 0.0
    batter: float = 0.0


def draw_abutments(settings: AbutmentSettings, bearings: Bearings, draws: Draws) -> Abutments:
    """Draw the abutments.

    Args:
        settings: Values set by the user.
        bearings: Bearings on the seats.
        draws: Random stream and profile of the bridge.
    """
    front = round(0.5 * bearings.plinth_length + draw(settings, "seat_margin", draws), 3)
    length, thickness = draw(settings, "wing_length", draws), draw(settings, "wing_thickness", draws)
    founding, chamfer = draw(settings, "founding", draws), draw(settings, "chamfer", draws)
    shows, leans = draw_option(settings, "footing", draws), draw_option(settings, "battered", draws)
    toe, top, batter = (draw(settings, key, draws) for key in ("footing_toe", "footing_top", "batter"))
    toe, top = (toe, top) if shows else (0.0, 0.0)
    return Abutments(front, length, thickness, founding, chamfer, toe, top, batter if leans else 0.0)


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
        stand = _Stand(support, station, back, float(place.grade_at(np.array([station]))[0]))
        parts += [
            *_wall_parts(abutments, width, stand, levels, level, ground),
            _backwall_part(width, stand, spans, levels, level, place),
            *_wing_parts(abutments, width, stand, levels, place, ground),
        ]
    return parts


@dataclass(frozen=True)
class _Stand:
    """Position of one abutment: its support, that support's station [m], which way is back, and the grade [1]."""

    support: int
    station: float
    back: float
    grade: float

    def outline(self, corners: list[tuple[float, float]]) -> F64:
        """Place an outline given by distances behind the bearing line: (station, above) [m], shape (P, 2), float64."""
        points = np.array(corners) * (self.back, 1.0) + (self.station, 0.0)
        return points if area(points) > 0.0 else points[::-1]


def _wall_parts(
    abutments: Abutments, width: float, stand: _Stand, levels: Levels, level: Alignment, ground: Ground
) -> list[Part]:
    a, half = abutments, 0.5 * width
    drop = levels.seat - _LEAST_WALL
    ends = sorted((stand.station - stand.back * (a.front + a.footing_toe), stand.station + stand.back * ABUTMENT_BACK))
    before = sorted((stand.station - stand.back * (a.front + a.footing_toe), stand.station - stand.back * a.front))
    lowest = _lowest(ground, level, (ends[0], ends[1]), (-half, half)) - a.founding
    bottom, foot = min(lowest, levels.seat - 1.5), 0.0
    parts = []
    size: dict[str, object]
    if a.footing_toe:
        strip = _heights(ground, level, (before[0], before[1]), (-half, half), beside=0.0)
        foot = min(footing_top(float(strip.min()), float(strip.max()), a.footing_top), drop)
        lowest = min(lowest, foot - a.founding)
        toe = a.front + a.footing_toe + a.batter * (levels.seat - foot)
        reach = half + 0.5 * a.footing_toe
        corners = [
            (-toe, lowest),
            (ABUTMENT_BACK - _SIDE_STEP, lowest),
            (ABUTMENT_BACK - _SIDE_STEP, foot),
            (-toe, foot),
        ]
        surface = Prism(cut_corners(stand.outline(corners), a.chamfer), -reach, reach, "left", level, a.chamfer)
        size = {
            "length": 2.0 * reach,
            "thickness": toe + ABUTMENT_BACK - _SIDE_STEP,
            "height": foot - lowest,
            "support": stand.support,
        }
        name = f"Abutment_{stand.support:03d}_Footing"
        parts.append(Part(name, "abutment_footing", "Role_AbutmentConcrete", SUBSTRUCTURE, surface, size))
        bottom = foot - _LAP
    lean = a.batter * (levels.seat - bottom)
    corners = [
        (-a.front - lean, bottom),
        (ABUTMENT_BACK, bottom),
        (ABUTMENT_BACK, levels.seat),
        (-a.front, levels.seat),
    ]
    surface = Prism(cut_corners(stand.outline(corners), a.chamfer), -half, half, "left", level, a.chamfer)
    size = {
        "length": width,
        "thickness": a.front + lean + ABUTMENT_BACK,
        "height": levels.seat - bottom,
        "batter": a.batter,
        "support": stand.support,
    }
    name = f"Abutment_{stand.support:03d}_Wall"
    return [Part(name, "abutment_wall", "Role_AbutmentConcrete", SUBSTRUCTURE, surface, size), *parts]


def _backwall_part(
    width: float, stand: _Stand, spans: Spans, levels: Levels, level: Alignment, place: Alignment
) -> Part:
    near, far, top = spans.backwall, ABUTMENT_BACK + _LAP, -levels.surfacing - _LOWER
    low, half = levels.seat - _LAP, 0.5 * width - _SIDE_STEP
    at = np.array([stand.station, stand.station + stand.back * far])
    # Its bottom is level on the wall, its top follows the road: its grade, and changes of its crossfall.
    twist = float(np.diff(place.crossfall(at))[0]) / (stand.back * far)
    frame = wedge(level, (stand.station, 0.0), (low, top), high=(stand.grade, 0.0), twist=twist)
    outline = replace(stand, station=0.0).outline([(near, low), (far, low), (far, top), (near, top)])
    surface = Prism(outline, -half, half, "left", frame)
    size: dict[str, object] = {
        "length": 2.0 * half,
        "thickness": far - near,
        "height": top - levels.seat,
        "support": stand.support,
    }
    name = f"Abutment_{stand.support:03d}_Backwall"
    return Part(name, "backwall", "Role_AbutmentConcrete", SUBSTRUCTURE, surface, size)


def _wing_parts(
    abutments: Abutments, width: float, stand: _Stand, levels: Levels, place: Alignment, ground: Ground
) -> list[Part]:
    support, station, back = stand.support, stand.station, stand.back
    ends = sorted((station + back * ABUTMENT_BACK, station + back * (ABUTMENT_BACK + abutments.wing_length)))
    parts = []
    for side, sign in (("L", 1.0), ("R", -1.0)):
        outer, inner = sign * 0.5 * width, sign * (0.5 * width - abutments.wing_thickness)
        left = sorted((outer, inner))
        bottom = _lowest(ground, place, (ends[0], ends[1]), (left[0], left[1])) - abutments.founding
        bottom = min(bottom, levels.seat - 0.5)
        outline = rectangle((left[0], bottom), (left[1], -levels.surfacing))
        surface = Prism(outline, ends[0], ends[1], "station", place, abutments.chamfer)
        size: dict[str, object] = {
            "length": abutments.wing_length,
            "thickness": abutments.wing_thickness,
            "height": -levels.surfacing - bottom,
            "support": support,
        }
        name = f"Abutment_{support:03d}_Wing_{side}"
        parts.append(Part(name, "wing_wall", "Role_AbutmentConcrete", SUBSTRUCTURE, surface, size))
    return parts


def _lowest(ground: Ground, place: Alignment, stations: tuple[float, float], left: tuple[float, float]) -> float:
    """Find the lowest ground under a rectangle and close beside it, above the finished deck surface [m]."""
    return float(np.min(_heights(ground, place, stations, left)))


def _heights(
    ground: Ground, place: Alignment, stations: tuple[float, float], left: tuple[float, float], beside: float = 0.3
) -> F64:
    s, across = np.meshgrid(
        np.linspace(stations[0] - beside, stations[1] + beside, 25), np.linspace(left[0] - beside, left[1] + beside, 25)
    )
    axis = place.point(s.ravel(), across.ravel(), np.zeros(s.size))
    return ground(axis[:, :2]) - axis[:, 2]
