"""Image files of a capture: lossless labels and depth, photographs, and decoding that refuses a damaged file."""

import re
import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError, MissingError
from groundwork.foreign_file import open_regular, read_regular
from groundwork.png_chunks import SIGNATURE, is_whole_png
from render.images.gray_png import decode_gray_png, encode_gray_png

_DEFLATE = 8  # TIFF's Adobe Deflate: OpenCV's own wheel cannot read Zstandard
_JPEG_END = b"\xff\xd9"
_JPEG_SCAN = 0xDA
_JPEG_MARKER = re.compile(rb"\xff[^\x00\xd0-\xd7\xff]")  # ends a scan: neither a stuffed byte nor a restart marker
_HEADER = 1 << 16  # bytes that contain the size of an image
_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # JPEG markers that begin a frame: followed by its size
MOST_PIXELS = 400_000_000  # of one image; the largest cameras have 150 million
_RUN_LENGTH = 3  # PNG strategy: half the time of the default at the same size
_SHORT = 3  # TIFF's number for 16 bits
WIDE_ID = 0x10000


def encode_jpeg(pixels: NDArray[np.uint8], quality: int) -> bytes:
    """Encode a photograph as JPEG with full color resolution (4:4:4).

    Args:
        pixels: sRGB colors [0 to 255], shape (H, W, 3), uint8.
        quality: JPEG quality, 1 to 100.

    Returns:
        The file's bytes, without EXIF.
    """
    options = [
        cv2.IMWRITE_JPEG_QUALITY,
        quality,
        cv2.IMWRITE_JPEG_SAMPLING_FACTOR,
        cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444,
    ]
    return _encode(".jpg", cv2.cvtColor(pixels, cv2.COLOR_RGB2BGR), options)


def encode_png(pixels: NDArray[np.uint8] | NDArray[np.uint16]) -> bytes:
    """Encode gray values or sRGB colors as PNG.

    Args:
        pixels: Gray, shape (H, W), uint8 or uint16; or red, green, blue, shape (H, W, 3), uint8 [0 to 255].

    Returns:
        The file's bytes.
    """
    if pixels.ndim == 2:
        return encode_gray_png(pixels)
    options = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_STRATEGY, _RUN_LENGTH]
    return _encode(".png", cv2.cvtColor(pixels, cv2.COLOR_RGB2BGR), options)


def encode_wide_ids(ids: NDArray[np.uint32]) -> bytes:
    """Encode ids above 65,535 as TIFF without loss.

    Args:
        ids: Instance ids, shape (H, W), uint32.

    Returns:
        The file's bytes.
    """
    return _encode(".tiff", ids, [cv2.IMWRITE_TIFF_COMPRESSION, _DEFLATE])


def ids_file(folder: Path, name: str) -> Path:
    """Find the file of instance ids: a 16-bit PNG, or a 32-bit TIFF.

    Args:
        folder: Where they lie.
        name: Stem of the file.
    """
    wide = folder / f"{name}.tiff"
    return wide if wide.exists() else folder / f"{name}.png"


def decode(path: Path, size: tuple[int, int] | None = None) -> NDArray[Any]:
    """Decode an image file without conversion: a gray one keeps its one channel, in every format; red comes first.

    Args:
        path: JPEG, PNG or TIFF.
        size: Width and height that it must have [px]; a file that states another is refused before memory is allocated.

    Returns:
        Values, shape (H, W), (H, W, 3), or (H, W, 4) with opacity last.

    Raises:
        MissingError: There is no such file.
        InputError: The file is cut off, not an image, of another size, or too large.
    """
    try:
        data = read_regular(path)
    except MissingError:
        raise MissingError("no such image", where=path, hint="Put it back") from None
    said = _said_size(data)
    if size is not None and said not in (None, size):
        raise InputError("not the size that cameras.json states", where=path, value=said, allowed=str(size))
    if said is not None and said[0] * said[1] > MOST_PIXELS:
        raise InputError("the image is too large", where=path, value=said, allowed=f"up to {MOST_PIXELS / 1e6:.0f} Mpx")
    gray = decode_gray_png(data)
    if gray is not None:
        return gray
    pixels = _decode(data, jpeg=data[:2] == b"\xff\xd8") if _is_whole(data) else None
    if pixels is None:
        raise InputError("the image is cut off or damaged", where=path, hint="Copy it again, or leave it out")
    if pixels.ndim == 2:
        return pixels
    return cv2.cvtColor(pixels, cv2.COLOR_BGRA2RGBA if pixels.shape[2] == 4 else cv2.COLOR_BGR2RGB)


def size(path: Path) -> tuple[int, int] | None:
    """Read the size of an image from its first bytes.

    Args:
        path: JPEG, PNG or classic TIFF.

    Returns:
        Width and height [px], as stored; None if it needs decoding.
    """
    try:
        with open_regular(path) as file:
            return _said_size(file.read(_HEADER))
    except (OSError, InputError):
        return None


def _said_size(data: bytes) -> tuple[int, int] | None:
    """Read the size of a PNG, JPEG or classic TIFF from its bytes [px]; None if it needs decoding."""
    if data[:8] == SIGNATURE and len(data) >= 24:
        return int.from_bytes(data[16:20]), int.from_bytes(data[20:24])
    place = 2
    while data[:2] == b"\xff\xd8" and place + 9 <= len(data) and data[place] == 0xFF:
        if data[place + 1] in _FRAMES:
            return int.from_bytes(data[place + 7 : place + 9]), int.from_bytes(data[place + 5 : place + 7])
        place += 2 + int.from_bytes(data[place + 2 : place + 4])
    return _tiff_size(data)


def _tiff_size(data: bytes) -> tuple[int, int] | None:
    """Read a TIFF's size: entries 256 and 257 of the first directory, 16 or 32 bits long. Source: TIFF 6.0."""
    order = {b"II*\0": "<", b"MM\0*": ">"}.get(data[:4])
    if order is None:
        return None
    found: dict[int, int] = {}
    try:
        (table,) = struct.unpack_from(order + "I", data, 4)
        (count,) = struct.unpack_from(order + "H", data, table)
        for at in range(table + 2, table + 2 + 12 * count, 12):
            tag, kind = struct.unpack_from(order + "HH", data, at)
            found[tag] = struct.unpack_from(order + ("H" if kind == _SHORT else "I"), data, at + 8)[0]
    except struct.error:
        return None
    return (found[256], found[257]) if found.get(256) and found.get(257) else None


def _is_whole(data: bytes) -> bool:
    """Tell whether an image is complete; of a TIFF only the decoder can tell."""
    if data.startswith(SIGNATURE):
        return is_whole_png(data)
    if data[:2] == b"\xff\xd8":
        return data.rstrip(b"\x00")[-2:] == _JPEG_END or _reaches_its_end(data)
    return bool(data)


def _reaches_its_end(jpeg: bytes) -> bool:
    """Tell whether the JPEG data is complete; phones append a video and drones a preview behind it."""
    place = 2
    while place + 4 <= len(jpeg) and jpeg[place] == 0xFF:
        kind = jpeg[place + 1]
        if kind == _JPEG_END[1]:
            return True
        place += 1 if kind == 0xFF else 2 + int.from_bytes(jpeg[place + 2 : place + 4])
        if kind == _JPEG_SCAN:
            found = _JPEG_MARKER.search(jpeg, place)
            if found is None:
                return False
            place = found.start()
    return False


def _decode(data: bytes, *, jpeg: bool) -> NDArray[Any] | None:
    # EXIF orientation is ignored: the calibration belongs to the stored pixels.
    flags = cv2.IMREAD_ANYCOLOR | cv2.IMREAD_IGNORE_ORIENTATION if jpeg else cv2.IMREAD_UNCHANGED
    former = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # replaced by our own error message
    try:
        return cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error:
        return None
    finally:
        cv2.utils.logging.setLogLevel(former)


def _encode(suffix: str, pixels: NDArray[Any], options: list[int]) -> bytes:
    return cv2.imencode(suffix, np.ascontiguousarray(pixels), options)[1].tobytes()
