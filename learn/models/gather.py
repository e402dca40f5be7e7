"""Gathering of neighbors' features: rows within each cloud of a batch, channels last."""

import torch
from torch import Tensor, nn
from torch.nn import functional


def gather(values: Tensor, index: Tensor) -> Tensor:
    """Gather rows within each cloud.

    One `index_select` on the flattened batch is several times faster than `gather` along an expanded axis, forwards
    and backwards, and has a deterministic backward on every device.

    Args:
        values: Shape (B, N, C).
        index: Rows, shape (B, M) or (B, M, K), int64.

    Returns:
        Shape (B, M, C) or (B, M, K, C).
    """
    batch, count, channels = values.shape
    first = torch.arange(batch, device=values.device) * count
    flat = index + first.view(-1, *[1] * (index.dim() - 1))
    return values.reshape(-1, channels).index_select(0, flat.reshape(-1)).view(*index.shape, channels)


def interpolate(values: Tensor, index: Tensor, coord: Tensor, known: Tensor, power: int) -> Tensor:
    """Interpolate features at finer points, weighted by a power of the inverse distance.

    Args:
        values: Features of the coarse points, shape (B, M, C).
        index: Nearest coarse points of each fine one, shape (B, N, K), int64.
        coord: Positions of the fine points [m or 1], shape (B, N, 3).
        known: Positions of the coarse points [m or 1], shape (B, M, 3).
        power: 2 in PointNet++, 1 in PointNeXt.

    Returns:
        Features of the fine points, shape (B, N, C).
    """
    squared = (coord[:, :, None] - gather(known, index)).square().sum(-1)
    inverse = 1.0 / ((squared if power == 2 else squared.sqrt()) + 1e-8)
    weights = inverse / inverse.sum(-1, keepdim=True)
    return (gather(values, index) * weights[..., None]).sum(2)


def of_neighbors(layer: nn.Module, features: Tensor, offset: Tensor, index: Tensor) -> Tensor:
    """Apply the linear part of a layer, without its bias, to the offset and the features of each neighbor.

    The features of a point go through the layer once, not once in every neighborhood that holds it.

    Args:
        layer: A `Shared` layer with 3 + C inputs: the offset comes first.
        features: Shape (B, N, C).
        offset: From the centers to their neighbors, shape (B, M, K, 3).
        index: Rows of the neighbors, shape (B, M, K), int64.

    Returns:
        Shape (B, M, K, outputs).
    """
    assert isinstance(layer, Shared)
    weight = layer.linear.weight
    points = gather(functional.linear(features, weight[:, 3:]), index)
    added = torch.addmm(points.flatten(0, 2), offset.flatten(0, 2), weight[:, :3].t())
    return added.view(points.shape)


class Shared(nn.Module):
    """One layer of a shared MLP: linear, batch normalization, activation, the same for every point."""

    def __init__(
        self,
        inputs: int,
        outputs: int,
        activation: nn.Module | None,
        *,
        bias: bool = True,
        epsilon: float = 1e-5,
        momentum: float = 0.1,
    ) -> None:
        super().__init__()
        self.linear = nn.Linear(inputs, outputs, bias=bias)
        self.norm = nn.BatchNorm1d(outputs, eps=epsilon, momentum=momentum)
        self.activation = activation

    def forward(self, values: Tensor) -> Tensor:
        """Apply the layer to the last axis.

        Args:
            values: Shape (…, inputs).

        Returns:
            Shape (…, outputs).
        """
        return self.behind(functional.linear(values, self.linear.weight))

    def behind(self, values: Tensor) -> Tensor:
        """Apply bias, normalization and activation to the output of the linear part without its bias.

        In training the bias is left out, because normalization subtracts it with the mean of the batch. It only changes
        the running mean, and its gradient is zero. Adding it to every row and summing its gradient takes a tenth of a
        step.

        Args:
            values: Shape (…, outputs).

        Returns:
            Shape (…, outputs).
        """
        rows = values.reshape(-1, values.shape[-1])
        bias = self.linear.bias
        if self.norm.training:
            rows = _normalized(rows, bias, self.norm)
        else:
            rows = self.norm(rows if bias is None else rows + bias)
        return (rows if self.activation is None else self.activation(rows)).view(values.shape)


def _normalized(rows: Tensor, bias: Tensor | None, norm: nn.BatchNorm1d) -> Tensor:
    """Normalize in training as if a bias had been added to the rows."""
    if bias is None:
        return norm(rows)
    assert norm.running_mean is not None
    assert norm.num_batches_tracked is not None
    mean = norm.running_mean - bias.detach()
    after = norm.bias + 0.0 * bias  # so that the bias has a gradient of zero
    found = functional.batch_norm(
        rows,
        mean,
        norm.running_var,
        norm.weight,
        after,
        True,
        norm.momentum or 0.0,
        norm.eps,
    )
    norm.running_mean.copy_(mean + bias.detach())
    norm.num_batches_tracked += 1
    return found
