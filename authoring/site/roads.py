"""Roads and rivers of a site: water or road under the bridge, and the approach roads on their fills."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from authoring.shapes.component import Mesh
from authoring.site.grid import HeightField
from authoring.site.land import no_hills
from authoring.site.rails import crossing_railway, railway_pieces
from authoring.site.shape import BANK_SLOPE, Crossing, Hills, Land, crossfall
from authoring.site.ways import Line, carriageway, dashes, merged, ribbon

F64 = NDArray[np.float64]
Piece = tuple[str, str, str, Mesh]
Lift = Callable[[F64, F64], F64]
STEP = 2.0  # distance between cross-sections of a road [m]
WATER_STEP = 4.0
BURIED = 0.9  # height of bank above the water's edge, which is hidden in it [m]
EDGE_LINE = 0.3  # from the edge of the asphalt to the middle of the edge line [m]
LANE = 6.6  # width of a pair of lanes [m]
CLEARANCE = 0.05  # least height of a far road over the ground [m]
DASHES, SOLID = (3.0, 6.0), (1.0, 0.0)
LINE_WIDTH = 0.12  # [m]


def way_pieces(land: Land, ground: HeightField) -> list[Piece]:
    """Build the crossing and the approach roads on the strip.

    Args:
        land: The land.
        ground: The strip.

    Returns:
        Leaf prim name, component kind, material recipe and mesh of each piece.
    """
    low, high = ground.lefts[[0, -1]]
    pieces = crossing_pieces(land, spread(low, high, WATER_STEP), no_hills, "")
    for number, (approach, border) in enumerate(zip(land.approaches, ground.stations[[0, -1]], strict=True)):
        pieces += approach_pieces(land, number, spread(approach.back, border, STEP), no_hills, "")
    return pieces


def crossing_pieces(land: Land, lefts: F64, hills: Hills, suffix: str, lift: Lift | None = None) -> list[Piece]:
    """Build a stretch of the river, road or railway that the bridge crosses.

    Args:
        land: The land.
        lefts: Its cross-sections, by their distance to the left of the axis [m], shape (N,), float64.
        hills: Large-scale height of the land.
        suffix: Ending of the prim names.
        lift: Height of ground that a road must stay above [m], shape (N,), from station and left, or None.

    Returns:
        Pieces as in `way_pieces`.
    """
    crossing, axis = land.crossing, land.layout.alignment
    aside = -np.sign(lefts[-1] - lefts[0]) * crossing.stretch(lefts)
    line = Line(crossing.center(lefts), lefts, np.column_stack([aside, np.zeros(len(lefts))]))
    if crossing.kind == "river":
        half = water_half(crossing)
        level = np.full(len(lefts), crossing.level)
        rows = [np.column_stack([line.offset(side), level]) for side in (half, 0.0, -half)]
        water = ribbon(axis, rows, line.length(), (half, 0.0, -half))
        if not suffix:  # the site's own stretch has an image of its bed
            chart = ribbon(axis, rows, (lefts - lefts[0]) / (lefts[-1] - lefts[0]), (1.0, 0.5, 0.0))
            water = replace(water, st1=chart.st)
        return [(f"Water{suffix}", "water", "water", water)]
    crown = crossing.level + hills(line.station, lefts)
    if crossing.kind == "rail":
        return crossing_railway(land, line, crown, suffix)
    fall = np.full(len(lefts), 0.02 * crossing.half_width)
    names = (f"Road{suffix}", f"RoadMarking{suffix}")
    return _road(land, line, _Profile(crown, fall, np.zeros(len(lefts)), crossing.half_width), names, lift)


def water_half(crossing: Crossing) -> float:
    """Compute half the width of a river's surface, up to where it is hidden in its banks [m].

    Args:
        crossing: The river.
    """
    return crossing.half_width + BURIED * BANK_SLOPE


def approach_pieces(
    land: Land, number: int, stations: F64, hills: Hills, suffix: str, lift: Lift | None = None
) -> list[Piece]:
    """Build a stretch of an approach road.

    Args:
        land: The land.
        number: 0 before the first abutment, 1 behind the last.
        stations: Its cross-sections, in the direction away from the bridge [m], shape (N,), float64.
        hills: Large-scale height of the land.
        suffix: Ending of the prim names.
        lift: Height of ground that the road must stay above [m], shape (N,), from station and left, or None.

    Returns:
        Pieces as in `way_pieces`.
    """
    approach = land.approaches[number]
    aside = approach.sign * approach.stretch(stations)
    line = Line(stations, approach.center(stations), np.column_stack([np.zeros(len(stations)), aside]))
    crown = approach.level(land.layout, hills, stations)
    if land.layout.track is not None:
        return railway_pieces(land, number, line, crown, suffix, lift)
    fall = crossfall(approach.along(stations), np.full(len(stations), approach.half_width))
    names = (f"ApproachRoad_{number}{suffix}", f"ApproachMarking_{number}{suffix}")
    tilt = land.layout.alignment.crossfall(stations) * approach.sign
    return _road(land, line, _Profile(crown, fall, tilt, approach.half_width), names, lift)


def spread(first: float, last: float, step: float) -> F64:
    """Divide a range into equal steps.

    Args:
        first: Where the range begins [m].
        last: Where it ends [m].
        step: Largest step [m].

    Returns:
        Ends of the steps [m], shape (N,), float64.
    """
    return np.linspace(first, last, int(np.ceil(abs(last - first) / step)) + 1)


@dataclass(frozen=True)
class _Profile:
    """Cross-sections of a road, one for each of N points of its line.

    Attributes:
        crown: Height of the crown [m], shape (N,), float64.
        fall: Of either edge below the crown [m], shape (N,), float64.
        tilt: Rise to its own left over the fall from the crown [1], shape (N,), float64.
        half: Half its width [m].
    """

    crown: F64
    fall: F64
    tilt: F64
    half: float


def _road(land: Land, line: Line, profile: _Profile, names: tuple[str, str], lift: Lift | None) -> list[Piece]:
    """Build a road's surface and markings; `names` are those of the surface and of the markings."""
    crown, fall, tilt, half = profile.crown, profile.fall, profile.tilt, profile.half
    road, marking = names
    axis = land.layout.alignment
    if lift is not None:
        for share in (-1.0, -0.5, 0.0, 0.5, 1.0):
            station, left = line.offset(share * half).T
            crown = np.maximum(crown, lift(station, left) + fall * abs(share) + CLEARANCE)
    lines, width = _lines(land, half, road.startswith("Approach"))
    paint = [
        dashes(axis, line, crown - fall * abs(left) / half + tilt * left, left, style, width) for left, style in lines
    ]
    surface = carriageway(axis, line, crown, fall, tilt, half)
    strips = merged([strip for strip in paint if strip is not None])
    return [(road, "road", "asphalt", surface), (marking, "road", "road_marking", strips)]


def _lines(land: Land, half: float, approach: bool) -> tuple[list[tuple[float, tuple[float, float]]], float]:
    """List the painted lines of a road: place to the left [m], dash and gap [m]; and their width [m].

    An approach has those of its bridge.
    """
    section = land.layout.road
    if approach and section is not None:
        return [(left, section.dash if dashed else SOLID) for left, dashed in section.lines], section.line_width
    edge = half - EDGE_LINE
    if approach and land.layout.edge_line > 0:
        edge = min(land.layout.edge_line, half - 0.1)
    lanes = max(2 * round(2 * edge / LANE), 2)
    lefts = (edge * (2 * number / lanes - 1) for number in range(lanes + 1))
    return [(left, SOLID if number in (0, lanes) else DASHES) for number, left in enumerate(lefts)], LINE_WIDTH
