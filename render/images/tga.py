"""Truevision TGA pictures, which OpenCV does not read.

Source: Truevision TGA file format specification, version 2.0 (1991), image types 1 to 3 and 9 to 11.
"""

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from groundwork.foreign_file import read_regular
from render.images.image_files import MOST_PIXELS

U8 = NDArray[np.uint8]

_HEADER = struct.Struct("<BBBHHBHHHHBB")
_MAPPED, _COLOR, _GRAY = 1, 2, 3  # kinds; plus 8 with run-length encoding
_PACKED = 8
_FROM_RIGHT, _FROM_TOP = 0x10, 0x20


def decode_tga(path: Path) -> U8:
    """Decode a TGA picture.

    Args:
        path: The file.

    Returns:
        Gray values, shape (H, W), or red, green, blue and maybe opacity, shape (H, W, 3 or 4), uint8.

    Raises:
        InputError: Cut off, of an unsupported kind, or too large.
    """
    data = read_regular(path)
    try:
        return _decoded(data)
    except (struct.error, ValueError, IndexError) as error:
        raise InputError(f"not readable as a TGA picture: {error}", where=path, hint="Save it as PNG") from None


def _decoded(data: bytes) -> U8:
    note, has_map, kind, first, length, map_bits, _, _, width, height, bits, flags = _HEADER.unpack_from(data)
    plain, packed = kind & ~_PACKED, bool(kind & _PACKED)
    if plain not in (_MAPPED, _COLOR, _GRAY) or width * height == 0 or width * height > MOST_PIXELS:
        raise ValueError(f"image type {kind}, {width} x {height} pixels")
    if bits not in ((8,) if plain != _COLOR else (15, 16, 24, 32)):
        raise ValueError(f"{bits} bits per pixel")
    at, size = _HEADER.size + note, (bits + 7) // 8
    table = np.zeros((0, 0), np.uint8)
    if has_map:
        step = (map_bits + 7) // 8
        table = np.frombuffer(data, np.uint8, length * step, at).reshape(length, step)
        at += length * step
    if packed:
        rows = _unpacked(data, at, width * height, size)
    else:
        rows = np.frombuffer(data, np.uint8, width * height * size, at).reshape(-1, size)
    if plain == _MAPPED:
        rows = table[rows[:, 0].astype(np.int64) - first]
    pixels = _colors(rows).reshape(height, width, -1)
    pixels = pixels[:, ::-1] if flags & _FROM_RIGHT else pixels
    pixels = pixels if flags & _FROM_TOP else pixels[::-1]
    return np.ascontiguousarray(pixels[..., 0] if pixels.shape[2] == 1 else pixels)


def _unpacked(data: bytes, at: int, count: int, size: int) -> U8:
    """Decode runs: a byte gives the number of pixels, which follow separately or as one; shape (count, size)."""
    found = np.empty((count, size), np.uint8)
    done = 0
    while done < count:
        head = data[at]
        many = min((head & 0x7F) + 1, count - done)
        run = bool(head & 0x80)
        pixels = np.frombuffer(data, np.uint8, size * (1 if run else (head & 0x7F) + 1), at + 1).reshape(-1, size)
        found[done : done + many] = pixels if run else pixels[:many]
        at += 1 + pixels.size
        done += many
    return found


def _colors(rows: U8) -> U8:
    """Convert blue, green, red to red, green, blue; 15 and 16 bits have 5 bits for each."""
    if rows.shape[1] == 1:
        return rows
    if rows.shape[1] == 2:
        value = rows[:, 0].astype(np.uint16) | rows[:, 1].astype(np.uint16) << 8
        fives = np.stack([value >> 10 & 31, value >> 5 & 31, value & 31], axis=1)
        return np.rint(fives * (255 / 31)).astype(np.uint8)
    return rows[:, [2, 1, 0, 3]] if rows.shape[1] == 4 else rows[:, [2, 1, 0]]
