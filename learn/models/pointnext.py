"""PointNeXt: PointNet++ with residual connections, inverted bottlenecks and offsets measured in radii."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Literal

from pydantic import Field
from torch import Tensor, cat, nn

from groundwork.settings import Settings
from learn.models.backbone import COORD, Geometry
from learn.models.gather import Shared, gather, interpolate, of_neighbors
from learn.models.pooled import pooled
from learn.neighborhoods.farthest import need_points
from learn.neighborhoods.pyramids import INTERPOLATED, add_own_balls, farthest_pyramid
from learn.neighborhoods.searcher import Points, Rows, Searcher

STRIDE = 4
LEVELS = 4
EXPANSION = 4
_BLOCKS = {"pointnext-s": (0, 0, 0, 0), "pointnext-b": (1, 2, 1, 1)}  # residual blocks after each set abstraction


class PointNextSettings(Settings):
    """PointNeXt."""

    kind: Literal["pointnext-s", "pointnext-b"] = "pointnext-s"
    """s: two layers and a shortcut in each set abstraction; b: one layer, and residual blocks after it."""
    width: int = Field(default=32, ge=4, le=256)
    """Number of features of the finest level; each coarser level has twice as many."""
    radius: float = Field(default=0.1, gt=0.0, le=1000.0)
    """Radius of the first ball [m or 1], doubled at each level: 0.1 for points 0.04 apart, as published."""
    neighbours: int = Field(default=32, ge=2, le=128)
    """Number of points of a ball."""
    dropout: float = Field(default=0.5, ge=0.0, lt=1.0)
    """Dropout of the head: share of its features that a training step leaves out [1]."""


class PointNext(nn.Module):
    """PointNeXt-S and -B for semantic segmentation, as configured for rooms.

    Source: Qian et al., PointNeXt, 2022, https://doi.org/10.48550/arXiv.2206.04670, and the authors' settings.
    """

    def __init__(self, settings: PointNextSettings, inputs: int, classes: int) -> None:
        super().__init__()
        self.settings = settings
        small = settings.kind == "pointnext-s"
        widths = [settings.width * 2**level for level in range(LEVELS + 1)]
        self.stem = nn.Linear(inputs, widths[0])
        self.down = nn.ModuleList()
        self.blocks = nn.ModuleList()
        for level, (width, wider) in enumerate(pairwise(widths)):
            radius = self.radius(level)
            self.down.append(SetAbstraction(width, wider, radius, small))
            count = _BLOCKS[settings.kind][level]
            self.blocks.append(nn.ModuleList(InvertedResidual(wider, 2 * radius) for _ in range(count)))
        self.up = nn.ModuleList()
        for width, wider in reversed(list(pairwise(widths))):
            self.up.append(nn.Sequential(_layer(width + wider, width), _layer(width, width)))
        self.head = nn.Sequential(
            _layer(widths[0], widths[0]), nn.Dropout(settings.dropout), nn.Linear(widths[0], classes)
        )

    def radius(self, level: int) -> float:
        """Return the radius of the balls of a level.

        Args:
            level: 0 for the first set abstraction.

        Returns:
            Radius [m or 1]; the residual blocks behind it use twice the radius.
        """
        return self.settings.radius * 2**level

    def pyramid(self, coord: Points, search: Searcher[Points, Rows]) -> Mapping[str, Rows]:
        """Choose the points of every level and search their balls.

        Args:
            coord: Positions [m or 1], shape (N, 3), float32; of a batch with an axis in front.
            search: What searches.

        Returns:
            As `learn.neighborhoods.pyramids.farthest_pyramid`: `kept{l}`, shape (points of level l,), `ball{l}_{j}` and
            `up{l}`, shape (rows, neighbors); with `own{l}` of `add_own_balls` where residual blocks need them.

        Raises:
            InputError: Too few points for the coarsest level.
        """
        points = search.count(coord)
        need_points(points, INTERPOLATED * STRIDE**LEVELS)
        counts = [points // STRIDE ** (level + 1) for level in range(LEVELS)]
        near = self.settings.neighbours
        arrays = farthest_pyramid(coord, counts, [[(self.radius(level), near)] for level in range(LEVELS)], search)
        if self.settings.kind == "pointnext-s":
            return arrays
        return add_own_balls(arrays, coord, LEVELS, [(2 * self.radius(level), near) for level in range(LEVELS)], search)

    def pyramid_parameters(self) -> object:
        """Return the parameters that determine the pyramid beside the positions."""
        return {
            "pyramid": "next",
            "own": self.settings.kind != "pointnext-s",
            "radius": self.settings.radius,
            "neighbours": self.settings.neighbours,
        }

    def forward(self, features: Tensor, geometry: Geometry) -> Tensor:
        """Compute logits for every point and class.

        Args:
            features: Inputs [1], shape (B, N, C), float32.
            geometry: Of the B clouds `coord` [m or 1], shape (B, N, 3), float32, and the pyramids, shape (B, rows) or
                (B, rows, neighbors), int64.

        Returns:
            Logits [1], shape (B, N, classes).
        """
        coords, levels = [geometry[COORD]], [self.stem(features)]
        for level, (down, blocks) in enumerate(zip(self.down, self.blocks, strict=True)):
            kept = geometry[f"kept{level}"]
            coords.append(gather(coords[-1], kept))
            values = down(levels[-1], coords[-2], kept, geometry[f"ball{level}_0"])
            assert isinstance(blocks, nn.ModuleList)
            for block in blocks:
                values = block(values, coords[-1], geometry[f"own{level}"])
            levels.append(values)
        values = levels[-1]
        for step, mlp in enumerate(self.up):
            level = LEVELS - 1 - step
            values = interpolate(values, geometry[f"up{level}"], coords[level], coords[level + 1], power=1)
            values = mlp(cat([levels[level], values], dim=-1))
        return self.head(values)


class SetAbstraction(nn.Module):
    """Fewer points, each with the maximum over a ball of a shared MLP of offsets and features."""

    def __init__(self, inputs: int, outputs: int, radius: float, residual: bool) -> None:
        super().__init__()
        self.radius = radius
        if residual:
            half = outputs // 2
            self.mlp = nn.Sequential(_layer(inputs + 3, half), _layer(half, outputs, active=False))
            self.shortcut: nn.Linear | None = nn.Linear(inputs, outputs)
        else:
            self.mlp = nn.Sequential(_layer(inputs + 3, outputs))
            self.shortcut = None

    def forward(self, features: Tensor, coord: Tensor, kept: Tensor, ball: Tensor) -> Tensor:
        """Aggregate each kept point's ball.

        Args:
            features: Shape (B, N, inputs).
            coord: Positions [m or 1], shape (B, N, 3).
            kept: Rows of the kept points, shape (B, M), int64.
            ball: Rows of their balls, shape (B, M, K), int64.

        Returns:
            Features, shape (B, M, outputs).
        """
        offset = _offset(coord, gather(coord, kept), ball, self.radius)
        values = pooled(self.mlp, of_neighbors(self.mlp[0], features, offset, ball))
        if self.shortcut is None:
            return values
        return (values + self.shortcut(gather(features, kept))).relu()


class InvertedResidual(nn.Module):
    """A layer over a ball, then two pointwise layers that widen and narrow again, with a shortcut around all."""

    def __init__(self, width: int, radius: float) -> None:
        super().__init__()
        self.radius = radius
        self.local = _layer(width + 3, width)
        self.widen = _layer(width, EXPANSION * width)
        self.narrow = _layer(EXPANSION * width, width, active=False)

    def forward(self, features: Tensor, coord: Tensor, ball: Tensor) -> Tensor:
        """Aggregate each point's ball.

        Args:
            features: Shape (B, N, width).
            coord: Positions [m or 1], shape (B, N, 3).
            ball: Rows of the points' balls, shape (B, N, K), int64.

        Returns:
            Features, shape (B, N, width).
        """
        offset = _offset(coord, coord, ball, self.radius)
        values = pooled([self.local], of_neighbors(self.local, features, offset, ball))
        return (self.narrow(self.widen(values)) + features).relu()


def _offset(coord: Tensor, centers: Tensor, ball: Tensor, radius: float) -> Tensor:
    return (gather(coord, ball) - centers[:, :, None]) / radius


def _layer(inputs: int, outputs: int, *, active: bool = True) -> Shared:
    return Shared(inputs, outputs, nn.ReLU() if active else None, bias=False)
