"""Bolted field splices of plate girders: cover plates on web and flanges, and their bolts."""

from dataclasses import replace

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.part import SUPERSTRUCTURE, Part
from authoring.parts.plate_girders import PlateGirders
from authoring.parts.spans import Levels, Spans
from authoring.shapes.component import F64
from authoring.solids.setting_out import bolts, in_one_chart, plates, shifted, to_world
from authoring.solids.sweep import Surface, joined

HALF_LENGTH = 0.42  # [m] of a splice, from the joint to the ends of its plates
_PLATE = 0.014  # [m]
_INTO = 0.002  # [m] embedment of plates in the girder, and of bolts in the plates
_HEAD, _ACROSS = 0.020, 0.044  # [m] height of a bolt's head, width over its corners
_PITCH = 0.16  # [m] largest, between bolts
_EDGE = 0.055  # [m] least, from a bolt to its plate's edge
_CLEAR = 0.05  # [m] between a web plate and the flanges


def splice_parts(
    girders: PlateGirders, spans: Spans, cuts: tuple[float, ...], levels: Levels, place: Alignment
) -> list[Part]:
    """Build the plates and bolts of every splice, one part for each line and splice.

    Args:
        girders: Dimensions.
        spans: Stations.
        cuts: Field splices, rising [m].
        levels: Levels of the deck.
        place: Axis of the bridge.
    """
    if girders.box or not cuts:
        return []
    surfaces, parts, top = [], [], girders.steel_top(levels)
    for station, depth in zip(cuts, girders.depths(spans, np.array(cuts)), strict=True):
        template = _following(splice_surface(girders, float(depth)), girders, spans, station, float(depth))
        surfaces += [shifted(template, np.array([station, line, top])) for line in girders.lines]
    placed = iter(to_world(surfaces, place))
    depths = girders.depths(spans, np.array(cuts))
    for number, (station, depth) in enumerate(zip(cuts, depths, strict=True)):
        for line in range(len(girders.lines)):
            size: dict[str, object] = {
                "length": 2.0 * HALF_LENGTH,
                "height": float(depth),
                "thickness": _PLATE,
                "station": station,
                "line": line,
            }
            name = f"Splice_{number:03d}_{line:02d}"
            parts.append(Part(name, "splice_plate", "Role_GirderSteel", SUPERSTRUCTURE, next(placed), size))
    return parts


def splice_surface(girders: PlateGirders, depth: float) -> Surface:
    """Build one splice round the joint, heights counted from the top of the steel.

    Args:
        girders: Dimensions.
        depth: Depth of the girder there [m].
    """
    web, flange = 0.5 * girders.web, girders.flange
    low, high = flange + _CLEAR - depth, -flange - _CLEAR
    rows = _spread(low + _EDGE, high - _EDGE)
    columns = np.array([-0.75, -0.27, 0.27, 0.75]) * HALF_LENGTH
    boxes, heads = [], []
    for side in (-1.0, 1.0):  # of the web
        boxes.append(_plate((-HALF_LENGTH, HALF_LENGTH), _to(side, web - _INTO, web + _PLATE), (low, high)))
        s, z = (grid.ravel() for grid in np.meshgrid(columns, rows))
        face = side * (web + _PLATE)
        heads.append(bolts(np.stack([s, np.full(len(s), face), z], axis=1), _ACROSS, _to(side, -_INTO, _HEAD), "left"))
    for width, face, sign in ((girders.bottom_width, flange - depth, 1.0), (girders.top_width, -flange, -1.0)):
        for side in (-1.0, 1.0):  # the two inner plates of a flange
            reach = _to(side, web + _PLATE + _HEAD + 0.012, 0.5 * width - 0.006)
            above = _ordered(face - sign * _INTO, face + sign * _PLATE)
            boxes.append(_plate((-HALF_LENGTH, HALF_LENGTH), reach, above))
            heads.append(_flange_bolts(columns, reach, face + sign * _PLATE, sign))
    below = -depth
    boxes.append(
        _plate(
            (-HALF_LENGTH, HALF_LENGTH),
            (0.004 - 0.5 * girders.bottom_width, 0.5 * girders.bottom_width - 0.004),
            (below - _PLATE, below + _INTO),
        )
    )
    for side in (-1.0, 1.0):
        reach = _to(side, web + _PLATE + _HEAD + 0.012, 0.5 * girders.bottom_width - 0.006)
        heads.append(_flange_bolts(columns, reach, below - _PLATE, -1.0))
    low_corners, high_corners = np.array([box[0] for box in boxes]), np.array([box[1] for box in boxes])
    return in_one_chart(joined([plates(low_corners, high_corners, "station"), *heads]))


def _following(template: Surface, girders: PlateGirders, spans: Spans, station: float, depth: float) -> Surface:
    """Shear a splice along a haunch, so that its plates follow the bottom flange."""
    points = template.points.copy()
    points[:, 2] *= girders.depths(spans, station + points[:, 0]) / depth
    return replace(template, points=points)


def _flange_bolts(columns: F64, reach: tuple[float, float], face: float, sign: float) -> Surface:
    count = 2 if reach[1] - reach[0] >= 0.20 else 1
    across = np.linspace(reach[0], reach[1], 2 * count + 1)[1::2]
    s, left = (grid.ravel() for grid in np.meshgrid(columns, across))
    heads = np.stack([s, left, np.full(len(s), face)], axis=1)
    return bolts(heads, _ACROSS, _to(sign, -_INTO, _HEAD), "above")


def _spread(low: float, high: float) -> F64:
    return np.linspace(low, high, max(int(np.ceil((high - low) / _PITCH)) + 1, 2))


def _to(sign: float, near: float, far: float) -> tuple[float, float]:
    """Mirror a range to either side of 0 [m]; the lower end comes first."""
    return _ordered(sign * near, sign * far)


def _ordered(one: float, other: float) -> tuple[float, float]:
    return min(one, other), max(one, other)


def _plate(
    station: tuple[float, float], left: tuple[float, float], above: tuple[float, float]
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    return (station[0], left[0], above[0]), (station[1], left[1], above[1])
