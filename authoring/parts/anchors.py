"""Anchorages and supports of cables: sleeves of stays, clamps and sockets of hangers, saddles, anchor blocks."""

from dataclasses import dataclass

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.cables import STAY_SIDES, Plane, tubes
from authoring.shapes.component import F64
from authoring.shapes.sections import cut_corners
from authoring.solids.extrusion import Prism
from authoring.solids.sweep import Surface, joined

SUNK = 0.010  # [m] embedment of sleeves and saddles in their support
HELD = 0.12  # [m] length of a cable's end inside its anchorage
_BORE = 0.001  # [m] embedment of a clamp in the cable


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


def sleeves(feet: F64, faces: F64, towards: F64, radius: float, lengths: F64) -> list[Sleeve]:
    """Build collars and tapered sleeves that stand on flat faces, slanted as the cables are.

    Args:
        feet: Where each cable's axis meets its face [m], shape (N, 3), float64.
        faces: Unit normals of the faces, outward [1], shape (N, 3), float64.
        towards: Unit vectors along the cables, away from the faces [1], shape (N, 3), float64.
        radius: Of the collars [m].
        lengths: Lengths of the sleeves beyond the point where their full section is outside the face [m], shape (N,),
            float64.
    """
    cosines = np.sum(towards * faces, axis=1)
    clear = radius * np.sqrt(np.maximum(1.0 - cosines**2, 0.0)) / cosines  # here the collar's far side leaves the face
    reach = clear[:, None] + lengths[:, None] * np.array([0.0, 0.25, 0.25, 1.0])
    reach[:, 0] = 0.0
    radii = radius * np.array([1.0, 1.0, 0.70, 0.62])
    cut = Plane(feet - SUNK * faces, faces)
    surfaces = tubes(feet[:, None] + reach[..., None] * towards[:, None], radii, STAY_SIDES, cut)
    mouths = feet + reach[:, -1:] * towards
    held = mouths - np.minimum(HELD, 0.5 * lengths)[:, None] * towards
    return [Sleeve(*each) for each in zip(surfaces, mouths, held, strict=True)]


def clamps(centers: F64, along: F64, radius: float, length: float, lug: float, hanger: float) -> list[Surface]:
    """Build clamps: each a ring round the main cable, and a lug under it that takes the hanger.

    Args:
        centers: Points on the cable's axis [m], shape (N, 3), float64.
        along: Unit vectors along the cable [1], shape (N, 3), float64.
        radius: Of the cable [m].
        length: Of the ring along the cable [m].
        lug: Of the lug below the cable [m].
        hanger: Radius of the hanger that ends in the lug [m].
    """
    wall, up = 0.02 + 0.35 * radius, np.array([0.0, 0.0, 1.0])
    half = 0.5 * length * along
    rings = _pipes(centers - half, centers + half, radius - _BORE, radius + wall, 16)
    ends = np.stack([centers - (radius + 0.75 * wall) * up, centers - (radius + wall + lug) * up], axis=1)
    lugs = tubes(ends, max(0.04, 0.4 * radius, hanger + 0.01), 8)
    return [joined([ring, below]) for ring, below in zip(rings, lugs, strict=True)]


def hanger_sockets(feet: F64, radius: float, length: float) -> list[Surface]:
    """Build the upright sockets of hangers: each a plate, and the socket on it.

    Args:
        feet: Middles of the faces that they stand on [m], shape (N, 3), float64.
        radius: Of the hangers [m].
        length: Of a socket above the face [m].
    """
    rise = np.array([-SUNK, 0.03, 0.03, 0.6 * length, length])
    radii = radius * np.array([3.2, 3.2, 2.2, 2.2, 1.9])
    return tubes(feet[:, None] + rise[:, None] * np.array([0.0, 0.0, 1.0]), radii, 8)


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
    return Prism(outline, left - 0.5 * width, left + 0.5 * width, "left", place, 0.02).surface


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
    return Prism(outline, *lefts, "left", place, 0.03).surface


def _pipes(begin: F64, end: F64, inner: float, outer: float, sides: int) -> list[Surface]:
    """Build pipes: each two tubes, the inner one with inverted faces, and the rings that join their ends."""
    shells = tubes(np.stack([begin, begin, end, end], axis=1), np.array([inner, outer, outer, inner]), sides)
    quads = 3 * sides
    # The two end faces are cut out for the bore.
    j = np.arange(sides)
    k = (j + 1) % sides
    bore = np.stack([j, quads + j, quads + k, k], axis=1)
    chord = 2.0 * inner * np.sin(np.pi / sides)
    radial = np.stack([shell.points[:sides] for shell in shells]) - begin[:, None]
    radial /= np.linalg.norm(radial, axis=2, keepdims=True)
    inward = -radial[:, np.stack([j, j, k, k], axis=1)].reshape(len(begin), -1, 3)
    st = np.stack([np.tile([0.0, 1.0, 1.0, 0.0], (sides, 1)), np.stack([j, j, j + 1, j + 1], axis=1) * chord], axis=2)
    lengths = np.linalg.norm(end - begin, axis=1)
    counts = np.full(quads + sides, 4, np.int32)
    corners = np.concatenate([shells[0].corners[: 4 * quads], bore.ravel()]).astype(np.int32)
    chart = np.concatenate([shells[0].chart[:quads], np.full(sides, 3)]).astype(np.int32)
    return [
        Surface(
            shell.points,
            counts,
            corners,
            np.concatenate([shell.normals[: 4 * quads], inside]),
            np.concatenate([shell.st[: 4 * quads], st.reshape(-1, 2) * (length, 1.0)]),
            chart,
        )
        for shell, inside, length in zip(shells, inward, lengths.tolist(), strict=True)
    ]
