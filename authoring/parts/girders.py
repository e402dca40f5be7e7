"""Concrete girders of I and T section, and the diaphragms between them at the supports."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import Field

from authoring.alignment import Alignment
from authoring.component import F64
from authoring.parts.drawing import Draws, draw, drawn
from authoring.parts.part import SUPERSTRUCTURE, Part
from authoring.parts.spans import Levels, Spans
from authoring.sections import cut_corners, mirrored
from authoring.sweep import Surface, prism, sweep
from groundwork.errors import InputError
from groundwork.settings import Settings

EMBEDDED = 0.010  # [m] how far girders reach into the slab, and diaphragms into both
_SHORTER = 0.012  # [m] than the slab at either end, so that their end faces do not lie in one plane
_MIN_SPACING, _MAX_SPACING = 1.8, 3.0  # [m]
_MIN_CANTILEVER, _MAX_CANTILEVER = 0.6, 1.2  # [m]


class GirderSettings(Settings):
    """Concrete girders; what is left out is drawn."""

    shape: Literal["i", "t"] | None = Field(
        default=None, description="Section: precast I girder or T stem; drawn 60 : 40"
    )
    slenderness: float | None = drawn(16.0, 22.0, "Longest span over girder depth [1]", ge=10.0, le=30.0)
    count: int | None = Field(
        default=None, ge=2, le=20, description="Girder lines; drawn so that they lie 1.8 to 3.0 m apart"
    )
    spacing: float | None = drawn(2.0, 2.8, "Target distance between girder lines [m]", ge=1.8, le=3.0)
    top_width: float | None = drawn(0.45, 0.70, "Width of an I girder's top flange [m]", le=1.2)
    bottom_width: float | None = drawn(0.52, 0.66, "Width of an I girder's bottom flange [m]", le=1.0)
    web: float | None = drawn(0.16, 0.20, "Thickness of an I girder's web [m]", ge=0.12, le=0.35)
    stem: float | None = drawn(0.50, 0.60, "Width of a T stem at its soffit [m]", le=1.0)
    chamfer: float | None = drawn(0.015, 0.030, "Leg of chamfers on girder edges [m]", ge=0.0, le=0.05)
    diaphragm: float | None = drawn(0.25, 0.35, "Thickness of the diaphragms at the supports [m]", ge=0.15, le=0.6)


@dataclass(frozen=True)
class Girders:
    """All girders of a bridge have one section.

    Attributes:
        shape: `i` or `t`.
        depth: Below the slab [m].
        lines: Distance of every girder line to the left of the axis [m], rising.
        top_width: Width at the slab [m].
        bottom_width: Width at the soffit [m].
        web: Thickness of an I girder's web [m]; of a T stem, its soffit.
        top_thickness: Edge of the top flange, or height of a T's haunch [m].
        bottom_thickness: Edge of the bottom flange [m]; 0 for a T.
        chamfer: Leg of chamfers [m].
        diaphragm: Thickness of diaphragms [m].
    """

    shape: str
    depth: float
    lines: tuple[float, ...]
    top_width: float
    bottom_width: float
    web: float
    top_thickness: float
    bottom_thickness: float
    chamfer: float
    diaphragm: float


def draw_girders(settings: GirderSettings, width: float, longest_span: float, draws: Draws) -> Girders:
    """Draw the girders for a deck.

    Args:
        settings: What the user fixed.
        width: Deck width [m].
        longest_span: Longest span [m].
        draws: Random stream and profile of the bridge.

    Returns:
        Section and lines.

    Raises:
        InputError: The fixed number of lines cannot carry this width.
    """
    choice = "i" if draws.random() < 0.6 else "t"
    shape = settings.shape or choice
    depth = round(longest_span / draw(settings, "slenderness", draws), 2)
    lines = _draw_lines(settings, width, draws)
    top, bottom = draw(settings, "top_width", draws), draw(settings, "bottom_width", draws)
    web, stem = draw(settings, "web", draws), draw(settings, "stem", draws)
    chamfer, diaphragm = draw(settings, "chamfer", draws), draw(settings, "diaphragm", draws)
    if shape == "t":
        return Girders("t", depth, lines, stem + 0.24, stem, stem, 0.10, 0.0, chamfer, diaphragm)
    top_thickness = round(float(np.clip(0.11 * depth, 0.07, 0.15)), 3)
    bottom_thickness = round(float(np.clip(0.15 * depth, 0.09, 0.22)), 3)
    return Girders("i", depth, lines, top, bottom, web, top_thickness, bottom_thickness, chamfer, diaphragm)


def _draw_lines(settings: GirderSettings, width: float, draws: Draws) -> tuple[float, ...]:
    target = draw(settings, "spacing", draws)
    share = draws.random()
    count = settings.count or max(2, round((width - 1.8) / target) + 1)
    least = max(_MIN_CANTILEVER, 0.5 * (width - _MAX_SPACING * (count - 1)))
    most = min(_MAX_CANTILEVER, 0.5 * (width - _MIN_SPACING * (count - 1)))
    if least > most:
        if settings.count is None:
            least = most = 0.5 * (width - target * (count - 1))
        else:
            raise InputError(
                f"{count} girder lines cannot carry a deck {width:.2f} m wide", field="bridge.beam.girder.count",
                allowed=f"{_MIN_SPACING} to {_MAX_SPACING} m apart, overhang {_MIN_CANTILEVER} to {_MAX_CANTILEVER} m",
                mend="Leave it out, or change the lanes",
            )  # fmt: skip
    cantilever = least + share * (most - least)
    return tuple(
        round(float(line), 3) for line in np.linspace(-0.5 * width + cantilever, 0.5 * width - cantilever, count)
    )


def girder_outline(girders: Girders, thickening: float = 0.0) -> F64:
    """Draw the section of a girder, around its line and above its soffit.

    Args:
        girders: Section.
        thickening: How much of an I girder's web has become an end block, 0 to 1.

    Returns:
        Outline [m], shape (P, 2), float64; the same P for every thickening.
    """
    g = girders
    if g.shape == "t":
        stem_top = 0.5 * g.bottom_width + 0.02
        right = [
            (0.5 * g.bottom_width, 0.0),
            (stem_top, g.depth - g.top_thickness),
            (0.5 * g.top_width, g.depth - 0.01),
            (0.5 * g.top_width, g.depth + EMBEDDED),
        ]
        legs = [g.chamfer, 0.0, 0.0, 0.0]
    else:
        block = 0.5 * min(g.top_width, g.bottom_width) - 0.03
        web = 0.5 * g.web + thickening * (block - 0.5 * g.web)
        right = [
            (0.5 * g.bottom_width, 0.0),
            (0.5 * g.bottom_width, g.bottom_thickness),
            (web, g.bottom_thickness + 0.12 * g.depth),
            (web, g.depth - g.top_thickness - 0.07 * g.depth),
            (0.5 * g.top_width, g.depth - g.top_thickness),
            (0.5 * g.top_width, g.depth + EMBEDDED),
        ]
        legs = [g.chamfer, 0.5 * g.chamfer, 0.0, 0.0, 0.5 * g.chamfer, 0.0]
    return cut_corners(mirrored(right), np.array(legs + legs[::-1]))


def girder_surface(girders: Girders, line: float, low: float, high: float, levels: Levels, place: Alignment) -> Surface:
    """Sweep one girder; an I girder's ends are blocks that taper into the web.

    Args:
        girders: Section.
        line: Distance to the left of the axis [m].
        low: Station of its first end [m].
        high: Station of its last end [m].
        levels: Levels of the deck.
        place: Axis of the bridge.
    """
    shift = np.array([line, levels.girder_soffit])
    if girders.shape == "t":
        return prism(girder_outline(girders) + shift, low, high, "station", place)
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
    for span in range(spans.count):
        low, high = spans.ends(span)
        low, high = low + _SHORTER, high - _SHORTER
        for number, line in enumerate(girders.lines):
            parameters: dict[str, object] = {
                "shape": girders.shape, "length": high - low, "depth": girders.depth, "web": girders.web,
                "top_width": girders.top_width, "bottom_width": girders.bottom_width, "span": span, "line": number,
            }  # fmt: skip
            surface = girder_surface(girders, line, low, high, levels, place)
            name = f"Girder_{span:03d}_{number:02d}"
            parts.append(Part(name, "concrete_girder", "Role_GirderConcrete", SUPERSTRUCTURE, surface, parameters))
    return parts


def diaphragm_outline(girders: Girders, left_line: float, right_line: float) -> F64:
    """Draw a diaphragm between two neighbouring girders: its sides follow theirs, a little inside them.

    Args:
        girders: Section of both girders.
        left_line: The line with the smaller distance to the left of the axis [m].
        right_line: The other line [m].

    Returns:
        Outline, heights above the girders' soffit [m], shape (P, 2), float64.
    """
    outline = girder_outline(girders, 1.0)
    half = outline[: len(outline) // 2]
    low, high = diaphragm_heights(girders)
    heights = np.concatenate([[low], half[(half[:, 1] > low) & (half[:, 1] < high), 1], [high]])
    side = np.interp(heights, half[:, 1], half[:, 0]) - EMBEDDED
    rising = np.stack([right_line - side, heights], axis=1)
    falling = np.stack([left_line + side, heights], axis=1)[::-1]
    return np.concatenate([rising, falling])


def diaphragm_heights(girders: Girders) -> tuple[float, float]:
    """Find a diaphragm's bottom and top above the girders' soffit [m].

    Args:
        girders: Section.
    """
    bottom = girders.bottom_thickness + 0.12 * girders.depth if girders.shape == "i" else 0.25 * girders.depth
    return bottom, girders.depth + EMBEDDED


def diaphragm_parts(girders: Girders, spans: Spans, levels: Levels, place: Alignment) -> list[Part]:
    """Build the diaphragms over both rows of bearings of every span, one for each bay.

    Args:
        girders: Section and lines.
        spans: Stations.
        levels: Levels of the deck.
        place: Axis of the bridge.
    """
    parts = []
    low, high = diaphragm_heights(girders)
    for span in range(spans.count):
        for end, station in enumerate(spans.bearing_lines(span)):
            for bay, (first, second) in enumerate(zip(girders.lines[:-1], girders.lines[1:], strict=True)):
                outline = diaphragm_outline(girders, first, second) + np.array([0.0, levels.girder_soffit])
                half = 0.5 * girders.diaphragm
                surface = prism(outline, station - half, station + half, "station", place)
                parameters: dict[str, object] = {
                    "thickness": girders.diaphragm, "depth": high - low, "length": second - first, "span": span,
                }  # fmt: skip
                name = f"Diaphragm_{span:03d}_{end}_{bay:02d}"
                parts.append(Part(name, "diaphragm", "Role_GirderConcrete", SUPERSTRUCTURE, surface, parameters))
    return parts
