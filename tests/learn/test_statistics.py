"""Intervals and p values equal closed forms, slow twins and known tables."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from groundwork.errors import InputError
from learn.compare.statistics import crossed_bootstrap, holm, paired_difference, signed_rank
from learn.metrics import mean_iou


def test_the_paired_interval_is_students() -> None:
    """The one-sample t interval of the differences."""
    first, second = np.array([0.7, 0.8, 0.75, 0.9]), np.array([0.6, 0.79, 0.77, 0.8])
    result = paired_difference(first, second)
    interval = stats.ttest_1samp(first - second, 0.0).confidence_interval(0.95)
    assert (result.low, result.high) == pytest.approx((interval.low, interval.high))
    assert (result.mean, result.pairs, result.wins) == (pytest.approx(0.0475), 4, 3)
    with pytest.raises(InputError, match="two pairs"):
        paired_difference(first[:1], second[:1])


def matrices(seed: int, right: float) -> np.ndarray:
    """Draw confusion matrices of 4 seeds and 6 bridges, three classes, a share of the points right."""
    rng = np.random.default_rng(seed)
    wrong = (1 - right) / 2
    rows = np.full((3, 3), wrong) + np.eye(3) * (right - wrong)
    return np.stack([[np.stack([rng.multinomial(200, row) for row in rows]) for _ in range(6)] for _ in range(4)])


def test_the_crossed_bootstrap_equals_its_slow_twin() -> None:
    """Every draw picks seeds and bridges one by one, adds up their matrices and scores them."""
    first, second = matrices(1, 0.8), matrices(2, 0.75)
    rng, slow = np.random.default_rng(9), []
    for _ in range(50):
        chosen, bridges = rng.integers(0, 4, 4), rng.integers(0, 6, 6)
        scores = [
            np.mean([float(mean_iou(np.sum([arm[seed, bridge] for bridge in bridges], axis=0))) for seed in chosen])
            for arm in (first, second)
        ]
        slow.append(scores[0] - scores[1])
    result = crossed_bootstrap(first, second, draws=50, seed=9)
    assert (result.low, result.high) == pytest.approx(tuple(np.percentile(slow, [2.5, 97.5])))
    assert result.deviation == pytest.approx(np.std(slow))
    assert result.low < result.mean < result.high


def test_arms_that_are_the_same_do_not_differ() -> None:
    """Both arms meet the same seeds and bridges in every draw, so that what they share cancels."""
    one = matrices(1, 0.8)
    result = crossed_bootstrap(one, one, draws=20, seed=0)
    assert (result.mean, result.low, result.high, result.wins) == (0.0, 0.0, 0.0, 0)


def test_more_bridges_narrow_the_interval() -> None:
    """Sixteen times the same six bridges instead of once: about a quarter of the width remains of their share."""
    first, second = matrices(1, 0.8), matrices(2, 0.75)
    few = crossed_bootstrap(first[:1], second[:1], draws=400, seed=0)
    many = crossed_bootstrap(np.tile(first[:1], (1, 16, 1, 1)), np.tile(second[:1], (1, 16, 1, 1)), draws=400, seed=0)
    assert (many.high - many.low) / (few.high - few.low) == pytest.approx(0.25, rel=0.25)


def test_the_signed_rank_test_by_table() -> None:
    """Five bridges that all got better: 2 / 2^5. Bridges without a score are left out; no difference is no evidence."""
    first = np.array([0.5, 0.6, 0.7, 0.8, 0.9, np.nan])
    second = first - np.array([0.01, 0.02, 0.03, 0.04, 0.05, 0.0])
    assert signed_rank(first, second) == pytest.approx(0.0625)
    assert signed_rank(first, first) == 1.0


def test_holm_by_hand() -> None:
    """Ordered p times what is left, never falling, at most one, in the order given."""
    assert holm([0.04, 0.01, 0.03]) == pytest.approx((0.06, 0.03, 0.06))
    assert holm([0.9, 0.8]) == (1.0, 1.0)
    assert holm([]) == ()
