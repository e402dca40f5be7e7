"""Cutting of triangles along the border of free land; values at their corners are interpolated."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

SHORTEST = 3.0  # [m]: edges up to this length are not split
SHARE = 0.7  # largest length of an edge, as a share of its distance from the border [1]
_ROUNDS = 12
_OF_SPLIT = {  # corners 0-2 and edge middles 3-5 (of 01, 12, 20) of the pieces, by which edges are split
    (False, False, False): ((0, 1, 2),),
    (True, False, False): ((0, 3, 2), (3, 1, 2)),
    (False, True, False): ((0, 1, 4), (0, 4, 2)),
    (False, False, True): ((0, 1, 5), (5, 1, 2)),
    (True, True, False): ((3, 1, 4), (0, 3, 4), (0, 4, 2)),
    (False, True, True): ((5, 4, 2), (0, 1, 4), (0, 4, 5)),
    (True, False, True): ((0, 3, 5), (3, 1, 2), (3, 2, 5)),
    (True, True, True): ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
}


def split_long(corners: F64, free: Callable[[F64], F64]) -> F64:
    """Split edges that are long relative to their distance from the border; neighbors split a common edge equally.

    Args:
        corners: Rows of x, y [m] and further values at the corners, shape (T, 3, K), float64.
        free: Returns the distance of plan positions, shape (N, 2), from the border, negative inside [m].

    Returns:
        The same surface in more triangles, rows of x, y [m] and further values, shape (U, 3, K), float64.
    """
    for _ in range(_ROUNDS):
        ends = np.roll(corners, -1, axis=1)
        length = np.linalg.norm((ends - corners)[..., :2], axis=2)
        middle = 0.5 * (corners + ends)
        away = np.abs(free(middle[..., :2].reshape(-1, 2))).reshape(length.shape)
        long = length > np.maximum(SHORTEST, SHARE * np.maximum(away - 0.5 * length, 0.0))
        deep = free(corners[..., :2].reshape(-1, 2)).reshape(length.shape)
        long &= ~(np.maximum(deep, np.roll(deep, -1, axis=1)) + 0.5 * length < 0.0)
        if not long.any():
            break
        whole = np.concatenate([corners, middle], axis=1)
        corners = np.concatenate(
            [
                whole[(long == np.array(split)).all(axis=1)][:, list(piece)]
                for split, pieces in _OF_SPLIT.items()
                for piece in pieces
            ]
        )
    return corners


def cut_free(corners: F64, field: F64) -> F64:
    """Keep the parts where a field is positive.

    Args:
        corners: Rows of values at the corners, each in its own unit [any unit], shape (T, 3, K), float64.
        field: The field at each corner, linear in between [any unit], shape (T, 3), float64.

    Returns:
        Triangles, in the units of `corners` [any unit], shape (U, 3, K), float64.
    """
    inside = field > 0.0
    count = inside.sum(axis=1)
    kept = [corners[count == 3]]
    for many in (1, 2):
        chosen = count == many
        # Rotate the corners so that the only corner on its side comes first.
        alone = np.argmax(inside[chosen] == (many == 1), axis=1)
        turn = (alone[:, None] + np.arange(3)) % 3
        rows = np.arange(len(turn))[:, None]
        a, b, c = np.moveaxis(corners[chosen][rows, turn], 1, 0)
        f, g, h = np.moveaxis(field[chosen][rows, turn][..., None], 1, 0)
        ab, ac = a + f / (f - g) * (b - a), a + f / (f - h) * (c - a)
        pieces = [(a, ab, ac)] if many == 1 else [(ab, b, c), (ab, c, ac)]
        kept += [np.stack(piece, axis=1) for piece in pieces]
    return np.concatenate(kept)
