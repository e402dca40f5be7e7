"""Lens distortion: the radial and tangential polynomial of COLMAP's OPENCV camera.

It acts on normalized coordinates (x / z, y / z), between the pose and the calibration matrix: a point at `xy` is imaged
where a camera without distortion would image `distort(xy)`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError

F64 = NDArray[np.float64]

STEPS = 30  # Newton's method needs about five
CLOSE = 1e-12  # largest remaining error, in normalized coordinates [1]


@dataclass(frozen=True)
class Distortion:
    """Distortion of a lens; the default has none.

    Source: D. C. Brown, Close-range camera calibration, Photogrammetric Engineering 37 (1971); written as in COLMAP.

    Attributes:
        k1: Radial coefficient of the square of the distance from the axis [1].
        k2: Radial coefficient of its fourth power [1].
        p1: Tangential coefficient along the columns (y) [1].
        p2: Tangential coefficient along the rows (x) [1].
    """

    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0

    @property
    def is_identity(self) -> bool:
        """Whether the lens has no distortion."""
        return not any((self.k1, self.k2, self.p1, self.p2))

    def distort(self, xy: F64) -> F64:
        """Apply the distortion.

        Args:
            xy: Normalized coordinates [1], shape (..., 2), float64.

        Returns:
            Distorted normalized coordinates [1], the same shape (..., 2), float64.
        """
        x, y = xy[..., 0], xy[..., 1]
        square = x * x + y * y
        radial = 1.0 + square * (self.k1 + square * self.k2)
        return np.stack(
            [
                x * radial + 2.0 * self.p1 * x * y + self.p2 * (square + 2.0 * x * x),
                y * radial + self.p1 * (square + 2.0 * y * y) + 2.0 * self.p2 * x * y,
            ],
            axis=-1,
        )

    def undistort(self, xy: F64) -> F64:
        """Invert the distortion by Newton's method.

        Args:
            xy: Distorted normalized coordinates [1], shape (..., 2), float64.

        Returns:
            Normalized coordinates [1], the same shape (..., 2), float64.

        Raises:
            InputError: A point is where the polynomial is no longer monotonic, so that the distortion has no inverse.
        """
        if self.is_identity:
            return np.array(xy, np.float64)
        found = np.array(xy, np.float64)
        with np.errstate(all="ignore"):
            for _ in range(STEPS):
                error = self.distort(found) - xy
                if not np.any(np.abs(error) > CLOSE):
                    break
                xx, xy_, yy = self.slopes(found)
                area = xx * yy - xy_ * xy_
                found[..., 0] -= (yy * error[..., 0] - xy_ * error[..., 1]) / area
                found[..., 1] -= (xx * error[..., 1] - xy_ * error[..., 0]) / area
            xx, xy_, yy = self.slopes(found)
            # The Jacobian is symmetric; the polynomial is monotonic as long as both of its eigenvalues are positive.
            good = (xx + yy > 0.0) & (xx * yy - xy_ * xy_ > 0.0)
            good &= np.all(np.abs(self.distort(found) - xy) <= 1e3 * CLOSE, axis=-1) & self._is_before_fold(found)
        if not good.all():
            farthest = float(np.sqrt((np.asarray(xy)[~good] ** 2).sum(axis=-1)).min())
            raise InputError(
                f"a distortion of k1 {self.k1:g}, k2 {self.k2:g}, p1 {self.p1:g}, p2 {self.p2:g} has no inverse "
                f"{farthest:.3g} focal lengths from the axis, which lies inside the image",
                hint="Use smaller coefficients, or a longer focal length",
            )
        return found

    def _is_before_fold(self, xy: F64) -> NDArray[np.bool_]:
        """Tell which points are not beyond a fold, where the polynomial rises again; shape (...)."""
        square = (xy * xy).sum(axis=-1)
        if not self.k1 < 0.0 < self.k2:
            return np.ones(square.shape, bool)
        # The slope along a radius, 1 + 3 k1 r² + 5 k2 r⁴, is least here: it tells whether the way from the axis folds.
        lowest = -0.3 * self.k1 / self.k2
        xx, xy_, yy = self.slopes(xy * np.sqrt(lowest / np.maximum(square, lowest))[..., None])
        return (square <= lowest) | ((xx + yy > 0.0) & (xx * yy - xy_ * xy_ > 0.0))

    def slopes(self, xy: F64) -> tuple[F64, F64, F64]:
        """Compute the derivatives of the distorted coordinates by the normalized ones.

        Args:
            xy: Normalized coordinates [1], shape (..., 2), float64.

        Returns:
            Derivatives dx/dx, dx/dy = dy/dx and dy/dy [1], each of shape (...), float64.
        """
        x, y = xy[..., 0], xy[..., 1]
        square = x * x + y * y
        radial = 1.0 + square * (self.k1 + square * self.k2)
        steep = 2.0 * (self.k1 + 2.0 * square * self.k2)
        xx = radial + steep * x * x + 2.0 * self.p1 * y + 6.0 * self.p2 * x
        yy = radial + steep * y * y + 6.0 * self.p1 * y + 2.0 * self.p2 * x
        return xx, steep * x * y + 2.0 * self.p1 * x + 2.0 * self.p2 * y, yy


NO_DISTORTION = Distortion()
