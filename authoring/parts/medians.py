"""The raised strip between the two directions of a road, for stays and masts."""

from dataclasses import replace

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.part import SUPERSTRUCTURE, Part
from authoring.parts.roadway import EMBEDDED, Roadway
from authoring.shapes.sections import cut_corners, rectangle
from authoring.solids.extrusion import Prism

_BESIDE = 0.20  # [m] from its kerb to the inner edge lines
_APART = 0.02  # [m] distance from a mast
_NOSE_LOWER = 0.004  # [m] lower than the strip, so that their tops are not coplanar
_LAP = 0.010  # [m] embedment of the nose in the strip
_ARC = np.radians(np.linspace(-90.0, 90.0, 13))
_SHORTER = 0.25  # [m] shorter than the deck at either end: the expansion joints are continuous


def median_parts(
    roadway: Roadway,
    low: float,
    high: float,
    masts: tuple[tuple[float, float], ...],
    place: Alignment,
    *,
    name: str = "",
    noses: tuple[bool, bool] = (False, False),
) -> list[Part]:
    """Build the strip, interrupted at masts.

    Args:
        roadway: Cross-section of the road.
        low: Station of the deck's first end [m].
        high: Station of its last end [m].
        masts: Station and half length along the bridge [m] of every mast, rising.
        place: Axis of the bridge.
        name: Prefix of the number in the parts' names, e.g. `000_`.
        noses: Whether its first and its last end are rounded towards the traffic.
    """
    half = 0.5 * roadway.median - _BESIDE
    outline = rectangle((-half, -roadway.surfacing - EMBEDDED), (half, roadway.kerb_height))
    outline = cut_corners(outline, np.array([0.0, 0.0, 0.02, 0.02]))
    begin, end = (_SHORTER + (half if round_ else 0.0) for round_ in noses)
    cuts = [low + begin]
    for station, reach in masts:
        cuts += [station - reach - _APART, station + reach + _APART]
    cuts.append(high - end)
    parts = [
        _nose_part(roadway, half, station, ahead, f"Median_{name}Nose_{number}", place)
        for number, (round_, station, ahead) in enumerate(zip(noses, (cuts[0], cuts[-1]), (-1.0, 1.0), strict=True))
        if round_
    ]
    for number, (first, last) in enumerate(zip(cuts[::2], cuts[1::2], strict=True)):
        surface = Prism(outline, first, last, "station", place)
        size: dict[str, object] = {
            "length": last - first,
            "width": 2.0 * half,
            "height": roadway.kerb_height,
            "embedded_in": "surfacing",
        }
        parts.append(Part(f"Median_{name}{number}", "kerb", "Role_KerbConcrete", SUPERSTRUCTURE, surface, size))
    return parts


def _nose_part(roadway: Roadway, half: float, station: float, ahead: float, name: str, place: Alignment) -> Part:
    """Build the round end of a median that ends at a station; `ahead` is 1 towards higher stations, else -1."""
    bottom, top = -roadway.surfacing - EMBEDDED - _NOSE_LOWER, roadway.kerb_height - _NOSE_LOWER
    width = half - _NOSE_LOWER
    round_ = width * np.stack([np.cos(_ARC), np.sin(_ARC)], axis=1)
    corners = np.concatenate([[(-_LAP, -width)], round_, [(-_LAP, width)]])
    corners = corners if ahead > 0.0 else (corners * (-1.0, 1.0))[::-1]
    # Built in a straight frame, along the end of the strip, which is skewed like the joints.
    level, grade = place.straight_at(station), float(place.grade_at(np.array([station]))[0])
    frame = replace(level, grade=grade, level=level.level - grade * station)
    surface = Prism(np.add(corners, (station, 0.0)), bottom, top, "above", frame).surface
    size: dict[str, object] = {"width": 2.0 * width, "height": roadway.kerb_height, "embedded_in": "surfacing"}
    return Part(name, "kerb", "Role_KerbConcrete", SUPERSTRUCTURE, surface, size)
