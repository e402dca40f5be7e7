"""Visibility of surface points in the cameras of a stage."""

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from groundwork.progress import Progress
from usd_schemas.distortion import Distortion
from usd_schemas.flat_scene import FlatScene
from usd_schemas.pinhole import Pinhole, pinhole_from_lens
from usd_schemas.raycast import RayScene

F64 = NDArray[np.float64]

TOUCH = 0.001  # [m] a ray that ends less than this before a point counts as reaching it
_TOUCH_SHARE = 2e-5  # plus this share of the distance: the ray caster uses single precision
_MARGIN = 1.5  # times the image size: a lens with distortion may show points outside the image of a pinhole


def count_views(points: F64, scene: FlatScene, survey: str, rays: RayScene, progress: Progress) -> NDArray[np.uint16]:
    """Count the images in which each point is visible: inside the frame, and not occluded.

    Args:
        points: Positions on the surface [m], shape (N, 3), float64.
        scene: Stage with surveys.
        survey: Count in this survey only; empty for all.
        rays: The whole surface.
        progress: Listener.

    Returns:
        Number of images, shape (N,), uint16.

    Raises:
        InputError: The stage has no camera, or not this survey.
    """
    products = [product for product in scene.products if scene.cameras[product.camera].path]
    names = [product.name for product in products]
    if not names:
        raise InputError(
            "has no camera of a survey", field="min_views", hint="Add a survey to the stage, or set min_views = 0"
        )
    if survey and survey not in names:
        raise InputError("no such survey on the stage", field="survey", value=survey, allowed=", ".join(names))
    chosen = [product for product in products if survey in ("", product.name)]
    views = np.zeros(len(points), np.uint16)
    progress.stage("views", sum(len(scene.cameras[product.camera].poses) for product in chosen))
    done = 0
    for product in chosen:
        track = scene.cameras[product.camera]
        camera = track.calibration or pinhole_from_lens(track.lens, product.width, product.height)
        for pose in track.poses:
            framed = np.flatnonzero(in_frame(points, camera, track.distortion, pose))
            views[framed[_reached(points[framed], pose[:3, 3], rays)]] += 1
            done += 1
            progress.advance(done)
    return views


def in_frame(points: F64, camera: Pinhole, distortion: Distortion, pose: F64) -> NDArray[np.bool_]:
    """Tell which points fall into an image, ignoring occlusion.

    Args:
        points: World positions [m], shape (N, 3), float64.
        camera: Intrinsics.
        distortion: Distortion of the lens.
        pose: camera_to_world [m], shape (4, 4), float64.

    Returns:
        Whether each does, shape (N,), bool.
    """
    local = (points - pose[:3, 3]) @ pose[:3, :3]
    size, focal = np.array([camera.width, camera.height]), np.array([camera.fx, camera.fy])
    middle = np.array([camera.cx, camera.cy])
    with np.errstate(divide="ignore", invalid="ignore"):
        xy = local[:, :2] / local[:, 2:]
    # Far outside the image the distortion polynomial may map points back into it.
    near = (local[:, 2] > 0) & (np.abs(xy * focal) <= _MARGIN * np.maximum(middle, size - middle)).all(axis=1)
    inside = np.zeros(len(points), bool)
    pixels = distortion.distort(xy[near]) * focal + middle
    inside[near] = ((pixels >= 0) & (pixels < size)).all(axis=1)
    return inside


def _reached(points: F64, eye: F64, rays: RayScene) -> NDArray[np.bool_]:
    """Tell which points a ray from the camera reaches."""
    ways = points - eye
    lengths = np.linalg.norm(ways, axis=1)
    found, _, _ = rays.cast(np.broadcast_to(eye, points.shape), ways)
    return found * lengths >= lengths * (1.0 - _TOUCH_SHARE) - TOUCH
