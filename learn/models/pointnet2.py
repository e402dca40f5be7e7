"""PointNet++ for semantic segmentation, with one ball (SSG) or several balls (MSG) about each point."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Literal

from pydantic import Field
from torch import Tensor, cat, nn

from groundwork.settings import Settings
from learn.models.backbone import COORD, Geometry
from learn.models.gather import Shared, gather, interpolate, of_neighbors
from learn.models.pooled import pooled
from learn.neighborhoods.pyramids import farthest_pyramid
from learn.neighborhoods.searcher import Points, Rows, Searcher

Ball = tuple[float, int, tuple[int, ...]]
"""Radius [m or 1], neighbors, and the widths of the shared MLP."""

SSG: tuple[tuple[Ball, ...], ...] = (
    ((0.1, 32, (32, 32, 64)),),
    ((0.2, 32, (64, 64, 128)),),
    ((0.4, 32, (128, 128, 256)),),
    ((0.8, 32, (256, 256, 512)),),
)
MSG: tuple[tuple[Ball, ...], ...] = (
    ((0.05, 16, (16, 16, 32)), (0.1, 32, (32, 32, 64))),
    ((0.1, 16, (64, 64, 128)), (0.2, 32, (64, 96, 128))),
    ((0.2, 16, (128, 196, 256)), (0.4, 32, (128, 196, 256))),
    ((0.4, 16, (256, 256, 512)), (0.8, 32, (256, 384, 512))),
)
UP: tuple[tuple[int, ...], ...] = ((128, 128, 128), (256, 128), (256, 256), (256, 256))
"""Widths of the feature propagation that leads up from each level."""
HEAD = 128


class PointNet2Settings(Settings):
    """PointNet++."""

    kind: Literal["pointnet2-ssg", "pointnet2-msg"] = "pointnet2-ssg"
    """ssg: one ball around each point; msg: two."""
    counts: tuple[int, ...] = Field(default=(1024, 256, 64, 16), min_length=2, max_length=4)
    """Number of points of each coarser level; with fewer than four levels, the coarsest are left out."""
    unit: float = Field(default=1.0, gt=0.0, le=1000.0)
    """Factor for the radii 0.1 to 0.8 [m or 1]; 1 is for clouds scaled to a unit cube, as published."""
    dropout: float = Field(default=0.5, ge=0.0, lt=1.0)
    """Dropout of the head: share of its features that a training step leaves out [1]."""


class PointNet2(nn.Module):
    """PointNet++ with neighborhoods from the loader.

    Source: Qi et al., PointNet++, 2017, https://doi.org/10.48550/arXiv.1706.02413, and the authors' segmentation
    network for rooms.
    """

    def __init__(self, settings: PointNet2Settings, inputs: int, classes: int) -> None:
        super().__init__()
        self.settings = settings
        levels = (SSG if settings.kind == "pointnet2-ssg" else MSG)[: len(settings.counts)]
        self.balls = [[(radius * settings.unit, count) for radius, count, _ in balls] for balls in levels]
        relu = nn.ReLU()
        self.down = nn.ModuleList()
        widths = [inputs]
        for balls in levels:
            self.down.append(nn.ModuleList(_mlp((widths[-1] + 3, *mlp), relu) for _, _, mlp in balls))
            widths.append(sum(mlp[-1] for _, _, mlp in balls))
        self.up = nn.ModuleList()
        below = widths[-1]
        for level in reversed(range(len(levels))):
            skip = widths[level] if level else 0  # the finest level uses no inputs, as published
            self.up.append(_mlp((below + skip, *UP[level]), relu))
            below = UP[level][-1]
        self.head = nn.Sequential(Shared(below, HEAD, relu), nn.Dropout(settings.dropout), nn.Linear(HEAD, classes))

    def pyramid(self, coord: Points, search: Searcher[Points, Rows]) -> Mapping[str, Rows]:
        """Choose the points of every level and search their balls.

        Args:
            coord: Positions [m or 1], shape (N, 3), float32; of a batch with an axis in front.
            search: What searches.

        Returns:
            As `learn.neighborhoods.pyramids.farthest_pyramid`: `kept{l}`, shape (points of level l,), `ball{l}_{j}` and
            `up{l}`, shape (rows, neighbors).
        """
        return farthest_pyramid(coord, self.settings.counts, self.balls, search)

    def pyramid_parameters(self) -> object:
        """Return the parameters that determine the pyramid beside the positions."""
        return {"pyramid": "farthest", "counts": self.settings.counts, "balls": self.balls}

    def forward(self, features: Tensor, geometry: Geometry) -> Tensor:
        """Compute logits for every point and class.

        Args:
            features: Inputs [1], shape (B, N, C), float32.
            geometry: Of the B clouds `coord` [m or 1], shape (B, N, 3), float32, and the pyramids, shape (B, rows) or
                (B, rows, neighbors), int64.

        Returns:
            Logits [1], shape (B, N, classes).
        """
        coords, levels = [geometry[COORD]], [features]
        for level, mlps in enumerate(self.down):
            assert isinstance(mlps, nn.ModuleList)
            centers = gather(coords[-1], geometry[f"kept{level}"])
            found = []
            for ring, mlp in enumerate(mlps):
                index = geometry[f"ball{level}_{ring}"]
                offset = gather(coords[-1], index) - centers[:, :, None]
                assert isinstance(mlp, nn.Sequential)
                found.append(pooled(mlp, of_neighbors(mlp[0], levels[-1], offset, index)))
            coords.append(centers)
            levels.append(cat(found, dim=-1))
        values = levels[-1]
        for step, mlp in enumerate(self.up):
            level = len(levels) - 2 - step
            values = interpolate(values, geometry[f"up{level}"], coords[level], coords[level + 1], power=2)
            values = mlp(cat([levels[level], values], dim=-1) if level else values)
        return self.head(values)


def _mlp(widths: tuple[int, ...], activation: nn.Module) -> nn.Sequential:
    return nn.Sequential(*(Shared(a, b, activation) for a, b in pairwise(widths)))
