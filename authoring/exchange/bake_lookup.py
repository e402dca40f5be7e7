"""Texture lookup for baking: tiled, in linear values, averaged over a texel."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from authoring.exchange.texture_files import read_color
from usd_schemas.texels import srgb_to_linear

F32 = NDArray[np.float32]

_READ = 8  # images cached unchanged, up to 50 MB each
_REDUCED = 4  # images cached in linear values, up to 200 MB each
_ROWS = 32_000  # the library's images have at most 32,767 rows


class TextureLookup:
    """Textures of one scene: materials share files, and each is read and reduced as rarely as memory allows."""

    def __init__(self) -> None:
        """Start with an empty cache."""
        self._read = lru_cache(_READ)(read_color)
        self._reduced = lru_cache(_REDUCED)(self._reduce)

    def colors(self, file: str, uv: F32, footprint: float, srgb: bool) -> F32:
        """Sample a tiled texture, averaged over one texel of the atlas.

        Args:
            file: Texture.
            uv: Positions [tiles], shape (N, 2), float32, v upwards.
            footprint: Size of an atlas texel [tiles].
            srgb: The texture holds coded colors.

        Returns:
            Linear values [1], shape (N, 3), float32.
        """
        return _remap(self._reduced(file, self._size(file, footprint), srgb, False), uv)[:, ::-1]

    def levels(self, file: str, uv: F32, footprint: float) -> F32:
        """Sample the first channel of a tiled texture, averaged over one texel of the atlas.

        Args:
            file: Texture, whose values are linear.
            uv: Positions [tiles], shape (N, 2), float32, v upwards.
            footprint: Size of an atlas texel [tiles].

        Returns:
            Values [1], shape (N, 1), float32.
        """
        return _remap(self._reduced(file, self._size(file, footprint), False, True), uv)

    def _size(self, file: str, footprint: float) -> tuple[int, int]:
        height, width = self._read(file).shape[:2]
        return (_reduced_side(height, footprint), _reduced_side(width, footprint))

    def _reduce(self, file: str, size: tuple[int, int], srgb: bool, first: bool) -> F32:
        import cv2

        found = self._read(file)
        picture = (found[..., 2:] if first else found).astype(np.float32) / np.float32(255)
        picture = srgb_to_linear(picture) if srgb else picture
        if size != picture.shape[:2]:
            reduced = cv2.resize(picture, size[::-1], interpolation=cv2.INTER_AREA).reshape(*size, -1)
            picture = reduced.astype(np.float32, copy=False)
        return picture


def _reduced_side(side: int, footprint: float) -> int:
    return max(round(side / max(footprint * side, 1.0)), 1)


def _remap(picture: F32, uv: F32) -> F32:
    import cv2

    height, width, channels = picture.shape
    x = uv[:, 0] % 1 * width - np.float32(0.5)
    y = (1 - uv[:, 1] % 1) * height - np.float32(0.5)
    values = np.zeros((len(uv), channels), np.float32)
    for start in range(0, len(uv), _ROWS):
        part = slice(start, start + _ROWS)
        sampled = cv2.remap(picture, x[part], y[part], cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
        values[part] = sampled.reshape(-1, channels)
    return values
