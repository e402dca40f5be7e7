"""The light volume: how much sky and reflected sun reaches every place around the bridge, ray cast once per scene.

A grid of probes stores the irradiance of the first two bands of spherical harmonics. The shader reads it one cell off
the surface, so that a wall never takes light from its far side. It depends on the scene alone, never on the view, and
so the same surface looks the same in every photograph.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from groundwork.progress import Progress
from render.light.daylight import Daylight, irradiance_coefficients, sphere
from usd_schemas.flat_scene import FlatScene, without_ghosts, world_triangles
from usd_schemas.raycast import RayScene

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_MARGIN = np.array([5.0, 5.0, 1.5])  # [m] the volume reaches beyond the region of interest
_SMALLEST_CELL = 0.35  # [m]
_BURIED = 0.3  # a probe that sees more back faces than this stands inside something
_CHUNK = 400_000  # rays cast at once
_LIFT = 0.01  # [m] shadow rays start off the surface


@dataclass(frozen=True)
class LightVolume:
    """Irradiance on a grid.

    Attributes:
        lower: Position of the first probe [m], shape (3,), float64.
        cell: Distance of neighbouring probes [m].
        coefficients: c0, c1, c2, c3 of E(n) = c0 + c1 nx + c2 ny + c3 nz [1], shape (Z, Y, X, 4, 3), float32.
    """

    lower: F64
    cell: float
    coefficients: F32

    def nearest(self, points: F64) -> tuple[I64, NDArray[np.bool_]]:
        """Find the probe nearest to each point.

        Args:
            points: World positions [m], shape (N, 3), float64.

        Returns:
            Flat probe number, shape (N,), int64, and whether the point lies in the volume, shape (N,), bool.
        """
        shape = np.array(self.coefficients.shape[2::-1])
        place = np.rint((points - self.lower) / self.cell).astype(np.int64)
        inside = np.all((place >= 0) & (place < shape), axis=1)
        x, y, z = np.clip(place, 0, shape - 1).T
        return (z * shape[1] + y) * shape[0] + x, inside


@dataclass(frozen=True)
class _Hits:
    """What the rays of all probes met: flat ray number, position, facing normal and albedo of each hit."""

    ray: I64
    position: F32
    normal: F32
    albedo: F32


def cast_light_volume(
    scene: FlatScene, light: Daylight, albedo: F64, box: tuple[F64, F64], probes: int, rays: int, progress: Progress
) -> LightVolume:
    """Cast the light volume of a scene.

    Args:
        scene: A scene.
        light: Its sun and sky.
        albedo: Mean base colour of each material [1], shape (M, 3), float64.
        box: Lower and upper corner of the region of interest [m], each of shape (3,), float64.
        probes: Most probes.
        rays: Rays per probe.
        progress: Told how far it is.
    """
    low, high = box[0] - _MARGIN, box[1] + _MARGIN
    cell = max(_SMALLEST_CELL, float(np.cbrt(np.prod(high - low) / probes)))
    counts = np.maximum(np.ceil((high - low) / cell).astype(int), 1) + 1
    z, y, x = np.meshgrid(*(np.arange(count) for count in counts[::-1]), indexing="ij")
    positions = low + cell * np.stack([x, y, z], axis=-1).reshape(-1, 3)
    directions = sphere(rays)
    radiance, hits, buried = _gather(scene, light, albedo, positions, directions, progress)
    grid = (counts[2], counts[1], counts[0])

    def volume(total: F32) -> LightVolume:
        coefficients = irradiance_coefficients(directions, total.reshape(-1, rays, 3)).reshape(*grid, 4, 3)
        return LightVolume(low, cell, _filled(coefficients, buried.reshape(grid)))

    # What the sky and sunlit surfaces give; then once more with what these light up.
    radiance[hits.ray] += hits.albedo / np.float32(np.pi) * _ambient(volume(radiance), light, hits)
    return volume(radiance)


def _gather(
    scene: FlatScene, light: Daylight, albedo: F64, positions: F64, directions: F64, progress: Progress
) -> tuple[F32, _Hits, NDArray[np.bool_]]:
    scene = without_ghosts(scene)
    corners, _, draws = world_triangles(scene)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = (normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)).astype(np.float32)
    mirrored = np.linalg.det(scene.draws.transform[:, :3, :3]) < 0
    normals[mirrored[draws]] *= -1
    colors = albedo[scene.draws.material].astype(np.float32)
    tracer = RayScene(corners, np.zeros(len(corners), np.uint32))
    count, rays = len(positions), len(directions)
    radiance = np.empty((count * rays, 3), np.float32)
    radiance.reshape(count, rays, 3)[:] = light.radiance(directions)
    back = np.zeros(count)
    parts: list[_Hits] = []
    step = max(1, _CHUNK // rays)
    progress.stage("light", count)
    for start in range(0, count, step):
        eyes = positions[start : start + step]
        aims = np.tile(directions, (len(eyes), 1))
        distance, triangle, _ = tracer.cast(np.repeat(eyes, rays, axis=0), aims)
        met = np.flatnonzero(triangle >= 0)
        normal = normals[triangle[met]]
        behind = np.einsum("ij,ij->i", normal, aims[met]) > 0
        back[start : start + step] = np.bincount(met[behind] // rays, minlength=len(eyes)) / rays
        normal = np.where(behind[:, None], -normal, normal)
        point = eyes[met // rays] + distance[met, None] * aims[met]
        color = colors[draws[triangle[met]]]
        radiance[start * rays + met] = (
            color * _sunlight(tracer, light, point, normal)[:, None] * (light.sun_irradiance / np.pi)
        )
        parts.append(_Hits(start * rays + met, point.astype(np.float32), normal, color))
        progress.advance(min(start + step, count))
    fields = [np.concatenate([getattr(part, name) for part in parts]) for name in _Hits.__dataclass_fields__]
    return radiance, _Hits(*fields), back > _BURIED


def _sunlight(tracer: RayScene, light: Daylight, points: F64, normals: F32) -> F32:
    """Cosine of the sun's rays where they reach a surface, else 0; shape (N,)."""
    cosine = normals @ light.sun_direction.astype(np.float32)
    result = np.zeros(len(points), np.float32)
    if not light.sun_irradiance.any():
        return result
    facing = np.flatnonzero(cosine > 0)
    starts = points[facing] + _LIFT * normals[facing]
    distance, _, _ = tracer.cast(starts, np.broadcast_to(light.sun_direction, (len(facing), 3)))
    lit = ~np.isfinite(distance)
    result[facing[lit]] = cosine[facing[lit]]
    return result


def _ambient(volume: LightVolume, light: Daylight, hits: _Hits) -> F32:
    """Irradiance at the hits: from the volume one cell off the surface, under the open sky outside it; shape (N, 3)."""
    probe, inside = volume.nearest(hits.position + volume.cell * hits.normal.astype(np.float64))
    table = volume.coefficients.reshape(-1, 4, 3)
    result = np.empty((len(probe), 3), np.float32)
    open_sky = light.open_sky.astype(np.float32)
    for channel in range(3):
        rows = np.where(inside[:, None], table[probe, :, channel], open_sky[:, channel])
        result[:, channel] = rows[:, 0] + np.einsum("nk,nk->n", rows[:, 1:], hits.normal)
    return np.maximum(result, 0)


def _filled(coefficients: F64, buried: NDArray[np.bool_]) -> F32:
    """Give probes inside solids the mean of their neighbours outside, ring by ring."""
    values, known = coefficients.astype(np.float32), ~buried
    values[buried] = 0
    while known.any() and not known.all():
        total, weight = np.zeros_like(values), np.zeros(known.shape, np.float32)
        for axis in range(3):
            for shift in (-1, 1):
                total += _shifted(values * known[..., None, None], axis, shift)
                weight += _shifted(known.astype(np.float32), axis, shift)
        grown = ~known & (weight > 0)
        values[grown] = total[grown] / weight[grown][:, None, None]
        known = known | grown
    return values


def _shifted(values: F32, axis: int, shift: int) -> F32:
    moved = np.zeros_like(values)
    source, target = [slice(None)] * values.ndim, [slice(None)] * values.ndim
    target[axis], source[axis] = (slice(1, None), slice(None, -1)) if shift > 0 else (slice(None, -1), slice(1, None))
    moved[tuple(target)] = values[tuple(source)]
    return moved
