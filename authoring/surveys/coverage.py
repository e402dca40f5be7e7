"""Greedy coverage: nearly the fewest views that show everything often enough from different places."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import KDTree

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

NEXT_TO = 3.5  # [m] from a chosen view and ...
TURNED = np.cos(np.radians(46.0))  # ... rotated by no more than this: surfaces are matched, and it is one leg
PREFERRED = 3  # factor of preference for a view next to a chosen one [1]


@dataclass(frozen=True, eq=False)
class Wanted:
    """Targets of a choice of views.

    Attributes:
        shows: 1 where a view shows an element, shape (V, E), int64.
        needs: Views that each element still needs, shape (E,), int64.
        worth: Value of one more view of an element, shape (E,), int64.
    """

    shows: sparse.csr_matrix
    needs: I64
    worth: I64


def choose_views(wanted: Wanted, poses: F64, place: I64, least: int, most: int) -> I64:
    """Choose views one after the other, each with the largest gain; an element counts once for each place.

    Source: G. Nemhauser, L. Wolsey, M. Fisher 1978: the greedy choice reaches at least 1 - 1/e of the optimum for such
        sums. That
    a view next to a chosen one is preferred is our own rule: a reconstruction has to link them.

    Args:
        wanted: Elements, and which view shows which.
        poses: camera_to_world of the views [m], shape (V, 4, 4), float64.
        place: Place of each view, rising, shape (V,), int64.
        least: Value below which no view is chosen.
        most: Greatest number of views.

    Returns:
        Rows of the views in the order of choice, shape (M,), int64.
    """
    chosen: list[int] = []
    if not len(poses):
        return np.array(chosen, np.int64)
    shows = sparse.csr_matrix(wanted.shows, dtype=np.int64, copy=True)
    shows.sort_indices()
    needs, preferred = wanted.needs.copy(), np.ones(len(poses), np.int64)
    starts, ends = np.searchsorted(place, place), np.searchsorted(place, place, side="right")
    tree, looks = KDTree(poses[:, :3, 3]), np.round(poses[:, :3, 2], 9)
    while len(chosen) < most:
        gains = shows @ np.where(needs > 0, wanted.worth, 0)
        gains[gains < least] = 0
        best = int(np.argmax(gains * preferred))
        if gains[best] < max(least, 1):
            break
        chosen.append(best)
        row = slice(shows.indptr[best], shows.indptr[best + 1])
        shown = shows.indices[row][shows.data[row] > 0]
        needs[shown] -= 1
        same = slice(shows.indptr[starts[best]], shows.indptr[ends[best]])
        shows.data[same][np.isin(shows.indices[same], shown)] = 0
        around = np.array(tree.query_ball_point(poses[best, :3, 3], NEXT_TO), np.int64)
        preferred[around[looks[around] @ looks[best] >= TURNED]] = PREFERRED
    return np.array(chosen, np.int64)
