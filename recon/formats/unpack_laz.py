"""A child process that unpacks the points of a LAZ file into plain bytes: the library may crash on a damaged one."""

import resource
from importlib import import_module
from pathlib import Path
from typing import Any

from groundwork.child import answer_parent
from groundwork.errors import InputError
from groundwork.progress import Progress

_BLOCK = 100_000  # points unpacked at once
_ADDRESSES = 8_000_000_000  # [bytes] a larger allocation fails at once


def unpack(request: dict[str, Any], progress: Progress) -> int:
    """Unpack block by block; memory is allocated only for points that exist.

    Args:
        request: `{path, out, offset, size, count, laszip}`: file, file to write, first byte of the points, bytes of a
            point, number of points, and the compressor's record in hexadecimal.
        progress: Listener.

    Returns:
        Number of points.

    Raises:
        InputError: The library cannot decode them.
    """
    lazrs: Any = import_module("lazrs")  # it ships no types

    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    most = _ADDRESSES if hard == resource.RLIM_INFINITY else min(_ADDRESSES, hard)
    resource.setrlimit(resource.RLIMIT_AS, (most, hard))
    path, count, size = Path(request["path"]), request["count"], request["size"]
    progress.stage("unpack", count)
    try:
        laszip = bytes.fromhex(request["laszip"])
        packs = lazrs.LazVlr(laszip).item_size()
        if packs != size:
            raise InputError(
                "the laszip record does not fit the point format", where=path, value=packs, allowed=str(size)
            )
        with path.open("rb") as packed, Path(request["out"]).open("wb") as out:  # not atomic: a temporary file
            packed.seek(request["offset"])
            unpacker = lazrs.LasZipDecompressor(packed, laszip)
            for first in range(0, count, _BLOCK):
                block = bytearray(min(_BLOCK, count - first) * size)
                unpacker.decompress_many(block)
                out.write(block)
                progress.advance(min(first + _BLOCK, count))
    except lazrs.LazrsError as error:
        raise InputError(f"not decodable as LAZ: {error}", where=path, hint="Copy it again") from None
    except MemoryError:
        raise InputError("not decodable as LAZ within the memory allowed", where=path) from None
    return count


if __name__ == "__main__":
    answer_parent(unpack)
