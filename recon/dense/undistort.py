"""The working camera of the dense step: photographs without their lens's distortion, reduced by the chosen quality."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from groundwork.errors import RejectedSceneError
from recon.sfm.colmap_model import SparseModel
from usd_schemas.distortion import Distortion
from usd_schemas.pinhole import Pinhole

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]
Mask = NDArray[np.bool_]

_GROWTH = 0.3  # a barrel-shaped photograph may grow by this share of its size on every side before it is cut
_CLOSE = 0.01  # [px] a lens that moves no pixel by more than this counts as free of distortion


@dataclass(frozen=True)
class WorkingCamera:
    """A pinhole camera that sees all that the photograph shows, and the mapping back to the photograph's own pixels.

    Attributes:
        pinhole: Of the undistorted, reduced image.
        photograph: Intrinsics of the photograph as the reconstruction found them.
        distortion: Its distortion as the reconstruction found it.
        full: The pinhole before it was reduced.
    """

    pinhole: Pinhole
    photograph: Pinhole
    distortion: Distortion
    full: Pinhole

    def to_photograph(self, pixels: F64) -> F64:
        """Map positions in a working image to the photograph.

        Args:
            pixels: Positions in the working image [px], shape (..., 2), float64.

        Returns:
            Positions in the photograph [px], shape (..., 2), float64.
        """
        camera, original = self.pinhole, self.photograph
        straight = (pixels - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
        return self.distortion.distort(straight) * [original.fx, original.fy] + [original.cx, original.cy]


def working_camera(model: SparseModel, size: tuple[int, int], downscale: int) -> WorkingCamera:
    """Choose the working camera of a reconstruction.

    Args:
        model: Holds the camera as the reconstruction found it.
        size: Width and height of the photographs [px].
        downscale: Side of a working pixel in pixels of the photograph.

    Returns:
        The camera.

    Raises:
        RejectedSceneError: `bad_lens`: the estimated distortion cannot be inverted inside the image.
    """
    photograph, distortion = lens_of(model, size)
    (left, right), (top, bottom) = _reach(photograph, distortion)
    full = Pinhole(right - left, bottom - top, photograph.fx, photograph.fy, photograph.cx - left, photograph.cy - top)
    width, height = max(1, round(full.width / downscale)), max(1, round(full.height / downscale))
    across, down = width / full.width, height / full.height
    reduced = Pinhole(width, height, full.fx * across, full.fy * down, full.cx * across, full.cy * down)
    return WorkingCamera(reduced, photograph, distortion, full)


def undistort(image: U8, camera: WorkingCamera) -> U8:
    """Undistort and reduce a photograph to a working image.

    Args:
        image: Photograph, shape (H, W, 3), uint8.
        camera: Working camera.

    Returns:
        Working image, shape (h, w, 3), uint8; black where the photograph shows nothing.
    """
    where = _source_pixels(camera)
    straight = image
    if not _is_straight(where, camera):
        across, down = np.moveaxis((where - 0.5).astype(np.float32), -1, 0)  # OpenCV counts from pixel centers
        straight = cv2.remap(image, across, down, cv2.INTER_CUBIC, None, cv2.BORDER_CONSTANT).astype(np.uint8)
    size = (camera.pinhole.width, camera.pinhole.height)
    return cv2.resize(straight, size, interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)


def covered(camera: WorkingCamera) -> Mask:
    """Find the working pixels that the photograph covers completely.

    Args:
        camera: Working camera.

    Returns:
        Their mask, shape (h, w), bool.
    """
    where, photograph = _source_pixels(camera), camera.photograph
    inside = np.asarray(((where >= 0.0) & (where <= [photograph.width, photograph.height])).all(axis=-1), np.float32)
    size = (camera.pinhole.width, camera.pinhole.height)
    return np.asarray(cv2.resize(inside, size, interpolation=cv2.INTER_AREA) > 0.999)


def _source_pixels(camera: WorkingCamera) -> F64:
    """Find the photograph's position of every pixel of the full pinhole [px], shape (H, W, 2)."""
    full, original = camera.full, camera.photograph
    column, row = np.meshgrid(np.arange(full.width) + 0.5, np.arange(full.height) + 0.5)
    straight = np.stack([(column - full.cx) / full.fx, (row - full.cy) / full.fy], axis=-1)
    bent = camera.distortion.distort(straight.astype(np.float64))
    return bent * [original.fx, original.fy] + [original.cx, original.cy]


def _is_straight(where: F64, camera: WorkingCamera) -> bool:
    full, original = camera.full, camera.photograph
    if (full.width, full.height) != (original.width, original.height):
        return False
    return bool(
        abs(where[0, 0] - 0.5).max() < _CLOSE and abs(where[-1, -1] + 0.5 - [full.width, full.height]).max() < _CLOSE
    )


def lens_of(model: SparseModel, size: tuple[int, int]) -> tuple[Pinhole, Distortion]:
    """Read the lens of a reconstruction from COLMAP's parameters; their order depends on the camera model.

    Args:
        model: Holds the camera.
        size: Width and height of the photographs [px].

    Returns:
        Intrinsics and distortion.
    """
    params = model.camera_params
    if model.camera_model in ("PINHOLE", "OPENCV"):
        fx, fy, cx, cy, *rest = params
    else:
        fx, cx, cy, *rest = params
        fy = fx
    k1, k2, p1, p2 = (*rest, 0.0, 0.0, 0.0, 0.0)[:4]
    return Pinhole(*size, fx, fy, cx, cy), Distortion(k1, k2, p1, p2)


def _reach(camera: Pinhole, distortion: Distortion) -> tuple[tuple[int, int], tuple[int, int]]:
    """Find the columns and rows that the undistorted photograph spans, in whole pixels of the photograph."""
    width, height = camera.width, camera.height
    column, row = np.linspace(0, width, 65), np.linspace(0, height, 65)
    rim = np.concatenate(
        [
            np.column_stack([column, np.zeros(65)]),
            np.column_stack([column, np.full(65, height)]),
            np.column_stack([np.zeros(65), row]),
            np.column_stack([np.full(65, width), row]),
        ]
    )
    try:
        straight = distortion.undistort((rim - [camera.cx, camera.cy]) / [camera.fx, camera.fy])
    except ValueError as error:
        raise RejectedSceneError(
            "bad_lens", f"the lens distortion that structure from motion found cannot be inverted: {error}"
        ) from None
    rim = straight * [camera.fx, camera.fy] + [camera.cx, camera.cy]
    low = np.maximum(np.round(rim.min(axis=0)), [-_GROWTH * width, -_GROWTH * height]).astype(int)
    high = np.minimum(np.round(rim.max(axis=0)), [(1 + _GROWTH) * width, (1 + _GROWTH) * height]).astype(int)
    return (int(low[0]), int(high[0])), (int(low[1]), int(high[1]))
