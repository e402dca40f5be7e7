"""Loss functions: weighted cross-entropy, Lovasz-softmax, and a separate head for noisy points."""

from typing import Literal

import torch
from torch import Tensor
from torch.nn import functional

from learn.sample import UNLABELED

WeightRule = Literal["none", "cube-root", "randla", "sqrt"]

_RANDLA_FLOOR = 0.02  # of the published rule: no class has a weight above 50
_SQRT_FLOOR = 1e-4  # frequencies below one point in 10,000 count as this


def class_weights(counts: Tensor, rule: WeightRule) -> Tensor:
    """Compute class weights from their frequencies f.

    Args:
        counts: Training points of each class, shape (C,).
        rule: none: 1. cube-root: (largest f / f)^(1/3), of PointNet++'s usual training code. randla: 1 / (f + 0.02), of
            RandLA-Net, and so the paper's for it. sqrt: 1 / sqrt(f + 0.0001), scaled so that the mean over the points
            is 1.

    Returns:
        Weights [1], shape (C,), float32; a class without points gets the largest weight of those with points.
    """
    share = counts.double() / counts.sum().clamp(min=1)
    if rule == "none":
        weights = torch.ones_like(share)
    elif rule == "randla":
        weights = 1.0 / (share + _RANDLA_FLOOR)
    elif rule == "cube-root":
        weights = (share.max() / share.clamp(min=1e-12)).pow(1.0 / 3.0)
    else:
        weights = (share + _SQRT_FLOOR).rsqrt()
        weights = weights / (weights * share).sum().clamp(min=1e-12)
    if (counts > 0).any():
        weights = weights.clamp(max=float(weights[counts > 0].max()))
    return weights.float()


def cross_entropy(
    logits: Tensor, labels: Tensor, weights: Tensor | None = None, points: Tensor | None = None, smoothing: float = 0.0
) -> Tensor:
    """Average the cross-entropy over the labeled points, each multiplied by its class weight and its own weight.

    The sum is divided by the number of points, as in RandLA-Net, not by the sum of the weights, as in torch.

    Args:
        logits: Scores [1], shape (P, C).
        labels: Classes, 255 where unknown, shape (P,), int64.
        weights: Of the classes [1], shape (C,), or None.
        points: Of the points [1], shape (P,), or None.
        smoothing: Share of the target that is distributed over all classes [1].

    Returns:
        A number [1], shape (); 0 without a labeled point.
    """
    known = labels != UNLABELED
    target = labels.clamp(max=logits.shape[-1] - 1)
    each = functional.cross_entropy(logits, target, reduction="none", label_smoothing=smoothing)
    if weights is not None:
        each = each * weights[target]
    if points is not None:
        each = each * points
    return (each * known).sum() / known.sum().clamp(min=1)


def lovasz_softmax(logits: Tensor, labels: Tensor) -> Tensor:
    """Average the Lovasz extension of 1 - IoU over the classes that are present.

    Args:
        logits: Scores [1], shape (P, C).
        labels: Classes, 255 where unknown, shape (P,), int64.

    Returns:
        A number [1], shape (); 0 without a labeled point.

    Source: Berman et al., The Lovasz-softmax loss, 2018, algorithm 1.
    """
    known = labels != UNLABELED
    probabilities, target = logits[known].softmax(dim=-1), labels[known]
    present = target.unique()
    if not len(present):
        return logits.sum() * 0.0
    inside = (target == present[:, None]).to(probabilities.dtype)  # all classes at once: on a GPU, launches are dear
    errors, order = (inside - probabilities.t()[present]).abs().sort(dim=1, descending=True)
    return (errors * _jaccard_steps(inside.gather(1, order))).sum(dim=1).mean()


def uncertainty_weights(uncertainty: Tensor, scale: float, form: Literal["gauss", "inverse"] = "gauss") -> Tensor:
    """Weight points by the uncertainty of their position.

    Args:
        uncertainty: Of each point, infinite where the truth shows no surface [m], shape (P,).
        scale: Uncertainty u0 at which the weight is 1/e (gauss) or 1/2 (inverse) [m].
        form: exp(-(u / u0)^2), or 1 / (1 + u / u0).

    Returns:
        Weights [1], shape (P,).
    """
    ratio = uncertainty / scale
    return torch.exp(-ratio.square()) if form == "gauss" else 1.0 / (1.0 + ratio)


def noise_loss(logits: Tensor, labels: Tensor, noisy: int) -> Tensor:
    """Compute the loss of the noise head: a separate output, so that noise does not compete with the components.

    Args:
        logits: Scores [1], shape (P, C); column `noisy` is the head for noise.
        labels: Classes, 255 where unknown, shape (P,), int64.
        noisy: Number of the class of noisy points.

    Returns:
        Mean binary cross-entropy over the labeled points [1], shape (); 0 without one.
    """
    known = labels != UNLABELED
    target = (labels == noisy).to(logits.dtype)
    each = functional.binary_cross_entropy_with_logits(logits[:, noisy], target, reduction="none")
    return (each * known).sum() / known.sum().clamp(min=1)


def components_only(logits: Tensor, labels: Tensor, noisy: int) -> tuple[Tensor, Tensor]:
    """Exclude the noise head: its logits are not in the softmax, and its points have no label.

    Args:
        logits: Shape (P, C).
        labels: Classes, 255 where unknown, shape (P,), int64.
        noisy: Number of the class of noisy points.

    Returns:
        Logits, shape (P, C), -1e9 in column `noisy`; labels, shape (P,), 255 for noisy points.
    """
    column = torch.arange(logits.shape[-1], device=logits.device) == noisy
    return logits.masked_fill(column, -1e9), labels.masked_fill(labels == noisy, UNLABELED)


def merge_noise(logits: Tensor, noisy: int) -> Tensor:
    """Combine the two heads into log-probabilities of all classes: noisy, or not noisy and one of the others.

    Args:
        logits: Shape (…, C); column `noisy` is the head for noise.
        noisy: Number of the class of noisy points.

    Returns:
        Log-probabilities that sum to 1 as probabilities, shape (…, C).
    """
    column = torch.arange(logits.shape[-1], device=logits.device) == noisy
    head = logits[..., noisy : noisy + 1]
    others = logits.masked_fill(column, -1e9).log_softmax(dim=-1) + functional.logsigmoid(-head)
    return torch.where(column, functional.logsigmoid(head), others)


def _jaccard_steps(inside: Tensor) -> Tensor:
    """Compute the increments of 1 - IoU as each further point counts as wrong, worst first; one row for each class."""
    whole = inside.sum(dim=1, keepdim=True)
    loss = 1.0 - (whole - inside.cumsum(dim=1)) / (whole + (1.0 - inside).cumsum(dim=1))
    return torch.cat([loss[:, :1], loss[:, 1:] - loss[:, :-1]], dim=1)
