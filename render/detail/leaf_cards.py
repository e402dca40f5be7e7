"""Coarser copies of a crown of leaf cards: fewer cards, each larger, so that the crown keeps its shape and cover.

Edges of separate cards cannot collapse into each other without spanning the gap between them.

Source: Cook et al., Stochastic simplification of aggregate detail, SIGGRAPH 2007; here the cards that stay are those
which lie farthest apart, so that no place of the crown is left bare.
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

_STEP = 0.7  # cards of a level over those of the one before
_FEWEST = 3  # cards of the last level
_LARGEST = 2.0  # size of a card over that in the crown as authored [1]
_SHEETS = 0.05  # distance of the two sheets of one card, at most, over the card's size [1]


def cards_of(soup: Soup) -> I64:
    """Tell to which card each triangle belongs.

    A card is a piece of one or two triangles that touches no other; sheets that lie on each other are one card.

    Args:
        soup: Triangles.

    Returns:
        The number of its card for each triangle, shape (T,), int64; empty where the soup holds anything but cards.
    """
    if not len(soup):
        return np.zeros(0, np.int64)
    corners = soup.corners.reshape(-1, 3)
    place = np.unique(corners, axis=0, return_inverse=True)[1].reshape(-1)
    triangle = np.repeat(np.arange(len(soup)), 3)
    joint = coo_array((np.ones(len(place)), (triangle, len(soup) + place)), shape=(len(soup) + len(corners),) * 2)
    piece = np.unique(connected_components(joint, directed=False)[1][: len(soup)], return_inverse=True)[1]
    if np.bincount(piece).max() > 2:
        return np.zeros(0, np.int64)
    middle, size = _middles(soup, piece), _sizes(soup, piece)
    pairs = KDTree(middle).query_pairs(_SHEETS * float(np.median(size)), output_type="ndarray")
    sheets = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(middle),) * 2)
    return connected_components(sheets, directed=False)[1].astype(np.int64)[piece]


def fewer_cards(soup: Soup, card: I64) -> Iterator[Soup]:
    """Make ever coarser copies, each with about 0.7 of the cards of the one before.

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
    """Order points: the one farthest from the middle of all, then always the farthest from those before it."""
    order, away = [], np.linalg.norm(points - points.mean(axis=0), axis=1)
    for _ in range(len(points)):
        row = int(np.argmax(away))
        order.append(row)
        distance = np.linalg.norm(points - points[row], axis=1)
        away = distance if len(order) == 1 else np.minimum(away, distance)
    return np.array(order, np.int64)
