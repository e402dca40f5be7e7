"""Resolution of textures that the nearest camera of a survey needs.

The finest mipmap level of a texture is used only where its texels are about as wide as pixels. If all cameras are
farther away, only the coarser levels are kept: a quarter of the memory suffices, and hardly any pixel changes.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from render.gpu.gpu_scene import draw_boxes
from render.gpu.materials import placed_textures
from render.gpu.textures import TextureKey
from usd_schemas.flat_scene import CameraTrack, FlatScene, Geometry
from usd_schemas.pinhole import Pinhole

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_SLACK = 0.1  # [m] largest difference of a rolling shutter's positions from the frame's
_WIDER = 1.5  # a view for a distorting lens is wider by at most this factor
_BLOCK = 200_000  # triangles at once
_LARGE = 0.3  # ratio to its distance; larger objects are measured triangle by triangle, or box by box


@dataclass(frozen=True)
class Sight:
    """Positions and resolution of a survey's cameras.

    Attributes:
        eyes: Camera centers [m], shape (N, 3), float64.
        pixel: Smallest width of a pixel on a surface, as a share of its distance from the camera [1].
        near: Smallest distance of drawn surfaces [m].
    """

    eyes: F64
    pixel: float
    near: float


def survey_sight(track: CameraTrack, camera: Pinhole) -> Sight:
    """Collect positions and resolution of a survey's cameras.

    Args:
        track: Camera and poses.
        camera: Intrinsics of its images.
    """
    wider = 1.0 if track.distortion.is_identity else _WIDER
    across = wider * max(camera.cx, camera.width - camera.cx) / camera.fx
    down = wider * max(camera.cy, camera.height - camera.cy) / camera.fy
    focal = max(camera.fx, camera.fy)
    return Sight(track.poses[:, :3, 3], 1.0 / (focal * float(np.sqrt(1.0 + across**2 + down**2))), track.near)


def texel_needs(scene: FlatScene, sight: Sight) -> dict[TextureKey, float]:
    """Find the smallest share of each texture that a pixel covers.

    Args:
        scene: A scene.
        sight: Positions and resolution of its survey's cameras.

    Returns:
        For each texture of a drawn material, the smallest width of a pixel in widths of the texture, over all cameras
        [1].
    """
    needs = _draw_needs(scene, sight)
    least = np.full((len(scene.materials), 2), np.inf)
    for uv_set in range(2):
        np.minimum.at(least[:, uv_set], scene.draws.material, needs[:, uv_set])
    found: dict[TextureKey, float] = {}
    for number, material in enumerate(scene.materials):
        for key, scale, uv_set in placed_textures(material):
            found[key] = min(found.get(key, np.inf), float(scale * least[number, uv_set]))
    return found


def least_distances(lower: F64, upper: F64, sight: Sight) -> F64:
    """Find the distance of boxes from the nearest camera, at least that of the nearest drawn surface.

    Args:
        lower: Lower corners [m], shape (N, 3), float64.
        upper: Upper corners [m], shape (N, 3), float64.
        sight: Positions and resolution of the survey's cameras.

    Returns:
        Distances [m], shape (N,), float64.
    """
    away = np.full(len(lower), np.inf)
    for eye in sight.eyes:
        gap = np.maximum(np.maximum(lower - eye, eye - upper), 0.0)
        np.minimum(away, np.einsum("ij,ij->i", gap, gap), out=away)
    return np.maximum(np.sqrt(away) - _SLACK, sight.near)


def _draw_needs(scene: FlatScene, sight: Sight) -> F64:
    """Compute the smallest width of a pixel in units of each UV set, for each draw; shape (D, 2)."""
    geometry, draws = scene.geometry, scene.draws
    density = _densities(geometry)
    starts, stops = geometry.part_first.astype(np.int64), (geometry.part_first + geometry.part_count).astype(np.int64)
    least = np.array(
        [
            density[first:stop].min(axis=0) if stop > first else (np.inf, np.inf)
            for first, stop in zip(starts, stops, strict=True)
        ]
    ).reshape(-1, 2)
    stretch = np.linalg.norm(draws.transform[:, :3, :3], axis=(1, 2), ord=2)
    lower, upper = draw_boxes(scene)
    away = least_distances(lower, upper, sight)
    needs = least[draws.part] * (away * sight.pixel / np.maximum(stretch, 1e-30))[:, None]
    for row in np.flatnonzero(np.linalg.norm(upper - lower, axis=1) > _LARGE * away):
        part = slice(starts[draws.part[row]], stops[draws.part[row]])
        corners = geometry.positions[geometry.triangles[part]] @ draws.transform[row, :3, :3].T.astype(np.float64)
        far = _from_triangles(corners + draws.transform[row, :3, 3], sight)
        needs[row] = np.min(density[part] * (far * sight.pixel / max(stretch[row], 1e-30))[:, None], axis=0)
    return needs


def _densities(geometry: Geometry) -> F64:
    """UV per meter of mesh, for each triangle and UV set, as the root of the sum of squares over both axes; (T, 2).

    Triangles without area, or with one UV at all corners, need no texels: infinite.
    """
    density = np.full((len(geometry.triangles), 2), np.inf)
    for rows in _blocks(len(density)):
        corners = geometry.triangles[rows]
        edges = np.diff(geometry.positions[corners].astype(np.float64), axis=1)
        square, other = np.einsum("tij,tij->ti", edges, edges).T
        mixed = np.einsum("ti,ti->t", edges[:, 0], edges[:, 1])
        area = square * other - mixed**2
        for uv_set, uv in enumerate((geometry.st, geometry.st1)):
            steps = np.diff(uv[corners].astype(np.float64), axis=1)
            along, across = np.einsum("tij,tij->ti", steps, steps).T
            skew = np.einsum("ti,ti->t", steps[:, 0], steps[:, 1])
            with np.errstate(divide="ignore", invalid="ignore"):
                trace = (other * along - 2 * mixed * skew + square * across) / area
            density[rows, uv_set] = np.where((area > 0) & (trace > 1e-12), np.sqrt(np.maximum(trace, 0)), np.inf)
    return density


def _from_triangles(corners: F64, sight: Sight) -> F64:
    """Compute the smallest distance of each triangle from a camera [m], shape (T,)."""
    middle = corners.mean(axis=1)
    radius = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
    away = KDTree(sight.eyes).query(middle)[0] - radius - _SLACK
    coarse = np.flatnonzero(radius > _LARGE * away)
    away[coarse] = np.maximum(
        away[coarse], least_distances(corners[coarse].min(axis=1), corners[coarse].max(axis=1), sight)
    )
    return np.maximum(away, sight.near)


def _blocks(count: int) -> Iterator[slice]:
    return (slice(first, first + _BLOCK) for first in range(0, count, _BLOCK))
