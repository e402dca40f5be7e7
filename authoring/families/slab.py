"""The family `slab`: concrete slabs that span from support to support without girders, simple or continuous.

Source: depths L/22 for simple and L/25 for continuous road slabs (WSDOT Bridge Design Manual), 1:10 to 1:18 under rails
(Network Rail); spans of 6 to 15 m, voided to 18 m (Khan, Bridge and Highway Structure Rehabilitation and Repair).
"""

from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from authoring.axis.alignment import Layout
from authoring.families.shared import AxisNeeds, SharedSettings, draw_layout_of, draw_top
from authoring.families.span_choice import (
    PIERS_BETWEEN_SPANS,
    SEVERAL,
    OwnDraws,
    SpanLengths,
    SpanRule,
    draw_spans,
    of_spans,
)
from authoring.parts.abutments import Abutments, abutment_parts, draw_abutments
from authoring.parts.bearings import Bearings, bearing_parts, draw_bearings
from authoring.parts.deck_top import DeckTop, deck_runs, deck_top_parts
from authoring.parts.drawing import Draws, check_depth, chosen, draw_option, draw_whole, drawn
from authoring.parts.fittings import fitting_parts
from authoring.parts.part import Part
from authoring.parts.piers import Ground, PierNeeds, Piers, draw_piers, pier_parts
from authoring.parts.slabs import (
    LEAST_DEPTH,
    SLENDERNESS,
    Slab,
    SlabNeeds,
    SlabSectionSettings,
    draw_section,
    draw_slab_section,
    slab_parts,
    usual_slenderness,
)
from authoring.parts.spans import Levels, Spans
from groundwork.errors import InputError

_LONGEST_SOLID = 15.0  # [m]
_SOLID = SpanRule("slab", "slabs", 5.0, 18.0, (6.0, 15.0), 5.0, one_row=True, end_shares=(0.75, 0.85))
_VOIDED = replace(_SOLID, drawn=(9.0, 18.0))
_MOST_SPANS = 8


class SlabSettings(SlabSectionSettings, SpanLengths):
    """A slab bridge; omitted values are drawn at random."""

    uses: ClassVar = (*SlabSectionSettings.uses, *of_spans("system"))
    shared_uses: ClassVar = PIERS_BETWEEN_SPANS
    spans: tuple[float, ...] = Field(
        default=(),
        max_length=_MOST_SPANS,
        description="Lengths of the spans, bearing line to bearing line, 5 to 18 each [m]; empty: drawn, 6 to 15, "
        "voided and pk 9 to 18",
    )
    span_count: int | None = drawn(1, _MOST_SPANS, "Number of spans, if `spans` is empty [1]")
    system: Literal["simple", "continuous"] | None = chosen(
        {"continuous": 60, "simple": 40},
        "simple: one slab for each span; continuous: one slab over all spans",
        among=SEVERAL,
    )
    overhang: float | None = drawn(0.32, 0.40, "Length of the slab beyond its bearing line [m]", ge=0.30, le=0.60)
    gap: float | None = drawn(0.03, 0.05, "Width of an expansion gap [m]", ge=0.02, le=0.15)


@dataclass(frozen=True)
class DrawnSlab:
    """Every drawn parameter of a slab bridge.

    Attributes:
        spans: Stations.
        top: Surfacing, parapets and fittings of the slab.
        slab: Section and bearing lines.
        bearings: Bearings and plinths.
        piers: Caps, columns, footings.
        abutments: Walls.
    """

    spans: Spans
    top: DeckTop
    slab: Slab
    bearings: Bearings
    piers: Piers
    abutments: Abutments

    @property
    def levels(self) -> Levels:
        """Thicknesses from the finished surface down to the seats."""
        return Levels(
            surfacing=self.top.surfacing,
            slab=self.slab.depth,
            girder=0.0,
            pad=self.bearings.pad_height,
            plinth=self.bearings.plinth_height,
        )


def draw_slab(settings: SlabSettings, shared: SharedSettings, draws: Draws) -> tuple[Layout, DrawnSlab]:
    """Draw the values that the user did not set.

    Args:
        settings: Settings of the family.
        shared: Settings of the parts that every family has.
        draws: Random stream and profile of the bridge.

    Returns:
        Layout for the site, and the record that `build_slab` builds from.
    """
    top = draw_top(shared, draws)
    bearings = draw_bearings(shared.bearing, draws)
    abutments = draw_abutments(shared.abutment, bearings, draws)
    section = draw_section(settings, draws)
    if settings.section is None and section == "solid" and max(settings.spans, default=0.0) > _LONGEST_SOLID:
        section = "voided"
    apart = shared.pier.cap == "inverted_t"  # its stem needs two rows of bearings
    spans = _draw_spans(settings, section, top.service, apart, bearings, draws)
    longest = float(np.max(np.diff(spans.supports)))
    ratio = usual_slenderness(top.service, continuous=spans.continuous)
    slab = draw_slab_section(settings, section, SlabNeeds(top.width, longest, ratio), bearings, draws)
    if settings.depth and draws.profile != "paper":
        most = min(ratio * SLENDERNESS[1], longest / LEAST_DEPTH)
        check_depth("bridge.slab.depth", slab.depth, longest, (ratio * SLENDERNESS[0], most))
    _check(settings, slab, longest, bearings)
    piers = draw_piers(shared.pier, PierNeeds(top.width, slab.lines[-1], bearings, spans), draws)
    drawn_slab = DrawnSlab(spans, top, slab, bearings, piers, abutments)
    levels = drawn_slab.levels
    needs = AxisNeeds(spans.supports, levels.girder_soffit, levels.seat, abutments.wing_length, river_piers=True)
    return draw_layout_of(shared, top, needs, draws), drawn_slab


def _draw_spans(
    settings: SlabSettings, section: str, service: str, apart: bool, bearings: Bearings, draws: Draws
) -> Spans:
    count = draw_whole(settings, "span_count", draws)
    through = draw_option(settings, "system", draws, suited=("simple",) if apart else None) == "continuous"
    rule, longest = (_SOLID, _LONGEST_SOLID) if section == "solid" else (_VOIDED, _VOIDED.longest)

    def fit(inner: float) -> float:
        if not settings.depth:
            return inner
        several = (len(settings.spans) or count) > 1
        usual = settings.depth * usual_slenderness(service, continuous=several and through)
        inner = round(float(np.clip(inner, SLENDERNESS[0] * usual, SLENDERNESS[1] * usual)), 3)
        return min(max(inner, rule.shortest), longest)

    return draw_spans(rule, settings, OwnDraws(count, fit, through, apart=apart), bearings, draws)


def _check(settings: SlabSettings, slab: Slab, longest: float, bearings: Bearings) -> None:
    if slab.section == "solid" and longest > _LONGEST_SOLID:
        raise InputError(
            "too long a span for a solid slab",
            field="bridge.slab.spans",
            value=longest,
            allowed=f"at most {_LONGEST_SOLID:g} m",
            hint=f"Choose at most {_LONGEST_SOLID:g} m, or section = 'voided'",
        )
    apart = max(0.8, round(bearings.plinth_width + 0.05, 3))  # [m]
    if slab.lines[-1] <= 0.0 or min(np.diff(slab.lines)) < apart:
        raise InputError(
            "no room for the bearings under the slab",
            field="bridge.slab.bearings",
            value=settings.bearings,
            allowed=f"bearings at least {apart:g} m apart",
            hint="Choose fewer bearings or a shorter cantilever",
        )


def build_slab(layout: Layout, drawn_slab: DrawnSlab, ground: Ground) -> list[Part]:
    """Build every member of a slab bridge.

    Args:
        layout: Axis and supports.
        drawn_slab: The drawn record.
        ground: Height of the ground [m], shape (N,), at plan positions [m], shape (N, 2).

    Returns:
        Parts in a fixed order.
    """
    place, spans, levels, top = layout.alignment, drawn_slab.spans, drawn_slab.levels, drawn_slab.top
    parts = slab_parts(drawn_slab.slab, spans, levels, place)
    parts += deck_top_parts(top, spans, deck_runs(spans, drawn_slab.abutments), place)
    parts += bearing_parts(drawn_slab.bearings, drawn_slab.slab.lines, spans, levels, place)
    parts += pier_parts(drawn_slab.piers, spans, levels, place, ground)
    parts += abutment_parts(drawn_slab.abutments, top.width, spans, levels, place, ground)
    parts += fitting_parts(top.fitted, spans, levels.girder_soffit, place)
    return parts
