"""The concrete deck slab, one for each span."""

import numpy as np

from authoring.alignment import Alignment
from authoring.parts.part import SUPERSTRUCTURE, Part
from authoring.parts.spans import Levels, Spans
from authoring.sections import cut_corners, rectangle
from authoring.sweep import prism

EDGE_CHAMFER = 0.025  # [m]


def deck_parts(width: float, spans: Spans, levels: Levels, place: Alignment) -> list[Part]:
    """Build the slab of every span.

    Args:
        width: Overall deck width [m].
        spans: Stations.
        levels: Levels of the deck.
        place: Axis of the bridge.
    """
    parts = []
    outline = rectangle((-0.5 * width, levels.soffit), (0.5 * width, -levels.surfacing))
    outline = cut_corners(outline, np.array([EDGE_CHAMFER, EDGE_CHAMFER, 0.0, 0.0]))
    for span in range(spans.count):
        low, high = spans.ends(span)
        surface = prism(outline, low, high, "station", place)
        size: dict[str, object] = {"length": high - low, "width": width, "thickness": levels.slab, "span": span}
        parts.append(Part(f"Deck_{span:03d}", "deck_slab", "Role_DeckConcrete", SUPERSTRUCTURE, surface, size))
    return parts
