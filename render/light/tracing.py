"""Rays that gather light for the light volume: the surfaces that they hit, and the light that these reflect."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from render.light.daylight import Daylight
from usd_schemas.flat_scene import ALIKE, FlatScene, without_mostly_transparent, world_triangles
from usd_schemas.raycast import RayScene

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_LIFT = 0.01  # [m] rays start off the surface
# Share of light that a surface reflects specularly in addition: that of Fresnel for a refractive index of 1.5 over the
# facets of a roughness of 0.9, the mean over all directions.
# Source: Walter et al., Microfacet models for refraction, EGSR 2007.
_MIRRORED, _MIRRORED_STRAIGHT = 0.025, 0.04
_LAYERS = 3  # of surfaces that are followed along a normal: the lower and the upper side of a thin part, and one more
CHUNK = 400_000  # rays cast at once


@dataclass(frozen=True)
class Hits:
    """Where rays hit surfaces.

    Attributes:
        ray: Number of the ray, shape (N,), int64.
        position: Position of the hit [m], shape (N, 3), float32.
        normal: Unit normal that faces the ray [1], shape (N, 3), float32.
        albedo: Mean base color there [1], shape (N, 3), float32.
        near: Whether the hit is so near that the ray's start lies on or in a solid, shape (N,), bool.
        behind: Whether the ray hit the back of a face that is not `ALIKE` from both sides, shape (N,), bool.
    """

    ray: I64
    position: F32
    normal: F32
    albedo: F32
    near: NDArray[np.bool_]
    behind: NDArray[np.bool_]


class LightTracer:
    """The surfaces of a scene under its sun and sky.

    Attributes:
        corners: Corners of the triangles [m], shape (T, 3, 3), float64.
        normals: Their unit normals, outwards [1], shape (T, 3), float32.
        draws: Draw of each triangle, shape (T,), uint32.
        scene: The scene without transparent draws.
    """

    def __init__(self, scene: FlatScene, light: Daylight, albedo: F64) -> None:
        """Build the search structure.

        Args:
            scene: A scene.
            light: Its sun and sky.
            albedo: Mean base color of each material [1], shape (M, 3), float64.
        """
        self.scene = scene = without_mostly_transparent(scene)
        self.corners, _, self.draws = world_triangles(scene)
        first, second, third = self.corners[:, 0], self.corners[:, 1], self.corners[:, 2]
        normals = np.cross(second - first, third - first)
        self.normals = (normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)).astype(np.float32)
        mirrored = np.linalg.det(scene.draws.transform[:, :3, :3]) < 0
        self.normals[mirrored[self.draws]] *= -1
        self._colors = (albedo + _mirrored(scene) * (1 - albedo))[scene.draws.material].astype(np.float32)
        self._alike = (scene.geometry.part_double_sided[scene.draws.part] == ALIKE)[self.draws]
        self._light = light
        self._rays = RayScene(self.corners, np.zeros(len(self.corners), np.uint32))

    def trace(self, origins: F64, directions: F64, touching: float = 0.0) -> tuple[F32, Hits]:
        """Follow rays to their first hit.

        Args:
            origins: Starts [m], shape (N, 3), float64.
            directions: Unit directions [1], shape (N, 3), float64.
            touching: Distance up to which a hit counts as near [m].

        Returns:
            Radiance along each ray from the sky, or from a sunlit surface [1], shape (N, 3),
            float32, and the hits.
        """
        light = self._light
        distance, triangle, _ = self._rays.cast(origins, directions)
        met = np.flatnonzero(triangle >= 0)
        radiance = light.radiance(directions).astype(np.float32)
        normal = self.normals[triangle[met]]
        behind = np.einsum("ij,ij->i", normal, directions[met]) > 0
        normal = np.where(behind[:, None], -normal, normal)
        point = origins[met] + distance[met, None] * directions[met]
        color = self._colors[self.draws[triangle[met]]]
        radiance[met] = color * self._sunlight(point, normal)[:, None] * (light.sun_irradiance / np.pi)
        behind &= ~self._alike[triangle[met]]
        return radiance, Hits(met, point.astype(np.float32), normal, color, distance[met] < touching, behind)

    def topped(self, points: F64, normals: F64, reach: float) -> NDArray[np.bool_]:
        """Find positions on surfaces that have another surface, which faces the same way, close in front of them.

        Args:
            points: Positions [m], shape (N, 3), float64.
            normals: Unit normals [1], shape (N, 3), float64.
            reach: Largest distance [m].

        Returns:
            One flag each, shape (N,), bool.
        """
        found, height, left = np.zeros(len(points), bool), np.full(len(points), _LIFT), np.arange(len(points))
        for _ in range(_LAYERS):
            distance, triangle, _ = self._rays.cast(points[left] + height[left, None] * normals[left], normals[left])
            height[left] += np.minimum(distance, reach) + _LIFT
            met = (triangle >= 0) & (height[left] < reach)
            alike = np.einsum("ij,ij->i", self.normals[triangle], normals[left]) > 0.5
            found[left[met & alike]] = True
            left = left[met & ~alike]
        return found

    def _sunlight(self, points: F64, normals: F32) -> F32:
        """Compute the cosine of the sun's rays where they reach a surface, else 0; shape (N,)."""
        light = self._light
        cosine = normals @ light.sun_direction.astype(np.float32)
        result = np.zeros(len(points), np.float32)
        if not light.sun_irradiance.any():
            return result
        facing = np.flatnonzero(cosine > 0)
        starts = points[facing] + _LIFT * normals[facing]
        distance, _, _ = self._rays.cast(starts, np.broadcast_to(light.sun_direction, (len(facing), 3)))
        lit = ~np.isfinite(distance)
        result[facing[lit]] = cosine[facing[lit]]
        return result


def joined(parts: list[Hits]) -> Hits:
    """Concatenate the hits of several casts.

    Args:
        parts: Hits whose rays are numbered through.
    """
    return Hits(*(np.concatenate([getattr(part, name) for part in parts]) for name in Hits.__dataclass_fields__))


def _mirrored(scene: FlatScene) -> F64:
    """List what the surface of each material mirrors [1], in proportion to its specular color, shape (M, 3)."""
    usual = (_MIRRORED_STRAIGHT,) * 3  # of pictures of shine, too: their mean is not known here
    told = [usual if each.specular is None or each.specular_texture else each.specular for each in scene.materials]
    return _MIRRORED / _MIRRORED_STRAIGHT * np.minimum(np.array(told).reshape(-1, 3), _MIRRORED_STRAIGHT)
