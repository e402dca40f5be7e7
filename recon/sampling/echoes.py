"""Returns of laser pulses: ranges with noise, intensities, and losses."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.sampling.sampler_settings import ScannerSettings
from recon.sampling.scan_pattern import Rays
from recon.sampling.scene_surface import SceneSurface
from recon.sampling.surface_look import SurfaceLook
from usd_schemas.raycast import RayScene

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Bool = NDArray[np.bool_]

EDGE = 0.02  # [m] points closer than this to the plane hit by the beam's center belong to one surface
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
_TEN_PERCENT = 0.1
_HOLES = 6  # transparent texels of leaves that a ray may pass through
_STEP = 0.002  # [m] beyond a transparent texel, where the ray continues
_LAYERS = 12  # leaves that a pulse of several returns may hit


@dataclass(frozen=True, eq=False)
class Hits:
    """Where rays hit a surface; for a ray that hits none, `rows` is -1 and the rest is undefined.

    Attributes:
        rows: Triangle, shape (N,), int64.
        distances: Range along the unit direction [m], shape (N,), float64.
        colors: Linear base colors [1], shape (N, 3), float32.
    """

    rows: I64
    distances: F64
    colors: F32

    def take(self, rows: Bool) -> "Hits":
        """Select some hits.

        Args:
            rows: Which ones, shape (N,), bool.
        """
        return Hits(self.rows[rows], self.distances[rows], self.colors[rows])


@dataclass(frozen=True, eq=False)
class Echoes:
    """Returns that make points: none, one, or several in a row for each ray.

    Attributes:
        shots: Row of its ray, shape (M,), int64.
        rows: Triangle that the beam's center hit, shape (M,), int64.
        distances: True range of the beam's center [m], shape (M,), float64.
        measured: Range as measured [m], shape (M,), float64.
        colors: Linear base colors [1], shape (M, 3), float32.
        intensities: Reflectance times cosine of the incidence, times the share of the pulse that hit the surface [1],
            shape (M,), float64.
        mixed: Whether the range is a mixture of two surfaces, shape (M,), bool.
    """

    shots: I64
    rows: I64
    distances: F64
    measured: F64
    colors: F32
    intensities: F64
    mixed: Bool


class Target:
    """A scene with what laser scanning needs."""

    def __init__(self, surface: SceneSurface, look: SurfaceLook, rays: RayScene, water: Bool, plants: Bool) -> None:
        """Store the parts of the scene.

        Args:
            surface: Its surface.
            look: Colors of the surface.
            rays: The same surface for ray casting.
            water: Which triangles are water, shape (T,), bool.
            plants: Which triangles are those of trees and shrubs, shape (T,), bool.
        """
        self._surface, self._look, self._rays, self._water, self._plants = surface, look, rays, water, plants

    def hit(self, origins: F64, directions: F64, colored: bool = True, behind: F64 | None = None) -> Hits:
        """Find the first surface whose texture is not transparent there, with the range in double precision.

        Args:
            origins: Starts [m], shape (N, 3), float64.
            directions: Unit directions [1], shape (N, 3), float64.
            colored: Whether the colors are needed.
            behind: Smallest range of a surface [m], shape (N,), float64; None for none.
        """
        rows, distances = np.full(len(origins), -1), np.full(len(origins), np.inf)
        colors = np.zeros((len(origins), 3), np.float32)
        open_rays, begin = np.arange(len(origins)), np.zeros(len(origins)) if behind is None else behind.copy()
        for _ in range(_HOLES):
            starts = origins[open_rays] + begin[open_rays, None] * directions[open_rays]
            _, found, _ = self._rays.cast(starts, directions[open_rays])
            met = open_rays[found >= 0]
            row = found[found >= 0]
            normals, corner = self._surface.normals[row], self._surface.corners[row, 0]
            with np.errstate(divide="ignore", invalid="ignore"):
                distance = np.einsum("ni,ni->n", corner - origins[met], normals) / np.einsum(
                    "ni,ni->n", directions[met], normals
                )
            places = barycentric(origins[met] + distance[:, None] * directions[met], self._surface.corners[row])
            good = np.isfinite(distance) & np.isfinite(places).all(axis=1)  # a ray along the triangle's plane
            met, row, distance, places = met[good], row[good], distance[good], places[good]
            if colored or self._look.has_holes:
                colors[met], solid = self._look.at(row, places)
            else:
                solid = np.ones(len(met), bool)
            rows[met[solid]], distances[met[solid]] = row[solid], distance[solid]
            open_rays = met[~solid]
            begin[open_rays] = distance[~solid] + _STEP
            if not len(open_rays):
                break
        return Hits(rows, distances, colors)

    def echoes(self, rays: Rays, settings: ScannerSettings, rng: np.random.Generator) -> Echoes:
        """Simulate the measurement along rays.

        A pulse with several returns continues behind trees and shrubs with the share that passes their leaves.

        Args:
            rays: Shots.
            settings: Ranges, returns, noise and losses.
            rng: Source of randomness.
        """
        shots, power = np.arange(len(rays.origins)), np.ones(len(rays.origins))
        behind, last = np.zeros(len(shots)), np.full(len(shots), -np.inf)
        given = np.zeros(len(shots), np.int64)
        parts: list[Echoes] = []
        for _ in range(_LAYERS if settings.returns > 1 else 1):
            hits = self.hit(rays.origins[shots], rays.directions[shots], behind=behind[shots])
            met = hits.rows >= 0
            shots, hits = shots[met], hits.take(met)
            caught = self._caught(hits.rows, settings, rng)
            apart = (caught > 0.0) & (hits.distances - last[shots] >= settings.return_gap)
            found = self._measured(rays, shots[apart], hits.take(apart), (power[shots] * caught)[apart], settings, rng)
            parts.append(found)
            given[found.shots] += 1
            last[found.shots], behind[shots] = found.distances, hits.distances + _STEP
            power[shots] *= 1.0 - caught
            shots = shots[(caught < 1.0) & (given[shots] < settings.returns)]
            if not len(shots):
                break
        return Echoes(*(np.concatenate([getattr(part, name) for part in parts]) for name in vars(parts[0])))

    def _caught(self, rows: I64, settings: ScannerSettings, rng: np.random.Generator) -> F64:
        """Draw the share of a pulse that each surface stops: leaves none or some of it, other surfaces all."""
        caught = np.ones(len(rows))
        if settings.returns > 1:
            leaves = np.flatnonzero(self._plants[rows])
            passed, share = rng.random((2, len(leaves)))
            caught[leaves] = np.where(passed < settings.leaf_gap, 0.0, share)
        return caught

    def _measured(
        self, rays: Rays, shots: I64, hits: Hits, power: F64, settings: ScannerSettings, rng: np.random.Generator
    ) -> Echoes:
        """Measure the hits: there is no return if too far, too oblique, too dark, or at random."""
        rows, distances, directions = hits.rows, hits.distances, rays.directions[shots]
        cosines = np.abs(np.einsum("ni,ni->n", directions, self._surface.normals[rows]))
        intensities = hits.colors @ _LUMINANCE * cosines * power
        kept = (distances >= settings.min_range) & (distances <= settings.max_range)
        kept &= cosines >= np.cos(np.deg2rad(settings.max_incidence))
        kept &= intensities / distances**2 >= _TEN_PERCENT / settings.range_at_10_percent**2
        lucky = rng.random((2, len(shots)))
        kept &= (lucky[0] >= settings.drop_out) & (~self._water[rows] | (lucky[1] < settings.water_echo))
        shots, rows, distances = shots[kept], rows[kept], distances[kept]
        measured, mixed = self._mixed(rays, shots, rows, distances, settings, rng)
        sigma = settings.range_noise + 1e-6 * settings.range_noise_ppm * distances
        measured = measured + sigma * rng.standard_normal(len(shots))
        return Echoes(shots, rows, distances, measured, hits.colors[kept], intensities[kept], mixed)

    def _mixed(
        self, rays: Rays, shots: I64, rows: I64, distances: F64, settings: ScannerSettings, rng: np.random.Generator
    ) -> tuple[F64, Bool]:
        """Mix the range with that of a second ray of the same beam that hits another surface just behind or in front.

        The share of that surface in the beam is drawn uniformly between 0 and 1.
        """
        if not settings.beam_divergence or not settings.mixing_gap:
            return distances, np.zeros(len(shots), bool)
        directions = rays.directions[shots]
        radius, turn, share = rng.random((3, len(shots)))
        second = _bent(directions, 0.5 * settings.beam_divergence * np.sqrt(radius), 2.0 * np.pi * turn)
        origins = rays.origins[shots]
        other = self.hit(origins, second, colored=False)
        met = other.rows >= 0
        far = np.where(met, other.distances, 0.0)
        points, others = origins + distances[:, None] * directions, origins + far[:, None] * second
        off_plane = np.abs(np.einsum("ni,ni->n", others - points, self._surface.normals[rows]))
        mixed = met & (off_plane > EDGE) & (np.abs(far - distances) <= settings.mixing_gap)
        return np.where(mixed, distances + share * (far - distances), distances), mixed


def barycentric(points: F64, corners: F64) -> F64:
    """Compute the barycentric coordinates of points in triangles.

    Args:
        points: Positions in the planes of the triangles [m], shape (N, 3), float64.
        corners: Corners [m], shape (N, 3, 3), float64.

    Returns:
        Weights of the corners [1], shape (N, 3), float64; NaN where a triangle has no area.

    Source: C. Ericson, Real-Time Collision Detection (2005), section 3.4.
    """
    first, second, way = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    aa, ab, bb = (np.einsum("ni,ni->n", a, b) for a, b in ((first, first), (first, second), (second, second)))
    wa, wb = np.einsum("ni,ni->n", way, first), np.einsum("ni,ni->n", way, second)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = aa * bb - ab * ab
        v, w = (bb * wa - ab * wb) / scale, (aa * wb - ab * wa) / scale
    return np.column_stack([1.0 - v - w, v, w])


def _bent(directions: F64, angles: F64, turns: F64) -> F64:
    """Tilt unit directions by an angle [rad] towards an azimuth [rad] about them."""
    steep = np.abs(directions[:, 2:]) > 0.9
    side = np.cross(directions, np.where(steep, [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    across = np.cross(directions, side)
    offset = np.cos(turns)[:, None] * side + np.sin(turns)[:, None] * across
    return np.cos(angles)[:, None] * directions + np.sin(angles)[:, None] * offset
