"""Training of a random forest on covariance features, which is often better than a network with little data."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from pydantic import Field

from groundwork.errors import InputError
from groundwork.progress import Progress
from groundwork.settings import Settings, parse_settings
from learn.models.forest import Arrays, forest_probabilities, grow_forest
from learn.sample import UNLABELED, SampleSource
from learn.trained import FOREST, ModelFacts, as_probabilities, forest_inputs, share_logits, write_model
from learn.training.calibration import fit_temperature, gather_scores
from learn.training.settings import TrainSettings


class ForestSettings(Settings):
    """A random forest."""

    scales: tuple[int, ...] = Field(default=(10, 30, 100), min_length=1, max_length=6)
    """Numbers of nearest neighbors whose covariances describe a point."""
    trees: int = Field(default=60, ge=1, le=1000)
    """Number of trees."""
    depth: int = Field(default=16, ge=1, le=40)
    """Largest depth of a tree."""
    points: int = Field(default=200_000, ge=100, le=10_000_000)
    """Largest number of training points, drawn evenly from all samples."""


def train_forest(
    source: SampleSource,
    settings: TrainSettings,
    folder: Path,
    progress: Progress,
    data: Mapping[str, Any] | None = None,
    *,
    held: SampleSource | None = None,
) -> None:
    """Train a forest and write it as a model.

    No epoch is chosen by validation, so no bridge is held out of `source`.

    Args:
        source: Training samples, each drawn once.
        settings: The user's settings; `network` holds those of the forest.
        folder: Folder of the model.
        progress: Listener.
        data: How the samples were made; stored with the model.
        held: Samples of other bridges, on which the temperature of the confidence is fitted; None leaves it at 1.

    Raises:
        InputError: No samples, an unknown setting, or only one class.
    """
    chosen = parse_settings(ForestSettings, settings.network, "--set network")
    if not len(source):
        raise InputError("no training samples", field="samples", value=0)
    rng = np.random.default_rng(settings.seed)
    share = max(1, chosen.points // len(source))
    features, labels, channels = [], [], source.sample(0, settings.seed).channels
    progress.stage("features", len(source))
    for row in range(len(source)):
        sample = source.sample(row, settings.seed)
        known = np.flatnonzero(sample.labels != UNLABELED)
        kept = np.sort(rng.permutation(known)[:share])
        features.append(forest_inputs(sample, chosen.scales)[kept])
        labels.append(sample.labels[kept])
        progress.advance(row + 1)
    progress.stage("train", 1)
    arrays = grow_forest(
        np.concatenate(features),
        np.concatenate(labels),
        len(source.classes),
        trees=chosen.trees,
        depth=chosen.depth,
        seed=settings.seed,
    )
    facts = ModelFacts(
        network=FOREST,
        settings=chosen.model_dump(mode="json"),
        classes=source.classes,
        channels=channels,
        data=data or {},
        temperature=_temperature(arrays, held, chosen.scales),
        training={"settings": settings.model_dump(mode="json"), "training_bridges": _bridges(source)}
        | ({} if held is None else {"validation_bridges": _bridges(held)}),
    )
    write_model(folder, facts, {name: torch.from_numpy(np.ascontiguousarray(rows)) for name, rows in arrays.items()})
    progress.advance(1)


def _bridges(source: SampleSource) -> list[str]:
    return sorted({source.bridge(row) for row in range(len(source))})


def _temperature(arrays: Arrays, held: SampleSource | None, scales: Sequence[int]) -> float:
    """Fit the temperature on the labeled points of held-out bridges; 1 without any."""
    if held is None:
        return 1.0

    def score(row: int) -> tuple[torch.Tensor, torch.Tensor]:
        sample = held.sample(row, 0)
        known = sample.labels != UNLABELED
        shares = forest_probabilities(arrays, forest_inputs(sample, scales)[known])
        return share_logits(shares), torch.from_numpy(sample.labels[known].astype(np.int64))

    gathered = gather_scores(range(len(held)), score)
    if gathered is None:
        return 1.0
    return fit_temperature(*gathered, lambda logits, by: as_probabilities(logits, None, by))
