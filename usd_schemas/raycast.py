"""Rays and nearest points against the triangles of a scene."""

import ctypes
from typing import Any

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
U32 = NDArray[np.uint32]

NOTHING = -1  # triangle row of a ray that hits nothing


class RayScene:
    """Triangles with a search structure for ray casting.

    The engine uses single precision. Positions are therefore made relative to the middle of the scene in double
    precision first, so that a scene far from the origin keeps its precision.
    """

    def __init__(self, corners: F64, ids: U32) -> None:
        """Build the search structure.

        Args:
            corners: Corner positions of each triangle [m], shape (T, 3, 3), float64.
            ids: Id of each triangle, shape (T,), uint32.
        """
        o3d = load_open3d()
        self._float = o3d.core.Dtype.Float32
        self._tensor = o3d.core.Tensor
        flat = np.asarray(corners, np.float64).reshape(-1, 3)
        self._origin = (flat.min(axis=0) + flat.max(axis=0)) / 2 if len(flat) else np.zeros(3)
        self._ids = np.asarray(ids, np.uint32)
        self._scene = o3d.t.geometry.RaycastingScene()
        if len(flat):
            positions = np.ascontiguousarray(flat - self._origin, np.float32)
            numbers = np.arange(len(flat), dtype=np.uint32).reshape(-1, 3)
            self._scene.add_triangles(self._tensor(positions), self._tensor(numbers))

    def cast(self, origins: F64, directions: F64) -> tuple[F64, I64, U32]:
        """Find the first triangle that each ray hits, from either side.

        Args:
            origins: Starts of the rays [m], shape (N, 3), float64.
            directions: Directions, of any length [m], shape (N, 3), float64.

        Returns:
            Distance in lengths of the direction vector [1], shape (N,), float64, +inf where nothing is hit; triangle
            row, shape (N,), int64, `NOTHING` there; its id, shape (N,), uint32, 0 there. For a direction whose
            component along the camera's axis is 1, the distance is the planar depth [m].
        """
        rays = np.concatenate([np.asarray(origins, np.float64) - self._origin, directions], axis=1)
        hits = self._scene.cast_rays(self._tensor(np.ascontiguousarray(rays, np.float32)))
        distance = hits["t_hit"].numpy().astype(np.float64)
        return distance, *self._named(hits["primitive_ids"].numpy(), np.isfinite(distance))

    def distance(self, points: F64) -> tuple[F64, I64]:
        """Find the distance to the nearest point of the surface.

        Args:
            points: Query positions [m], shape (N, 3), float64.

        Returns:
            Unsigned distance [m], shape (N,), float64, and triangle row, shape (N,), int64.
        """
        nearest, rows = self.nearest(points)
        return np.linalg.norm(np.asarray(points, np.float64) - nearest, axis=1), rows

    def nearest(self, points: F64) -> tuple[F64, I64]:
        """Find the nearest point of the surface itself.

        Args:
            points: Query positions [m], shape (N, 3), float64.

        Returns:
            Nearest points [m], shape (N, 3), float64, and triangle row, shape (N,), int64.
        """
        local = np.asarray(points, np.float64) - self._origin
        found = self._scene.compute_closest_points(self._tensor(np.ascontiguousarray(local, np.float32)))
        return found["points"].numpy().astype(np.float64) + self._origin, found["primitive_ids"].numpy().astype(
            np.int64
        )

    def _named(self, rows: NDArray[np.uint32], hit: NDArray[np.bool_]) -> tuple[I64, U32]:
        triangle = np.where(hit, rows.astype(np.int64), NOTHING)
        ids = np.zeros(len(rows), np.uint32)
        ids[hit] = self._ids[triangle[hit]]
        return triangle, ids


def load_open3d() -> Any:
    """Import open3d on first use, because it takes long; it needs libusb, which a wheel provides if it is missing."""
    import libusb_package

    library = libusb_package.get_library_path()
    if library is not None:
        ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)
    import open3d

    return open3d
