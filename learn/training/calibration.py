"""The temperature of a model's confidence, fitted on samples of bridges that it was not trained on."""

from collections.abc import Callable, Sequence

import numpy as np
import torch
from scipy.optimize import minimize_scalar
from torch import Tensor

MOST_POINTS = 200_000
"""Labeled points that are enough to fit a temperature."""


def fit_temperature(scores: Tensor, labels: Tensor, probabilities: Callable[[Tensor, float], Tensor]) -> float:
    """Find the temperature that maximizes the likelihood of the labels, to three digits.

    Args:
        scores: Logits of each point [1], shape (N, K).
        labels: Its true class, shape (N,), int64.
        probabilities: Makes probabilities [1], shape (N, K), of scores and a temperature [1].

    Returns:
        The temperature [1]; 1 without points.
    """
    if not len(labels):
        return 1.0

    def loss(power: float) -> float:
        likely = probabilities(scores, float(np.exp(power))).gather(1, labels[:, None])
        return -float(likely.clamp(min=1e-12).log().mean())

    found = minimize_scalar(loss, bounds=(np.log(0.05), np.log(20.0)), method="bounded").x
    return float(f"{np.exp(found):.3g}")


def gather_scores(
    rows: Sequence[int], score: Callable[[int], tuple[Tensor, Tensor]], most: int = MOST_POINTS
) -> tuple[Tensor, Tensor] | None:
    """Score samples that are spread evenly over all of them, until there are enough labeled points.

    Args:
        rows: Numbers of the samples; neighbors show the same bridge.
        score: Returns logits [1], shape (n, K), and true classes, shape (n,), int64, of the labeled points of a sample.
        most: Points that are enough.

    Returns:
        Logits [1], shape (N, K), and true classes, shape (N,), int64, in the order of `rows`; None without a point.

    Source: Van der Corput, Verteilungsfunktionen, 1935: any beginning of the order is spread evenly.
    """
    width = max(len(rows) - 1, 1).bit_length()
    order = sorted(range(len(rows)), key=lambda place: f"{place:0{width}b}"[::-1])
    found: dict[int, tuple[Tensor, Tensor]] = {}
    count = 0
    for place in order:
        found[place] = score(rows[place])
        count += len(found[place][1])
        if count >= most:
            break
    if not count:
        return None
    logits, labels = zip(*(found[place] for place in sorted(found)), strict=True)
    return torch.cat(logits), torch.cat(labels)
