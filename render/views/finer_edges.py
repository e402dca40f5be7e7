"""Edges of a photograph whose ids are finer than its pixels, as those of a lens that distorts: mixed by covered area.

A pixel is the mean of what its finer pixels show, each with the light of the nearest pixel whose middle shows the same.
Source: Chajdas, McGuire, Luebke, Subpixel reconstruction antialiasing for deferred shading, I3D 2011; ids instead of
depth and normals.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Bools = NDArray[np.bool_]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]
U16 = NDArray[np.uint16]
U32 = NDArray[np.uint32]


def smooth_finer_edges(code: U16, middle: U32, draw: U32) -> None:
    """Mix the pixels along edges of a photograph in place.

    What no pixel around shows in its middle has no known light, and does not count.

    Args:
        code: Square root of linear radiance over a maximum [65535], shape (H, W, 3), uint16.
        middle: Draw that the middle of each pixel shows, whose light `code` is, shape (H, W), uint32.
        draw: Draw that each finer pixel shows, shape (n H, n W), uint32.
    """
    finer = len(draw) // len(code)
    _mix(code, code.copy(), middle, draw, finer, _nearest_first(finer))


def mixed_pixels(draw: U32, finer: int, leaves: Bools) -> U8:
    """Choose the pixels of a photograph that show several parts, and those around solid ones.

    Args:
        draw: Draw that each finer pixel shows, shape (finer H, finer W), uint32.
        finer: Finer pixels along a side of a pixel.
        leaves: Which draws are cut-outs, by the number of `draw`, shape (D + 1,), bool.

    Returns:
        1 for the pixels chosen, else 0, shape (H, W), uint8.
    """
    chosen = np.zeros((len(draw) // finer, draw.shape[1] // finer), np.uint8)
    _choose(chosen, draw, finer, leaves)
    return chosen


def _nearest_first(finer: int) -> I64:
    """Order the eight pixels around by their distance from each finer pixel, shape (finer * finer, 8, 2), row first."""
    around = np.array([(row, column) for row in (-1, 0, 1) for column in (-1, 0, 1) if row or column])
    place = (np.arange(finer) + 0.5) / finer - 0.5
    own = np.stack(np.meshgrid(place, place, indexing="ij"), axis=-1).reshape(-1, 1, 2)
    order = np.argsort(np.sum((around - own) ** 2, axis=-1), axis=1, kind="stable")
    return around[order].astype(np.int64)


@njit(cache=True, nogil=True)
def _mix(code: U16, before: U16, middle: U32, draw: U32, finer: int, order: I64) -> None:
    height, width = code.shape[0], code.shape[1]
    total = np.empty(3)
    for row in range(height):
        for column in range(width):
            own = middle[row, column]
            count, strange = 0, False
            total[:] = 0.0
            for place in range(finer * finer):
                number = draw[finer * row + place // finer, finer * column + place % finer]
                at_row, at_column, known = row, column, number == own
                strange |= not known
                for turn in range(8):
                    if known:
                        break
                    at_row, at_column = row + order[place, turn, 0], column + order[place, turn, 1]
                    if 0 <= at_row < height and 0 <= at_column < width:
                        known = middle[at_row, at_column] == number
                if known:
                    count += 1
                    for channel in range(3):
                        value = float(before[at_row, at_column, channel])
                        total[channel] += value * value
            if strange and count > 0:
                for channel in range(3):
                    code[row, column, channel] = np.uint16(np.sqrt(total[channel] / count) + 0.5)


@njit(cache=True, nogil=True)
def _choose(chosen: U8, draw: U32, finer: int, leaves: Bools) -> None:
    height, width = chosen.shape
    for row in range(height):
        for column in range(width):
            first, several, soft = draw[finer * row, finer * column], False, False
            for place in range(1, finer * finer):
                number = draw[finer * row + place // finer, finer * column + place % finer]
                several |= number != first
                soft |= leaves[number]
            if several:
                reach = 0 if soft or leaves[first] else 1
                for at_row in range(max(row - reach, 0), min(row + reach + 1, height)):
                    for at_column in range(max(column - reach, 0), min(column + reach + 1, width)):
                        chosen[at_row, at_column] = 1
