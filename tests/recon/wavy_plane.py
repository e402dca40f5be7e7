"""A plane with a texture in closed form: every gray value and every depth of any view is exact."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usd_schemas.pinhole import Pinhole, unproject

F64 = NDArray[np.float64]
WAVES = 60
SKY = 200.0


@dataclass(frozen=True)
class WavyPlane:
    """All points p with normal @ p = offset, gray by a sum of waves in space.

    Attributes:
        normal: Unit normal, shape (3,), float64.
        offset: Distance from the origin [m].
        seed: Seed of the waves.
        wavelength: Shortest wave [m].
        reach: Half side of the square about its middle that is there; beyond is sky [m].
    """

    normal: F64
    offset: float
    seed: int = 0
    wavelength: float = 0.12
    reach: float = np.inf

    def depth(self, camera: Pinhole, pose: F64) -> F64:
        """Find the planar depth of each pixel, +inf for sky [m], shape (H, W)."""
        column, row = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
        pixels = np.column_stack([column.ravel(), row.ravel()]).astype(np.float64)
        rays = unproject(pixels, np.ones(len(pixels)), camera, pose) - pose[:3, 3]
        depth = (self.offset - self.normal @ pose[:3, 3]) / (rays @ self.normal)
        points = pose[:3, 3] + rays * depth[:, None]
        there = (depth > 0) & (np.abs(points - self.normal * self.offset).max(axis=1) <= self.reach)
        return np.where(there, depth, np.inf).reshape(camera.height, camera.width)

    def gray(self, camera: Pinhole, pose: F64) -> NDArray[np.uint8]:
        """Photograph it, shape (H, W), uint8: the mean over four places of each pixel, as a sensor takes it."""
        total = np.zeros((camera.height, camera.width))
        for dx in (-0.25, 0.25):
            for dy in (-0.25, 0.25):
                shifted = Pinhole(camera.width, camera.height, camera.fx, camera.fy, camera.cx - dx, camera.cy - dy)
                total += self._shade(shifted, pose)
        return np.clip(total / 4, 0, 255).astype(np.uint8)

    def _shade(self, camera: Pinhole, pose: F64) -> F64:
        rng = np.random.default_rng(self.seed)
        waves = rng.normal(size=(WAVES, 3))
        waves *= (2 * np.pi / rng.uniform(self.wavelength, 8 * self.wavelength, WAVES) / np.linalg.norm(waves, axis=1))[
            :, None
        ]
        phase = rng.uniform(0, 2 * np.pi, WAVES)
        depth = self.depth(camera, pose)
        there = np.isfinite(depth)
        column, row = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
        pixels = np.column_stack([column[there], row[there]]).astype(np.float64)
        points = unproject(pixels, depth[there], camera, pose)
        gray = np.full(depth.shape, SKY)
        gray[there] = 110 + 90 * np.sin(points @ waves.T + phase).sum(axis=1) / np.sqrt(WAVES)
        return gray
