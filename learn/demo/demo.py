"""The demonstration: a network learns from clouds that come with the package, and is held against simple answers."""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.progress import Progress
from learn.datasets.build import Source, build_dataset
from learn.datasets.labeled_cloud import HEIGHT
from learn.datasets.settings import DatasetSettings, dataset_settings
from learn.datasets.stored import StoredSplit
from learn.demo.clouds import VOXEL, DemoCloud, demo_clouds, write_demo_cloud
from learn.metrics import confusion, scores
from learn.models.forest import forest_probabilities, grow_forest
from learn.sample import UNLABELED, Sample
from learn.trained import read_model
from learn.training.settings import TrainSettings, recipe_of
from learn.training.train import TrainingData, train_network

F32 = NDArray[np.float32]
I64 = NDArray[np.int64]

TEST = ("beam26", "girder15", "girder16", "slab34")
"""Bridges that are kept for the test: chosen before anything was trained, the last ones of three families."""
NO_SENSORS = {"range": 0.0, "gaps": 0.0, "half": 0.0, "tilt": 0.0, "colorless": 0.0}
"""Training and test are of one sensor here, and steps are few."""
MODEL: Mapping[str, Any] = {
    "model": "pointnet2-ssg",
    "network": {"counts": [256, 64, 16], "unit": 2.0, "dropout": 0.3},
    "epochs": 4,
    "batch": 8,
    "accelerator": "cpu",
    "sensors": NO_SENSORS,
}


@dataclass(frozen=True)
class DemoRow:
    """What one way of answering is worth on the held-out bridges.

    Attributes:
        name: Way of answering.
        iou: Of each class, over all held-out bridges together; NaN where it occurs in neither [1], shape (C,), float64.
        mean: Mean over the classes [1].
        bridges: Mean IoU of each bridge [1].
    """

    name: str
    iou: NDArray[np.float64]
    mean: float
    bridges: Mapping[str, float]


def run_demo(
    folder: Path,
    progress: Progress,
    *,
    clouds: Sequence[DemoCloud] | None = None,
    test: Sequence[str] = TEST,
    changed: Mapping[str, Any] | None = None,
) -> tuple[tuple[str, ...], list[DemoRow]]:
    """Train on the shipped clouds and score what was learnt on bridges that the training never saw.

    Args:
        folder: Where the model goes; what an interrupted call left there is gone on from.
        progress: Listener.
        clouds: Clouds in place of the shipped ones.
        test: Names of those that are held out.
        changed: Settings of the training in place of the demonstration's own.

    Returns:
        Class names; rows of the network, a forest on the height alone, and the class with most points.
    """
    clouds = demo_clouds() if clouds is None else clouds
    settings = TrainSettings(**{**MODEL, **(changed or {})})
    channels = recipe_of(settings).channels
    with tempfile.TemporaryDirectory() as place:
        data = _data_set(Path(place), clouds, test, progress)
        train = StoredSplit(data, "train", channels, sensors=recipe_of(settings).sensors)
        facts = {
            "settings": train.facts.settings.model_dump(mode="json"),
            "scaling": vars(train.facts.scaling),
            "table": train.facts.settings.table,
        }
        samples = TrainingData(train, StoredSplit(data, "val", channels), facts)
        train_network(samples, settings, folder, progress)
        held = StoredSplit(data, "test", channels)
        names = {cloud.bridge: cloud.name for cloud in clouds}
        answers = [
            ("network", read_model(folder)),
            ("forest on the height alone", _HeightForest.grown(train.unchanged())),
            ("the class with most points", _Majority.counted(train.unchanged())),
        ]
        progress.stage("evaluate", len(answers) * len(held))
        rows = [
            _row(name, answer, held, names, progress, place * len(held)) for place, (name, answer) in enumerate(answers)
        ]
        return train.classes, rows


def demo_settings(test: Sequence[str]) -> DatasetSettings:
    """Say how the demonstration's clouds are cut: squares of 10 m side by side, each drawn until every point was seen.

    Args:
        test: Hashes of the bridges that are held out.
    """
    tile = {"size": 10.0, "stride": 10.0, "voxel": VOXEL}
    shares = (0.7, 0.08, 0.22)  # of the bridges that are not for the test one in ten is for validation
    values = {"points": 1024, "fewest": 128, "tile": tile, "shares": shares, "test": list(test)}
    return dataset_settings("local", values, "demo")


def demo_table(classes: tuple[str, ...], rows: Sequence[DemoRow]) -> list[str]:
    """Spell the scores as a table for people.

    Args:
        classes: Class names.
        rows: Of `run_demo`.

    Returns:
        Lines of text.
    """
    heads = [*classes, "mean"]
    lines = [f"{'IoU on bridges never seen':<28}" + "".join(f"{head:>12}" for head in heads)]
    lines += [f"{row.name:<28}" + "".join(f"{value:>12.3f}" for value in [*row.iou, row.mean]) for row in rows]
    lines += ["", f"{'mean of each bridge':<28}" + "".join(f"{bridge:>12}" for bridge in rows[0].bridges)]
    lines += [f"{row.name:<28}" + "".join(f"{value:>12.3f}" for value in row.bridges.values()) for row in rows]
    return lines


def _data_set(place: Path, clouds: Sequence[DemoCloud], test: Sequence[str], progress: Progress) -> Path:
    sources = []
    for cloud in clouds:
        (place / cloud.name).mkdir()
        write_demo_cloud(cloud, place / cloud.name)
        sources.append(Source(place / cloud.name))
    (place / "set").mkdir()
    held = [cloud.bridge for cloud in clouds if cloud.name in test]
    build_dataset(sources, place / "set", demo_settings(held), progress)
    return place / "set"


def _row(name: str, answer: Any, held: StoredSplit, names: Mapping[str, str], progress: Progress, done: int) -> DemoRow:
    count = len(held.classes)
    matrices: dict[str, I64] = {}
    for number in range(len(held)):
        sample = held.sample(number, 0)
        (likely,) = answer.probabilities([sample])
        bridge = names[held.bridge(number)]
        found = confusion(sample.labels, likely.argmax(axis=1), count)
        matrices[bridge] = matrices.get(bridge, np.zeros((count, count), np.int64)) + found
        progress.advance(done + number + 1)
    total = scores(sum(matrices.values(), np.zeros((count, count), np.int64)))
    return DemoRow(
        name,
        total.iou,
        total.mean_iou,
        {bridge: scores(matrix).mean_iou for bridge, matrix in sorted(matrices.items())},
    )


@dataclass(frozen=True)
class _HeightForest:
    """A forest that knows of a point how high it stands, and nothing else."""

    arrays: Mapping[str, NDArray[Any]]

    @classmethod
    def grown(cls, train: StoredSplit) -> "_HeightForest":
        samples = [train.sample(number, 0) for number in range(len(train))]
        labels = np.concatenate([sample.labels for sample in samples])
        heights = np.concatenate([_height(sample) for sample in samples])
        known = labels != UNLABELED
        return cls(grow_forest(heights[known], labels[known], len(train.classes), trees=20, depth=10, seed=0))

    def probabilities(self, samples: Sequence[Sample]) -> list[F32]:
        return [forest_probabilities(self.arrays, _height(sample)) for sample in samples]


@dataclass(frozen=True)
class _Majority:
    """Always the class with most training points."""

    likely: F32

    @classmethod
    def counted(cls, train: StoredSplit) -> "_Majority":
        labels = np.concatenate([train.sample(number, 0).labels for number in range(len(train))])
        counts = np.bincount(labels[labels != UNLABELED], minlength=len(train.classes))
        return cls((np.arange(len(counts)) == counts.argmax()).astype(np.float32))

    def probabilities(self, samples: Sequence[Sample]) -> list[F32]:
        return [np.tile(self.likely, (len(sample.labels), 1)) for sample in samples]


def _height(sample: Sample) -> F32:
    return sample.features[:, sample.channels.index(HEIGHT)][:, None]
