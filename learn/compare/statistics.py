"""Statistics for the comparison of trainings: paired seeds, bridges as the sampling unit, confidence intervals."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from groundwork.errors import InputError
from learn.metrics import mean_iou

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


@dataclass(frozen=True)
class Difference:
    """A mean difference of paired values.

    Attributes:
        mean: First minus second [1].
        deviation: Standard deviation of the differences [1].
        low: Lower end of the interval [1].
        high: Upper end of the interval [1].
        pairs: Number of pairs.
        wins: Pairs in which the first is better.
    """

    mean: float
    deviation: float
    low: float
    high: float
    pairs: int
    wins: int


def paired_difference(first: F64, second: F64, level: float = 0.95) -> Difference:
    """Compare two arms over the same seeds, with Student's t interval.

    Args:
        first: Score of each seed in one arm [1], shape (S,), float64.
        second: Score of the same seeds in the other [1], shape (S,), float64.
        level: Coverage of the interval [1].

    Returns:
        The difference.

    Raises:
        InputError: Fewer than two pairs.
    """
    if first.shape != second.shape or len(first) < 2:
        raise InputError("an interval needs at least two pairs", field="seeds", value=len(first), allowed="2 or more")
    differences = first - second
    deviation = float(differences.std(ddof=1))
    reach = float(stats.t.ppf(0.5 + level / 2, len(first) - 1)) * deviation / np.sqrt(len(first))
    mean = float(differences.mean())
    return Difference(mean, deviation, mean - reach, mean + reach, len(first), int((differences > 0).sum()))


def crossed_bootstrap(
    first: I64,
    second: I64,
    draws: int,
    seed: int,
    *,
    level: float = 0.95,
    statistic: Callable[[F64], F64] = mean_iou,
    corrected: bool = False,
) -> Difference:
    """Compare two arms by a crossed bootstrap over seeds and bridges.

    A draw takes S seeds and B bridges with replacement, the same for both arms. The score of a seed is that of the
    confusion matrices summed over the bridges; the score of an arm is the mean over the seeds.

    Args:
        first: Confusion matrices of one arm, shape (S, B, C, C), int64.
        second: Of the other, for the same seeds and bridges, shape (S, B, C, C), int64.
        draws: Number of draws.
        seed: Seed of the draws.
        level: Coverage of the interval [1].
        statistic: Score of summed matrices, (…, C, C) → (…).
        corrected: Use Student's t interval with the corrected deviation of the draws instead of their percentiles.
            Bootstrap draws of n items spread too little by √((n - 1) / n), and percentiles ignore the uncertainty of
            that spread: with few seeds or bridges both make the interval too short. n is the smaller number of the two.

    Returns:
        The difference of the whole sample, the deviation of the draws, the interval, and the number of seeds in which
        the first arm is better.

    Source: of the correction, T. Hesterberg, What teachers should know about the bootstrap, The American Statistician
    69 (2015), on narrowness bias.
    """
    seeds, bridges = first.shape[:2]
    rng = np.random.default_rng(seed)
    arms = [matrices.astype(np.float64).transpose(1, 0, 2, 3).reshape(bridges, -1) for matrices in (first, second)]
    whole = [statistic(matrices.sum(axis=1).astype(np.float64)) for matrices in (first, second)]
    found = np.empty(draws)
    for draw in range(draws):
        of_seed = np.bincount(rng.integers(0, seeds, seeds), minlength=seeds)
        of_bridge = np.bincount(rng.integers(0, bridges, bridges), minlength=bridges)
        scores = [statistic((of_bridge @ arm).reshape(seeds, *first.shape[2:])) for arm in arms]
        found[draw] = of_seed @ (scores[0] - scores[1]) / seeds
    low, high = np.nanpercentile(found, [50 * (1 - level), 50 * (1 + level)])
    differences = whole[0] - whole[1]
    mean, deviation = float(differences.mean()), float(np.nanstd(found))
    if corrected:
        fewest = min(seeds, bridges)
        if fewest < 2:
            raise InputError(
                "an interval needs at least two seeds and two bridges",
                field="seeds, bridges",
                value=f"{seeds}, {bridges}",
                allowed="2 or more each",
            )
        deviation *= float(np.sqrt(fewest / (fewest - 1)))
        reach = float(stats.t.ppf(0.5 + level / 2, fewest - 1)) * deviation
        low, high = mean - reach, mean + reach
    return Difference(mean, deviation, float(low), float(high), seeds, int((differences > 0).sum()))


def class_iou(matrices: F64 | I64) -> F64:
    """Compute the IoU of each class of many confusion matrices at once.

    Args:
        matrices: Confusion matrices [1], shape (…, C, C).

    Returns:
        IoU of each class [1], shape (…, C), float64; NaN where it occurs in neither.
    """
    right = np.diagonal(matrices, axis1=-2, axis2=-1)
    union = matrices.sum(axis=-1) + matrices.sum(axis=-2) - right
    return np.where(union > 0, right / np.where(union > 0, union, 1), np.nan)


def signed_rank(first: F64, second: F64) -> float:
    """Compute Wilcoxon's two-sided signed-rank p value for paired scores, such as those of bridges.

    Args:
        first: Score of each bridge in one arm [1], shape (B,), float64; NaN where it has none.
        second: Score of the same bridges in the other [1], shape (B,), float64.

    Returns:
        p [1]; 1 if no pair differs.
    """
    differences = first - second
    differences = differences[~np.isnan(differences)]
    if not differences.any():
        return 1.0
    return float(np.asarray(stats.wilcoxon(differences))[1])


def holm(p_values: Sequence[float]) -> tuple[float, ...]:
    """Correct p values for multiple tests by Holm's method.

    Args:
        p_values: One per test [1].

    Returns:
        Adjusted p values in the same order [1], at most 1.

    Source: Holm, A simple sequentially rejective multiple test procedure, 1979.
    """
    adjusted, largest = [0.0] * len(p_values), 0.0
    for rank, row in enumerate(sorted(range(len(p_values)), key=lambda i: p_values[i])):
        largest = max(largest, min(1.0, (len(p_values) - rank) * p_values[row]))
        adjusted[row] = largest
    return tuple(adjusted)
