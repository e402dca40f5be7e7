"""The ray caster as judge of every exact image: through any lens, and from wherever each row was read out."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from render.capture import Truth
from usd_schemas.distortion import NO_DISTORTION, Distortion
from usd_schemas.pinhole import Pinhole
from usd_schemas.raycast import RayScene

F64 = NDArray[np.float64]
U32 = NDArray[np.uint32]
Bands = tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class Verdict:
    """How far one view is from its oracle.

    Attributes:
        equal: Share of pixels with the same id [1].
        stray: Share of pixels that differ and lie farther than a pixel from every edge of the oracle's ids [1].
        median: Median relative error of depth where ids agree [1].
        tail: Its 99.9th percentile [1].
        pixels: Number of pixels.
    """

    equal: float
    stray: float
    median: float
    tail: float
    pixels: int


class Oracle:
    """World triangles under the ray caster."""

    def __init__(self, corners: F64, ids: U32) -> None:
        """Build the search structure of triangles, shape (T, 3, 3), with their ids, shape (T,)."""
        self._corners = corners
        self._rays = RayScene(corners, ids)

    def look(self, truth: Truth, index: int) -> tuple[F64, U32, F64]:
        """Cast the rays of one image of a capture."""
        bands: Bands = ((0, truth.camera.height),)
        poses = truth.poses[index][None]
        if truth.readout is not None:
            bands, poses = truth.readout.bands, truth.readout.poses[index]
        return self.cast(truth.camera, poses, bands, truth.distortion)

    def cast(
        self, camera: Pinhole, poses: F64, bands: Bands, distortion: Distortion = NO_DISTORTION
    ) -> tuple[F64, U32, F64]:
        """Cast a ray through every pixel center: planar depth, id, geometric normal facing the camera."""
        v, u = np.mgrid[0 : camera.height, 0 : camera.width] + 0.5
        bent = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy], axis=-1)
        rays = np.concatenate([distortion.undistort(bent), np.ones((*u.shape, 1))], axis=-1)
        eyes = np.empty_like(rays)
        for pose, (first, end) in zip(poses, bands, strict=True):
            rays[first:end] = rays[first:end] @ pose[:3, :3].T
            eyes[first:end] = pose[:3, 3]
        flat = rays.reshape(-1, 3)
        depth, triangle, ids = self._rays.cast(eyes.reshape(-1, 3), flat)
        depth = self._sharpened(depth, triangle, eyes.reshape(-1, 3), flat)
        met = self._corners[triangle]
        normal = np.cross(met[:, 1] - met[:, 0], met[:, 2] - met[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
        normal *= -np.sign(np.einsum("ij,ij->i", normal, flat))[:, None]
        return depth.reshape(u.shape), ids.reshape(u.shape), normal.reshape(*u.shape, 3)

    def _sharpened(self, depth: F64, triangle: NDArray[np.int64], eyes: F64, rays: F64) -> F64:
        """The engine counts in single precision; the plane of the triangle that it found gives the depth in double."""
        hit = np.flatnonzero(triangle >= 0)
        a, b, c = (self._corners[triangle[hit], corner] for corner in range(3))
        normal = np.cross(b - a, c - a)
        slope = np.einsum("ij,ij->i", normal, rays[hit])
        with np.errstate(divide="ignore", invalid="ignore"):
            exact = np.einsum("ij,ij->i", normal, a - eyes[hit]) / slope
        good = np.abs(exact - depth[hit]) < 1e-3 * depth[hit]  # a sliver's plane is no better than the engine
        result = depth.copy()
        result[hit[good]] = exact[good]
        return result


def edges(ids: U32, depth: F64) -> NDArray[np.bool_]:
    """Mark pixels beside which another part begins, or the same one behind a step."""
    middle = np.where(np.isfinite(depth), depth, 1e12)
    result = np.zeros(ids.shape, bool)
    for axis in (0, 1):
        here, there = [slice(None)] * 2, [slice(None)] * 2
        here[axis], there[axis] = slice(None, -1), slice(1, None)
        one, other = tuple(here), tuple(there)
        step = (ids[one] != ids[other]) | (np.abs(middle[one] - middle[other]) > 0.02 * middle[one])
        result[one] |= step
        result[other] |= step
    return result


def judge(ids: U32, depth: NDArray[np.float32], expected: U32, truth: F64) -> Verdict:
    """Compare a view with its oracle."""
    same = ids == expected
    beside: NDArray[np.bool_] = np.asarray(binary_dilation(edges(expected, truth), np.ones((3, 3), bool)), bool)
    sure = same & (expected > 0) & np.isfinite(truth)
    error = np.abs(depth[sure].astype(np.float64) - truth[sure]) / truth[sure]
    inner = ~beside[sure]
    return Verdict(
        float(same.mean()),
        float((~same & ~beside).mean()),
        float(np.median(error)),
        float(np.quantile(error[inner] if inner.any() else error, 0.999)),
        ids.size,
    )
