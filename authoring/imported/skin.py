"""Colors of an imported world: images, and palettes for colors of vertices or faces."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from authoring.looks.encode import png
from authoring.looks.material import MaterialRecipe
from groundwork.errors import InputError
from groundwork.files import write_bytes
from groundwork.png_chunks import SIGNATURE, is_whole_png
from usd_schemas.texels import srgb_to_linear

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]

LARGEST = 4096  # [px]: larger textures are reduced to this
MOST_PIXELS = 300_000_000  # of one texture
_ROUGHNESS = 0.85  # of surfaces with only a photograph [1]
_QUALITY = 92  # of a texture that had to be reduced


@dataclass(frozen=True, eq=False)
class Skin:
    """One image on pieces of a world, looked up at `st` from 0 to 1.

    Attributes:
        role: Name of its material, from its content.
        image: The file's bytes.
        suffix: `.png` or `.jpg`.
        color: Its mean, linear [1].
    """

    role: str
    image: bytes
    suffix: str
    color: tuple[float, float, float]

    @property
    def file_name(self) -> str:
        """Name of its file, unique by content."""
        return f"{self.role}{self.suffix}"


def image_skin(data: bytes, where: str) -> Skin:
    """Copy an image file unchanged; one that is too large is reduced.

    Args:
        data: Bytes of a PNG or JPEG file.
        where: Its name in errors.

    Raises:
        InputError: Neither, cut short, or larger than the limit.
    """
    import cv2

    size = _size(data)
    if size is None:
        raise InputError("a texture is neither PNG nor JPEG", where=where, hint="Convert it")
    if size[0] * size[1] > MOST_PIXELS or min(size) < 1:
        raise InputError(
            f"too large a texture: {size[0]} x {size[1]} px",
            where=where,
            allowed=f"up to {MOST_PIXELS / 1e6:.0f} Mpx",
            hint="Reduce it",
        )
    try:
        whole = is_whole_png(data) or not data.startswith(SIGNATURE)
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR) if whole else None
    except cv2.error:
        pixels = None
    if pixels is None:
        raise InputError("a texture cannot be decoded", where=where, hint="Check that the file is complete")
    suffix = ".png" if data[:4] == b"\x89PNG" else ".jpg"
    if max(size) > LARGEST:
        share = LARGEST / max(size)
        pixels = cv2.resize(pixels, None, fx=share, fy=share, interpolation=cv2.INTER_AREA)
        data, suffix = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1].tobytes(), ".jpg"
    return _skin(data, suffix, np.asarray(pixels[..., ::-1], np.uint8))


def palette_skin(colors: U8) -> tuple[Skin, F64]:
    """Store the colors of triangles in an image: each triangle reads the center of one texel.

    Args:
        colors: sRGB color of each triangle, shape (T, 3), uint8.

    Returns:
        The image, and `st` of each triangle's corners [1], shape (T, 3, 2), float64.
    """
    entries, number = np.unique(colors, axis=0, return_inverse=True)
    if len(entries) > 1 << 18:
        entries, number = np.unique(colors & 0xFC, axis=0, return_inverse=True)
    side = 1 << int(np.ceil(np.log2(max(np.sqrt(len(entries)), 2.0))))
    image = np.zeros((side * side, 3), np.uint8)
    image[: len(entries)] = entries
    row, column = np.divmod(number.reshape(-1), side)
    st = np.stack([(column + 0.5) / side, 1.0 - (row + 0.5) / side], axis=1)
    skin = _skin(png(image.reshape(side, side, 3)), ".png", np.asarray(entries[None], np.uint8))
    return skin, np.repeat(st[:, None], 3, axis=1)


def skin_recipes(skins: tuple[Skin, ...], folder: Path) -> dict[str, MaterialRecipe]:
    """Write images into an asset.

    Args:
        skins: The images.
        folder: Folder of the asset; receives `textures/`.

    Returns:
        One recipe for each, by role.
    """
    recipes = {}
    for skin in skins:
        (folder / "textures").mkdir(parents=True, exist_ok=True)
        write_bytes(folder / "textures" / skin.file_name, skin.image)
        recipes[skin.role] = MaterialRecipe(
            skin.role, f"./textures/{skin.file_name}", skin.color, roughness=_ROUGHNESS, sheet=1.0
        )
    return recipes


def _skin(data: bytes, suffix: str, pixels: U8) -> Skin:
    linear = srgb_to_linear(np.arange(256) / 255.0)
    red, green, blue = (
        round(float(np.bincount(pixels[..., k].ravel(), minlength=256) @ linear / pixels[..., k].size), 4)
        for k in range(3)
    )
    return Skin(f"skin_{hashlib.sha256(data).hexdigest()[:16]}", data, suffix, (red, green, blue))


def _size(data: bytes) -> tuple[int, int] | None:
    """Read width and height from the head of a PNG or JPEG file [px], before anything is decoded."""
    if data.startswith(SIGNATURE) and len(data) > 24:
        return int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")
    if data[:2] != b"\xff\xd8":
        return None
    place = 2
    while place + 9 < len(data) and data[place] == 0xFF:
        marker, length = data[place + 1], int.from_bytes(data[place + 2 : place + 4], "big")
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            height, width = (int.from_bytes(data[place + k : place + k + 2], "big") for k in (5, 7))
            return width, height
        place += 2 + max(length, 2)
    return None
