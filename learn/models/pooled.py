"""The last layer over a neighborhood and its maximum: in training only the maximum is normalized."""

from collections.abc import Iterable
from typing import Any

import torch
from torch import Tensor, nn

from learn.models.gather import Shared


def pooled(layers: Iterable[nn.Module], begun: Tensor) -> Tensor:
    """Apply a shared MLP to neighborhoods, and take the maximum over each.

    Normalization and activation are monotonic, so the maximum can be taken before them, which saves time in training.
    In evaluation and under autocast, all steps run in the usual order.

    Args:
        layers: `Shared` layers, at least one; the last has ReLU or no activation.
        begun: Output of the linear part of the first layer, as from `of_neighbors`, shape (B, M, K, outputs).

    Returns:
        Shape (B, M, outputs).
    """
    last, *others = (layer for layer in layers if isinstance(layer, Shared))
    for layer in others:
        begun = nn.functional.linear(last.behind(begun), layer.linear.weight)
        last = layer
    if not last.norm.training or torch.is_autocast_enabled(begun.device.type):
        return last.behind(begun).max(dim=2).values
    norm, linear = last.norm, last.linear
    assert norm.running_mean is not None
    assert norm.num_batches_tracked is not None
    rows = begun.flatten(0, 1)
    bias, shift = norm.bias, torch.zeros_like(norm.running_mean)
    if linear.bias is not None:  # as in `Shared`: it only changes the running mean
        bias, shift = norm.bias + 0.0 * linear.bias, linear.bias.detach()
    mean = norm.running_mean - shift
    found: Tensor = _PooledNorm.apply(rows, norm.weight, bias, mean, norm.running_var, norm.momentum, norm.eps)
    norm.running_mean.copy_(mean + shift)
    norm.num_batches_tracked += 1
    found = found.view(*begun.shape[:2], -1)
    return found if last.activation is None else last.activation(found)


class _PooledNorm(torch.autograd.Function):
    """Batch normalization over all rows, and the maximum over the second axis."""

    @staticmethod  # many: torch passes the arguments by position
    def forward(
        ctx: Any,
        rows: Tensor,
        weight: Tensor,
        bias: Tensor,
        running_mean: Tensor,
        running_var: Tensor,
        momentum: float,
        epsilon: float,
    ) -> Tensor:
        flat = rows.view(-1, rows.shape[-1])
        mean, variance = torch.batch_norm_update_stats(flat, running_mean, running_var, momentum)
        inverse = (variance + epsilon).rsqrt()
        top, place = rows.max(dim=1)
        falling = weight < 0
        if bool(falling.any()):
            low, lowest = rows.min(dim=1)
            top, place = torch.where(falling, low, top), torch.where(falling, lowest, place)
        normal = (top - mean) * inverse
        ctx.save_for_backward(rows, place, normal, weight, mean, inverse)
        return normal * weight + bias

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor | None, ...]:
        rows, place, normal, weight, mean, inverse = ctx.saved_tensors
        (above,) = gradients
        of_bias, of_weight = above.sum(dim=0), (above * normal).sum(dim=0)
        count = rows.shape[0] * rows.shape[1]
        # gradient of every row through mean and variance, and of the maxima from above
        slope = -of_weight * inverse * inverse * weight / count
        level = -of_bias * inverse * weight / count - slope * mean
        whole = torch.addcmul(level, rows, slope)
        at = place[:, None]
        whole.scatter_(1, at, whole.gather(1, at) + (above * (inverse * weight))[:, None])
        return whole, of_weight, of_bias, None, None, None, None
