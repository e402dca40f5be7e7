"""Cubes, spheres, cylinders, cones, capsules and planes as polygon meshes."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Usd

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

AROUND = 32  # segments of a full turn; the error of a radius is 0.5 %
RINGS = 8  # segments of a quarter turn from the pole
SHAPES = ("Cube", "Sphere", "Cylinder", "Cylinder_1", "Cone", "Capsule", "Capsule_1", "Plane")


@dataclass(frozen=True)
class Shape:
    """A polygon mesh with smooth or creased corners.

    Attributes:
        points: Positions [stage units], shape (V, 3), float64.
        face_counts: Corners of each face, shape (F,), int64.
        corners: Vertex number of each corner, counter-clockwise from outside, shape (C,), int64.
        normals: Unit normal at each corner [1], shape (C, 3), float64.
        st: Texture coordinates at each corner [1], shape (C, 2), float64.
    """

    points: F64
    face_counts: I64
    corners: I64
    normals: F64
    st: F64


def read_shape(prim: Usd.Prim, time: Usd.TimeCode) -> Shape:
    """Turn a native gprim into a polygon mesh.

    Args:
        prim: A prim whose type is one of `SHAPES`.
        time: Time code at which it is read.
    """

    def value(name: str) -> float:
        return float(prim.GetAttribute(name).Get(time))

    kind = prim.GetTypeName()
    if kind == "Cube":
        return _cube(value("size"))
    if kind == "Sphere":
        return _lathe(_arc(value("radius"), np.pi / 2, -np.pi / 2))
    axis = str(prim.GetAttribute("axis").Get(time))
    if kind == "Plane":
        # USD's width runs along x, or along z where the plane faces x: the rotation exchanges the two sides.
        sides = value("width"), value("length")
        return _along(_plane(*(sides if axis == "Z" else sides[::-1])), axis)
    height = value("height")
    low, high = _radii(prim, value)
    if kind.startswith("Capsule"):
        up = np.array([0.0, height / 2, 0.0, 0.0])
        return _along(_lathe(np.concatenate([_arc(high, np.pi / 2, 0.0) + up, _arc(low, 0.0, -np.pi / 2) - up])), axis)
    return _along(_turned(low, high, height), axis)


def _radii(prim: Usd.Prim, value: Callable[[str], float]) -> tuple[float, float]:
    kind = prim.GetTypeName()
    if kind.endswith("_1"):
        return value("radiusBottom"), value("radiusTop")
    return value("radius"), 0.0 if kind == "Cone" else value("radius")


def _arc(radius: float, first: float, last: float) -> F64:
    """Compute the profile of a sphere between two latitudes [rad]: rows of radius, z, normal's radius, normal's z."""
    angle = np.linspace(first, last, round(abs(first - last) / (np.pi / 2)) * RINGS + 1)
    normal = np.round(np.stack([np.cos(angle), np.sin(angle)], axis=1), 12)  # a pole is one point
    return np.column_stack([radius * normal, normal]).astype(np.float64)


def _turned(low: float, high: float, height: float) -> Shape:
    """Make a cylinder or cone about z with creased rims."""
    slope = np.array([height, low - high]) / np.hypot(height, low - high)
    top, bottom = [high, height / 2], [low, -height / 2]
    pieces = [_lathe(np.array([[*top, *slope], [*bottom, *slope]]))]
    if high > 0.0:
        pieces.append(_lathe(np.array([[0.0, height / 2, 0.0, 1.0], [*top, 0.0, 1.0]])))
    if low > 0.0:
        pieces.append(_lathe(np.array([[*bottom, 0.0, -1.0], [0.0, -height / 2, 0.0, -1.0]])))
    return _joined(pieces)


def _lathe(profile: F64) -> Shape:
    """Rotate a profile from top to bottom, rows of (radius, z, normal's radius, normal's z), about z."""
    angle = np.linspace(0.0, 2 * np.pi, AROUND + 1)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    ring[-1] = ring[0]  # the seam closes exactly
    upright = np.ones((len(ring), 1))
    points = np.concatenate([profile[:, None, :1] * ring, profile[:, None, 1:2] * upright], axis=2)
    normals = np.concatenate([profile[:, None, 2:3] * ring, profile[:, None, 3:4] * upright], axis=2)
    st = np.stack(np.broadcast_arrays(angle / (2 * np.pi), np.linspace(1.0, 0.0, len(profile))[:, None]), axis=2)
    down, across = np.meshgrid(np.arange(len(profile) - 1), np.arange(AROUND), indexing="ij")
    first = (down * (AROUND + 1) + across).reshape(-1)
    quads = np.stack([first, first + AROUND + 1, first + AROUND + 2, first + 1], axis=1).reshape(-1)
    return Shape(
        points.reshape(-1, 3),
        np.full(len(quads) // 4, 4, np.int64),
        quads,
        normals.reshape(-1, 3)[quads],
        st.reshape(-1, 2)[quads],
    )


def _joined(pieces: list[Shape]) -> Shape:
    starts = np.cumsum([0, *(len(piece.points) for piece in pieces)])
    return Shape(
        np.concatenate([piece.points for piece in pieces]),
        np.concatenate([piece.face_counts for piece in pieces]),
        np.concatenate([piece.corners + start for piece, start in zip(pieces, starts, strict=False)]),
        np.concatenate([piece.normals for piece in pieces]),
        np.concatenate([piece.st for piece in pieces]),
    )


def _plane(width: float, length: float) -> Shape:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    points = np.column_stack([(square - 0.5) * [width, length], np.zeros(4)])
    return Shape(points, np.array([4]), np.arange(4), np.tile([0.0, 0.0, 1.0], (4, 1)), square)


def _cube(size: float) -> Shape:
    square = _plane(size, size)
    faces = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            # Columns of a proper rotation: the plane's x, y and z become the face's u, v and outward normal.
            turn = np.zeros((3, 3))
            turn[axis, 2] = sign
            turn[(axis + 1) % 3, 0] = 1.0
            turn[(axis + 2) % 3, 1] = sign
            points = (square.points + np.array([0.0, 0.0, size / 2])) @ turn.T
            faces.append(Shape(points, square.face_counts, square.corners, square.normals @ turn.T, square.st))
    return _joined(faces)


def _along(shape: Shape, axis: str) -> Shape:
    """Turn a shape about z into one about another axis."""
    order = {"X": [2, 0, 1], "Y": [1, 2, 0], "Z": [0, 1, 2]}[axis]
    return Shape(shape.points[:, order], shape.face_counts, shape.corners, shape.normals[:, order], shape.st)
