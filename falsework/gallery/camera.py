"""Cameras of the gallery, which replace a scene's surveys."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from usd_schemas.flat_scene import FlatScene
from usd_schemas.pinhole import Pinhole

# Settings of a sensor that meters each picture separately, as there is no continuous flight from shade into the sky.
# What it meters is said, for on cameras that are no survey of ours the light is metered, and no frame follows its
# surfaces.
EACH_FOR_ITSELF = {"metering": "surfaces", "auto_exposure": 1.0}


def seen_from(scene: FlatScene, poses: NDArray[np.float64], camera: Pinhole) -> FlatScene:
    """Replace the surveys of a scene by one camera.

    Args:
        scene: Any scene with a survey.
        poses: camera_to_world [m] of each picture, shape (N, 4, 4), float64.
        camera: Intrinsics of all of them.
    """
    names = tuple(f"{number:06d}" for number in range(len(poses)))
    track = replace(
        scene.cameras[scene.products[0].camera],
        name="gallery",
        poses=poses,
        image_names=names,
        calibration=camera,
        gps=None,
        facts={},
    )
    product = replace(scene.products[0], name="gallery", camera=0, width=camera.width, height=camera.height)
    return replace(scene, cameras=(track,), products=(product,))
