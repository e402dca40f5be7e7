"""Pyramids of points: the points of each level and their neighbors, as arrays of row numbers.

Row numbers do not change under rotation, mirroring and uniform scaling (if the radii are scaled too), so one pyramid
serves every such augmentation of a cloud.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from learn.neighborhoods.farthest import need_points
from learn.neighborhoods.searcher import Points, Rows, Searcher

Indices = Mapping[str, NDArray[np.int32]]

INTERPOLATED = 3  # coarse points that the features of a finer point are interpolated from


def farthest_pyramid(
    coord: Points, counts: Sequence[int], balls: Sequence[Sequence[tuple[float, int]]], search: Searcher[Points, Rows]
) -> Mapping[str, Rows]:
    """Build the pyramid of PointNet++: farthest points, balls about them, and neighbors for upsampling.

    Args:
        coord: Positions [m or 1], shape (N, 3), float32; of a batch, here and below with an axis in front.
        counts: Points of each coarser level.
        balls: For each of them, (radius [m or 1], neighbors) of each ball about its points.
        search: What searches.

    Returns:
        For level l: `kept{l}`, shape (counts[l],), rows of the level above; `ball{l}_{j}`, shape (counts[l],
        neighbors), rows of the level above; `up{l}`, shape (points above, 3), rows of level l, nearest first.
    """
    arrays: dict[str, Rows] = {}
    above = coord
    for level, (count, rings) in enumerate(zip(counts, balls, strict=True)):
        kept = search.farthest(above, count)
        below = search.take(above, kept)
        arrays[f"kept{level}"] = kept
        for ring, (radius, neighbors) in enumerate(rings):
            arrays[f"ball{level}_{ring}"] = search.ball(above, below, radius, neighbors)
        arrays[f"up{level}"] = search.nearest(below, above, INTERPOLATED)
        above = below
    return arrays


def add_own_balls(
    arrays: Mapping[str, Rows],
    coord: Points,
    levels: int,
    balls: Sequence[tuple[float, int]],
    search: Searcher[Points, Rows],
) -> Mapping[str, Rows]:
    """Add to a pyramid, for the points of each level, the balls among the points of the same level.

    Args:
        arrays: A pyramid of `farthest_pyramid`: `kept{l}`, shape (points of level l,), `ball{l}_{j}` and `up{l}`, shape
            (rows, neighbors).
        coord: Positions that it was built from [m or 1], shape (N, 3), float32.
        levels: Number of levels.
        balls: (radius [m or 1], neighbors) at each level.
        search: What searches.

    Returns:
        The pyramid and `own{l}`, shape (points of level l, neighbors), rows of level l.
    """
    more = dict(arrays)
    for level in range(levels):
        coord = search.take(coord, arrays[f"kept{level}"])
        more[f"own{level}"] = search.ball(coord, coord, *balls[level])
    return more


def random_pyramid(
    coord: Points, ratios: Sequence[int], neighbors: int, seed: int, search: Searcher[Points, Rows]
) -> Mapping[str, Rows]:
    """Build the pyramid of RandLA-Net: random points, k nearest neighbors, and the nearest kept point.

    Args:
        coord: Positions [m or 1], shape (N, 3), float32; of a batch, here and below with an axis in front.
        ratios: Factor by which each level thins the cloud.
        neighbors: Nearest neighbors k.
        seed: Seed of the choice; the paper takes the first points of a cloud shuffled beforehand.
        search: What searches.

    Returns:
        For level l: `near{l}`, shape (N_l, k), rows of level l; `kept{l}`, shape (N_l // ratio,), rows of level l that
        are level l + 1; `up{l}`, shape (N_l, 1), rows of level l + 1.

    Raises:
        InputError: Too few points for the last level.
    """
    need_points(search.count(coord), neighbors * int(np.prod(ratios[:-1])))
    arrays: dict[str, Rows] = {}
    for level, ratio in enumerate(ratios):
        left = search.count(coord) // ratio
        kept = search.first(coord, left) if level else search.shuffled(coord, left, seed)
        below = search.take(coord, kept)
        arrays[f"near{level}"] = search.nearest(coord, coord, neighbors)
        arrays[f"kept{level}"] = kept
        arrays[f"up{level}"] = search.nearest(below, coord, 1)
        coord = below
    return arrays
