"""Points inside the picture of a camera, with its lens distortion."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usd_schemas.distortion import NO_DISTORTION, Distortion
from usd_schemas.pinhole import Pinhole

F64 = NDArray[np.float64]

BORDER = 33  # places along each side of a picture that are undistorted to find its field of view


@dataclass(frozen=True)
class Eye:
    """A camera for ray casting.

    Attributes:
        camera: Intrinsics.
        distortion: Distortion of the lens.
        widest: Largest distance from the axis that a picture shows, in normalized coordinates [1].
    """

    camera: Pinhole
    distortion: Distortion
    widest: float

    def rays(self, pixels: F64) -> F64:
        """Compute the ray directions of pixels.

        Args:
            pixels: Pixel positions [px], shape (N, 2), float64.

        Returns:
            Directions of depth 1 in camera axes [1], shape (N, 3), float64.
        """
        camera = self.camera
        drawn = (pixels - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
        return np.column_stack([self.distortion.undistort(drawn), np.ones(len(pixels))])

    def framed(self, points: F64, pose: F64) -> NDArray[np.bool_]:
        """Find which points are inside an image, ignoring occlusion.

        Args:
            points: World positions [m], shape (N, 3), float64.
            pose: camera_to_world [m], shape (4, 4), float64.

        Returns:
            Whether each is framed, shape (N,), bool.
        """
        return self.framed_local((points - pose[:3, 3]) @ pose[:3, :3])

    def framed_local(self, local: F64) -> NDArray[np.bool_]:
        """Find which points in camera axes are inside the image, ignoring occlusion.

        Args:
            local: Positions from the camera's center, axes right, down, forward [m], shape (N, 3), float64.

        Returns:
            Whether each is framed, shape (N,), bool.
        """
        camera = self.camera
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            normalized = local[:, :2] / local[:, 2:]
            # Far outside the picture the polynomial is not monotonic, and would map points into the picture.
            near = np.sum(normalized**2, axis=1) <= self.widest**2
            pixels = self.distortion.distort(normalized) * [camera.fx, camera.fy] + [camera.cx, camera.cy]
            inside = ((pixels >= 0.0) & (pixels < [camera.width, camera.height])).all(axis=1)
        return (local[:, 2] > 0.0) & near & inside


def eye_of(camera: Pinhole, distortion: Distortion = NO_DISTORTION) -> Eye:
    """Compute the field of view of a camera.

    Args:
        camera: Intrinsics.
        distortion: Distortion of the lens.
    """
    x, y = np.linspace(0.0, camera.width, BORDER), np.linspace(0.0, camera.height, BORDER)
    border = np.concatenate(
        [np.column_stack([x, np.full(BORDER, edge)]) for edge in (0.0, camera.height)]
        + [np.column_stack([np.full(BORDER, edge), y]) for edge in (0.0, camera.width)]
    )
    drawn = (border - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
    reach = np.linalg.norm(distortion.undistort(drawn), axis=1).max()
    return Eye(camera, distortion, float(reach) * (1.0 + 1e-9))
