"""The family `beam`: simply supported spans of a concrete slab on concrete I or T girders.

Source: dimensions by the usual ratios of AASHTO and of standard precast girders, as listed in Shi, Kim, Narazaki and
Khan, Bridge and Highway Structure Rehabilitation and Repair, table 1.2.
"""

from dataclasses import dataclass

import numpy as np
from pydantic import Field

from authoring.alignment import Layout
from authoring.families.shared import SharedSettings, draw_layout_of
from authoring.parts.abutments import Abutments, abutment_parts, draw_abutments
from authoring.parts.bearings import Bearings, bearing_parts, draw_bearings
from authoring.parts.deck_top import DeckTop, deck_runs, deck_top_parts, draw_deck_top
from authoring.parts.decks import deck_parts
from authoring.parts.drawing import Draws, draw, draw_whole, drawn
from authoring.parts.girders import Girders, GirderSettings, diaphragm_parts, draw_girders, girder_parts
from authoring.parts.part import Part
from authoring.parts.piers import Ground, Piers, draw_piers, pier_parts
from authoring.parts.spans import Levels, Spans
from groundwork.errors import InputError
from groundwork.settings import Settings

SHORTEST_SPAN, LONGEST_SPAN = 6.0, 60.0  # [m] that a user may ask for
_DRAWN_SPANS = (12.0, 30.0)  # [m]


class BeamSettings(Settings):
    """A concrete beam bridge; what is left out is drawn."""

    spans: tuple[float, ...] = Field(
        default=(18.0, 22.0),
        max_length=8,
        description="Bearing line to bearing line [m], 6 to 60 each; empty: drawn, 12 to 30",
    )
    span_count: int | None = drawn(1, 4, "Number of spans where they are drawn [1]", le=8)
    slab: float | None = drawn(0.20, 0.25, "Deck slab [m]", ge=0.15, le=0.40)
    overhang: float | None = drawn(0.32, 0.40, "Girder beyond its bearing line [m]", ge=0.30, le=0.60)
    gap: float | None = drawn(0.03, 0.05, "Expansion gap [m]", ge=0.02, le=0.15)
    girder: GirderSettings = GirderSettings()


@dataclass(frozen=True)
class DrawnBeam:
    """Every drawn parameter of a beam bridge.

    Attributes:
        spans: Stations.
        slab: Thickness of the deck slab [m].
        top: What lies on the deck.
        girders: Section and lines of the girders.
        bearings: Pads and plinths.
        piers: Caps, columns, footings.
        abutments: Walls.
    """

    spans: Spans
    slab: float
    top: DeckTop
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
            girder=self.girders.depth,
            pad=self.bearings.pad_height,
            plinth=self.bearings.plinth_height,
        )


def draw_beam(settings: BeamSettings, shared: SharedSettings, draws: Draws) -> tuple[Layout, DrawnBeam]:
    """Draw what the user did not fix.

    Args:
        settings: Settings of the family.
        shared: Settings of the parts that every family has.
        draws: Random stream and profile of the bridge.

    Returns:
        Layout for the site, and the record that `build_beam` builds from.
    """
    top = draw_deck_top(shared, draws)
    bearings = draw_bearings(shared.bearing, draws)
    abutments = draw_abutments(shared.abutment, bearings, draws)
    spans = _draw_spans(settings, bearings, draws)
    slab = draw(settings, "slab", draws)
    width = top.width
    longest = float(np.max(np.diff(spans.supports)))
    girders = draw_girders(settings.girder, width, longest, draws)
    if bearings.pad_width > girders.bottom_width:
        raise InputError(
            "wider than the girders' soffit", field="bridge.bearing.pad_width", value=bearings.pad_width,
            allowed=f"at most {girders.bottom_width:g} m", mend="Make the pad narrower or the girder wider",
        )  # fmt: skip
    piers = draw_piers(shared.pier, width, girders.lines[-1], bearings, spans, draws)
    beam = DrawnBeam(spans, slab, top, girders, bearings, piers, abutments)
    layout = draw_layout_of(shared, top, spans.supports, beam.levels.girder_soffit, beam.levels.seat, draws)
    return layout, beam


def _draw_spans(settings: BeamSettings, bearings: Bearings, draws: Draws) -> Spans:
    count = draw_whole(settings, "span_count", draws)
    overhang, gap = draw(settings, "overhang", draws), draw(settings, "gap", draws)
    low, high = _DRAWN_SPANS
    shares = draws.rng.random(8)  # always eight, so that the number of spans changes nothing that follows
    lengths = settings.spans or tuple(round(float(low + (high - low) * share), 1) for share in shares[:count])
    for length in lengths:
        if not SHORTEST_SPAN <= length <= LONGEST_SPAN:
            raise InputError(
                "a span that concrete girders do not have", field="bridge.beam.spans", value=length,
                allowed=f"{SHORTEST_SPAN:g} to {LONGEST_SPAN:g} m", mend="Correct this span",
            )  # fmt: skip
    # A plinth stays under its own span's girder end.
    overhang = max(overhang, round(0.5 * bearings.plinth_length + 0.02, 3))
    supports = tuple(round(float(station), 3) for station in np.cumsum([0.0, *lengths]))
    return Spans(supports, overhang, gap)


def build_beam(layout: Layout, beam: DrawnBeam, ground: Ground) -> list[Part]:
    """Build every member of a beam bridge.

    Args:
        layout: Axis and supports.
        beam: What was drawn.
        ground: Height of the ground [m], shape (N,), at plan positions [m], shape (N, 2).

    Returns:
        Parts in their lasting order.
    """
    place, spans, levels = layout.alignment, beam.spans, beam.levels
    parts = deck_parts(beam.top.width, spans, levels, place)
    parts += girder_parts(beam.girders, spans, levels, place)
    parts += diaphragm_parts(beam.girders, spans, levels, place)
    parts += deck_top_parts(beam.top, spans, deck_runs(spans, beam.abutments), place)
    parts += bearing_parts(beam.bearings, beam.girders.lines, spans, levels, place)
    parts += pier_parts(beam.piers, spans, levels, place, ground)
    parts += abutment_parts(beam.abutments, beam.top.width, spans, levels, place, ground)
    return parts
