"""One training of an arm, and one test of the trained model."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from groundwork.files import write_json
from groundwork.progress import Progress
from groundwork.settings import parse_settings
from learn.compare.sources import HeldWindows, TrainingWindows
from learn.device import Device
from learn.metrics import confusion, confusion_by_threshold
from learn.models.registry import NETWORKS
from learn.scoring.record import SURE
from learn.scoring.votes import scored_clouds
from learn.trained import FOREST, read_model
from learn.training.forest import ForestSettings, train_forest
from learn.training.settings import TrainSettings

I64 = NDArray[np.int64]

FORMAT_VERSION = 1
SCORES = "scores.json"


def check_models(models: Sequence[str], network: Mapping[str, Mapping[str, Any]]) -> None:
    """Refuse an unknown model, or a setting that it does not have, before anything is made.

    Args:
        models: Networks, or `forest`.
        network: Settings of each, by name.

    Raises:
        InputError: The first that is wrong.
    """
    for name in models:
        if name not in (*NETWORKS, FOREST):
            raise InputError("no such model", field="models", value=name, allowed=", ".join((*NETWORKS, FOREST)))
    for name, values in network.items():
        if name not in (*NETWORKS, FOREST):
            raise InputError(
                "settings of an unknown model", field="network", value=name, allowed=", ".join((*NETWORKS, FOREST))
            )
        if name == FOREST:
            parse_settings(ForestSettings, dict(values), f"network.{name}")
        else:
            parse_settings(NETWORKS[name][0], {**values, "kind": name}, f"network.{name}")


def train_trial(
    source: TrainingWindows,
    validation: HeldWindows,
    settings: TrainSettings,
    folder: Path,
    progress: Progress,
    data: Mapping[str, Any],
) -> None:
    """Train an arm's model; an interrupted training is resumed.

    Args:
        source: Its samples.
        validation: Windows of other bridges from the arm's own clouds; a forest needs none.
        settings: The training.
        folder: Folder of the model: empty, or left by an interrupted call.
        progress: Listener.
        data: How the samples were made; stored with the model.

    Raises:
        InputError: No windows to train on.
    """
    if not source.windows:
        raise InputError(
            "no window is left to train on", field="fewest", hint="Lower fewest, or give bridges that all arms show"
        )
    if settings.model == FOREST:
        train_forest(source, settings, folder, progress, data)
        return
    from learn.training.train import TrainingData, train_network

    if not validation.windows:
        raise InputError("no bridge is left for validation", field="shares", hint="Give more bridges")
    train_network(TrainingData(source, validation, data), settings, folder, progress)


def score_trial(
    model: Path, source: HeldWindows, folder: Path, progress: Progress, accelerator: Device = "cpu"
) -> None:
    """Score a trained model and write the confusion matrix of each bridge, for all its points and for precise ones.

    Every point counts once, with the mean of the predictions in the draws and windows that hold it.

    Args:
        model: Its folder.
        source: Windows of bridges that were not used for training.
        folder: Empty folder to fill.
        progress: Listener.
        accelerator: Where a network predicts.
    """
    count = len(source.classes)
    nothing = np.zeros((count, count), np.int64)
    whole: dict[str, I64] = {}
    sure: dict[str, I64] = {}
    for cloud in scored_clouds(read_model(model, accelerator), source, progress):
        found = cloud.probabilities.argmax(axis=1)
        (low,) = confusion_by_threshold(cloud.truth, found, cloud.uncertainty, (SURE,), count)
        sure[cloud.bridge] = sure.get(cloud.bridge, nothing) + low
        whole[cloud.bridge] = whole.get(cloud.bridge, nothing) + confusion(cloud.truth, found, count)
    write_json(
        folder / SCORES,
        {
            "format": "falsework.trial",
            "format_version": FORMAT_VERSION,
            "classes": list(source.classes),
            "bridges": {name: matrix.tolist() for name, matrix in sorted(whole.items())},
            "uncertainty": SURE,
            "sure": {name: matrix.tolist() for name, matrix in sorted(sure.items())},
        },
    )
