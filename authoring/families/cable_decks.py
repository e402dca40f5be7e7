"""Common parts of cable-supported decks: their bearings, piers and abutments, and the towers' bases."""

from dataclasses import dataclass, replace

from authoring.axis.alignment import Alignment, Layout
from authoring.families.shared import AxisNeeds, SharedSettings, draw_layout_of
from authoring.parts.abutments import Abutments, abutment_parts
from authoring.parts.bearings import Bearings, bearing_parts
from authoring.parts.box_access import box_access_parts
from authoring.parts.box_decks import CableDeck, deck_pieces
from authoring.parts.deck_top import DeckTop
from authoring.parts.drawing import Draws, draw
from authoring.parts.fittings import CLEAR, fitting_parts
from authoring.parts.gangways import gangway_parts
from authoring.parts.part import Part
from authoring.parts.piers import Ground, PierNeeds, Piers, draw_piers, pier_parts
from authoring.parts.pylons import Pylon, PylonSite, pylon_parts
from authoring.parts.spans import Levels, Spans
from groundwork.settings import Settings


@dataclass(frozen=True)
class CableSupportedDeck:
    """A cable-supported deck, and the supports of its ends.

    Attributes:
        top: Surfacing, parapets and fittings of the deck.
        deck: Cross-section.
        bearings: Pads and plinths.
        abutments: Walls.
    """

    top: DeckTop
    deck: CableDeck
    bearings: Bearings
    abutments: Abutments

    @property
    def levels(self) -> Levels:
        """Thicknesses from the finished surface down to the seats."""
        return cable_deck_levels(self.top, self.deck, self.bearings)


def cable_deck_levels(top: DeckTop, deck: CableDeck, bearings: Bearings) -> Levels:
    """Stack the thicknesses from the finished surface down to the seats.

    Args:
        top: Surfacing, parapets and fittings of the deck.
        deck: Cross-section.
        bearings: Pads and plinths.
    """
    return Levels(top.surfacing, deck.slab, deck.depth, bearings.pad_height, bearings.plinth_height)


def draw_supports(
    settings: Settings,
    shared: SharedSettings,
    hung: CableSupportedDeck,
    spans: Spans,
    draws: Draws,
    *,
    main: float,
    walls: float,
) -> tuple[Layout, Piers, Abutments]:
    """Draw the piers, the clearance below the main span and the axis.

    Args:
        settings: Settings of the family; `air` is the clearance below the main span as a share of its length [1].
        shared: Settings of the parts that every family has.
        hung: The deck.
        spans: Stations.
        draws: Random stream and profile of the bridge.
        main: Length of the main span [m].
        walls: Least thickness of the wing walls: the approaches' parapets stand on them, and their outer faces follow
            the deck's edge [m].

    Returns:
        Layout for the site; the piers; the abutments with such walls.
    """
    deck, levels = hung.deck, hung.levels
    piers = draw_piers(shared.pier, PierNeeds(deck.width, deck.bearing_lines[-1], hung.bearings, spans), draws)
    abutments = replace(hung.abutments, wing_thickness=round(max(hung.abutments.wing_thickness, walls), 3))
    air = draw(settings, "air", draws) * main  # clearance for ships under long spans
    wings = abutments.wing_length
    needs = AxisNeeds(spans.supports, levels.girder_soffit, levels.seat, wings, straight=True, least_clearance=air)
    layout = draw_layout_of(shared, hung.top, needs, draws)
    return replace(layout, width=deck.width), piers, abutments


@dataclass(frozen=True)
class Supports:
    """Substructure of a cable-supported deck.

    Attributes:
        spans: Stations of all bearing lines.
        piers: Piers between towers and abutments, if there are any.
        pylon: Elevation of every tower.
        towers: Stations of the towers [m].
        floor: Stations of the floor beams [m].
        clear: Distance of fittings from the supports [m].
        gangways: Whether inspection gangways hang below the deck.
    """

    spans: Spans
    piers: Piers
    pylon: Pylon
    towers: tuple[float, ...]
    floor: tuple[float, ...]
    clear: float = CLEAR
    gangways: bool = False


def support_parts(hung: CableSupportedDeck, supports: Supports, place: Alignment, ground: Ground) -> list[Part]:
    """Build bearings, towers, piers and abutments, and the attachments of the deck between them.

    Args:
        hung: The deck.
        supports: Its supports.
        place: Axis of the bridge.
        ground: Height of the ground [m], shape (N,), at plan positions [m], shape (N, 2).

    Returns:
        Parts in a fixed order.
    """
    deck, levels, spans, top = hung.deck, hung.levels, supports.spans, hung.top
    parts = bearing_parts(hung.bearings, deck.bearing_lines, spans, levels, place, (deck.beam_width, 0.0))
    for station in supports.towers:
        site = PylonSite(spans.supports.index(station), station, -levels.surfacing, supports.piers.footing_top)
        parts += pylon_parts(supports.pylon, site, place, ground)
    parts += pier_parts(supports.piers, spans, levels, place, ground, supports.towers)
    parts += abutment_parts(hung.abutments, deck.width, spans, levels, place, ground)
    ends = spans.pieces[0]
    pieces = deck_pieces(*ends, supports.floor)
    gangways = gangway_parts(pieces, levels, place, ground, parts) if supports.gangways else []
    parts += fitting_parts(top.fitted, spans, None, place, clear=supports.clear)
    return parts + box_access_parts(deck, *ends, levels, place) + gangways
