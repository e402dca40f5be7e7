"""The raised strip between the two directions of a road, from which stays and masts rise."""

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.part import SUPERSTRUCTURE, Part
from authoring.parts.roadway import EMBEDDED, Roadway
from authoring.shapes.sections import cut_corners, rectangle
from authoring.solids.extrusion import Prism

_BESIDE = 0.20  # [m] from its kerb to the inner edge lines
_APART = 0.02  # [m] from a mast
_SHORTER = 0.25  # [m] than the deck at either end: the expansion joints run through


def median_parts(
    roadway: Roadway, low: float, high: float, masts: tuple[tuple[float, float], ...], place: Alignment, name: str = ""
) -> list[Part]:
    """Build the strip, parted where masts stand.

    Args:
        roadway: Cross-section of the road.
        low: Station of the deck's first end [m].
        high: Station of its last end [m].
        masts: Station and half length along the bridge [m] of every mast, rising.
        place: Axis of the bridge.
        name: What the parts' names have before their number, e.g. `000_`.
    """
    half = 0.5 * roadway.median - _BESIDE
    outline = rectangle((-half, -roadway.surfacing - EMBEDDED), (half, roadway.kerb_height))
    outline = cut_corners(outline, np.array([0.0, 0.0, 0.02, 0.02]))
    cuts = [low + _SHORTER]
    for station, reach in masts:
        cuts += [station - reach - _APART, station + reach + _APART]
    cuts.append(high - _SHORTER)
    parts = []
    for number, (begin, end) in enumerate(zip(cuts[::2], cuts[1::2], strict=True)):
        surface = Prism(outline, begin, end, "station", place)
        size: dict[str, object] = {
            "length": end - begin,
            "width": 2.0 * half,
            "height": roadway.kerb_height,
            "embedded_in": "surfacing",
        }
        parts.append(Part(f"Median_{name}{number}", "kerb", "Role_KerbConcrete", SUPERSTRUCTURE, surface, size))
    return parts
