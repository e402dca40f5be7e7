"""The family `cable_stayed`: a continuous deck on stays from one or two pylons.

Source: side span about 0.40 of the main span by Jorquera 2016; pylon heights, pitches, slenderness and diameters by
common practice, as listed in Shi, Kim, Narazaki; profile `paper` by the public Random Bridge Generator.
"""

from dataclasses import dataclass, replace

import numpy as np

from authoring.axis.alignment import Layout
from authoring.families.cable_decks import CableSupportedDeck, Supports, cable_deck_levels, draw_supports, support_parts
from authoring.families.shared import SharedSettings, draw_top
from authoring.families.stayed_choices import (
    LEAST_PITCH,
    CableStayedSettings,
    Choice,
    beside_median,
    choose,
    draw_random,
    drawn_main,
    suited_top,
    with_longer_spans,
    with_median,
)
from authoring.families.stayed_elevation import FLATTEST, GAUGE, Frame, NoRoomForStays, fit, leg_size
from authoring.parts.abutments import Abutments, draw_abutments
from authoring.parts.bearings import Bearings, draw_bearings
from authoring.parts.box_decks import CableDeck, bracket_parts, bracket_top, cable_deck_parts, floor_stations
from authoring.parts.cable_forces import deck_load
from authoring.parts.deck_top import DeckTop, deck_runs, deck_top_parts, fitted_to_span
from authoring.parts.drawing import Draws, draw, draw_option
from authoring.parts.gangways import draw_gangways
from authoring.parts.medians import median_parts
from authoring.parts.part import Part
from authoring.parts.piers import Ground, Piers
from authoring.parts.pylons import Pylon, covered_by_pylon
from authoring.parts.spans import Levels, Spans
from authoring.parts.stays import Stays, stay_parts, thickest_stay
from groundwork.errors import InputError

_PORTAL_STRIP = 0.12  # [m] width beside parapets if the stays are anchored on brackets
_LEAST_DEPTH = {"edge_beam": 0.9, "plate_girder": 0.9, "concrete_box": 1.3, "steel_box": 1.1}  # [m]
_MEDIAN_MARGIN = 0.45  # [m] between a mast and the inner edge lines
_DRAWN = (
    "slab",
    "strip",
    "leg",
    "overhang",
    "gap",
    "zone",
    "height_ratio",
    "single_height_ratio",
    "slenderness",
)
_DROP = 6.5  # [m] from a pylon's lower cross beam to the ground, for its proportions
_EACH_LANE = 30.0  # [m] of main span: two lanes below 120 m, four below 180 m
_GROWTH, _GROWTHS = 1.06, 40  # factor and number of lengthenings of a main span that is too short for a requested shape
_ANCHORED, _ANCHOR_PITCH = 40.0, 36.0  # [m] least side span with anchor piers, and their largest distance
_MEDIAN = 1.4  # [m] width for the sockets of a single plane


@dataclass(frozen=True)
class DrawnCableStayed:
    """Every drawn parameter of a cable-stayed bridge.

    Attributes:
        choice: Its kind and its spans.
        spans: Stations.
        top: Surfacing, parapets and fittings of the deck.
        deck: Cross-section.
        strip: Edge strips outside the parapets [m].
        pylon: Elevation of every pylon.
        stays: End points of the stays.
        bearings: Pads and plinths.
        piers: Anchor piers under long side spans.
        abutments: Walls.
        gangways: Whether inspection gangways hang below the deck.
    """

    choice: Choice
    spans: Spans
    top: DeckTop
    deck: CableDeck
    strip: float
    pylon: Pylon
    stays: Stays
    bearings: Bearings
    piers: Piers
    abutments: Abutments
    gangways: bool

    @property
    def levels(self) -> Levels:
        """Thicknesses from the finished surface down to the seats."""
        return cable_deck_levels(self.top, self.deck, self.bearings)

    @property
    def pylons(self) -> tuple[tuple[int, float, int], ...]:
        """Support, station [m] and direction of the main span of every pylon."""
        stations = self.choice.supports[1 : 1 + self.choice.pylons]
        return tuple((self.spans.supports.index(s), s, -1 if number else 1) for number, s in enumerate(stations))


def draw_cable_stayed(
    settings: CableStayedSettings, shared: SharedSettings, draws: Draws
) -> tuple[Layout, DrawnCableStayed]:
    """Draw the values that the user did not set.

    Args:
        settings: Settings of the family.
        shared: Settings of the parts that every family has.
        draws: Random stream and profile of the bridge.

    Returns:
        Layout for the site, and the record that `build_cable_stayed` builds from.
    """
    top = draw_top(shared, draws, suited_top(settings))
    settings = beside_median(settings, shared.roadway)
    bearings = draw_bearings(shared.bearing, draws)
    abutments = draw_abutments(shared.abutment, bearings, draws)
    randoms = draw_random(settings, draws)
    top = fitted_to_span(top, shared, drawn_main(settings, randoms), _EACH_LANE, draws)
    values = {key: draw(settings, key, draws) for key in _DRAWN}
    values["share"] = draws.random()
    make = _Make(settings, values, bearings, draws.profile)
    choice = choose(settings, top, randoms, lambda kind: _fits(make, kind, top))
    choice, top, deck, pylon, stays, strip = _fitted(make, choice, top)
    supports = tuple(sorted((*choice.supports, *_pier_stations(settings, choice, draws))))
    spans = Spans(supports, values["overhang"], values["gap"], continuous=True, one_row=True)
    hung = CableSupportedDeck(top, deck, bearings, abutments)
    layout, piers, walls = draw_supports(settings, shared, hung, spans, draws, main=choice.main, walls=strip + 0.5)
    gangways = draw_gangways(settings, deck, choice.main, draws)
    record = DrawnCableStayed(choice, spans, top, deck, strip, pylon, stays, bearings, piers, walls, gangways)
    heights = ((at, float(layout.alignment.height(np.array(at)))) for _, at, _ in record.pylons)
    blocks = (covered_by_pylon(pylon, at, height) for at, height in heights)
    return replace(layout, blocks=tuple(blocks)), record


def _pier_stations(settings: CableStayedSettings, choice: Choice, draws: Draws) -> tuple[float, ...]:
    """Place the anchor piers, which stiffen long side spans [m]."""
    if not draw_option(settings, "anchor_piers", draws) or choice.side < _ANCHORED:
        return ()
    steps = np.linspace(0.0, choice.side, int(np.ceil(choice.side / _ANCHOR_PITCH)) + 1)[1:-1]
    far = [choice.supports[-1] - s for s in steps[::-1]] if choice.pylons == 2 else []
    return tuple(round(float(s), 3) for s in (*steps, *far))


@dataclass(frozen=True)
class _Make:
    """Drawn values from which a bridge of any kind is fitted.

    Attributes:
        settings: Values set by the user.
        values: Numbers that were drawn.
        bearings: Pads and plinths.
        profile: `default` or `paper`.
    """

    settings: CableStayedSettings
    values: dict[str, float]
    bearings: Bearings
    profile: str


Fitted = tuple[Choice, DeckTop, CableDeck, Pylon, Stays, float]


def _fits(make: _Make, choice: Choice, top: DeckTop) -> bool:
    try:
        return _try(make, choice, top) is not None
    except NoRoomForStays:
        return False


def _try(make: _Make, choice: Choice, top: DeckTop) -> Fitted | None:
    """Fit pylon, stays and deck of one kind and length; None if legs or stays are in the traffic's clearance."""
    values, chamfered = make.values, make.profile != "paper"
    way = with_median(top, _median(choice, values)) if choice.planes == 1 else top
    # The strips are widened later: the deck's transverse span is the road.
    depth = max(choice.main / values["slenderness"], _LEAST_DEPTH[choice.deck], way.width / 15.0)
    deck = _deck(choice, way.width, depth, values, chamfered)
    levels = cable_deck_levels(way, deck, make.bearings)
    found = _elevation(make.settings, choice, way, values, levels)
    if found is None:
        return None
    if make.profile != "paper" and make.settings.stay_diameter is None:
        load = deck_load(way.width + 2.0 * found[2], deck.slab, way.surfacing) / choice.planes
        needed = thickest_stay(load, found[1], found[0])
        if needed > choice.diameter:
            choice = replace(choice, diameter=needed)
            found = _elevation(make.settings, choice, way, values, levels)
            if found is None:
                return None
    pylon, stays, strip = found
    deck = _deck(choice, way.width + 2.0 * strip, depth, values, chamfered, stays.plane)
    return choice, way, deck, pylon, stays, strip


def _fitted(make: _Make, choice: Choice, top: DeckTop) -> Fitted:
    """Fit pylon, stays and deck; a drawn span that is too short for them is lengthened."""
    settings, choice = make.settings, _closer(make, choice, top) if make.settings.main is not None else choice
    longer = choice
    for _ in range(_GROWTHS):
        try:
            found = _try(make, longer, top)
        except NoRoomForStays:
            if settings.main is not None and longer is choice:
                raise
            found = None
        if found is not None and (make.settings.main is None or longer is choice):
            return found
        if found is not None:
            break
        longer = with_longer_spans(longer, _GROWTH)
    other = "mast" if choice.planes == 1 else "portal"
    raise InputError(
        f"leaves no clear width for traffic beside {choice.shape} pylons",
        field="bridge.cable_stayed.main",
        value=choice.main,
        allowed=f"at least {longer.main:g} m here",
        hint=f'Choose a longer main span, or bridge.cable_stayed.shape = "{other}"',
    )


def _closer(make: _Make, choice: Choice, top: DeckTop) -> Choice:
    """Reduce a drawn pitch until a given main span has room for three stays on each side."""
    if make.settings.pitch is not None:
        return choice
    for _ in range(_GROWTHS):
        try:
            _try(make, choice, top)
        except NoRoomForStays:
            if choice.pitch <= LEAST_PITCH:
                break
            choice = replace(choice, pitch=max(round(choice.pitch / _GROWTH, 2), LEAST_PITCH))
        else:
            return choice
    raise InputError(
        "leaves no room for three stays on each side of a pylon",
        field="bridge.cable_stayed.main",
        value=choice.main,
        allowed=f"room for stays at least {LEAST_PITCH:g} m apart",
        hint="Choose a longer main span",
    )


def _median(choice: Choice, values: dict[str, float]) -> float:
    if choice.shape != "mast":
        return _MEDIAN
    frame = Frame(0.0, 0.0, 0.0, 0.0, 0.0, _height(choice, values), values["leg"], 6.0, 0.0)
    return round(leg_size(frame)[0] + 2.0 * _MEDIAN_MARGIN, 2)


def _height(choice: Choice, values: dict[str, float]) -> float:
    return round(choice.main * values["height_ratio" if choice.pylons == 2 else "single_height_ratio"], 2)


def _deck(
    choice: Choice, width: float, depth: float, values: dict[str, float], chamfered: bool, plane: float = 0.0
) -> CableDeck:
    """Design the cross-section: beams under the stays if these are anchored in the deck."""
    slab, share = values["slab"], values["share"]
    below = round(depth - slab, 2)
    half = 0.5 * width
    match choice.deck:
        case "edge_beam" | "plate_girder":
            beam = 0.45 if choice.deck == "plate_girder" else 0.75
            edge = min(plane, half - 0.5 * beam - 0.06) if plane else half - 0.5
            return CableDeck(choice.deck, width, slab, below, round(edge, 3), beam, chamfered)
        case _:
            soffit = (0.44 if choice.deck == "concrete_box" else 0.50) * half * (0.85 + 0.3 * share)
            return CableDeck(choice.deck, width, slab, below, round(soffit, 3), 0.0, chamfered)


def _elevation(
    settings: CableStayedSettings, choice: Choice, top: DeckTop, values: dict[str, float], levels: Levels
) -> tuple[Pylon, Stays, float] | None:
    """Fit pylon and stays; the pylon's height is increased until the outermost stay is steep enough."""
    height = _height(choice, values)
    for _ in range(6):
        foot = _foot(choice, top, levels)
        frame = Frame(
            top.width,
            top.kerb_face,
            GAUGE[top.service],
            foot,
            levels.seat,
            height,
            values["leg"],
            _DROP,
            values["zone"],
        )
        found = fit(choice, frame, _PORTAL_STRIP if choice.shape == "portal" else values["strip"])
        if found is None:
            return None
        pylon, stays, _ = found
        rise, run = stays.heights[-1] - stays.foot, stays.offsets[-1] - pylon.face(stays.heights[-1])
        if np.degrees(np.arctan2(rise, run)) >= FLATTEST or choice.pitch == 0.0:
            return found
        missing = run * float(np.tan(np.radians(FLATTEST + 0.2))) - rise
        key = "height_ratio" if choice.pylons == 2 else "single_height_ratio"
        if getattr(settings, key) is not None:
            raise InputError(
                f"makes the outermost stay flatter than {FLATTEST:g} deg",
                field=f"bridge.cable_stayed.{key}",
                value=getattr(settings, key),
                allowed=f"at least {(height + missing) / choice.main:.3f} here",
                hint="Choose a higher pylon",
            )
        height = round(height + missing, 2)
    return None


def _foot(choice: Choice, top: DeckTop, levels: Levels) -> float:
    if choice.planes == 1:
        assert top.roadway is not None
        return top.roadway.kerb_height
    return bracket_top(levels) if choice.shape == "portal" else -levels.surfacing


def build_cable_stayed(layout: Layout, bridge: DrawnCableStayed, ground: Ground) -> list[Part]:
    """Build every member of a cable-stayed bridge.

    Args:
        layout: Axis and supports.
        bridge: The drawn record.
        ground: Height of the ground [m], shape (N,), at plan positions [m], shape (N, 2).

    Returns:
        Parts in a fixed order.
    """
    place, spans, levels, deck = layout.alignment, bridge.spans, bridge.levels, bridge.deck
    low, high = spans.pieces[0]
    feet = _feet(bridge)
    floor = floor_stations(feet, spans.supports)
    parts = cable_deck_parts(deck, low, high, floor, levels, place)
    if bridge.choice.shape == "portal":
        parts += bracket_parts(deck, bridge.stays.plane + 0.30, feet, levels, place)
    parts += deck_top_parts(bridge.top, spans, deck_runs(spans, bridge.abutments), place)
    if bridge.top.roadway is not None and bridge.choice.planes == 1:
        masts = [(s, bridge.pylon.face(0.0)) for _, s, _ in bridge.pylons if bridge.pylon.shape == "mast"]
        noses = (bridge.top.parapets.terminals, bridge.top.parapets.terminals)
        parts += median_parts(bridge.top.roadway, low, high, tuple(masts), place, noses=noses)
    parts += stay_parts(bridge.stays, bridge.pylon, bridge.pylons, place)
    towers = tuple(station for _, station, _ in bridge.pylons)
    beside = bridge.pylon.face(0.0) + 1.0  # a leg that is inclined over the footway
    supports = Supports(spans, bridge.piers, bridge.pylon, towers, floor, beside, bridge.gangways)
    hung = CableSupportedDeck(bridge.top, deck, bridge.bearings, bridge.abutments)
    return parts + support_parts(hung, supports, place, ground)


def _feet(bridge: DrawnCableStayed) -> tuple[float, ...]:
    side = bridge.stays.side_offsets(bridge.pylon)
    feet = []
    for _, station, main in bridge.pylons:
        feet += [station + main * x for x in bridge.stays.offsets] + [station - main * x for x in side]
    return tuple(sorted(feet))
