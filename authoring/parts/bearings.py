"""Bearings: elastomeric pads or pots under sole plates, on concrete plinths, one for each line and row."""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar, Literal

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.drawing import Draws, chosen, draw, draw_option, drawn
from authoring.parts.idle_settings import Use
from authoring.parts.part import SUBSTRUCTURE, Part
from authoring.parts.spans import Levels, Spans, level_at
from authoring.parts.wedges import Slope, road_slope, seat_slope, wedge
from authoring.shapes.component import F64
from authoring.shapes.sections import circle, inset, rectangle
from authoring.solids.copies import LOCAL, copied
from authoring.solids.extrusion import Prism, extruded
from authoring.solids.sweep import Surface, joined, sweep
from groundwork.settings import Settings

PAD_EMBEDDED = 0.002  # [m] embedment in plinth and girder: loaded rubber has no gap
PLINTH_EMBEDDED = 0.010  # [m] embedment in the cap
_SOLE = 0.020  # [m] of a sole plate at its middle on a level bridge
_IN_PLANE = 0.006  # [m] smallest offset between the sides of stacked plates, against z-fighting
_SOLE_EDGE = 0.006  # [m] of a sole plate at its thinnest corner
_SOLE_MARGIN = 0.015  # [m] margin of the sole plate beyond the bearing
_BULGE = 0.003  # [m] of the rubber between two steel laminates
_LAYER = 0.022  # [m] of rubber between two laminates
_POT_SIDES = 24
_POT_EMBEDDED = 0.002  # [m] embedment of the pot's pieces in each other


class BearingSettings(Settings):
    """Bearings and plinths; omitted values are drawn at random."""

    uses: ClassVar = (
        Use("kind", ("pad",), ("pad_width", "pad_length", "pad_height")),
        Use("kind", ("pot",), ("pot_width", "pot_height")),
    )
    kind: Literal["pad", "pot"] | None = chosen(
        {"pad": 0.7, "pot": 0.3}, "Kind of bearing: laminated elastomeric pad, or steel pot bearing", paper={"pot": 1}
    )
    pad_width: float | None = drawn(0.36, 0.44, "Width of a pad, across the bridge [m]", ge=0.20, le=0.90)
    pad_length: float | None = drawn(0.28, 0.38, "Length of a pad, along the bridge [m]", ge=0.15, le=0.50)
    pad_height: float | None = drawn(0.06, 0.12, "Height of a pad with its sole plate [m]", ge=0.04, le=0.30)
    plinth_margin: float | None = drawn(
        0.05, 0.10, "Distance from the pad or pot to the plinth's edge [m]", ge=0.02, le=0.15
    )
    plinth_height: float | None = drawn(0.10, 0.25, "Height of a plinth above the cap or seat [m]", ge=0.05, le=0.50)
    pot_width: float | None = drawn(0.35, 0.48, "Side of a pot bearing's square base plate [m]", le=0.90)
    pot_height: float | None = drawn(
        0.10, 0.20, "Height of a pot bearing with its plates [m]", ge=0.08, le=0.30, paper=(0.30, 0.30)
    )


@dataclass(frozen=True)
class Bearings:
    """One kind of bearing and plinth for the whole bridge.

    Attributes:
        pad_width: Across the bridge [m].
        pad_length: Along the bridge [m].
        pad_height: From the plinth to the girder [m].
        plinth_margin: From the bearing to the plinth's edge [m].
        plinth_height: Above cap or seat [m].
        kind: `pad` or `pot`.
        sole_plate: Whether a steel plate lies between bearing and girder.
    """

    pad_width: float
    pad_length: float
    pad_height: float
    plinth_margin: float
    plinth_height: float
    kind: str = "pad"
    sole_plate: bool = True

    @property
    def plinth_width(self) -> float:
        """Plinth across the bridge [m]."""
        return self.pad_width + 2.0 * self.plinth_margin

    @property
    def plinth_length(self) -> float:
        """Plinth along the bridge [m]."""
        return self.pad_length + 2.0 * self.plinth_margin


def draw_bearings(settings: BearingSettings, draws: Draws) -> Bearings:
    """Draw bearings and plinths.

    Args:
        settings: Values set by the user.
        draws: Random stream and profile of the bridge.
    """
    width, length, height = (draw(settings, key, draws) for key in ("pad_width", "pad_length", "pad_height"))
    margin, plinth = draw(settings, "plinth_margin", draws), draw(settings, "plinth_height", draws)
    kind = draw_option(settings, "kind", draws)
    pot_width, pot_height = draw(settings, "pot_width", draws), draw(settings, "pot_height", draws)
    if kind == "pot":
        width, length, height = pot_width, pot_width, pot_height
    return Bearings(width, length, height, margin, plinth, kind, sole_plate=draws.profile != "paper")


@dataclass(frozen=True)
class _Row:
    """The equal bearings at one end of one span: heights above each one's own level frame, and slopes.

    Attributes:
        plinth_top: Height of the plinths [m].
        soffit: Height of the girders' soffit [m].
        above: Slope of the soffit.
    """

    plinth_top: float
    soffit: float
    above: Slope


def bearing_parts(
    bearings: Bearings,
    lines: tuple[float, ...],
    spans: Spans,
    levels: Levels,
    place: Alignment,
    soffit: tuple[float, float] = (0.0, 0.0),
) -> list[Part]:
    """Build bearing, sole plate and plinth for each line and row.

    Args:
        bearings: Their dimensions.
        lines: Distance of every bearing to the left of the axis [m].
        spans: Stations.
        levels: Levels of the deck.
        place: Axis of the bridge.
        soffit: Width across and length along the bridge of the member on each bearing [m]; 0 where it is continuous.
    """
    parts = []
    bearings = _beside(_askew(bearings, place.skew), soffit)
    for span, end, station in spans.rows:
        support = spans.supports[span + end]
        level = level_at(place, support)
        at = np.full(len(lines), station), np.array(lines), np.zeros(len(lines))
        seats = levels.seat + level.point(*at)[:, 2] - place.point(*at)[:, 2]
        below, above = seat_slope(place, support), road_slope(place, station)
        row = _Row(levels.plinth_top, levels.girder_soffit, above)
        template = _bearing(bearings, row)
        for number, line in enumerate(lines):
            where, name = place.frame_at(station, line, turn=-place.skew), f"{span:03d}_{end}_{number:02d}"
            facts: dict[str, object] = {"span": span, "support": span + end, "line": number}
            surface = copied(template, _standing(where, station, line))
            parts.append(_bearing_part(bearings, row, surface, name, facts))
            frame = wedge(where, (station, line), (float(seats[number]) - PLINTH_EMBEDDED, row.plinth_top), low=below)
            parts.append(_plinth_part(bearings, row, float(seats[number]), frame, name, facts))
    return parts


def _standing(level: Alignment, station: float, left: float) -> F64:
    """Find the frame of a copy at one point of a level frame, shape (4, 4), float64."""
    cosine, sine = float(np.cos(level.heading)), float(np.sin(level.heading))
    frame = np.eye(4)
    frame[:2, :2] = (cosine, -sine), (sine, cosine)
    frame[:3, 3] = level.point(*(np.array([value]) for value in (station, left, 0.0)))[0]
    return frame


def _askew(bearings: Bearings, skew: float) -> Bearings:
    """Shrink a bearing that is rotated relative to its girder until it is under the soffit."""
    w, length = bearings.pad_width, bearings.pad_length
    share = w / (w * np.cos(skew) + length * np.sin(abs(skew)))
    if share >= 1.0:
        return bearings
    return Bearings(
        round(float(w * share), 3),
        round(float(length * share), 3),
        bearings.pad_height,
        bearings.plinth_margin,
        bearings.plinth_height,
        bearings.kind,
        bearings.sole_plate,
    )


def _beside(bearings: Bearings, soffit: tuple[float, float]) -> Bearings:
    """Trim a bearing whose sole plate would be coplanar with the end of the flange above it."""
    sizes = []
    for size, over in zip((bearings.pad_width, bearings.pad_length), soffit, strict=True):
        flush = abs(size + 2.0 * _SOLE_MARGIN - over) <= _IN_PLANE
        sizes.append(round(size - 2.0 * _IN_PLANE, 3) if flush else size)
    return replace(bearings, pad_width=sizes[0], pad_length=sizes[1])


@lru_cache(maxsize=64)
def _bearing(bearings: Bearings, row: _Row) -> Surface:
    """Build one bearing with its sole plate round the origin of `LOCAL`."""
    b, low, top = bearings, row.plinth_top - PAD_EMBEDDED, row.soffit
    if b.sole_plate:
        top -= sole_thickness(bearings, row.above)
    surface = _pot(b, row, low, top) if b.kind == "pot" else _pad(b, row, low, top + PAD_EMBEDDED)
    if not b.sole_plate:
        return surface
    plan = (b.pad_length + 2.0 * _SOLE_MARGIN, b.pad_width + 2.0 * _SOLE_MARGIN)
    # Vulcanised to its pad or bolted to its pot: one bearing, one component.
    return joined([surface, _sole_plate(plan, row, top, row.soffit + PAD_EMBEDDED)])


def _bearing_part(bearings: Bearings, row: _Row, surface: Surface, name: str, facts: dict[str, object]) -> Part:
    b = bearings
    kind, role = ("bearing_pot", "Role_GirderSteel") if b.kind == "pot" else ("bearing_pad", "Role_BearingRubber")
    size = {"width": b.pad_width, "length": b.pad_length, "height": row.soffit - row.plinth_top, **facts}
    if b.sole_plate:
        size["sole_plate"] = sole_thickness(bearings, row.above)
    return Part(f"Bearing_{name}", kind, role, SUBSTRUCTURE, surface, size)


def _plinth_part(
    bearings: Bearings, row: _Row, seat: float, frame: Alignment, name: str, facts: dict[str, object]
) -> Part:
    b = bearings
    outline = _plate((b.plinth_length, b.plinth_width))
    plinth = Prism(outline, seat - PLINTH_EMBEDDED, row.plinth_top, "above", frame, 0.015)
    size = {"width": b.plinth_width, "length": b.plinth_length, "height": row.plinth_top - seat, **facts}
    return Part(f"Plinth_{name}", "bearing_plinth", "Role_CapConcrete", SUBSTRUCTURE, plinth, size)


def _plate(size: tuple[float, float]) -> F64:
    """Draw a rectangle along and across the bridge around the origin: [m], shape (4, 2), float64."""
    return rectangle((-0.5 * size[0], -0.5 * size[1]), (0.5 * size[0], 0.5 * size[1]))


def sole_thickness(bearings: Bearings, slope: Slope) -> float:
    """Find the thickness of a sole plate at its middle [m]: more under a sloping girder, so that no corner has none.

    Args:
        bearings: Dimensions.
        slope: Of the girder's soffit.
    """
    reach = 0.5 * (bearings.pad_length + 2.0 * _SOLE_MARGIN), 0.5 * (bearings.pad_width + 2.0 * _SOLE_MARGIN)
    return max(_SOLE, _SOLE_EDGE + abs(slope[0]) * reach[0] + abs(slope[1]) * reach[1])


def _sole_plate(plan: tuple[float, float], row: _Row, low: float, high: float) -> Surface:
    """Build a plate, level below and parallel to the girder above."""
    outline = _plate(plan)
    heights = np.stack([np.full(4, low), high + outline @ np.array(row.above)])
    return sweep(
        np.stack([outline, outline]),
        np.array([low, high]),
        "above",
        wedge(LOCAL, (0.0, 0.0), (low, high), high=row.above),
        lengths=heights - low,
    )


def _pad(bearings: Bearings, row: _Row, low: float, high: float) -> Surface:
    """Build a rubber pad whose edges bulge between its steel laminates."""
    frame = LOCAL if bearings.sole_plate else wedge(LOCAL, (0.0, 0.0), (low, high), high=row.above)
    outline = _plate((bearings.pad_length, bearings.pad_width))
    layers = max(2, round((high - low) / _LAYER))
    heights = np.linspace(low, high, 2 * layers + 1)
    waist = inset(outline, _BULGE)
    rings = np.stack([waist if k % 2 == 0 else outline for k in range(2 * layers + 1)])
    guide = np.array([min(k | 1, 2 * layers - 1) for k in range(2 * layers + 1)], np.int32)
    return sweep(rings, heights, "above", frame, girth_of=guide)


def _pot(bearings: Bearings, row: _Row, low: float, high: float) -> Surface:
    """Build a pot bearing: base plate, pot, piston and top plate."""
    width, height = bearings.pad_width, high - low
    levels = low + height * np.array([0.0, 0.20, 0.62, 0.76, 1.0])
    top = LOCAL if bearings.sole_plate else wedge(LOCAL, (0.0, 0.0), (float(levels[3]), high), high=row.above)
    e = _POT_EMBEDDED
    return joined(
        extruded(
            [
                Prism(_plate((width, width)), low, float(levels[1]), "above", LOCAL),
                Prism(circle(0.86 * width, _POT_SIDES), float(levels[1]) - e, float(levels[2]), "above", LOCAL),
                Prism(circle(0.70 * width, _POT_SIDES), float(levels[2]) - e, float(levels[3]) + e, "above", LOCAL),
                Prism(_plate((0.94 * width, 0.94 * width)), float(levels[3]), high + e, "above", top),
            ]
        )
    )
