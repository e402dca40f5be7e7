"""What the numbers of a texture mean: linear colors from sRGB, the place of a texel, one channel, and opacity."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from usd_schemas.flat_scene import Texture

F64 = NDArray[np.float64]
Floats = NDArray[np.floating[Any]]
Pixels = NDArray[Any]


def srgb_to_linear(coded: Floats) -> Floats:
    """Decode sRGB.

    Args:
        coded: Coded values from 0 to 1 [1], shape (...), float32 or float64.

    Returns:
        Linear values [1], shape (...), same dtype.

    Source: IEC 61966-2-1.
    """
    return np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)


def linear_to_srgb(linear: Floats) -> Floats:
    """Code linear values as sRGB.

    Args:
        linear: Linear values [1], shape (...), float32 or float64.

    Returns:
        Coded values [1], shape (...), same dtype.

    Source: IEC 61966-2-1.
    """
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)


def rotation(texture: Texture) -> F64:
    """Return the rotation of a texture's coordinates (s, t), for column vectors [1], shape (2, 2), float64.

    Args:
        texture: A texture.
    """
    angle = np.radians(texture.rotation)
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def placed(texture: Texture, st: Floats) -> F64:
    """Scale, then rotate, then translate texture coordinates, as UsdTransform2d does.

    Args:
        texture: A texture.
        st: Coordinates of the mesh, of the texture's own set [m or 1], shape (N, 2), float32 or float64.

    Returns:
        Where to look them up [1], shape (N, 2), float64.
    """
    return (st * np.array(texture.scale)) @ rotation(texture).T + np.array(texture.translation)


def one_channel(pixels: Pixels, channel: int) -> Pixels:
    """Take one channel of a picture: a gray one has the same value for all colors, and without opacity it is opaque.

    Args:
        pixels: Gray, or red, green, blue, perhaps opacity: shape (..., 1), (..., 3) or (..., 4).
        channel: 0 red, 1 green, 2 blue, 3 opacity.

    Returns:
        Its values, shape (...), same dtype.
    """
    count = pixels.shape[-1]
    if channel == 3 and count < 4:
        return np.full(pixels.shape[:-1], _whole(pixels), pixels.dtype)
    return pixels[..., channel if count > 1 else 0]


def opacity(texture: Texture, pixels: Pixels) -> NDArray[np.float32]:
    """Compute the opacity of a texture from the pixels of the file that states it.

    Args:
        texture: A texture.
        pixels: Gray, or red, green, blue, perhaps opacity: shape (..., 1), (..., 3) or (..., 4).

    Returns:
        Opacity, with scale and bias, not limited to 0 to 1 [1], shape (...), float32.
    """
    told = one_channel(pixels, texture.alpha_channel).astype(np.float32) / np.float32(_whole(pixels))
    return told * np.float32(texture.alpha_gain) + np.float32(texture.alpha_bias)


def _whole(pixels: Pixels) -> float:
    """Return the number that stands for 1."""
    return float(np.iinfo(pixels.dtype).max) if np.issubdtype(pixels.dtype, np.integer) else 1.0
