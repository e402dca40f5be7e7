"""The light volume: irradiance from sky and reflected sunlight around the bridge, ray cast once per scene.

A grid of probes stores the irradiance of surfaces that face along each half axis, so that the two sides of a thin slab
share nothing. The shader reads it half a cell in front of the surface. It depends only on the scene, never on the view,
so a surface looks the same in every photograph.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from groundwork.progress import Progress
from render.light.daylight import Daylight, sphere
from render.light.half_axes import COUNT, HALF_AXES, project, weigh
from render.light.surface_fit import AHEAD, cast_places, fit_to_surfaces, spread_places
from render.light.tracing import CHUNK, Hits, LightTracer, joined
from usd_schemas.flat_scene import FlatScene

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_MARGIN = np.array([5.0, 5.0, 1.5])  # [m] the volume reaches beyond the region of interest
_SMALLEST_CELL = 0.35  # [m]
_MOST_LAYERS = 1000  # of probes, for a texture has at most 2048, and holds every layer twice
_BURIED = 0.3  # a probe that sees more back faces than this is inside a solid
_PLACES = 2.4  # positions on surfaces for each probe [1]
_BOUNCES = 2  # reflections of light between surfaces, after those that the probes include
_BESIDE = (0.02, 0.2)  # weight of the neighbor behind a surface, and of those beside it, to that in front of it [1]
_SEED = 4  # of the positions at which reflected light is looked up


@dataclass(frozen=True)
class Sampling:
    """Resolution of a light volume.

    Attributes:
        probes: Largest number of probes [1].
        rays: Rays per probe [1].
    """

    probes: int
    rays: int


@dataclass(frozen=True)
class LightVolume:
    """Irradiance on a grid.

    Attributes:
        lower: Position of the first probe [m], shape (3,), float64.
        cell: Distance of neighboring probes [m].
        coefficients: Irradiance by half axis, and its mean, as in `half_axes` [1], shape (Z, Y, X, 7, 3), float32.
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


def cast_light_volume(
    scene: FlatScene, light: Daylight, albedo: F64, box: tuple[F64, F64], sampling: Sampling, progress: Progress
) -> LightVolume:
    """Cast the light volume of a scene: probes in the air first, then fitted to the irradiance of surfaces.

    Args:
        scene: A scene.
        light: Its sun and sky.
        albedo: Mean base color of each material [1], shape (M, 3), float64.
        box: Lower and upper corner of the region of interest [m], each of shape (3,), float64.
        sampling: Numbers of probes and rays.
        progress: Listener.
    """
    probes, rays = sampling.probes, sampling.rays
    low, high = box[0] - _MARGIN, box[1] + _MARGIN
    cell = max(_SMALLEST_CELL, float(np.cbrt(np.prod(high - low) / probes)), float(high[2] - low[2]) / _MOST_LAYERS)
    counts = np.maximum(np.ceil((high - low) / cell).astype(int), 1) + 1
    tracer = LightTracer(scene, light, albedo)
    volume = _cast_probes(
        tracer, light, LightVolume(low, cell, np.zeros((*counts[::-1], COUNT, 3), np.float32)), rays, progress
    )
    places = spread_places(tracer, low, low + cell * (counts - 1), round(_PLACES * probes))
    if not len(places.position):
        return volume
    fewer = max(8, rays // 2)  # many positions with few rays each give more than few with many
    places, radiance, hits = cast_places(tracer, places, fewer)
    probed, fitted = volume.coefficients, None
    for _ in range(_BOUNCES):  # each with the light of the one before
        total = radiance.copy()
        total[hits.ray] += hits.albedo / np.float32(np.pi) * _ambient(volume, light, hits)
        irradiance = np.float32(np.pi) * total.reshape(-1, fewer, 3).mean(axis=1)
        fitted = fit_to_surfaces(probed, low, cell, places, irradiance, fitted)
        volume = LightVolume(low, cell, fitted)
    return volume


def _cast_probes(tracer: LightTracer, light: Daylight, grid: LightVolume, rays: int, progress: Progress) -> LightVolume:
    """Compute the light of sky and sunlit surfaces at each probe; then again with surfaces that these illuminate."""
    counts = grid.coefficients.shape[:3]
    z, y, x = np.meshgrid(*(np.arange(count) for count in counts), indexing="ij")
    positions = grid.lower + grid.cell * np.stack([x, y, z], axis=-1).reshape(-1, 3)
    directions, count = sphere(rays), len(positions)
    radiance, back = np.empty((count * rays, 3), np.float32), np.zeros(count)
    parts: list[Hits] = []
    step = max(1, CHUNK // rays)
    progress.stage("light", count)
    for start in range(0, count, step):
        eyes = positions[start : start + step]
        light_there, hits = tracer.trace(np.repeat(eyes, rays, axis=0), np.tile(directions, (len(eyes), 1)))
        back[start : start + step] = np.bincount(hits.ray[hits.behind] // rays, minlength=len(eyes)) / rays
        radiance[start * rays : start * rays + len(light_there)] = light_there
        parts.append(replace(hits, ray=hits.ray + start * rays))
        progress.advance(min(start + step, count))
    hits, buried = joined(parts), (back > _BURIED).reshape(counts)
    parts.clear()  # a hundred megabytes that are not needed again

    def volume() -> LightVolume:
        coefficients = project(directions, radiance.reshape(-1, rays, 3)).reshape(*counts, COUNT, 3)
        return replace(grid, coefficients=_filled(coefficients, buried))

    radiance[hits.ray] += hits.albedo / np.float32(np.pi) * _ambient(volume(), light, hits)
    return volume()


def _ambient(volume: LightVolume, light: Daylight, hits: Hits) -> F32:
    """Compute irradiance at the hits: from the volume as the shader does, of the open sky outside it; shape (N, 3).

    A position that is moved at random by up to half a cell has on average the mean of the probes around it.
    """
    table, open_sky = volume.coefficients.reshape(-1, 3), light.open_sky.astype(np.float32)
    rng = np.random.default_rng(_SEED)
    result = np.empty((len(hits.ray), 3), np.float32)
    for start in range(0, len(result), CHUNK):
        rows = slice(start, start + CHUNK)
        normal = hits.normal[rows].astype(np.float64)
        moved = rng.random((len(normal), 3)) - 0.5
        probe, inside = volume.nearest(hits.position[rows] + volume.cell * (AHEAD * normal + moved))
        number, weight = weigh(normal)
        held = np.zeros((len(normal), 3), np.float32)
        for column in range(number.shape[1]):
            held += weight[:, column, None].astype(np.float32) * table[COUNT * probe + number[:, column]]
        outside = open_sky[0] + hits.normal[rows] @ open_sky[1:]
        result[rows] = np.where(inside[:, None], held, outside)
    return np.maximum(result, 0)


def _filled(coefficients: F64, buried: NDArray[np.bool_]) -> F32:
    """Fill probes inside solids with the mean of their neighbors outside solids, layer by layer.

    A surface that faces along a half axis has its air there: the neighbor on that side counts most.
    """
    values, known = coefficients.astype(np.float32), ~buried
    values[buried] = 0
    while known.any() and not known.all():
        total, weight = np.zeros_like(values), np.zeros((*known.shape, COUNT, 1), np.float32)
        for axis in range(3):
            for shift in (-1, 1):
                facing = HALF_AXES[:, 2 - axis] * -shift  # 1 for the half axis that points to this neighbor
                share = np.append(np.where(facing > 0, 1.0, np.where(facing < 0, *_BESIDE)), 1.0).astype(np.float32)
                there = _shifted(known.astype(np.float32), axis, shift)[..., None, None] * share[:, None]
                total += _shifted(values, axis, shift) * there
                weight += there
        grown = ~known & (weight[..., 0, 0] > 0)
        values[grown] = total[grown] / weight[grown]
        known = known | grown
    return values


def _shifted(values: F32, axis: int, shift: int) -> F32:
    moved = np.zeros_like(values)
    source, target = [slice(None)] * values.ndim, [slice(None)] * values.ndim
    target[axis], source[axis] = (slice(1, None), slice(None, -1)) if shift > 0 else (slice(None, -1), slice(1, None))
    moved[tuple(target)] = values[tuple(source)]
    return moved
