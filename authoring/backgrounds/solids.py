"""Flat-faced solids for buildings: boxes, gabled walls, roof slabs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.shapes.component import Mesh

F64 = NDArray[np.float64]

_SIDES = {
    "z": [0, 2, 3, 1],
    "Z": [4, 5, 7, 6],
    "y": [0, 1, 5, 4],
    "Y": [2, 6, 7, 3],
    "x": [0, 4, 6, 2],
    "X": [1, 3, 7, 5],
}


@dataclass(frozen=True)
class Frame:
    """A local frame: x along the ridge, y to its left, z up from the floor.

    Attributes:
        station: Station of its origin [m].
        left: Distance of its origin to the left of the axis [m].
        height: World height of its origin [m].
        heading: Direction of x from the axis [rad].
    """

    station: float
    left: float
    height: float
    heading: float

    def turned(self, vectors: F64) -> F64:
        """Rotate local directions into bridge axes.

        Args:
            vectors: Local positions [m] or directions [1], shape (N, 3), float64.

        Returns:
            The same in bridge axes [m or 1], shape (N, 3), float64.
        """
        cosine, sine = np.cos(self.heading), np.sin(self.heading)
        x, y, z = vectors.T
        return np.stack([x * cosine - y * sine, x * sine + y * cosine, z], axis=1)

    def placed(self, points: F64) -> F64:
        """Place local points in bridge coordinates.

        Args:
            points: Local positions [m], shape (N, 3), float64.

        Returns:
            Station, left and height [m], shape (N, 3), float64.
        """
        return self.turned(points) + np.array([self.station, self.left, self.height])


def box(
    frame: Frame, center: tuple[float, float, float], half: tuple[float, float, float], sides: str = "zZyYxX"
) -> Mesh:
    """Make a box.

    Args:
        frame: Local frame.
        center: Its middle [m].
        half: Half its sizes [m].
        sides: Sides wanted: small letters face along the negative axis, capitals along the positive one.

    Returns:
        The mesh, closed if it has all sides.
    """
    signs = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], np.float64)
    return solid(frame, np.asarray(center) + signs * np.asarray(half), [_SIDES[side] for side in sides])


def gabled_walls(frame: Frame, half: tuple[float, float], levels: tuple[float, float, float]) -> Mesh:
    """Make the walls of a house as one solid up to the underside of its roof.

    Args:
        frame: Local frame.
        half: Half its length and width [m].
        levels: Foot, eaves and ridge [m].

    Returns:
        A closed mesh.
    """
    (x, y), (foot, eaves, ridge) = half, levels
    gable = [(-y, foot), (y, foot), (y, eaves), (0.0, ridge), (-y, eaves)]
    points = np.array([(end, *corner) for end in (-x, x) for corner in gable])
    faces = [[4, 3, 2, 1, 0], [5, 6, 7, 8, 9]]
    faces += [[start, ahead, 5 + ahead, 5 + start] for start, ahead in ((0, 1), (1, 2), (2, 3), (3, 4), (4, 0))]
    return solid(frame, points, faces)


def roof_slab(frame: Frame, half: tuple[float, float], eaves: float, ridge: float, thickness: float) -> Mesh:
    """Make a gabled roof of constant thickness that encloses the walls' top.

    Args:
        frame: Local frame.
        half: Half its length and width with the overhangs [m].
        eaves: Height of the walls' roof plane at the overhang's edge [m].
        ridge: Height of that plane at the ridge [m].
        thickness: Vertical thickness [m].

    Returns:
        A closed mesh.
    """
    x, y = half
    under, over = -0.04, thickness
    profile = [(-y, eaves + under), (0.0, ridge + under), (y, eaves + under)]
    profile += [(y, eaves + over), (0.0, ridge + over), (-y, eaves + over)]
    points = np.array([(end, *corner) for end in (-x, x) for corner in profile])
    faces = [[5, 4, 1, 0], [4, 3, 2, 1], [6, 7, 10, 11], [7, 8, 9, 10]]
    faces += [[start, (start + 1) % 6, 6 + (start + 1) % 6, 6 + start] for start in range(6)]
    return solid(frame, points, faces)


def solid(frame: Frame, points: F64, faces: list[list[int]]) -> Mesh:
    """Convert a flat-faced solid to a mesh: flat normals, and `st` in meters along and up each face.

    Args:
        frame: Local frame.
        points: Local positions [m], shape (V, 3), float64.
        faces: Convex faces, counter-clockwise from outside.

    Returns:
        The mesh in bridge coordinates.
    """
    normals, st = [], []
    for face in faces:
        corner = points[face]
        normal = _cross(corner[1] - corner[0], corner[2] - corner[1])
        normal /= np.sqrt(normal.dot(normal))
        level = np.array([-normal[1], normal[0], 0.0])
        along = level / np.linalg.norm(level) if abs(normal[2]) < 0.99 else np.array([1.0, 0.0, 0.0])
        st.append(np.stack([corner @ along, corner @ _cross(normal, along)], axis=1))
        normals.append(np.tile(normal, (len(face), 1)))
    return Mesh(
        points=frame.placed(points),
        face_counts=np.array([len(face) for face in faces], np.int32),
        corners=np.concatenate(faces).astype(np.int32),
        normals=frame.turned(np.concatenate(normals)).astype(np.float32),
        st=np.concatenate(st).astype(np.float32),
    )


def _cross(a: F64, b: F64) -> F64:
    """Compute the cross product of two vectors, shape (3,); `np.cross` is slow for one, and a town has 25,000."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
