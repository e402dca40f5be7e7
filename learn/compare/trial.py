"""One training of an arm, and one test of what came of it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from groundwork.errors import InputError
from groundwork.files import write_json
from groundwork.progress import Progress
from learn.compare.sources import HeldWindows, TrainingWindows
from learn.evaluate import evaluate_model
from learn.trained import FOREST, read_model
from learn.training.settings import TrainSettings

SCORES = "scores.json"


def train_trial(
    source: TrainingWindows, validation: HeldWindows, settings: TrainSettings, folder: Path, progress: Progress,
    data: Mapping[str, Any],
) -> None:  # fmt: skip
    """Train an arm's model; goes on where it was stopped.

    Args:
        source: Its samples.
        validation: Windows of other bridges, seen by the arm's own clouds; a forest picks nothing and needs none.
        settings: The training.
        folder: Where the model goes: empty, or left by an interrupted call.
        progress: Listener.
        data: How the samples were made: kept with the model.

    Raises:
        InputError: No windows to train on.
    """
    if not source.windows:
        raise InputError("no window is left to train on", field="fewest",
                         mend="Lower fewest, or take bridges that all arms show")  # fmt: skip
    if settings.model == FOREST:
        from learn.training.forest import train_forest

        train_forest(source, settings, folder, progress, data)
        return
    from learn.training.train import train_network

    if not validation.windows:
        raise InputError("no bridge is left for validation", field="shares", mend="Give more bridges")
    train_network(source, validation, settings, folder, progress, data=data)


def score_trial(model: Path, source: HeldWindows, folder: Path, progress: Progress) -> None:
    """Score a trained model and write the record.

    Args:
        model: Its folder.
        source: Windows of bridges that it never saw.
        folder: Empty folder to fill.
        progress: Listener.
    """
    write_json(folder / SCORES, evaluate_model(read_model(model), source, progress))
