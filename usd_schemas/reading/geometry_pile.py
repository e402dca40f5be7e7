"""Collects meshes, parts and draws one by one, and returns them as the concatenated arrays of a flat scene."""

import numpy as np
from numpy.typing import NDArray

from usd_schemas.flat_scene import Draws, Geometry
from usd_schemas.reading.meshes import FlatMesh

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
U32 = NDArray[np.uint32]


class GeometryPile:
    """Growing `Geometry` and `Draws`.

    Attributes:
        draw_count: Number of draws so far.
    """

    def __init__(self) -> None:
        self._meshes: list[FlatMesh] = []
        self._runs: list[I64] = []
        self._double_sided: list[bool] = []
        self._draws: list[tuple[I64, F64, I64, U32, I64]] = []
        self._vertices = 0
        self.draw_count = 0

    def add_mesh(self, mesh: FlatMesh) -> int:
        """Add a mesh's vertices.

        Args:
            mesh: Mesh to add.

        Returns:
            Number of its first vertex.
        """
        first = self._vertices
        self._meshes.append(mesh)
        self._vertices += len(mesh.positions)
        return first

    def add_part(self, triangles: I64, double_sided: bool) -> int:
        """Add a part.

        Args:
            triangles: Vertex numbers among all meshes, shape (T, 3), int64.
            double_sided: Back faces are visible.

        Returns:
            Row of the part.
        """
        self._runs.append(triangles)
        self._double_sided.append(double_sided)
        return len(self._runs) - 1

    def add_draws(self, part: int, transforms: F64, material: int | I64, instances: U32, label: int) -> None:
        """Add a part's instances.

        Args:
            part: Row of the part.
            transforms: Mesh to world [m], shape (N, 4, 4), float64.
            material: Row of the material, or one for each instance, shape (N,), int64.
            instances: Instance ids, shape (N,), uint32.
            label: Class id.
        """
        same = np.ones(len(transforms), np.int64)
        self.draw_count += len(transforms)
        self._draws.append((same * part, transforms, same * material, instances, same * label))

    def geometry(self) -> Geometry:
        """Concatenate the meshes."""

        def joined(name: str, width: int) -> NDArray[np.float32]:
            return np.concatenate([np.zeros((0, width), np.float32), *(getattr(mesh, name) for mesh in self._meshes)])

        counts = np.array([len(run) for run in self._runs], np.int32)
        return Geometry(
            joined("positions", 3),
            joined("normals", 3),
            joined("st", 2),
            joined("st1", 2),
            joined("colors", 3),
            np.concatenate([np.zeros((0, 3), np.int64), *self._runs]).astype(np.uint32),
            (np.cumsum(counts) - counts).astype(np.int32),
            counts,
            np.array(self._double_sided, np.uint8),
        )

    def draws(self) -> Draws:
        """Concatenate the draws."""
        nothing = (np.zeros(0), np.zeros((0, 4, 4)), np.zeros(0), np.zeros(0), np.zeros(0))
        columns = zip(nothing, *self._draws, strict=True)
        part, transform, material, instance, label = (np.concatenate(column) for column in columns)
        return Draws(
            part.astype(np.int32),
            np.ascontiguousarray(transform),
            material.astype(np.int32),
            instance.astype(np.uint32),
            label.astype(np.uint8),
        )
