"""Scores of a trained model on samples that it never saw."""

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from groundwork.progress import Progress
from learn.metrics import calibration_error, confusion, risk_coverage, scores
from learn.sample import UNLABELLED, Sample, SampleSource

F32 = NDArray[np.float32]

FORMAT_VERSION = 1


class Predicting(Protocol):
    """What can be scored."""

    def probabilities(self, samples: Sequence[Sample]) -> list[F32]:
        """Say how likely each class is at each point.

        Args:
            samples: Clouds as in training.

        Returns:
            For each sample probabilities [1], shape (N, K), float32.
        """
        ...


def evaluate_model(model: Predicting, source: SampleSource, progress: Progress) -> dict[str, Any]:
    """Score a model: one confusion matrix for each bridge, and everything else from these and the confidences.

    Args:
        model: A trained model with the classes of the source.
        source: Samples; drawn with seed 0 where anything is random in them.
        progress: Listener.

    Returns:
        A record for JSON: scores of the whole, matrices of each bridge, calibration. A score of nothing is null.
    """
    count = len(source.classes)
    matrices: dict[str, NDArray[np.int64]] = {}
    sure: list[F32] = []
    right: list[NDArray[np.bool_]] = []
    progress.stage("evaluate", len(source))
    for row in range(len(source)):
        sample = source.sample(row, 0)
        (likely,) = model.probabilities([sample])
        found = likely.argmax(axis=1)
        matrix = matrices.setdefault(source.bridge(row), np.zeros((count, count), np.int64))
        matrix += confusion(sample.labels, found, count)
        known = sample.labels != UNLABELLED
        sure.append(likely.max(axis=1)[known])
        right.append((found == sample.labels)[known])
        progress.advance(row + 1)
    total = sum(matrices.values(), np.zeros((count, count), np.int64))
    result = scores(total)
    confidence, correct = np.concatenate(sure), np.concatenate(right)
    coverage, risk = risk_coverage(confidence, correct) if len(confidence) else (np.zeros(0), np.zeros(0))
    per_class = {
        name: {
            "points": int(result.support[number]), "accuracy": _plain(result.accuracy[number]),
            "precision": _plain(result.precision[number]), "iou": _plain(result.iou[number]),
            "f1": _plain(result.f1[number]),
        }
        for number, name in enumerate(source.classes)
    }  # fmt: skip
    return {
        "format": "falsework.evaluation", "format_version": FORMAT_VERSION, "classes": per_class,
        "overall_accuracy": _plain(result.overall_accuracy), "mean_accuracy": _plain(result.mean_accuracy),
        "mean_precision": _plain(result.mean_precision), "mean_iou": _plain(result.mean_iou),
        "mean_f1": _plain(result.mean_f1), "classes_averaged": result.classes_averaged,
        "calibration_error": _plain(calibration_error(confidence, correct)),
        "coverage": coverage.tolist(), "risk": risk.tolist(), "confusion": total.tolist(),
        "bridges": {name: matrix.tolist() for name, matrix in sorted(matrices.items())},
    }  # fmt: skip


def score_lines(record: dict[str, Any]) -> list[str]:
    """Spell the scores as a table for people.

    Args:
        record: Of `evaluate_model`.

    Returns:
        Lines of text; a class that does not occur has dashes.
    """
    names = ("accuracy", "precision", "iou", "f1")
    lines = [f"{'class':<16}{'points':>10}" + "".join(f"{name:>11}" for name in names)]
    for name, row in record["classes"].items():
        lines.append(f"{name:<16}{row['points']:>10}" + "".join(f"{_figure(row[key]):>11}" for key in names))
    means = ("mean_accuracy", "mean_precision", "mean_iou", "mean_f1")
    lines.append(f"{'mean':<26}" + "".join(f"{_figure(record[key]):>11}" for key in means))
    overall, calibration = _figure(record["overall_accuracy"]), _figure(record["calibration_error"])
    averaged = f"over {record['classes_averaged']} classes that occur"
    lines.append(f"{averaged}; overall accuracy {overall}, calibration error {calibration}")
    return lines


def _plain(value: float) -> float | None:
    return None if np.isnan(value) else float(value)


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.4f}"
