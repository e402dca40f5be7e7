"""The published networks written out literally: Conv2d over (batch, channels, points, neighbors), brute force.

Slow on purpose and independent of `learn`: nothing but the weights is taken from the networks under test, layer after
layer in the order in which the papers describe them.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import torch
from torch import Tensor, nn

from learn.models.gather import Shared
from learn.models.pointnext import PointNext


class Weights:
    """Hands out the layers of a network in order, as convolutions."""

    def __init__(self, network: nn.Module) -> None:
        """Collect the layers."""
        inside = {id(m.linear) for m in network.modules() if isinstance(m, Shared)}
        self._layers: Iterator[nn.Module] = iter(
            [m for m in network.modules() if isinstance(m, Shared | nn.Linear) and id(m) not in inside]
        )

    def conv(self, values: Tensor, outputs: int, slope: float | None, epsilon: float = 1e-5) -> Tensor:
        """Convolution, batch normalisation with stored statistics, and (leaky) ReLU unless the slope is None."""
        layer = next(self._layers)
        assert isinstance(layer, Shared)
        conv = nn.Conv2d(values.shape[1], outputs, 1, bias=layer.linear.bias is not None)
        norm = nn.BatchNorm2d(outputs, eps=epsilon)
        conv.load_state_dict(
            {k: v.reshape(*v.shape, *[1, 1][: 2 * (v.dim() - 1)]) for k, v in layer.linear.state_dict().items()}
        )
        norm.load_state_dict(layer.norm.state_dict())
        found = norm.eval()(conv(values))
        return found if slope is None else torch.where(found > 0, found, slope * found)

    def dense(self, values: Tensor, outputs: int, *, bias: bool = True) -> Tensor:
        """Convolution alone."""
        layer = next(self._layers)
        assert isinstance(layer, nn.Linear)
        conv = nn.Conv2d(values.shape[1], outputs, 1, bias=bias)
        conv.load_state_dict(
            {k: v.reshape(*v.shape, *[1, 1][: 2 * (v.dim() - 1)]) for k, v in layer.state_dict().items()}
        )
        return conv(values)

    def finished(self) -> bool:
        """Tell whether every layer was used."""
        return next(self._layers, None) is None


def distances(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Every distance, in double precision."""
    return np.linalg.norm(a[:, None].astype(np.float64) - b[None], axis=-1)


def farthest(coord: np.ndarray, count: int) -> np.ndarray:
    """Farthest point sampling, the textbook loop."""
    chosen, apart = [0], np.full(len(coord), np.inf)
    while len(chosen) < count:
        apart = np.minimum(apart, distances(coord, coord[chosen[-1:]])[:, 0])
        chosen.append(int(np.argmax(apart)))
    return np.array(chosen)


def ball(coord: np.ndarray, centers: np.ndarray, radius: float, count: int) -> np.ndarray:
    """The nearest points within a radius, filled up with the first."""
    rows = []
    for row in distances(centers, coord):
        inside = [i for i in np.argsort(row, kind="stable") if row[i] <= radius][:count]
        rows.append(inside + inside[:1] * (count - len(inside)))
    return np.array(rows)


def around(values: Tensor, rows: np.ndarray) -> Tensor:
    """(1, C, N, 1) values at rows (M, K) as (1, C, M, K)."""
    return values[:, :, torch.from_numpy(rows), 0]


def as_map(rows: np.ndarray | Tensor) -> Tensor:
    """(N, C) as (1, C, N, 1)."""
    return torch.as_tensor(np.asarray(rows)).float().T[None, :, :, None]


def blend(fine: np.ndarray, coarse: np.ndarray, values: Tensor, power: int) -> Tensor:
    """The three nearest coarse points' features, by inverse distance to a power."""
    apart = distances(fine, coarse)
    rows = np.argsort(apart, axis=1)[:, :3]
    weight = 1.0 / (np.take_along_axis(apart, rows, 1) ** power + 1e-8)
    weight /= weight.sum(axis=1, keepdims=True)
    return (around(values, rows) * torch.from_numpy(weight).float()).sum(dim=3, keepdim=True)


SSG = [
    [(0.1, 32, [32, 32, 64])],
    [(0.2, 32, [64, 64, 128])],
    [(0.4, 32, [128, 128, 256])],
    [(0.8, 32, [256, 256, 512])],
]
MSG = [
    [(0.05, 16, [16, 16, 32]), (0.1, 32, [32, 32, 64])],
    [(0.1, 16, [64, 64, 128]), (0.2, 32, [64, 96, 128])],
    [(0.2, 16, [128, 196, 256]), (0.4, 32, [128, 196, 256])],
    [(0.4, 16, [256, 256, 512]), (0.8, 32, [256, 384, 512])],
]


def pointnet2(network: nn.Module, table: list, features: np.ndarray, coord: np.ndarray, classes: int) -> Tensor:
    """PointNet++: four set abstractions, four feature propagations, one head; logits (N, classes)."""
    weights = Weights(network)
    places, levels = [coord], [as_map(features)]
    for count, rings in zip((1024, 256, 64, 16), table, strict=True):
        centers = places[-1][farthest(places[-1], count)]
        pooled = []
        for radius, neighbors, mlp in rings:
            rows = ball(places[-1], centers, radius, neighbors)
            offset = around(as_map(places[-1]), rows) - as_map(centers)
            values = torch.cat([offset, around(levels[-1], rows)], dim=1)
            for width in mlp:
                values = weights.conv(values, width, 0.0)
            pooled.append(values.max(dim=3, keepdim=True).values)
        places.append(centers)
        levels.append(torch.cat(pooled, dim=1))
    values = levels[4]
    for level, mlp in ((3, [256, 256]), (2, [256, 256]), (1, [256, 128]), (0, [128, 128, 128])):
        values = blend(places[level], places[level + 1], values, 2)
        if level > 0:
            values = torch.cat([levels[level], values], dim=1)
        for width in mlp:
            values = weights.conv(values, width, 0.0)
    logits = weights.dense(weights.conv(values, 128, 0.0), classes)
    assert weights.finished()
    return logits[0, :, :, 0].T


def pointnext(network: PointNext, blocks: list[int], features: np.ndarray, coord: np.ndarray, classes: int) -> Tensor:
    """PointNeXt of width 32: S where `blocks` are all zero, else residual blocks behind each set abstraction."""
    # The shortcuts and blocks are modules of their own: each stage takes its layers from its own part of the network.
    down, repeated = network.down, network.blocks
    small = not any(blocks)
    places, levels, radius = [coord], [Weights(nn.ModuleList([network.stem])).dense(as_map(features), 32)], 0.1
    for stage, width in enumerate((64, 128, 256, 512)):
        weights = Weights(down[stage])
        kept = farthest(places[-1], len(places[-1]) // 4)
        centers = places[-1][kept]
        rows = ball(places[-1], centers, radius, 32)
        offset = (around(as_map(places[-1]), rows) - as_map(centers)) / radius
        values = torch.cat([offset, around(levels[-1], rows)], dim=1)
        if small:
            values = weights.conv(weights.conv(values, width // 2, 0.0), width, None).max(dim=3, keepdim=True).values
            values = torch.relu(values + weights.dense(around(levels[-1], kept[:, None]), width))
        else:
            values = weights.conv(values, width, 0.0).max(dim=3, keepdim=True).values
        assert weights.finished()
        radius *= 2
        own = repeated[stage]
        assert isinstance(own, nn.ModuleList)
        assert len(own) == blocks[stage]
        for block in own:
            weights = Weights(block)
            rows = ball(centers, centers, radius, 32)
            offset = (around(as_map(centers), rows) - as_map(centers)) / radius
            inner = weights.conv(torch.cat([offset, around(values, rows)], dim=1), width, 0.0)
            inner = weights.conv(inner.max(dim=3, keepdim=True).values, 4 * width, 0.0)
            values = torch.relu(weights.conv(inner, width, None) + values)
            assert weights.finished()
        places.append(centers)
        levels.append(values)
    weights = Weights(nn.ModuleList([network.up, network.head]))
    values = levels[4]
    for level, width in ((3, 256), (2, 128), (1, 64), (0, 32)):
        values = torch.cat([levels[level], blend(places[level], places[level + 1], values, 1)], dim=1)
        values = weights.conv(weights.conv(values, width, 0.0), width, 0.0)
    logits = weights.dense(weights.conv(values, 32, 0.0), classes)
    assert weights.finished()
    return logits[0, :, :, 0].T


def randlanet(
    network: nn.Module, widths: list[int], kept: list[np.ndarray], features: np.ndarray, coord: np.ndarray, classes: int
) -> Tensor:
    """RandLA-Net with the random choice of points given; logits (N, classes)."""
    eps, slope = 1e-6, 0.2
    weights = Weights(network)
    values = weights.conv(as_map(features), 8, slope, eps)
    places, skips = [coord], []
    for level, width in enumerate(widths):
        here = places[-1]
        rows = np.argsort(distances(here, here), axis=1, kind="stable")[:, :16]
        middle = as_map(here).expand(-1, -1, -1, 16)
        beside = around(as_map(here), rows)
        apart = (middle - beside).square().sum(dim=1, keepdim=True).sqrt()
        place = torch.cat([apart, middle - beside, middle, beside], dim=1)
        before = values
        values = weights.conv(values, width // 2, slope, eps)
        place = weights.conv(place, width // 2, slope, eps)
        for outputs in (width // 2, width):
            if outputs == width:
                place = weights.conv(place, width // 2, slope, eps)
            seen = torch.cat([around(values, rows), place], dim=1)
            share = torch.softmax(weights.dense(seen, width, bias=False), dim=3)
            values = weights.conv((seen * share).sum(dim=3, keepdim=True), outputs, slope, eps)
        values = weights.conv(values, 2 * width, None, eps) + weights.conv(before, 2 * width, None, eps)
        values = torch.where(values > 0, values, slope * values)
        if level == 0:
            skips.append(values)
        values = around(values, rows[kept[level]]).max(dim=3, keepdim=True).values
        places.append(here[kept[level]])
        skips.append(values)
    values = weights.conv(skips.pop(), 2 * widths[-1], slope, eps)
    for level in reversed(range(len(widths))):
        skip = skips.pop()
        up = np.argmin(distances(places[level], places[level + 1]), axis=1)
        values = weights.conv(torch.cat([skip, around(values, up[:, None])], dim=1), skip.shape[1], slope, eps)
    values = weights.conv(weights.conv(values, 64, slope, eps), 32, slope, eps)
    logits = weights.dense(values, classes)
    assert weights.finished()
    return logits[0, :, :, 0].T
