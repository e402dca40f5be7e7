"""Cameras by name: the table `cameras.toml`."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from types import MappingProxyType
from typing import Any

from usd_schemas.distortion import NO_DISTORTION, Distortion
from usd_schemas.pinhole import Pinhole

DEFAULT = "default_24mm"
_DISTORTION = ("k1", "k2", "p1", "p2")


@dataclass(frozen=True)
class CameraModel:
    """A real camera.

    Attributes:
        make: Maker, as written in photographs.
        model: Name, as written in photographs.
        focal_length: Focal length [m].
        sensor_width: Width of the sensor [m].
        width: Width of a photograph [px].
        height: Height of a photograph [px].
        distortion: Distortion of the lens.
        readout_time: Time from the first row to the last [s]; 0 for a global shutter.
    """

    make: str
    model: str
    focal_length: float
    sensor_width: float
    width: int
    height: int
    distortion: Distortion = NO_DISTORTION
    readout_time: float = 0.0


@cache
def camera_models() -> Mapping[str, CameraModel]:
    """Read the table: name to camera, in its order."""
    rows = tomllib.loads(files("authoring.surveys").joinpath("cameras.toml").read_text(encoding="utf-8"))
    return MappingProxyType({name: _camera(row) for name, row in rows.items()})


def _camera(row: dict[str, Any]) -> CameraModel:
    plain = {key: value for key, value in row.items() if key not in _DISTORTION}
    return CameraModel(**plain, distortion=Distortion(*(float(row.get(key, 0.0)) for key in _DISTORTION)))


def calibration(model: CameraModel, width: int | None = None, height: int | None = None) -> Pinhole:
    """Find the intrinsics of a camera at an image size: square pixels, centered principal point.

    Args:
        model: Camera.
        width: Image width [px]; the camera's own when None, or that which corresponds to `height`.
        height: Image height [px]; from the camera's aspect when None.
    """
    if width is None:
        width = model.width if height is None else round(height * model.width / model.height)
    if height is None:
        height = round(width * model.height / model.width)
    focal = model.focal_length / model.sensor_width * width
    return Pinhole(width, height, focal, focal, width / 2, height / 2)
