"""The texture of the sky: direction and solid angle of its texels."""

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]


def sky_directions(rows: int) -> F64:
    """List the world direction of every texel of the sky texture.

    Args:
        rows: Rows of the texture; it is twice as wide.

    Returns:
        Unit vectors, world axes [1], shape (rows, 2 * rows, 3), float64.
    """
    latitude = (np.pi / 2 - (np.arange(rows) + 0.5) / rows * np.pi)[:, None]
    longitude = (np.pi - (np.arange(2 * rows) + 0.5) / rows * np.pi)[None, :]
    level = np.cos(latitude)
    x, y, z = np.broadcast_arrays(level * np.sin(longitude), np.sin(latitude), level * np.cos(longitude))
    return np.stack([x, -z, y], axis=-1)


def solid_angles(rows: int) -> F64:
    """Find the solid angle of a texel in each row of the sky texture [sr], shape (rows, 1), float64."""
    edges = np.sin(np.pi / 2 - np.arange(rows + 1) / rows * np.pi)
    return ((edges[:-1] - edges[1:]) * (np.pi / rows))[:, None]
