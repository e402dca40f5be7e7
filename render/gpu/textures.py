"""Texture files as texture arrays: one array per side length, so that one draw call can reach every texture of a size.

Colors are kept as square roots of linear values: the shader squares the filtered values, which is nearly the sRGB
decoding at a fraction of its cost on a CPU.
"""

from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, replace
from pathlib import Path
from typing import Any, Literal

import cv2
import moderngl
import numpy as np
from numpy.typing import NDArray

from groundwork.canonical import file_digest
from groundwork.errors import InputError
from render.gpu.context import Gl
from render.images import image_files
from render.images.float_files import decode_float
from render.images.tga import decode_tga
from usd_schemas.texels import linear_to_srgb, one_channel, srgb_to_linear

U8 = NDArray[np.uint8]

_SMALLEST = 16
# A level is omitted if every pixel covers at least this many of its texels, as the root of the sum of squares over both
# directions: 1.4 texels of a square look-up. The next level then still has one texel per 1.4 pixels or better, which is
# finer than the lens resolves.
_UNSEEN = 2.0
_OPACITY = 3  # channel
_ONE, _NONE = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class TextureKey:
    """A texture file with its interpretation; the same file used as a color and as a number is two textures.

    Attributes:
        file: Path.
        srgb: Whether its values are sRGB-coded.
        kind: `color` is stored as the square root of its linear value, with its opacity; `vector` unchanged; of a
            `number`, one channel is stored.
        channel: Channel of a `number`: 0 red, 1 green, 2 blue, 3 alpha.
        gain: Multiplier of linear red, green, blue [1].
        bias: Added after `gain` [1].
        alpha: File whose channel is its opacity; empty for its own.
        alpha_channel: Channel of that file: 0 red, 1 green, 2 blue, 3 alpha.
        alpha_gain: Multiplier of that opacity [1].
        alpha_bias: Added after `alpha_gain` [1].
    """

    file: str
    srgb: bool
    kind: Literal["color", "vector", "number"] = "color"
    channel: int = 0
    gain: tuple[float, float, float] = _ONE
    bias: tuple[float, float, float] = _NONE
    alpha: str = ""
    alpha_channel: int = _OPACITY
    alpha_gain: float = 1.0
    alpha_bias: float = 0.0


ChannelPair = tuple[TextureKey | None, TextureKey | None]


@dataclass(frozen=True)
class TextureSlot:
    """Place of a loaded texture.

    Attributes:
        array: The texture array, shape (side, side, layers), uint8: RGBA, or one channel of numbers; None where only
            the mean was requested.
        side: Side of the array's layers [px].
        layer: Its layer.
        channel: Channel of the array that contains a number: 3 where it is stored in the unused opacity of a color.
        mean: Mean linear value of red, green, blue [1]; of a number, three times the same.
        cut_out: Whether any texel is transparent.
    """

    array: moderngl.TextureArray | None
    side: int
    layer: int
    mean: tuple[float, float, float]
    cut_out: bool
    channel: int = 0


def load_textures(
    gl: Gl,
    keys: list[TextureKey],
    averaged: list[TextureKey],
    largest: int,
    anisotropy: float,
    *,
    enough: Callable[[TextureKey, int], int] | None = None,
    packable: Sequence[ChannelPair] = (),
) -> tuple[dict[TextureKey, TextureSlot], list[str]]:
    """Read texture files into texture arrays with mipmaps, one layer in memory at a time, equal contents once.

    Args:
        gl: Open context.
        keys: What to load.
        averaged: Textures of which only the mean is needed.
        largest: Larger textures are reduced to this side [px].
        anisotropy: Anisotropic filtering [1]; 1 for none.
        enough: Returns the side [px] of the finest level that is used, for a texture of a given side.
        packable: Which numbers may be stored in the opacity of which colors: a color and a number that is looked up at
            the same coordinates; a color and None if its opacity is used; None and a number with its own coordinates.

    Returns:
        Slot of each texture that could be read, and one line for each that could not.
    """
    warnings: list[str] = []
    slots: dict[TextureKey, TextureSlot] = {}
    copies = _copies([*keys, *averaged])
    sides = _sides(sorted(set(copies.values()), key=astuple), largest, warnings)
    kept = _kept_sides([key for key in keys if copies[key] in sides], copies, sides, enough)
    within = _packed_numbers(packable, copies, kept)

    def load(key: TextureKey, array: moderngl.TextureArray | None, layer: int, channel: int = 0) -> U8 | None:
        try:
            image = _read(key, sides[key])
        except InputError as error:
            warnings.append(f"{error}; drawn without it")
            return None
        side = kept[key] if array is not None else sides[key]
        mean, cut_out = _mean(image, key.kind == "color"), image.shape[2] == 4 and bool(image[..., 3].min() < 255)
        slots[key] = TextureSlot(array, side, layer, mean, cut_out, channel)
        return _halved(image, side) if array is not None else None

    for key in [key for key in sides if key not in kept]:
        load(key, None, 0)
    for (side, channels), members in sorted(_groups(sides, kept, set(within.values())).items()):
        array = gl.context.texture_array((1, 1, 1), channels)
        gl.functions.make_array(array.glo, side, len(members), channels)
        for layer, key in enumerate(members):
            image = load(key, array, layer)
            number = load(within[key], None if image is None else array, layer, _OPACITY) if key in within else None
            if image is not None and number is not None:
                image[..., _OPACITY] = number[..., 0]
            if image is not None:
                array.write(image, viewport=(0, 0, layer, side, side, 1))
        array.build_mipmaps()
        array.filter = (moderngl.LINEAR_MIPMAP_NEAREST, moderngl.LINEAR)  # half the cost of blending two levels
        array.anisotropy = anisotropy
    return {key: slots[copy] for key, copy in copies.items() if copy in slots}, warnings


def sufficient_side(side: int, need: float) -> int:
    """Halve the side of a texture as long as the finest level is not needed [px].

    Args:
        side: Side of the file [px].
        need: Least width of a pixel in widths of the texture [1].
    """
    while side > 1 and side * need >= _UNSEEN:
        side //= 2
    return side


def _copies(keys: list[TextureKey]) -> dict[TextureKey, TextureKey]:
    """Map each texture to the first one with the same content and interpretation."""
    sizes: dict[int, list[str]] = {}
    for file in sorted({key.file for key in keys}):
        path = Path(file)
        sizes.setdefault(path.stat().st_size if path.is_file() else -1, []).append(file)
    content = {file: file for files in sizes.values() for file in files}
    for size, files in sizes.items():
        if size >= 0 and len(files) > 1:
            content |= {file: file_digest(Path(file)) for file in files}
    first: dict[TextureKey, TextureKey] = {}
    ordered = sorted(set(keys), key=astuple)
    return {key: first.setdefault(replace(key, file=content[key.file]), key) for key in ordered}


def _kept_sides(
    keys: list[TextureKey],
    copies: dict[TextureKey, TextureKey],
    sides: dict[TextureKey, int],
    enough: Callable[[TextureKey, int], int] | None,
) -> dict[TextureKey, int]:
    """Side of the finest level that any of the textures of one content needs [px]."""
    kept: dict[TextureKey, int] = {}
    for key in keys:
        copy = copies[key]
        side = sides[copy]
        need = max(enough(key, side), min(side, _SMALLEST)) if enough is not None else side
        kept[copy] = max(kept.get(copy, 0), need)
    return kept


def _sides(keys: list[TextureKey], largest: int, warnings: list[str]) -> dict[TextureKey, int]:
    """Find the side of each texture whose file states one [px]; a warning for each of the others."""
    sides: dict[TextureKey, int] = {}
    for key in keys:
        try:
            sides[key] = _side(key, largest)
        except InputError as error:
            warnings.append(f"{error}; drawn without it")
    return sides


def _groups(
    sides: dict[TextureKey, int], kept: dict[TextureKey, int], guests: set[TextureKey]
) -> dict[tuple[int, int], list[TextureKey]]:
    """Sort textures that are looked up, and need a layer of their own, by its side and channels."""
    groups: dict[tuple[int, int], list[TextureKey]] = {}
    for key in sides:
        if key in kept and key not in guests:
            groups.setdefault((kept[key], 1 if key.kind == "number" else 4), []).append(key)
    return groups


def _packed_numbers(
    packable: Sequence[ChannelPair], copies: dict[TextureKey, TextureKey], kept: dict[TextureKey, int]
) -> dict[TextureKey, TextureKey]:
    """Find for each color the number that its layer can hold: always looked up with it, and of the same size."""
    numbers: dict[TextureKey, set[TextureKey | None]] = {}
    colors: dict[TextureKey, set[TextureKey | None]] = {}
    for color, number in packable:
        color, number = copies[color] if color else None, copies[number] if number else None
        if color is not None:
            numbers.setdefault(color, set()).add(number)
        if number is not None:
            colors.setdefault(number, set()).add(color)
    sole = {color: number for color, found in numbers.items() for number in found if len(found) == 1}
    return {
        color: number
        for color, number in sole.items()
        if number is not None and colors[number] == {color} and 0 < kept.get(color, 0) == kept.get(number, 0)
    }


def _halved(image: U8, side: int) -> U8:
    """Average 2x2 texels until the side is right, as the driver does for the smaller levels."""
    while (half := len(image) // 2) >= side:
        smaller = cv2.resize(image, (half, half), interpolation=cv2.INTER_AREA)
        image = smaller.astype(np.uint8, copy=False).reshape(half, half, -1)
    return np.ascontiguousarray(image)


def _side(key: TextureKey, largest: int) -> int:
    """Choose the side of a texture: the power of two that is nearest to its longer one [px]."""
    size = image_files.size(Path(key.file)) or _decode(Path(key.file)).shape[:2]
    if not min(size):
        raise InputError("an image without pixels", where=key.file)
    side = max(_SMALLEST, 1 << round(np.log2(min(max(size), largest))))
    return side if side <= largest else side // 2


def _read(key: TextureKey, side: int) -> U8:
    """Return (side, side, 4) texels, or (side, side, 1) of a number, first row at the bottom."""
    pixels = _bytes(key.file, key.srgb)
    if key.kind == "number":
        texels = _channel(pixels, key.channel)
    else:
        pixels = cv2.cvtColor(pixels, cv2.COLOR_GRAY2RGB) if pixels.ndim == 2 else pixels
        texels = cv2.cvtColor(pixels, cv2.COLOR_RGB2RGBA) if pixels.shape[2] == 3 else pixels
        if key.alpha:
            opacity = _channel(_bytes(key.alpha, False), key.alpha_channel)
            rows, columns = texels.shape[:2]
            texels = np.dstack([texels[..., :3], cv2.resize(opacity, (columns, rows), interpolation=cv2.INTER_AREA)])
    if texels.shape[:2] != (side, side):
        shrink = max(texels.shape[:2]) > side
        texels = cv2.resize(texels, (side, side), interpolation=cv2.INTER_AREA if shrink else cv2.INTER_LINEAR)
    if key.srgb or key.kind == "color" or (key.gain, key.bias) != (_ONE, _NONE):
        texels = cv2.LUT(texels, _table(key, 1 if texels.ndim == 2 else 4))
    return np.ascontiguousarray(texels[::-1]).astype(np.uint8, copy=False).reshape(side, side, -1)


def _bytes(file: str, srgb: bool) -> U8:
    """Decode a file to 8 bits per channel; floating-point values above 1 are clipped."""
    pixels = _decode(Path(file))
    if pixels.dtype == np.uint16:
        return (pixels >> 8).astype(np.uint8)
    if pixels.dtype == np.float32:
        plain = np.clip(pixels, 0.0, 1.0)
        if srgb:  # decoded again by the table: 8 bits of linear values would show steps
            plain = linear_to_srgb(plain)
        return np.rint(255.0 * plain).astype(np.uint8)
    if pixels.dtype != np.uint8:
        raise InputError("not an 8- or 16-bit texture", where=file)
    return pixels


def _channel(pixels: U8, channel: int) -> U8:
    """Take one channel, shape (H, W)."""
    return np.ascontiguousarray(one_channel(pixels[..., None] if pixels.ndim == 2 else pixels, channel))


def _decode(path: Path) -> NDArray[Any]:
    if path.suffix.lower() in (".exr", ".hdr"):
        return decode_float(path)
    if path.suffix.lower() == ".tga":
        return decode_tga(path)
    return image_files.decode(path)


def _table(key: TextureKey, channels: int) -> U8:
    """Compute the new value for each of the 256 values of a file, shape (1, 256, channels); the last is opacity."""
    coded = np.arange(256)[None, :, None] / 255.0
    linear = srgb_to_linear(coded) if key.srgb else coded
    told = np.clip(linear * np.array(key.gain) + np.array(key.bias), 0.0, 1.0)
    table = np.empty((1, 256, 4), np.uint8)
    table[..., :3] = np.rint((np.sqrt(told) if key.kind == "color" else told) * 255)
    table[..., 3] = np.rint(np.clip(coded[..., 0] * key.alpha_gain + key.alpha_bias, 0.0, 1.0) * 255)
    return np.ascontiguousarray(table[..., :channels])


def _mean(texels: U8, rooted: bool) -> tuple[float, float, float]:
    coarse = cv2.resize(texels, (16, 16), interpolation=cv2.INTER_AREA).reshape(16, 16, -1)[..., :3] / 255.0
    red, *others = np.mean(coarse**2 if rooted else coarse, axis=(0, 1)).tolist()
    green, blue = others or (red, red)
    return float(red), float(green), float(blue)
