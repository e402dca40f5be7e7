"""Settings of an arch bridge in a scenario, and the random draw of the values that all arrangements share."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from authoring.families.alignments import STRAIGHT_AND_SQUARE
from authoring.parts.drawing import Draws, chosen, chosen_by, draw, draw_option, draw_whole, drawn
from authoring.parts.idle_settings import POSITIVE, SEVERAL, Use
from authoring.parts.railings import RailingSettings
from groundwork.settings import Settings

ARRANGEMENTS = {"deck": 0.60, "through": 0.08, "half_through": 0.07, "tied": 0.10, "masonry": 0.15}
ABOVE = ("through", "half_through", "tied")
_DECK_FORMS = {"ring": 0.30, "concrete": 0.45, "steel": 0.25}
_RAILED = ("railing_height", "plinth", "low_wall", *RailingSettings.model_fields)
_LAMPS = ("fittings.lamp_pitch", "fittings.lamp_height", "fittings.lamp_arm")
_FOOTING = ("abutment.footing", "abutment.footing_toe", "abutment.footing_top")
_NOT_ON_MASONRY = ("abutment.seat_margin", *_FOOTING, "abutment.battered", "abutment.batter", "bearing")
_NOT_ABOVE = (*_FOOTING, "fittings.pipe_diameter", "fittings.conduits", "fittings.conduit_diameter")
_THROUGH_FORMS = {"concrete": 0.35, "steel": 0.65}


class MasonrySettings(Settings):
    """A masonry arch bridge with filled spandrels; omitted values are drawn at random."""

    uses: ClassVar = (Use("span_count", SEVERAL, ("pier_ratio", "cutwater")),)
    span_count: int | None = drawn(1, 5, "Number of arches [1]")
    span: float | None = drawn(6.0, 25.0, "Clear span of every arch [m]", ge=4.0, le=35.0)
    rise_ratio: float | None = drawn(0.22, 0.48, "Rise of the intrados over the span [1]", ge=0.15, le=0.5)
    span_to_ring: float | None = drawn(17.0, 26.0, "Span over the thickness of the ring [1]", ge=12.0, le=35.0)
    pier_ratio: float | None = drawn(0.16, 0.26, "Thickness of a pier over the span [1]", ge=0.12, le=0.35)
    crown_fill: float | None = drawn(
        0.30, 0.60, "Depth of the fill over the crown, below the surfacing [m]", ge=0.2, le=1.5
    )
    cutwater: float | None = drawn(0.5, 0.9, "Length of a cutwater over half its width [1]", ge=0.3, le=1.2)
    wall: float | None = drawn(0.45, 0.65, "Thickness of the spandrel walls [m]", ge=0.4, le=1.0)


class AboveSettings(Settings):
    """Main dimensions of an arch that rises above its deck: braces leave room for traffic in every draw."""

    span: float | None = drawn(60.0, 150.0, "Span, springing to springing [m]", ge=40.0, le=250.0)
    span_to_rise: float | None = drawn(3.5, 5.5, "Span over rise [1]", ge=3.0, le=8.0)
    below_deck: float | None = drawn(
        0.15, 0.25, "Part of a half-through arch's rise that is below the road [1]", ge=0.1, le=0.6
    )


class ArchSettings(Settings):
    """An arch bridge; omitted values are drawn at random.

    For arches below the deck the shared `clearance` is kept by the intrados over the middle half of the span, and
    `springing` by the springings; the higher of both decides the level of the deck.
    """

    uses: ClassVar = (
        Use("arrangement", ("deck",), ("span", "span_to_rise", "deck", "bays", "approach")),
        Use("arrangement", ABOVE, ("above.span", "above.span_to_rise", "hanger_pitch", "bracing")),
        Use("arrangement", ("half_through",), ("above.below_deck",)),
        Use("arrangement", ("masonry",), ("masonry",)),
        Use("arrangement", ("deck", *ABOVE), ("form", "span_to_depth", "thickening")),
        Use("arrangement", ("deck", "through", "half_through", "masonry"), ("springing",)),
    )
    shared_uses: ClassVar = (
        Use("", ("beam", "girder", "slab", "cable_stayed", "suspension"), ("pier",)),
        *STRAIGHT_AND_SQUARE,
        Use("arrangement", ("deck",), (*_NOT_ABOVE, "fittings.lamps", *_LAMPS)),
        Use("arrangement", ("deck", *ABOVE), ("parapet.shape",), plain="wall"),
        Use("arrangement", ("deck", *ABOVE), ("fittings", *_NOT_ON_MASONRY, *(f"parapet.{key}" for key in _RAILED))),
        Use("approach", POSITIVE, (*_FOOTING, "abutment.battered", "abutment.batter")),
    )
    arrangement: Literal["deck", "through", "half_through", "tied", "masonry"] | None = chosen(
        ARRANGEMENTS, "Position of the deck", paper={"deck": 1}
    )
    shape: Literal["parabola", "circle", "catenary"] | None = chosen(
        {"parabola": 0.45, "circle": 0.30, "catenary": 0.25}, "Curve of the arch axis", paper={"parabola": 1}
    )
    form: Literal["ring", "concrete", "steel"] | None = chosen_by(
        {"below a deck": _DECK_FORMS, "above a deck": _THROUGH_FORMS},
        "Arch: one concrete ring, only below a deck, or ribs of concrete or steel",
        paper={"ring": 1},
    )
    deck: Literal["slab", "beam_slab", "box"] | None = chosen(
        {"slab": 0.40, "beam_slab": 0.45, "box": 0.15}, "Deck on the spandrel columns", paper={"box": 1}
    )
    span: float | None = drawn(30.0, 150.0, "Span of a deck arch, springing to springing [m]", paper=(100, 100))
    span_to_rise: float | None = drawn(3.0, 8.0, "Span over rise [1]", paper=(4, 4))
    span_to_depth: float | None = drawn(45.0, 70.0, "Span over the depth at the crown [1]", ge=30.0, paper=(50, 50))
    thickening: float | None = drawn(
        1.0, 1.5, "Depth at the springing over depth at the crown [1]", le=2.0, paper=(1, 1)
    )
    bays: int | None = drawn(8, 14, "Number of bays between the springing piers [1]", ge=6, le=20, paper=(10, 10))
    approach: float | None = drawn(
        0.9,
        1.6,
        "Length of the deck beyond each springing pier over the rise, rounded up to whole bays [1]; 0: abutments "
        "behind the springings",
        ge=0.0,
        le=4.0,
        paper=(0, 0),
    )
    springing: float | None = drawn(0.8, 2.5, "Least height of the springings above z = 0 [m]", ge=0.0, le=20.0)
    hanger_pitch: float | None = drawn(
        4.0, 8.0, "Distance between hangers, and between floor beams [m]", ge=3.0, le=10.0
    )
    bracing: Literal["struts", "k"] | None = chosen(
        {"struts": 50, "k": 50}, "Bracing between ribs above a deck: struts alone, or struts with diagonals (k)"
    )
    above: AboveSettings = AboveSettings()
    masonry: MasonrySettings = MasonrySettings()


@dataclass(frozen=True)
class ArchChoice:
    """Values that every arrangement needs.

    Attributes:
        arrangement: A key of ARRANGEMENTS.
        shape: Line of the axis.
        form: `ring`, `concrete` or `steel`.
        deck: `slab`, `beam_slab` or `box`.
        bracing: `struts` or `k`.
        span: Springing to springing [m].
        rise: Of the axis [m].
        depth: At the crown [m].
        springing_depth: At the springings [m].
        bays: Of a deck over spandrel columns.
        approach_bays: Beyond either springing pier.
        springing: Least height of the springings above z = 0 [m].
        hanger_pitch: Wanted distance of hangers [m].
        below_deck: Share of the rise below the road [1].
    """

    arrangement: str
    shape: str
    form: str
    deck: str
    bracing: str
    span: float
    rise: float
    depth: float
    springing_depth: float
    bays: int
    approach_bays: int
    springing: float
    hanger_pitch: float
    below_deck: float


def draw_choice(settings: ArchSettings, draws: Draws) -> ArchChoice:
    """Draw arrangement and main dimensions; every value is drawn, whether the arrangement uses it or not.

    Args:
        settings: Values set by the user.
        draws: Random stream and profile.
    """
    suited = ("deck",) if settings.form == "ring" else None  # no other arrangement has a ring
    arrangement, shape = (
        draw_option(settings, "arrangement", draws, suited=suited),
        draw_option(settings, "shape", draws),
    )
    above = arrangement in ABOVE
    form = draw_option(settings, "form", draws, _THROUGH_FORMS if above else _DECK_FORMS)
    deck, bracing = (draw_option(settings, key, draws) for key in ("deck", "bracing"))
    below_span, below_flatness = draw(settings, "span", draws), draw(settings, "span_to_rise", draws)
    above_span, above_flatness = draw(settings.above, "span", draws), draw(settings.above, "span_to_rise", draws)
    span, flatness = (above_span, above_flatness) if above else (below_span, below_flatness)
    rise = round(span / flatness, 3)
    depth = round(span / draw(settings, "span_to_depth", draws), 3)
    bays = draw_whole(settings, "bays", draws)
    approach = int(np.ceil(draw(settings, "approach", draws) * rise / (span / bays)))
    return ArchChoice(
        arrangement=arrangement,
        shape=shape,
        form=form,
        deck=deck,
        bracing=bracing,
        span=span,
        rise=rise,
        depth=depth,
        springing_depth=round(depth * draw(settings, "thickening", draws), 3),
        bays=bays,
        approach_bays=approach,
        springing=draw(settings, "springing", draws),
        hanger_pitch=draw(settings, "hanger_pitch", draws),
        below_deck=draw(settings.above, "below_deck", draws),
    )
