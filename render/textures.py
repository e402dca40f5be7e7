"""Texture files as texture arrays: one array per side length, so that one draw call can reach every texture of a size.

Colours are kept as square roots of linear values: the shader squares what it has filtered, which is nearly the sRGB
decoding at a fraction of its cost on a CPU.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import moderngl
import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from render import image_files

U8 = NDArray[np.uint8]

_SMALLEST = 16


@dataclass(frozen=True)
class TextureKey:
    """One file read in one way; the same file as a colour and as raw numbers is two textures.

    Attributes:
        file: Path.
        srgb: Whether its values are sRGB-coded colours.
    """

    file: str
    srgb: bool


@dataclass(frozen=True)
class TextureSlot:
    """Where a texture went.

    Attributes:
        array: The texture array, shape (side, side, layers), RGBA uint8.
        side: Side of the array's layers [px].
        layer: Its layer.
        mean: Mean linear value of red, green, blue [1].
        cut_out: Whether any texel is transparent.
    """

    array: moderngl.TextureArray
    side: int
    layer: int
    mean: tuple[float, float, float]
    cut_out: bool


def load_textures(
    context: moderngl.Context, keys: list[TextureKey], largest: int, anisotropy: float
) -> tuple[dict[TextureKey, TextureSlot], list[str]]:
    """Read texture files into texture arrays with mipmaps.

    Args:
        context: Open context.
        keys: What to load.
        largest: Larger textures are reduced to this side [px].
        anisotropy: Anisotropic filtering [1]; 1 for none.

    Returns:
        Slot of each texture that could be read, and one line for each that could not.
    """
    images: dict[int, list[tuple[TextureKey, U8]]] = {}
    warnings: list[str] = []
    for key in sorted(set(keys), key=lambda key: (key.file, key.srgb)):
        try:
            image = _read(key, largest)
        except InputError as error:
            warnings.append(f"{error}; drawn without it")
            continue
        images.setdefault(image.shape[0], []).append((key, image))
    slots: dict[TextureKey, TextureSlot] = {}
    for side, members in sorted(images.items()):
        array = context.texture_array((side, side, len(members)), 4)
        for layer, (key, image) in enumerate(members):
            array.write(image.tobytes(), viewport=(0, 0, layer, side, side, 1))
            slots[key] = TextureSlot(array, side, layer, _mean(image, key.srgb), bool(image[..., 3].min() < 255))
        array.build_mipmaps()
        array.filter = (moderngl.LINEAR_MIPMAP_NEAREST, moderngl.LINEAR)  # half the cost of blending two levels
        array.anisotropy = anisotropy
        members.clear()
    return slots, warnings


def _read(key: TextureKey, largest: int) -> U8:
    """Return (side, side, 4) texels, first row at the bottom, colours as square roots of linear values."""
    pixels = _decode(Path(key.file))
    if pixels.dtype == np.uint16:
        pixels = (pixels >> 8).astype(np.uint8)
    if pixels.dtype != np.uint8:
        raise InputError("not an 8- or 16-bit texture", where=key.file)
    if pixels.ndim == 2:
        pixels = cv2.cvtColor(pixels, cv2.COLOR_GRAY2RGB)
    alpha = pixels[..., 3] if pixels.shape[2] == 4 else np.full(pixels.shape[:2], 255, np.uint8)
    texels = np.dstack([pixels[..., :3], alpha])
    longest = min(max(texels.shape[:2]), largest)
    side = max(_SMALLEST, 1 << round(np.log2(longest)))
    side = side if side <= largest else side // 2
    if texels.shape[:2] != (side, side):
        shrink = max(texels.shape[:2]) > side
        texels = cv2.resize(texels, (side, side), interpolation=cv2.INTER_AREA if shrink else cv2.INTER_LINEAR)
    if key.srgb:
        texels[..., :3] = cv2.LUT(texels[..., :3], _root_table())
    return np.ascontiguousarray(texels[::-1]).astype(np.uint8, copy=False)


def _decode(path: Path) -> NDArray[Any]:
    if path.suffix.lower() in (".exr", ".hdr"):
        raise InputError("a floating-point texture is not read for surfaces", where=path)
    return image_files.decode(path)


def _root_table() -> U8:
    coded = np.arange(256) / 255.0
    linear = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    return np.rint(np.sqrt(linear) * 255).astype(np.uint8)


def _mean(texels: U8, rooted: bool) -> tuple[float, float, float]:
    coarse = cv2.resize(texels[..., :3], (16, 16), interpolation=cv2.INTER_AREA).astype(np.float64) / 255
    red, green, blue = np.mean(coarse**2 if rooted else coarse, axis=(0, 1))
    return float(red), float(green), float(blue)
