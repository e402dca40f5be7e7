"""Decks over bents: a solid slab, a slab on beams, or a box with cantilevers."""

from dataclasses import dataclass

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.bearings import Bearings
from authoring.parts.deck_top import DeckTop
from authoring.parts.decks import deck_parts
from authoring.parts.drawing import Draws
from authoring.parts.part import SUPERSTRUCTURE, Part
from authoring.parts.spans import Levels, Spans
from authoring.shapes.component import F64
from authoring.shapes.sections import cut_corners, mirrored, rectangle
from authoring.solids.extrusion import Prism

_EMBEDDED = 0.010  # [m] embedment of a beam in the slab
_SHORTER = 0.008  # [m] beams are shorter than the slab
_FLANGE = (0.40, 0.03)  # [m] width and thickness of a steel beam's flanges


@dataclass(frozen=True)
class SpandrelDeck:
    """The deck's own structure.

    Attributes:
        form: `slab`, `beam_slab` or `box`.
        material: `concrete` or `steel` beams.
        slab: Thickness of the slab, or of the cantilevers of a box [m].
        girder: Beams below the slab, or the box below its cantilevers [m]; 0 for a solid slab.
        beam_width: Of a beam, or of the box's underside [m].
        lines: Distance of every beam, or of every bearing, to the left of the axis [m].
    """

    form: str
    material: str
    slab: float
    girder: float
    beam_width: float
    lines: tuple[float, ...]

    def levels(self, top: DeckTop, bearings: Bearings) -> Levels:
        """Gather the thicknesses from the finished surface down to the seats.

        Args:
            top: Surfacing, parapets and fittings of the deck.
            bearings: Pads and plinths.
        """
        return Levels(top.surfacing, self.slab, self.girder, bearings.pad_height, bearings.plinth_height)


def draw_spandrel_deck(
    form: str, steel: bool, top: DeckTop, bearings: Bearings, pitch: float, draws: Draws
) -> SpandrelDeck:
    """Draw a deck over bents.

    Args:
        form: `slab`, `beam_slab` or `box`.
        steel: Beams are of steel.
        top: Surfacing, parapets and fittings of the deck.
        bearings: Bearings under its ends.
        pitch: Distance of bents [m].
        draws: Random stream and profile.
    """
    width = top.width
    share, spacing, slab = draws.random(), 2.0 + 1.0 * draws.random(), 0.20 + 0.05 * draws.random()
    pad = bearings.plinth_width
    if form == "box":
        depth = 3.0 if draws.profile == "paper" else max(1.0, pitch / (12.0 + 4.0 * share))
        box = round(0.5 * width, 3)
        edge = 0.5 * box - 0.5 * pad - 0.1
        return SpandrelDeck(
            "box", "concrete", round(slab, 3), round(depth - slab, 3), box, (-round(edge, 3), round(edge, 3))
        )
    if form == "slab":
        thickness = max(0.30, pitch / (18.0 + 6.0 * share))
        outer = 0.36 * width
        lines = np.linspace(-outer, outer, max(2, round(2.0 * outer / 3.2) + 1))
        return SpandrelDeck("slab", "concrete", round(thickness, 3), 0.0, 0.0, _rounded(lines))
    outer = 0.5 * width - 0.9 - 0.4 * share
    lines = np.linspace(-outer, outer, max(2, round(2.0 * outer / spacing) + 1))
    depth = max(0.5, pitch / (13.0 + 5.0 * share))
    beam = max(_FLANGE[0] if steel else 0.35 + 0.1 * share, bearings.pad_width + 0.04)
    return SpandrelDeck(
        "beam_slab", "steel" if steel else "concrete", round(slab, 3), round(depth, 3), round(beam, 3), _rounded(lines)
    )


def spandrel_deck_parts(deck: SpandrelDeck, width: float, spans: Spans, levels: Levels, place: Alignment) -> list[Part]:
    """Build the slab or box of every piece of deck.

    Args:
        deck: Its dimensions.
        width: Overall deck width [m].
        spans: Stations.
        levels: Levels of the deck.
        place: Axis of the bridge.
    """
    if deck.form != "box":
        return deck_parts(width, spans, levels, place)
    parts = []
    for number, (low, high) in enumerate(spans.pieces):
        surface = Prism(_box_outline(deck, width, levels), low, high, "station", place)
        size: dict[str, object] = {
            "length": high - low,
            "width": width,
            "thickness": deck.slab,
            "depth": deck.slab + deck.girder,
        }
        parts.append(Part(f"Deck_{number:03d}", "deck_slab", "Role_DeckConcrete", SUPERSTRUCTURE, surface, size))
    return parts


def deck_beam_parts(deck: SpandrelDeck, spans: Spans, levels: Levels, place: Alignment) -> list[Part]:
    """Build the beams under a slab.

    Args:
        deck: Its dimensions.
        spans: Stations.
        levels: Levels of the deck.
        place: Axis of the bridge.
    """
    if deck.form != "beam_slab":
        return []
    steel = deck.material == "steel"
    kind, role = ("plate_girder", "Role_GirderSteel") if steel else ("concrete_girder", "Role_GirderConcrete")
    outline = i_outline(deck.beam_width, deck.girder + _EMBEDDED) if steel else _concrete_beam(deck)
    parts = []
    for piece, (low, high) in enumerate(spans.pieces):
        for number, line in enumerate(deck.lines):
            shifted = outline + np.array([line, levels.girder_soffit])
            surface = Prism(shifted, low + _SHORTER, high - _SHORTER, "station", place)
            size: dict[str, object] = {
                "length": high - low,
                "width": deck.beam_width,
                "depth": deck.girder,
                "span": piece,
                "line": number,
            }
            parts.append(Part(f"Beam_{piece:03d}_{number:02d}", kind, role, SUPERSTRUCTURE, surface, size))
    return parts


def i_outline(width: float, depth: float, web: float = 0.02, flange: float = _FLANGE[1]) -> F64:
    """Draw a welded steel I around x = 0, its underside at 0.

    Args:
        width: Of both flanges [m].
        depth: Overall [m].
        web: Thickness of the web [m].
        flange: Thickness of the flanges [m].

    Returns:
        Outline [m], shape (12, 2), float64.
    """
    half, thin = 0.5 * width, 0.5 * web
    right = [(half, 0.0), (half, flange), (thin, flange), (thin, depth - flange), (half, depth - flange), (half, depth)]
    return mirrored(right)


def _concrete_beam(deck: SpandrelDeck) -> F64:
    half = 0.5 * deck.beam_width
    outline = rectangle((-half, 0.0), (half, deck.girder + _EMBEDDED))
    return cut_corners(outline, np.array([0.02, 0.02, 0.0, 0.0]))


def _box_outline(deck: SpandrelDeck, width: float, levels: Levels) -> F64:
    half, box = 0.5 * width, 0.5 * deck.beam_width
    web = min(box + 0.25 * deck.girder, half - 0.3)
    right = [
        (box, levels.girder_soffit),
        (web, levels.soffit - 0.15),
        (half, levels.soffit + 0.02),
        (half, -levels.surfacing),
    ]
    return mirrored(right)


def _rounded(lines: F64) -> tuple[float, ...]:
    return tuple(round(float(line), 3) for line in lines)
