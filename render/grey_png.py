"""Labels and ids as PNG without loss, in a tenth of the time that OpenCV takes, a few kB larger.

Source: PNG, W3C Recommendation, 3rd edition (chunks, section 5; filters, section 9).
"""

import struct
from zlib import crc32

import numpy as np
from isal import isal_zlib
from numpy.typing import NDArray

SIGNATURE = b"\x89PNG\r\n\x1a\n"
_LEVEL = 1
_GREY, _UNFILTERED = 0, 0


def encode_grey_png(pixels: NDArray[np.uint8] | NDArray[np.uint16]) -> bytes:
    """Encode labels or ids: areas of equal numbers, which need no filter to pack well.

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
    header = struct.pack(">IIBBBBB", width, height, 8 * size, _GREY, 0, 0, 0)
    return b"".join([
        SIGNATURE, _chunk(b"IHDR", header), _chunk(b"IDAT", isal_zlib.compress(rows, _LEVEL)), _chunk(b"IEND", b""),
    ])  # fmt: skip


def _chunk(kind: bytes, data: bytes) -> bytes:
    return b"".join([struct.pack(">I", len(data)), kind, data, struct.pack(">I", crc32(data, crc32(kind)))])
