"""Result of a survey: cameras in order, and the positions that the drone's receiver recorded."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usd_schemas.distortion import NO_DISTORTION, Distortion
from usd_schemas.pinhole import Pinhole

F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Flown:
    """The poses and the model of a camera.

    Attributes:
        poses: camera_to_world in the order of flight [m], shape (N, 4, 4), float64.
        calibration: Exact intrinsics.
        sensor_width: Width of the sensor [m].
        distortion: Distortion of the lens.
        readout_time: Time from the first row of an image to its last [s].
        make: Maker of the camera, or empty.
        model: Name of the camera, or empty.
    """

    poses: F64
    calibration: Pinhole
    sensor_width: float
    distortion: Distortion = NO_DISTORTION
    readout_time: float = 0.0
    make: str = ""
    model: str = ""


@dataclass(frozen=True)
class CameraPath:
    """One survey, ready to be authored.

    Attributes:
        id: Survey id: a prim name, unique in the scene.
        kind: Kind of survey, a key of the registry.
        seed: Seed of the scene that it was drawn from.
        calibration: Exact intrinsics.
        sensor_width: Width of the sensor [m].
        spacing: Mean distance between neighboring images [m].
        poses: camera_to_world, camera axes right-down-forward [m], shape (N, 4, 4), float64.
        times: Seconds since the first image [s], shape (N,), float64.
        gps: Measured positions [m], shape (N, 3), float64.
        gps_sigma: Standard deviation of `gps` along x, y, z [m].
        attitude: Measured yaw, pitch and roll [deg], shape (N, 3), float64.
        attitude_sigma: Standard deviation of `attitude` [deg].
        distortion: Distortion of the lens.
        readout_time: Time from the first row of an image to its last [s].
        make: Maker of the camera, or empty.
        model: Name of the camera, or empty.
    """

    id: str
    kind: str
    seed: int
    calibration: Pinhole
    sensor_width: float
    spacing: float
    poses: F64
    times: F64
    gps: F64
    gps_sigma: tuple[float, float, float]
    attitude: F64
    attitude_sigma: tuple[float, float, float]
    distortion: Distortion = NO_DISTORTION
    readout_time: float = 0.0
    make: str = ""
    model: str = ""
