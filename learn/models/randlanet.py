"""RandLA-Net: random sampling, local spatial encoding and attentive pooling, for clouds of 10,000 points and more."""

from collections.abc import Mapping
from typing import Literal

from pydantic import Field, model_validator
from torch import Tensor, cat, nn

from groundwork.settings import Settings
from learn.models.backbone import COORD, Geometry
from learn.models.gather import Shared, gather
from learn.neighborhoods.pyramids import random_pyramid
from learn.neighborhoods.searcher import Points, Rows, Searcher

STEM = 8
HEAD = (64, 32)
WIDEST = 2048  # four times the published one; a number in a damaged file must not fill the memory
SLOPE = 0.2
_EPSILON, _MOMENTUM = 1e-6, 0.01  # of the published batch normalization; a momentum of 0.99 there is 0.01 here


class RandlaNetSettings(Settings):
    """RandLA-Net."""

    kind: Literal["randlanet"] = "randlanet"
    """Name of the network."""
    widths: tuple[int, ...] = Field(default=(16, 64, 128, 256, 512), min_length=2, max_length=6)
    """Half the number of features of each layer; the published network for laser scans has the first four layers."""
    ratios: tuple[int, ...] = (4, 4, 4, 4, 2)
    """Factor by which the cloud is thinned after each layer [1]."""
    neighbours: int = Field(default=16, ge=2, le=64)
    """Number of nearest neighbors of a point."""
    dropout: float = Field(default=0.5, ge=0.0, lt=1.0)
    """Dropout of the head: share of its features that a training step leaves out [1]."""
    sampling_seed: int = Field(default=0, ge=0)
    """Seed of the random sampling."""

    @model_validator(mode="after")
    def _as_many(self) -> "RandlaNetSettings":
        if len(self.widths) != len(self.ratios) or any(width % 2 or not 2 <= width <= WIDEST for width in self.widths):
            raise ValueError(
                f"widths and ratios must have the same length, and widths must be even numbers from 2 to {WIDEST}"
            )
        if any(ratio < 1 for ratio in self.ratios):
            raise ValueError("ratios must be 1 or more")
        return self


class RandlaNet(nn.Module):
    """RandLA-Net with neighborhoods from the loader.

    Positions enter the spatial encoding without change: center each cloud.

    Source: Hu et al., RandLA-Net, 2020, https://doi.org/10.48550/arXiv.1911.11236, and the authors' settings.
    """

    def __init__(self, settings: RandlaNetSettings, inputs: int, classes: int) -> None:
        super().__init__()
        self.settings = settings
        self.stem = _shared(inputs, STEM)
        self.down = nn.ModuleList()
        widths = [STEM]
        for width in settings.widths:
            self.down.append(DilatedResidual(widths[-1], width))
            widths.append(2 * width)
        self.bottom = _shared(widths[-1], widths[-1])
        skips = [widths[1], *widths[1:-1]]  # of the finest level before its sampling, then of each level after it
        self.up = nn.ModuleList()
        below = widths[-1]
        for skip in reversed(skips):
            self.up.append(_shared(below + skip, skip))
            below = skip
        self.head = nn.Sequential(
            _shared(below, HEAD[0]),
            _shared(HEAD[0], HEAD[1]),
            nn.Dropout(settings.dropout),
            nn.Linear(HEAD[1], classes),
        )

    def pyramid(self, coord: Points, search: Searcher[Points, Rows]) -> Mapping[str, Rows]:
        """Choose the points of every level and search their neighbors.

        Args:
            coord: Positions [m or 1], shape (N, 3), float32; of a batch with an axis in front.
            search: What searches.

        Returns:
            As `learn.neighborhoods.pyramids.random_pyramid`: `near{l}` and `up{l}`, shape (rows, neighbors),
            `kept{l}`, shape (points of level l + 1,).
        """
        settings = self.settings
        return random_pyramid(coord, settings.ratios, settings.neighbours, settings.sampling_seed, search)

    def pyramid_parameters(self) -> object:
        """Return the parameters that determine the pyramid beside the positions."""
        settings = self.settings
        return {
            "pyramid": "random",
            "ratios": settings.ratios,
            "neighbours": settings.neighbours,
            "seed": settings.sampling_seed,
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
        coord, values = geometry[COORD], self.stem(features)
        skips: list[Tensor] = []
        for level, block in enumerate(self.down):
            near, kept = geometry[f"near{level}"], geometry[f"kept{level}"]
            values = block(values, coord, near)
            if level == 0:
                skips.append(values)
            rows = gather(near, kept)
            values = gather(values, rows).max(dim=2).values
            coord = gather(coord, kept)
            skips.append(values)
        values = self.bottom(skips.pop())
        for step, mlp in enumerate(self.up):
            up = geometry[f"up{len(self.up) - 1 - step}"]
            values = mlp(cat([skips.pop(), gather(values, up[:, :, 0])], dim=-1))
        return self.head(values)


class DilatedResidual(nn.Module):
    """Two consecutive local aggregations, with a shortcut around both."""

    def __init__(self, inputs: int, width: int) -> None:
        super().__init__()
        half = width // 2
        self.enter = _shared(inputs, half)
        self.place_first = _shared(10, half)
        self.pool_first = AttentivePooling(width, half)
        self.place_second = _shared(half, half)
        self.pool_second = AttentivePooling(width, width)
        self.leave = _shared(width, 2 * width, active=False)
        self.shortcut = _shared(inputs, 2 * width, active=False)
        self.activation = nn.LeakyReLU(SLOPE)

    def forward(self, features: Tensor, coord: Tensor, near: Tensor) -> Tensor:
        """Aggregate each point's neighborhood.

        Args:
            features: Shape (B, N, inputs).
            coord: Positions [m or 1], shape (B, N, 3).
            near: Neighbors, shape (B, N, K), int64.

        Returns:
            Features, shape (B, N, 2 x width).
        """
        place = self.place_first(relative_place(coord, near))
        values = self.enter(features)
        values = self.pool_first(cat([gather(values, near), place], dim=-1))
        place = self.place_second(place)
        values = self.pool_second(cat([gather(values, near), place], dim=-1))
        return self.activation(self.leave(values) + self.shortcut(features))


class AttentivePooling(nn.Module):
    """A sum over neighbors, each feature weighted by a softmax over them."""

    def __init__(self, width: int, outputs: int) -> None:
        super().__init__()
        self.score = nn.Linear(width, width, bias=False)
        self.mlp = _shared(width, outputs)

    def forward(self, values: Tensor) -> Tensor:
        """Pool over the neighbors.

        Args:
            values: Shape (B, N, K, width).

        Returns:
            Shape (B, N, outputs).
        """
        return self.mlp((values * self.score(values).softmax(dim=2)).sum(dim=2))


def relative_place(coord: Tensor, near: Tensor) -> Tensor:
    """Compute the spatial encoding of each neighbor.

    Args:
        coord: Positions [m or 1], shape (B, N, 3).
        near: Neighbors, shape (B, N, K), int64.

    Returns:
        Distance, center minus neighbor, center, neighbor [m or 1], shape (B, N, K, 10).
    """
    neighbor = gather(coord, near)
    center = coord[:, :, None].expand_as(neighbor)
    offset = center - neighbor
    squared = offset.square().sum(-1, keepdim=True)
    return cat([squared.sqrt(), offset, center, neighbor], dim=-1)


def _shared(inputs: int, outputs: int, *, active: bool = True) -> Shared:
    activation = nn.LeakyReLU(SLOPE) if active else None
    return Shared(inputs, outputs, activation, epsilon=_EPSILON, momentum=_MOMENTUM)
