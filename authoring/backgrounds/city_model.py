"""A built-up world from elsewhere that has no place yet: buildings and terrain about an origin of their own."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

ROOF_SLOPE = 0.2  # a face whose normal rises by more than this belongs to a roof [1]


@dataclass(frozen=True, eq=False)
class Building:
    """One building.

    Attributes:
        name: Its name in the file that it comes from.
        walls: Triangles of its walls [m], shape (T, 3, 3), float64.
        roofs: Triangles of its roofs [m], shape (T, 3, 3), float64.
    """

    name: str
    walls: F64
    roofs: F64

    @property
    def corners(self) -> F64:
        """All corners of its triangles [m], shape (N, 3), float64."""
        return np.concatenate([self.walls, self.roofs]).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class CityModel:
    """A built-up world.

    Attributes:
        buildings: Its buildings.
        terrain: Triangles of its ground [m], shape (T, 3, 3), float64; none where it has no relief.
        attribution: Who made it and where it lies, e.g. `source`, `crs`, `origin`, `license`.
    """

    buildings: tuple[Building, ...]
    terrain: F64
    attribution: dict[str, str]

    @property
    def extent(self) -> F64:
        """Lowest and highest corner in plan [m], shape (2, 2), float64."""
        points = [building.corners[:, :2] for building in self.buildings]
        points.append(self.terrain.reshape(-1, 3)[:, :2])
        every = np.concatenate(points)
        return np.stack([every.min(axis=0), every.max(axis=0)])


def face_normals(triangles: F64) -> F64:
    """Find the unit normal of triangles; 0 for one without an area.

    Args:
        triangles: Corners [m], shape (T, 3, 3), float64.

    Returns:
        Normals, shape (T, 3), float64.
    """
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.divide(normal, length, out=np.zeros_like(normal), where=length > 0.0)


def sound_triangles(triangles: F64) -> F64:
    """Leave out triangles without an area.

    Args:
        triangles: Corners [m], shape (T, 3, 3), float64.

    Returns:
        The others [m], shape (U, 3, 3), float64.
    """
    return triangles[np.linalg.norm(face_normals(triangles), axis=1) > 0.5]


def split_faces(triangles: F64) -> tuple[F64, F64, F64]:
    """Tell walls, roofs and undersides apart by their slope.

    Args:
        triangles: Corners, counter-clockwise from outside [m], shape (T, 3, 3), float64.

    Returns:
        Triangles of walls, of roofs and of undersides [m], each of shape (U, 3, 3), float64.
    """
    rise = face_normals(triangles)[:, 2]
    return triangles[np.abs(rise) <= ROOF_SLOPE], triangles[rise > ROOF_SLOPE], triangles[rise < -ROOF_SLOPE]
