"""Labels and ids as lossless PNG, read in a tenth of OpenCV's time, at the same size.

Source: PNG, W3C Recommendation, 3rd edition (chunks, section 5; filters, section 9).
"""

import struct
from zlib import crc32

import deflate
import numpy as np
from numpy.typing import NDArray

from groundwork.png_chunks import SIGNATURE

_LEVEL = 1
_GRAY, _UNFILTERED = 0, 0
_HEADER, _HEADER_BEGINS = ">IIBBBBB", b"\x00\x00\x00\x0dIHDR"
_HEADER_AT, _HEADER_ENDS, _DATA_AT = 16, 29, 41  # in a file whose numbers are one chunk
_SUM = 4  # bytes of the check sum behind a chunk
_TIGHTEST = 1032  # largest compression ratio of Deflate


def encode_gray_png(pixels: NDArray[np.uint8] | NDArray[np.uint16]) -> bytes:
    """Encode labels or ids: areas of equal numbers, which compress well without a filter.

    Args:
        pixels: Numbers, shape (H, W), uint8 or uint16.

    Returns:
        The file's bytes.
    """
    height, width = pixels.shape
    size = pixels.dtype.itemsize
    rows = np.empty((height, 1 + width * size), np.uint8)
    rows[:, 0] = _UNFILTERED
    rows[:, 1:] = np.ascontiguousarray(pixels, pixels.dtype.newbyteorder(">")).view(np.uint8)
    header = struct.pack(_HEADER, width, height, 8 * size, _GRAY, 0, 0, 0)
    return _file(header, bytes(deflate.zlib_compress(rows, _LEVEL)))


def decode_gray_png(data: bytes) -> NDArray[np.uint8] | NDArray[np.uint16] | None:
    """Decode the result of `encode_gray_png`, in a tenth of OpenCV's time.

    Args:
        data: The file's bytes.

    Returns:
        Numbers, shape (H, W), uint8 or uint16; None for any other file, such as a damaged one.
    """
    if data[:_HEADER_AT] != SIGNATURE + _HEADER_BEGINS or len(data) < _DATA_AT:
        return None
    header, packed = data[_HEADER_AT:_HEADER_ENDS], data[_DATA_AT : -len(_END) - _SUM]
    if data != _file(header, packed):
        return None
    width, height, bits, *kind = struct.unpack(_HEADER, header)
    size = height * (1 + width * bits // 8)
    if bits not in (8, 16) or kind != [_GRAY, 0, 0, 0] or not 0 < width * height <= size <= _TIGHTEST * len(packed):
        return None
    try:
        unpacked = deflate.zlib_decompress(packed, size)  # fails if there is more
    except deflate.DeflateError:
        return None
    if len(unpacked) != size:
        return None
    rows = np.frombuffer(unpacked, np.uint8).reshape(height, -1)
    if (rows[:, 0] != _UNFILTERED).any():
        return None
    numbers = rows[:, 1:].copy()
    return numbers if bits == 8 else numbers.view(">u2").astype(np.uint16)


def _file(header: bytes, packed: bytes) -> bytes:
    return b"".join([SIGNATURE, _chunk(b"IHDR", header), _chunk(b"IDAT", packed), _END])


def _chunk(kind: bytes, data: bytes) -> bytes:
    return b"".join([struct.pack(">I", len(data)), kind, data, struct.pack(">I", crc32(data, crc32(kind)))])


_END = _chunk(b"IEND", b"")
