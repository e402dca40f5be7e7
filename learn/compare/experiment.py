"""Settings of an experiment: the arms to train, the clouds to test on, and how; from a preset or a TOML file."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from groundwork.settings import Settings, parse_settings
from learn.compare.pieces import CutSettings, known_inputs
from learn.compare.preset import DEFAULT_SET, preset_values
from learn.compare.sources import SampleSettings
from learn.datasets.patch import CHANNELS, Scaling
from learn.datasets.settings import AugmentSettings, TileSettings, WindowSettings, dataset_settings
from learn.training.settings import TrainSettings

MOST = 1000.0  # [m] uncertainty that no point exceeds
_NAME = r"[A-Za-z0-9][A-Za-z0-9_@.+-]*"  # a run that makes two clouds of a flight calls them local+dense …
_PART = re.compile(rf"(?:({_NAME})/)?({_NAME})(?:\s*~\s*({_NAME}))?")

__all__ = ["ExperimentSettings", "Part", "data_facts", "experiment_settings"]


@dataclass(frozen=True, order=True)
class Part:
    """Clouds of one name, of one set of bridges.

    Attributes:
        set: Name of the set of bridges.
        cloud: Name of the clouds.
        like: Name of the clouds whose noise, density and gaps are simulated on them; empty for none.
    """

    set: str
    cloud: str
    like: str = ""

    def __str__(self) -> str:
        """Format it as in a file."""
        return f"{self.set}/{self.cloud}" + (f" ~ {self.like}" if self.like else "")


def read_part(text: str) -> Part:
    """Read `CLOUD`, `SET/CLOUD` or `SET/CLOUD ~ LIKE`.

    Args:
        text: Text of the file.

    Raises:
        ValueError: Not of this form.
    """
    found = _PART.fullmatch(text.strip())
    if found is None:
        raise ValueError(
            f"no such clouds: {text!r}; allowed: CLOUD, SET/CLOUD, or CLOUD ~ OTHER for noise like that of OTHER"
        )
    return Part(found[1] or DEFAULT_SET, found[2], found[3] or "")


class ExperimentSettings(Settings):
    """An experiment."""

    title: str = ""
    """Heading of its page."""
    arms: dict[str, tuple[str, ...]]
    """What is trained: a name, and the clouds that its windows come from: `CLOUD`, `SET/CLOUD`, or `CLOUD ~ OTHER` for
    noise like that of another cloud, fitted on the training bridges."""
    tests: dict[str, str]
    """What every arm is tested on: a name, and the clouds."""
    pairs: tuple[tuple[str, str], ...] = ()
    """Arms to compare, first minus second; empty for all pairs."""
    windows: Literal["all", "pair"] = "all"
    """all: train each arm once, on the windows that are valid in all arms; pair: for each pair on those valid in
    both."""
    models: tuple[str, ...] = Field(default=("pointnet2-ssg",), min_length=1)
    """Networks, or `forest`."""
    seeds: int = Field(default=5, ge=1, le=100)
    """Number of trainings of each arm and model; all arms have the same seeds."""
    first_seed: int = Field(default=0, ge=0, le=10**6)
    """The first seed; the others follow."""
    steps: int = Field(default=5000, ge=1, le=10**7)
    """Number of steps of a training, the same in every arm, independent of its number of windows."""
    epochs: int = Field(default=10, ge=1, le=1000)
    """Number of validations during a training; the weights of the best one are kept."""
    batch: int = Field(default=8, ge=1, le=1024)
    """Samples per step."""
    recipe: Literal["paper", "modern"] = "modern"
    """As in `falsework train`."""
    learning_rate: float | None = Field(default=None, gt=0.0, le=1.0)
    """Largest learning rate [1]; left out: that of the recipe."""
    accelerator: Literal["cpu", "gpu"] = "cpu"
    """Device on which networks are trained and tested; only results of the CPU are the same bytes in every run."""
    network: dict[str, dict[str, Any]] = Field(default_factory=dict)
    """Settings of the networks and the forest, by name."""
    channels: tuple[str, ...] = ("x", "y", "z")
    """Inputs of a point. Do not compare with colors: meshes and lasers have those of unlit materials."""
    mode: Literal["metric", "paper", "whole"] = "metric"
    """Metric tiles, the paper's windows along the bridge, or draws from whole bridges."""
    table: str = "kim2023"
    """Table of classes."""
    noisy: float = Field(default=0.1, gt=0.0, le=MOST)
    """Uncertainty above which a point is noisy: it is left out of training, but not out of tests [m]."""
    noisy_class: bool = False
    """Make noisy points a class instead."""
    filters: dict[str, float] = Field(default_factory=dict)
    """Arms that keep points up to an uncertainty other than `noisy`, and not smaller; 1000 keeps all points [m]. Their
    windows are still those that are valid with `noisy`."""
    points: int = Field(default=4096, ge=16, le=1_000_000)
    """Points of a draw."""
    fewest: int = Field(default=1024, ge=1, le=1_000_000)
    """Number of points that a valid window has at least."""
    test_draws: int = Field(default=2, ge=1, le=10_000)
    """Largest number of draws of each test window; no point is repeated before all were drawn."""
    shares: tuple[float, float, float] = (0.6, 0.1, 0.3)
    """Shares of the bridges for training, validation and test; of a set that is not tested on, the first two count."""
    split_seed: int = Field(default=0, ge=0, le=2**31 - 1)
    """Seed of the order in which bridges are shared out."""
    held: tuple[str, ...] = ()
    """Bridges for the test, by the first digits of their hash; empty: by `shares`."""
    tile: TileSettings = Field(default_factory=lambda: TileSettings(stride=10.0))
    """Metric tiles."""
    window: WindowSettings = Field(default_factory=WindowSettings)
    """The paper's windows, laid along the first named cloud of each set."""
    augment: AugmentSettings = Field(default_factory=AugmentSettings)
    """Augmentation of training samples."""
    forest_draws: int = Field(default=400, ge=1, le=1_000_000)
    """Number of draws that a forest is trained on, the same in every arm; `steps` does not apply to it."""
    draws: int = Field(default=2000, ge=100, le=1_000_000)
    """Number of draws of the bootstrap."""
    level: float = Field(default=0.95, gt=0.5, lt=1.0)
    """Coverage of the intervals [1]."""

    @model_validator(mode="after")
    def _names_fit(self) -> Self:
        if not self.arms or not self.tests or not all(self.arms.values()):
            raise ValueError("an experiment needs arms, each with at least one cloud, and tests")
        for text in (*self.tests.values(), *(part for parts in self.arms.values() for part in parts)):
            read_part(text)
        for pair in self.pairs:
            for name in pair:
                if name not in self.arms:
                    raise ValueError(f"pairs has {name!r}, which is not an arm; allowed: {', '.join(self.arms)}")
            if pair[0] == pair[1]:
                raise ValueError(f"pairs compares {pair[0]!r} with itself")
        for key, given in (("models", self.models), ("pairs", self.pairs)):
            if len(set(given)) < len(given):
                raise ValueError(f"{key} has one twice, which would count its trainings double")
        self._check_filters()
        for name in self.channels:
            if name not in CHANNELS:
                raise ValueError(f"not a channel: {name!r}; allowed: {', '.join(CHANNELS)}")
        if "height" in self.channels and self.mode != "metric":
            raise ValueError('the channel height needs mode = "metric"')
        if not self.channels:
            raise ValueError("channels is empty; allowed: at least one, such as x, y, z")
        if min(self.shares) < 0.0 or abs(sum(self.shares) - 1.0) > 1e-6:
            raise ValueError("shares must be three numbers of at least 0 that add up to 1")
        return self

    def _check_filters(self) -> None:
        for name, most in self.filters.items():
            if name not in self.arms:
                raise ValueError(f"filters has {name!r}, which is not an arm; allowed: {', '.join(self.arms)}")
            if not self.noisy <= most <= MOST:
                raise ValueError(
                    f"filters.{name} is {most:g}; allowed: {self.noisy:g} (noisy) to {MOST:g}, which keeps all points"
                )
        if self.filters and self.noisy_class:
            raise ValueError("filters and noisy_class cannot be combined; leave one of them out")

    def parts(self, arm: str) -> tuple[Part, ...]:
        """List the clouds of an arm.

        Args:
            arm: Its name.
        """
        return tuple(dict.fromkeys(read_part(text) for text in self.arms[arm]))

    def test(self, name: str) -> Part:
        """Return the clouds of a test.

        Args:
            name: Its name.
        """
        return read_part(self.tests[name])

    @property
    def compared(self) -> tuple[tuple[str, str], ...]:
        """List the pairs of arms that are compared."""
        return self.pairs or tuple(combinations(self.arms, 2))

    @property
    def groups(self) -> tuple[tuple[str, ...], ...]:
        """List the groups of arms; the arms of a group are trained on the windows that are valid in all of them."""
        return (tuple(self.arms),) if self.windows == "all" or len(self.arms) < 2 else self.compared

    def training(self, model: str, seed: int) -> TrainSettings:
        """Return the settings of one training; all trainings have the same number of steps per epoch.

        Args:
            model: Network, or forest.
            seed: Its seed.
        """
        values: dict[str, Any] = {
            "model": model,
            "network": self.network.get(model, {}),
            "recipe": self.recipe,
            "epochs": self.looks,
            "batch": self.batch,
            "learning_rate": self.learning_rate,
            "seed": seed,
            "accelerator": self.accelerator,
        }
        return TrainSettings.model_validate(values)

    @property
    def cut(self) -> CutSettings:
        """Return how clouds are cut."""
        return CutSettings(
            mode=self.mode,
            table=self.table,
            noisy=self.noisy,
            noisy_class=self.noisy_class,
            inputs=tuple(known_inputs(self.channels)),
            tile=self.tile,
            window=self.window,
        )

    def kept(self, arm: str) -> float:
        """Return the largest uncertainty of the points that an arm is trained on [m].

        Args:
            arm: Its name.
        """
        return self.filters.get(arm, self.noisy)

    def sampling_of(self, arm: str) -> SampleSettings:
        """Return how the training samples of an arm are drawn.

        Args:
            arm: Its name.
        """
        return self.sampling if self.noisy_class else replace(self.sampling, noisy=self.kept(arm))

    @property
    def sampling(self) -> SampleSettings:
        """Return how samples are drawn, except those of arms with a filter of their own."""
        scaling = {
            "metric": Scaling("constant", self.tile.scale),
            "paper": Scaling("extent"),
            "whole": Scaling("constant", 1.0),
        }[self.mode]
        noisy = float("inf") if self.noisy_class else self.noisy
        return SampleSettings(self.cut.classes, self.channels, scaling, self.points, noisy, self.augment)

    @property
    def looks(self) -> int:
        """Number of epochs: at most the number of steps."""
        return min(self.epochs, self.steps)

    @property
    def samples_each(self) -> int:
        """Number of samples of an epoch: whole steps, at least `steps` in all epochs together."""
        return -(-self.steps // self.looks) * self.batch


def experiment_settings(what: str, given: Mapping[str, Any]) -> ExperimentSettings:
    """Read an experiment.

    Args:
        what: Name of a preset, or path of a TOML file.
        given: Settings that the command line changes.

    Raises:
        InputError: Neither a preset nor a file, or a value that is not allowed.
    """
    return parse_settings(ExperimentSettings, _changed(preset_values(what), given), what)


def _changed(values: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Replace values, and in tables those of the keys that are given."""
    new = dict(values)
    for key, value in given.items():
        before = new.get(key)
        new[key] = _changed(before, value) if isinstance(before, Mapping) and isinstance(value, Mapping) else value
    return new


def data_facts(settings: ExperimentSettings, noisy: float) -> dict[str, Any]:
    """Describe how samples were made, in the format of a data set, so that a prediction can cut a scan the same way.

    Args:
        settings: The experiment.
        noisy: Uncertainty above which points were left out of training [m].
    """
    kind = "global" if settings.mode == "whole" else "local"
    values = {
        "mode": "metric" if settings.mode == "metric" else "paper",
        "table": settings.table,
        "points": settings.points,
        "fewest": settings.fewest,
        "noisy": noisy,
        "noisy_class": settings.noisy_class,
        "tile": settings.tile.model_dump(mode="json"),
        "window": settings.window.model_dump(mode="json"),
        "augment": settings.augment.model_dump(mode="json"),
    }
    made = dataset_settings(kind, values, "experiment")
    return {
        "settings": made.model_dump(mode="json"),
        "scaling": vars(settings.sampling.scaling),
        "table": settings.table,
    }
