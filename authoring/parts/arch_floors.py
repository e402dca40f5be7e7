"""The floor of a bridge under an arch: floor beams, tie girders, and the blocks under the ties."""

from dataclasses import dataclass, replace

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.axis.road_section import ABUTMENT_BACK
from authoring.parts.footings import Founding
from authoring.parts.part import SUBSTRUCTURE, SUPERSTRUCTURE, Part
from authoring.parts.spandrel_decks import i_outline
from authoring.parts.spans import Levels, level_at
from authoring.shapes.sections import cut_corners, rectangle
from authoring.solids.extrusion import Prism

EMBEDDED = 0.008  # [m] floor beam into slab
_FLANGE = (0.45, 0.035)  # [m] width and thickness of a steel floor beam's flanges
_TIE_GAP = 0.05  # [m] gap between a tie's end and the wall behind it


@dataclass(frozen=True)
class Floor:
    """Floor beams, and the tie girders of a tied arch.

    Attributes:
        material: `concrete` or `steel`.
        beam_depth: Floor beam below the slab [m].
        beam_width: Floor beam along the bridge [m].
        tie_width: Tie girder across the bridge [m]; 0 for none.
        tie_top: Its top above the finished surface [m].
        tie_depth: Of the tie girder [m].
        tie_end: Tie girder beyond its bearing line [m].
    """

    material: str
    beam_depth: float
    beam_width: float
    tie_width: float
    tie_top: float
    tie_depth: float
    tie_end: float


def floor_beam_part(floor: Floor, name: str, station: float, reach: float, levels: Levels, place: Alignment) -> Part:
    """Build a floor beam across the bridge.

    Args:
        floor: Dimensions.
        name: Name of the part.
        station: Its middle [m].
        reach: From the axis to either end [m].
        levels: Levels of the deck.
        place: Axis of the bridge.
    """
    level = level_at(place, station)
    ends = place.point(np.array([station - 0.5 * floor.beam_width, station]), np.zeros(2), np.zeros(2))[:, 2]
    top = levels.soffit + EMBEDDED + abs(float(ends[0] - ends[1]))
    depth = top - (levels.soffit - floor.beam_depth)
    if floor.material == "steel":
        outline = i_outline(floor.beam_width, depth, 0.025, _FLANGE[1]) + np.array([station, top - depth])
    else:
        half = 0.5 * floor.beam_width
        outline = rectangle((station - half, top - depth), (station + half, top))
        outline = cut_corners(outline, np.array([0.02, 0.02, 0.0, 0.0]))
    surface = Prism(outline, -reach, reach, "left", level)
    size: dict[str, object] = {"length": 2.0 * reach, "depth": depth, "width": floor.beam_width, "station": station}
    role = "Role_GirderSteel" if floor.material == "steel" else "Role_GirderConcrete"
    return Part(name, "floor_beam", role, SUPERSTRUCTURE, surface, size)


def tie_parts(floor: Floor, line: float, low: float, high: float, place: Alignment) -> list[Part]:
    """Build both tie girders.

    Args:
        floor: Dimensions.
        line: From the axis to the middle of either tie [m].
        low: Station of the first bearing line [m].
        high: Station of the last one [m].
        place: Axis of the bridge.
    """
    role = "Role_GirderSteel" if floor.material == "steel" else "Role_GirderConcrete"
    half, bottom = 0.5 * floor.tie_width, floor.tie_top - floor.tie_depth
    chamfer = 0.025 if floor.material == "concrete" else 0.0
    size: dict[str, object] = {
        "length": high - low + 2.0 * floor.tie_end,
        "width": floor.tie_width,
        "depth": floor.tie_depth,
    }
    parts = []
    for side, middle in (("L", line), ("R", -line)):
        outline = rectangle((middle - half, bottom), (middle + half, floor.tie_top))
        outline = cut_corners(outline, chamfer) if chamfer else outline
        surface = Prism(outline, low - floor.tie_end, high + floor.tie_end, "station", place, chamfer)
        parts.append(Part(f"Tie_{side}", "edge_beam", role, SUPERSTRUCTURE, surface, size))
    return parts


def tie_seat_parts(
    floor: Floor,
    line: float,
    supports: tuple[float, float],
    front: float,
    seat: float,
    founding: Founding,
) -> list[Part]:
    """Build the four blocks beside the abutments under the ties' bearings.

    Args:
        floor: Dimensions.
        line: From the axis to the middle of either tie [m].
        supports: Stations of the bearing lines [m].
        front: From a bearing line to the front face [m].
        seat: Height of the seats [m].
        founding: Depth of their foundation, from the axis of the bridge.
    """
    parts = []
    half = 0.5 * floor.tie_width
    for support, (station, away) in enumerate(zip(supports, (-1.0, 1.0), strict=True)):
        level = level_at(founding.place, station)
        wall, back = station + away * (floor.tie_end + _TIE_GAP), station + away * ABUTMENT_BACK
        face = station - away * (front + 0.1)
        for side, sign in (("L", 1.0), ("R", -1.0)):
            left = sorted((sign * (line - half + 0.02), sign * (line + half + 0.30)))
            ends = (min(face, back), max(face, back))
            bottom = replace(founding, place=level).bottom(ends, (left[0], left[1]), seat - 1.5)
            outline = np.array(
                [
                    (back, bottom),
                    (face, bottom),
                    (face, seat),
                    (wall, seat),
                    (wall, floor.tie_top),
                    (back, floor.tie_top),
                ]
            )
            outline = outline if away < 0.0 else outline[::-1]
            surface = Prism(outline, left[0], left[1], "left", level, 0.025)
            size: dict[str, object] = {
                "length": left[1] - left[0],
                "thickness": abs(back - face),
                "height": seat - bottom,
                "support": support,
            }
            name = f"Abutment_{support:03d}_Block_{side}"
            parts.append(Part(name, "abutment_wall", "Role_AbutmentConcrete", SUBSTRUCTURE, surface, size))
    return parts


def brace_places(low: float, high: float, pitch: float) -> list[float]:
    """Place braces evenly about the middle of a range, all inside it.

    Args:
        low: Station from which there is room [m].
        high: Station up to which there is room [m].
        pitch: Wanted distance [m].

    Returns:
        Stations [m].
    """
    count = max(1, int(np.floor((high - low) / pitch)) + 1)
    places = 0.5 * (low + high) + pitch * (np.arange(count) - 0.5 * (count - 1))
    return [float(place) for place in places]
