"""A cache folder of pyramids, named by the hash of the cloud and of the parameters."""

import hashlib
import io
import zipfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from groundwork.canonical import canonical_json
from groundwork.errors import OutOfSpaceError
from groundwork.files import write_bytes
from learn.neighborhoods.pyramids import Indices

F32 = NDArray[np.float32]

VERSION = 1
"""Counts up when a search changes what it finds."""


def pyramid_key(coord: F32, parameters: object) -> str:
    """Compute the cache key of a pyramid.

    Args:
        coord: Positions [m or 1], shape (N, 3), float32.
        parameters: All other parameters that determine it; anything with a canonical JSON form.

    Returns:
        SHA-256 in 64 hexadecimal digits.
    """
    head = canonical_json({"version": VERSION, "shape": list(coord.shape), "parameters": parameters})
    body = np.ascontiguousarray(coord, dtype="<f4").tobytes()
    return hashlib.sha256(head.encode() + b"\0" + body).hexdigest()


def cached_pyramid(folder: Path | None, coord: F32, parameters: object, build: Callable[[F32], Indices]) -> Indices:
    """Read a pyramid from the cache, or build and store it.

    Args:
        folder: The cache; made if absent. None: no cache.
        coord: Positions [m or 1], shape (N, 3), float32.
        parameters: All other parameters that determine the pyramid.
        build: Function that builds it.

    Returns:
        The pyramid: named arrays of row numbers, shape (rows,) or (rows, neighbors), int32; a damaged or foreign file
        is rebuilt.
    """
    if folder is None:
        return build(coord)
    key = pyramid_key(coord, parameters)
    path = folder / key[:2] / f"{key}.npz"
    try:
        with np.load(path, allow_pickle=False) as file:
            return {name: np.asarray(file[name], dtype=np.int32) for name in file.files}
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile):
        arrays = build(coord)
    stream = io.BytesIO()
    np.savez(stream, allow_pickle=False, **dict(arrays))  # not atomic: into memory
    with suppress(OutOfSpaceError):  # the work goes on without a cache
        path.parent.mkdir(parents=True, exist_ok=True)
        write_bytes(path, stream.getvalue(), durable=False)
    return arrays
