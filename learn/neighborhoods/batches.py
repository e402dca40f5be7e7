"""Neighborhoods of a batch of clouds at once, with torch: made for a GPU, where all distances cost less than a tree.

What is found is what float64 finds, as on the processor; rows may differ where two points are equally far.
"""

from dataclasses import dataclass
from subprocess import SubprocessError

import numpy as np
import torch
from torch import Tensor

from learn.neighborhoods.farthest import need_points

MANY = 16_384
"""Points of a cloud beyond which a GPU needs longer for all distances than some cores of a processor for trees."""

_DISTANCES = 1 << 27  # at a time: half a gigabyte
_SPARE = 8  # more points than that are not equally far in float32
_ONE_BLOCK = 8192  # points that a processor of a GPU holds in its registers


@dataclass(frozen=True)
class Batches:
    """Searches in all clouds of a batch; a `learn.neighborhoods.searcher.Searcher`."""

    def count(self, coord: Tensor) -> int:
        """Count the points of each cloud.

        Args:
            coord: Positions [m or 1], shape (B, N, 3), float32.
        """
        return coord.shape[1]

    def take(self, coord: Tensor, rows: Tensor) -> Tensor:
        """Take some points of each cloud.

        Args:
            coord: Positions [m or 1], shape (B, N, 3), float32.
            rows: Their row numbers, shape (B, M), int64.

        Returns:
            Their positions [m or 1], shape (B, M, 3), float32.
        """
        return coord.gather(1, rows[..., None].expand(-1, -1, 3))

    def first(self, coord: Tensor, count: int) -> Tensor:
        """Number the first points of each cloud.

        Args:
            coord: Positions [m or 1], shape (B, N, 3), float32.
            count: How many.

        Returns:
            Row numbers, shape (B, count), int64.
        """
        return torch.arange(min(count, coord.shape[1]), device=coord.device).expand(len(coord), -1)

    def shuffled(self, coord: Tensor, count: int, seed: int) -> Tensor:
        """Choose random points, the same rows in every cloud.

        Args:
            coord: Positions [m or 1], shape (B, N, 3), float32.
            count: How many.
            seed: Seed of the choice.

        Returns:
            Row numbers, shape (B, count), int64.
        """
        rows = np.random.default_rng([seed, coord.shape[1]]).permutation(coord.shape[1])[:count]
        return torch.from_numpy(rows.astype(np.int64)).to(coord.device).expand(len(coord), -1)

    def farthest(self, coord: Tensor, count: int) -> Tensor:
        """Choose points by farthest point sampling, beginning with point 0.

        Args:
            coord: Positions [m or 1], shape (B, N, 3), float32.
            count: How many.

        Returns:
            Rows in the order of choice, shape (B, count), int64.

        Raises:
            InputError: Fewer points than `count`.
        """
        need_points(coord.shape[1], max(count, 1))
        in_one_launch = coord.is_cuda and coord.shape[1] <= _ONE_BLOCK
        return farthest_by_kernel(coord, count) if in_one_launch else farthest_in_turn(coord, count)

    def ball(self, coord: Tensor, centers: Tensor, radius: float, count: int) -> Tensor:
        """Find the points within a ball about each center, nearest first; missing ones are the first one again.

        Args:
            coord: Positions [m or 1], shape (B, N, 3), float32.
            centers: Centers [m or 1], shape (B, M, 3), float32.
            radius: Of the balls, points on the surface included [m or 1].
            count: Entries of a row.

        Returns:
            Rows, shape (B, M, count), int64.
        """
        distances, rows = _nearest(coord, centers, min(count, coord.shape[1]))
        rows = torch.where(distances <= radius, rows, rows[..., :1])
        missing = count - rows.shape[-1]
        return rows if missing <= 0 else torch.cat([rows, rows[..., :1].expand(-1, -1, missing)], dim=-1)

    def nearest(self, coord: Tensor, centers: Tensor, count: int) -> Tensor:
        """Find the k nearest points of each center, nearest first.

        Args:
            coord: Positions [m or 1], shape (B, N, 3), float32.
            centers: Centers [m or 1], shape (B, M, 3), float32.
            count: Neighbors of each.

        Returns:
            Rows, shape (B, M, count), int64.

        Raises:
            InputError: Fewer points than neighbors.
        """
        need_points(coord.shape[1], count)
        return _nearest(coord, centers, count)[1]


def farthest_by_kernel(coord: Tensor, count: int) -> Tensor:
    """Choose points by farthest point sampling in one launch, or one after the other where Triton cannot compile it.

    Torch comes without Triton on some systems, and Triton needs a C compiler and Python's headers.

    Args:
        coord: Positions on a GPU [m or 1], shape (B, N, 3), float32.
        count: How many, 1 to N.

    Returns:
        Rows in the order of choice, shape (B, count), int64.
    """
    try:
        from learn.neighborhoods.farthest_kernel import farthest_on_gpu

        return farthest_on_gpu(coord, count)
    except (ImportError, OSError, RuntimeError, SubprocessError):
        return farthest_in_turn(coord, count)


def farthest_in_turn(coord: Tensor, count: int) -> Tensor:
    """Choose points by farthest point sampling, one after the other in all clouds.

    Args:
        coord: Positions [m or 1], shape (B, N, 3), float32.
        count: How many, 1 to N.

    Returns:
        Rows in the order of choice, shape (B, count), int64.
    """
    x, y, z = coord.double().unbind(-1)
    nearest = torch.full_like(x, torch.inf)
    chosen = torch.zeros((len(coord), count), dtype=torch.int64, device=coord.device)
    for step in range(1, count):
        last = chosen[:, step - 1 : step]
        dx, dy, dz = (axis - axis.gather(1, last) for axis in (x, y, z))
        nearest = torch.minimum(nearest, dx * dx + dy * dy + dz * dz)
        chosen[:, step] = nearest.argmax(dim=1)
    return chosen


def _nearest(coord: Tensor, centers: Tensor, count: int) -> tuple[Tensor, Tensor]:
    """Find the nearest points: distances, float64, and rows, shape (B, M, count); nearest first.

    A few more than these are found among all, in float32, which takes a third of the time; float64 orders them.
    """
    batch, size, _ = coord.shape
    flat, first = coord.double().reshape(-1, 3), torch.arange(batch, device=coord.device)[:, None, None] * size
    x, y, z = coord[:, None].unbind(-1)
    distances, rows = [], []
    for part in centers.split(max(1, _DISTANCES // max(1, batch * size)), dim=1):
        own_x, own_y, own_z = part[:, :, None].unbind(-1)
        rough = (x - own_x).square_().add_((y - own_y).square_()).add_((z - own_z).square_())
        near = rough.topk(min(count + _SPARE, size), dim=-1, largest=False, sorted=False).indices
        apart = flat.index_select(0, (near + first).flatten()).view(*near.shape, 3) - part[:, :, None].double()
        exact, order = apart.square().sum(-1).sort(dim=-1)
        distances.append(exact[..., :count].sqrt())
        rows.append(near.gather(-1, order)[..., :count])
    return torch.cat(distances, dim=1), torch.cat(rows, dim=1)
