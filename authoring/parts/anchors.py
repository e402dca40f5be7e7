"""What holds the ends of cables: sleeves of stays, clamps and sockets of hangers, saddles, anchor blocks."""

from dataclasses import dataclass

import numpy as np

from authoring.alignment import Alignment
from authoring.component import F64
from authoring.extrusion import prism
from authoring.parts.cables import STAY_SIDES, Plane, tube
from authoring.sections import cut_corners
from authoring.sweep import Surface, joined

SUNK = 0.010  # [m] sleeves and saddles into what they stand on
HELD = 0.12  # [m] of a cable's end inside the body that holds it
_BORE = 0.001  # [m] clamp into cable


@dataclass(frozen=True)
class Sleeve:
    """A round casting on a face, along the cable that ends in it.

    Attributes:
        surface: Closed surface.
        mouth: World position on its axis where the cable leaves it [m], shape (3,), float64.
        held: World position on its axis where the cable ends inside it [m], shape (3,), float64.
    """

    surface: Surface
    mouth: F64
    held: F64


def sleeve(foot: F64, face: F64, towards: F64, radius: float, length: float) -> Sleeve:
    """Build a collar and a tapered sleeve that stand on a flat face, slanted as the cable is.

    Args:
        foot: Where the cable's axis meets the face [m], shape (3,), float64.
        face: Unit normal of the face, outward [1], shape (3,), float64.
        towards: Unit vector along the cable, away from the face [1], shape (3,), float64.
        radius: Of the collar [m].
        length: Of the sleeve beyond where its whole girth has left the face [m].
    """
    cosine = float(towards @ face)
    clear = radius * np.sqrt(max(1.0 - cosine**2, 0.0)) / cosine  # the collar's far side leaves the face here
    reach = np.array([0.0, clear + 0.25 * length, clear + 0.25 * length, clear + length])
    radii = radius * np.array([1.0, 1.0, 0.70, 0.62])
    surface = tube(foot + reach[:, None] * towards, radii, STAY_SIDES, Plane(foot - SUNK * face, face))
    end = float(reach[-1])
    return Sleeve(surface, foot + end * towards, foot + (end - min(HELD, 0.5 * length)) * towards)


def sleeve_reach(radius: float, cosine: float) -> float:
    """Find how far a slanted collar spreads on its face, to either side of its axis [m].

    Args:
        radius: Of the collar [m].
        cosine: Of the angle between the cable and the face's normal [1].
    """
    return radius / cosine


def clamp(centre: F64, along: F64, radius: float, length: float, lug: float, hanger: float) -> Surface:
    """Build a clamp: a ring round the main cable, and a lug under it that takes the hanger.

    Args:
        centre: Point on the cable's axis [m], shape (3,), float64.
        along: Unit vector along the cable [1], shape (3,), float64.
        radius: Of the cable [m].
        length: Of the ring along the cable [m].
        lug: Of the lug below the cable [m].
        hanger: Radius of the hanger that ends in the lug [m].
    """
    wall = 0.02 + 0.35 * radius
    ring = _pipe(centre - 0.5 * length * along, centre + 0.5 * length * along, radius - _BORE, radius + wall, 16)
    top = centre + np.array([0.0, 0.0, -radius - 0.75 * wall])
    bottom = centre + np.array([0.0, 0.0, -radius - wall - lug])
    return joined([ring, tube(np.stack([top, bottom]), max(0.04, 0.4 * radius, hanger + 0.01), 8)])


def hanger_socket(foot: F64, radius: float, length: float) -> Surface:
    """Build the upright socket of a hanger: a plate, and the socket on it.

    Args:
        foot: Middle of the face that it stands on [m], shape (3,), float64.
        radius: Of the hanger [m].
        length: Of the socket above the face [m].
    """
    rise = np.array([-SUNK, 0.03, 0.03, 0.6 * length, length])
    radii = radius * np.array([3.2, 3.2, 2.2, 2.2, 1.9])
    return tube(foot + rise[:, None] * np.array([0.0, 0.0, 1.0]), radii, 8)


def saddle_outline(station: float, top: float, length: float, depth: float) -> F64:
    """Draw the elevation of a saddle: broad at its foot, rounded on top, with open throats towards both spans.

    Args:
        station: Axis of the tower [m].
        top: Height of the cable's crown [m].
        length: Along the bridge [m].
        depth: From the crown down to the tower's top [m].

    Returns:
        Outline (station, above) [m], shape (P, 2), float64.
    """
    half = 0.5 * length
    bend = np.linspace(-1.0, 1.0, 9)[::-1]
    crown = np.stack([0.96 * half * bend, 0.30 * depth - 0.42 * depth * bend**2], axis=1)
    foot = np.array([(-half, -depth - SUNK), (half, -depth - SUNK), (half, -0.75 * depth)])
    outline = np.concatenate([foot, crown, [(-half, -0.75 * depth)]])
    return outline + np.array([station, top])


def saddle(station: float, left: float, top: float, size: tuple[float, float, float], place: Alignment) -> Surface:
    """Build a saddle on a tower's top.

    Args:
        station: Axis of the tower [m].
        left: Plane of the cable [m].
        top: Height of the cable's crown [m].
        size: Length along the bridge, width, and depth from the crown to the tower's top [m].
        place: Level frame of the tower.
    """
    length, width, depth = size
    outline = saddle_outline(station, top, length, depth)
    return prism(outline, left - 0.5 * width, left + 0.5 * width, "left", place, 0.02)


def anchor_block(
    front: float, back: float, lefts: tuple[float, float], heights: tuple[float, float], place: Alignment
) -> Surface:
    """Build an anchor block: upright towards the cable, its top falling to the rear.

    Args:
        front: Station of the face that the cable enters [m].
        back: Station of its rear [m].
        lefts: Its sides, distance to the left of the axis, rising [m].
        heights: Its foot and the top of its front [m].
        place: Level frame of the block.
    """
    low, high = heights
    fall = 0.25 * abs(back - front)
    if back > front:
        outline = np.array(
            [(front, low), (back, low), (back, high - fall), (front + 0.35 * (back - front), high), (front, high)]
        )
    else:
        outline = np.array(
            [(back, low), (front, low), (front, high), (front + 0.35 * (back - front), high), (back, high - fall)]
        )
    outline = cut_corners(outline, np.where(outline[:, 1] > low, 0.03, 0.0))
    return prism(outline, *lefts, "left", place, 0.03)


def _pipe(begin: F64, end: F64, inner: float, outer: float, sides: int) -> Surface:
    """Build a pipe: two tubes, the inner one turned inside out, and the rings that join their ends."""
    shell = tube(np.stack([begin, begin, end, end]), np.array([inner, outer, outer, inner]), sides)
    quads = 3 * sides
    # The two end faces give way to the bore.
    j = np.arange(sides)
    k = (j + 1) % sides
    last = 3 * sides
    bore = np.stack([j, last + j, last + k, k], axis=1)
    first_ring, along = shell.points[:sides], end - begin
    radial = first_ring - begin
    radial /= np.linalg.norm(radial, axis=1, keepdims=True)
    chord = 2.0 * inner * np.sin(np.pi / sides)
    length = float(np.linalg.norm(along))
    along_st = length * np.tile(np.array([0.0, 1.0, 1.0, 0.0]), (sides, 1))
    st: F64 = np.stack([along_st, np.stack([j, j, j + 1, j + 1], axis=1) * chord], axis=2, dtype=np.float64)
    corners = 4 * quads
    return Surface(
        points=shell.points,
        face_counts=np.full(quads + sides, 4, np.int32),
        corners=np.concatenate([shell.corners[:corners], bore.ravel()]).astype(np.int32),
        normals=np.concatenate([shell.normals[:corners], -radial[np.stack([j, j, k, k], axis=1)].reshape(-1, 3)]),
        st=np.concatenate([shell.st[:corners], st.reshape(-1, 2)]),
        chart=np.concatenate([shell.chart[:quads], np.full(sides, 3)]).astype(np.int32),
    )
