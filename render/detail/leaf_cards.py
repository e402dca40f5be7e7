"""Levels of detail of tree crowns made of leaf cards: fewer, larger cards, so that shape and cover are kept.

Edges of separate cards cannot collapse into each other without bridging the gap between them.

Source: Cook et al., Stochastic simplification of aggregate detail, SIGGRAPH 2007; here the cards that are farthest
apart are kept, so that no part of the crown becomes empty.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from render.detail.soup import Soup

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_STEP = 0.7  # ratio of the number of cards of a level to that of the level before
_FEWEST = 3  # cards of the last level
_LARGEST = 2.0  # size of a card over that in the crown as authored [1]
_SHEETS = 0.05  # largest distance of the two sheets of one card, as a share of the card's size [1]
_UNLIKE = 1e-3  # greatest difference of normals, texture coordinates and colors at a corner of two sheets [1]


def cards_of(soup: Soup) -> I64:
    """Find the card of each triangle.

    A card is a piece of one or two triangles that touches no other; coincident sheets are one card.

    Args:
        soup: Triangles.

    Returns:
        The number of its card for each triangle, shape (T,), int64; empty if the soup contains anything but cards.
    """
    if not len(soup):
        return np.zeros(0, np.int64)
    piece = _pieces(soup)
    if np.bincount(piece).max() > 2:
        return np.zeros(0, np.int64)
    middle, size = _middles(soup, piece), _sizes(soup, piece)
    pairs = KDTree(middle).query_pairs(_SHEETS * float(np.median(size)), output_type="ndarray")
    sheets = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(middle),) * 2)
    return connected_components(sheets, directed=False)[1].astype(np.int64)[piece]


def single_sheets(soup: Soup, card: I64) -> tuple[Soup, I64] | None:
    """Replace the two sheets of each card by one between them, with the same shading on both sides.

    Args:
        soup: Triangles.
        card: The number of its card for each triangle, shape (T,), int64.

    Returns:
        Half the triangles, and the number of the card of each, shape (T / 2,), int64; None where a card has not two
        sheets that lie back to back, with the same values at each corner and a single normal.
    """
    piece, size = _pieces(soup), _sizes(soup, card)
    fronts: list[I64] = []
    corners: list[F64] = []
    for number in range(len(size)):
        members = np.flatnonzero(card == number)
        left = [members[piece[members] == one] for one in dict.fromkeys(piece[members].tolist())]
        while left:  # more than two if two cards intersect
            front = left.pop(0)
            pairs = ((row, _between(soup, front, back, _SHEETS * size[number])) for row, back in enumerate(left))
            row, middle = next(((row, middle) for row, middle in pairs if middle is not None), (-1, None))
            if middle is None:
                return None
            left.pop(row)
            fronts.append(front)
            corners.append(middle)
    every = np.concatenate(fronts)
    single = replace(
        soup,
        corners=np.concatenate(corners),
        normals=soup.normals[every],
        carried=soup.carried[every],
        alike=True,
    )
    return single, card[every]


def fewer_cards(soup: Soup, card: I64) -> Iterator[Soup]:
    """Make successively coarser levels, each with about 0.7 of the cards of the one before.

    Args:
        soup: Triangles.
        card: The number of its card for each triangle, shape (T,), int64.

    Yields:
        The next level; nothing is computed ahead.
    """
    middle = _middles(soup, card)
    order, area = _apart(middle), _areas(soup, card)
    count = int(_STEP * len(order))
    while count >= _FEWEST:
        kept = np.zeros(len(order), bool)
        kept[order[:count]] = True
        grown = min(float(np.sqrt(area.sum() / area[kept].sum())), _LARGEST)
        rows = np.flatnonzero(kept[card])
        center = middle[card[rows], None]
        corners = center + grown * (soup.corners[rows] - center)
        yield replace(soup, corners=corners, normals=soup.normals[rows], carried=soup.carried[rows])
        count = int(_STEP * count)


def _pieces(soup: Soup) -> I64:
    """Number the connected components of triangles, shape (T,)."""
    corners = soup.corners.reshape(-1, 3)
    place = np.unique(corners, axis=0, return_inverse=True)[1].reshape(-1)
    triangle = np.repeat(np.arange(len(soup)), 3)
    joint = coo_array((np.ones(len(place)), (triangle, len(soup) + place)), shape=(len(soup) + len(corners),) * 2)
    return np.unique(connected_components(joint, directed=False)[1][: len(soup)], return_inverse=True)[1]


def _between(soup: Soup, front: I64, back: I64, most: float) -> F64 | None:
    """Make a sheet between the two of one card, at most `most` apart, shape (N, 3, 3); None if they differ."""
    if len(front) != len(back):
        return None
    here, there = (
        np.concatenate([part[sheet] for part in (soup.corners, soup.normals, soup.carried)], axis=2).reshape(
            3 * len(sheet), -1
        )
        for sheet in (front, back)
    )
    gap = np.linalg.norm(here[:, None, :3] - there[None, :, :3], axis=2)
    other = there[np.argmin(gap, axis=1)]
    facing = [
        np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]).sum(axis=0) for t in map(soup.corners.__getitem__, (front, back))
    ]
    if facing[0] @ facing[1] >= 0 or gap.min(axis=1).max() > most or np.abs(here - other)[:, 3:].max() > _UNLIKE:
        return None
    return (here[:, :3] + other[:, :3]).reshape(-1, 3, 3) / 2


def _middles(soup: Soup, piece: I64) -> F64:
    """Mean of the corners of each piece [stage units], shape (K, 3)."""
    total = np.zeros((int(piece.max()) + 1, 3))
    np.add.at(total, piece, soup.corners.sum(axis=1))
    return total / (3.0 * np.bincount(piece))[:, None]


def _sizes(soup: Soup, piece: I64) -> F64:
    """Longest edge of each piece [stage units], shape (K,)."""
    edges = np.linalg.norm(soup.corners - np.roll(soup.corners, -1, axis=1), axis=2).max(axis=1)
    longest = np.zeros(int(piece.max()) + 1)
    np.maximum.at(longest, piece, edges)
    return longest


def _areas(soup: Soup, piece: I64) -> F64:
    """Area of each piece [square stage units], shape (K,)."""
    first, second = soup.corners[:, 1] - soup.corners[:, 0], soup.corners[:, 2] - soup.corners[:, 0]
    area = np.zeros(int(piece.max()) + 1)
    np.add.at(area, piece, np.linalg.norm(np.cross(first, second), axis=1) / 2)
    return area


def _apart(points: F64) -> I64:
    """Order points by farthest point sampling, starting with the one farthest from the center."""
    order, away = [], np.linalg.norm(points - points.mean(axis=0), axis=1)
    for _ in range(len(points)):
        row = int(np.argmax(away))
        order.append(row)
        distance = np.linalg.norm(points - points[row], axis=1)
        away = distance if len(order) == 1 else np.minimum(away, distance)
    return np.array(order, np.int64)
