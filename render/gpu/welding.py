"""Vertices of meshes at the same position: flat shading and seams of texture coordinates duplicate them."""

import numpy as np
from numpy.typing import NDArray

from usd_schemas.flat_scene import Geometry

I64 = NDArray[np.int64]
U64 = NDArray[np.uint64]


def welded_places(geometry: Geometry) -> I64:
    """Number the positions of vertices, shape (V,).

    Args:
        geometry: Meshes.
    """
    bits = (geometry.positions + np.float32(0)).view(np.uint32).astype(np.uint64)  # -0 and 0 are the same
    return np.unique(mixed(mixed(bits[:, 0], bits[:, 1]), bits[:, 2]), return_inverse=True)[1].astype(np.int64)


def mixed(one: U64, other: U64) -> U64:
    """Hash two columns into one of 64 bits.

    Args:
        one: Numbers, shape (N,), uint64.
        other: Numbers, shape (N,), uint64.

    Returns:
        Hashes, shape (N,), uint64.

    Source: the finalizer of SplitMix64, Steele et al., OOPSLA 2014.
    """
    with np.errstate(over="ignore"):
        value = one * np.uint64(0x9E3779B97F4A7C15) + other
        value = (value ^ (value >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        value = (value ^ (value >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return value ^ (value >> np.uint64(31))
