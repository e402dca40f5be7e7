"""Stiffeners of plate girders: plates perpendicular to the web, at cross-frames, between them, and over bearings."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.part import SUPERSTRUCTURE, Part
from authoring.parts.plate_girders import PlateGirders
from authoring.parts.spans import Levels, Spans
from authoring.parts.splices import HALF_LENGTH
from authoring.shapes.component import F64
from authoring.solids.setting_out import in_one_chart, plates, shifted, to_world
from authoring.solids.sweep import Surface

INTO = 0.004  # [m] embedment of plates in web and flanges
_FROM_EDGE = 0.015  # [m] from a stiffener's free edge to the narrower flange's edge
_BEARING_THICKER = 1.6  # [1] factor of the thickness of bearing stiffeners


@dataclass(frozen=True)
class _Plates:
    """Stiffeners of one part, in bridge coordinates."""

    name: str
    surface: Surface
    facts: dict[str, object]


@dataclass(frozen=True)
class Stiffening:
    """The stiffeners of the girders.

    Attributes:
        frames: Stations of the cross-frames, rising [m].
        cuts: Stations of the splices [m].
        pitch: Largest distance between stiffeners over the depth [1].
        thickness: Of the plates [m].
    """

    frames: tuple[float, ...]
    cuts: tuple[float, ...]
    pitch: float
    thickness: float


def stiffener_width(girders: PlateGirders) -> float:
    """Compute the projection of stiffeners from the web [m].

    Args:
        girders: Section.
    """
    return 0.5 * (min(girders.top_width, girders.bottom_width) - girders.web) - _FROM_EDGE


def stiffener_parts(
    girders: PlateGirders, spans: Spans, stiffening: Stiffening, levels: Levels, place: Alignment
) -> list[Part]:
    """Build the stiffeners of every line: one part for each span and line, and one for each bearing.

    Args:
        girders: Dimensions.
        spans: Stations.
        stiffening: Their positions and thickness.
        levels: Levels of the deck.
        place: Axis of the bridge.
    """
    if girders.box:
        return []
    top = girders.steel_top(levels)
    made = [
        *_along_spans(girders, spans, stiffening, top),
        *_on_bearings(girders, spans, stiffening.thickness, top),
    ]
    surfaces = to_world([plate.surface for plate in made], place)
    return [
        Part(
            plate.name,
            "stiffener",
            "Role_GirderSteel",
            SUPERSTRUCTURE,
            surface,
            {"thickness": stiffening.thickness, **plate.facts},
        )
        for plate, surface in zip(made, surfaces, strict=True)
    ]


def _along_spans(girders: PlateGirders, spans: Spans, stiffening: Stiffening, top: float) -> list[_Plates]:
    """Build the stiffeners at cross-frames and between them: one part for each span and line."""
    found: list[_Plates] = []
    for span in range(spans.count):
        low, high = spans.bearing_lines(span)
        joints = [station for station in stiffening.frames if low + 0.01 < station < high - 0.01]
        between = _between(girders, spans, [low, *joints, high], stiffening)
        made: dict[tuple[tuple[float, float], ...], Surface] = {}  # lines with the same neighbors have the same plates
        for line, left in enumerate(girders.lines):
            sides = _inner_sides(girders, line)
            towards = [side for side in sides if side * left < 0.0] or sides  # the axis
            wanted = tuple(
                (station, side)
                for stations, own in ((joints, sides), (between, towards))
                for station in stations
                for side in own
            )
            if wanted:
                if wanted not in made:
                    depth = girders.depths(spans, np.array([station for station, _ in wanted]))
                    made[wanted] = _across(girders, depth, wanted, stiffening.thickness)
                surface = shifted(made[wanted], np.array([0.0, left, top]))
                facts: dict[str, object] = {"count": len(wanted), "span": span, "line": line}
                found.append(_Plates(f"Stiffeners_{span:03d}_{line:02d}", surface, facts))
    return found


def _on_bearings(girders: PlateGirders, spans: Spans, thickness: float, top: float) -> list[_Plates]:
    """Build a pair of thicker stiffeners over each bearing."""
    found: list[_Plates] = []
    rows = np.array(sorted({station for _, _, station in spans.rows}))
    pairs: dict[float, Surface] = {}  # rows under the same depth have the same plates
    for number, (station, depth) in enumerate(
        zip(rows, np.round(girders.depths(spans, rows), 9).tolist(), strict=True)
    ):
        if depth not in pairs:
            both = ((0.0, -1.0), (0.0, 1.0))
            pairs[depth] = _across(girders, np.full(2, depth), both, _BEARING_THICKER * thickness)
        for line, left in enumerate(girders.lines):
            surface = shifted(pairs[depth], np.array([station, left, top]))
            facts: dict[str, object] = {"count": 2, "row": number, "line": line}
            found.append(_Plates(f"BearingStiffener_{number:03d}_{line:02d}", surface, facts))
    return found


def _inner_sides(girders: PlateGirders, line: int) -> list[float]:
    """List the sides of a line with a neighboring line: an edge girder has no stiffeners outside."""
    return [side for side, there in ((1.0, line + 1 < len(girders.lines)), (-1.0, line > 0)) if there]


def _between(girders: PlateGirders, spans: Spans, joints: list[float], stiffening: Stiffening) -> list[float]:
    found = []
    for low, high in pairwise(joints):
        depth = float(girders.depths(spans, np.array([0.5 * (low + high)]))[0])
        count = int(np.ceil((high - low) / (stiffening.pitch * depth) - 1e-9))
        found += np.linspace(low, high, count + 1)[1:-1].tolist()
    return [station for station in found if all(abs(station - cut) > HALF_LENGTH + 0.06 for cut in stiffening.cuts)]


def _across(girders: PlateGirders, depth: F64, wanted: tuple[tuple[float, float], ...], thickness: float) -> Surface:
    """Build plates round a line, at stations and on sides of the web; heights count from the top of the steel."""
    station, side = np.array(wanted).T
    near, far = 0.5 * girders.web - INTO, 0.5 * girders.web + stiffener_width(girders)
    ends = np.sort(side[:, None] * (near, far), axis=1)
    high_edge = np.full(len(station), INTO - girders.flange)
    low = np.stack([station - 0.5 * thickness, ends[:, 0], girders.flange - INTO - depth], axis=1)
    high = np.stack([station + 0.5 * thickness, ends[:, 1], high_edge], axis=1)
    return in_one_chart(plates(low, high, "above"))
