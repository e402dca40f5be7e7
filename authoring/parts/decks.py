"""The concrete deck slab: haunched over girders, with thickening cantilevers and drip grooves under its edges."""

from dataclasses import dataclass

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.drawing import Draws, draw, drawn
from authoring.parts.girder_sections import HAUNCH_LEDGE
from authoring.parts.part import SUPERSTRUCTURE, Part
from authoring.parts.spans import Levels, Spans
from authoring.shapes.component import F64
from authoring.shapes.sections import cut_corners, mirrored
from authoring.solids.extrusion import Prism
from groundwork.settings import Settings

EDGE_CHAMFER = 0.025  # [m]
GROOVE = 0.020  # [m] depth and half the width of a drip groove


class DeckEdgeSettings(Settings):
    """Edges of the slab; omitted values are drawn at random."""

    groove: float | None = drawn(
        0.10,
        0.15,
        "Distance of the drip groove from the slab's edge; 0: no groove [m]",
        ge=0.0,
        le=0.30,
        paper=(0.0, 0.0),
    )
    chamfer: float | None = drawn(
        0.015, 0.030, "Leg length of the chamfer along the slab's lower edges [m]", ge=0.0, le=0.05, paper=(0.0, 0.0)
    )


@dataclass(frozen=True)
class DeckEdge:
    """Edges of a deck slab.

    Attributes:
        groove: From the slab's edge to the middle of its drip groove [m]; 0 for none.
        chamfer: Leg of the chamfer along the lower edge [m].
    """

    groove: float = 0.0
    chamfer: float = EDGE_CHAMFER


def draw_deck_edge(settings: DeckEdgeSettings, draws: Draws) -> DeckEdge:
    """Draw the edges of a slab.

    Args:
        settings: Values set by the user.
        draws: Random stream and profile of the bridge.
    """
    return DeckEdge(draw(settings, "groove", draws), draw(settings, "chamfer", draws))


@dataclass(frozen=True)
class Haunches:
    """Haunches of a slab over the members under it.

    Attributes:
        lines: Distance of every member to the left of the axis [m], rising and symmetric.
        width: Width of a member's top [m].
        height: From the slab's soffit to the member's top [m].
    """

    lines: tuple[float, ...]
    width: float
    height: float


def deck_outline(width: float, top: float, soffit: float, edge: DeckEdge, haunches: Haunches | None = None) -> F64:
    """Draw the section of a slab: level on top, its underside falling from the edges to the outer members.

    Args:
        width: Overall width [m].
        top: Height of its top [m].
        soffit: Height of its underside between members [m].
        edge: Its edges.
        haunches: Members under it, or None.

    Returns:
        Outline [m], shape (P, 2), float64.
    """
    half = 0.5 * width
    inner, outer = _haunch_corners(haunches, soffit)
    tip, low = outer[-1] if outer else (0.0, soffit)

    def under(x: float) -> float:
        """Find the cantilever's underside, which falls towards the outer member [m]."""
        return soffit + (low - soffit) * (half - x) / (half - tip)

    groove, right = edge.groove, [*inner, *outer]
    if groove > 0.0:
        middle = half - groove
        right += [(middle - GROOVE, under(middle - GROOVE)), (middle, under(middle) + GROOVE)]
        right += [(middle + GROOVE, under(middle + GROOVE))]
    right += [(half, soffit), (half, top)]
    legs = np.zeros(len(right))
    legs[-2] = edge.chamfer
    return cut_corners(mirrored(right), np.concatenate([legs, legs[::-1]]))


def _haunch_corners(
    haunches: Haunches | None, soffit: float
) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    """List a slab's lower corners to the left of the axis: between the members, and on the outermost [m]."""
    if haunches is None or haunches.height <= 0.0:
        return [], []
    half, low, corners = 0.5 * haunches.width - HAUNCH_LEDGE, soffit - haunches.height, []
    for line in [line for line in haunches.lines if line > -1e-9]:
        if line - half > 1e-9:
            corners += [(line - half - haunches.height, soffit), (line - half, low)]
        corners.append((line + half, low))
        corners.append((line + half + haunches.height, soffit))
    return corners[:-2], corners[-2:-1]


def deck_parts(
    width: float,
    spans: Spans,
    levels: Levels,
    place: Alignment,
    *,
    edge: DeckEdge = DeckEdge(),
    haunches: Haunches | None = None,
) -> list[Part]:
    """Build the slab, one piece for every span or a single continuous one.

    Args:
        width: Overall deck width [m].
        spans: Stations.
        levels: Levels of the deck.
        place: Axis of the bridge.
        edge: Edges of the slab.
        haunches: Haunches over the members under the slab.
    """
    parts = []
    outline = deck_outline(width, -levels.surfacing, levels.soffit, edge, haunches)
    for span, (low, high) in enumerate(spans.pieces):
        surface = Prism(outline, low, high, "station", place)
        size: dict[str, object] = {"length": high - low, "width": width, "thickness": levels.slab, "span": span}
        parts.append(Part(f"Deck_{span:03d}", "deck_slab", "Role_DeckConcrete", SUPERSTRUCTURE, surface, size))
    return parts
