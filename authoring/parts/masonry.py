"""Masonry of filled-spandrel arches: rings on springers, piers with cutwaters, spandrel walls and the fill between."""

from dataclasses import dataclass, replace

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.arch_axis import ArchAxis, Rib
from authoring.parts.arches import RibSection, facetted, rib_surface
from authoring.parts.footings import Founding
from authoring.parts.part import SUBSTRUCTURE, SUPERSTRUCTURE, Part
from authoring.shapes.component import F64
from authoring.shapes.sections import plane_cross, rectangle
from authoring.shapes.topology import corner_normals
from authoring.solids.extrusion import Prism
from authoring.solids.sweep import Surface, sweep

ROLE = "Role_Masonry"
PROUD = 0.02  # [m] projection of the ring in front of the spandrel walls
_SPRINGER = 0.35  # [m] height of a springer below the springing
_EMBEDDED = 0.005  # [m] embedment of walls and fill in their support
_OFFSET = 0.06  # [m] projection of the pier beyond the springer
_SHORTER = 0.004  # [m] walls are shorter than the abutments' blocks below them
_FILL_SHORTER = 0.010  # [m] shorter than the walls beside it
_FILL_LOWER = 0.002  # [m] depth of the fill below the top of the walls


@dataclass(frozen=True)
class Viaduct:
    """Equal masonry arches in a row; heights count from the finished surface in the middle of the bridge.

    Attributes:
        ring: Axis and thickness of one arch, its first springing at station 0.
        starts: Station of the first springing of every arch's axis [m].
        pier: Thickness of a pier at the springing [m].
        cutwater: Length of a cutwater over half its width [1].
        wall: Thickness of the spandrel walls [m].
        width: Overall deck width [m].
        ends: Stations of the abutments' back faces [m].
        slope: Rise of the road per meter, which the arches follow [1].
    """

    ring: Rib
    starts: tuple[float, ...]
    pier: float
    cutwater: float
    wall: float
    width: float
    ends: tuple[float, float]
    slope: float = 0.0

    def rib(self, number: int) -> Rib:
        """Place one arch.

        Args:
            number: Of the arch.
        """
        ring = replace(self.ring, start=self.starts[number], slope=self.slope)
        return replace(ring, base=ring.base + self.slope * (ring.middle - 0.5 * sum(self.ends)))

    @property
    def back(self) -> F64:
        """The lower line of walls and fill, from back face to back face (station, height) [m], shape (N, 2)."""
        arches = [self.rib(number).edge(1.0) for number in range(len(self.starts))]
        line = np.concatenate(arches)
        return np.concatenate([[(self.ends[0] + _SHORTER, line[0, 1])], line, [(self.ends[1] - _SHORTER, line[-1, 1])]])


def ring_of(shape: str, span: float, rise: float, thickness: float) -> ArchAxis:
    """Find the axis of a ring from its intrados.

    Args:
        shape: Of the axis.
        span: Clear span of the intrados [m].
        rise: Of the intrados [m].
        thickness: Of the ring [m].

    Returns:
        The axis, half a thickness outside the intrados at crown and springings.
    """
    sine, cosine = ArchAxis(shape, span, rise).tangent(np.array([0.0]))[0][::-1]
    return ArchAxis(shape, span + thickness * float(sine), rise + 0.5 * thickness * float(1.0 - cosine))


def springing_reach(shape: str, span: float, rise: float) -> float:
    """Find the run of a ring's end across its thickness, over that thickness [1]: 1 at the foot of a semicircle.

    Args:
        shape: Of the axis.
        span: Clear span of the intrados [m].
        rise: Of the intrados [m].
    """
    return float(ArchAxis(shape, span, rise).tangent(np.array([0.0]))[0, 1])


def viaduct_parts(viaduct: Viaduct, surfacing: float, place: Alignment) -> list[Part]:
    """Build rings, spandrel walls, string courses and fill.

    Args:
        viaduct: Dimensions.
        surfacing: From the finished surface down to fill and walls [m].
        place: Level frame in the middle of the bridge.
    """
    v = viaduct
    section = RibSection("masonry", v.width + 2.0 * PROUD, (0.0,), 0.0)
    facts: dict[str, object] = {
        "shape": v.ring.axis.shape,
        "span": v.ring.axis.span,
        "rise": v.ring.axis.rise,
        "width": section.width,
        "depth": v.ring.depth,
        "springing_depth": v.ring.springing_depth,
        "form": "masonry",
    }
    parts = []
    for number in range(len(v.starts)):
        surface = rib_surface(v.rib(number), section, 0.0, place)
        parts.append(Part(f"Arch_{number:02d}", "arch_ring", ROLE, SUPERSTRUCTURE, surface, facts))
    line = v.back
    stations = line[:, 0]
    top = v.slope * (stations - 0.5 * (v.ends[0] + v.ends[1])) - surfacing
    half = 0.5 * v.width
    for side, low, high in (("L", half - v.wall, half), ("R", -half, v.wall - half)):
        surface = bank_surface(stations, line[:, 1] - _EMBEDDED, top, (low, high), place)
        size: dict[str, object] = {"length": v.ends[1] - v.ends[0], "thickness": v.wall}
        parts.append(Part(f"Spandrel_Wall_{side}", "spandrel_wall", ROLE, SUPERSTRUCTURE, surface, size))
        parts.append(_course_part(v, side, stations, top, float(np.min(top - line[:, 1])), place))
    inner = half - v.wall + _EMBEDDED
    shorter = stations + np.concatenate([[_FILL_SHORTER], np.zeros(len(stations) - 2), [-_FILL_SHORTER]])
    surface = bank_surface(shorter, line[:, 1] - _EMBEDDED, top - _FILL_LOWER, (-inner, inner), place)
    fill: dict[str, object] = {"length": v.ends[1] - v.ends[0], "width": 2.0 * inner, "filled_spandrel": True}
    parts.append(Part("Fill", "spandrel_wall", ROLE, SUPERSTRUCTURE, surface, fill))
    return parts


def masonry_support_parts(viaduct: Viaduct, founding: Founding) -> list[Part]:
    """Build the abutments' blocks, and the piers with their springers.

    Args:
        viaduct: Dimensions.
        founding: Depth of their foundation, in the level frame in the middle of the bridge.
    """
    v, half = viaduct, 0.5 * viaduct.width
    parts = []
    last = len(v.starts) - 1
    for number, k, back in ((0, 0, v.ends[0]), (last, -1, v.ends[1])):
        lower, upper = v.rib(number).edge(-1.0)[k], v.rib(number).edge(1.0)[k]
        stations = (min(back, float(lower[0])), max(back, float(lower[0])))
        reach = half + _OFFSET
        bottom = founding.bottom(stations, (-reach, reach), lower[1] - 0.5)
        outline = np.array([(back, bottom), (lower[0], bottom), lower, upper, (back, upper[1])])
        outline = _cornered(outline if k == 0 else outline[::-1])
        surface = Prism(outline, -reach, reach, "left", founding.place)
        size: dict[str, object] = {
            "length": 2.0 * reach,
            "thickness": stations[1] - stations[0],
            "height": float(upper[1]) - bottom,
            "support": 0 if k == 0 else last + 1,
            "filled_spandrel": True,
        }
        name = f"Abutment_{(0 if k == 0 else last + 1):03d}_Wall"
        parts.append(Part(name, "abutment_wall", ROLE, SUBSTRUCTURE, surface, size))
    for number in range(last):
        parts += _pier_parts(v, number, founding)
    return parts


def _cornered(outline: F64) -> F64:
    """Leave out points of an outline at which it runs straight: semicircles spring from level beds.

    Args:
        outline: Corners [m], shape (P, 2), float64.

    Returns:
        Those with a turn [m], shape (Q, 2), float64.
    """
    before, after = outline - np.roll(outline, 1, axis=0), np.roll(outline, -1, axis=0) - outline
    return outline[np.abs(plane_cross(before, after)) > 1e-9]


def bank_surface(stations: F64, bottom: F64, top: F64, left: tuple[float, float], place: Alignment) -> Surface:
    """Build a wall along the bridge between two lines in elevation; the texture of its faces is level.

    Args:
        stations: Rising [m], shape (S,), float64.
        bottom: Heights of its underside [m], shape (S,), float64.
        top: Heights of its top [m], shape (S,), float64.
        left: From and to, to the left of the axis [m].
        place: Level frame.
    """
    sections = np.stack([rectangle((left[0], low), (left[1], high)) for low, high in zip(bottom, top, strict=True)])
    surface = sweep(sections, stations, "station", place)
    sides = 4 * (len(stations) - 1)
    ring, corner = surface.corners[: 4 * sides] // 4, surface.corners[: 4 * sides] % 4
    side = np.repeat(np.arange(sides) % 4, 4)
    across = sections[ring, corner, 0]
    height = sections[ring, corner, 1]
    under = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(stations), np.diff(bottom)))])[ring]
    along = stations[ring]
    u = np.choose(side, [under, -along, along, along])
    v = np.choose(side, [-across, height, across, height])
    st = surface.st.copy()
    st[: 4 * sides] = np.stack([u, v], axis=1)
    chart = surface.chart.copy()
    chart[:sides] = np.array([0, 3, 4, 5])[np.arange(sides) % 4]
    normals = corner_normals(surface.points, surface.face_counts, surface.corners)
    return replace(surface, st=st, chart=chart.astype(np.int32), normals=normals)


def _course_part(viaduct: Viaduct, side: str, stations: F64, top: F64, fill: float, place: Alignment) -> Part:
    """Build the string course that runs along a spandrel wall below the parapet."""
    half, sign = 0.5 * viaduct.width, 1.0 if side == "L" else -1.0
    left = sorted((sign * (half - 0.01), sign * (half + 0.07)))
    ends = stations[[0, -1]] + np.array([0.01, -0.01])
    height, deep = np.interp(ends, stations, top) - 0.05, min(0.22, fill - 0.10)
    surface = bank_surface(ends, height - deep, height, (left[0], left[1]), place)
    size: dict[str, object] = {"length": float(np.ptp(ends)), "height": deep, "width": 0.08}
    return Part(f"String_Course_{side}", "spandrel_wall", ROLE, SUPERSTRUCTURE, surface, size)


@dataclass(frozen=True)
class _Cutwater:
    """Plan of a pier with a pointed nose on either side: halves count from the axis.

    Attributes:
        middle: Station of the pier's middle [m].
        thick: Half its thickness along the bridge [m].
        half: Half its width where the noses begin [m].
        nose: Half its width at their tips [m].
    """

    middle: float
    thick: float
    half: float
    nose: float

    def plan(self) -> F64:
        """Draw the outline, counter-clockwise: (station, left) [m], shape (6, 2), float64."""
        thick, half, nose = self.thick, self.half, self.nose
        corners = [(thick, -half), (thick, half), (0.0, nose), (-thick, half), (-thick, -half), (0.0, -nose)]
        return np.array(corners) + np.array([self.middle, 0.0])


def covered_by_piers(viaduct: Viaduct) -> list[tuple[float, float, float, float]]:
    """List the rectangles on the ground round the piers and their cutwaters.

    Args:
        viaduct: Dimensions.

    Returns:
        Lowest and highest station, lowest and highest distance to the left of the axis of each [m].
    """
    found = [_cutwater(viaduct, number) for number in range(len(viaduct.starts) - 1)]
    return [(one.middle - one.thick, one.middle + one.thick, -one.nose, one.nose) for one in found]


def _cutwater(viaduct: Viaduct, number: int) -> _Cutwater:
    """Find the plan of the pier behind an arch."""
    before, after = viaduct.rib(number).edge(-1.0)[-1], viaduct.rib(number + 1).edge(-1.0)[0]
    thick, middle = 0.5 * viaduct.pier + _OFFSET, 0.5 * float(before[0] + after[0])
    half = 0.5 * viaduct.width + _OFFSET
    return _Cutwater(middle, thick, half, half + viaduct.cutwater * thick)


def _pier_parts(viaduct: Viaduct, number: int, founding: Founding) -> list[Part]:
    v, half, place = viaduct, 0.5 * viaduct.width, founding.place
    before, after = v.rib(number), v.rib(number + 1)
    left_low, left_up = before.edge(-1.0)[-1], before.edge(1.0)[-1]
    right_low, right_up = after.edge(-1.0)[0], after.edge(1.0)[0]
    under = float(min(left_low[1], right_low[1])) - _SPRINGER
    outline = np.array([(left_low[0], under), (right_low[0], under), right_low, right_up, left_up, left_low])
    reach = half + 0.5 * _OFFSET
    springer = Prism(_cornered(outline), -reach, reach, "left", place).surface
    cutwater = _cutwater(v, number)
    middle, thick, nose = cutwater.middle, cutwater.thick, cutwater.nose
    bottom = founding.bottom((middle - thick, middle + thick), (-nose, nose), under - 0.5)
    shaft = Prism(cutwater.plan(), bottom, under + 0.010, "above", place).surface
    support = number + 1
    facts: dict[str, object] = {"support": support, "filled_spandrel": True}
    cap: dict[str, object] = {"length": 2.0 * reach, "width": v.pier, "depth": float(left_up[1]) - under, **facts}
    size: dict[str, object] = {"length": 2.0 * nose, "width": 2.0 * thick, "height": under - bottom, **facts}
    return [
        Part(f"Pier_{support:03d}_Springer", "pier_cap", ROLE, SUBSTRUCTURE, springer, cap),
        Part(f"Pier_{support:03d}_Shaft", "wall_pier", ROLE, SUBSTRUCTURE, shaft, size),
        *_hood_parts(support, cutwater, under + 0.005, place),
    ]


def _hood_parts(support: int, cutwater: _Cutwater, low: float, place: Alignment) -> list[Part]:
    """Build the half pyramids on top of the cutwaters, from a height [m]."""
    middle, thick, half, nose = cutwater.middle, cutwater.thick, cutwater.half, cutwater.nose
    parts = []
    for side, sign in (("L", 1.0), ("R", -1.0)):
        plan = np.array([(middle - thick, sign * half), (middle + thick, sign * half), (middle, sign * nose)])
        plan = plan if sign > 0.0 else plan[::-1]
        foot = np.array([middle, sign * half])
        rings = np.stack([foot + share * (plan - foot) for share in (0.96, 0.06)])
        surface = facetted(sweep(rings, np.array([low, low + 0.8 * thick]), "above", place))
        size: dict[str, object] = {"length": nose - half, "width": 2.0 * thick, "height": 0.8 * thick}
        parts.append(Part(f"Pier_{support:03d}_Hood_{side}", "wall_pier", ROLE, SUBSTRUCTURE, surface, size))
    return parts
