"""An imported world that has not been placed yet: buildings and terrain about their own origin."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.imported.skin import Skin

F64 = NDArray[np.float64]

ROOF_SLOPE = 0.2  # a face whose normal rises by more than this is part of a roof [1]


@dataclass(frozen=True, eq=False)
class Building:
    """One building.

    Attributes:
        name: Its name in the source file.
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
class Textured:
    """Part of a world with a photograph as texture.

    Attributes:
        owner: Name of its object; `ground` for the ground.
        is_ground: Whether it is ground.
        triangles: Its triangles [m], shape (T, 3, 3), float64.
        st: Texture coordinates at their corners, v upwards [1], shape (T, 3, 2), float64.
        skin: Number of its image in `CityModel.skins`.
    """

    owner: str
    is_ground: bool
    triangles: F64
    st: F64
    skin: int


@dataclass(frozen=True, eq=False)
class CityModel:
    """A built-up world.

    Attributes:
        buildings: Its buildings.
        terrain: Triangles of its ground [m], shape (T, 3, 3), float64; none where it has no relief.
        attribution: Its author and position, e.g. `source`, `crs`, `origin`, `license`.
        textured: Its parts with photographs; buildings and terrain are the others.
        skins: The images of `textured`.
    """

    buildings: tuple[Building, ...]
    terrain: F64
    attribution: dict[str, str]
    textured: tuple[Textured, ...] = ()
    skins: tuple[Skin, ...] = ()

    @property
    def extent(self) -> F64:
        """Lowest and highest corner in plan [m], shape (2, 2), float64."""
        every = np.concatenate([self.built.reshape(-1, 3), self.ground.reshape(-1, 3)])[:, :2]
        return np.stack([every.min(axis=0), every.max(axis=0)])

    @property
    def built(self) -> F64:
        """Triangles of everything on the ground [m], shape (T, 3, 3), float64."""
        plain = [part for building in self.buildings for part in (building.walls, building.roofs)]
        return _joined([*plain, *(piece.triangles for piece in self.textured if not piece.is_ground)])

    @property
    def ground(self) -> F64:
        """Triangles of all its ground [m], shape (T, 3, 3), float64."""
        return _joined([self.terrain, *(piece.triangles for piece in self.textured if piece.is_ground)])


def _joined(parts: list[F64]) -> F64:
    return np.concatenate([np.zeros((0, 3, 3)), *parts])


def face_normals(triangles: F64) -> F64:
    """Find the unit normal of triangles; 0 for one without an area.

    Args:
        triangles: Corners [m], shape (T, 3, 3), float64.

    Returns:
        Normals [1], shape (T, 3), float64.
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
    """Distinguish walls, roofs and undersides by their slope.

    Args:
        triangles: Corners, counter-clockwise from outside [m], shape (T, 3, 3), float64.

    Returns:
        Triangles of walls, of roofs and of undersides [m], each of shape (U, 3, 3), float64.
    """
    rise = face_normals(triangles)[:, 2]
    return triangles[np.abs(rise) <= ROOF_SLOPE], triangles[rise > ROOF_SLOPE], triangles[rise < -ROOF_SLOPE]
