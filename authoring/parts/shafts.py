"""Shafts of piers: columns, walls, frame legs, and the forked stems of Y and V piers."""

from dataclasses import dataclass, replace

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.wedges import seat_slope, wedge
from authoring.shapes.component import F64
from authoring.shapes.sections import circle, cut_corners, mirrored, rectangle
from authoring.solids.extrusion import Prism
from authoring.solids.sweep import Surface, sweep, turned

EMBEDDED = 0.010  # [m] embedment in cap and footing
APART = 0.3  # [m] least distance between neighboring shafts at their bases
SIDES = 48  # of a round column
_NOSE_SIDES = 12  # of half a round nose
_NOTCH = 0.10  # [m] half the flat bottom of a fork
_LEAST_FORK = 0.4  # [m] if a fork would be shallower, the shaft only widens


@dataclass(frozen=True)
class Shafts:
    """The shafts of one pier.

    Attributes:
        kind: Kind of pier.
        shape: `round`, `octagonal` or `rectangular`.
        width: Across the bridge at the top; of a Y or V, across its stem [m].
        length: Along the bridge at the top [m].
        lines: Distance of every shaft to the left of the axis [m].
        batter: Growth of each side towards the base [1].
        arm: From the axis to the middle of an arm's head [m]; 0 without arms.
        chamfer: Leg of chamfers [m].
    """

    kind: str
    shape: str
    width: float
    length: float
    lines: tuple[float, ...]
    batter: float
    arm: float
    chamfer: float


def limit_slenderness(shafts: Shafts, height: float, slenderness: float) -> Shafts:
    """Thicken shafts until height over least side meets a limit; the distance between their bases is kept.

    Args:
        shafts: Dimensions.
        height: Of the tallest [m].
        slenderness: The limit [1].
    """
    growth = height / (slenderness * min(shafts.width, shafts.length))
    if growth > 1.0:
        wider = 1.0 if shafts.kind == "wall" else growth
        shafts = replace(shafts, width=round(wider * shafts.width, 3), length=round(growth * shafts.length, 3))
    if len(shafts.lines) < 2:
        return shafts
    pitch = float(np.diff(np.sort(shafts.lines)).min())
    width = min(shafts.width, round(pitch - 2.0 * APART, 3))
    batter = min(shafts.batter, max(0.5 * (pitch - width - APART) / height, 0.0))
    return replace(shafts, width=width, batter=batter)


def shaft_base(shafts: Shafts, height: float, skew: float = 0.0) -> F64:
    """Compute the extent of the bases of all shafts from the pier's middle.

    Args:
        shafts: Dimensions.
        height: Of the shafts [m].
        skew: Skew of the support line [rad].

    Returns:
        Half sizes perpendicular to the support line and along it [m], shape (2,), float64.
    """
    growth = shafts.batter * max(height, 0.0)
    across = max(shafts.lines) / np.cos(skew) + 0.5 * _along_support(shafts, skew).width
    return np.array([0.5 * shafts.length, across]) + growth


def shaft_surfaces(shafts: Shafts, station: float, low: float, high: float, place: Alignment) -> list[Surface]:
    """Build every shaft of one pier: with right angles on its level base, and a head along the cap's slope.

    Args:
        shafts: Dimensions.
        station: The pier's middle [m].
        low: Where they begin above the finished deck surface on the axis [m].
        high: Where they end under the cap [m].
        place: Axis of the bridge.
    """
    fall, slope = float(place.crossfall(np.array([station]))[0]), seat_slope(place, station)
    shafts = _along_support(shafts, place.skew)
    surfaces = []
    for line in shafts.lines:
        foot = low - fall * line
        level = place.frame_at(station, line, turn=-place.skew)
        frame = wedge(level, (station, line), (foot, high), high=slope)
        if shafts.arm > 0.0:
            half, outline = 0.5 * shafts.length, fork_outline(shafts, foot, high)
            surfaces.append(turned(Prism(outline, -half, half, "station", frame, shafts.chamfer).surface))
        else:
            surfaces.append(_upright(shafts, foot, high, frame))
    return surfaces


def _along_support(shafts: Shafts, skew: float) -> Shafts:
    """Lengthen walls across the whole bridge by the factor by which the skew lengthens the support line."""
    if shafts.kind != "wall" and shafts.arm == 0.0:
        return shafts
    stretch = 1.0 / float(np.cos(skew))
    return replace(shafts, width=shafts.width * (stretch if shafts.kind == "wall" else 1.0), arm=shafts.arm * stretch)


def shaft_outline(shafts: Shafts, growth: float = 0.0) -> F64:
    """Draw the plan of one shaft around its own middle.

    Args:
        shafts: Dimensions.
        growth: Widening of every side relative to the top [m].

    Returns:
        Outline (along, across) [m], shape (P, 2), float64; the same P for every growth.
    """
    half = np.array([0.5 * shafts.length, 0.5 * shafts.width]) + growth
    # A frame's legs are flush with its beam.
    shape = "rectangular" if shafts.kind == "pi_frame" else shafts.shape
    if shape == "rectangular":
        return cut_corners(rectangle((-half[0], -half[1]), (half[0], half[1])), 2.0 * shafts.chamfer)
    short, straight = min(half), abs(half[1] - half[0])
    if straight < 1e-9:
        sides = SIDES if shape == "round" else 8
        return circle(2.0 * short / (1.0 if shape == "round" else np.cos(np.pi / 8.0)), sides)
    if shape == "octagonal":
        return cut_corners(rectangle((-half[0], -half[1]), (half[0], half[1])), 0.6 * short)
    angle = np.pi * np.arange(_NOSE_SIDES + 1) / _NOSE_SIDES
    nose = short * np.stack([np.cos(angle), np.sin(angle)], axis=1) + np.array([0.0, straight])
    return np.concatenate([nose, -nose])


def _upright(shafts: Shafts, low: float, high: float, level: Alignment) -> Surface:
    if shafts.batter == 0.0:
        return Prism(shaft_outline(shafts), low, high, "above", level).surface
    rings = np.stack([shaft_outline(shafts, shafts.batter * (high - low)), shaft_outline(shafts)])
    return sweep(rings, np.array([low, high]), "above", level)


def fork_outline(shafts: Shafts, low: float, high: float) -> F64:
    """Draw the elevation of a Y or V: a stem that divides into two arms, or only widens if it is too low for that.

    Args:
        shafts: Dimensions.
        low: Where it begins above the finished deck surface [m].
        high: Where it ends [m].

    Returns:
        Outline (left, above) [m], shape (P, 2), float64.
    """
    height, stem = high - low, 0.5 * shafts.width
    head = 0.30 * shafts.width  # half an arm's width at its head
    reach = shafts.arm + head
    # The arms of a Y rise no steeper than 1.3 : 1 and take up to 70 % of its height; a V opens from its base.
    opens = low + (max(0.30 * height, height - 1.3 * (reach - stem)) if shafts.kind == "y" else 0.08 * height)
    slope = (high - opens) / (reach - stem)
    notch = max(high - slope * (shafts.arm - head - _NOTCH), opens + 0.9 * shafts.width)
    base = stem + shafts.batter * (opens - low)
    right = [(base, low), (stem, opens), (reach, high)]
    if high - notch >= _LEAST_FORK:
        right += [(shafts.arm - head, high), (_NOTCH, notch)]
    return mirrored(right)
