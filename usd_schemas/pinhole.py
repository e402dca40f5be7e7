"""The camera convention: pinhole intrinsics, USD lens values, and camera axes.

Camera axes are +x right, +y down, +z forward; a USD camera looks along -z with +y up. The center of the top-left pixel
is (0.5, 0.5), so that the center of an image is (width/2, height/2), as in COLMAP. OpenCV counts from the pixel
center: its principal point is ours minus 0.5.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

USD_FROM_CAMERA = np.diag([1.0, -1.0, -1.0, 1.0])
TENTH = 0.1  # USD's unit of lens lengths is a tenth of a stage unit


@dataclass(frozen=True)
class Pinhole:
    """Intrinsics of a camera without distortion.

    Attributes:
        width: Image width [px].
        height: Image height [px].
        fx: Focal length along the rows [px].
        fy: Focal length along the columns [px].
        cx: Principal point from the left edge of the image [px].
        cy: Principal point from the top edge of the image [px].
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def matrix(self) -> Array:
        """Return the calibration matrix [px], shape (3, 3), float64."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])


@dataclass(frozen=True)
class UsdLens:
    """Lens attributes of a UsdGeomCamera, in tenths of a stage unit.

    Attributes:
        focal_length: `focalLength` [0.1 stage units].
        horizontal_aperture: `horizontalAperture` [0.1 stage units].
        vertical_aperture: `verticalAperture` [0.1 stage units].
        horizontal_offset: `horizontalApertureOffset` [0.1 stage units].
        vertical_offset: `verticalApertureOffset` [0.1 stage units].
    """

    focal_length: float
    horizontal_aperture: float
    vertical_aperture: float
    horizontal_offset: float = 0.0
    vertical_offset: float = 0.0


def lens_from_pinhole(camera: Pinhole, sensor_width: float, meters_per_unit: float = 1.0) -> UsdLens:
    """Express intrinsics as USD lens attributes.

    Args:
        camera: Intrinsics.
        sensor_width: Width of the sensor [m], e.g. 0.036.
        meters_per_unit: Size of the stage unit [m].

    Returns:
        Lens attributes that give the same projection.
    """
    pitch = sensor_width / camera.width / (TENTH * meters_per_unit)
    return UsdLens(
        focal_length=camera.fx * pitch,
        horizontal_aperture=camera.width * pitch,
        vertical_aperture=camera.height * pitch * camera.fx / camera.fy,
        horizontal_offset=(camera.width / 2 - camera.cx) * pitch,
        vertical_offset=(camera.cy - camera.height / 2) * pitch * camera.fx / camera.fy,
    )


def pinhole_from_lens(lens: UsdLens, width: int, height: int) -> Pinhole:
    """Read intrinsics from USD lens attributes for an image size.

    Where the aspects of aperture and image differ, the aperture is widened in one direction until it has the image's
    aspect (USD's default, `expandAperture`), so that pixels stay square and nothing authored is cut off.

    Args:
        lens: Lens attributes.
        width: Image width [px].
        height: Image height [px].

    Returns:
        Intrinsics with square pixels.
    """
    per_unit = min(width / lens.horizontal_aperture, height / lens.vertical_aperture)
    focal = lens.focal_length * per_unit
    return Pinhole(
        width,
        height,
        focal,
        focal,
        width / 2 - lens.horizontal_offset * per_unit,
        height / 2 + lens.vertical_offset * per_unit,
    )


def look_at(eye: Array, target: Array, up: Array | None = None) -> Array:
    """Aim a camera without roll.

    Args:
        eye: Camera center [m], shape (3,), float64.
        target: Point on the optical axis [m], shape (3,), float64.
        up: Direction that points up in the image [1], shape (3,), float64; None: world z.

    Returns:
        camera_to_world [m], shape (4, 4), float64, with camera axes right, down, forward.
    """
    forward = target - eye
    forward = forward / np.linalg.norm(forward)
    upward = np.array([0.0, 0.0, 1.0]) if up is None else up
    right = np.cross(forward, upward)
    if np.linalg.norm(right) < 1e-6:  # looking along the up axis: right is arbitrary, the world's x
        right = np.array([1.0, 0.0, 0.0])
    right = right / np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = right, np.cross(forward, right), forward, eye
    return pose


def project(points: Array, camera: Pinhole, camera_to_world: Array) -> tuple[Array, Array]:
    """Project world points into an image.

    Args:
        points: World positions [m], shape (N, 3), float64.
        camera: Intrinsics.
        camera_to_world: Camera pose [m], shape (4, 4), float64.

    Returns:
        Pixel positions [px], shape (N, 2), float64, and planar depths [m], shape (N,), float64, negative behind.
    """
    local = (points - camera_to_world[:3, 3]) @ camera_to_world[:3, :3]
    depth = local[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels = local[:, :2] / depth[:, None] * [camera.fx, camera.fy] + [camera.cx, camera.cy]
    return pixels, depth


def unproject(pixels: Array, depth: Array, camera: Pinhole, camera_to_world: Array) -> Array:
    """Find the world points at given pixels and planar depths.

    Args:
        pixels: Pixel positions [px], shape (N, 2), float64.
        depth: Planar depths [m], shape (N,), float64.
        camera: Intrinsics.
        camera_to_world: Camera pose [m], shape (4, 4), float64.

    Returns:
        World positions [m], shape (N, 3), float64.
    """
    rays = np.column_stack([(pixels - [camera.cx, camera.cy]) / [camera.fx, camera.fy], np.ones(len(pixels))])
    return (rays * depth[:, None]) @ camera_to_world[:3, :3].T + camera_to_world[:3, 3]
