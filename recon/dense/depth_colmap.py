"""Depth maps by COLMAP's PatchMatch, which needs a CUDA device and is not deterministic."""

import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from recon.dense.undistort import WorkingCamera
from recon.sfm.colmap_model import read_model
from usd_schemas.pinhole import Pinhole

F32 = NDArray[np.float32]

_KIND = "geometric"  # COLMAP's name for depths that it has checked against other views


def has_cuda() -> bool:
    """Tell whether this COLMAP can run its PatchMatch."""
    import pycolmap

    return bool(pycolmap.has_cuda)


def measure_with_colmap(
    photographs: Path, model: Path, work: Path, names: Sequence[str], camera: WorkingCamera
) -> Iterator[F32]:
    """Measure the depth maps of all images of a model.

    Args:
        photographs: Folder that the images' names are relative to.
        model: Folder of the COLMAP model.
        work: Folder for COLMAP's workspace; created here, and deleted at the end.
        names: Names of the images.
        camera: Camera of the depth maps to return.

    Yields:
        Planar depth of each image, 0 where unknown [model units], shape (H, W), float32.

    Raises:
        InputError: This COLMAP has no CUDA.
    """
    import pycolmap

    from recon.sfm.colmap_log import silence

    silence()
    if not pycolmap.has_cuda:
        raise InputError(
            "COLMAP's PatchMatch needs CUDA, and this COLMAP was built without it",
            field="recon.dense.method",
            value="colmap",
            allowed="auto, sgm, patchmatch",
            hint="Choose another method, or install pycolmap-cuda12",
        )
    longest = max(camera.pinhole.width, camera.pinhole.height)
    smaller = pycolmap.UndistortCameraOptions(max_image_size=longest)
    pycolmap.undistort_images(work, model, photographs, list(names), undistort_options=smaller)
    pycolmap.patch_match_stereo(work, options=pycolmap.PatchMatchOptions(geom_consistency=True))
    fx, fy, cx, cy = read_model(work / "sparse").camera_params
    for name in names:
        depth = read_depth_map(work / "stereo" / "depth_maps" / f"{name}.{_KIND}.bin")
        yield reproject_depth(depth, Pinhole(depth.shape[1], depth.shape[0], fx, fy, cx, cy), camera.pinhole)
    shutil.rmtree(work)


def read_depth_map(path: Path) -> F32:
    """Read a depth map as COLMAP writes it: width&height&channels& and then rows of little-endian float32.

    Args:
        path: File to read.

    Returns:
        Planar depth [model units], shape (H, W), float32.

    Raises:
        InputError: Missing, or shorter than its stated sizes.
    """
    try:
        width, height, channels, data = path.read_bytes().split(b"&", 3)
        return np.frombuffer(data, "<f4").reshape(int(height), int(width), int(channels))[..., 0].astype(np.float32)
    except (OSError, ValueError) as error:
        raise InputError(f"not a depth map of COLMAP: {error}", where=path, hint="Reconstruct again") from None


def reproject_depth(depth: F32, camera: Pinhole, target: Pinhole) -> F32:
    """Resample a depth map for another camera of the same pose: planar depths stay, pixels move.

    Args:
        depth: Planar depth [model units], shape (h, w), float32.
        camera: Its camera.
        target: The other.

    Returns:
        Planar depth of the nearest pixel, 0 outside [model units], shape (H, W), float32.
    """
    column, row = np.meshgrid(np.arange(target.width) + 0.5, np.arange(target.height) + 0.5)
    across = (column - target.cx) / target.fx * camera.fx + camera.cx - 0.5
    down = (row - target.cy) / target.fy * camera.fy + camera.cy - 0.5
    maps = across.astype(np.float32), down.astype(np.float32)
    moved = cv2.remap(depth, *maps, cv2.INTER_NEAREST, None, cv2.BORDER_CONSTANT, 0.0)
    return np.asarray(moved, np.float32)
