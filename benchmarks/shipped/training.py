"""How the model that comes with the package is trained: on tiles as other sensors would have seen them.

Usage: python -m benchmarks.shipped.training DATASET --out MODEL [--validation NAME…] [--init MODEL] [--set KEY=VALUE…]

`benchmarks.shipped.model` calls this; the command is for another machine, one with a GPU, where nothing but what a
training needs is installed: there DATASET was unpacked by `benchmarks.shipped.pack`. `--minutes` are shared out: a
first epoch is timed, and as many follow as fit.
"""

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import torch

from groundwork.errors import InputError
from groundwork.progress import Progress, Silent
from learn.datasets.stored import StoredSplit
from learn.datasets.varied import SomeSamples, Variation, VariedSplit
from learn.trained import FOREST
from learn.training.forest import train_forest
from learn.training.settings import TrainSettings
from learn.training.train import TrainingData, train_network

CHANNELS = ("z",)
VARIED = {  # shares of the samples, and how much leaves are shaken
    "alone": 0.15,  # nothing but a bridge, as scans that were cut out
    "empty": 0.1,  # nothing of a bridge
    "clutter": 0.2,  # made up land without a bridge
    "rustle": 0.4,  # [m]
}
SAMPLES, HELD_SAMPLES = 800, 128  # of an epoch, and of its validation
USUAL = {"model": "pointnext-s", "epochs": 10, "precision": "bf16-mixed", "accelerator": "cpu"}


def varied_data(dataset: Path, validation: Sequence[str], samples: int) -> TrainingData:
    """Take varied tiles to train on, and tiles of bridges of their own to pick the epoch on.

    Args:
        dataset: Data set whose test split holds those bridges, too.
        validation: First digits of their hashes.
        samples: Samples of an epoch.
    """
    source = VariedSplit(
        StoredSplit(dataset, "train", CHANNELS), Variation.model_validate({"samples": samples, **VARIED})
    )
    whole = StoredSplit(dataset, "test", CHANNELS)
    rows = [row for row in range(len(whole)) if whole.bridge(row).startswith(tuple(validation))]
    held = SomeSamples(whole, rows[:: max(1, len(rows) // HELD_SAMPLES)])
    facts = {
        "settings": whole.facts.settings.model_dump(mode="json"),
        "scaling": vars(whole.facts.scaling),
        "table": whole.facts.settings.table,
        "variation": source.settings.model_dump(mode="json"),
    }
    return TrainingData(source, held, facts)


def train_shipped(
    data: TrainingData, settings: TrainSettings, folder: Path, progress: Progress, init: Path | None = None
) -> None:
    """Train a network, or a forest.

    Args:
        data: Of `varied_data`.
        settings: The training.
        folder: Model to write.
        progress: Listener.
        init: A model to begin with.
    """
    if settings.model == FOREST:
        train_forest(data.training, settings, folder, progress, data.facts)
    else:
        train_network(data, settings, folder, progress, init=init)


class _Epochs(Silent):
    """Prints when epochs end, and keeps the times."""

    def __init__(self, folder: Path) -> None:
        self._folder, self.ends = folder, list[float]()

    def advance(self, done: int) -> None:
        self.ends.append(time.monotonic())
        last = (self._folder / "log.csv").read_text(encoding="utf-8").splitlines()[-1]
        sys.stdout.write(f"{self._folder.name} {last}\n")
        sys.stdout.flush()


def epochs_in(minutes: float, data: TrainingData, settings: TrainSettings) -> int:
    """Time an epoch, the second of two, and compute how many fit.

    Args:
        minutes: What all have together, the two of the measurement left out [min].
        data: Samples.
        settings: The training.
    """
    with tempfile.TemporaryDirectory() as folder:
        clock = _Epochs(Path(folder))
        train_shipped(data, settings.model_copy(update={"epochs": 2}), Path(folder), clock)
    return max(1, int(60.0 * minutes / (clock.ends[1] - clock.ends[0])))


def said(value: str) -> object:
    """Read a word of `--set`: JSON, or else the word itself.

    Args:
        value: What stands behind the equals sign.
    """
    try:
        return json.loads(value)
    except json.JSONDecodeError:
        return value


def main() -> None:
    """Train."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--validation", nargs="+", default=[])
    parser.add_argument("--samples", type=int, default=SAMPLES, help="samples of an epoch")
    parser.add_argument("--init", type=Path, help="a model to begin with")
    parser.add_argument(
        "--minutes", type=float, default=0.0, help="train as long, not for `epochs`; another call begins anew"
    )
    parser.add_argument("--set", nargs="*", default=[], help="settings of the training, key=value")
    given = parser.parse_args()
    torch.set_num_threads(1)
    words = {key: said(value) for key, _, value in (word.partition("=") for word in given.set)}
    settings = TrainSettings.model_validate({**USUAL, "accelerator": "auto", **words})
    if settings.model == FOREST:
        raise InputError("a forest is not trained here", field="model", hint="Call benchmarks.shipped.model")
    data = varied_data(given.dataset, given.validation, given.samples)
    if given.minutes:
        settings = settings.model_copy(update={"epochs": epochs_in(given.minutes, data, settings)})
    given.out.mkdir(parents=True, exist_ok=True)
    train_shipped(data, settings, given.out, _Epochs(given.out), given.init)


if __name__ == "__main__":
    main()
