"""Metrics: all scores of classes from one confusion matrix, and calibration from confidences.

A quotient of zero by zero is NaN and left out of means, never 0: a class that a bridge does not have says nothing about
a network.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from learn.sample import UNLABELED

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Bools = NDArray[np.bool_]

BINS = 15


@dataclass(frozen=True)
class Scores:
    """Scores derived from a confusion matrix.

    Attributes:
        support: True points of each class, shape (C,), int64.
        accuracy: Share of a class's points that were found (recall) [1], shape (C,), float64; NaN without points.
        precision: Share of the points predicted as the class that are right [1], shape (C,), float64; 0 where none is
            predicted although there are some, NaN where the class occurs in neither.
        iou: Intersection over union [1], shape (C,), float64; NaN where the class occurs in neither.
        f1: Harmonic mean of precision and accuracy [1], shape (C,), float64; NaN where the class occurs in neither.
        overall_accuracy: Share of all points that are right [1]; NaN without points.
        mean_accuracy: Mean over the classes with points [1].
        mean_precision: Mean over the classes that occur [1].
        mean_iou: Mean over the classes that occur [1].
        mean_f1: Mean over the classes that occur [1].
        classes_averaged: Number of classes in the mean IoU.
    """

    support: I64
    accuracy: F64
    precision: F64
    iou: F64
    f1: F64
    overall_accuracy: float
    mean_accuracy: float
    mean_precision: float
    mean_iou: float
    mean_f1: float
    classes_averaged: int


def confusion(truth: I64, predicted: I64, classes: int) -> I64:
    """Count how often each class was predicted as each.

    Args:
        truth: True classes, 255 where unknown, shape (N,), int64.
        predicted: Predicted classes, shape (N,), int64.
        classes: Number of classes.

    Returns:
        Counts, true classes in rows and predicted ones in columns, shape (C, C), int64; matrices of several clouds can
        be added.
    """
    known = truth != UNLABELED
    flat = truth[known].astype(np.int64) * classes + predicted[known]
    return np.bincount(flat, minlength=classes * classes).reshape(classes, classes).astype(np.int64)


def scores(matrix: I64) -> Scores:
    """Derive every score from a confusion matrix.

    Args:
        matrix: True classes in rows, predicted ones in columns, shape (C, C), int64.

    Returns:
        The scores.
    """
    right, support, called = np.diag(matrix), matrix.sum(axis=1), matrix.sum(axis=0)
    occurs = support + called > 0
    accuracy = _share(right, support)
    precision = np.where(occurs & (called == 0), 0.0, _share(right, called))
    iou, f1 = _share(right, support + called - right), _share(2 * right, support + called)
    return Scores(
        support=support,
        accuracy=accuracy,
        precision=precision,
        iou=iou,
        f1=f1,
        overall_accuracy=float(_share(right.sum(), matrix.sum())),
        mean_accuracy=_mean(accuracy),
        mean_precision=_mean(precision),
        mean_iou=_mean(iou),
        mean_f1=_mean(f1),
        classes_averaged=int(occurs.sum()),
    )


def mean_iou(matrices: F64 | I64) -> F64:
    """Compute the mean IoU of many confusion matrices at once.

    Args:
        matrices: Confusion matrices [1], shape (…, C, C).

    Returns:
        Mean over the classes that occur [1], shape (…), float64; NaN where none does.
    """
    right = np.diagonal(matrices, axis1=-2, axis2=-1)
    union = matrices.sum(axis=-1) + matrices.sum(axis=-2) - right
    iou = np.where(union > 0, right / np.where(union > 0, union, 1), 0.0)
    count = (union > 0).sum(axis=-1)
    return np.where(count > 0, iou.sum(axis=-1) / np.maximum(count, 1), np.nan)


def calibration_error(confidence: F32, right: Bools, bins: int = BINS) -> float:
    """Compute the expected calibration error: the difference of confidence and accuracy, over bins of equal width.

    Args:
        confidence: Highest class probability of each point [1], shape (N,), float32.
        right: Whether its class is right, shape (N,), bool.
        bins: Number of bins.

    Returns:
        Mean over the points of |mean confidence - share right| of their bin [1]; NaN without points.

    Source: Guo et al., On calibration of modern neural networks, 2017, equation 3.
    """
    if not len(confidence):
        return float("nan")
    counts, said, true = reliability(confidence, right, bins)
    return float(np.abs(said - true).sum() / counts.sum())


def reliability(confidence: F32, right: Bools, bins: int = BINS) -> tuple[I64, F64, F64]:
    """Sum confidences and correct predictions in bins of equal width.

    Args:
        confidence: Highest class probability of each point [1], shape (N,), float32.
        right: Whether its class is right, shape (N,), bool.
        bins: Number of bins.

    Returns:
        Points of each bin, shape (bins,), int64; sum of their confidence [1], shape (bins,), float64; number of right
        ones [1], shape (bins,), float64.
    """
    values = confidence.astype(np.float64)
    bin_of = np.clip(np.ceil(values * bins).astype(np.int64) - 1, 0, bins - 1)
    counts = np.bincount(bin_of, minlength=bins).astype(np.int64)
    said, true = (np.bincount(bin_of, weights, bins).astype(np.float64) for weights in (values, right))
    return counts, said, true


def risk_coverage(confidence: F32, right: Bools, steps: int = 20) -> tuple[F64, F64]:
    """Compute the share of errors among the points with the highest confidences.

    Args:
        confidence: Highest class probability of each point [1], shape (N,), float32.
        right: Whether its class is right, shape (N,), bool.
        steps: Number of coverages.

    Returns:
        Coverages: shares of the points kept, equally spaced up to 1 [1], shape (steps,), float64; risks: shares of
        those that are wrong [1], shape (steps,), float64.
    """
    order = np.argsort(-confidence.astype(np.float64), kind="stable")
    errors = np.cumsum(~right[order])
    coverage = np.arange(1, steps + 1) / steps
    kept = np.maximum(np.ceil(coverage * len(order) - 1e-9).astype(np.int64), 1)
    return coverage, errors[kept - 1] / kept


def confusion_by_threshold(
    truth: I64, predicted: I64, uncertainty: F32, thresholds: Sequence[float], classes: int
) -> I64:
    """Count how often each class was predicted as each, over the points up to each uncertainty.

    Args:
        truth: True classes, 255 where unknown, shape (N,), int64.
        predicted: Predicted classes, shape (N,), int64.
        uncertainty: Of each point [m], shape (N,), float32; NaN counts as above every threshold.
        thresholds: Upper limits of the uncertainty [m], T of them.
        classes: Number of classes.

    Returns:
        Counts, shape (T, C, C), int64.
    """
    kept = (uncertainty <= threshold for threshold in thresholds)
    return np.stack([confusion(truth[rows], predicted[rows], classes) for rows in kept])


def _share(part: NDArray[np.integer], whole: NDArray[np.integer]) -> F64:
    return np.where(whole > 0, part / np.maximum(whole, 1), np.nan)


def _mean(values: F64) -> float:
    present = values[~np.isnan(values)]
    return float(present.mean()) if len(present) else float("nan")


def known_or_none(value: float | np.floating[Any]) -> float | None:
    """Convert a score for JSON, which has no NaN.

    Args:
        value: The score, NaN where it is not defined [1].

    Returns:
        The score [1], or None.
    """
    return None if np.isnan(value) else float(value)
