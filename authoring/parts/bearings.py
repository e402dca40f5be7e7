"""Bearings: elastomeric pads or pots under sole plates, on concrete plinths, one for each line and row."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from pydantic import Field

from authoring.alignment import Alignment
from authoring.component import F64
from authoring.parts.drawing import Draws, draw, drawn
from authoring.parts.part import SUBSTRUCTURE, Part
from authoring.parts.spans import Levels, Spans, level_at
from authoring.parts.wedges import Slope, road_slope, seat_slope, wedge
from authoring.sections import circle, inset, rectangle
from authoring.sweep import Surface, joined, prism, sweep
from groundwork.settings import Settings

PAD_EMBEDDED = 0.002  # [m] into plinth and girder: loaded rubber leaves no gap
PLINTH_EMBEDDED = 0.010  # [m] into the cap
_SOLE = 0.020  # [m] of a sole plate at its middle on a level bridge
_IN_PLANE = 0.006  # [m] by which sides that stand over each other must differ, so that they do not flicker
_SOLE_EDGE = 0.006  # [m] of a sole plate at its thinnest corner
_SOLE_MARGIN = 0.015  # [m] of the sole plate beyond what it lies on
_BULGE = 0.003  # [m] of the rubber between two steel laminates
_LAYER = 0.022  # [m] of rubber between two laminates
_POT_SIDES = 24
_POT_EMBEDDED = 0.002  # [m] of the pot's pieces into each other


class BearingSettings(Settings):
    """Bearings and plinths; what is left out is drawn."""

    kind: Literal["pad", "pot"] | None = Field(
        default=None, description="Laminated rubber pad or steel pot; drawn 70 : 30, in profile paper always pot"
    )
    pad_width: float | None = drawn(0.36, 0.44, "Pad across the bridge [m]", ge=0.20, le=0.90)
    pad_length: float | None = drawn(0.28, 0.38, "Pad along the bridge [m]", ge=0.15, le=0.50)
    pad_height: float | None = drawn(0.06, 0.12, "Pad with its sole plate [m]", ge=0.04, le=0.30)
    plinth_margin: float | None = drawn(0.05, 0.10, "From pad or pot to plinth edge [m]", ge=0.02, le=0.15)
    plinth_height: float | None = drawn(0.10, 0.25, "Plinth above cap or seat [m]", ge=0.05, le=0.50)
    pot_width: float | None = drawn(0.35, 0.48, "Base plate of a pot, square [m]", le=0.90)
    pot_height: float | None = drawn(0.10, 0.20, "Pot with its plates [m]", ge=0.08, le=0.30, paper=(0.30, 0.30))


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
        settings: What the user fixed.
        draws: Random stream and profile of the bridge.
    """
    width, length, height = (draw(settings, key, draws) for key in ("pad_width", "pad_length", "pad_height"))
    margin, plinth = draw(settings, "plinth_margin", draws), draw(settings, "plinth_height", draws)
    share, pot_width, pot_height = (
        draws.random(),
        draw(settings, "pot_width", draws),
        draw(settings, "pot_height", draws),
    )
    paper = draws.profile == "paper"
    kind = settings.kind or ("pot" if share >= 0.70 or paper else "pad")
    if kind == "pot":
        width, length, height = pot_width, pot_width, pot_height
    return Bearings(width, length, height, margin, plinth, kind, sole_plate=not paper)


@dataclass(frozen=True)
class _Spot:
    """Where one bearing stands: its own level frame, and the planes below and above it.

    Attributes:
        frame: Level, turned with the support line; heights are the deck's at this place.
        station: Of the row [m].
        line: Distance to the left of the axis [m].
        seat: Height of the seat [m].
        plinth_top: Height of the plinth [m].
        soffit: Height of the girder's soffit [m].
        below: Slope of the seat.
        above: Slope of the soffit.
    """

    frame: Alignment
    station: float
    line: float
    seat: float
    plinth_top: float
    soffit: float
    below: Slope
    above: Slope

    def between(self, low: float, high: float, *, below: bool = False, above: bool = False) -> Alignment:
        """Take the frame of what reaches from one height to another, with the slopes of the seat and the soffit."""
        slopes = (self.below if below else (0.0, 0.0)), (self.above if above else (0.0, 0.0))
        return wedge(self.frame, (self.station, self.line), (low, high), low=slopes[0], high=slopes[1])


def bearing_parts(
    bearings: Bearings, lines: tuple[float, ...], spans: Spans, levels: Levels, place: Alignment,
    soffit: tuple[float, float] = (0.0, 0.0),
) -> list[Part]:  # fmt: skip
    """Build bearing, sole plate and plinth for each line and row.

    Args:
        bearings: Their dimensions.
        lines: Distance of every bearing to the left of the axis [m].
        spans: Stations.
        levels: Levels of the deck.
        place: Axis of the bridge.
        soffit: Width across and length along the bridge of what lies on each bearing [m]; 0 where it goes on.
    """
    parts = []
    bearings = _beside(_askew(bearings, place.skew), soffit)
    for span, end, station in spans.rows:
        support = spans.supports[span + end]
        level = level_at(place, support)
        at = np.full(len(lines), station), np.array(lines), np.zeros(len(lines))
        seats = levels.seat + level.point(*at)[:, 2] - place.point(*at)[:, 2]
        below, above = seat_slope(place, support), road_slope(place, station)
        for number, line in enumerate(lines):
            frame = place.frame_at(station, line, turn=-place.skew)
            spot = _Spot(
                frame, station, line, float(seats[number]), levels.plinth_top, levels.girder_soffit, below, above
            )
            facts: dict[str, object] = {"span": span, "support": span + end, "line": number}
            parts += _stack(bearings, spot, f"{span:03d}_{end}_{number:02d}", facts)
    return parts


def _askew(bearings: Bearings, skew: float) -> Bearings:
    """Shrink a bearing that is turned against its girder until it stays under the soffit."""
    if skew == 0.0:
        return bearings
    w, length = bearings.pad_width, bearings.pad_length
    share = w / (w * np.cos(skew) + length * np.sin(abs(skew)))
    if share >= 1.0:
        return bearings
    return Bearings(
        round(float(w * share), 3), round(float(length * share), 3), bearings.pad_height, bearings.plinth_margin,
        bearings.plinth_height, bearings.kind, bearings.sole_plate,
    )  # fmt: skip


def _beside(bearings: Bearings, soffit: tuple[float, float]) -> Bearings:
    """Trim a bearing whose sole plate would end in the very plane in which the flange over it ends."""
    sizes = []
    for size, over in zip((bearings.pad_width, bearings.pad_length), soffit, strict=True):
        flush = abs(size + 2.0 * _SOLE_MARGIN - over) <= _IN_PLANE
        sizes.append(round(size - 2.0 * _IN_PLANE, 3) if flush else size)
    return replace(bearings, pad_width=sizes[0], pad_length=sizes[1])


def _stack(bearings: Bearings, spot: _Spot, where: str, facts: dict[str, object]) -> list[Part]:
    """Build one bearing with its sole plate and plinth."""
    b, top = bearings, spot.soffit
    kind = "bearing_pot" if b.kind == "pot" else "bearing_pad"
    low, parts = spot.plinth_top - PAD_EMBEDDED, []
    sole = sole_thickness(bearings, spot.above)
    if b.sole_plate:
        top -= sole
    surface = _pot(b, spot, low, top) if b.kind == "pot" else _pad(b, spot, low, top + PAD_EMBEDDED)
    role = "Role_GirderSteel" if b.kind == "pot" else "Role_BearingRubber"
    size = {"width": b.pad_width, "length": b.pad_length, "height": spot.soffit - spot.plinth_top, **facts}
    if b.sole_plate:
        plan = (b.pad_length + 2.0 * _SOLE_MARGIN, b.pad_width + 2.0 * _SOLE_MARGIN)
        # Vulcanised to its pad or bolted to its pot: one bearing, one component.
        surface = joined([surface, _sole_plate(plan, spot, top, spot.soffit + PAD_EMBEDDED)])
        size = {**size, "sole_plate": sole}
    parts.append(Part(f"Bearing_{where}", kind, role, SUBSTRUCTURE, surface, size))
    foot = spot.seat - PLINTH_EMBEDDED
    outline, frame = _plate((b.plinth_length, b.plinth_width)), spot.between(foot, spot.plinth_top, below=True)
    plinth = prism(outline, foot, spot.plinth_top, "above", frame, 0.015)
    size = {"width": b.plinth_width, "length": b.plinth_length, "height": spot.plinth_top - spot.seat, **facts}
    parts.append(Part(f"Plinth_{where}", "bearing_plinth", "Role_CapConcrete", SUBSTRUCTURE, plinth, size))
    return parts


def _plate(size: tuple[float, float]) -> F64:
    """Draw a rectangle along and across the bridge around the spot: [m], shape (4, 2), float64."""
    return rectangle((-0.5 * size[0], -0.5 * size[1]), (0.5 * size[0], 0.5 * size[1]))


def sole_thickness(bearings: Bearings, slope: Slope) -> float:
    """Find the thickness of a sole plate at its middle [m]: more under a sloping girder, so that no corner vanishes.

    Args:
        bearings: Dimensions.
        slope: Of the girder's soffit.
    """
    reach = 0.5 * (bearings.pad_length + 2.0 * _SOLE_MARGIN), 0.5 * (bearings.pad_width + 2.0 * _SOLE_MARGIN)
    return max(_SOLE, _SOLE_EDGE + abs(slope[0]) * reach[0] + abs(slope[1]) * reach[1])


def _sole_plate(plan: tuple[float, float], spot: _Spot, low: float, high: float) -> Surface:
    """Build a plate, level below and as steep as the girder above."""
    outline = _plate(plan)
    heights = np.stack([np.full(4, low), high + outline @ np.array(spot.above)])
    return sweep(
        np.stack([outline, outline]), np.array([low, high]), "above", spot.between(low, high, above=True),
        lengths=heights - low,
    )  # fmt: skip


def _pad(bearings: Bearings, spot: _Spot, low: float, high: float) -> Surface:
    """Build a rubber pad whose edges bulge between its steel laminates."""
    frame = spot.between(low, high, above=not bearings.sole_plate)
    outline = _plate((bearings.pad_length, bearings.pad_width))
    layers = max(2, round((high - low) / _LAYER))
    heights = np.linspace(low, high, 2 * layers + 1)
    waist = inset(outline, _BULGE)
    rings = np.stack([waist if k % 2 == 0 else outline for k in range(2 * layers + 1)])
    guide = np.array([min(k | 1, 2 * layers - 1) for k in range(2 * layers + 1)], np.int32)
    return sweep(rings, heights, "above", frame, girth_of=guide)


def _pot(bearings: Bearings, spot: _Spot, low: float, high: float) -> Surface:
    """Build a pot bearing: base plate, pot, piston and top plate."""
    width, height = bearings.pad_width, high - low
    levels = low + height * np.array([0.0, 0.20, 0.62, 0.76, 1.0])
    frame = spot.between(low, high)
    top = spot.between(float(levels[3]), high, above=not bearings.sole_plate)
    e = _POT_EMBEDDED
    return joined([
        prism(_plate((width, width)), low, float(levels[1]), "above", frame),
        prism(circle(0.86 * width, _POT_SIDES), float(levels[1]) - e, float(levels[2]), "above", frame),
        prism(circle(0.70 * width, _POT_SIDES), float(levels[2]) - e, float(levels[3]) + e, "above", frame),
        prism(_plate((0.94 * width, 0.94 * width)), float(levels[3]), high + e, "above", top),
    ])  # fmt: skip
