"""Scores equal scikit-learn's, absent classes are left out, and calibration follows from its definition."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn import metrics as peer

from learn.metrics import calibration_error, confusion, confusion_by_threshold, mean_iou, risk_coverage, scores
from learn.scoring.panoptic import count_instances, panoptic_quality

SEEDS = st.integers(0, 10_000)


def drawn(seed: int, classes: int, count: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """Draw true and predicted classes that agree on about two thirds."""
    rng = np.random.default_rng(seed)
    truth = rng.integers(0, classes, count)
    return truth, np.where(rng.random(count) < 0.5, truth, rng.integers(0, classes, count))


@given(SEEDS, st.integers(2, 8))
def test_scores_equal_those_of_scikit_learn(seed: int, classes: int) -> None:
    """Confusion matrix, accuracy, recall, precision, F1 and IoU of every class, and their means."""
    truth, found = drawn(seed, classes)
    matrix, names = confusion(truth, found, classes), list(range(classes))
    assert np.array_equal(matrix, peer.confusion_matrix(truth, found, labels=names))
    result = scores(matrix)
    table = [
        peer.precision_recall_fscore_support(truth == number, found == number, average="binary") for number in names
    ]
    precision, recall, f1 = np.array([row[:3] for row in table], dtype=float).T
    iou = np.array([peer.jaccard_score(truth == number, found == number) for number in names])
    pairs = [(result.precision, precision), (result.accuracy, recall), (result.f1, f1), (result.iou, iou)]
    for ours, theirs in pairs:
        assert np.allclose(ours, theirs, rtol=0, atol=1e-12)
    assert np.array_equal(result.support, np.bincount(truth, minlength=classes))
    assert math.isclose(result.overall_accuracy, peer.accuracy_score(truth, found))
    assert math.isclose(result.mean_accuracy, peer.balanced_accuracy_score(truth, found))
    assert math.isclose(result.mean_iou, iou.mean())
    assert math.isclose(result.mean_f1, f1.mean())
    assert math.isclose(result.mean_precision, precision.mean())
    assert math.isclose(float(mean_iou(matrix[None])[0]), iou.mean())


def test_absent_classes_are_left_out_and_unlabeled_points_do_not_count() -> None:
    """Class 2 occurs nowhere; class 3 is only called; class 1 is never called; the point of class 255 is nobody's."""
    truth, found = np.array([0, 0, 0, 1, 255]), np.array([0, 0, 3, 0, 2])
    result = scores(confusion(truth, found, 4))
    assert result.support.tolist() == [3, 1, 0, 0]
    assert np.array_equal(result.iou, [0.5, 0.0, np.nan, 0.0], equal_nan=True)
    assert np.array_equal(result.accuracy, [2 / 3, 0.0, np.nan, np.nan], equal_nan=True)
    assert np.array_equal(result.precision, [2 / 3, 0.0, np.nan, 0.0], equal_nan=True)
    assert np.array_equal(result.f1, [2 / 3, 0.0, np.nan, 0.0], equal_nan=True)
    assert (result.mean_iou, result.classes_averaged) == (0.5 / 3, 3)
    assert result.mean_accuracy == 1 / 3
    assert result.overall_accuracy == 0.5


def test_nothing_scores_nothing() -> None:
    """Without a labeled point every score is NaN."""
    result = scores(confusion(np.array([255]), np.array([1]), 3))
    assert np.isnan([result.overall_accuracy, result.mean_iou, result.mean_accuracy, result.mean_f1]).all()
    assert np.isnan(mean_iou(np.zeros((2, 3, 3)))).all()
    assert math.isnan(calibration_error(np.zeros(0, np.float32), np.zeros(0, bool)))


@given(SEEDS)
def test_calibration_error_is_the_sum_over_bins(seed: int) -> None:
    """Against the definition, bin by bin; 1 belongs to the last bin and an edge to the bin below it."""
    rng = np.random.default_rng(seed)
    confidence = np.concatenate([rng.random(200), [0.0, 1.0, 0.2, 0.4]]).astype(np.float32)
    right = rng.random(204) < confidence
    total = 0.0
    for low in range(5):
        inside = (confidence.astype(float) > low / 5) & (confidence.astype(float) <= (low + 1) / 5)
        inside |= (confidence == 0.0) & (low == 0)
        if inside.any():
            total += inside.sum() / 204 * abs(confidence[inside].astype(float).mean() - right[inside].mean())
    assert math.isclose(calibration_error(confidence, right, bins=5), total, abs_tol=1e-12)


def test_a_calibrated_forecast_has_no_error_and_a_boastful_one_has_its_excess() -> None:
    """Three of four right at confidence 3/4: 0. All wrong at confidence 1: 1."""
    right = np.array([True, True, True, False])
    assert calibration_error(np.full(4, 0.75, np.float32), right) == 0.0
    assert calibration_error(np.ones(4, np.float32), np.zeros(4, bool)) == 1.0


def test_risk_falls_with_coverage_when_confidence_is_worth_something() -> None:
    """The two wrong points are the least sure ones."""
    confidence = np.array([0.9, 0.3, 0.8, 0.2], np.float32)
    coverage, risk = risk_coverage(confidence, np.array([True, False, True, False]), steps=4)
    assert coverage.tolist() == [0.25, 0.5, 0.75, 1.0]
    assert risk.tolist() == [0.0, 0.0, 1 / 3, 0.5]


def test_scores_up_to_a_threshold_leave_the_others_out() -> None:
    """The wrong point is the uncertain one; infinite uncertainty is above every threshold; none left is NaN."""
    truth, found = np.array([0, 1, 1, 0]), np.array([0, 1, 0, 1])
    uncertainty = np.array([0.01, 0.01, 0.5, np.inf], np.float32)
    values = mean_iou(confusion_by_threshold(truth, found, uncertainty, (0.001, 0.1, 1.0), 2))
    assert math.isnan(values[0])
    assert values[1:].tolist() == [1.0, 0.5]


def test_panoptic_quality_by_hand() -> None:
    """One column found with IoU 3/4, one missed; one deck found whole; one column invented; the rest unlabelled.

    Points of columns that belong to no instance, the last two, are none together.
    """
    true_class = np.array([1, 1, 1, 1, 1, 1, 2, 2, 255, 0, 1, 1])
    true_instance = np.array([7, 7, 7, 7, 8, 8, 1, 1, 3, 0, 0, 0])
    found_class = np.array([1, 1, 1, 2, 0, 1, 2, 2, 1, 0, 1, 1])
    found_instance = np.array([1, 1, 1, 5, 0, 2, 9, 9, 2, 0, 0, 0])
    counts = count_instances(true_class, true_instance, found_class, found_instance, 4, (0,))
    result = panoptic_quality(counts)
    # Columns: pair 7-1 at 3/4; 8-2 shares 1 of 2, which is not more than half. One hit, one missed, one invented.
    assert result.quality[1] == pytest.approx(0.75 / 2)
    assert result.segmentation[1] == pytest.approx(0.75)
    assert result.recognition[1] == pytest.approx(0.5)
    # Decks: 1-9 whole; instance 5 of one point is invented. Background: 0-0 shares one of two points: no match.
    assert result.quality[2] == pytest.approx(1 / 1.5)
    assert result.quality[0] == 0.0
    assert math.isnan(result.quality[3])
    assert result.mean == pytest.approx((0.375 + 2 / 3 + 0.0) / 3)
    twice = panoptic_quality(counts + counts)  # another cloud of the same kind changes no quality
    for name in ("quality", "segmentation", "recognition"):
        assert getattr(twice, name)[1:3].tolist() == getattr(result, name)[1:3].tolist(), name


@given(SEEDS)
def test_perfect_instances_have_quality_one_whatever_their_numbers(seed: int) -> None:
    """Numbers of instances are names: permuted ones are as good."""
    rng = np.random.default_rng(seed)
    of_class, instance = rng.integers(0, 3, 100), rng.integers(0, 5, 100)
    other = 1 + rng.permutation(5)[instance]
    result = panoptic_quality(count_instances(of_class, instance + 1, of_class, other, 3, ()))
    assert result.mean == 1.0
