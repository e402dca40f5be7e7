"""Concrete girders: the choice of section, the positions of the lines, the girders and the diaphragms between them."""

from dataclasses import replace
from itertools import pairwise
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from authoring.axis.alignment import Alignment
from authoring.parts.drawing import Draws, UnsuitedDeck, check_depth, chosen, draw, draw_option, drawn
from authoring.parts.girder_sections import EMBEDDED as EMBEDDED
from authoring.parts.girder_sections import Girders as Girders
from authoring.parts.girder_sections import diaphragm_heights, diaphragm_outline, girder_outline, u_top_width
from authoring.parts.idle_settings import LEFT_OUT, Use
from authoring.parts.part import SUPERSTRUCTURE, Part
from authoring.parts.spans import Levels, Spans
from authoring.solids.extrusion import Prism
from authoring.solids.sweep import Surface, sweep
from groundwork.errors import InputError
from groundwork.settings import Settings

Shape = Literal["i", "bulb_t", "t", "u", "box", "rectangle"]

SPAN_TO_DEPTH = (10.0, 30.0)  # [1] of girders that a user may set
_SHORTER = 0.012  # [m] shorter than the slab at either end, so that their end faces are not coplanar
_WIDE_SHAPES = ("u", "box")
_CLOSE = (1.8, 3.0, 0.6, 1.2)  # [m] least and largest spacing, least and largest overhang
_WIDE = (3.0, 5.0, 0.9, 1.8)  # [m] the same for U and box girders
_NARROW_DECK = 7.5  # [m] below which two U or box girders do not fit
_BESIDE_TOP = 0.30  # [m] of slab beside a girder's top, at the edges
_BETWEEN_TOPS = 0.45  # [m] of slab between two girders' tops
_SHAPES = {"i": 30.0, "bulb_t": 20.0, "t": 18.0, "u": 12.0, "box": 10.0, "rectangle": 10.0}
_SHORT_SPAN = 24.0  # [m] up to which beams are cast in place as T or rectangle
_ONE_INNER, _TWO_INNER = 20.0, 30.0  # [m] spans from which on there are one and two inner diaphragms
_PAPER_LINES = 5


class GirderSettings(Settings):
    """Concrete girders; omitted values are drawn at random."""

    uses: ClassVar = (
        Use("shape", ("i",), ("top_width",)),
        Use("shape", ("bulb_t",), ("bulb_width",)),
        Use("shape", ("i", "bulb_t"), ("bottom_width", "end_blocks")),
        Use("shape", ("i", "bulb_t", "u"), ("web",)),
        Use("shape", ("t", "rectangle"), ("stem",)),
        Use("shape", _WIDE_SHAPES, ("wide_bottom", "wide_spacing")),
        Use("shape", ("i", "bulb_t", "t", "rectangle"), ("spacing",)),
        Use("count", LEFT_OUT, ("spacing", "wide_spacing")),
        Use("depth", LEFT_OUT, ("slenderness",)),
        Use("omitted", (False,), ("chamfer", "depth", "diaphragm", "end_blocks", "haunch", "web")),
    )
    shape: Shape | None = chosen(
        _SHAPES,
        "Cross section; the void of a box is not modeled",
        among=f" of the sections that suit the bridge: t and rectangle for spans up to {_SHORT_SPAN:g} m, u and box "
        f"for decks from {_NARROW_DECK:g} m on",
        paper={"i": 50.0, "rectangle": 50.0},
    )
    slenderness: float | None = drawn(
        16.0, 22.0, "Longest span over girder depth [1]", ge=SPAN_TO_DEPTH[0], le=SPAN_TO_DEPTH[1]
    )
    count: int | None = Field(
        default=None,
        ge=2,
        le=20,
        description="Number of girder lines [1]; drawn so that they lie 1.8 to 3.0 m apart, U and box girders 3.0 to "
        "5.0 m; in profile paper 5, a fifth of the deck's width apart",
    )
    spacing: float | None = drawn(2.0, 2.8, "Target distance between girder lines [m]", ge=1.8, le=3.0)
    wide_spacing: float | None = drawn(3.2, 4.6, "Target distance between U or box girders [m]", ge=3.0, le=5.0)
    top_width: float | None = drawn(0.45, 0.70, "Width of an I girder's top flange [m]", le=1.2)
    bulb_width: float | None = drawn(1.05, 1.30, "Width of a bulb-T's top flange [m]", ge=0.9, le=1.6)
    bottom_width: float | None = drawn(0.52, 0.66, "Width of the bottom flange of an I girder or bulb-T [m]", le=1.0)
    web: float | None = drawn(0.16, 0.20, "Web thickness of an I girder, bulb-T or U girder [m]", ge=0.12, le=0.35)
    stem: float | None = drawn(
        0.50, 0.60, "Width of a T girder's stem or a rectangular girder at its soffit [m]", le=1.0
    )
    wide_bottom: float | None = drawn(1.0, 1.3, "Width of a U or box girder at its soffit [m]", ge=0.8, le=1.8)
    chamfer: float | None = drawn(
        0.015, 0.030, "Leg length of the chamfers on girder edges [m]", ge=0.0, le=0.05, paper=(0.0, 0.0)
    )
    diaphragm: float | None = drawn(
        0.25,
        0.35,
        "Thickness of the diaphragms; 0: none [m]. One row at each support, one more at midspan of spans over 20 m, "
        "or two at the third points of spans over 30 m",
        ge=0.0,
        le=0.6,
        paper=(0.0, 0.0),
    )
    haunch: float | None = drawn(
        0.03, 0.08, "Depth of the haunch between girder and slab [m]", ge=0.0, le=0.15, paper=(0.0, 0.0)
    )
    end_blocks: bool | None = chosen(
        {True: 80, False: 20}, "Thickened web at the ends of I girders and bulb-Ts", paper={False: 1}
    )
    depth: float | None = Field(
        default=None, ge=0.3, le=4.0, description="Girder depth without slab and haunch [m]; in profile paper 0.6"
    )
    omitted: bool | None = chosen(
        {False: 1.0},
        "No girders under the slab, as for the beam bridges of the Random Bridge Generator whose girders have zero "
        "size",
        paper={True: 0.5, False: 0.5},
    )


def draw_girders(settings: GirderSettings, width: float, longest_span: float, draws: Draws) -> Girders:
    """Draw the girders for a deck.

    Args:
        settings: Values set by the user.
        width: Deck width [m].
        longest_span: Longest span [m].
        draws: Random stream and profile of the bridge.

    Returns:
        Section and lines.

    Raises:
        InputError: The given number of lines does not fit this width, or the given depth does not fit the span.
    """
    paper = draws.profile == "paper"
    shape = draw_option(settings, "shape", draws, shape_weights(longest_span, width))
    depth = round(longest_span / draw(settings, "slenderness", draws), 2)
    depth = settings.depth or (0.6 if paper and settings.slenderness is None else depth)
    if settings.depth and not paper:
        check_depth("bridge.beam.girder.depth", depth, longest_span, SPAN_TO_DEPTH)
    wide = shape in _WIDE_SHAPES
    top, bottom, bulb = (draw(settings, key, draws) for key in ("top_width", "bottom_width", "bulb_width"))
    web, stem, soffit = (draw(settings, key, draws) for key in ("web", "stem", "wide_bottom"))
    chamfer, diaphragm = draw(settings, "chamfer", draws), draw(settings, "diaphragm", draws)
    haunch = draw(settings, "haunch", draws)
    omitted, blocks = (draw_option(settings, key, draws) for key in ("omitted", "end_blocks"))
    top_thickness = round(float(np.clip(0.11 * depth, 0.07, 0.15)), 3)
    bottom_thickness = round(float(np.clip(0.15 * depth, 0.09, 0.22)), 3)
    ends = chamfer, diaphragm, haunch, blocks
    lines = ()
    match shape:
        case "i":
            girders = Girders("i", depth, lines, top, bottom, web, top_thickness, bottom_thickness, *ends)
        case "bulb_t":
            girders = Girders("bulb_t", depth, lines, bulb, bottom, web, 0.08, bottom_thickness, *ends)
        case "u":
            broad = round(u_top_width(soffit, depth, 0.15), 3)
            if 0.5 * broad - 2.2 * web < 0.05 or 0.5 * soffit - 1.05 * web < 0.10:
                raise InputError(
                    "the webs of a U girder leave no trough between them",
                    field="bridge.beam.girder.web",
                    value=web,
                    allowed=f"at most {min((0.5 * broad - 0.05) / 2.2, (0.5 * soffit - 0.10) / 1.05):.2f} m",
                    hint="Choose thinner webs or a larger wide_bottom",
                )
            girders = Girders("u", depth, lines, broad, soffit, web, 0.15, 0.20, *ends)
        case "t":
            girders = Girders("t", depth, lines, stem + 0.24, stem, stem, 0.10, 0.0, *ends)
        case _:
            side = soffit if wide else stem
            girders = Girders(shape, depth, lines, side, side, side, 0.0, 0.0, *ends)
    girders = replace(girders, lines=_draw_lines(settings, girders, width, draws))
    return replace(girders, depth=0.0, haunch=0.0) if omitted else girders


def shape_weights(longest_span: float, width: float) -> dict[str, float]:
    """List the sections that fit a span, with their weights.

    Args:
        longest_span: Longest span [m].
        width: Deck width [m].

    Returns:
        Weight of each section that fits [1].
    """
    excluded = (() if longest_span <= _SHORT_SPAN else ("t", "rectangle")) + (
        () if width >= _NARROW_DECK else _WIDE_SHAPES
    )
    return {name: weight for name, weight in _SHAPES.items() if name not in excluded}


def _draw_lines(settings: GirderSettings, girders: Girders, width: float, draws: Draws) -> tuple[float, ...]:
    close, far = draw(settings, "spacing", draws), draw(settings, "wide_spacing", draws)
    share, wide = draws.random(), girders.shape in _WIDE_SHAPES
    asked = settings.wide_spacing if wide else settings.spacing
    if draws.profile == "paper" and settings.count is None and asked is None:
        pitch = width / _PAPER_LINES
        return tuple(round(pitch * (k - 0.5 * (_PAPER_LINES - 1)), 3) for k in range(_PAPER_LINES))
    low, high, shortest, longest = _WIDE if wide else _CLOSE
    low = max(low, girders.top_width + _BETWEEN_TOPS)
    shortest = max(shortest, 0.5 * girders.top_width + _BESIDE_TOP)
    longest = max(longest, shortest + 0.6)
    fewest = max(2, int(np.ceil((width - 2.0 * longest) / high)) + 1)
    most_lines = int(np.floor((width - 2.0 * shortest) / low)) + 1
    wanted = round((width - shortest - longest) / (far if wide else close)) + 1
    count = settings.count or min(max(wanted, fewest), max(most_lines, fewest))
    least = max(shortest, 0.5 * (width - high * (count - 1)))
    most = min(longest, 0.5 * (width - low * (count - 1)))
    if least > most:
        key = "shape" if settings.count is None else "count"
        here = (
            f"{fewest} to {most_lines} lines"
            if most_lines >= fewest
            else "no number of lines fits, choose another shape"
        )
        raise UnsuitedDeck(
            f"{count} lines of {girders.shape} girders cannot carry a deck {width:.2f} m wide",
            field=f"bridge.beam.girder.{key}",
            value=getattr(settings, key),
            hint="Leave it out, or change the lanes",
            allowed=f"{low:.2f} to {high} m apart, overhang {shortest:.2f} to {longest:.2f} m; here {here}",
        )
    cantilever = least + share * (most - least)
    return tuple(
        round(float(line), 3) for line in np.linspace(-0.5 * width + cantilever, 0.5 * width - cantilever, count)
    )


def girder_surface(girders: Girders, line: float, low: float, high: float, levels: Levels, place: Alignment) -> Surface:
    """Sweep one girder; the ends of an I or bulb-T are blocks that taper into the web.

    Args:
        girders: Section.
        line: Distance to the left of the axis [m].
        low: Station of its first end [m].
        high: Station of its last end [m].
        levels: Levels of the deck.
        place: Axis of the bridge.
    """
    shift = np.array([line, levels.girder_soffit])
    if girders.shape not in ("i", "bulb_t") or not girders.end_blocks:
        return Prism(girder_outline(girders) + shift, low, high, "station", place).surface
    block, taper = girders.depth, 0.6 * girders.depth
    stations = np.array([low, low + block, low + block + taper, high - block - taper, high - block, high])
    sections = np.stack([girder_outline(girders, t) + shift for t in (1.0, 1.0, 0.0, 0.0, 1.0, 1.0)])
    return sweep(sections, stations, "station", place, girth_of=np.array([1, 1, 2, 3, 4, 4], np.int32))


def girder_parts(girders: Girders, spans: Spans, levels: Levels, place: Alignment) -> list[Part]:
    """Build every girder, one for each span and line.

    Args:
        girders: Section and lines.
        spans: Stations.
        levels: Levels of the deck.
        place: Axis of the bridge.
    """
    parts = []
    for span in range(spans.count if girders.depth > 0.0 else 0):
        low, high = spans.ends(span)
        low, high = low + _SHORTER, high - _SHORTER
        for number, line in enumerate(girders.lines):
            parameters: dict[str, object] = {
                "shape": girders.shape,
                "length": high - low,
                "depth": girders.depth,
                "web": girders.web,
                "top_width": girders.top_width,
                "bottom_width": girders.bottom_width,
                "span": span,
                "line": number,
            }
            surface = girder_surface(girders, line, low, high, levels, place)
            name = f"Girder_{span:03d}_{number:02d}"
            parts.append(Part(name, "concrete_girder", "Role_GirderConcrete", SUPERSTRUCTURE, surface, parameters))
    return parts


def diaphragm_stations(spans: Spans, span: int) -> list[tuple[float, float]]:
    """List the rows of diaphragms of one span: over both rows of bearings, then those between.

    Args:
        spans: Stations.
        span: Number of the span.

    Returns:
        Station of each row [m], and the thickening of the girders' webs there, 1 at the supports and 0 between.
    """
    low, high = spans.bearing_lines(span)
    inner = int(high - low > _ONE_INNER) + int(high - low > _TWO_INNER)
    between = [(low + (high - low) * (k + 1) / (inner + 1), 0.0) for k in range(inner)]
    return [(low, 1.0), (high, 1.0), *between]


def diaphragm_parts(girders: Girders, spans: Spans, levels: Levels, place: Alignment) -> list[Part]:
    """Build the diaphragms of every span, one for each row and bay.

    Args:
        girders: Section and lines.
        spans: Stations.
        levels: Levels of the deck.
        place: Axis of the bridge.
    """
    parts: list[Part] = []
    if girders.diaphragm == 0.0 or girders.depth == 0.0:
        return parts
    low, high = diaphragm_heights(girders)
    half, shift = 0.5 * girders.diaphragm, np.array([0.0, levels.girder_soffit])
    for span in range(spans.count):
        for row, (station, thickening) in enumerate(diaphragm_stations(spans, span)):
            for bay, (first, second) in enumerate(pairwise(girders.lines)):
                outline = diaphragm_outline(girders, first, second, thickening * girders.end_blocks) + shift
                surface = Prism(outline, station - half, station + half, "station", place)
                parameters: dict[str, object] = {
                    "thickness": girders.diaphragm,
                    "depth": high - low,
                    "length": float(np.ptp(outline[:, 0])),
                    "span": span,
                }
                name = f"Diaphragm_{span:03d}_{row}_{bay:02d}"
                parts.append(Part(name, "diaphragm", "Role_GirderConcrete", SUPERSTRUCTURE, surface, parameters))
    return parts
