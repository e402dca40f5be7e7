"""The family `suspension`: a deck suspended from two parabolic cables over two portal towers.

Source: sag 1:8 to 1:12, side spans 1:4 with straight backstays and up to 1:2 where suspended, after Structural Steel
Designer's Handbook, section 15; hangers and diameters by common practice; profile `paper` by the public Random Bridge
Generator.
"""

from dataclasses import dataclass, replace

import numpy as np

from authoring.axis.alignment import Layout
from authoring.axis.road_section import ABUTMENT_BACK
from authoring.families.cable_decks import CableSupportedDeck, Supports, cable_deck_levels, draw_supports, support_parts
from authoring.families.shared import SharedSettings, draw_top
from authoring.families.stayed_elevation import GAUGE
from authoring.families.suspension_choices import (
    SuspensionChoice,
    SuspensionSettings,
    check_sag,
    choose_suspension,
    hanger_stations,
)
from authoring.parts.abutments import Abutments, draw_abutments
from authoring.parts.bearings import Bearings, draw_bearings
from authoring.parts.box_decks import CableDeck, bracket_parts, bracket_top, cable_deck_parts, floor_stations
from authoring.parts.cable_forces import deck_load, hanger_diameter, main_cable
from authoring.parts.deck_top import DeckTop, deck_runs, deck_top_parts, fitted_to_span
from authoring.parts.drawing import Draws, draw
from authoring.parts.gangways import draw_gangways
from authoring.parts.part import Part
from authoring.parts.piers import Ground, Piers
from authoring.parts.pylons import Pylon, covered_by_pylon
from authoring.parts.spans import Levels, Spans
from authoring.parts.suspension_cables import (
    SuspensionCables,
    cable_parts,
    clear_of_saddle,
    least_pitch,
    saddle_depth,
    saddle_length,
)

_STRIP = 0.12  # [m] of deck outside the parapets
_LEG_GAP = 0.35  # [m] between deck and tower leg
_TIP = 0.30  # [m] length of a bracket outside the cable's plane
_ENTRY = -0.6  # [m] height where the cables enter the anchor blocks
_BEHIND = 1.6  # [m] distance of anchor blocks behind the abutments' backs
_LEAST_DEPTH = {"steel_box": 1.0, "plate_girder": 0.9}  # [m]
_STRUTS = 11.0  # [m] least distance between a tower's struts
_EACH_LANE = 40.0  # [m] of main span: two lanes below 160 m, four below 240 m
_BESIDE_SADDLE = 0.1  # [m] least length of a tower's top beyond its saddle, on both sides together
_MOST_PITCH = 1.25  # largest distance between hangers over the wanted one: 2.5 of these are two bays [1]
_FREE = 26.0  # [m] longest span between tower, piers and abutment without hangers


@dataclass(frozen=True)
class DrawnSuspension:
    """Every drawn parameter of a suspension bridge.

    Attributes:
        choice: Its kind and its spans.
        spans: Stations of all bearing lines.
        top: Surfacing, parapets and fittings of the deck.
        deck: Cross-section.
        tower: Elevation of both towers.
        cables: Main cables and hangers.
        bearings: Pads and plinths.
        piers: Piers under side spans without hangers.
        abutments: Walls.
        gangways: Whether inspection gangways hang below the deck.
    """

    choice: SuspensionChoice
    spans: Spans
    top: DeckTop
    deck: CableDeck
    tower: Pylon
    cables: SuspensionCables
    bearings: Bearings
    piers: Piers
    abutments: Abutments
    gangways: bool

    @property
    def levels(self) -> Levels:
        """Thicknesses from the finished surface down to the seats."""
        return cable_deck_levels(self.top, self.deck, self.bearings)


def draw_suspension(
    settings: SuspensionSettings, shared: SharedSettings, draws: Draws
) -> tuple[Layout, DrawnSuspension]:
    """Draw the values that the user did not set.

    Args:
        settings: Settings of the family.
        shared: Settings of the parts that every family has.
        draws: Random stream and profile of the bridge.

    Returns:
        Layout for the site, and the record that `build_suspension` builds from.
    """
    top = draw_top(shared, draws)
    bearings = draw_bearings(shared.bearing, draws)
    abutments = draw_abutments(shared.abutment, bearings, draws)
    choice = choose_suspension(settings, draws)
    top = fitted_to_span(top, shared, choice.main, _EACH_LANE, draws)
    slab, leg = draw(settings, "slab", draws), draw(settings, "leg", draws)
    overhang, gap = draw(settings, "overhang", draws), draw(settings, "gap", draws)
    deck = _deck(choice, top.width + 2.0 * _STRIP, slab, draws.random(), draws.profile != "paper")
    levels = cable_deck_levels(top, deck, bearings)
    check_sag(settings, choice)
    pull = 0.0
    if draws.profile == "default":
        load = 0.5 * deck_load(deck.width, deck.slab, top.surfacing)
        pull, choice = _sized(choice, load, settings.hanger_diameter)
    tower = _tower(choice, deck.width, levels.seat, leg, GAUGE[top.service])
    cables = replace(_cables(choice, tower, bracket_top(levels), settings.pitch is None), pull=pull)
    piers_at = _pier_stations(choice)
    spans = Spans(tuple(sorted((*choice.supports, *piers_at))), overhang, gap, continuous=True, one_row=True)
    hung = CableSupportedDeck(top, deck, bearings, abutments)
    layout, piers, walls = draw_supports(settings, shared, hung, spans, draws, main=choice.main, walls=_STRIP + 0.45)
    towers = tuple(covered_by_pylon(tower, at, float(layout.alignment.height(np.array(at)))) for at in cables.towers)
    blocks = (*towers, *cables.blocks)
    layout = replace(layout, anchorages=_BEHIND + cables.block_length, blocks=blocks)
    gangways = draw_gangways(settings, deck, choice.main, draws)
    record = DrawnSuspension(choice, spans, top, deck, tower, cables, bearings, piers, walls, gangways)
    return layout, record


def _deck(choice: SuspensionChoice, width: float, slab: float, share: float, chamfered: bool) -> CableDeck:
    """Choose the cross-section's depth: from the drawn slenderness, but enough to build and to span across."""
    free = 0.0 if choice.suspended else min(choice.side, _FREE) / 22.0
    depth = max(choice.main / choice.slenderness, _LEAST_DEPTH[choice.deck], width / 15.0, free)
    below, half = round(depth - slab, 2), 0.5 * width
    if choice.deck == "plate_girder":
        return CableDeck("plate_girder", width, slab, below, round(half - 0.75, 3), 0.45, chamfered)
    return CableDeck("steel_box", width, slab, below, round(half * (0.45 + 0.2 * share), 3), 0.0, chamfered)


def _tower(choice: SuspensionChoice, width: float, seat: float, leg: float, gauge: float) -> Pylon:
    """Choose the towers' dimensions: vertical legs in the cables' planes, inclined outwards below the deck."""
    top = choice.crown - saddle_depth(choice.cable)
    length = round(max(leg * (0.70 + 0.032 * (top + 8.0)), saddle_length(choice.cable) + _BESIDE_SADDLE), 2)
    across = round(max(0.75 * length, 0.8), 2)
    plane = 0.5 * width + _LEG_GAP + 0.5 * across
    beam = round(0.7 + 0.055 * 2.0 * plane, 2)
    return Pylon(
        shape="portal",
        top=top,
        seat=seat,
        knee=seat - beam,
        merge=0.5 * top,
        knee_line=round(plane, 3),
        merge_line=round(plane, 3),
        foot_lean=0.04,
        width=across,
        length=length,
        beam_depth=beam,
        upper_beams=_struts(top, beam, gauge),
        prefix="Tower",
    )


def _struts(top: float, beam: float, gauge: float) -> tuple[float, ...]:
    """Place the struts above the deck: one at the top, more between in tall towers, none in the clearance gauge."""
    highest, lowest = top - 0.4 * beam - 0.10, gauge + 0.3 + 0.4 * beam
    if highest < lowest:
        return ()
    return tuple(
        float(h) for h in np.linspace(highest, lowest, max(1, int((highest - lowest) // _STRUTS)) + 1)[:-1][::-1]
    )


def _sized(choice: SuspensionChoice, load: float, hanger: float | None) -> tuple[float, SuspensionChoice]:
    """Thicken cables and hangers until they carry half the deck [kN/m]; also the horizontal force in a cable [kN]."""
    sag, back = choice.crown - choice.low, choice.side + ABUTMENT_BACK + _BEHIND
    steepest = max(4.0 * sag / choice.main, (choice.crown - _ENTRY + 4.0 * _side_sag(choice)) / back)
    cable = main_cable(load, choice.main, sag, steepest, choice.cable)
    hanger = hanger or max(choice.hanger, hanger_diameter(load, _MOST_PITCH * choice.pitch))
    return cable.pull, replace(choice, cable=cable.diameter, hanger=hanger)


def _side_sag(choice: SuspensionChoice) -> float:
    """Find the sag of the side spans' cables [m]: that of the same force under the same load, 0 without hangers."""
    return round((choice.crown - choice.low) * (choice.side / choice.main) ** 2, 3) if choice.suspended else 0.0


def _cables(choice: SuspensionChoice, tower: Pylon, foot: float, drawn_pitch: bool) -> SuspensionCables:
    _, first, last, total = choice.supports
    back = ABUTMENT_BACK + _BEHIND
    clear = max(0.5 * tower.length + max(0.8, 0.35 * choice.pitch), clear_of_saddle(choice.cable))
    least = least_pitch(choice.cable)
    main = hanger_stations(first + clear, last - clear, choice.pitch, least, drawn_pitch=drawn_pitch)
    side: tuple[float, ...] = ()
    if choice.suspended:
        side = hanger_stations(clear, first - clear, choice.pitch, least, drawn_pitch=drawn_pitch)
    cables = SuspensionCables(
        tower.merge_line,
        (first, last),
        (-back, total + back),
        choice.crown,
        choice.low,
        _ENTRY,
        _side_sag(choice),
        choice.cable,
        choice.hanger,
        foot,
        main,
        (),
    )
    # A hanger needs room for its clamp and its socket.
    lowest = foot + 0.9 + 2.0 * choice.cable
    side = tuple(s for s in side if float(cables.height(np.array([s]))[0]) > lowest)
    return replace(cables, side_hangers=(*side, *(round(total - s, 6) for s in reversed(side))))


def _pier_stations(choice: SuspensionChoice) -> tuple[float, ...]:
    """Place piers under side spans without hangers."""
    _, first, last, _ = choice.supports
    bays = 1 if choice.suspended else int(np.ceil(choice.side / _FREE))
    steps = np.linspace(0.0, choice.side, bays + 1)[1:-1]
    return tuple(round(float(s), 3) for s in (*steps, *(last + first - steps[::-1])))


def build_suspension(layout: Layout, bridge: DrawnSuspension, ground: Ground) -> list[Part]:
    """Build every member of a suspension bridge.

    Args:
        layout: Axis and supports.
        bridge: The drawn record.
        ground: Height of the ground [m], shape (N,), at plan positions [m], shape (N, 2).

    Returns:
        Parts in a fixed order.
    """
    place, spans, levels, deck, cables = layout.alignment, bridge.spans, bridge.levels, bridge.deck, bridge.cables
    low, high = spans.pieces[0]
    hung = tuple(sorted((*cables.main_hangers, *cables.side_hangers)))
    floor = floor_stations(hung, spans.supports)
    parts = cable_deck_parts(deck, low, high, floor, levels, place)
    parts += bracket_parts(deck, cables.plane + _TIP, hung, levels, place)
    parts += deck_top_parts(bridge.top, spans, deck_runs(spans, bridge.abutments), place)
    parts += cable_parts(cables, place, ground)
    hung = CableSupportedDeck(bridge.top, deck, bridge.bearings, bridge.abutments)
    supports = Supports(spans, bridge.piers, bridge.tower, cables.towers, floor, gangways=bridge.gangways)
    return parts + support_parts(hung, supports, place, ground)
