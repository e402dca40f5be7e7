"""A photographed sky: read, and separated into the sun and the rest."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from authoring.light.sky import sky_directions, solid_angles
from authoring.light.sun import LUMINANCE
from groundwork.errors import InputError, MissingError
from groundwork.foreign_file import read_regular

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

PANORAMAS = (".exr", ".hdr")
_MOST_ROWS = 4096
_BRIGHTEST = 6.0e4  # the largest float16 is 65,504
_DISC, _RING = 4.0, (5.0, 9.0)  # [deg] from the brightest texel: extent of the sun, and of the sky beside it
_OVER_THE_SKY = 4.0  # a texel this much brighter than the sky beside it is part of the sun
_LEAST_SUN = 0.05  # share of the light on level ground below which a sun is not made a separate light


@dataclass(frozen=True)
class SeparatedSky:
    """A panorama without its sun, and the sun.

    Attributes:
        sky: Linear radiance [1], shape (R, 2 R, 3), float64, oriented as `sky_directions`.
        direction: Unit vector towards the sun [1], shape (3,), float64; up if there is none.
        irradiance: Irradiance of the removed sun on a surface that faces it [1], shape (3,), float64; zeros if there is
            none.
    """

    sky: F64
    direction: F64
    irradiance: F64


def read_panorama(path: Path) -> F32:
    """Read a latitude-longitude picture of linear light.

    Args:
        path: OpenEXR or Radiance file, twice as wide as high, the zenith in its top row.

    Returns:
        Linear radiance [1], shape (R, 2 R, 3), float32; finite and not negative.

    Raises:
        InputError: Missing, unreadable, of another shape, too large, or without light.
    """
    if not path.is_file():
        raise MissingError("no such sky", field="light.sky", value=path.name)
    if path.suffix.lower() not in PANORAMAS:
        raise InputError("unknown format of a sky", field="light.sky", value=path.name, allowed=", ".join(PANORAMAS))
    pixels = _read_exr(path) if path.suffix.lower() == ".exr" else _read_radiance(path)
    if np.isnan(pixels).any():
        raise InputError("holds values that are not finite", field="light.sky", value=path.name)
    pixels = np.clip(pixels, 0.0, _BRIGHTEST)
    if not pixels.any():
        raise InputError("is black", field="light.sky", value=path.name)
    return np.ascontiguousarray(pixels, np.float32)


def reduce_panorama(panorama: F32, rows: int) -> F32:
    """Average a panorama down to a number of rows; a smaller one is unchanged.

    Args:
        panorama: Linear radiance [1], shape (R, 2 R, 3), float32.
        rows: Rows wanted.

    Returns:
        Linear radiance [1], shape (rows, 2 * rows, 3), float32.
    """
    import cv2

    if len(panorama) <= rows:
        return panorama
    return cv2.resize(panorama, (2 * rows, rows), interpolation=cv2.INTER_AREA).astype(np.float32)


def turned(panorama: F32, turn: float) -> F32:
    """Rotate a panorama about the vertical, counter-clockwise seen from above, by whole texels.

    Args:
        panorama: Linear radiance [1], shape (R, 2 R, 3), float32.
        turn: Angle [deg].

    Returns:
        The same texels [1], shape (R, 2 R, 3), float32.
    """
    return np.roll(panorama, -round(turn / 360.0 * panorama.shape[1]), axis=1)


def separate_sun(panorama: F64) -> SeparatedSky:
    """Remove the sun from a sky, if there is one, and replace it by the sky beside it.

    The sun is the texels within 4 degrees of the brightest one that are four times as bright as the sky beside it. The
    removed irradiance becomes a distant light: a surface that faces the sun receives as much as before. A sun that
    gives less than 5 % of the light on level ground casts no visible shadow: it is not removed.

    Args:
        panorama: Linear radiance [1], shape (R, 2 R, 3), float64.
    """
    rows = len(panorama)
    directions, solid = sky_directions(rows), solid_angles(rows)
    luminance = panorama @ LUMINANCE
    peak = directions[np.unravel_index(int(luminance.argmax()), luminance.shape)]
    angle = np.degrees(np.arccos(np.clip(directions @ peak, -1, 1)))
    ring = (angle > _RING[0]) & (angle < _RING[1]) & (directions[..., 2] > 0)
    beside = np.median(panorama[ring], axis=0) if ring.any() else np.zeros(3)
    disc = (angle <= _DISC) & (luminance > _OVER_THE_SKY * max(float(beside @ LUMINANCE), 1e-6))
    excess = np.where(disc[..., None], np.maximum(panorama - beside, 0.0), 0.0) * solid[..., None]
    pull = np.einsum("rc,rcd->d", excess @ LUMINANCE, directions)
    strength = float(np.linalg.norm(pull))
    level = float((luminance * np.maximum(directions[..., 2], 0) * solid).sum())
    if pull[2] < _LEAST_SUN * level:
        return SeparatedSky(panorama, np.array([0.0, 0.0, 1.0]), np.zeros(3))
    sun = pull / strength
    irradiance = np.einsum("rc,rck->k", directions @ sun, excess)
    return SeparatedSky(np.where(disc[..., None], np.minimum(panorama, beside), panorama), sun, irradiance)


def _read_exr(path: Path) -> F32:
    import OpenEXR

    try:
        with OpenEXR.File(str(path), header_only=True) as file:
            low, high = file.header()["dataWindow"]
        _check_shape(path, int(high[0] - low[0] + 1), int(high[1] - low[1] + 1))
        with OpenEXR.File(str(path)) as file:
            channels = file.channels()
            name = next(name for name in ("RGB", "RGBA") if name in channels)
            return np.array(channels[name].pixels[..., :3], np.float32)
    except (RuntimeError, OSError, StopIteration, ValueError, KeyError, TypeError) as error:
        what = "has no channels R, G, B" if isinstance(error, StopIteration) else "not readable as OpenEXR"
        raise InputError(what, field="light.sky", value=path.name) from None


def _read_radiance(path: Path) -> F32:
    import cv2

    data = read_regular(path)
    head = data[:4096]
    size = re.search(rb"\n-Y (\d{1,6}) \+X (\d{1,6})\n", head)
    if not head.startswith((b"#?RADIANCE", b"#?RGBE")) or size is None:
        raise InputError("not readable as a Radiance picture", field="light.sky", value=path.name)
    _check_shape(path, int(size[2]), int(size[1]))
    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        pixels = None
    if pixels is None or pixels.ndim != 3:
        raise InputError("not readable as a Radiance picture", field="light.sky", value=path.name)
    return pixels[..., 2::-1].astype(np.float32)


def _check_shape(path: Path, width: int, height: int) -> None:
    if width != 2 * height or height < 16:
        raise InputError(
            "not an equirectangular (latitude-longitude) picture",
            field="light.sky",
            value=f"{path.name}: {width} x {height}",
            allowed="a width of twice the height, and at least 16 rows",
        )
    if height > _MOST_ROWS:
        raise InputError(
            "too large",
            field="light.sky",
            value=f"{path.name}: {width} x {height}",
            allowed=f"up to {2 * _MOST_ROWS} x {_MOST_ROWS}",
            hint="Reduce it; a scene keeps at most 2048 rows",
        )
