"""Edge smoothing of the photograph, guided by ids and depth, which are not changed.

At the border of two surfaces, a pixel is blended as if a straight edge passed through the steps of the ids.

Source: Reshetov, Morphological antialiasing, HPG 2009; edges come from ids and depth instead of colors.
"""

import cv2
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
_FAINT = 2  # times weaker than an edge that it touches: the two are not the same border
_AROUND = 5  # [px] side of the square that gets samples for one pixel at an edge
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
    _drop_faint(code, down, right)
    pixels: list[I64] = []
    others: list[I64] = []
    shares: list[F32] = []
    for across, beside, step, flip in ((down, right, width, False), (_turned(right), _turned(down), 1, True)):
        row, column, share = _shares(across, beside, draw.T if flip else draw)
        near = column * width + row if flip else row * width + column
        up = share > 0
        pixels += [near[up], near[~up] + step]
        others += [near[up] + step, near[~up]]
        shares += [share[up], -share[~up]]
    _blend(code.reshape(-1, 3), np.concatenate(pixels), np.concatenate(others), np.concatenate(shares))


def pixels_at_edges(draw: U32, depth: F32, leaves: Bools) -> NDArray[np.uint8]:
    """Choose the pixels of a photograph that may show several surfaces: those along edges, and two pixels around them.

    What is thinner than a pixel is not in every sample: hence those around. Leaves have edges everywhere; only the
    outlines of what they belong to count.

    Args:
        draw: Draw that each pixel shows, shape (H, W), uint32.
        depth: Planar depth [m], +inf for sky, shape (H, W), float32.
        leaves: Pixels that show a cut-out, shape (H, W), bool.

    Returns:
        1 for the pixels chosen, else 0, shape (H, W), uint8.
    """
    hard, soft = np.zeros(draw.shape, np.uint8), np.zeros(draw.shape, np.uint8)
    for axis, (one, other) in enumerate(((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:]))):
        edges = _edges(draw, depth, axis)
        edges &= ~(leaves[one] & leaves[other]) | (draw[one] != draw[other])
        solid = edges & ~(leaves[one] | leaves[other])
        for side in (one, other):
            hard[side] |= solid
            soft[side] |= edges
    return np.maximum(cv2.dilate(hard, np.ones((_AROUND, _AROUND), np.uint8)), soft).astype(np.uint8)


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


def _drop_faint(code: U16, down: Bools, right: Bools) -> None:
    """Drop edges that touch one of more than twice their contrast, in place.

    They would end the stronger one's runs: the crease above the lower flange of a girder divides what is seen before
    the sky into pieces, although the girder's outline is one line.

    Source: Jimenez et al., SMAA: Enhanced subpixel morphological antialiasing, Eurographics 2012, section 4.1.
    """
    height, width, _ = code.shape
    size, light = height * width, code.reshape(-1, 3)
    places, contrasts = [], []
    for edges, step in ((down, width), (right, 1)):
        row, column = np.divmod(np.flatnonzero(edges), edges.shape[1])
        place, contrast = row * width + column, np.zeros(size, np.uint16)
        one, other = light[place], light[place + step]
        contrast[place] = (np.maximum(one, other) - np.minimum(one, other)).max(axis=1)
        places.append(place)
        contrasts.append(contrast)
    for axis, (edges, step, aside) in enumerate(((down, width, 1), (right, 1, width))):
        place, own, crossing = places[axis], contrasts[axis], contrasts[1 - axis]
        most = np.zeros(len(place), np.uint16)
        for contrast, shift in (
            *((crossing, shift) for shift in (0, -aside, step, step - aside)),
            *((own, shift) for shift in (step, -step)),
        ):
            beside = place + shift
            there = (beside >= 0) & (beside < size)
            np.maximum(most, np.where(there, np.take(contrast, beside, mode="clip"), 0), out=most)
        faint = place[own[place] < most // _FAINT]
        edges[faint // width, faint % width] = False


def _turned(edges: Bools) -> Bools:
    return np.ascontiguousarray(edges.T)


def _shares(across: Bools, beside: Bools, draw: U32) -> tuple[I64, I64, F32]:
    """Find how far straight edges reach into the pixels on either side of the level steps that samples show.

    Args:
        across: Edges below pixels, shape (H - 1, W), bool.
        beside: Edges to the right of pixels, shape (H, W - 1), bool.
        draw: What pixels show, shape (H, W), uint32.

    Returns:
        Row and column of the pixels above each piece of an edge, shape (N,), int64; share of that pixel which shows
        what lies below it, or negative: of the one below it which shows what lies above [1], shape (N,), float32.
    """
    height, width = across.shape
    padded = np.zeros(height * (width + 1) + 1, bool)  # each row begins with a gap, so that starts and ends alternate
    padded[:-1].reshape(height, width + 1)[:, 1:] = across
    change = np.flatnonzero(padded[1:] != padded[:-1])
    strip = _strips(across, beside, draw)
    crossing = strip[0] * (width + 1) + strip[1]
    row, first = np.divmod(np.sort(np.concatenate([change[::2], crossing + 1])), width + 1)
    last = np.sort(np.concatenate([change[1::2], crossing + 1])) % (width + 1) - 1
    left = _turn(across, beside, row, first - 1) - _turn_of_strip(strip, row, first - 1, width)
    right = _turn(across, beside, row, last) + _turn_of_strip(strip, row, last, width)
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


def _strips(across: Bools, beside: Bools, draw: U32) -> tuple[I64, I64, F32]:
    """Find where a strip one pixel thick goes on in the next row: two runs meet there that belong to its two sides.

    Returns:
        Row above and column left of each such corner of four pixels, shape (N,); how the strip goes on to the right:
        0.5 up, -0.5 down, shape (N,).
    """
    width = across.shape[1]
    place = np.flatnonzero(across[:, :-1] & across[:, 1:] & beside[:-1] & beside[1:])
    row, column = np.divmod(place, width - 1)
    falling = draw[row, column] == draw[row + 1, column + 1]
    rising = draw[row, column + 1] == draw[row + 1, column]
    wide = draw[row, column] == draw[np.maximum(row - 1, 0), column]  # where both: the background is what is thick
    falling, rising = falling & ~(rising & wide), rising & (~falling | wide)
    sure = falling != rising
    return row[sure], column[sure], np.where(rising, np.float32(0.5), np.float32(-0.5))[sure]


def _turn_of_strip(strip: tuple[I64, I64, F32], row: I64, column: I64, width: int) -> F32:
    """How a strip goes on at the end of a run: 0.5 up to the right, -0.5 down, 0 where there is none, shape (N,)."""
    key, wanted = strip[0] * (width + 1) + strip[1], row * (width + 1) + column
    if not len(key):
        return np.zeros(len(row), np.float32)
    at = np.minimum(np.searchsorted(key, wanted), len(key) - 1)
    return np.where((key[at] == wanted) & (column >= 0), strip[2][at], np.float32(0))


def _turn(across: Bools, beside: Bools, row: I64, column: I64) -> F32:
    """Which way edges turn where a run ends: 0.5 up, -0.5 down, 0 neither or both, shape (N,).

    A slanted edge that runs along rows rises by one pixel at a time: a longer turn is a corner, and is kept. Where the
    edge that seems to go on belongs to the other side of a strip one pixel thick, the turn does not count as longer.
    """
    height = len(beside)
    inside = (column >= 0) & (column < beside.shape[1])
    column = np.clip(column, 0, max(beside.shape[1] - 1, 0))
    up, down = beside[row, column], beside[row + 1, column]
    above, below = np.maximum(row - 1, 0), np.minimum(row + 1, height - 2)
    farther_up = beside[above, column] & (row > 0) & ~(across[above, column] & across[above, column + 1])
    farther_down = beside[below + 1, column] & (row + 2 < height) & ~(across[below, column] & across[below, column + 1])
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
