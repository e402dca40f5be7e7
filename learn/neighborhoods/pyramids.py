"""Pyramids of points: the points of each level and their neighbors, as arrays of row numbers.

Row numbers do not change under rotation, mirroring and uniform scaling (if the radii are scaled too), so one pyramid
serves every such augmentation of a cloud.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from learn.neighborhoods.farthest import farthest_points, need_points
from learn.neighborhoods.search import ball_query, nearest

F32 = NDArray[np.float32]
I64 = NDArray[np.int64]
Indices = Mapping[str, NDArray[np.int32]]

INTERPOLATED = 3  # coarse points that the features of a finer point are interpolated from


def farthest_pyramid(coord: F32, counts: Sequence[int], balls: Sequence[Sequence[tuple[float, int]]]) -> Indices:
    """Build the pyramid of PointNet++: farthest points, balls about them, and neighbors for upsampling.

    Args:
        coord: Positions [m or 1], shape (N, 3), float32.
        counts: Points of each coarser level.
        balls: For each of them, (radius [m or 1], neighbors) of each ball about its points.

    Returns:
        For level l: `kept{l}`, shape (counts[l],), rows of the level above; `ball{l}_{j}`, shape (counts[l],
        neighbors), rows of the level above; `up{l}`, shape (points above, 3), rows of level l, nearest first; int32.
    """
    arrays: dict[str, NDArray[np.int32]] = {}
    above = coord
    for level, (count, rings) in enumerate(zip(counts, balls, strict=True)):
        kept = farthest_points(above, count)
        below = above[kept]
        arrays[f"kept{level}"] = kept.astype(np.int32)
        for ring, (radius, neighbors) in enumerate(rings):
            arrays[f"ball{level}_{ring}"] = ball_query(above, below, radius, neighbors).astype(np.int32)
        arrays[f"up{level}"] = nearest(below, above, INTERPOLATED).astype(np.int32)
        above = below
    return arrays


def add_own_balls(arrays: Indices, coord: F32, levels: int, balls: Sequence[tuple[float, int]]) -> Indices:
    """Add to a pyramid, for the points of each level, the balls among the points of the same level.

    Args:
        arrays: A pyramid of `farthest_pyramid`: `kept{l}`, shape (points of level l,), `ball{l}_{j}` and `up{l}`, shape
            (rows, neighbors), int32.
        coord: Positions that it was built from [m or 1], shape (N, 3), float32.
        levels: Number of levels.
        balls: (radius [m or 1], neighbors) at each level.

    Returns:
        The pyramid and `own{l}`, shape (points of level l, neighbors), rows of level l, int32.
    """
    more = dict(arrays)
    for level in range(levels):
        coord = coord[arrays[f"kept{level}"]]
        more[f"own{level}"] = ball_query(coord, coord, *balls[level]).astype(np.int32)
    return more


def random_pyramid(coord: F32, ratios: Sequence[int], neighbors: int, seed: int) -> Indices:
    """Build the pyramid of RandLA-Net: random points, k nearest neighbors, and the nearest kept point.

    Args:
        coord: Positions [m or 1], shape (N, 3), float32.
        ratios: Factor by which each level thins the cloud.
        neighbors: Nearest neighbors k.
        seed: Seed of the choice; the paper takes the first points of a cloud shuffled beforehand.

    Returns:
        For level l: `near{l}`, shape (N_l, k), rows of level l; `kept{l}`, shape (N_l // ratio,), rows of level l that
        are level l + 1; `up{l}`, shape (N_l, 1), rows of level l + 1. All int32.

    Raises:
        InputError: Too few points for the last level.
    """
    need_points(len(coord), neighbors * int(np.prod(ratios[:-1])))
    arrays: dict[str, NDArray[np.int32]] = {}
    kept = np.random.default_rng([seed, len(coord)]).permutation(len(coord))
    for level, ratio in enumerate(ratios):
        kept = kept[: len(coord) // ratio]
        arrays[f"near{level}"] = nearest(coord, coord, neighbors).astype(np.int32)
        arrays[f"kept{level}"] = kept.astype(np.int32)
        arrays[f"up{level}"] = nearest(coord[kept], coord, 1).astype(np.int32)
        coord = coord[kept]
        kept = np.arange(len(coord))
    return arrays
