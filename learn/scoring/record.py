"""Scores of a model as a record for JSON: of all bridges and of each, by uncertainty, and of instances."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from learn.instances import connected_parts
from learn.metrics import (
    calibration_error,
    confusion_by_threshold,
    known_or_none,
    mean_iou,
    reliability,
    risk_coverage,
    scores,
)
from learn.scoring.panoptic import PanopticCounts, count_instances, panoptic_quality
from learn.scoring.votes import ScoredCloud, labeled

F32 = NDArray[np.float32]
I64 = NDArray[np.int64]

FORMAT_VERSION = 3  # 3: added `class_names`, because the keys of a JSON object are sorted
SURE = 0.1  # [m] the paper's threshold, above which a point counts as noisy
THRESHOLDS = (0.01, 0.03, SURE, 0.3, 1.0)  # [m]
_ALL = len(THRESHOLDS)  # index of the matrix of all points, behind those of the thresholds


@dataclass
class Tally:
    """Counts over the clouds of a bridge, or over all clouds.

    Attributes:
        matrices: Confusion up to each threshold, then of all points, shape (T + 1, C, C), int64.
        confidence: Highest class probabilities of the labeled points [1], one array per cloud, shape (P,), float32.
        right: Whether the class of each is right, one array per cloud, shape (P,), bool.
        modeled: Predicted instances compared with the true ones.
        parts: Predicted instances compared with the connected parts of the true classes.
        points: Points that were scored.
        votes: Number of draws that held them, summed.
    """

    matrices: I64
    confidence: list[F32] = field(default_factory=list)
    right: list[NDArray[np.bool_]] = field(default_factory=list)
    modeled: PanopticCounts | None = None
    parts: PanopticCounts | None = None
    points: int = 0
    votes: int = 0

    def __add__(self, other: "Tally") -> "Tally":
        """Add the counts of other clouds."""
        return Tally(
            self.matrices + other.matrices,
            self.confidence + other.confidence,
            self.right + other.right,
            _both(self.modeled, other.modeled),
            _both(self.parts, other.parts),
            self.points + other.points,
            self.votes + other.votes,
        )


def tally_cloud(cloud: ScoredCloud, classes: int, without: Sequence[int], link: float, fewest: int) -> Tally:
    """Count for one cloud what its scores are computed from.

    Args:
        cloud: Predictions for its points.
        classes: Number of classes.
        without: Classes that have no instances.
        link: Points of a class in touching cubes of this side are one instance [m].
        fewest: Least number of points of an instance.
    """
    known = labeled(cloud)
    truth, found = cloud.truth[known], cloud.probabilities[known].argmax(axis=1)
    matrices = confusion_by_threshold(truth, found, cloud.uncertainty[known], THRESHOLDS, classes)
    whole = confusion_by_threshold(truth, found, np.zeros(len(truth), np.float32), (0.0,), classes)
    tally = Tally(np.concatenate([matrices, whole]), points=len(truth), votes=int(cloud.votes[known].sum()))
    tally.confidence.append(cloud.probabilities[known].max(axis=1))
    tally.right.append(found == truth)
    if len(truth):
        places = cloud.coord[known]
        mine = connected_parts(places, found.astype(np.uint8), link, fewest, tuple(without))
        theirs = connected_parts(places, truth.astype(np.uint8), link, fewest, tuple(without))
        tally.parts = count_instances(truth, theirs, found, mine, classes, without)
        instance = np.where(np.isin(truth, without), 0, cloud.instance[known])
        if instance.any():
            tally.modeled = count_instances(truth, instance, found, mine, classes, without)
    return tally


def whole_record(tallies: dict[str, Tally], names: Sequence[str], link: float) -> dict[str, Any]:
    """Return the scores of all bridges and of each.

    Args:
        tallies: Counts of each bridge.
        names: Name of each class.
        link: As for `tally_cloud` [m].

    Returns:
        A record for JSON; an undefined score is null. Rows and columns of `confusion` are in the order of
        `class_names`.
    """
    count = len(names)
    total = sum(tallies.values(), Tally(np.zeros((_ALL + 1, count, count), np.int64)))
    matrix = total.matrices[_ALL]
    support = matrix.sum(axis=1, keepdims=True)
    shares = np.where(support > 0, matrix / np.maximum(support, 1), np.nan)
    confidence, right = _confidences(total)
    coverage, risk = risk_coverage(confidence, right) if len(confidence) else (np.zeros(0), np.zeros(0))
    return {
        "format": "falsework.evaluation",
        "format_version": FORMAT_VERSION,
        "points": total.points,
        "votes": total.votes,
        "class_names": list(names),
        **score_rows(matrix, names),
        "confusion": matrix.tolist(),
        "confusion_shares": [[known_or_none(value) for value in row] for row in shares],
        "calibration_error": known_or_none(calibration_error(confidence, right)),
        "reliability": _reliability(confidence, right),
        "coverage": coverage.tolist(),
        "risk": risk.tolist(),
        "sure": {"uncertainty": SURE, **score_rows(total.matrices[THRESHOLDS.index(SURE)], names)},
        "by_uncertainty": {
            "thresholds": list(THRESHOLDS),
            "points": total.matrices[:_ALL].sum(axis=(1, 2)).tolist(),
            "mean_iou": [known_or_none(value) for value in mean_iou(total.matrices[:_ALL])],
        },
        "panoptic": {"link": link, "modelled": _quality(total.modeled, names), "parts": _quality(total.parts, names)},
        "bridges": {name: _bridge(tally, names) for name, tally in sorted(tallies.items())},
    }


def score_rows(matrix: I64, names: Sequence[str]) -> dict[str, Any]:
    """Return all scores of a confusion matrix.

    Args:
        matrix: True classes in rows, predicted ones in columns, shape (C, C), int64.
        names: Name of each class.

    Returns:
        Scores of each class and their means; those of a class that does not occur are null.
    """
    result = scores(matrix)
    columns = {"accuracy": result.accuracy, "precision": result.precision, "iou": result.iou, "f1": result.f1}
    return {
        "classes": {
            name: {
                "points": int(result.support[number]),
                **{key: known_or_none(v[number]) for key, v in columns.items()},
            }
            for number, name in enumerate(names)
        },
        "overall_accuracy": known_or_none(result.overall_accuracy),
        "mean_accuracy": known_or_none(result.mean_accuracy),
        "mean_precision": known_or_none(result.mean_precision),
        "mean_iou": known_or_none(result.mean_iou),
        "mean_f1": known_or_none(result.mean_f1),
        "classes_averaged": result.classes_averaged,
    }


def _bridge(tally: Tally, names: Sequence[str]) -> dict[str, Any]:
    confidence, right = _confidences(tally)
    return {
        "points": tally.points,
        **score_rows(tally.matrices[_ALL], names),
        "confusion": tally.matrices[_ALL].tolist(),
        "calibration_error": known_or_none(calibration_error(confidence, right)),
        "panoptic": {
            key: _mean_quality(counts) for key, counts in (("modelled", tally.modeled), ("parts", tally.parts))
        },
    }


def _reliability(confidence: F32, right: NDArray[np.bool_]) -> list[dict[str, float]]:
    """Return the accuracy by confidence, in bins; bins without points are left out."""
    return [
        {"points": int(points), "confidence": float(said / points), "accuracy": float(true / points)}
        for points, said, true in zip(*reliability(confidence, right), strict=True)
        if points
    ]


def _confidences(tally: Tally) -> tuple[F32, NDArray[np.bool_]]:
    if not tally.confidence:
        return np.zeros(0, np.float32), np.zeros(0, bool)
    return np.concatenate(tally.confidence), np.concatenate(tally.right)


def _quality(counts: PanopticCounts | None, names: Sequence[str]) -> dict[str, Any] | None:
    if counts is None:
        return None
    result = panoptic_quality(counts)
    return {
        "mean": known_or_none(result.mean),
        "classes": {
            name: {
                "true": int(counts.true[number]),
                "found": int(counts.found[number]),
                "matched": int(counts.hits[number]),
                "quality": known_or_none(result.quality[number]),
                "segmentation": known_or_none(result.segmentation[number]),
                "recognition": known_or_none(result.recognition[number]),
            }
            for number, name in enumerate(names)
        },
    }


def _mean_quality(counts: PanopticCounts | None) -> float | None:
    return None if counts is None else known_or_none(panoptic_quality(counts).mean)


def _both(first: PanopticCounts | None, second: PanopticCounts | None) -> PanopticCounts | None:
    return first + second if first is not None and second is not None else first or second
