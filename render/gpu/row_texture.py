"""Rows of numbers that shaders read from a texture: the transforms of draws.

A driver on the CPU reads a storage buffer number by number and pixel by pixel, a texture four numbers at a time.
"""

import moderngl
import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]

DRAW_UNIT = 12  # after those of light and materials
UNITS = {"draw_rows": DRAW_UNIT}
_ROWS_ACROSS = 1024  # of rows.glsl; a texture has at most 16384 texels a side


def row_texture(context: moderngl.Context, rows: F32) -> moderngl.Texture:
    """Store rows in a texture, `_ROWS_ACROSS` side by side, four numbers per texel.

    Args:
        context: Open context.
        rows: The rows [any unit], shape (N, 4 K), float32.

    Returns:
        A texture of shape (N / 1024 rounded up, 1024 K, 4), float32.
    """
    high = max(1, -(-len(rows) // _ROWS_ACROSS))
    filled = np.zeros((high * _ROWS_ACROSS, rows.shape[1]), np.float32)
    filled[: len(rows)] = rows
    texture = context.texture((_ROWS_ACROSS * rows.shape[1] // 4, high), 4, filled.tobytes(), dtype="f4")
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    return texture
