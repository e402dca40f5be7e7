"""The family `girder`: a concrete slab on welded steel girders, simple or continuous over the piers.

Source: spans, depths and plates by Shi, Kim, Narazaki and Khan, Bridge and Highway Structure Rehabilitation and Repair,
table 1.2 (plate girders 18 to 91 m); profile `paper`: Random Bridge Generator, whose girder bridges have four lines
1.2 m deep and 1.0 m wide, plates as cross-frames and a pier every 10 m.
"""

from dataclasses import dataclass, replace
from typing import ClassVar

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
from authoring.parts.cross_frames import (
    CrossFrames,
    CrossFrameSettings,
    cross_frame_parts,
    draw_cross_frames,
    floor_fillet_parts,
    frame_stations,
)
from authoring.parts.deck_top import DeckTop, deck_runs, deck_top_parts
from authoring.parts.decks import DeckEdge, DeckEdgeSettings, Haunches, deck_parts, draw_deck_edge
from authoring.parts.drawing import Draws, chosen, draw, draw_option, drawn
from authoring.parts.fittings import fitting_parts
from authoring.parts.idle_settings import Use
from authoring.parts.part import Part
from authoring.parts.piers import Ground, PierNeeds, Piers, draw_piers, pier_parts
from authoring.parts.plate_girders import PlateGirders, girder_parts, splices
from authoring.parts.spans import Levels, Spans
from authoring.parts.splices import splice_parts
from authoring.parts.steel_choice import PlateGirderSettings, draw_plate_girders
from authoring.parts.stiffeners import Stiffening, stiffener_parts

_SPANS = SpanRule("girder", "steel girders", 10.0, 90.0, (22.0, 60.0), 18.0, one_row=True)
_COUNTS = {1: 14.0, 2: 20.0, 3: 26.0, 4: 16.0, 5: 10.0, 6: 6.0, 7: 4.0, 8: 4.0}
_PAPER_COUNTS = (8, 20)
_STIFFENERS = ("frames.stiffeners", "frames.stiffener_pitch", "frames.stiffener")


class SteelGirderSettings(SpanSettings):
    """A steel girder bridge; omitted values are drawn at random."""

    uses: ClassVar = (
        *of_spans("continuous", "end_share", "steel.splices", "steel.splice_share"),
        Use("continuous", (True,), ("steel.splices", "steel.splice_share"), drawn=False),
        Use("steel.arrangement", ("multi", "box"), ("frames.pitch",)),
        Use("steel.arrangement", ("ladder",), ("frames.floor_beam_pitch",)),
        Use("steel.arrangement", ("multi", "ladder"), _STIFFENERS),
        Use("steel.arrangement", ("multi",), ("frames.kind", "frames.plate", "frames.laterals")),
    )
    shared_uses: ClassVar = PIERS_BETWEEN_SPANS
    spans: tuple[float, ...] = Field(
        default=(),
        max_length=20,
        description="Lengths of the spans, bearing line to bearing line, 10 to 90 each [m]; empty: drawn, the inner "
        "spans equal, 22 to 60, the end spans by `end_share`, but at least 18; in profile paper 10 each",
    )
    span_count: int | None = chosen(
        _COUNTS,
        "Number of spans, if `spans` is empty [1]",
        among=f"; in profile paper {_PAPER_COUNTS[0]} to {_PAPER_COUNTS[1]} (the Random Bridge Generator has 50)",
        ge=1,
        le=20,
    )
    end_share: float | None = drawn(0.72, 0.90, "End span over inner span, if `spans` is empty [1]", ge=0.5, le=1.2)
    continuous: bool | None = chosen(
        {True: 70, False: 30}, "Girders and slab are continuous over the piers", among=SEVERAL, paper={False: 1}
    )
    slab: float | None = drawn(0.21, 0.27, "Thickness of the deck slab [m]", ge=0.15, le=1.0, paper=(1.0, 1.0))
    overhang: float | None = drawn(0.34, 0.45, "Length of a girder beyond its bearing line [m]", ge=0.30, le=0.80)
    gap: float | None = drawn(0.03, 0.06, "Width of an expansion gap [m]", ge=0.02, le=0.20)
    edge: DeckEdgeSettings = DeckEdgeSettings()
    steel: PlateGirderSettings = PlateGirderSettings()
    frames: CrossFrameSettings = CrossFrameSettings()


@dataclass(frozen=True)
class DrawnGirder:
    """Every drawn parameter of a steel girder bridge.

    Attributes:
        spans: Stations.
        slab: Thickness of the deck slab [m].
        top: Surfacing, parapets and fittings of the deck.
        edge: Edges of the slab.
        steel: Section and lines of the girders.
        frames: Cross-frames between the girders.
        bearings: Pads or pots, and plinths.
        piers: Caps, columns, footings.
        abutments: Walls.
    """

    spans: Spans
    slab: float
    top: DeckTop
    edge: DeckEdge
    steel: PlateGirders
    frames: CrossFrames
    bearings: Bearings
    piers: Piers
    abutments: Abutments

    @property
    def levels(self) -> Levels:
        """Thicknesses at the abutments, from the finished surface down to the seats."""
        return Levels(
            surfacing=self.top.surfacing,
            slab=self.slab,
            girder=self.steel.fillet + self.steel.depth,
            pad=self.bearings.pad_height,
            plinth=self.bearings.plinth_height,
        )

    @property
    def pier_levels(self) -> Levels:
        """Thicknesses at the piers, where haunched girders are deeper."""
        return replace(self.levels, girder=self.steel.fillet + self.steel.pier_depth)


def draw_girder(settings: SteelGirderSettings, shared: SharedSettings, draws: Draws) -> tuple[Layout, DrawnGirder]:
    """Draw the values that the user did not set.

    Args:
        settings: Settings of the family.
        shared: Settings of the parts that every family has.
        draws: Random stream and profile of the bridge.

    Returns:
        Layout for the site, and the record that `build_girder` builds from.
    """
    top = draw_top(shared, draws)
    bearings = draw_bearings(shared.bearing, draws)
    abutments = draw_abutments(shared.abutment, bearings, draws)
    spans = _draw_spans(settings, shared.pier.cap == "inverted_t", bearings, draws)
    slab, edge = draw(settings, "slab", draws), draw_deck_edge(settings.edge, draws)
    steel = draw_plate_girders(settings.steel, top.width, spans, draws)
    frames = draw_cross_frames(settings.frames, steel, draws)
    piers = draw_piers(shared.pier, PierNeeds(top.width, steel.bearing_lines[-1], bearings, spans), draws)
    girder = DrawnGirder(spans, slab, top, edge, steel, frames, bearings, piers, abutments)
    lowest = (girder.pier_levels if spans.count > 1 else girder.levels).girder_soffit
    needs = AxisNeeds(spans.supports, lowest, girder.levels.seat, abutments.wing_length, river_piers=True)
    return draw_layout_of(shared, top, needs, draws), girder


def _draw_spans(settings: SteelGirderSettings, apart: bool, bearings: Bearings, draws: Draws) -> Spans:
    """Draw the spans: several continuous ones for haunches, and simple ones for caps that need two rows of bearings."""
    haunched = settings.steel.haunch not in (None, "none")
    several = tuple(count for count in _COUNTS if count > 1) if haunched else None
    through = (True,) if haunched else (False,) if apart else None
    count, many = (
        draw_option(settings, "span_count", draws, suited=several),
        int(draws.rng.integers(*_PAPER_COUNTS, endpoint=True)),
    )
    count = many if draws.profile == "paper" and settings.span_count is None else count
    return draw_spans(_SPANS, settings, OwnDraws(count, suited=through, apart=apart), bearings, draws)


def build_girder(layout: Layout, girder: DrawnGirder, ground: Ground) -> list[Part]:
    """Build every member of a steel girder bridge.

    Args:
        layout: Axis and supports.
        girder: The drawn record.
        ground: Height of the ground [m], shape (N,), at plan positions [m], shape (N, 2).

    Returns:
        Parts in a fixed order.
    """
    place, spans, steel, frames = layout.alignment, girder.spans, girder.steel, girder.frames
    levels, piers = girder.levels, girder.pier_levels
    cuts = splices(steel, spans)
    stations = frame_stations(frames, spans, cuts)
    haunches = Haunches(steel.lines, steel.top_width, steel.fillet)
    parts = deck_parts(girder.top.width, spans, levels, place, edge=girder.edge, haunches=haunches)
    parts += floor_fillet_parts(steel, spans, stations, levels, place)
    parts += girder_parts(steel, spans, cuts, levels, place)
    parts += splice_parts(steel, spans, cuts, levels, place)
    if frames.stiffeners:
        stiffening = Stiffening(stations, cuts, frames.stiffener_pitch, frames.stiffener)
        parts += stiffener_parts(steel, spans, stiffening, levels, place)
    parts += cross_frame_parts(frames, steel, spans, stations, levels, place)
    parts += deck_top_parts(girder.top, spans, deck_runs(spans, girder.abutments), place)
    for where, on_piers in ((levels, False), (piers, True)):
        rows = bearing_parts(girder.bearings, steel.bearing_lines, spans, where, place, (steel.bottom_width, 0.0))
        parts += [part for part in rows if (part.parameters["support"] not in (0, spans.count)) == on_piers]
    parts += pier_parts(girder.piers, spans, piers, place, ground)
    parts += abutment_parts(girder.abutments, girder.top.width, spans, levels, place, ground)
    top = girder.top
    return parts + fitting_parts(top.fitted, spans, levels.girder_soffit, place)
