"""Looking textures up while others are baked from them: tiled, in linear values, averaged over a texel."""

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError

F32 = NDArray[np.float32]


def sample(file: str, uv: F32, footprint: float, srgb: bool) -> F32:
    """Look a tiled texture up, averaged over what one texel of the atlas shows.

    Args:
        file: Texture.
        uv: Where [tiles], shape (N, 2), float32, v upwards.
        footprint: Size of an atlas texel [tiles].
        srgb: The texture holds coded colours.

    Returns:
        Linear values [1], shape (N, 3), float32.
    """
    import cv2

    found = cv2.imread(file, cv2.IMREAD_COLOR)
    if found is None:
        raise InputError("not readable as an image", where=file)
    picture = found.astype(np.float32) / np.float32(255)
    picture = _linear(picture) if srgb else picture
    size = [max(round(side / max(footprint * side, 1.0)), 1) for side in picture.shape[:2]]
    if size != list(picture.shape[:2]):
        picture = cv2.resize(picture, (size[1], size[0]), interpolation=cv2.INTER_AREA).reshape(*size, 3)
    x = uv[:, 0] % 1 * size[1] - np.float32(0.5)
    y = (1 - uv[:, 1] % 1) * size[0] - np.float32(0.5)
    values = np.zeros((len(uv), 3), np.float32)
    for start in range(0, len(uv), 32_000):  # the library's images have at most 32,767 rows
        part = slice(start, start + 32_000)
        sampled = cv2.remap(picture, x[part], y[part], cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
        values[part] = sampled.reshape(-1, 3)[:, ::-1]
    return values


def _linear(values: F32) -> F32:
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4).astype(np.float32)
