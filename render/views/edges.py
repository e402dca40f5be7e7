"""Edge smoothing of the photograph, guided by ids and depth, which are not changed.

At the border of two surfaces, a pixel is blended as if a straight edge passed through the steps of the ids.

Source: Reshetov, Morphological antialiasing, HPG 2009; edges come from ids and depth instead of colours.
"""

import numpy as np
from numpy.typing import NDArray

Bools = NDArray[np.bool_]
F32 = NDArray[np.float32]
I64 = NDArray[np.int64]
U16 = NDArray[np.uint16]
U32 = NDArray[np.uint32]

_SINGLE = np.float32(
    2 / 3
)  # for steps of one pixel in both directions: an edge at 45 degrees covers a sixth of a pixel on average
_JUMP_BITS = 2**17  # difference of the bits of two floats: 1.6 to 3.1 %
_JUMP = 0.02  # relative step of 1 / depth beyond its slope on both sides: one part of a surface in front of another


def smooth_edges(code: U16, draw: U32, depth: F32) -> None:
    """Blend the pixels along edges of a photograph in place.

    Args:
        code: Square root of linear radiance over a maximum [65535], shape (H, W, 3), uint16.
        draw: Draw that each pixel shows, shape (H, W), uint32.
        depth: Planar depth [m], +inf for sky, shape (H, W), float32.
    """
    width = draw.shape[1]
    down, right = _edges(draw, depth, 0), _edges(draw, depth, 1)
    pixels: list[I64] = []
    others: list[I64] = []
    shares: list[F32] = []
    for across, beside, step, flip in ((down, right, width, False), (_turned(right), _turned(down), 1, True)):
        row, column, share = _shares(across, beside)
        near = column * width + row if flip else row * width + column
        up = share > 0
        pixels += [near[up], near[~up] + step]
        others += [near[up] + step, near[~up]]
        shares += [share[up], -share[~up]]
    _blend(code.reshape(-1, 3), np.concatenate(pixels), np.concatenate(others), np.concatenate(shares))


def _edges(draw: U32, depth: F32, axis: int) -> Bools:
    """Whether an edge runs between each pixel and the next along an axis, one fewer than pixels along it."""
    count = draw.shape[axis]
    here, there = ((slice(None),) * axis + (slice(first, count - 1 + first),) for first in (0, 1))
    found = draw[here] != draw[there]
    bits = depth.view(np.int32)  # of positive floats: they increase like a logarithm, and infinity's are finite
    jumps = (np.abs(bits[here] - bits[there]) > _JUMP_BITS) & ~found
    place = list(np.divmod(np.flatnonzero(jumps), jumps.shape[1]))  # a quarter of the time of `nonzero`
    inverse = []
    for step in (-1, 0, 1, 2):
        near = place.copy()
        near[axis] = np.clip(place[axis] + step, 0, count - 1)
        inverse.append(1 / depth[near[0], near[1]])
    jump = inverse[2] - inverse[1]
    slack = np.float32(_JUMP) * np.maximum(inverse[1], inverse[2])
    found[place[0], place[1]] = (np.abs(jump - (inverse[1] - inverse[0])) > slack) & (
        np.abs(jump - (inverse[3] - inverse[2])) > slack
    )
    return found


def _turned(edges: Bools) -> Bools:
    return np.ascontiguousarray(edges.T)


def _shares(across: Bools, beside: Bools) -> tuple[I64, I64, F32]:
    """Find how far straight edges reach into the pixels on either side of the level steps that samples show.

    Args:
        across: Edges below pixels, shape (H - 1, W), bool.
        beside: Edges to the right of pixels, shape (H, W - 1), bool.

    Returns:
        Row and column of the pixels above each piece of an edge, shape (N,), int64; share of that pixel which shows
        what lies below it, or negative: of the one below it which shows what lies above [1], shape (N,), float32.
    """
    height, width = across.shape
    padded = np.zeros(height * (width + 1) + 1, bool)  # each row begins with a gap, so that starts and ends alternate
    padded[:-1].reshape(height, width + 1)[:, 1:] = across
    change = np.flatnonzero(padded[1:] != padded[:-1])
    row, first = np.divmod(change[::2], width + 1)
    last = change[1::2] % (width + 1) - 1
    left = _turn(beside, row, first - 1)
    right = _turn(beside, row, last)
    single = first == last
    kept = ((left != 0) | (right != 0)) & (left != right)  # a run that turns the same way twice is one or two corners
    kept &= ~single | (left == -right)  # a single step belongs to the runs that it connects
    left, right = left * np.where(single, _SINGLE, 1), right * np.where(single, _SINGLE, 1)
    row, first, length, left, right = row[kept], first[kept], (last - first + 1)[kept], left[kept], right[kept]
    run = np.repeat(np.arange(len(row)), length)
    column = np.arange(len(run)) - np.repeat(np.cumsum(length) - length, length)
    size = length[run].astype(np.float32)
    start = column.astype(np.float32) / size
    end = (column + 1).astype(np.float32) / size
    # The edge falls from half a pixel at a turn to nothing in the middle of the run; a pixel in the middle has both.
    halves = left[run] * (_fall(end) - _fall(start)), right[run] * (_fall(1 - start) - _fall(1 - end))
    share = np.concatenate(halves) * np.tile(size, 2)
    touched = np.abs(share) > 1 / 512
    return np.tile(row[run], 2)[touched], np.tile(first[run] + column, 2)[touched], share[touched].astype(np.float32)


def _turn(beside: Bools, row: I64, column: I64) -> F32:
    """Which way edges turn where a run ends: 0.5 up, -0.5 down, 0 neither or both, shape (N,).

    A slanted edge that runs along rows rises by one pixel at a time: a longer turn is a corner, and is kept.
    """
    height = len(beside)
    inside = (column >= 0) & (column < beside.shape[1])
    column = np.clip(column, 0, max(beside.shape[1] - 1, 0))
    up, down = beside[row, column], beside[row + 1, column]
    farther_up = beside[np.maximum(row - 1, 0), column] & (row > 0)
    farther_down = beside[np.minimum(row + 2, height - 1), column] & (row + 2 < height)
    turn = (up & ~down & ~farther_up).astype(np.float32) - (down & ~up & ~farther_down).astype(np.float32)
    return turn * inside * np.float32(0.5)


def _fall(place: F32) -> F32:
    """Area below a line that falls from 1 at 0 to 0 at a half, up to a place, shape (N,)."""
    near = np.minimum(place, np.float32(0.5))
    return near - near * near


def _blend(code: U16, pixels: I64, others: I64, shares: F32) -> None:
    """Mix other pixels' light into some pixels; a pixel may occur more than once."""
    touched = np.zeros(code.shape[0], bool)
    touched[pixels] = True
    every = np.flatnonzero(touched)
    rank = np.empty(code.shape[0], np.int32)
    rank[every] = np.arange(len(every), dtype=np.int32)
    row = rank[pixels]
    total = np.bincount(row, shares, len(every))
    shares = (shares / np.maximum(total, 1.0)[row]).astype(np.float32)
    total = np.minimum(total, 1.0).astype(np.float32)
    light = code[every].astype(np.float32) ** 2 * (1 - total)[:, None]
    added = code[others].astype(np.float32) ** 2 * shares[:, None]
    for channel in range(3):
        light[:, channel] += np.bincount(row, added[:, channel], len(every)).astype(np.float32)
    code[every] = np.rint(np.sqrt(light)).astype(np.uint16)
