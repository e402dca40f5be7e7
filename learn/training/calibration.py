"""The temperature of a model's confidence, fitted on samples of bridges that it was not trained on."""

from collections.abc import Callable

import numpy as np
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
