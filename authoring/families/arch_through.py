"""Arches that rise above the deck: through, half-through, and tied (bowstring) arches with hangers."""

from dataclasses import dataclass, replace

import numpy as np

from authoring.axis.alignment import Alignment, Layout
from authoring.families.arch_deck import FOUNDING, raised, with_springing_ground
from authoring.families.arch_settings import ArchChoice, ArchSettings
from authoring.families.shared import AxisNeeds, SharedSettings, draw_layout_of, draw_top
from authoring.families.stayed_elevation import GAUGE
from authoring.parts.abutments import Abutments, abutment_parts, draw_abutments
from authoring.parts.arch_axis import ArchAxis, Rib
from authoring.parts.arch_braces import diagonal_parts
from authoring.parts.arch_floors import Floor, brace_places, floor_beam_part, tie_parts, tie_seat_parts
from authoring.parts.arches import EMBEDDED, RibSection, rib_parts, skewback_part, skewback_stations, strut_parts
from authoring.parts.bearings import Bearings, bearing_parts, draw_bearings
from authoring.parts.deck_top import DeckTop, deck_runs, deck_top_parts
from authoring.parts.decks import deck_parts
from authoring.parts.drawing import Draws
from authoring.parts.fittings import fitting_parts
from authoring.parts.footings import Founding
from authoring.parts.hangers import Hangers, RibAbove, bracket_surface, hanger_parts, needed_height
from authoring.parts.part import SUBSTRUCTURE, Part
from authoring.parts.piers import Ground
from authoring.parts.spandrels import Bents, column_surface, foot_on
from authoring.parts.spans import Levels, Spans, level_at
from groundwork.errors import InputError

_ABOVE_GAUGE = 0.3  # [m] further clearance above the gauge
_CLEAR = 0.12  # [m] gap between the deck's edge and a rib
_LEAST_COLUMN = 0.03  # [m]
_BESIDE_COLUMN = 0.05  # [m] length of a floor beam beyond a column under it, so that their end faces are not coplanar


@dataclass(frozen=True)
class DrawnThroughArch:
    """Every drawn parameter of an arch above its deck.

    Attributes:
        kind: `through`, `half_through` or `tied`.
        rib: Axis and depths; heights relative to the road at mid-span.
        section: Form and lines of both ribs.
        panels: Fields between floor beams.
        pitch: Distance of floor beams and hangers [m].
        slab: Thickness of the deck slab [m].
        floor: Floor beams and ties.
        hangers: Dimensions.
        columns: Columns on the rib below the deck.
        brace: Size along the arch and perpendicular to it [m].
        bracing: `struts` or `k`.
        spans: One piece of deck.
        top: Surfacing, parapets and fittings of the deck.
        bearings: Under ties or end floor beams.
        bearing_lines: Distance of every bearing to the left of the axis [m].
        abutments: Their walls.
    """

    kind: str
    rib: Rib
    section: RibSection
    panels: int
    pitch: float
    slab: float
    floor: Floor
    hangers: Hangers
    columns: Bents
    brace: tuple[float, float]
    bracing: str
    spans: Spans
    top: DeckTop
    bearings: Bearings
    bearing_lines: tuple[float, ...]
    abutments: Abutments

    @property
    def levels(self) -> Levels:
        """Thicknesses from the finished surface down to the seats."""
        girder = self.floor.beam_depth
        if self.kind == "tied":
            girder = self.floor.tie_depth - self.floor.tie_top - self.top.surfacing - self.slab
        bearings = self.bearings
        return Levels(self.top.surfacing, self.slab, girder, bearings.pad_height, bearings.plinth_height)


def draw_through_arch(
    settings: ArchSettings, choice: ArchChoice, shared: SharedSettings, draws: Draws
) -> tuple[Layout, DrawnThroughArch]:
    """Draw an arch above its deck.

    Args:
        settings: Values set by the user.
        choice: Main dimensions.
        shared: Settings of the parts that every family has.
        draws: Random stream and profile of the bridge.
    """
    _refuse_ring(choice)
    top = draw_top(shared, draws)
    top = replace(top, fittings=replace(top.fittings, lamps=False))  # braces would collide with lamp posts
    bearings = draw_bearings(shared.bearing, draws)
    abutments = draw_abutments(shared.abutment, bearings, draws)
    abutments = replace(abutments, footing_toe=0.0, footing_top=0.0)  # the arch's blocks are in its place
    shares = draws.rng.random(6)
    tied = choice.arrangement == "tied"
    width = float(np.clip(choice.depth * (0.7 + 0.4 * shares[0]), 0.6, 1.8))
    tie_width = round(max(width + 0.2, bearings.plinth_width + 0.1), 3) if tied else 0.0
    line = 0.5 * top.width + (0.05 + 0.5 * tie_width if tied else _CLEAR + 0.5 * width)
    chamfer = 0.0 if choice.form == "steel" else 0.025
    section = RibSection(choice.form, round(width, 3), (-round(line, 3), round(line, 3)), chamfer)
    floor = _draw_floor(choice, top, tie_width, 2.0 * line, shares[1])
    brace = (round(0.45 + 0.25 * shares[2], 3), round(0.6 * choice.depth, 3))
    rib = _draw_rib(settings, choice, top, floor, brace)
    slab = round(max(0.25, choice.hanger_pitch / (20.0 + 6.0 * shares[3])), 3)
    diameter = round(0.06 + 0.05 * shares[4], 3)
    hangers = Hangers(diameter, round(2.0 * diameter + 0.04, 3), 0.30, round(min(0.6 * width, 0.45), 3))
    columns = _draw_columns(choice, section, width, shares[5])
    start = _start(choice, rib, floor)
    total = round(choice.span + 2.0 * start, 3)
    panels = max(6, round(total / choice.hanger_pitch))
    overhang = max(0.35, round(0.5 * bearings.plinth_length + 0.02, 3))
    drawn = DrawnThroughArch(
        kind=choice.arrangement,
        rib=replace(rib, start=start),
        section=section,
        panels=panels,
        pitch=total / panels,
        slab=slab,
        floor=floor,
        hangers=hangers,
        columns=columns,
        brace=brace,
        bracing=choice.bracing,
        spans=Spans((0.0, total), overhang, 0.05),
        top=top,
        bearings=bearings,
        bearing_lines=section.lines if tied else _lines_under_deck(top.width),
        abutments=abutments,
    )
    levels = drawn.levels
    needs = AxisNeeds((0.0, total), levels.girder_soffit, levels.seat, abutments.wing_length, straight=True)
    layout = draw_layout_of(shared, top, needs, draws)
    if not tied:
        layout = with_springing_ground(raised(layout, drawn.rib, choice.springing), drawn.rib)
        layout = replace(layout, blocks=_covered(drawn))
    return layout, drawn


def build_through_arch(layout: Layout, arch: DrawnThroughArch, ground: Ground) -> list[Part]:
    """Build an arch above its deck.

    Args:
        layout: Axis and supports.
        arch: The drawn record.
        ground: Height of the ground [m], shape (N,), at plan positions [m], shape (N, 2).
    """
    place, spans, levels = layout.alignment, arch.spans, arch.levels
    rib = _placed(arch, place)
    middle = level_at(place, rib.middle)
    parts = deck_parts(arch.top.width, spans, levels, place)
    parts += deck_top_parts(arch.top, spans, deck_runs(spans, arch.abutments), place)
    parts += rib_parts(rib, arch.section, "arch_rib", middle)
    parts += _brace_parts(arch, rib, place, middle)
    for number in range(arch.panels + 1):
        parts += _panel_parts(arch, rib, number, place, middle)
    over = (arch.floor.tie_width, 0.0) if arch.kind == "tied" else (0.0, arch.floor.beam_width)
    parts += bearing_parts(arch.bearings, arch.bearing_lines, spans, levels, place, over)
    line, ends = arch.section.lines[1], (spans.supports[0], spans.supports[-1])
    if arch.kind == "tied":
        parts += tie_parts(arch.floor, line, *ends, place)
        founding = Founding(place, ground, FOUNDING)
        parts += tie_seat_parts(arch.floor, line, ends, arch.abutments.front, levels.seat, founding)
    else:
        parts += _skewback_parts(arch, rib, middle, ground)
    parts += abutment_parts(arch.abutments, arch.top.width, spans, levels, place, ground)
    top = arch.top
    parts += fitting_parts(top.fitted, spans, None, place)
    return parts


def _refuse_ring(choice: ArchChoice) -> None:
    if choice.form == "ring":
        raise InputError(
            "a ring is as wide as the deck, and cannot rise above it",
            field="bridge.arch.form",
            value="ring",
            allowed="concrete or steel",
            hint="Choose ribs, or the arrangement deck",
        )


def _draw_columns(choice: ArchChoice, section: RibSection, width: float, share: float) -> Bents:
    """Choose the size of the columns on ribs of a given width [m] from a drawn share [1]."""
    length = round(0.5 + 0.3 * share, 3)
    role = "Role_GirderSteel" if choice.form == "steel" else "Role_PierConcrete"
    across = round(min(width - 0.16, length), 3)
    return Bents("rectangular", length, across, section.lines, 0.0, 0.0, 0.0, 0.02, role)


def _lines_under_deck(width: float) -> tuple[float, ...]:
    """Distribute bearings under the ends of a deck of a given width [m]."""
    inner = 0.5 * width - 0.8
    return tuple(np.linspace(-inner, inner, max(2, round(inner / 2.0))).round(3).tolist())


def _draw_floor(choice: ArchChoice, top: DeckTop, tie_width: float, reach: float, share: float) -> Floor:
    material = "steel" if choice.form == "steel" else "concrete"
    depth = round(max(0.6, reach / (12.0 + 4.0 * share)), 3)
    width = 0.45 if material == "steel" else 0.50
    tie_top = round(max(top.walk_level, -top.surfacing) + 0.05, 3)
    slab = max(0.25, choice.hanger_pitch / 20.0)
    tie_depth = round(tie_top + top.surfacing + slab + depth + 0.08, 3) if tie_width else 0.0
    return Floor(material, depth, width, tie_width, tie_top, tie_depth, 0.6)


def _draw_rib(
    settings: ArchSettings, choice: ArchChoice, top: DeckTop, floor: Floor, brace: tuple[float, float]
) -> Rib:
    """Draw the axis so that there is room for some braces above the traffic."""
    needed = GAUGE[top.service] + _ABOVE_GAUGE + 0.5 * brace[1] + 0.8
    rise = choice.rise
    below = {"tied": -floor.tie_top, "through": 1.2 + top.surfacing, "half_through": choice.below_deck * rise}
    under = below[choice.arrangement]
    if rise - under < needed:
        share = choice.below_deck if choice.arrangement == "half_through" else 0.0
        deep = share > 0.0 and settings.above.below_deck is not None and rise > needed
        key, value = ("below_deck", share) if deep else ("span_to_rise", choice.span / rise)
        most = 1.0 - needed / rise if deep else choice.span / (needed / (1.0 - share) if share else needed + under)
        raise InputError(
            f"the crown lies {rise - under:.2f} m above the road: no room for traffic under the bracing",
            field=f"bridge.arch.above.{key}",
            value=round(value, 3),
            allowed=f"at most {np.floor(1e3 * most) / 1e3:g} here",
            hint="Choose a higher arch or a longer span",
        )
    axis = ArchAxis(choice.shape, choice.span, rise)
    tied = choice.arrangement == "tied"
    return Rib(axis, 0.0, -under, 0.0, choice.depth, choice.springing_depth, level_feet=tied)


def _start(choice: ArchChoice, rib: Rib, floor: Floor) -> float:
    """Find the distance of the springing behind the first bearing line [m]."""
    if choice.arrangement != "tied":
        return round(0.55 * choice.hanger_pitch, 3)
    foot = -float(rib.edge(1.0)[0, 0])
    return round(max(0.0, foot + 0.1 - floor.tie_end), 3)


def _placed(arch: DrawnThroughArch, place: Alignment) -> Rib:
    """Align a tied arch with its ties, also on a grade."""
    if arch.kind != "tied":
        return arch.rib
    ends = np.array([arch.rib.start, arch.rib.start + arch.rib.axis.span, arch.rib.middle])
    heights = place.point(ends, np.zeros(3), np.zeros(3))[:, 2]
    slope = float(heights[1] - heights[0]) / arch.rib.axis.span
    return replace(arch.rib, slope=slope, base=arch.rib.base + float(0.5 * (heights[0] + heights[1]) - heights[2]))


def _panel_parts(arch: DrawnThroughArch, rib: Rib, number: int, place: Alignment, middle: Alignment) -> list[Part]:
    """Build a floor beam and its connections to the ribs."""
    station, levels = arch.pitch * number, arch.levels
    level = level_at(place, station)
    lift = middle.level - level.level
    above = RibAbove(rib, station, level, lift)
    line = arch.section.lines[1]
    name = f"Floor_Beam_{number:03d}"
    tied, end = arch.kind == "tied", number in (0, arch.panels)
    foot = arch.floor.tie_top if tied else levels.soffit
    inside = rib.start < station < rib.start + rib.axis.span
    sides = station + 0.5 * arch.columns.length * np.array([-1.0, 1.0])
    low, high = float(rib.intrados(sides).min()) + lift, float(rib.extrados(sides).max()) + lift
    hung = inside and not end and low - foot > needed_height()
    face = line - 0.5 * arch.section.width + (0.05 if arch.section.form == "steel" else 0.0)
    reach, parts = 0.5 * arch.top.width, []
    beam_bottom = levels.soffit - arch.floor.beam_depth
    if tied:
        reach = line - 0.5 * arch.floor.tie_width + EMBEDDED
    elif inside and not end and not hung and high > beam_bottom - _LEAST_COLUMN and low < levels.soffit + _LEAST_COLUMN:
        reach = face + EMBEDDED
    elif inside and not end:
        reach = line + max(0.30, 0.5 * arch.columns.width + _BESIDE_COLUMN)
        parts += [] if hung else _post_parts(arch, number, above, (low, high), middle)
    parts.append(floor_beam_part(arch.floor, name, station, reach, levels, place))
    if hung:
        for side, middle_line in (("L", line), ("R", -line)):
            where = f"{number:03d}_{side}"
            parts += hanger_parts(arch.hangers, where, above, middle_line, foot)
    return parts


def _post_parts(
    arch: DrawnThroughArch, number: int, above: RibAbove, edges: tuple[float, float], middle: Alignment
) -> list[Part]:
    """Build posts between rib and floor beam where there is no room for a hanger."""
    parts, station, level = [], above.station, above.level
    soffit, columns = arch.levels.soffit, arch.columns
    for side, line in (("L", arch.section.lines[1]), ("R", arch.section.lines[0])):
        if edges[0] > soffit:
            size = (columns.length, columns.width)
            surface = bracket_surface(above, line, size, soffit - 0.005)
        else:
            high = soffit - arch.floor.beam_depth + EMBEDDED
            foot = foot_on(above.rib.extrados, station, columns.length, level, middle)
            surface = column_surface(columns, station, line, foot, (high, 0.0), level)
        height = float(np.ptp(surface.points[:, 2]))
        facts: dict[str, object] = {"length": columns.length, "width": columns.width, "height": height}
        name = f"Spandrel_{number:03d}_Column_{side}"
        parts.append(Part(name, "spandrel_column", columns.role, SUBSTRUCTURE, surface, facts))
    return parts


def _brace_parts(arch: DrawnThroughArch, rib: Rib, place: Alignment, middle: Alignment) -> list[Part]:
    """Build struts, and diagonals between them, where there is room for traffic below."""
    nodes, _, _ = rib.polygon
    flat = np.zeros(len(nodes))
    road = place.point(nodes[:, 0], flat, flat)[:, 2] - middle.level
    free = GAUGE[arch.top.service] + _ABOVE_GAUGE + 0.5 * arch.brace[1]
    room = nodes[nodes[:, 1] - road > free, 0]
    places = brace_places(float(room[0]), float(room[-1]), 1.5 * arch.pitch)
    parts = strut_parts(rib, arch.section, places, arch.brace, middle)
    if arch.bracing == "k":
        parts += diagonal_parts(rib, arch.section, places, arch.brace, middle)
    return parts


def _skewback_parts(arch: DrawnThroughArch, rib: Rib, middle: Alignment, ground: Ground) -> list[Part]:
    founding = Founding(middle, ground, FOUNDING)
    return [
        skewback_part(rib, end, f"Springing_{end}_{side}", left, back, founding)
        for end, side, left, back in _skewbacks(arch)
    ]


def _covered(arch: DrawnThroughArch) -> tuple[tuple[float, float, float, float], ...]:
    """Find the rectangles on the ground under the springings' blocks, as `Layout.blocks` [m]."""
    return tuple((*skewback_stations(arch.rib, end, back), *left) for end, _, left, back in _skewbacks(arch))


def _skewbacks(arch: DrawnThroughArch) -> list[tuple[int, str, tuple[float, float], float]]:
    """List the blocks at the springings: end, side, from and to the left of the axis, length behind the face [m]."""
    half, line, back = 0.5 * arch.section.width, arch.section.lines[1], max(2.0, 0.05 * arch.rib.axis.span)
    inner, outer = line - half - _CLEAR + 0.02, line + half + 0.40
    return [
        (end, side, left, back) for end in (0, 1) for side, left in (("L", (inner, outer)), ("R", (-outer, -inner)))
    ]
