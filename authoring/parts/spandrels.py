"""Bents: columns on an arch or on the ground, under a cross-head that supports the deck."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.footings import Founding, footing_top
from authoring.parts.part import SUBSTRUCTURE, Part
from authoring.parts.spans import level_at
from authoring.shapes.component import F64
from authoring.shapes.sections import circle, cut_corners, rectangle
from authoring.shapes.topology import corner_normals
from authoring.solids.extrusion import Prism
from authoring.solids.sweep import Surface, turned

EMBEDDED = 0.010  # [m] embedment of a column in cross-head, arch and footing
_SIDES = 32  # of a round column
_FOOTING_MARGIN = 0.6  # [m] beyond the columns
_CAP_MARGIN = 0.12  # [m] beyond the columns, along the bridge

Heights = Callable[[F64], F64]


@dataclass(frozen=True)
class Bents:
    """Columns and cross-heads; all bents of a bridge are of one kind.

    Attributes:
        shape: `rectangular` or `round` columns.
        length: Column along the bridge [m].
        width: Column across the bridge [m].
        lines: Distance of every column to the left of the axis [m].
        cap_length: Cross-head across the bridge [m].
        cap_depth: Of the cross-head over the columns [m].
        cap_end_depth: At its ends [m].
        chamfer: Leg of chamfers [m].
        role: Material role of the columns.
        footing_top: Of footings above the middle of the ground at them; below zero under its lowest [m].
    """

    shape: str
    length: float
    width: float
    lines: tuple[float, ...]
    cap_length: float
    cap_depth: float
    cap_end_depth: float
    chamfer: float
    role: str
    footing_top: float = -0.4

    @property
    def cap_width(self) -> float:
        """Cross-head along the bridge [m]."""
        return self.length + 2.0 * _CAP_MARGIN


@dataclass(frozen=True)
class CapPlace:
    """Position of a cross-head.

    Attributes:
        station: Its middle [m].
        top: Height of its top [m].
        width: Along the bridge [m].
    """

    station: float
    top: float
    width: float


def cap_part(bents: Bents, name: str, kind: str, cap: CapPlace, level: Alignment) -> Part:
    """Build a cross-head: flat on top, its underside rising beyond the outer columns.

    Args:
        bents: Dimensions.
        name: Name of the part.
        kind: `cross_head` or `pier_cap`.
        cap: Its position.
        level: Level frame of the bent.
    """
    station, top, width = cap.station, cap.top, cap.width
    half = 0.5 * bents.cap_length
    flat = min(max(bents.lines) + 0.5 * bents.width + 0.1, half - 0.02)
    right = [(flat, top - bents.cap_depth), (half, top - bents.cap_end_depth), (half, top)]
    outline = np.array(right + [(-x, y) for x, y in right[::-1]])
    if bents.cap_depth - bents.cap_end_depth < 1e-6:
        outline = rectangle((-half, top - bents.cap_depth), (half, top))
    surface = turned(
        Prism(outline, station - 0.5 * width, station + 0.5 * width, "station", level, bents.chamfer).surface
    )
    size: dict[str, object] = {
        "length": bents.cap_length,
        "width": width,
        "depth": bents.cap_depth,
        "end_depth": bents.cap_end_depth,
    }
    return Part(name, kind, "Role_CapConcrete", SUBSTRUCTURE, surface, size)


def column_surface(
    bents: Bents,
    station: float,
    line: float,
    foot: tuple[float, float],
    head: tuple[float, float],
    level: Alignment,
) -> Surface:
    """Build a column whose ends are cut along slopes.

    Args:
        bents: Dimensions.
        station: Its middle [m].
        line: Distance of its middle to the left of the axis [m].
        foot: Height of the foot under its middle [m], and its rise per meter of station [1].
        head: Height of its top over its middle [m], and the rise per meter of station [1].
        level: Level frame of the bent.
    """
    if bents.shape == "round":
        outline = circle(bents.width, _SIDES) + np.array([station, line])
    else:
        half = 0.5 * np.array([bents.length, bents.width])
        outline = rectangle((station - half[0], line - half[1]), (station + half[0], line + half[1]))
        outline = cut_corners(outline, 2.0 * bents.chamfer) if bents.chamfer > 0.0 else outline
    surface = Prism(outline, foot[0], head[0], "above", level).surface
    size = len(outline)
    lift = np.zeros(len(surface.points))
    lift[:size], lift[-size:] = foot[1] * (outline[:, 0] - station), head[1] * (outline[:, 0] - station)
    points = surface.points + lift[:, None] * np.array([0.0, 0.0, 1.0])
    side, bottom, top = (np.repeat(surface.chart == chart, surface.face_counts) for chart in (0, 1, 2))
    st = surface.st.copy()
    st[side, 0] += lift[surface.corners[side]]
    st[bottom, 0] *= np.hypot(1.0, foot[1])  # a slope makes an end face longer along the bridge
    st[top, 0] *= np.hypot(1.0, head[1])
    normals = corner_normals(points, surface.face_counts, surface.corners)
    return replace(surface, points=points, st=st, normals=normals)


def foot_on(
    back: Heights, station: float, length: float, level: Alignment, reference: Alignment
) -> tuple[float, float]:
    """Find the foot of a column on an arch: it follows the chord of the arch's extrados below it.

    Args:
        back: Finds heights of the arch's back [m] at stations [m], shape (N,), float64.
        station: Middle of the column [m].
        length: Of the column along the bridge [m].
        level: Level frame of the bent.
        reference: Level frame that the arch's heights count in.

    Returns:
        Height in the bent's frame [m] and rise per meter of station [1] of the column's foot.
    """
    ends = np.array([station - 0.5 * length, station + 0.5 * length])
    low, high = back(ends) + (reference.level - level.level)
    return 0.5 * float(low + high) - EMBEDDED, float(high - low) / length


def spandrel_parts(
    bents: Bents, name: str, station: float, top: float, foot: tuple[float, float], place: Alignment
) -> list[Part]:
    """Build the columns of one bent on an arch, and their cross-head.

    Args:
        bents: Dimensions.
        name: Beginning of the names, e.g. `Spandrel_003`.
        station: Its middle [m].
        top: Height of the cross-head's top [m].
        foot: Height under a column's middle [m] and rise [1] of the columns' feet.
        place: Axis of the bridge; the cross-head follows its grade, the columns are upright.
    """
    level = level_at(place, station)
    parts = [cap_part(bents, f"{name}_Cap", "cross_head", CapPlace(station, top, bents.cap_width), place)]
    high = (top - bents.cap_depth + EMBEDDED, grade_near(place, station))
    for number, line in enumerate(bents.lines):
        surface = column_surface(bents, station, line, foot, high, level)
        facts = _column_facts(bents, high[0] - foot[0])
        parts.append(Part(f"{name}_Column_{number:02d}", "spandrel_column", bents.role, SUBSTRUCTURE, surface, facts))
    return parts


def pier_bent_parts(
    bents: Bents, name: str, cap: CapPlace, foot: float, place: Alignment, support: int | None = None
) -> list[Part]:
    """Build a pier: columns on a level surface, and their cap.

    Args:
        bents: Dimensions.
        name: Beginning of the names, e.g. `Pier_001`.
        cap: Position of its cap.
        foot: Height of the surface under the columns [m].
        place: Axis of the bridge.
        support: Number of the support if decks end on the pier: its cap is level; others follow the grade.
    """
    station = cap.station
    level = level_at(place, station)
    own: dict[str, object] = {} if support is None else {"support": support}
    head = cap_part(bents, f"{name}_Cap", "pier_cap", cap, place if support is None else level)
    parts = [replace(head, parameters=head.parameters | own)]
    high = (cap.top - bents.cap_depth + EMBEDDED, grade_near(place, station) if support is None else 0.0)
    for number, line in enumerate(bents.lines):
        surface = column_surface(bents, station, line, (foot - EMBEDDED, 0.0), high, level)
        facts = _column_facts(bents, high[0] - foot) | own
        parts.append(Part(f"{name}_Column_{number:02d}", "column", bents.role, SUBSTRUCTURE, surface, facts))
    return parts


def bent_footing(
    bents: Bents, name: str, station: float, ceiling: float, founding: Founding, room: float
) -> tuple[Part, float]:
    """Build the footing of a pier in the ground.

    Args:
        bents: Dimensions.
        name: Name of the part.
        station: Its middle [m].
        ceiling: Upper limit of its top [m].
        founding: Depth of its foundation, in the level frame of the bent.
        room: Along the bridge to its neighbors, from its middle [m].

    Returns:
        The footing and the height of its top [m].
    """
    half = np.array([0.5 * bents.length, max(bents.lines) + 0.5 * bents.width]) + _FOOTING_MARGIN
    half[0] = min(half[0], room)
    low, high = founding.ground_range((station - half[0], station + half[0]), (-half[1], half[1]))
    # A visible footing cuts into the upper side of a slope.
    top = min(footing_top(low, 0.5 * (low + high), bents.footing_top), ceiling)
    bottom = min(low, top) - founding.depth
    outline = cut_corners(rectangle((station - half[0], -half[1]), (station + half[0], half[1])), 0.025)
    surface = Prism(outline, bottom, top, "above", founding.place, 0.025)
    size: dict[str, object] = {"length": 2.0 * half[1], "width": 2.0 * half[0], "height": top - bottom}
    return Part(name, "pier_footing", "Role_PierConcrete", SUBSTRUCTURE, surface, size), top


def grade_near(place: Alignment, station: float) -> float:
    """Find the rise of the road per meter [1].

    Args:
        place: Axis of the bridge.
        station: Station [m].
    """
    heights = place.point(np.array([station - 0.5, station + 0.5]), np.zeros(2), np.zeros(2))[:, 2]
    return float(heights[1] - heights[0])


def _column_facts(bents: Bents, height: float) -> dict[str, object]:
    return {"shape": bents.shape, "length": bents.length, "width": bents.width, "height": height}
