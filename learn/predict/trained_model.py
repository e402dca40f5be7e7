"""Adapter from a model of `falsework train` to the interface of predictions."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from groundwork.settings import parse_settings
from learn.datasets.patch import CHANNELS
from learn.datasets.settings import DatasetSettings, TileSettings
from learn.device import Device
from learn.sample import Sample
from learn.trained import FACTS, TrainedForest, TrainedNetwork, read_model

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class TrainedModel:
    """A trained model with the settings of its data set; a `learn.predict.model.PointModel`.

    Attributes:
        trained: Network or forest.
        settings: How its training samples were cut and drawn.
    """

    trained: TrainedNetwork | TrainedForest
    settings: DatasetSettings

    @property
    def classes(self) -> tuple[str, ...]:
        """List the class names, in the order of the probabilities."""
        return self.trained.classes

    @property
    def table(self) -> str:
        """Return the name of the class table."""
        return self.settings.table

    @property
    def ids(self) -> tuple[int, ...]:
        """Return the number of each class in the user's files, for a user's own classes."""
        return tuple(self.settings.own[name] for name in self.classes) if self.settings.own else ()

    @property
    def channels(self) -> tuple[str, ...]:
        """List its input channels, names of `learn.datasets.patch.CHANNELS`."""
        return self.trained.channels

    @property
    def tile(self) -> TileSettings:
        """Return the settings of the tiles that it was trained on."""
        return self.settings.tile

    @property
    def points(self) -> int:
        """Return the number of points of a draw."""
        return self.settings.points

    def probabilities(self, samples: Sequence[Sample]) -> list[F32]:
        """Compute the probability of each class at each point.

        Args:
            samples: Clouds as in training.

        Returns:
            For each sample probabilities [1], shape (N, K), float32.
        """
        return self.trained.probabilities(samples)


def read_trained_model(folder: Path, device: Device = "cpu") -> TrainedModel:
    """Read a model of `falsework train` for a prediction.

    Args:
        folder: The model.
        device: Where a network predicts.

    Raises:
        InputError: Not a model, damaged, no GPU although one is requested, or trained on samples that cannot be cut
            without labels.
    """
    trained = read_model(folder, device)
    where, stored = folder / FACTS, trained.facts.data.get("settings")
    if not isinstance(stored, dict):
        raise InputError(
            "does not state its data set",
            where=where,
            field="data.settings",
            hint="Train it on a data set of falsework dataset",
        )
    settings = parse_settings(DatasetSettings, stored, where)
    if settings.mode != "metric":
        raise InputError(
            "trained on the paper's windows, which need labels: it can be evaluated, but it cannot label a scan",
            where=folder,
            field="--model",
            value=settings.mode,
            allowed="a model of a data set with --mode metric",
        )
    unknown = [name for name in trained.channels if name not in CHANNELS]
    if unknown:
        raise InputError(
            "an input that scans do not have",
            where=where,
            field="channels",
            value=unknown[0],
            allowed=", ".join(CHANNELS),
        )
    return TrainedModel(trained, settings)
