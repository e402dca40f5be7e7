"""Car parks: bays in rows on both sides of aisles, the asphalt with straight kerbs round it, and the painted lines."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.kerbs import Spots
from authoring.backgrounds.pavements import PAINT
from authoring.backgrounds.quads import quad_mesh
from authoring.shapes.component import Mesh
from authoring.site.grid import HeightField, surface_normals

F64 = NDArray[np.float64]
Ground = Callable[[F64], F64]  # heights [m] of world positions in plan [m], shape (N, 2)

BAY, DEEP, AISLE = 2.5, 5.0, 6.0  # width and depth of a bay, width of an aisle [m]
MODULE = 2 * DEEP + AISLE  # an aisle with a row of bays on each side [m]
RISE = 0.04  # least height of the asphalt above the ground [m]
KERB_HIGH, KERB_WIDE = 0.12, 0.15  # of a kerb over the asphalt [m]
_BURIED = 0.5  # depth of a kerb's outer face in the ground [m]
_PROBE = 0.5  # distance of places at which the ground is compared with the asphalt [m]
_LINE = 0.05  # half the width of a painted line [m]


@dataclass(frozen=True)
class Lot:
    """A rectangle for a car park: its rows along x, its entry on the side of the highest y.

    Attributes:
        corner: World position of its local origin [m].
        heading: Direction of its x, counter-clockwise from +x of the world [rad].
        size: Its extent along x and y [m].
        first: The aisle to the entry lies at the low end of x, else at the high end.
    """

    corner: tuple[float, float]
    heading: float
    size: tuple[float, float]
    first: bool = True

    def world(self, local: F64) -> F64:
        """Turn local positions into world positions in plan.

        Args:
            local: Local positions [m], shape (..., 2), float64.

        Returns:
            World positions [m], the same shape (..., 2), float64.
        """
        cosine, sine = np.cos(self.heading), np.sin(self.heading)
        return local @ np.array([[cosine, sine], [-sine, cosine]]) + np.asarray(self.corner)

    def local(self, world: F64) -> F64:
        """Turn world positions in plan into local ones.

        Args:
            world: World positions [m], shape (..., 2), float64.

        Returns:
            Local positions [m], the same shape (..., 2), float64.
        """
        cosine, sine = np.cos(self.heading), np.sin(self.heading)
        return (world - np.asarray(self.corner)) @ np.array([[cosine, -sine], [sine, cosine]])

    @property
    def entry(self) -> tuple[float, float]:
        """Lowest and highest x of the aisle to the entry [m]."""
        return (0.0, AISLE) if self.first else (self.size[0] - AISLE, self.size[0])


def rows_of(depth: float) -> list[tuple[float, float]]:
    """Divide a depth into rows of bays.

    Args:
        depth: Depth of a lot [m].

    Returns:
        Lowest y of each row [m] and where the cars in it head along y [1], from the lowest on; a lot that is too narrow
        for two rows has one, with the aisle on its far side, or none.
    """
    count = int(depth // MODULE)
    margin = 0.5 * (depth - count * MODULE)
    if not count:
        return [(0.5 * (depth - DEEP - AISLE), -1.0)] if depth >= DEEP + AISLE else []
    starts = [margin + MODULE * number for number in range(count)]
    return [row for start in starts for row in ((start, -1.0), (start + DEEP + AISLE, 1.0))]


def bays(lot: Lot) -> F64:
    """List the bays of a lot.

    Args:
        lot: The lot.

    Returns:
        Local x and y of the middle [m], and where a car heads along y [1], shape (N, 3), float64.
    """
    at = _lines_between(lot)
    middles = 0.5 * (at[:-1] + at[1:])
    rows = [
        np.column_stack([middles, np.full((len(middles), 2), (low + 0.5 * DEEP, way))])
        for low, way in rows_of(lot.size[1])
    ]
    return np.concatenate([np.zeros((0, 3)), *rows])


def bay_spots(lot: Lot, level: Ground) -> Spots:
    """List the places of cars in the bays of a lot.

    Args:
        lot: The lot.
        level: Height of its surface.
    """
    found = bays(lot)
    world = lot.world(found[:, :2])
    return Spots(np.column_stack([world, level(world)]), lot.heading + 0.5 * np.pi * found[:, 2])


def bay_lines(lot: Lot) -> F64:
    """List the lines between bays, and between rows that meet: middle and half sizes [m], shape (N, 4), float64.

    A line is as long as half a bay is deep, so that it follows the ground.

    Args:
        lot: The lot.
    """
    at, rows = _lines_between(lot), rows_of(lot.size[1])
    halves = [low + share * DEEP for low, _ in rows for share in (0.25, 0.75)]
    lines = [np.column_stack([at, np.full((len(at), 3), (middle, _LINE, 0.25 * DEEP))]) for middle in halves]
    middles = 0.5 * (at[:-1] + at[1:])
    starts = {round(low, 6) for low, _ in rows}
    shared = sorted({round(low + DEEP, 6) for low, _ in rows} & starts)
    lines += [np.column_stack([middles, np.full((len(middles), 3), (y, 0.5 * BAY, _LINE))]) for y in shared]
    return np.concatenate([np.zeros((0, 4)), *lines])


def painted(lot: Lot, lines: F64, level: Ground) -> F64:
    """Paint lines on the surface of a lot.

    Args:
        lot: The lot.
        lines: Middle and half sizes of each [m], shape (N, 4), float64.
        level: Height of the surface.

    Returns:
        Faces in world space [m], shape (N, 4, 3), float64.
    """
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float64)
    corners = lot.world(lines[:, None, :2] + signs * lines[:, None, 2:])
    height = level(corners.reshape(-1, 2)).reshape(-1, 4)
    return np.concatenate([corners, height[..., None] + PAINT], axis=-1)


def graded(lot: Lot, ground: Ground) -> HeightField:
    """Find the surface of a lot, everywhere at least `RISE` above the ground, in cells that end at lines and kerbs.

    Args:
        lot: The lot.
        ground: Height of the ground.

    Returns:
        Heights over local positions.
    """
    rows = [low for low, _ in rows_of(lot.size[1])]
    xs = _divided([0.0, lot.size[0], *_lines_between(lot)])
    ys = _divided([0.0, lot.size[1], *rows, *(low + DEEP for low in rows)])
    nodes = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1)
    heights = ground(lot.world(nodes.reshape(-1, 2))).reshape(len(xs), len(ys)) + RISE
    probes = [np.arange(0.0, side + 0.5 * _PROBE, _PROBE).clip(max=side) for side in lot.size]
    x, y = (axis.ravel() for axis in np.meshgrid(*probes, indexing="ij"))
    lacking = ground(lot.world(np.column_stack([x, y]))) + RISE - HeightField(xs, ys, heights)(x, y)
    row, column = (np.clip(np.searchsorted(line, at, "right") - 1, 0, len(line) - 2) for line, at in ((xs, x), (ys, y)))
    raised = np.zeros_like(heights)
    for ahead, aside in ((0, 0), (1, 0), (0, 1), (1, 1)):  # all corners of the cell, so that every point rises
        np.maximum.at(raised, (row + ahead, column + aside), lacking)
    return HeightField(xs, ys, heights + raised)


def surface_mesh(lot: Lot, surface: HeightField) -> Mesh:
    """Build the surface of a lot.

    Args:
        lot: The lot.
        surface: Heights over local positions.
    """
    nodes, faces = surface.nodes(), surface.triangles()
    used = faces.reshape(-1)
    turned = _upright(lot, surface_normals(nodes, faces))
    points = np.column_stack([lot.world(nodes[:, :2]), nodes[:, 2]])
    return Mesh(
        points=points,
        face_counts=np.full(len(faces), 3, np.int32),
        corners=used.astype(np.int32),
        normals=turned[used].astype(np.float32),
        st=points[used, :2].astype(np.float32),
    )


def kerb_mesh(lot: Lot, surface: HeightField, ground: Ground) -> Mesh:
    """Build the kerbs round a lot, open at its entry.

    Args:
        lot: The lot.
        surface: Heights over local positions.
        ground: Height of the ground.
    """
    xs, ys = surface.stations, surface.lefts
    (length, depth), (low, high) = lot.size, lot.entry
    sides = (
        (np.column_stack([xs, np.zeros(len(xs))]), (0.0, -1.0)),
        (np.column_stack([np.full(len(ys), length), ys]), (1.0, 0.0)),
        (np.column_stack([xs, np.full(len(xs), depth)])[::-1], (0.0, 1.0)),
        (np.column_stack([np.zeros(len(ys)), ys])[::-1], (-1.0, 0.0)),
    )
    faces = []
    for line, out in sides:
        start, end = line[:-1], line[1:]
        middle = 0.5 * (start[:, 0] + end[:, 0])
        closed = (out[1] <= 0.0) | (middle < low) | (middle > high)
        faces.append(_kerb(lot, (start[closed], end[closed]), np.asarray(out), surface, ground))
    return quad_mesh(np.concatenate(faces))


def _kerb(lot: Lot, line: tuple[F64, F64], out: F64, surface: HeightField, ground: Ground) -> F64:
    """Build a straight kerb along a side of a lot: inner face, top, outer face and ends, shape (F, 4, 3), float64."""
    start, end = line
    ahead = KERB_WIDE * np.array([-out[1], out[0]])
    outer = (
        start + KERB_WIDE * out - ahead * _at_corner(lot, start, out),
        end + KERB_WIDE * out + ahead * _at_corner(lot, end, out),
    )
    first, last = surface(*start.T)[:, None], surface(*end.T)[:, None]
    a, b, c, d = (
        np.hstack([lot.world(places), level + KERB_HIGH])
        for places, level in zip((start, end, *outer[::-1]), (first, last, last, first), strict=True)
    )
    low_a, low_b = (top - np.array([0.0, 0.0, KERB_HIGH + 0.02]) for top in (a, b))
    low_c, low_d = (np.column_stack([top[:, :2], ground(top[:, :2]) - _BURIED]) for top in (c, d))
    open_first, open_last = ((out[1] > 0.0) & (np.abs(places[:, :1] - lot.entry).min(axis=1) < 1e-6) for places in line)
    quads = [(low_b, low_a, a, b), (a, d, c, b), (low_d, low_c, c, d)]
    ends = [(low_a, low_d, d, a), (low_c, low_b, b, c)]
    faces = [np.stack(quad, axis=1) for quad in quads]
    faces += [np.stack(quad, axis=1)[seen] for quad, seen in zip(ends, (open_first, open_last), strict=True)]
    return np.concatenate(faces)


def _at_corner(lot: Lot, places: F64, out: F64) -> F64:
    """Whether the ends of a side's outer edge lie at a corner of the lot, where two kerbs meet, shape (N, 1)."""
    along = int(abs(out[0]) > 0.5)
    at, reach = places[:, along], lot.size[along]
    return ((at < 1e-6) | (at > reach - 1e-6)).astype(np.float64)[:, None]


def _upright(lot: Lot, normals: F64) -> F64:
    """Turn local normals into world space, shape (N, 3), float64."""
    turned = lot.world(normals[:, :2]) - np.asarray(lot.corner)
    return np.column_stack([turned, normals[:, 2]])


def _lines_between(lot: Lot) -> F64:
    """List the x of the lines between the bays of a row [m], shape (N,), float64."""
    free = lot.size[0] - AISLE
    count = int(free // BAY)
    start = AISLE if lot.first else free - count * BAY
    return start + BAY * np.arange(count + 1, dtype=np.float64)


def _divided(breaks: list[float]) -> F64:
    """Divide a range at given places, and further into steps of at most 3 m, shape (N,), float64."""
    at = np.unique(np.round(breaks, 6))
    pieces: list[F64] = [np.linspace(a, b, int(np.ceil((b - a) / 3.0 - 1e-9)) + 1) for a, b in pairwise(at.tolist())]
    return np.unique(np.round(np.concatenate(pieces), 6))
