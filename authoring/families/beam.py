"""The family `beam`: simply supported spans of a concrete slab on concrete I or T girders.

Source: dimensions by the usual ratios of AASHTO and of standard precast girders, as listed in Shi, Kim, Narazaki and
Khan, Bridge and Highway Structure Rehabilitation and Repair, table 1.2.
"""

from dataclasses import dataclass

import numpy as np
from pydantic import Field

from authoring.alignment import Alignment, Layout
from authoring.families.shared import SharedSettings
from authoring.parts.abutments import Abutments, abutment_parts, approach_range, draw_abutments
from authoring.parts.bearings import Bearings, bearing_parts, draw_bearings
from authoring.parts.decks import deck_parts
from authoring.parts.drawing import draw, draw_whole, drawn
from authoring.parts.girders import Girders, GirderSettings, diaphragm_parts, draw_girders, girder_parts
from authoring.parts.parapets import LEDGE, Parapets, draw_parapets, parapet_parts
from authoring.parts.part import Part
from authoring.parts.piers import Ground, Piers, draw_piers, pier_parts
from authoring.parts.roadway import Roadway, draw_roadway, kerb_parts, surfacing_parts
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
        roadway: Cross-section of the road.
        parapets: Section of the parapets.
        girders: Section and lines of the girders.
        bearings: Pads and plinths.
        piers: Caps, columns, footings.
        abutments: Walls.
    """

    spans: Spans
    slab: float
    roadway: Roadway
    parapets: Parapets
    girders: Girders
    bearings: Bearings
    piers: Piers
    abutments: Abutments

    @property
    def width(self) -> float:
        """Overall deck width [m]."""
        return 2.0 * (self.roadway.half_width + self.parapets.thickness + LEDGE)

    @property
    def levels(self) -> Levels:
        """Thicknesses from the finished surface down to the seats."""
        return Levels(
            surfacing=self.roadway.surfacing,
            slab=self.slab,
            girder=self.girders.depth,
            pad=self.bearings.pad_height,
            plinth=self.bearings.plinth_height,
        )


def draw_beam(settings: BeamSettings, shared: SharedSettings, rng: np.random.Generator) -> tuple[Layout, DrawnBeam]:
    """Draw what the user did not fix.

    Args:
        settings: Settings of the family.
        shared: Settings of the parts that every family has.
        rng: Random stream of the bridge.

    Returns:
        Layout for the site, and the record that `build_beam` builds from.
    """
    roadway = draw_roadway(shared.roadway, rng)
    parapets = draw_parapets(shared.parapet, rng)
    bearings = draw_bearings(shared.bearing, rng)
    abutments = draw_abutments(shared.abutment, bearings, rng)
    spans = _draw_spans(settings, bearings, rng)
    slab = draw(settings, "slab", rng)
    width = 2.0 * (roadway.half_width + parapets.thickness + LEDGE)
    longest = float(np.max(np.diff(spans.supports)))
    girders = draw_girders(settings.girder, width, longest, rng)
    if bearings.pad_width > girders.bottom_width:
        raise InputError(
            "wider than the girders' soffit", field="bridge.bearing.pad_width", value=bearings.pad_width,
            allowed=f"at most {girders.bottom_width:g} m", mend="Make the pad narrower or the girder wider",
        )  # fmt: skip
    piers = draw_piers(shared.pier, width, girders.lines[-1], bearings, spans, rng)
    beam = DrawnBeam(spans, slab, roadway, parapets, girders, bearings, piers, abutments)
    clearance, grade = draw(shared, "clearance", rng), draw(shared, "grade", rng)
    lowest = min(grade * station for station in spans.supports)
    level = round(clearance - beam.levels.girder_soffit - lowest, 3)
    alignment = Alignment(level, grade, float(np.radians(shared.heading)))
    layout = Layout(
        alignment, spans.supports, beam.width, -beam.levels.seat, "road",
        carriageway=2.0 * roadway.kerb_face, edge_line=0.5 * roadway.lanes * roadway.lane_width,
    )  # fmt: skip
    return layout, beam


def _draw_spans(settings: BeamSettings, bearings: Bearings, rng: np.random.Generator) -> Spans:
    count = draw_whole(settings, "span_count", rng)
    overhang, gap = draw(settings, "overhang", rng), draw(settings, "gap", rng)
    low, high = _DRAWN_SPANS
    shares = rng.random(8)  # always eight, so that the number of spans changes nothing that follows
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
    runs = [(f"{span:03d}", spans.ends(span)) for span in range(spans.count)]
    runs += [
        (f"Approach_{number}", approach_range(beam.abutments, spans, support))
        for number, support in enumerate((0, spans.count))
    ]
    parts = deck_parts(beam.width, spans, levels, place)
    parts += girder_parts(beam.girders, spans, levels, place)
    parts += diaphragm_parts(beam.girders, spans, levels, place)
    parts += surfacing_parts(beam.roadway, spans, place)
    for name, (low, high) in runs:
        # A little shorter than the slab, each by its own amount: end faces in one plane would flicker.
        parts += kerb_parts(beam.roadway, name, low + 0.008, high - 0.008, place)
        foot, slab_top = beam.roadway.half_width, -levels.surfacing
        parts += parapet_parts(beam.parapets, foot, slab_top, name, low + 0.004, high - 0.004, place)
    parts += bearing_parts(beam.bearings, beam.girders.lines, spans, levels, place)
    parts += pier_parts(beam.piers, spans, levels, place, ground)
    parts += abutment_parts(beam.abutments, beam.width, spans, levels, place, ground)
    return parts
