"""The road's cross-section on the bridge: lanes, shoulders, kerbs, footways, asphalt, markings, expansion joints."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.axis.road_section import ABUTMENT_BACK
from authoring.parts.drawing import Draws, chosen, draw, draw_option, drawn
from authoring.parts.idle_settings import Use
from authoring.parts.part import SUPERSTRUCTURE, Part
from authoring.parts.spans import Spans
from authoring.shapes.component import F64
from authoring.shapes.sections import cut_corners, on_side, rectangle
from authoring.solids.extrusion import Prism, extruded
from authoring.solids.sweep import Surface, joined
from groundwork.errors import InputError
from groundwork.settings import Settings

EMBEDDED = 0.005  # [m] embedment of asphalt, curbs and joints in their support
MARKING_HEIGHT = 0.006  # [m] above the asphalt
_MARKING_EDGE = 1.75  # horizontal meters for each meter of height of a line's long edges: paint thins out there [1]
_DEEPER = 0.0015  # [m] additional embedment of curbs relative to asphalt
DIVIDED_LANES = 4  # least number of lanes of roads with a raised strip
DIVIDED_IN = (4, 6)  # lanes of roads with such a strip
_SHORTEST_DASH = 0.4  # [m]
_SHORTER = 0.003  # [m] footway and joints are shorter than curb and asphalt, so that no two faces are coplanar
_CROWN = 0.001  # [m]
_MARKING_CLEAR = 0.03  # [m] distance from the asphalt's ends


class RoadwaySettings(Settings):
    """Cross-section of a road deck, the same on both sides; omitted values are drawn at random."""

    uses: ClassVar = (
        Use("footway", (True,), ("footway_width", "kerb_width")),
        Use("footway", (False,), ("verge_width",)),
        Use("lanes", DIVIDED_IN, ("median",)),
        Use("divided", (True,), ("median",)),
        Use("lanes", (2, 3, 4, 5, 6), ("dash", "dash_gap")),
    )
    lanes: int | None = chosen(
        {1: 0.05, 2: 0.50, 3: 0.10, 4: 0.25, 5: 0.05, 6: 0.05},
        "Number of traffic lanes [1]",
        among="; on suspension and cable-stayed bridges at most one for 40 and 30 m of main span, rounded down to an "
        "even number of at least 2",
        ge=1,
        le=6,
    )
    lane_width: float | None = drawn(3.0, 3.75, "Width of a lane [m]", ge=2.5, le=4.5)
    shoulder: float | None = drawn(0.3, 1.5, "Distance from the edge line to the kerb [m]", ge=0.0, le=3.0)
    footway: bool | None = chosen({True: 50, False: 50}, "Footways on both sides")
    footway_width: float | None = drawn(1.5, 2.2, "Width of a footway without its kerb [m]", ge=0.8, le=4.0)
    kerb_width: float | None = drawn(0.15, 0.20, "Width of the kerb beside a footway [m]", ge=0.10, le=0.40)
    verge_width: float | None = drawn(
        0.35, 0.60, "Width of the raised verge where there is no footway [m]", ge=0.20, le=1.0
    )
    kerb_height: float | None = drawn(0.10, 0.15, "Height of the kerb above the asphalt [m]", ge=0.05, le=0.25)
    surfacing: float | None = drawn(0.07, 0.10, "Thickness of the asphalt surfacing [m]", ge=0.04, le=0.15)
    divided: bool | None = chosen(
        {True: 0.6, False: 0.4}, "Raised median between the two directions of 4 or 6 lanes", paper={False: 1}
    )
    median: float | None = drawn(
        1.2, 2.4, "Width of the median, from inner edge line to inner edge line [m]", ge=0.8, le=5.0
    )
    marking_width: float | None = drawn(0.12, 0.15, "Width of the road markings [m]", ge=0.08, le=0.40)
    dash: float | None = drawn(2.0, 4.0, "Length of a dash of the lane markings [m]", ge=0.5, le=12.0)
    dash_gap: float | None = drawn(2.0, 6.0, "Gap between these dashes [m]", ge=0.5, le=18.0)
    joint_width: float | None = drawn(0.20, 0.30, "Width of an expansion joint, along the bridge [m]", ge=0.15, le=0.60)


@dataclass(frozen=True)
class Roadway:
    """Cross-section of a road deck.

    Attributes:
        lanes: Traffic lanes.
        lane_width: Width of a lane [m].
        shoulder: From the edge line to the kerb [m].
        kerb_width: Kerb, or raised verge where there is no footway [m].
        footway_width: Behind the kerb, each side [m]; 0 for none.
        kerb_height: Above the asphalt [m].
        surfacing: Asphalt [m].
        marking_width: Width of lines [m].
        dash: Length of a dash [m].
        dash_gap: Gap between dashes [m].
        joint_width: Expansion joint along the bridge [m].
        median: Strip between the two directions [m]; 0 for none.
        divided: Whether the strip is a raised curb without anything on it.
    """

    lanes: int
    lane_width: float
    shoulder: float
    kerb_width: float
    footway_width: float
    kerb_height: float
    surfacing: float
    marking_width: float
    dash: float
    dash_gap: float
    joint_width: float
    median: float = 0.0
    divided: bool = False

    @property
    def kerb_face(self) -> float:
        """From the axis to the face of the kerb [m]."""
        return self.edge_line + self.shoulder

    @property
    def edge_line(self) -> float:
        """From the axis to the middle of the outer edge lines [m]."""
        return 0.5 * (self.lanes * self.lane_width + self.median)

    @property
    def half_width(self) -> float:
        """From the axis to the foot of the parapet [m]."""
        return self.kerb_face + self.kerb_width + self.footway_width


def draw_roadway(settings: RoadwaySettings, draws: Draws, lanes_suited: tuple[int, ...] | None = None) -> Roadway:
    """Draw the cross-section.

    Args:
        settings: Values set by the user.
        draws: Random stream and profile of the bridge.
        lanes_suited: Numbers of lanes that suit what the user set; default: all.
    """
    suited = DIVIDED_IN if settings.divided else lanes_suited
    lanes, footway = draw_option(settings, "lanes", draws, suited=suited), draw_option(settings, "footway", draws)
    footway_width, kerb, verge = (draw(settings, key, draws) for key in ("footway_width", "kerb_width", "verge_width"))
    divided = _divided(settings, lanes, draw_option(settings, "divided", draws))
    median = draw(settings, "median", draws)
    return Roadway(
        lanes=lanes,
        lane_width=draw(settings, "lane_width", draws),
        shoulder=draw(settings, "shoulder", draws),
        kerb_width=kerb if footway else verge,
        footway_width=footway_width if footway else 0.0,
        kerb_height=draw(settings, "kerb_height", draws),
        surfacing=draw(settings, "surfacing", draws),
        marking_width=draw(settings, "marking_width", draws),
        dash=draw(settings, "dash", draws),
        dash_gap=draw(settings, "dash_gap", draws),
        joint_width=draw(settings, "joint_width", draws),
        median=median if divided else 0.0,
        divided=divided,
    )


def _divided(settings: RoadwaySettings, lanes: int, wanted: bool) -> bool:
    possible = lanes >= DIVIDED_LANES and lanes % 2 == 0
    if settings.divided and not possible:
        raise InputError(
            "a divided road has the same number of lanes in both directions",
            field="bridge.roadway.divided",
            value=True,
            allowed="4 or 6 lanes",
            hint=f"The nearest valid value is bridge.roadway.lanes = {max(4, lanes + lanes % 2)}",
        )
    return possible and wanted


def asphalt_ranges(roadway: Roadway, spans: Spans) -> list[tuple[float, float]]:
    """Find the stations between which asphalt lies: before the first joint, on each span, behind the last joint.

    Args:
        roadway: Cross-section.
        spans: Stations.

    Returns:
        First and last station of each stretch [m].
    """
    half = 0.5 * roadway.joint_width - EMBEDDED
    joints = [station for _, station in spans.joints]
    begins = [spans.supports[0] - ABUTMENT_BACK, *(joint + half for joint in joints)]
    ends = [*(joint - half for joint in joints), spans.supports[-1] + ABUTMENT_BACK]
    return list(zip(begins, ends, strict=True))


def surfacing_parts(roadway: Roadway, spans: Spans, place: Alignment) -> list[Part]:
    """Build the asphalt with its markings, and the expansion joints between its pieces.

    Args:
        roadway: Cross-section.
        spans: Stations.
        place: Axis of the bridge.
    """
    parts = []
    half, depth = roadway.kerb_face + EMBEDDED, roadway.surfacing + EMBEDDED
    for number, (low, high) in enumerate(asphalt_ranges(roadway, spans)):
        surface = Prism(_asphalt_outline(roadway, half, depth, place), low, high, "station", place)
        size: dict[str, object] = {"length": high - low, "width": 2.0 * half, "thickness": roadway.surfacing}
        name = f"Surfacing_{number:03d}"
        parts.append(Part(name, "surfacing", "Role_DeckAsphalt", SUPERSTRUCTURE, surface, size))
        parts += _marking_parts(roadway, number, low, high, place)
    for support, middle in spans.joints:
        low, high = middle - 0.5 * roadway.joint_width, middle + 0.5 * roadway.joint_width
        outline = rectangle((-half + 0.002, -depth - _SHORTER), (half - 0.002, 0.008))
        surface = Prism(outline, low, high, "station", place)
        size = {"width": roadway.joint_width, "length": 2.0 * half}
        name = f"Joint_{support:03d}"
        parts.append(Part(name, "expansion_joint", "Role_BearingRubber", SUPERSTRUCTURE, surface, size))
    return parts


def _asphalt_outline(roadway: Roadway, half: float, depth: float, place: Alignment) -> F64:
    """Draw the asphalt's section; where the road's crossfall changes, its top has an edge under every line.

    A wide twisted quad is millimeters off the road in its middle: lines would partly be below it.
    """
    outline = rectangle((-half, -depth), (half, 0.0))
    if not place.falls:
        return outline
    under = _lane_lines(roadway)[0][::-1]
    crown = _CROWN * (1.0 - (under / half) ** 2)  # too little to be visible, but the section stays convex
    return np.concatenate([outline[:3], np.column_stack([under, crown]), outline[3:]])


def _marking_parts(roadway: Roadway, number: int, low: float, high: float, place: Alignment) -> list[Part]:
    lines, edges = _lane_lines(roadway)
    low, high = low + _MARKING_CLEAR, high - _MARKING_CLEAR
    parts = []
    for line, left in enumerate(lines):
        edge = line in edges
        runs = np.array([[low, high]]) if edge else _dashes(roadway, low, high)
        if len(runs) == 0:
            continue
        stripes = [_stripe(roadway, float(left), float(a), float(b), place) for a, b in runs]
        surface = _rounded(joined(extruded(stripes)), len(stripes[0].outline))
        facts: dict[str, object] = {"width": roadway.marking_width, "dashed": not edge}
        name = f"Marking_{number:03d}_{line:02d}"
        parts.append(Part(name, "road_marking", "Role_RoadMarking", SUPERSTRUCTURE, surface, facts))
    return parts


def _lane_lines(roadway: Roadway) -> tuple[F64, tuple[int, ...]]:
    """Find the middle of every line on the road [m], and which of them are continuous."""
    lines: F64 = (np.arange(roadway.lanes + 1.0) - 0.5 * roadway.lanes) * roadway.lane_width
    if not roadway.median:
        return lines, (0, roadway.lanes)
    half = 0.5 * roadway.median
    middle = roadway.lanes // 2
    apart = np.concatenate([lines[: middle + 1] - half, lines[middle:] + half])
    return apart, (0, middle, middle + 1, roadway.lanes + 1)


def lane_lines(roadway: Roadway) -> list[tuple[float, bool]]:
    """List the painted lines: distance to the left of the axis [m], rising, and whether the line is dashed.

    Args:
        roadway: Cross-section.
    """
    lines, edges = _lane_lines(roadway)
    return [(float(left), number not in edges) for number, left in enumerate(lines)]


def _dashes(roadway: Roadway, low: float, high: float) -> F64:
    period = roadway.dash + roadway.dash_gap
    begin = np.arange(np.floor(low / period), np.ceil(high / period) + 1.0) * period
    runs = np.clip(np.stack([begin, begin + roadway.dash], axis=1), low, high)
    return runs[runs[:, 1] - runs[:, 0] >= _SHORTEST_DASH]


def _stripe(roadway: Roadway, left: float, low: float, high: float, place: Alignment) -> Prism:
    half = 0.5 * roadway.marking_width
    foot, top = half + EMBEDDED * _MARKING_EDGE, half - MARKING_HEIGHT * _MARKING_EDGE
    outline = np.array([[-foot, -EMBEDDED], [foot, -EMBEDDED], [top, MARKING_HEIGHT], [-top, MARKING_HEIGHT]])
    return Prism(outline + np.array([left, 0.0]), low, high, "station", place)


def _rounded(surface: Surface, size: int) -> Surface:
    """Give the long edges of lines the normals of their tops: a strip of a few millimeters in shade would flicker.

    Args:
        surface: Lines, every ring of them with as many corners.
        size: Corners of a ring.
    """
    up, ring = surface.normals[:, 2], surface.corners // size
    normals, flat = surface.normals.copy(), up > 0.95
    tops = np.zeros((len(surface.points) // size, 3))
    tops[ring[flat]] = normals[flat]
    edge = (up > 0.5) & ~flat
    normals[edge] = tops[ring[edge]]
    return replace(surface, normals=normals)


def kerb_parts(roadway: Roadway, name: str, low: float, high: float, place: Alignment) -> list[Part]:
    """Build kerb and footway of both sides over one run.

    Args:
        roadway: Cross-section.
        name: Ending of the names, e.g. `000`.
        low: Station where they begin [m].
        high: Station where they end [m].
        place: Axis of the bridge.
    """
    parts = []
    bottom = -roadway.surfacing - EMBEDDED - _DEEPER
    for side, sign in (("L", 1.0), ("R", -1.0)):
        face, back = roadway.kerb_face, roadway.kerb_face + roadway.kerb_width
        # Curb and footway extend slightly under adjacent parts, so that there are neither shared faces nor gaps.
        behind = back + (0.0 if roadway.footway_width else 2.0 * EMBEDDED)
        kerb = cut_corners(rectangle((face, bottom), (behind, roadway.kerb_height)), np.array([0.0, 0.0, 0.0, 0.02]))
        surface = Prism(on_side(kerb, sign), low, high, "station", place)
        size: dict[str, object] = {"width": roadway.kerb_width, "height": roadway.kerb_height, "length": high - low}
        parts.append(Part(f"Kerb_{name}_{side}", "kerb", "Role_KerbConcrete", SUPERSTRUCTURE, surface, size))
        if roadway.footway_width:
            far = roadway.half_width + 2.0 * EMBEDDED
            path = rectangle((back - EMBEDDED, bottom - 2.0 * _SHORTER), (far, roadway.kerb_height - 0.006))
            surface = Prism(on_side(path, sign), low + _SHORTER, high - _SHORTER, "station", place)
            size = {"width": roadway.footway_width, "length": high - low}
            parts.append(Part(f"Footway_{name}_{side}", "footway", "Role_KerbConcrete", SUPERSTRUCTURE, surface, size))
    return parts
