"""The demonstration: a network is trained on clouds of the package and compared with simple baselines."""

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
    """Score of one classifier on the held-out bridges.

    Attributes:
        name: Name of the classifier.
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
    """Train on the shipped clouds and score on bridges that were not used for training.

    Args:
        folder: Folder of the model; an interrupted training there is resumed.
        progress: Listener.
        clouds: Clouds to use instead of the shipped ones.
        test: Names of those that are held out.
        changed: Settings of the training that replace the demonstration's own.

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
    """Return how the demonstration's clouds are cut: adjacent squares of 10 m, with draws until every point is seen.

    Args:
        test: Hashes of the bridges that are held out.
    """
    tile = {"size": 10.0, "stride": 10.0, "voxel": VOXEL}
    shares = (0.7, 0.08, 0.22)  # one in ten of the bridges that are not for the test is for validation
    values = {"points": 1024, "fewest": 128, "tile": tile, "shares": shares, "test": list(test)}
    return dataset_settings("local", values, "demo")


def demo_table(classes: tuple[str, ...], rows: Sequence[DemoRow]) -> list[str]:
    """Format the scores as a table.

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
    """A forest whose only input is the height of a point."""

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
    """A baseline that always predicts the class with most training points."""

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
