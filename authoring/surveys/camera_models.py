"""Cameras by name: what a pilot would choose from, as data."""

from dataclasses import dataclass

from usd_schemas.pinhole import Pinhole


@dataclass(frozen=True)
class CameraModel:
    """A camera without distortion.

    Attributes:
        focal_length: Focal length [m].
        sensor_width: Width of the sensor [m].
    """

    focal_length: float
    sensor_width: float


CAMERA_MODELS = {
    # The drone camera of the paper's renders: 24 mm on a full-frame sensor.
    "default_24mm": CameraModel(0.024, 0.036),
}


def calibration(model: CameraModel, width: int, height: int) -> Pinhole:
    """Find the intrinsics of a camera at an image size: square pixels, centred principal point.

    Args:
        model: Camera.
        width: Image width [px].
        height: Image height [px].
    """
    focal = model.focal_length / model.sensor_width * width
    return Pinhole(width, height, focal, focal, width / 2, height / 2)
