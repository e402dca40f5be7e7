"""Samples drawn from the windows of an arm or a test: equally many for every arm, and the same for the same seed."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from learn.compare.pieces import known_inputs, read_window
from learn.datasets.augment import draw_change
from learn.datasets.draws import count_draws, exhaustive_draw, random_draw
from learn.datasets.patch import Patch, Scaling, make_sample
from learn.datasets.settings import AugmentSettings
from learn.sample import Sample, Truth


@dataclass(frozen=True)
class WindowPlace:
    """One window of one cloud.

    Attributes:
        folder: What `learn.compare.pieces.cut_pieces` wrote.
        cloud: Name of the cloud in it.
        number: Row in its list of windows.
        bridge: Hash of the bridge.
        points: Labeled points in the window.
    """

    folder: Path
    cloud: str
    number: int
    bridge: str
    points: int


@dataclass(frozen=True)
class SampleSettings:
    """How samples are drawn from windows.

    Attributes:
        classes: Names of the classes.
        channels: Inputs of the network per point.
        scaling: How positions are scaled.
        points: Points of a draw.
        noisy: Uncertainty above which a point is left out of training [m]; infinite if noisy points are a class.
        augment: Augmentation of training samples.
    """

    classes: tuple[str, ...]
    channels: tuple[str, ...]
    scaling: Scaling
    points: int
    noisy: float
    augment: AugmentSettings

    def record(self) -> dict[str, Any]:
        """Return all of it as JSON, for the key of a result and for a training on another machine."""
        return {
            "classes": self.classes,
            "channels": self.channels,
            "scaling": vars(self.scaling),
            "points": self.points,
            "noisy": str(self.noisy),
            "augment": self.augment.model_dump(mode="json"),
        }


@dataclass(frozen=True)
class TrainingWindows:
    """Training samples: a fixed number of random draws, spread evenly over the windows.

    Attributes:
        windows: The windows, in the same order for every arm of a pair.
        settings: How they are drawn.
        count: Samples of an epoch; it does not depend on the number of windows.
    """

    windows: Sequence[WindowPlace]
    settings: SampleSettings
    count: int

    @property
    def classes(self) -> tuple[str, ...]:
        """Name of each class, in the order of the labels."""
        return self.settings.classes

    def __len__(self) -> int:
        """Count the samples of an epoch."""
        return self.count

    def bridge(self, index: int) -> str:
        """Return one name for all training samples: each comes from any bridge.

        Args:
            index: Number of the sample.
        """
        return self.windows[index * len(self.windows) // self.count].bridge

    def sample(self, index: int, seed: int) -> Sample:
        """Draw one sample, from a window of the index's share of all windows.

        Args:
            index: Number of the sample, 0 to `len` - 1.
            seed: Seed of the draw.
        """
        rng = np.random.default_rng([seed, index])
        place = self.windows[min(int((index + rng.random()) * len(self.windows) / self.count), len(self.windows) - 1)]
        patch = _quiet(_read(place, self.settings), self.settings.noisy)
        change = draw_change(self.settings.augment, rng)
        rows = random_draw(len(patch), self.settings.points, rng)
        return make_sample(patch, rows, self.settings.channels, self.settings.scaling, change)


@dataclass(frozen=True)
class HeldWindows:
    """Samples of validation or test: always the same, neither augmented nor filtered.

    Attributes:
        windows: The windows.
        settings: How they are drawn.
        draws: Largest number of draws from a window.
    """

    windows: Sequence[WindowPlace]
    settings: SampleSettings
    draws: int

    @cached_property
    def _items(self) -> list[tuple[WindowPlace, int]]:
        return [
            (place, number)
            for place in self.windows
            for number in range(min(self.draws, count_draws(place.points, self.settings.points)))
        ]

    @property
    def classes(self) -> tuple[str, ...]:
        """Name of each class, in the order of the labels."""
        return self.settings.classes

    def __len__(self) -> int:
        """Count the samples."""
        return len(self._items)

    def bridge(self, index: int) -> str:
        """Name the bridge of a sample.

        Args:
            index: Number of the sample.
        """
        return self._items[index][0].bridge

    def sample(self, index: int, seed: int) -> Sample:
        """Draw one sample.

        Args:
            index: Number of the sample, 0 to `len` - 1.
            seed: Not used: all points are drawn once before any is drawn twice.
        """
        patch, rows = self._drawn(index)
        return make_sample(patch, rows, self.settings.channels, self.settings.scaling)

    def truth(self, index: int) -> Truth:
        """Return the truth of a sample's points and their rows in the cloud, without instances.

        Args:
            index: Number of the sample.
        """
        place = self._items[index][0]
        patch, rows = self._drawn(index)
        assert patch.row is not None
        cloud = self._clouds[place.folder, place.cloud]
        return Truth(
            cloud,
            patch.row[rows],
            patch.coord[rows] + patch.origin,
            patch.uncertainty[rows],
            np.zeros(len(rows), np.int64),
        )

    @cached_property
    def _clouds(self) -> dict[tuple[Path, str], int]:
        names = dict.fromkeys((place.folder, place.cloud) for place in self.windows)
        return {name: number for number, name in enumerate(names)}

    def _drawn(self, index: int) -> tuple[Patch, NDArray[np.int64]]:
        place, number = self._items[index]
        patch = _read(place, self.settings)
        return patch, exhaustive_draw(len(patch), self.settings.points, number, place.number)


def _read(place: WindowPlace, settings: SampleSettings) -> Patch:
    return read_window(place.folder, place.cloud, place.number, tuple(known_inputs(settings.channels)))


def _quiet(patch: Patch, noisy: float) -> Patch:
    kept = ~(patch.uncertainty > noisy)
    if kept.all():
        return patch
    inputs = {name: values[kept] for name, values in patch.inputs.items()}
    return Patch(patch.coord[kept], inputs, patch.labels[kept], patch.uncertainty[kept], patch.origin, patch.seed)
