"""Piers: a cap on one to five columns, and a footing in the ground."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import Field

from authoring.alignment import Alignment
from authoring.component import F64
from authoring.parts.bearings import Bearings
from authoring.parts.drawing import Draws, draw, drawn
from authoring.parts.part import SUBSTRUCTURE, Part
from authoring.parts.spans import Levels, Spans, level_at
from authoring.sections import circle, cut_corners, rectangle
from authoring.sweep import prism, turned
from groundwork.settings import Settings

Ground = Callable[[F64], F64]

EMBEDDED = 0.010  # [m] column into cap and footing
SIDES = 48  # of a round column
_WIDEST_HAMMERHEAD = 12.0  # [m] deck width on a single column
_COLUMN_PITCH = 7.0  # [m] no two columns stand further apart


class PierSettings(Settings):
    """Caps, columns and footings; what is left out is drawn."""

    columns: int | None = Field(default=None, ge=1, le=5, description="Columns of a pier; drawn by the deck's width")
    column_shape: Literal["round", "rectangular"] | None = Field(
        default=None, description="Column section; drawn 65 : 35"
    )
    diameter: float | None = drawn(0.9, 1.3, "Diameter of each of several columns [m]", ge=0.6, le=2.4)
    hammerhead_diameter: float | None = drawn(1.3, 1.8, "Diameter of a single column [m]", ge=0.9, le=3.0)
    cap_margin: float | None = drawn(0.15, 0.35, "Cap beyond the outer plinth [m]", ge=0.05, le=1.0)
    cap_depth: float | None = drawn(0.9, 1.3, "Depth of the cap over the columns [m]", ge=0.6, le=2.5)
    taper: float | None = drawn(
        0.30, 0.50, "Share of its depth that the cap loses towards its ends [1]", ge=0.0, le=0.6
    )
    chamfer: float | None = drawn(0.020, 0.030, "Leg of chamfers [m]", ge=0.0, le=0.05)
    footing_margin: float | None = drawn(0.5, 0.9, "Footing beyond the columns [m]", ge=0.2, le=2.0)
    footing_top: float | None = drawn(0.15, 0.45, "Footing above the highest ground at it [m]", ge=0.0, le=1.0)
    footing_depth: float | None = drawn(0.5, 1.0, "Footing below the lowest ground at it [m]", ge=0.3, le=3.0)


@dataclass(frozen=True)
class Piers:
    """All piers of a bridge are of one kind.

    Attributes:
        columns: Columns of a pier.
        column_shape: `round` or `rectangular`.
        column_width: Diameter, or side across the bridge [m].
        column_length: Diameter, or side along the bridge [m].
        cap_length: Across the bridge [m].
        cap_width: Along the bridge [m].
        cap_depth: Over the columns [m].
        cap_end_depth: At both ends [m].
        column_lines: Distance of every column to the left of the axis [m].
        chamfer: Leg of chamfers [m].
        footing_margin: Footing beyond the columns [m].
        footing_top: Above the highest ground at it [m].
        footing_depth: Below the lowest ground at it [m].
    """

    columns: int
    column_shape: str
    column_width: float
    column_length: float
    cap_length: float
    cap_width: float
    cap_depth: float
    cap_end_depth: float
    column_lines: tuple[float, ...]
    chamfer: float
    footing_margin: float
    footing_top: float
    footing_depth: float


def draw_piers(
    settings: PierSettings, width: float, outer_line: float, bearings: Bearings, spans: Spans, draws: Draws
) -> Piers:
    """Draw the piers under a deck.

    Args:
        settings: What the user fixed.
        width: Deck width [m].
        outer_line: From the axis to the outermost girder [m].
        bearings: What stands on the caps.
        spans: Stations of the bearings' rows.
        draws: Random stream and profile of the bridge.
    """
    share, round_share = draws.random(), draws.random()
    least = 1 if width <= _WIDEST_HAMMERHEAD else max(2, int(np.ceil(0.8 * width / _COLUMN_PITCH)))
    columns = settings.columns or least + int(2.0 * share)
    shape = settings.column_shape or ("round" if round_share < 0.65 else "rectangular")
    single = draw(settings, "hammerhead_diameter", draws)
    several = draw(settings, "diameter", draws)
    diameter = single if columns == 1 else several
    depth, taper = draw(settings, "cap_depth", draws), draw(settings, "taper", draws)
    cap_length = 2.0 * (outer_line + 0.5 * bearings.plinth_width + draw(settings, "cap_margin", draws))
    if columns == 1:  # the cantilevers of a hammerhead want depth
        depth = round(max(depth, 0.28 * 0.5 * (cap_length - diameter)), 3)
    flat = shape == "rectangular"
    column_width = round(diameter * (1.6 if columns == 1 else 1.1), 3) if flat else diameter
    column_length = round(0.8 * diameter, 3) if flat else diameter
    cap_width = 2.0 * (spans.row_setback + 0.5 * bearings.plinth_length + 0.10)
    pitch = cap_length / (columns - 0.2)
    return Piers(
        columns=columns,
        column_shape=shape,
        column_width=column_width,
        column_length=column_length,
        cap_length=round(cap_length, 3),
        cap_width=round(max(cap_width, column_length + 0.12), 3),
        cap_depth=depth,
        cap_end_depth=round(depth * (1.0 - taper), 3),
        column_lines=tuple(round(pitch * (k - 0.5 * (columns - 1)), 3) for k in range(columns)),
        chamfer=draw(settings, "chamfer", draws),
        footing_margin=draw(settings, "footing_margin", draws),
        footing_top=draw(settings, "footing_top", draws),
        footing_depth=draw(settings, "footing_depth", draws),
    )


def pier_parts(piers: Piers, spans: Spans, levels: Levels, place: Alignment, ground: Ground) -> list[Part]:
    """Build cap, columns and footing at every inner support.

    Args:
        piers: Their dimensions.
        spans: Stations.
        levels: Levels of the deck.
        place: Axis of the bridge.
        ground: Height of the ground [m], shape (N,), at plan positions [m], shape (N, 2).
    """
    parts = []
    for support in range(1, spans.count):
        station = spans.supports[support]
        level = level_at(place, station)
        cap_bottom = levels.seat - piers.cap_depth
        footing_low, footing_high = _footing_heights(piers, station, cap_bottom, level, ground)
        parts += [
            _cap_part(piers, support, station, levels.seat, level),
            *_column_parts(piers, support, station, footing_high - EMBEDDED, cap_bottom + EMBEDDED, level),
            _footing_part(piers, support, station, footing_low, footing_high, level),
        ]
    return parts


def cap_outline(piers: Piers, top: float) -> F64:
    """Draw the elevation of a cap: flat on top, its underside rising from the outer columns to the ends.

    Args:
        piers: Dimensions.
        top: Height of its top [m].

    Returns:
        Outline (left, above) [m], shape (P, 2), float64.
    """
    half, flat = 0.5 * piers.cap_length, max(piers.column_lines) + 0.5 * piers.column_width + 0.10
    flat = min(flat, half - 0.2)
    bottom, end = top - piers.cap_depth, top - piers.cap_end_depth
    right = [(flat, bottom), (half, end), (half, top)]
    outline = np.array(right + [(-x, y) for x, y in right[::-1]])
    return cut_corners(outline, np.array([0.0, piers.chamfer, piers.chamfer, piers.chamfer, piers.chamfer, 0.0]))


def _cap_part(piers: Piers, support: int, station: float, seat: float, level: Alignment) -> Part:
    half = 0.5 * piers.cap_width
    outline = cap_outline(piers, seat)
    surface = turned(prism(outline, station - half, station + half, "station", level, piers.chamfer))
    size: dict[str, object] = {
        "length": piers.cap_length, "width": piers.cap_width, "depth": piers.cap_depth,
        "end_depth": piers.cap_end_depth, "support": support,
    }  # fmt: skip
    return Part(f"Pier_{support:03d}_Cap", "pier_cap", "Role_CapConcrete", SUBSTRUCTURE, surface, size)


def _column_parts(piers: Piers, support: int, station: float, low: float, high: float, level: Alignment) -> list[Part]:
    parts = []
    for number, line in enumerate(piers.column_lines):
        if piers.column_shape == "round":
            outline = circle(piers.column_width, SIDES) + np.array([station, line])
        else:
            half = 0.5 * np.array([piers.column_length, piers.column_width])
            outline = rectangle((station - half[0], line - half[1]), (station + half[0], line + half[1]))
            outline = cut_corners(outline, 2.0 * piers.chamfer)
        surface = prism(outline, low, high, "above", level)
        size: dict[str, object] = {
            "shape": piers.column_shape, "width": piers.column_width, "length": piers.column_length,
            "height": high - low - 2.0 * EMBEDDED, "support": support,
        }  # fmt: skip
        name = f"Pier_{support:03d}_Column_{number:02d}"
        parts.append(Part(name, "column", "Role_PierConcrete", SUBSTRUCTURE, surface, size))
    return parts


def _footing_half(piers: Piers) -> F64:
    return np.array(
        [0.5 * piers.column_length + piers.footing_margin,
         max(piers.column_lines) + 0.5 * piers.column_width + piers.footing_margin]
    )  # fmt: skip


def _footing_heights(
    piers: Piers, station: float, cap_bottom: float, level: Alignment, ground: Ground
) -> tuple[float, float]:
    """Find bottom and top of a footing above the finished deck surface [m]."""
    half = _footing_half(piers)
    s, left = (g.ravel() for g in np.meshgrid(np.linspace(-1.0, 1.0, 9), np.linspace(-1.0, 1.0, 17), indexing="ij"))
    corners = level.point(station + s * half[0], left * half[1], np.zeros(len(s)))
    heights = ground(corners[:, :2]) - level.level
    top = min(float(heights.max()) + piers.footing_top, cap_bottom - 0.5)
    return min(float(heights.min()), top) - piers.footing_depth, top


def _footing_part(piers: Piers, support: int, station: float, low: float, high: float, level: Alignment) -> Part:
    half = _footing_half(piers)
    outline = cut_corners(rectangle((station - half[0], -half[1]), (station + half[0], half[1])), piers.chamfer)
    surface = prism(outline, low, high, "above", level, piers.chamfer)
    size: dict[str, object] = {
        "length": 2.0 * half[1],
        "width": 2.0 * half[0],
        "height": high - low,
        "support": support,
    }
    return Part(f"Pier_{support:03d}_Footing", "pier_footing", "Role_PierConcrete", SUBSTRUCTURE, surface, size)
