"""Elevation of a cable-stayed bridge: pylons outside the traffic's clearance, stays within limits of slope."""

from dataclasses import dataclass, replace

import numpy as np

from authoring.families.stayed_choices import Choice
from authoring.parts.pylons import Pylon, anchor_faces
from authoring.parts.stays import STEEPEST, HeadZone, Run, Stays, collar_of, head_heights
from groundwork.errors import InputError

GAUGE = {"road": 4.7, "rail": 6.0}  # [m] clear height over the finished surface
FLATTEST = 20.0  # [deg] of the outermost stay
_CLEAR = 0.25  # [m] beside the gauge
_LEG_GAP = 0.35  # [m] between deck and leg
_WIDEST_STRIP = 2.4  # [m]
_END = 1.2  # [m] from the last bearing line back to the outermost foot
_MOST_LEAN = 0.55  # [1] largest inclination of the legs of an A or a diamond
_MOST = 24  # largest number of stays on one side in one plane


class NoRoomForStays(InputError):
    """The main span is too short for three stays at the wanted pitch; a drawn span may be lengthened."""


@dataclass(frozen=True)
class Frame:
    """Dimensions that the elevation must fit.

    Attributes:
        width: Deck without its edge strips [m].
        kerb: From the axis to the kerb's face [m].
        gauge: Clear height [m].
        foot: Height of the face that stays stand on [m].
        seat: Top of the lower cross beam [m].
        height: Pylon over the deck [m].
        leg: Scale of the legs [1].
        drop: From the lower cross beam's top to the ground datum, about [m].
        zone: Lowest head of a semi-fan over the height [1].
    """

    width: float
    kerb: float
    gauge: float
    foot: float
    seat: float
    height: float
    leg: float
    drop: float
    zone: float


def leg_size(frame: Frame) -> tuple[float, float]:
    """Find a leg's width across and length along the bridge [m].

    Args:
        frame: Dimensions that the elevation must fit.
    """
    length = round(frame.leg * (0.75 + 0.035 * (frame.height + frame.drop)), 2)
    return round(max(0.72 * length, 0.8), 2), length


def pylon_of(choice: Choice, frame: Frame, strip: float) -> tuple[Pylon, float]:
    """Choose the pylon's dimensions for a deck with edge strips.

    Args:
        choice: Kind of the bridge.
        frame: Dimensions that it must fit.
        strip: Width of each strip [m].

    Returns:
        The pylon, and the feet of the stays, distance to the left of the axis [m].
    """
    width, length = leg_size(frame)
    half = 0.5 * frame.width + strip
    beam = round(0.7 + 0.06 * half * 2.0, 2)
    line, knee = half + _LEG_GAP + 0.5 * width, frame.seat - 0.5 * beam
    base = Pylon(
        shape=choice.shape,
        top=frame.height,
        seat=frame.seat,
        knee=knee,
        merge=0.0,
        knee_line=line,
        merge_line=0.0,
        foot_lean=0.0,
        width=width,
        length=length,
        beam_depth=beam,
        upper_beams=(),
    )
    match choice.shape:
        case "mast":
            pier, crosshead = round(max(0.32 * half * 2.0, 2.2 * width), 2), round(0.62 * half, 2)
            return replace(base, knee_line=pier, merge_line=crosshead, merge=1.0, knee=0.0), 0.0
        case "portal":
            upper = frame.height - 0.4 * beam - 0.12
            return replace(base, merge=0.5 * frame.height, merge_line=line, upper_beams=(upper,)), line
        case "h":
            upper = frame.gauge + 0.5 + 0.4 * beam
            merge, plane = upper + 0.4 * beam + 0.2, round(half - 0.5 * strip, 3)
            return replace(base, knee=max(0.0, knee), merge=merge, merge_line=plane, upper_beams=(upper,)), plane
        case _:
            plane = 0.0 if choice.planes == 1 else half - 0.5 * strip
            return _headed(base, choice, frame, line), plane


def _headed(base: Pylon, choice: Choice, frame: Frame, line: float) -> Pylon:
    """Incline the legs from beside the deck until they meet."""
    width = base.width
    meet = 0.5 * width + 0.01
    merge = frame.height - max(1.6 * width, 0.12 * frame.height)
    if choice.shape == "diamond":
        merge = _lowest_head(choice, frame) - 0.5
    slope = (line - meet) / merge
    knee_line = line - slope * base.knee
    upper = (0.5 * frame.height,) if choice.shape == "a" and frame.height > 32.0 else ()
    if choice.shape == "a":
        return replace(base, merge=merge, merge_line=meet, knee_line=knee_line, foot_lean=slope, upper_beams=upper)
    foot = max(0.5 * width + 0.5, 0.30 * knee_line)
    lean = min((knee_line - foot) / max(frame.drop - 0.5 * base.beam_depth, 1.0), 0.5)
    return replace(
        base, merge=merge, merge_line=meet, knee_line=knee_line, foot_lean=-lean, foot_line=0.5 * width + 0.4
    )


def _top_head(choice: Choice, frame: Frame) -> float:
    return frame.height - 0.6 - 2.0 * collar_of(choice.diameter)


def _offsets(choice: Choice, frame: Frame, lowest: float, least: float) -> tuple[float, ...]:
    """Place the feet in the main span, from the pylon's axis [m]."""
    _, length = leg_size(frame)
    near = max(1.15 * choice.pitch, 0.5 * length + 2.0, (lowest - frame.foot) / STEEPEST + 0.5 * length, least)
    if choice.pitch == 0.0:  # the seven stays of the paper
        far = 0.875 * 0.5 * choice.main if choice.pylons == 2 else 0.875 * choice.main
        return tuple(float(x) for x in np.round(np.linspace(max(near, far / 7.0), far, 7), 3))
    share = 0.5 if choice.pylons == 2 else 1.0
    end = 0.5 * choice.pitch if choice.pylons == 2 else max(_END, 0.35 * choice.pitch)
    far = share * choice.main - end
    count = int(np.clip(round((far - near) / choice.pitch) + 1, 3, _MOST))
    if (far - near) / (count - 1) < 1.2:
        most = max((share * choice.main - near) / 3.0, 2.5)
        raise NoRoomForStays(
            "leaves no room for three stays on each side",
            field="bridge.cable_stayed.pitch",
            value=choice.pitch,
            allowed=f"at most {most:.1f} m here",
            hint="Reduce it, or choose a longer main span",
        )
    return tuple(float(x) for x in np.round(np.linspace(near, far, count), 3))


def _lowest_head(choice: Choice, frame: Frame, least: float = 0.0) -> float:
    return _heads(choice, frame, least)[1][0]


def _heads(choice: Choice, frame: Frame, least: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Place feet and heads, in two passes: the innermost stay's slope depends on the height of the lowest head."""
    top = _top_head(choice, frame)
    _, length = leg_size(frame)
    face = (0.5 * length + 0.010 * (frame.height - top), 0.010)
    zone = max(frame.zone * frame.height, least)
    lowest = zone if choice.arrangement == "semi_fan" else 0.85 * top
    near = 0.0
    if choice.arrangement == "harp":
        lowest = max(least, 0.0)
        far = 0.5 * choice.main if choice.pylons == 2 else choice.main
        slope = (top - frame.foot) / (far - face[0])
        near = (max(least, frame.foot + 3.0) - frame.foot) / slope + face[0] + 0.1 if least else 0.0
    offsets = _offsets(choice, frame, lowest, near)
    heads = HeadZone(frame.foot, top, zone, collar_of(choice.diameter), face[1])
    lowest = head_heights(choice.arrangement, _runs(choice, offsets, face), heads)[0]
    offsets = _offsets(choice, frame, lowest, near)
    return offsets, head_heights(choice.arrangement, _runs(choice, offsets, face), heads)


def _runs(choice: Choice, offsets: tuple[float, ...], face: tuple[float, float]) -> tuple[Run, ...]:
    """Find the length of each stay along the bridge from the pylon's face: in the main span, and the least."""
    half = face[0]
    shrink = min((choice.side - _END - half) / (offsets[-1] - half), 1.0)
    return tuple((x - half, shrink * (x - half)) for x in offsets)


def stays_of(choice: Choice, frame: Frame, pylon: Pylon, plane: float) -> Stays:
    """Place the stays.

    Args:
        choice: Kind of the bridge.
        frame: Dimensions that they must fit.
        pylon: Their pylon.
        plane: Their feet, distance to the left of the axis [m].
    """
    least = pylon.merge + 0.3 if choice.shape == "h" else 0.0
    offsets, heads = _heads(choice, frame, least)
    half = pylon.face(heads[-1])
    shrink = (choice.side - _END - half) / (offsets[-1] - half)
    return Stays(
        choice.arrangement,
        choice.planes,
        round(plane, 3),
        frame.foot,
        offsets,
        tuple(round(h, 6) for h in heads),
        shrink,
        choice.diameter,
    )


def clears_traffic(choice: Choice, frame: Frame, pylon: Pylon, stays: Stays) -> bool:
    """Check whether legs and stays are outside the traffic's clearance gauge.

    Args:
        choice: Kind of the bridge.
        frame: Dimensions that the elevation must fit.
        pylon: The pylon.
        stays: The stays.
    """
    if choice.shape == "mast":
        return True
    leg = pylon.line(frame.gauge) - 0.5 * pylon.width >= frame.kerb + _CLEAR
    if choice.planes == 1:
        return leg
    low = stays.heights[0]
    head = abs(anchor_faces(pylon, low, 1, stays.collar + 0.05)[1])
    at_gauge = stays.plane + (head - stays.plane) * (frame.gauge - stays.foot) / (low - stays.foot)
    return leg and at_gauge - stays.collar >= frame.kerb + 0.5 * _CLEAR


def fit(choice: Choice, frame: Frame, strip: float) -> tuple[Pylon, Stays, float] | None:
    """Widen the edge strips until the clearance is free; None if they would be too wide.

    Args:
        choice: Kind of the bridge.
        frame: Dimensions that the elevation must fit.
        strip: Width of each strip to begin with [m].

    Returns:
        Pylon, stays and width of each strip [m], or None.
    """
    while strip <= _WIDEST_STRIP:
        pylon, plane = pylon_of(choice, frame, strip)
        if not pylon.headed or (pylon.merge > 0.4 * frame.height and pylon.lean < _MOST_LEAN):
            stays = stays_of(choice, frame, pylon, plane)
            if clears_traffic(choice, frame, pylon, stays):
                return pylon, stays, strip
        strip = round(strip + 0.1, 3)
    return None
