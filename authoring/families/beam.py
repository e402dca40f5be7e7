"""The family `beam`: simply supported concrete girders under a slab that stops or runs through at the piers.

Source: dimensions by the usual ratios of AASHTO and of standard precast girders, as listed in Shi, Kim, Narazaki and
Khan, Bridge and Highway Structure Rehabilitation and Repair, table 1.2.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from pydantic import Field

from authoring.axis.alignment import Layout
from authoring.families.shared import AxisNeeds, SharedSettings, draw_layout_of, draw_top
from authoring.families.span_choice import (
    PIERS_BETWEEN_SPANS,
    SEVERAL,
    OwnDraws,
    SpanRule,
    SpanSettings,
    draw_spans,
    of_spans,
)
from authoring.parts.abutments import Abutments, abutment_parts, draw_abutments
from authoring.parts.bearings import Bearings, bearing_parts, draw_bearings
from authoring.parts.deck_top import DeckTop, deck_runs, deck_top_parts
from authoring.parts.decks import DeckEdge, DeckEdgeSettings, Haunches, deck_parts, draw_deck_edge
from authoring.parts.drawing import Draws, chosen, draw, draw_whole, drawn
from authoring.parts.fittings import fitting_parts
from authoring.parts.girders import (
    SPAN_TO_DEPTH,
    Girders,
    GirderSettings,
    diaphragm_parts,
    draw_girders,
    girder_parts,
)
from authoring.parts.part import Part
from authoring.parts.pier_choice import PAPER_KINDS_UNDER_CONCRETE
from authoring.parts.piers import Ground, PierNeeds, Piers, draw_piers, pier_parts
from authoring.parts.spans import Levels, Spans
from groundwork.errors import InputError

_SPANS = SpanRule("beam", "concrete girders", 6.0, 60.0, (14.0, 36.0), 0.0, one_row=False)


class BeamSettings(SpanSettings):
    """A concrete beam bridge; omitted values are drawn at random."""

    uses: ClassVar = of_spans("continuous", "end_share")
    shared_uses: ClassVar = PIERS_BETWEEN_SPANS
    spans: tuple[float, ...] = Field(
        default=(),
        max_length=20,
        description="Lengths of the spans, bearing line to bearing line, 6 to 60 each [m]; empty: drawn, the inner "
        "spans equal, 14 to 36, the end spans by `end_share`; in profile paper 10 each",
    )
    span_count: int | None = drawn(1, 4, "Number of spans, if `spans` is empty [1]", le=20, paper=(4, 20))
    end_share: float | None = drawn(0.75, 1.0, "End span over inner span, if `spans` is empty [1]", ge=0.5, le=1.2)
    continuous: bool | None = chosen(
        {True: 35, False: 65}, "The slab is continuous over the piers", among=SEVERAL, paper={False: 1}
    )
    slab: float | None = drawn(0.20, 0.25, "Thickness of the deck slab [m]", ge=0.15, le=1.0, paper=(1.0, 1.0))
    overhang: float | None = drawn(0.32, 0.40, "Length of a girder beyond its bearing line [m]", ge=0.30, le=0.60)
    gap: float | None = drawn(0.03, 0.05, "Width of an expansion gap [m]", ge=0.02, le=0.15)
    edge: DeckEdgeSettings = DeckEdgeSettings()
    girder: GirderSettings = GirderSettings()


@dataclass(frozen=True)
class DrawnBeam:
    """Every drawn parameter of a beam bridge.

    Attributes:
        spans: Stations.
        slab: Thickness of the deck slab [m].
        top: Surfacing, parapets and fittings of the deck.
        edge: Edges of the slab.
        girders: Section and lines of the girders.
        bearings: Pads and plinths.
        piers: Caps, columns, footings.
        abutments: Walls.
    """

    spans: Spans
    slab: float
    top: DeckTop
    edge: DeckEdge
    girders: Girders
    bearings: Bearings
    piers: Piers
    abutments: Abutments

    @property
    def levels(self) -> Levels:
        """Thicknesses from the finished surface down to the seats."""
        return Levels(
            surfacing=self.top.surfacing,
            slab=self.slab,
            girder=self.girders.height,
            pad=self.bearings.pad_height,
            plinth=self.bearings.plinth_height,
        )


def draw_beam(settings: BeamSettings, shared: SharedSettings, draws: Draws) -> tuple[Layout, DrawnBeam]:
    """Draw the values that the user did not set.

    Args:
        settings: Settings of the family.
        shared: Settings of the parts that every family has.
        draws: Random stream and profile of the bridge.

    Returns:
        Layout for the site, and the record that `build_beam` builds from.
    """
    top = draw_top(shared, draws)
    bearings = draw_bearings(shared.bearing, draws)
    abutments = draw_abutments(shared.abutment, bearings, draws)
    spans = _draw_spans(settings, shared.pier.cap == "inverted_t", bearings, draws)
    slab = draw(settings, "slab", draws)
    width = top.width
    longest = float(np.max(np.diff(spans.supports)))
    girders = draw_girders(settings.girder, width, longest, draws)
    if girders.depth > 0.0 and bearings.pad_width > girders.bottom_width:
        raise InputError(
            "wider than the girders' soffit",
            field=f"bridge.bearing.{bearings.kind}_width",
            value=bearings.pad_width,
            allowed=f"at most {girders.bottom_width:g} m",
            hint="Choose a narrower bearing or a wider girder",
        )
    edge = draw_deck_edge(settings.edge, draws)
    carried = PierNeeds(width, girders.lines[-1], bearings, spans)
    piers = draw_piers(shared.pier, carried, draws, paper_kinds=PAPER_KINDS_UNDER_CONCRETE)
    beam = DrawnBeam(spans, slab, top, edge, girders, bearings, piers, abutments)
    needs = AxisNeeds(
        spans.supports, beam.levels.girder_soffit, beam.levels.seat, abutments.wing_length, river_piers=True
    )
    return draw_layout_of(shared, top, needs, draws), beam


def _draw_spans(settings: BeamSettings, apart: bool, bearings: Bearings, draws: Draws) -> Spans:
    def fit(inner: float) -> float:
        if not settings.girder.depth:
            return inner
        shortest, longest = (settings.girder.depth * ratio for ratio in SPAN_TO_DEPTH)
        return round(max(_SPANS.shortest, min(max(inner, shortest), longest)), 3)

    own = OwnDraws(draw_whole(settings, "span_count", draws), fit, apart=apart)
    return draw_spans(_SPANS, settings, own, bearings, draws)


def build_beam(layout: Layout, beam: DrawnBeam, ground: Ground) -> list[Part]:
    """Build every member of a beam bridge.

    Args:
        layout: Axis and supports.
        beam: The drawn record.
        ground: Height of the ground [m], shape (N,), at plan positions [m], shape (N, 2).

    Returns:
        Parts in a fixed order.
    """
    place, spans, levels = layout.alignment, beam.spans, beam.levels
    g = beam.girders
    haunches = Haunches(g.lines, g.top_width, g.haunch)
    parts = deck_parts(beam.top.width, spans, levels, place, edge=beam.edge, haunches=haunches)
    parts += girder_parts(g, spans, levels, place)
    parts += diaphragm_parts(g, spans, levels, place)
    parts += deck_top_parts(beam.top, spans, deck_runs(spans, beam.abutments), place)
    parts += bearing_parts(beam.bearings, g.lines, spans, levels, place, (g.bottom_width, 0.0))
    parts += pier_parts(beam.piers, spans, levels, place, ground)
    parts += abutment_parts(beam.abutments, beam.top.width, spans, levels, place, ground)
    parts += fitting_parts(beam.top.fitted, spans, levels.girder_soffit, place)
    return parts
