"""Masonry arches with filled spandrels: no bearings, parapets of masonry, one to five equal spans."""

from dataclasses import dataclass, replace

import numpy as np

from authoring.axis.alignment import Layout
from authoring.axis.road_section import ABUTMENT_BACK
from authoring.families.arch_deck import FOUNDING, raised
from authoring.families.arch_settings import ArchSettings
from authoring.families.shared import AxisNeeds, SharedSettings, draw_layout_of, draw_top
from authoring.parts.abutments import Abutments, abutment_parts, draw_abutments
from authoring.parts.arch_axis import Rib
from authoring.parts.bearings import draw_bearings
from authoring.parts.deck_top import DeckTop, deck_runs, deck_top_parts
from authoring.parts.drawing import Draws, draw, draw_whole
from authoring.parts.footings import Founding
from authoring.parts.masonry import (
    ROLE,
    Viaduct,
    covered_by_piers,
    masonry_support_parts,
    ring_of,
    springing_reach,
    viaduct_parts,
)
from authoring.parts.part import Part
from authoring.parts.piers import Ground
from authoring.parts.spans import Levels, Spans, level_at
from groundwork.errors import InputError

_FRONT = 0.6  # [m] from the support's station to the springing in front of it
_LEAST_BACK = 0.10  # [m] from the end of a ring to the back of the abutment's block, at least
_LEAST_PIER_TOP = 0.10  # [m] between the two rings on a pier


@dataclass(frozen=True)
class DrawnMasonry:
    """Every drawn parameter of a masonry arch bridge.

    Attributes:
        viaduct: Rings, piers, walls.
        supports: Stations of abutments and piers [m].
        spans: One piece of deck from abutment to abutment.
        top: What lies on the fill.
        abutments: Their wing walls.
    """

    viaduct: Viaduct
    supports: tuple[float, ...]
    spans: Spans
    top: DeckTop
    abutments: Abutments


def draw_masonry(
    settings: ArchSettings, springing: float, shared: SharedSettings, draws: Draws
) -> tuple[Layout, DrawnMasonry]:
    """Draw a masonry arch bridge.

    Args:
        settings: Values set by the user.
        springing: Least height of the springings above z = 0 [m].
        shared: Settings of the parts that every family has.
        draws: Random stream and profile of the bridge.
    """
    own = settings.masonry
    solid = shared.parapet.model_copy(update={"shape": "wall"})
    top = draw_top(shared.model_copy(update={"parapet": solid}), draws)
    abutments = draw_abutments(shared.abutment, draw_bearings(shared.bearing, draws), draws)
    count, span = draw_whole(own, "span_count", draws), draw(own, "span", draws)
    rise, thickness = span * draw(own, "rise_ratio", draws), span / draw(own, "span_to_ring", draws)
    pier, fill = span * draw(own, "pier_ratio", draws), draw(own, "crown_fill", draws)
    shape = settings.shape or "circle"
    thickness = _fitting(round(max(thickness, 0.35), 3), shape, (span, rise), own.span_to_ring)
    axis = ring_of(shape, span, rise, thickness)
    pier = round(max(pier, 2.0 * (axis.span - span) + _LEAST_PIER_TOP), 3)
    base = -(top.surfacing + fill + 0.5 * thickness + axis.rise)
    half_more = 0.5 * (axis.span - span)
    starts = tuple(round(_FRONT - half_more + k * (span + pier), 4) for k in range(count))
    total = round(2.0 * _FRONT + count * span + (count - 1) * pier, 4)
    piers = tuple(round(_FRONT + k * (span + pier) - 0.5 * pier, 4) for k in range(1, count))
    viaduct = Viaduct(
        ring=Rib(axis, 0.0, base, 0.0, thickness, thickness),
        starts=starts,
        pier=pier,
        cutwater=draw(own, "cutwater", draws),
        wall=draw(own, "wall", draws),
        width=top.width,
        ends=(-ABUTMENT_BACK, total + ABUTMENT_BACK),
    )
    supports = (0.0, *piers, total)
    drawn = DrawnMasonry(viaduct, supports, Spans((0.0, total), 0.35, 0.02), top, abutments)
    quarter = float(viaduct.rib(0).intrados(np.array([starts[0] + 0.25 * axis.span]))[0])
    needs = AxisNeeds(supports, quarter, base, abutments.wing_length, straight=True)
    layout = draw_layout_of(shared, top, needs, draws)
    layout = replace(layout, blocks=tuple(covered_by_piers(viaduct)))
    # The level of the middle of the bridge gives the lowest springing the required height.
    return raised(layout, replace(viaduct.ring, start=0.5 * (total - axis.span)), springing), drawn


def _fitting(thickness: float, shape: str, size: tuple[float, float], fixed: float | None) -> float:
    """Limit a ring's thickness to what ends within the abutments' blocks [m]; refuse a given one that does not fit.

    Args:
        thickness: Of the ring [m].
        shape: Of the axis.
        size: Clear span and rise of the intrados [m].
        fixed: Span over thickness that the user set [1].
    """
    most = (_FRONT + ABUTMENT_BACK - _LEAST_BACK) / springing_reach(shape, *size)
    if thickness > most and fixed is not None:
        raise InputError(
            f"makes the ring {thickness:.2f} m thick, which ends behind the abutments",
            field="bridge.arch.masonry.span_to_ring",
            value=fixed,
            allowed=f"at least {np.ceil(100.0 * size[0] / most) / 100.0:g} here",
            hint="Choose a thinner ring or a shorter span",
        )
    return min(thickness, float(np.floor(1000.0 * most)) / 1000.0)


def build_masonry(layout: Layout, arch: DrawnMasonry, ground: Ground) -> list[Part]:
    """Build a masonry arch bridge.

    Args:
        layout: Axis and supports.
        arch: The drawn record.
        ground: Height of the ground [m], shape (N,), at plan positions [m], shape (N, 2).
    """
    place, spans = layout.alignment, arch.spans
    middle = level_at(place, 0.5 * spans.supports[-1])
    heights = place.point(np.array(spans.supports), np.zeros(2), np.zeros(2))[:, 2]
    slope = float(heights[1] - heights[0]) / spans.supports[-1]
    v = replace(arch.viaduct, slope=slope)
    parts = viaduct_parts(v, arch.top.surfacing, middle)
    parts += [_as_masonry(part) for part in deck_top_parts(arch.top, spans, deck_runs(spans, arch.abutments), place)]
    parts += masonry_support_parts(v, Founding(middle, ground, FOUNDING))
    levels = Levels(arch.top.surfacing, 0.0, 0.0, 0.0, -arch.top.surfacing - v.ring.base)
    walls = abutment_parts(arch.abutments, arch.top.width, spans, levels, place, ground)
    parts += [replace(part, role=ROLE) for part in walls if part.kind == "wing_wall"]
    return parts


def _as_masonry(part: Part) -> Part:
    """Give parapets the masonry's material, and replace joints, which a filled arch does not have, by asphalt."""
    if part.kind in ("parapet", "parapet_coping"):
        return replace(part, role=ROLE)
    if part.kind == "expansion_joint":
        return replace(part, kind="surfacing", role="Role_DeckAsphalt")
    return part
