"""Arch ribs and rings, the blocks that they spring from, and the struts between ribs."""

from dataclasses import dataclass, replace

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.arch_axis import Rib
from authoring.parts.footings import Founding
from authoring.parts.part import SUBSTRUCTURE, SUPERSTRUCTURE, Part
from authoring.shapes.component import F64
from authoring.shapes.sections import cut_corners, mirrored, rectangle
from authoring.shapes.topology import corner_normals
from authoring.solids.extrusion import Prism
from authoring.solids.sweep import Surface, sweep

EMBEDDED = 0.010  # [m] rib into its block, strut into rib
_FLAT = 1e-8  # [m] largest distance of a corner from its face's plane
_LOCAL = Alignment(0.0)
_FACE_MARGIN = 0.25  # [m] margin of a block around the rib, on the face of the springing
_FLANGE_OVERHANG = 0.05  # [m] of a steel box's flanges over its webs


@dataclass(frozen=True)
class RibSection:
    """Section of a rib or ring, square to its axis.

    Attributes:
        form: `concrete`, `steel` or `masonry`.
        width: Across the bridge [m].
        lines: Distance of every rib's middle to the left of the axis [m].
        chamfer: Leg of the chamfers of concrete edges [m].
    """

    form: str
    width: float
    lines: tuple[float, ...]
    chamfer: float

    @property
    def role(self) -> str:
        """Material role of ribs and struts."""
        return "Role_GirderSteel" if self.form == "steel" else "Role_GirderConcrete"


def section_outline(section: RibSection, depth: float) -> F64:
    """Draw a rib's section round its center: a solid with cut corners, or a steel box with flange edges.

    Args:
        section: Form and width.
        depth: Of the section [m].

    Returns:
        Outline (left, outward) [m], shape (P, 2), float64.
    """
    half, top = 0.5 * section.width, 0.5 * depth
    if section.form != "steel":
        outline = rectangle((-half, -top), (half, top))
        return cut_corners(outline, section.chamfer) if section.chamfer > 0.0 else outline
    web, flange = half - _FLANGE_OVERHANG, top - 0.03
    return mirrored([(half, -top), (half, -flange), (web, -flange), (web, flange), (half, flange), (half, top)])


def rib_surface(rib: Rib, section: RibSection, line: float, place: Alignment) -> Surface:
    """Sweep one rib along its axis; every side of its polygon is a straight piece.

    Args:
        rib: Axis and depths.
        section: Form and width.
        line: Distance of its middle to the left of the axis [m].
        place: Level frame at mid-span.
    """
    nodes, ways, depth = rib.polygon
    first, last = nodes[1] - nodes[0], nodes[-1] - nodes[-2]  # lengthened along itself, an end piece stays straight
    nodes = nodes.copy()
    nodes[0] -= EMBEDDED * first / np.linalg.norm(first)
    nodes[-1] += EMBEDDED * last / np.linalg.norm(last)
    u = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(nodes, axis=0), axis=1))])
    flat = sweep(np.stack([section_outline(section, d) for d in depth]), u, "station", _LOCAL)
    ring = np.repeat(np.arange(len(u)), len(flat.points) // len(u))
    lifted = nodes[ring] + flat.points[:, 2:] * ways[ring]
    points = place.point(lifted[:, 0], line + flat.points[:, 1], lifted[:, 1])
    bent = replace(flat, points=points, st=_rib_texture(flat, rib, first, last))
    return _halved(bent) if np.ptp(depth) > 0.0 else _shaded(bent)


def _rib_texture(flat: Surface, rib: Rib, first: F64, last: F64) -> F64:
    """Correct the distortion of the texture by the oblique ends of a rib."""
    ways, st = rib.polygon[1], flat.st.copy()
    chart = np.repeat(flat.chart, flat.face_counts)
    size = len(flat.points) // len(ways)
    outward = flat.points[flat.corners, 2]
    for end, way, side in ((0, ways[0], first), (len(ways) - 1, ways[-1], last)):
        rows = (chart == 0) & (flat.corners // size == end)
        st[rows, 0] += outward[rows] * float(way @ side) / float(np.linalg.norm(side))
        st[chart == (1 if end == 0 else 2), 1] *= float(np.linalg.norm(way))
    return st


def _shaded(surface: Surface) -> Surface:
    normals = corner_normals(surface.points, surface.face_counts, surface.corners)
    return replace(surface, normals=normals)


def _halved(surface: Surface) -> Surface:
    """Halve the chamfers of a rib that thickens, whose four corners are not coplanar."""
    quads = int(np.sum(surface.chart == 0))
    corners, st = surface.corners[: 4 * quads].reshape(-1, 4), surface.st[: 4 * quads].reshape(-1, 4, 2)
    a, b, c, d = (surface.points[corners[:, k]] for k in range(4))
    across = np.cross(c - a, d - b)
    twisted = np.abs(np.sum((b - a) * across, axis=1)) > _FLAT * np.linalg.norm(across, axis=1)
    halves = np.array([[0, 1, 2], [0, 2, 3]])
    kept, cut = int(np.sum(~twisted)), 2 * int(np.sum(twisted))
    counts = np.concatenate([np.full(kept, 4), np.full(cut, 3), surface.face_counts[quads:]])
    return _shaded(
        replace(
            surface,
            face_counts=counts.astype(np.int32),
            corners=np.concatenate(
                [corners[~twisted].ravel(), corners[twisted][:, halves].ravel(), surface.corners[4 * quads :]]
            ).astype(np.int32),
            st=np.concatenate(
                [st[~twisted].reshape(-1, 2), st[twisted][:, halves].reshape(-1, 2), surface.st[4 * quads :]]
            ),
            chart=np.concatenate([np.zeros(kept + cut), surface.chart[quads:]]).astype(np.int32),
        )
    )


def rib_parts(rib: Rib, section: RibSection, kind: str, place: Alignment) -> list[Part]:
    """Build every rib, or the ring.

    Args:
        rib: Axis and depths.
        section: Form, width and lines.
        kind: `arch_rib` or `arch_ring`.
        place: Level frame at mid-span.
    """
    facts: dict[str, object] = {
        "shape": rib.axis.shape,
        "span": rib.axis.span,
        "rise": rib.axis.rise,
        "width": section.width,
        "depth": rib.depth,
        "springing_depth": rib.springing_depth,
        "form": section.form,
    }
    return [
        Part(f"Arch_{number:02d}", kind, section.role, SUPERSTRUCTURE, rib_surface(rib, section, line, place), facts)
        for number, line in enumerate(section.lines)
    ]


def facetted(surface: Surface) -> Surface:
    """Map the texture to every face separately, undistorted, with v upwards on the face.

    Args:
        surface: A solid of few flat faces.
    """
    starts = np.cumsum(surface.face_counts) - surface.face_counts
    st = np.empty((len(surface.corners), 2))
    for start, count in zip(starts, surface.face_counts, strict=True):
        rows = slice(start, start + count)
        points = surface.points[surface.corners[rows]]
        normal = np.cross(points - points[0], np.roll(points, -1, axis=0) - points[0]).sum(axis=0)
        normal /= np.linalg.norm(normal)
        across = np.cross([0.0, 0.0, 1.0], normal) if abs(normal[2]) < 0.999 else np.array([1.0, 0.0, 0.0])
        across = across / np.linalg.norm(across)
        st[rows] = np.stack([points @ across, points @ np.cross(normal, across)], axis=1)
    return replace(surface, st=st, chart=np.arange(len(surface.face_counts), dtype=np.int32))


def skewback_face(rib: Rib, end: int) -> tuple[F64, F64]:
    """Find the corners of the face of a rib's springing.

    Args:
        rib: Axis and depths.
        end: 0 for the first springing, 1 for the last.

    Returns:
        Upper and lower corner (station, height) [m], a margin outside extrados and intrados, shape (2,) each, float64.
    """
    nodes, ways, depth = rib.polygon
    k = -end
    reach = 0.5 * depth[k] + _FACE_MARGIN
    return nodes[k] + reach * ways[k], nodes[k] - reach * ways[k]


def skewback_stations(rib: Rib, end: int, back: float) -> tuple[float, float]:
    """Find the stations between which a block for the thrust of a rib lies [m], the smaller first.

    Args:
        rib: Axis and depths.
        end: 0 for the first springing, 1 for the last.
        back: Length of its top behind the face [m].
    """
    upper, lower = skewback_face(rib, end)
    behind = upper[0] + (-1.0 if end == 0 else 1.0) * back
    return min(behind, lower[0]), max(behind, lower[0])


def skewback_part(rib: Rib, end: int, name: str, left: tuple[float, float], back: float, founding: Founding) -> Part:
    """Build a block with an inclined face for the thrust of a rib; it extends into the ground.

    Args:
        rib: Axis and depths.
        end: 0 for the first springing, 1 for the last.
        name: Name of the part.
        left: From and to, to the left of the axis [m].
        back: Length of its top behind the face [m].
        founding: Depth of its foundation, in the level frame at mid-span.
    """
    upper, lower = skewback_face(rib, end)
    behind = upper[0] + (-1.0 if end == 0 else 1.0) * back
    stations = skewback_stations(rib, end, back)
    bottom = founding.bottom(stations, left, lower[1] - 0.5)
    outline = np.array([(behind, bottom), (lower[0], bottom), lower, upper, (behind, upper[1])])
    surface = Prism(outline if end == 0 else outline[::-1], left[0], left[1], "left", founding.place, 0.025)
    size: dict[str, object] = {
        "length": left[1] - left[0],
        "width": stations[1] - stations[0],
        "height": float(upper[1]) - bottom,
        "springing": end,
    }
    return Part(name, "abutment_wall", "Role_AbutmentConcrete", SUBSTRUCTURE, surface, size)


def strut_parts(
    rib: Rib, section: RibSection, stations: list[float], size: tuple[float, float], place: Alignment
) -> list[Part]:
    """Build struts between neighboring ribs, square to the arch.

    Args:
        rib: Axis and depths.
        section: Lines and width of the ribs.
        stations: Of the struts [m].
        size: Along the arch and square to it [m].
        place: Level frame at mid-span.
    """
    parts = []
    half = 0.5 * section.width - (_FLANGE_OVERHANG if section.form == "steel" else 0.0) - EMBEDDED
    for number, station in enumerate(stations):
        middle, along = rib_direction(rib, station)
        across = np.array([-along[1], along[0]])
        local = rectangle((-0.5 * size[0], -0.5 * size[1]), (0.5 * size[0], 0.5 * size[1]))
        if section.chamfer > 0.0:
            local = cut_corners(local, section.chamfer)
        outline = middle + local[:, :1] * along + local[:, 1:] * across
        for bay, (first, second) in enumerate(zip(section.lines[:-1], section.lines[1:], strict=True)):
            surface = Prism(outline, first + half, second - half, "left", place)
            facts: dict[str, object] = {"length": second - first - 2.0 * half, "width": size[0], "depth": size[1]}
            name = f"Arch_Brace_{number:02d}_{bay}"
            parts.append(Part(name, "arch_brace", section.role, SUPERSTRUCTURE, surface, facts))
    return parts


def rib_direction(rib: Rib, station: float) -> tuple[F64, F64]:
    """Find the middle of a rib and its direction.

    Args:
        rib: Axis and depths.
        station: Station [m].

    Returns:
        Middle (station, height) [m] and unit direction [1], shape (2,) each, float64.
    """
    x = np.array([station - rib.start])
    height = rib.base + rib.axis.height(x)[0] + rib.slope * (x[0] - 0.5 * rib.axis.span)
    along = rib.axis.tangent(x)[0]
    along = along + np.array([0.0, rib.slope * along[0]])
    return np.array([station, height]), along / np.linalg.norm(along)
