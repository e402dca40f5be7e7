"""Deck arches with open spandrels: ring or ribs below, columns and crossheads, a deck that continues over the banks."""

from dataclasses import dataclass, replace

import numpy as np

from authoring.axis.alignment import Alignment, Layout
from authoring.families.arch_settings import ArchChoice
from authoring.families.shared import AxisNeeds, SharedSettings, draw_layout_of, draw_top
from authoring.parts.abutments import Abutments, abutment_parts, draw_abutments
from authoring.parts.arch_axis import ArchAxis, Rib
from authoring.parts.arches import RibSection, rib_parts, skewback_face, skewback_part, skewback_stations, strut_parts
from authoring.parts.bearings import Bearings, bearing_parts, draw_bearings
from authoring.parts.deck_top import DeckTop, deck_runs, deck_top_parts
from authoring.parts.drawing import Draws
from authoring.parts.fittings import fitting_parts
from authoring.parts.footings import Founding
from authoring.parts.part import Part
from authoring.parts.piers import Ground
from authoring.parts.spandrel_decks import SpandrelDeck, deck_beam_parts, draw_spandrel_deck, spandrel_deck_parts
from authoring.parts.spandrels import Bents, CapPlace, bent_footing, foot_on, pier_bent_parts, spandrel_parts
from authoring.parts.spans import Levels, Spans, level_at
from authoring.shapes.component import F64
from groundwork.errors import InputError

FOUNDING = 1.2  # [m] depth of blocks and footings below the lowest ground at them
_SHOWS = 0.4  # [m] visible height of a springing's block
_LEAST_COLUMN = 0.25  # [m]
_COLUMNS = (0.55, 2.6)  # [m] size of columns along the bridge: the tallest are up to 20 times as tall as thick
_BELOW = 5.0  # [m] approximate height of the tallest columns above the rise
_RIB_SLENDERNESS = 20.0  # [1] of the tallest columns across the bridge, where ribs carry them
_INTO_DECK = 0.008  # [m] depth of a cross-head in the deck
_ROOM = 0.25  # [m] space on a block before and behind the pier on it
_APART, _LEAST_MARGIN = 0.05, 0.10  # [m] between footings, blocks and abutments; of a footing beyond its columns


@dataclass(frozen=True)
class DrawnDeckArch:
    """Every drawn parameter of a deck arch.

    Attributes:
        rib: Axis and depths.
        section: Ring or ribs.
        bents: Columns and cross-heads, including those of piers.
        pitch: Distance of bents [m].
        bent_stations: Bents on the arch [m].
        pier_stations: Piers on footings beyond the springings [m].
        slab: The deck's own structure.
        spans: Pieces of deck: over the arch, and over the banks.
        top: Surfacing, parapets and fittings of the deck.
        bearings: Under the ends of every piece of deck.
        abutments: At the ends of the bridge.
    """

    rib: Rib
    section: RibSection
    bents: Bents
    pitch: float
    bent_stations: tuple[float, ...]
    pier_stations: tuple[float, ...]
    slab: SpandrelDeck
    spans: Spans
    top: DeckTop
    bearings: Bearings
    abutments: Abutments

    @property
    def levels(self) -> Levels:
        """Thicknesses from the finished surface down to the seats."""
        return self.slab.levels(self.top, self.bearings)

    @property
    def footing_room(self) -> float:
        """From the middle of a pier on the banks to the footing, block or abutment beside it, at least [m]."""
        return _footing_room(self.pitch, self.bents, self.abutments)

    @property
    def reach(self) -> float:
        """Half the length of the springings' blocks across the bridge [m]."""
        ribs, columns = (max(lines.lines) + 0.5 * lines.width for lines in (self.section, self.bents))
        return max(ribs, columns) + 1.0

    @property
    def behind(self) -> float:
        """Length of the springings' blocks behind their faces [m]."""
        return 2.0 * _ROOM + self.bents.length if len(self.spans.supports) > 2 else 1.0 + 0.01


def draw_deck_arch(choice: ArchChoice, shared: SharedSettings, draws: Draws) -> tuple[Layout, DrawnDeckArch]:
    """Draw a deck arch.

    Args:
        choice: Main dimensions.
        shared: Settings of the parts that every family has.
        draws: Random stream and profile of the bridge.
    """
    top = draw_top(shared, draws)
    bearings = draw_bearings(shared.bearing, draws)
    abutments = draw_abutments(shared.abutment, bearings, draws)
    if choice.approach_bays == 0:  # walls stand behind the springings' blocks
        abutments = replace(abutments, footing_toe=0.0, footing_top=0.0, batter=0.0)
    section = _draw_section(choice, top.width, draws)
    slab = draw_spandrel_deck(choice.deck, choice.form == "steel", top, bearings, choice.span / choice.bays, draws)
    bents = _draw_bents(choice, section, slab, top.width, draws)
    stub = 0.35 + 0.4 * draws.random()
    arch = ArchAxis(choice.shape, choice.span, choice.rise)
    under = slab.levels(top, bearings).girder_soffit - bents.cap_depth - stub - 0.5 * choice.depth
    rib = Rib(arch, 0.0, under - choice.rise, 0.0, choice.depth, choice.springing_depth)
    rib, supports, pitch = _rib_and_supports(rib, choice, bents, abutments)
    if choice.approach_bays > 1:
        _check_banks(choice, pitch, bents, abutments)
    overhang = max(0.32, round(0.5 * bearings.plinth_length + 0.02, 3))
    spans = Spans(supports, overhang, 0.04)
    first, last = (supports[0], supports[-1]) if len(supports) == 2 else (supports[1], supports[2])
    inner = tuple(first + pitch * k for k in range(1, choice.bays))
    outer = tuple(pitch * k for k in range(1, choice.approach_bays))
    outer += tuple(last + pitch * k for k in range(1, choice.approach_bays))
    drawn = DrawnDeckArch(rib, section, bents, pitch, inner, outer, slab, spans, top, bearings, abutments)
    seat = drawn.levels.seat
    soffit = float(rib.intrados(np.array([rib.start + 0.25 * choice.span]))[0])
    needs = AxisNeeds(supports, soffit, seat, abutments.wing_length, straight=True)
    layout = draw_layout_of(shared, top, needs, draws)
    drawn = replace(drawn, rib=_lowered(drawn, layout.alignment))
    sides = -drawn.reach, drawn.reach
    blocks = [(*skewback_stations(drawn.rib, end, drawn.behind), *sides) for end in (0, 1)]
    layout = replace(layout, blocks=tuple(blocks))
    return with_springing_ground(raised(layout, drawn.rib, choice.springing), drawn.rib), drawn


def raised(layout: Layout, rib: Rib, springing: float) -> Layout:
    """Lift a bridge until its springings lie high enough.

    Args:
        layout: Axis, high enough for the clearance.
        rib: Heights relative to the road at mid-span.
        springing: Least height of the springings above z = 0 [m].
    """
    lowest = level_at(layout.alignment, rib.middle).level + rib.base
    level = layout.alignment.level + max(0.0, springing - lowest)
    return replace(layout, alignment=replace(layout.alignment, level=round(level, 3)))


def with_springing_ground(layout: Layout, rib: Rib) -> Layout:
    """Return the height of the ground that the springings need: just below the lower edge of their faces.

    Args:
        layout: Axis at its last height.
        rib: Heights relative to the road at mid-span.
    """
    level = level_at(layout.alignment, rib.middle).level
    corners = [skewback_face(rib, end)[1] for end in (0, 1)]
    feet = tuple((round(float(s), 3), round(level + float(above) - _SHOWS, 3)) for s, above in corners)
    return replace(layout, feet=feet)


def build_deck_arch(layout: Layout, arch: DrawnDeckArch, ground: Ground) -> list[Part]:
    """Build a deck arch.

    Args:
        layout: Axis and supports.
        arch: The drawn record.
        ground: Height of the ground [m], shape (N,), at plan positions [m], shape (N, 2).
    """
    place, spans, levels = layout.alignment, arch.spans, arch.levels
    middle = level_at(place, arch.rib.middle)
    kind = "arch_ring" if len(arch.section.lines) == 1 else "arch_rib"
    parts = spandrel_deck_parts(arch.slab, arch.top.width, spans, levels, place)
    parts += deck_beam_parts(arch.slab, spans, levels, place)
    parts += deck_top_parts(arch.top, spans, deck_runs(spans, arch.abutments), place)
    parts += rib_parts(arch.rib, arch.section, kind, middle)
    if len(arch.section.lines) > 1:
        size = (round(0.45 * arch.rib.depth, 3), round(0.6 * arch.rib.depth, 3))
        parts += strut_parts(arch.rib, arch.section, list(arch.bent_stations), size, middle)
    parts += _bent_parts(arch, place, middle)
    parts += bearing_parts(arch.bearings, arch.slab.lines, spans, levels, place)
    parts += _pier_parts(arch, place, middle, ground)
    parts += abutment_parts(arch.abutments, arch.top.width, spans, levels, place, ground)
    parts += fitting_parts(arch.top.fitted, spans, levels.girder_soffit, place)
    return parts


def _draw_section(choice: ArchChoice, width: float, draws: Draws) -> RibSection:
    ring_share, rib_share, spread = draws.random(), draws.random(), draws.random()
    sharp = 0.0 if draws.profile == "paper" else 0.025
    if choice.form == "ring":
        ring = 10.0 if draws.profile == "paper" else round((0.60 + 0.20 * ring_share) * width, 3)
        return RibSection("concrete", ring, (0.0,), sharp)
    count = 2 if width <= 15.0 else (3 if width <= 22.0 else 4)
    outer = (0.28 + 0.06 * spread) * width
    least = max(0.9, (choice.rise + _BELOW) / _RIB_SLENDERNESS + 0.16)  # least width for the tallest columns
    most = min(2.6, 1.2 * outer / (count - 1))
    rib = min(max(choice.depth * (0.7 + 0.5 * rib_share), least), most)
    lines = tuple(round(float(line), 3) for line in np.linspace(-outer, outer, count))
    return RibSection(choice.form, round(rib, 3), lines, 0.0 if choice.form == "steel" else sharp)


def _draw_bents(choice: ArchChoice, section: RibSection, slab: SpandrelDeck, width: float, draws: Draws) -> Bents:
    paper, ring = draws.profile == "paper", len(section.lines) == 1
    shape = draws.choose({"rectangular": 0.7, "round": 0.3})
    slender, depth, taper = draws.random(), 0.6 + 0.35 * draws.random(), 0.3 * draws.random()
    length = float(np.clip((choice.rise + _BELOW) / (14.0 + 4.0 * slender), *_COLUMNS))
    count = max(2, int(np.ceil(0.5 * width / 6.5)) + 1)
    lines = np.linspace(-0.25 * width, 0.25 * width, count) if ring else np.array(section.lines)
    across = min(1.3 * length, section.width - 0.16) if not ring else 1.3 * length
    round_ = shape == "round" and choice.form != "steel" and not paper
    if round_:
        length = across = min(across, 1.15 * length)
    cap = 2.0 * max(max(slab.lines) + 0.45, float(lines.max()) + 0.5 * across + 0.15)
    depth = 0.5 if paper else depth
    return Bents(
        shape="round" if round_ else "rectangular",
        length=round(length, 3),
        width=round(across, 3),
        lines=tuple(round(float(line), 3) for line in lines),
        cap_length=round(min(cap, width - 0.1), 3),
        cap_depth=round(depth, 3),
        cap_end_depth=round(depth * (1.0 if paper else 1.0 - taper), 3),
        chamfer=0.0 if paper else 0.02,
        footing_top=0.3 if paper else -0.4,
        role="Role_GirderSteel" if choice.form == "steel" else "Role_PierConcrete",
    )


def _rib_and_supports(
    rib: Rib, choice: ArchChoice, bents: Bents, abutments: Abutments
) -> tuple[Rib, tuple[float, ...], float]:
    """Find the stations of springings, supports and bents."""
    behind = -float(skewback_face(rib, 0)[0][0])  # from the springing back to the upper corner of its face
    if choice.approach_bays == 0:
        start = abutments.front + 1.0 + behind
        total = round(choice.span + 2.0 * start, 3)
        return replace(rib, start=start), (0.0, total), total / choice.bays
    offset = behind + _ROOM + 0.5 * bents.length
    pitch = round((choice.span + 2.0 * offset) / choice.bays, 3)
    first = round(pitch * choice.approach_bays, 3)
    last = round(first + pitch * choice.bays, 3)
    start = 0.5 * (first + last - choice.span)
    return replace(rib, start=start), (0.0, first, last, round(last + first, 3)), pitch


def _footing_room(pitch: float, bents: Bents, abutments: Abutments) -> float:
    """Find the room along the bridge for half a footing of a pier on the banks [m]."""
    block = 0.5 * bents.length + _ROOM
    return min(0.5 * (pitch - _APART), pitch - max(block, abutments.front + abutments.footing_toe) - _APART)


def _check_banks(choice: ArchChoice, pitch: float, bents: Bents, abutments: Abutments) -> None:
    """Refuse piers on the banks that have no room between the springings' blocks and the abutments."""
    missing = 0.5 * bents.length + _LEAST_MARGIN - _footing_room(pitch, bents, abutments)
    if missing <= 0.0:
        return
    # With the same columns a larger pitch gives as much room, or half of it between two footings.
    fitting = next(n for n in range(choice.bays, 0, -1) if pitch * choice.bays / n - pitch >= 2.0 * missing)
    raise InputError(
        f"puts the piers on the banks {pitch:.2f} m apart, which leaves no room for their footings",
        field="bridge.arch.bays",
        value=choice.bays,
        allowed=f"at most {fitting} here",
        hint="Choose fewer bays, a longer span or approach = 0",
    )


def _lowered(arch: DrawnDeckArch, place: Alignment) -> Rib:
    """Lower an arch until the shortest column has its least height."""
    middle = level_at(place, arch.rib.middle).level
    stations = np.array(arch.bent_stations)
    half = 0.5 * arch.bents.length
    back = np.maximum(arch.rib.extrados(stations - half), arch.rib.extrados(stations + half))
    road: F64 = place.point(stations, np.zeros(len(stations)), np.zeros(len(stations)))[:, 2] - middle
    room = road + arch.levels.girder_soffit - arch.bents.cap_depth - back
    return replace(arch.rib, base=arch.rib.base - max(0.0, _LEAST_COLUMN - float(room.min())))


def _bent_parts(arch: DrawnDeckArch, place: Alignment, middle: Alignment) -> list[Part]:
    parts = []
    for number, station in enumerate(arch.bent_stations):
        level = level_at(place, station)
        foot = foot_on(arch.rib.extrados, station, arch.bents.length, level, middle)
        top = arch.levels.girder_soffit + _INTO_DECK
        parts += spandrel_parts(arch.bents, f"Spandrel_{number:03d}", station, top, foot, place)
    return parts


def _pier_parts(arch: DrawnDeckArch, place: Alignment, middle: Alignment, ground: Ground) -> list[Part]:
    """Build the blocks, the piers on them, and the piers on the banks."""
    parts, reach = [], arch.reach
    paired = 2.0 * (arch.spans.row_setback + 0.5 * arch.bearings.plinth_length + 0.10)
    count = len(arch.spans.supports)
    for end in (0, 1):
        founding = Founding(middle, ground, FOUNDING)
        parts.append(skewback_part(arch.rib, end, f"Springing_{end}", (-reach, reach), arch.behind, founding))
        if count == 2:
            continue
        support = 1 + end
        station = arch.spans.supports[support]
        level = level_at(place, station)
        foot = float(skewback_face(arch.rib, end)[0][1]) + middle.level - level.level
        cap = CapPlace(station, arch.levels.seat, max(paired, arch.bents.cap_width))
        parts += pier_bent_parts(arch.bents, f"Pier_{support:03d}", cap, foot, place, support)
    for number, station in enumerate(arch.pier_stations):
        founding = Founding(level_at(place, station), ground, FOUNDING)
        name, top = f"Bank_Pier_{number:03d}", arch.levels.girder_soffit + _INTO_DECK
        ceiling = top - arch.bents.cap_depth - 0.3
        footing, foot = bent_footing(arch.bents, f"{name}_Footing", station, ceiling, founding, arch.footing_room)
        parts += pier_bent_parts(arch.bents, name, CapPlace(station, top, arch.bents.cap_width), foot, place)
        parts.append(footing)
    return parts
