"""A PNG whose chunks do not fit into it is told from a whole one."""

import struct
from zlib import crc32

import numpy as np

from groundwork.png_chunks import SIGNATURE, is_whole_png


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", crc32(kind + data))


WHOLE = SIGNATURE + _chunk(b"IHDR", bytes(13)) + _chunk(b"IDAT", b"numbers") + _chunk(b"IEND", b"")


def test_chunks_end_within_the_file() -> None:
    """Every cut is seen, bytes behind the end chunk are not, and other formats are none."""
    assert is_whole_png(WHOLE)
    assert is_whole_png(WHOLE + b"a preview")
    assert not any(is_whole_png(WHOLE[:length]) for length in range(len(WHOLE)))
    assert not is_whole_png(b"\xff\xd8" + WHOLE)


def test_lengths_that_leave_the_file_are_refused() -> None:
    """Any longer first or second chunk makes the file end too early, or go on with what is no chunk."""
    rng = np.random.default_rng(3)
    for place, length in ((8, 13), (33, 7)):
        for stated in rng.integers(length + 1, 1 << 32, 500):
            assert not is_whole_png(WHOLE[:place] + int(stated).to_bytes(4) + WHOLE[place + 4 :])
