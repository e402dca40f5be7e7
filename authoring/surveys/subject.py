"""The input of a survey: the triangles of bridge and site, never the background."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.shapes.component import Component, Mesh, Scatter, triangle_corners, triangles
from usd_schemas.components import class_of
from usd_schemas.raycast import RayScene

F64 = NDArray[np.float64]
I32 = NDArray[np.int32]

LAND = frozenset({"ground", "road", "rail_bed", "water", "embankment", "riverbank"})  # heights are measured from these


@dataclass(frozen=True)
class Subject:
    """A bridge on its site, as the input of surveys.

    Attributes:
        bridge: Corner positions of the bridge's triangles [m], shape (T, 3, 3), float64.
        bridge_ids: Instance id of each of them, shape (T,), int32.
        seats: Middle of each bearing [m], shape (S, 3), float64: small members hidden under the deck.
        surface: The bridge alone, for nearest points; its rows are those of `bridge`.
        obstacles: Bridge and site, for distances and lines of sight.
        obstacle_ids: Instance id of each of their triangles, shape (T,), int32.
        ground: Ground, roads and water alone, for heights.
    """

    bridge: F64
    bridge_ids: I32
    seats: F64
    surface: RayScene
    obstacles: RayScene
    obstacle_ids: I32
    ground: RayScene

    def ground_height(self, plan: F64) -> F64:
        """Find the height of ground or water below positions.

        Args:
            plan: Positions in plan [m], shape (N, 2), float64.

        Returns:
            Heights to the centimeter [m], shape (N,), float64; -inf beyond the site.
        """
        top = 1000.0
        origins = np.column_stack([plan, np.full(len(plan), top)])
        distance, _, _ = self.ground.cast(origins, np.tile([0.0, 0.0, -1.0], (len(plan), 1)))
        # Rounded, because the ray caster's last digits depend on the CPU, and cameras must not.
        return np.where(np.isfinite(distance), np.round(top - distance, 2), -np.inf)

    def clearance(self, positions: F64) -> F64:
        """Find the distance to the nearest surface of bridge or site.

        Args:
            positions: World positions [m], shape (N, 3), float64.

        Returns:
            Distances [m], shape (N,), float64.
        """
        return self.obstacles.distance(positions)[0]


def make_subject(bridge: tuple[Component | Scatter, ...], site: tuple[Component | Scatter, ...]) -> Subject:
    """Collect the triangles of a bridge and its site.

    Args:
        bridge: The bridge's pieces.
        site: The site's pieces.
    """
    corners, ids = piece_corners(bridge)
    site_corners, site_ids = piece_corners(site)
    land = piece_corners(tuple(piece for piece in site if piece.kind in LAND))
    both = np.concatenate([ids, site_ids])
    obstacles = RayScene(np.concatenate([corners, site_corners]), both.astype(np.uint32))
    seats = [
        (piece.mesh.points.min(axis=0) + piece.mesh.points.max(axis=0)) / 2
        for piece in bridge
        if isinstance(piece, Component) and class_of(piece.kind) == "bearing"
    ]
    surface = RayScene(corners, ids.astype(np.uint32))
    ground = RayScene(land[0], land[1].astype(np.uint32))
    return Subject(corners, ids, np.array(seats).reshape(-1, 3), surface, obstacles, both, ground)


def piece_corners(pieces: tuple[Component | Scatter, ...]) -> tuple[F64, I32]:
    """Collect the triangles of components and of every repeat of scatters, in world space.

    Args:
        pieces: Components and scatters.

    Returns:
        Corner positions [m], shape (T, 3, 3), float64, and instance ids, shape (T,), int32.
    """
    corners, ids = triangle_corners(tuple(piece for piece in pieces if isinstance(piece, Component)))
    repeats = [_scatter_corners(piece) for piece in pieces if isinstance(piece, Scatter)]
    return (
        np.concatenate([corners, *(part for part, _ in repeats)]),
        np.concatenate([ids, *(part for _, part in repeats)]),
    )


def _scatter_corners(scatter: Scatter) -> tuple[F64, I32]:
    corners, ids = [np.zeros((0, 3, 3))], [np.zeros(0, np.int32)]
    point_ids = np.resize(np.array(scatter.instance_ids, np.int32), len(scatter.positions))
    for number, prototype in enumerate(scatter.prototypes):
        rows = np.flatnonzero(scatter.prototype == number)
        local = np.concatenate([_mesh_corners(mesh) for _, mesh in prototype])
        sized = local[None] * scatter.scales[rows, None, None, :]
        cosine, sine = np.cos(scatter.yaw[rows])[:, None, None], np.sin(scatter.yaw[rows])[:, None, None]
        x, y, z = sized[..., 0], sized[..., 1], sized[..., 2]
        turned = np.stack([x * cosine - y * sine, x * sine + y * cosine, z], axis=-1)
        corners.append((turned + scatter.positions[rows, None, None, :]).reshape(-1, 3, 3))
        ids.append(np.repeat(point_ids[rows], len(local)))
    return np.concatenate(corners), np.concatenate(ids)


def _mesh_corners(mesh: Mesh) -> F64:
    return mesh.points[triangles(mesh)]
