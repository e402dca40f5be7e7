"""Numbers as the bytes of texture files."""

import numpy as np
from numpy.typing import NDArray

from authoring.looks.noise import Floats, snap

U8 = NDArray[np.uint8]

_CODES = 1 << 14  # steps of linear light in the table that codes sRGB
_JPEG_QUALITY = 90  # of sheets: 1 to 1.5 MB at 2048 texels, a fifth of a PNG, and no difference that the eye finds


def encode_srgb(albedo: Floats) -> U8:
    """Code linear colors as sRGB.

    Args:
        albedo: Linear values [1], shape (...), float32.

    Returns:
        Codes, the same shape (...), uint8.
    """
    light = np.arange(_CODES, dtype=np.float64) / (_CODES - 1)
    curve = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    table = np.round(snap(curve) * np.float32(255)).astype(np.uint8)
    return table[np.clip(albedo * np.float32(_CODES - 1) + np.float32(0.5), 0, _CODES - 1).astype(np.int32)]


def encode_raw(values: Floats) -> U8:
    """Code numbers from 0 to 1 in 8 bits.

    Args:
        values: Numbers [1], shape (...), float32.

    Returns:
        Codes, the same shape (...), uint8.
    """
    return np.clip(values * np.float32(255) + np.float32(0.5), 0, 255).astype(np.uint8)


def encode_normals(height: Floats, meters: float) -> U8:
    """Turn relief into tangent-space normals at half the resolution: red along u, green along v (up the image).

    Args:
        height: Relief [m], shape (H, W), float32.
        meters: Length of the sheet's sides [m].

    Returns:
        (n + 1) / 2, shape (H / 2, W / 2, 3), uint8.
    """
    half = halved(height)
    run = np.float32(2 * meters / len(half))
    along = (np.roll(half, 1, 1) - np.roll(half, -1, 1)) / run
    up = (np.roll(half, -1, 0) - np.roll(half, 1, 0)) / run
    length = np.sqrt(along * along + up * up + 1)
    return encode_raw(np.stack([along / length, up / length, 1 / length], axis=-1) * np.float32(0.5) + np.float32(0.5))


def halved(field: Floats) -> Floats:
    """Average squares of 2 x 2 texels.

    Args:
        field: Values [any unit], shape (H, W), float32.

    Returns:
        Means [any unit], shape (H / 2, W / 2), float32.
    """
    return (field[::2, ::2] + field[1::2, ::2] + field[::2, 1::2] + field[1::2, 1::2]) * np.float32(0.25)


def png(image: U8) -> bytes:
    """Compress an image as PNG with fixed parameters.

    Args:
        image: Gray, RGB or RGBA values, shape (H, W), (H, W, 3) or (H, W, 4), uint8.
    """
    import cv2

    options = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE]
    _, data = cv2.imencode(".png", _ordered(image), options)
    return data.tobytes()


def jpeg(image: U8) -> bytes:
    """Compress an image as JPEG with fixed parameters, colors at full resolution.

    Args:
        image: Gray or RGB values, shape (H, W) or (H, W, 3), uint8.
    """
    import cv2

    options = [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, 0x111111]
    _, data = cv2.imencode(".jpg", _ordered(image), options)
    return data.tobytes()


def _ordered(image: U8) -> U8:
    return image if image.ndim == 2 else np.ascontiguousarray(image[..., [2, 1, 0, 3][: image.shape[2]]])
