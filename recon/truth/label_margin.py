"""Distance of pixels from the next edge between labels: exact, and only at the requested pixels.

A distance transform of whole images would take longer than all other reading of the truth for a sparse cloud. Therefore
the distance along the column is computed for every pixel, in two passes, and the distance across columns is searched
for only in the rows of the requested pixels.

Source: the separation into columns and rows is that of Felzenszwalb and Huttenlocher, "Distance transforms of sampled
functions", 2012; rows are searched outwards instead of by a lower envelope.
"""

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

F32 = NDArray[np.float32]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]

_HALF_PIXEL = np.float32(0.5)
_FAR = np.int16(30_000)  # [px] in a column without an edge; its square plus that of a row's length fits 32 bits
_BLOCK = 64  # pixels that are searched at a time, without branches


def edge_distance(labels: U8, row: I64, column: I64) -> F32:
    """Measure how far the centers of some pixels lie from the next edge between labels.

    Args:
        labels: Class ids, shape (H, W), uint8.
        row: Rows of the pixels, shape (N,), int64.
        column: Their columns, shape (N,), int64.

    Returns:
        Distance [px], shape (N,), float32: 0.5 beside an edge; the image's diagonal where there is no edge.
    """
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    greatest, least = (turn(labels, cross, borderType=cv2.BORDER_REPLICATE) for turn in (cv2.dilate, cv2.erode))
    inner = greatest == least
    if inner.all():
        return np.full(len(row), np.hypot(*labels.shape), np.float32)
    return _search(_distance_in_column(inner), row, column)


@njit(cache=True, nogil=True)
def _distance_in_column(inner: NDArray[np.bool_]) -> NDArray[np.int16]:
    height, width = inner.shape
    distance = np.empty((height, width), np.int16)
    for column in range(width):
        distance[0, column] = _FAR if inner[0, column] else 0
    for row in range(1, height):
        for column in range(width):
            further = min(distance[row - 1, column] + np.int16(1), _FAR)
            distance[row, column] = further if inner[row, column] else 0
    for row in range(height - 2, -1, -1):
        for column in range(width):
            distance[row, column] = min(distance[row, column], distance[row + 1, column] + np.int16(1))
    return distance


@njit(cache=True, nogil=True)
def _search(in_column: NDArray[np.int16], row: I64, column: I64) -> F32:
    width = in_column.shape[1]
    found = np.empty(len(row), np.float32)
    for number in range(len(row)):
        line, here = in_column[row[number]], column[number]
        least = np.int32(line[here]) * np.int32(line[here])
        away = 1
        while away < width and away * away < least:
            for there in range(max(0, here - away - _BLOCK + 1), here - away + 1):
                down = np.int32(line[there])
                least = min(least, np.int32((here - there) * (here - there)) + down * down)
            for there in range(here + away, min(width, here + away + _BLOCK)):
                down = np.int32(line[there])
                least = min(least, np.int32((there - here) * (there - here)) + down * down)
            away += _BLOCK
        found[number] = np.sqrt(np.float32(least)) + _HALF_PIXEL
    return found
