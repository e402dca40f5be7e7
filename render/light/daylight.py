"""Sun, sky panorama and sky irradiance of a scene.

Radiance out of a Lambert surface is albedo * (E_sun * cos / pi * visibility + E_sky / pi). A DistantLight's color
times intensity is E_sun; a DomeLight's texel times intensity is the radiance of that direction.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from render.images import image_files
from render.images.float_files import decode_exr
from usd_schemas.flat_scene import Dome, FlatScene, Sun
from usd_schemas.texels import srgb_to_linear

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_DEFAULT_SUN = Sun((0.45, -0.62, 0.64), (3.9, 3.7, 3.35))
_ZENITH, _HORIZON, _GROUND = (0.16, 0.28, 0.55), (0.55, 0.66, 0.80), (0.13, 0.13, 0.11)
_POLE_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # a dome's +y to the world's +z
_ROWS = 512  # [px] a larger panorama makes no visible difference in a photograph
_HORIZON_RING = (0.0, 0.10)  # sines of the elevations from which the color of distant haze is taken
_GLOW = 0.08  # angular extent of the brighter haze near the sun: see `glow` [1]


@dataclass(frozen=True)
class Daylight:
    """Sun and sky.

    Attributes:
        sun_direction: Unit vector towards the sun [1], world axes, shape (3,), float64.
        sun_irradiance: Linear irradiance on a facing surface [1], shape (3,), float64; zeros without a sun.
        panorama: Linear radiance by direction [1], first row at the dome's pole, shape (R, 2 R, 3), float32.
        dome_from_world: Rotation from world axes to the dome's [1], shape (3, 3), float64.
        open_sky: Irradiance coefficients of the unobstructed dome [1], shape (4, 3), float64: E(n) = c0 + c1..3 . n.
        haze: Radiance of distant haze, as a function of the cosine c of the angle to the sun [1]: haze[0] + haze[1] c +
            haze[2] g(c), where g is `glow`, shape (3, 3), float64.
        sun_angle: Angular diameter of the sun [rad].
    """

    sun_direction: F64
    sun_irradiance: F64
    panorama: F32
    dome_from_world: F64
    open_sky: F64
    haze: F64
    sun_angle: float

    def radiance(self, directions: F64) -> F64:
        """Look up the radiance of the sky.

        Args:
            directions: Unit vectors, world axes [1], shape (N, 3), float64.

        Returns:
            Linear radiance [1], shape (N, 3), float64.
        """
        x, y, z = self.dome_from_world @ directions.T
        rows, columns = self.panorama.shape[:2]
        row = np.clip(np.arccos(np.clip(y, -1, 1)) / np.pi * rows, 0, rows - 1).astype(np.int64)
        column = np.floor((0.5 - np.arctan2(x, z) / (2 * np.pi)) * columns).astype(np.int64) % columns
        return self.panorama[row, column].astype(np.float64)

    def on_level_ground(self) -> F64:
        """Return the irradiance of level open ground [1], shape (3,), float64."""
        up = np.array([1.0, 0.0, 0.0, 1.0])
        return np.maximum(up @ self.open_sky, 0.0) + self.sun_irradiance * max(float(self.sun_direction[2]), 0.0)


def read_daylight(scene: FlatScene) -> tuple[Daylight, list[str]]:
    """Read the lights of a scene; without any, a clear afternoon.

    Args:
        scene: A scene.

    Returns:
        Its light, and one line for each thing that could not be read.
    """
    warnings: list[str] = []
    sun, dome = scene.sun, scene.dome
    if sun is None and dome is None and not scene.sphere_lights:
        warnings.append("the stage has no light: drawn under a default sun and sky")
        sun = _DEFAULT_SUN
        panorama, rotation = _default_sky(), _POLE_UP
    elif dome is None:
        panorama, rotation = np.zeros((2, 4, 3), np.float32), _POLE_UP
    else:
        panorama, rotation = _read_dome(dome, warnings), np.array(dome.rotation)
    direction = np.array(sun.direction if sun else (0.0, 0.0, 1.0))
    irradiance = np.array(sun.radiance if sun else (0.0, 0.0, 0.0))
    directions = sphere(4096)
    angle = float(np.radians(sun.angle)) if sun else 0.0
    bare = Daylight(
        direction / np.linalg.norm(direction),
        irradiance,
        panorama,
        rotation.T,
        np.zeros((4, 3)),
        np.zeros((3, 3)),
        angle,
    )
    radiance = bare.radiance(directions)
    ring = (directions[:, 2] > _HORIZON_RING[0]) & (directions[:, 2] < _HORIZON_RING[1])
    coefficients = irradiance_coefficients(directions, radiance[None])[0]
    haze = _fit_haze(directions[ring], radiance[ring], bare.sun_direction)
    return replace(bare, open_sky=coefficients, haze=haze), warnings


def glow(cosine: F64) -> F64:
    """Compute the brightening of haze near the sun from the cosine of the angle to it: 1 at the sun, little elsewhere.

    Args:
        cosine: Cosines [1], shape (...), float64.

    Returns:
        Shares [1], shape (...), float64.
    """
    return _GLOW / (1.0 + _GLOW - cosine)


def _fit_haze(directions: F64, radiance: F64, sun: F64) -> F64:
    """Fit the color of distant haze to the sky above the horizon, including clouds; shape (3, 3)."""
    cosine = directions @ sun
    basis = np.column_stack([np.ones(len(cosine)), cosine, glow(cosine)])
    mean = np.vstack([radiance.mean(axis=0), np.zeros((2, 3))])
    if np.ptp(cosine) < 0.3:  # the sun is overhead: all azimuths are alike
        return mean
    found = np.linalg.lstsq(basis, radiance, rcond=None)[0].astype(np.float64)
    ends = np.linspace(-1, 1, 41)
    lowest = (np.column_stack([np.ones(41), ends, glow(ends)]) @ found).min(axis=0)
    share = np.clip(0.8 * mean[0] / np.maximum(mean[0] - lowest, 1e-9), 0, 1)  # no direction becomes nearly black
    return mean + share * (found - mean)


def sphere(count: int) -> F64:
    """Distribute directions evenly over the sphere on a Fibonacci spiral.

    Args:
        count: Number of directions.

    Returns:
        Unit vectors [1], shape (count, 3), float64.
    """
    number = np.arange(count) + 0.5
    z = 1 - 2 * number / count
    angle = number * np.pi * (3 - np.sqrt(5))
    level = np.sqrt(1 - z * z)
    return np.column_stack([level * np.cos(angle), level * np.sin(angle), z])


def irradiance_coefficients(directions: F64, radiance: F64 | F32) -> F64:
    """Project radiance on the first two bands of spherical harmonics, convolved with the cosine.

    Irradiance of a surface with normal n is E(n) = c0 + c1 nx + c2 ny + c3 nz; exact for a uniform half sphere.

    Source: Ramamoorthi and Hanrahan, An efficient representation for irradiance environment maps, SIGGRAPH 2001.

    Args:
        directions: Evenly distributed directions [1], shape (N, 3), float64.
        radiance: Radiance from each of them [1], shape (P, N, 3), float64.

    Returns:
        Coefficients [1], shape (P, 4, 3), float64.
    """
    count = len(directions)
    basis = np.column_stack([np.full(count, np.pi / count), 2 * np.pi / count * directions])
    return np.einsum("nk,pnc->pkc", basis, radiance)


def _read_dome(dome: Dome, warnings: list[str]) -> F32:
    tint = np.array(dome.radiance, np.float32)
    if dome.file:
        try:
            return _reduced(_decode_panorama(Path(dome.file))) * tint
        except InputError as error:
            warnings.append(f"{error}; the dome is drawn in one color")
    return np.broadcast_to(tint, (2, 4, 3)).copy()


def _decode_panorama(path: Path) -> F32:
    if not path.is_file():
        raise InputError("no such texture", where=path)
    if path.suffix.lower() == ".exr":
        return decode_exr(path)
    pixels = image_files.decode(path)
    pixels = np.repeat(pixels[..., None], 3, axis=2) if pixels.ndim == 2 else pixels[..., :3]
    if pixels.dtype in (np.uint8, np.uint16):
        coded = pixels.astype(np.float32) / np.iinfo(pixels.dtype).max
        return srgb_to_linear(coded).astype(np.float32)
    return pixels.astype(np.float32)


def _reduced(panorama: F32) -> F32:
    import cv2

    finite = np.nan_to_num(np.clip(panorama, 0.0, 6.0e4), nan=0.0)
    if finite.shape[0] <= _ROWS:
        return np.ascontiguousarray(finite, np.float32)
    return cv2.resize(finite, (2 * _ROWS, _ROWS), interpolation=cv2.INTER_AREA).astype(np.float32)


def _default_sky() -> F32:
    height = np.sin(np.pi / 2 - (np.arange(64) + 0.5) / 64 * np.pi)[:, None]
    mix = np.exp(-4.0 * np.abs(height))
    sky = np.array(_ZENITH) * (1 - mix) + np.array(_HORIZON) * mix
    column = np.where(height > 0.0, sky, np.array(_GROUND))
    return np.repeat(column[:, None], 128, axis=1).astype(np.float32)
