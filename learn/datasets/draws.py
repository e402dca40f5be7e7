"""Draws of a fixed number of points: exhaustive, random, or stratified by class."""

import numpy as np
from numpy.typing import NDArray

I64 = NDArray[np.int64]


def count_draws(count: int, size: int) -> int:
    """Count the draws needed to draw every point once.

    Args:
        count: Points that there are, at least one.
        size: Points of a draw.
    """
    return -(-count // size)


def exhaustive_draw(count: int, size: int, number: int, seed: int) -> I64:
    """Draw without replacement until all points are drawn; the last draw is filled up with points drawn before.

    Args:
        count: Points that there are, at least one.
        size: Points of a draw.
        number: Which draw, 0 to `count_draws` - 1.
        seed: Seed of the order.

    Returns:
        Rows, shape (size,), int64.

    Source: Kim, Yoon, Sim, Automated bridge component recognition from point clouds using deep learning (2020).
    """
    order = np.random.default_rng([seed, count]).permutation(count)
    return order[np.arange(number * size, (number + 1) * size) % count]


def random_draw(count: int, size: int, rng: np.random.Generator) -> I64:
    """Draw without replacement; if there are too few points, their numbers of repetitions differ by at most one.

    Args:
        count: Points that there are, at least one.
        size: Points of the draw.
        rng: Source of randomness.

    Returns:
        Rows, shape (size,), int64.
    """
    if size <= count:
        return rng.choice(count, size, replace=False, shuffle=True)
    return np.concatenate([rng.permutation(count) for _ in range(-(-size // count))])[:size]


def stratified_draw(labels: NDArray[np.integer], size: int, least: int, rng: np.random.Generator) -> I64:
    """Draw at random, but with a least number of points of every class, which replace points of larger classes.

    Args:
        labels: Class of each point, shape (N,), any integer type, at least one.
        size: Points of the draw.
        least: Points of each class that the draw keeps, if there are so many and there is room for all classes.
        rng: Source of randomness.

    Returns:
        Rows, shape (size,), int64; without repetition where `size` is at most N.
    """
    rows = random_draw(len(labels), size, rng)
    if size >= len(labels):
        return rows
    classes, codes, total = np.unique(labels, return_inverse=True, return_counts=True)
    wanted = np.minimum(total, min(least, size // len(classes)))
    spare = np.bincount(codes[rows], minlength=len(classes)) - wanted  # points of each class above its least number
    leaving = np.zeros(len(classes), np.int64)
    for _ in range(int(-spare[spare < 0].sum())):
        leaving[np.argmax(spare - leaving)] += 1
    drawn = np.zeros(len(labels), bool)
    drawn[rows] = True
    freed = [
        rng.choice(np.flatnonzero(codes[rows] == place), leaving[place], replace=False)
        for place in np.flatnonzero(leaving)
    ]
    added = [
        rng.choice(np.flatnonzero((codes == place) & ~drawn), -spare[place], replace=False)
        for place in np.flatnonzero(spare < 0)
    ]
    if added:
        rows[rng.permutation(np.concatenate(freed))] = np.concatenate(added)
    return rows
