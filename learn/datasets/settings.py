"""Settings of data sets: how clouds are cut, drawn and split."""

from collections.abc import Mapping
from typing import Any, Literal, Self

from pydantic import Field, field_validator, model_validator

from groundwork.errors import InputError
from groundwork.settings import Settings, parse_settings

MOST_TILES_ACROSS = 16  # tiles that cover one place along one axis


class TileSettings(Settings):
    """Metric tiles: squares of one size, scaled by one constant."""

    size: float = Field(default=10.0, gt=0.0, le=1000.0, description="Side of a tile [m]")
    stride: float = Field(default=5.0, gt=0.0, le=1000.0, description="Distance between neighboring tiles [m]")
    scale: float = Field(default=10.0, gt=0.0, le=1000.0, description="Length that is scaled to 1 for the network [m]")
    voxel: float = Field(
        default=0.05, ge=0.001, le=10.0, description="Side of the cubes in each of which one point is kept [m]"
    )
    ground_reach: float = Field(
        default=30.0, gt=0.0, le=1000.0, description="Distance within which the ground below a tile is estimated [m]"
    )
    height_reach: float = Field(
        default=10.0,
        gt=0.0,
        le=1000.0,
        description="The same distance for the channel `height`; shorter, to follow embankments [m]",
    )

    @model_validator(mode="after")
    def _whole_strides(self) -> Self:
        times = self.size / self.stride
        if abs(times - round(times)) > 1e-9 or not 1 <= round(times) <= MOST_TILES_ACROSS:
            raise ValueError(f"size must be 1 to {MOST_TILES_ACROSS} times stride, a whole number")
        return self


class WindowSettings(Settings):
    """The paper's windows along a bridge; their boxes are computed from the labels."""

    length: float = Field(default=10.0, gt=0.0, le=1000.0, description="Length of a window along the bridge [m]")
    overlap: float = Field(default=0.8, ge=0.0, lt=1.0, description="Share of a window that the next one covers [1]")
    beside: float = Field(
        default=12.0, ge=0.0, le=1000.0, description="Length that is added to the width of the deck [m]"
    )
    below: float = Field(default=1.0, ge=0.0, le=1000.0, description="Depth of a window below the ground [m]")
    above: float = Field(default=2.0, ge=0.0, le=1000.0, description="Height of a window above the bridge [m]")


class AugmentSettings(Settings):
    """Augmentation of training samples; validation and test samples are never augmented."""

    flip: bool = Field(default=True, description="Mirror half of the samples")
    rotate: bool = Field(default=True, description="Rotate about the vertical axis by a random angle")
    scale: tuple[float, float] = Field(default=(0.8, 1.25), description="Range of the random scale factor [1]")

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not 0.1 <= self.scale[0] <= self.scale[1] <= 10.0:
            raise ValueError("scale must be two factors from 0.1 to 10, the smaller one first")
        return self


class SensorSettings(Settings):
    """Augmentation that imitates another sensor or another flight."""

    range: float = Field(
        default=0.5,
        ge=0.0,
        le=1.0,
        description="Share of the samples that are thinned with the square of the distance from a random place, as by "
        "a scanner [1]",
    )
    gaps: float = Field(
        default=0.3, ge=0.0, le=1.0, description="Share of the samples with holes, as from occlusion [1]"
    )
    half: float = Field(
        default=0.1,
        ge=0.0,
        le=1.0,
        description="Share of the samples of which one side of a random plane is removed [1]",
    )
    tilt: float = Field(
        default=2.0, ge=0.0, le=30.0, description="Standard deviation of the tilt of the vertical [deg]"
    )
    colorless: float = Field(default=0.2, ge=0.0, le=1.0, description="Share of the samples without color [1]")


class DatasetSettings(Settings):
    """Common settings of both kinds of data set."""

    kind: Literal["local", "global"] = Field(
        default="local", description="local: pieces of bridges; global: whole bridges"
    )
    mode: Literal["metric", "paper"] = Field(
        default="metric",
        description="metric: tiles that need no truth, as in prediction; paper: the paper's windows and draws",
    )
    table: str = Field(
        default="kim2023",
        description="Table of classes, one of those in docs/classes.md; own: the classes of a class map",
    )
    own: Mapping[str, int] = Field(default={}, description="Own classes and their numbers; filled from the class map")
    points: int = Field(default=4096, ge=16, le=1_000_000, description="Number of points of a draw [1]")
    fewest: int = Field(
        default=1024,
        ge=1,
        le=1_000_000,
        description="Smallest number of points of a piece; smaller pieces are left out [1]",
    )
    noisy: float = Field(default=0.1, gt=0.0, le=1000.0, description="Uncertainty above which a point is noisy [m]")
    noisy_class: bool = Field(
        default=False, description="Make noisy points a class; otherwise they are left out of training"
    )
    moving: bool = Field(default=False, description="Keep the points of moving objects; otherwise they are left out")
    stratified: int = Field(
        default=0,
        ge=0,
        le=100_000,
        description="Number of points of each class that a training draw has at least, if the piece has them [1]",
    )
    split: Literal["bridge", "random"] = Field(
        default="bridge", description="bridge: whole bridges are held out; random: random pieces, as in the paper"
    )
    shares: tuple[float, float, float] = Field(
        default=(0.6, 0.2, 0.2), description="Shares of training, validation and test, which add up to 1 [1]"
    )
    test: tuple[str, ...] = Field(default=(), description="Bridges for the test, by the first digits of their hash")
    seed: int = Field(default=0, ge=0, le=2**31 - 1, description="Seed of splits and draws")
    tile: TileSettings = Field(default_factory=TileSettings, description="Metric tiles")
    window: WindowSettings = Field(default_factory=WindowSettings, description="The paper's windows")
    augment: AugmentSettings = Field(default_factory=AugmentSettings, description="Augmentation of training samples")

    @field_validator("shares", mode="before")
    @classmethod
    def _three(cls, value: Any) -> Any:
        if not isinstance(value, list | tuple) or len(value) != 3:
            raise ValueError("shares must be three numbers of at least 0 that add up to 1, such as [0.6, 0.2, 0.2]")
        return value

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if min(self.shares) < 0.0 or abs(sum(self.shares) - 1.0) > 1e-6:
            raise ValueError("shares must be three numbers of at least 0 that add up to 1")
        if self.noisy_class and self.kind == "local" and self.mode == "paper":
            raise ValueError(
                "noisy_class cannot be combined with the paper's local data set, which leaves noisy points out"
            )
        return self


_TABLES = {"tile": "size=10", "window": "length=10", "augment": "flip=false"}
_OF_KIND: Mapping[str, Mapping[str, Any]] = {
    "local": {},
    "global": {
        "table": "falsework",
        "points": 65_536,
        "noisy_class": True,
        "tile": {"size": 60.0, "stride": 30.0, "scale": 1.0, "voxel": 0.1, "ground_reach": 60.0},
    },
}


def dataset_settings(kind: str, values: Mapping[str, Any], where: object) -> DatasetSettings:
    """Validate settings, with the defaults of their kind.

    Args:
        kind: `local` or `global`.
        values: Nested values from the user.
        where: Name for the error message.

    Raises:
        InputError: A value is invalid.
    """
    whole: dict[str, Any] = {"kind": kind, **_OF_KIND.get(kind, {})}
    for key, value in values.items():
        before = whole.get(key)
        if key in _TABLES and not isinstance(value, Mapping):
            raise InputError(
                "is a table of keys, not a value",
                where=where,
                field=key,
                value=value,
                hint=f"Give one of its keys, such as {key}.{_TABLES[key]}",
            )
        whole[key] = {**before, **value} if isinstance(before, dict) and isinstance(value, dict) else value
    return parse_settings(DatasetSettings, whole, where)
