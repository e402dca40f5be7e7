"""Predictions for every point of a cloud: the mean over the draws and tiles that hold it, as in `falsework predict`."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from groundwork.progress import Progress
from learn.sample import UNLABELED, Sample, ScoredSource, Truth

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_BATCH = 8  # samples per call of the model


class Predicting(Protocol):
    """Interface of a model that can be scored."""

    def probabilities(self, samples: Sequence[Sample]) -> list[F32]:
        """Compute the probability of each class at each point.

        Args:
            samples: Clouds as in training.

        Returns:
            For each sample probabilities [1], shape (N, K), float32.
        """
        ...


@dataclass(frozen=True, eq=False)
class ScoredCloud:
    """The points of a cloud that occur in any sample, each once.

    Attributes:
        bridge: Its bridge.
        truth: True classes, 255 where unknown, shape (P,), int64.
        probabilities: Mean predicted probabilities [1], shape (P, K), float32.
        coord: Positions [m], shape (P, 3), float64.
        uncertainty: NaN where unknown [m], shape (P,), float32.
        instance: True instances, 0 for none, shape (P,), int64.
        votes: Draws that held each point, shape (P,), int64.
    """

    bridge: str
    truth: I64
    probabilities: F32
    coord: F64
    uncertainty: F32
    instance: I64
    votes: I64


class _Ballot:
    """Sums over the points of one cloud; it grows to the highest row so far."""

    def __init__(self, bridge: str, classes: int) -> None:
        self.bridge = bridge
        self._total = np.zeros((0, classes), np.float32)
        self._votes, self._label, self._instance = np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0, np.int64)
        self._uncertainty, self._coord = np.zeros(0, np.float32), np.zeros((0, 3))

    def add(self, truth: Truth, labels: I64, probabilities: F32) -> None:
        """Add the predictions of a sample; a point that a filled-up draw holds twice counts twice."""
        self._reach(int(truth.row.max(initial=-1)) + 1)
        np.add.at(self._total, truth.row, probabilities)
        np.add.at(self._votes, truth.row, 1)
        self._label[truth.row], self._instance[truth.row] = labels, truth.instance
        self._uncertainty[truth.row], self._coord[truth.row] = truth.uncertainty, truth.coord

    def _reach(self, count: int) -> None:
        more = max(count, 2 * len(self._votes)) - len(self._votes) if count > len(self._votes) else 0
        if not more:
            return
        for name in ("_total", "_votes", "_label", "_instance", "_uncertainty", "_coord"):
            former = getattr(self, name)
            setattr(self, name, np.concatenate([former, np.zeros((more, *former.shape[1:]), former.dtype)]))

    def close(self) -> ScoredCloud:
        """Return the means of the points that occurred."""
        rows = np.flatnonzero(self._votes)
        votes = self._votes[rows]
        return ScoredCloud(
            self.bridge,
            self._label[rows],
            self._total[rows] / votes[:, None].astype(np.float32),
            self._coord[rows],
            self._uncertainty[rows],
            self._instance[rows],
            votes,
        )


def scored_clouds(model: Predicting, source: ScoredSource, progress: Progress) -> Iterator[ScoredCloud]:
    """Predict every sample of a source, and yield its clouds one by one.

    Args:
        model: A model with the classes of the source.
        source: Samples; those of one cloud are consecutive.
        progress: Listener.

    Yields:
        The clouds.
    """
    progress.stage("evaluate", len(source))
    ballot, now = None, -1
    for first in range(0, len(source), _BATCH):
        rows = range(first, min(first + _BATCH, len(source)))
        samples = [source.sample(row, 0) for row in rows]
        for row, sample, probabilities in zip(rows, samples, model.probabilities(samples), strict=True):
            truth = source.truth(row)
            if ballot is None or truth.cloud != now:
                if ballot is not None:
                    yield ballot.close()
                ballot, now = _Ballot(source.bridge(row), probabilities.shape[1]), truth.cloud
            ballot.add(truth, sample.labels, probabilities)
        progress.advance(rows[-1] + 1)
    if ballot is not None:
        yield ballot.close()


def labeled(cloud: ScoredCloud) -> NDArray[np.bool_]:
    """Tell which points of a cloud have a true class.

    Args:
        cloud: The cloud.

    Returns:
        Whether each has, shape (P,), bool.
    """
    return cloud.truth != UNLABELED
