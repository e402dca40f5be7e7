"""The recipes: samples chosen by class, points that count by their uncertainty, and trainings that hold nothing out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import nn

from groundwork.errors import InputError
from groundwork.progress import Silent
from learn.datasets.build import Source, build_dataset
from learn.datasets.settings import SensorSettings, dataset_settings
from learn.datasets.stored import StoredSplit
from learn.losses import cross_entropy, lovasz_softmax
from learn.sample import Sample
from learn.trained import FACTS, WEIGHTS, read_facts, read_weights
from learn.training.loader import EpochOrder, Loaded, collate, count_labels, expected_counts
from learn.training.module import Segmentation, TrainingPlan
from learn.training.settings import TrainSettings, recipe_of
from learn.training.train import TrainingData, train_network
from tests.learn.toy import ToyBridges
from tests.learn.toy_bridge import write_toy

SMALL: dict[str, Any] = {"counts": (64, 16), "unit": 2.0}
MADE = (WEIGHTS, FACTS, "log.csv")


@pytest.fixture(autouse=True)
def one_thread() -> None:
    """Small tensors gain nothing from threads."""
    torch.set_num_threads(1)


def settings(**changed: Any) -> TrainSettings:
    """Choose a training of a second."""
    return TrainSettings(**{"network": SMALL, "epochs": 2, "batch": 4, "accelerator": "cpu", "seed": 3, **changed})


class DoubtfulBridges(ToyBridges):
    """Toy bridges a third of whose points were seen by nobody; their labels may be shuffled among themselves."""

    mixed = False
    told = True

    def sample(self, index: int, seed: int) -> Sample:
        """Draw the points of a sample."""
        sample = super().sample(index, seed)
        doubtful = np.arange(len(sample.labels)) % 3 == 0
        labels = sample.labels.copy()
        if self.mixed:
            labels[doubtful] = np.random.default_rng(seed).permutation(labels[doubtful])
        uncertainty = np.where(doubtful, np.inf, 0.0).astype(np.float32)
        return replace(sample, labels=labels, uncertainty=uncertainty if self.told else None)


def train(folder: Path, source: Any, chosen: TrainSettings, **more: Any) -> Path:
    """Train on a few toy bridges."""
    folder.mkdir(exist_ok=True)
    train_network(TrainingData(source), chosen, folder, Silent(), **more)
    return folder


def doubtful(mixed: bool, told: bool = True) -> DoubtfulBridges:
    """Make the bridges."""
    source = DoubtfulBridges(3)
    source.mixed, source.told = mixed, told
    return source


def test_labels_of_points_that_nobody_saw_teach_nothing(tmp_path: Path) -> None:
    """Under modern the weights are the same bytes whatever they say; they matter with doubt 0, and under paper."""
    for number, (chosen, same) in enumerate(
        [
            (settings(validation=0.0, epochs=1), True),
            (settings(validation=0.0, epochs=1, doubt=0.0), False),
            (settings(validation=0.0, epochs=1, recipe="paper"), False),
        ]
    ):
        a, b = (train(tmp_path / f"{number}{mixed}", doubtful(mixed), chosen) for mixed in (False, True))
        assert ((a / WEIGHTS).read_bytes() == (b / WEIGHTS).read_bytes()) is same


def test_the_paper_knows_no_uncertainty(tmp_path: Path) -> None:
    """With or without it, a training by the paper's recipe gives the same bytes."""
    chosen = settings(validation=0.0, epochs=1, recipe="paper")
    told, untold = (train(tmp_path / f"{told}", doubtful(False, told), chosen) for told in (True, False))
    assert (told / WEIGHTS).read_bytes() == (untold / WEIGHTS).read_bytes()


class Plain(nn.Linear):
    """A network without neighborhoods."""

    def __init__(self) -> None:
        """Three inputs, three classes."""
        super().__init__(3, 3)

    def pyramid(self, coord: Any, search: Any) -> dict[str, Any]:
        """Search nothing."""
        return {}

    def pyramid_parameters(self) -> object:
        """Depend on nothing."""
        return None

    def forward(self, features: torch.Tensor, geometry: Any) -> torch.Tensor:  # type: ignore[override]
        """Score every point by itself."""
        return super().forward(features)


def test_the_loss_of_a_step_is_the_weighted_one() -> None:
    """Cross-entropy with the Gauss of the uncertainty as weight of a point, Lovasz on those up to the doubt."""
    source = ToyBridges(2)
    torch.manual_seed(0)
    network = Plain()
    doubts = np.linspace(0.0, 0.3, 256).astype(np.float32)
    doubts[7] = np.nan
    source.sample = lambda index, seed: replace(ToyBridges(2).sample(index, seed), uncertainty=doubts)  # type: ignore[method-assign]
    chosen = settings()
    recipe = recipe_of(chosen)
    assert recipe.doubt == 0.1
    loaded = Loaded(source, network, ("x", "y", "z"), 0, doubt=recipe.doubt)
    item = collate([loaded[0, 0, 0], loaded[0, 1, 0]])
    plan = TrainingPlan(chosen, recipe, torch.tensor([1.0, 2.0, 3.0]), None, 10)
    module = Segmentation(network, plan, Path(), Silent())
    found = module.training_step(item, 0)
    logits, labels = network(item["features"], {}).flatten(0, 1), item["labels"].flatten()
    known = np.where(np.isnan(doubts), 0.0, doubts)
    points = torch.from_numpy(np.tile(np.exp(-np.square(known / 0.1)), 2)).float()
    sure = labels.where(torch.from_numpy(np.tile(known <= 0.1, 2)), 255)
    wanted = cross_entropy(logits, labels, torch.tensor([1.0, 2.0, 3.0]), points, 0.1) + lovasz_softmax(logits, sure)
    assert found.item() == pytest.approx(wanted.item(), rel=1e-6)
    assert "weights" not in Loaded(source, network, ("x", "y", "z"), 0)[0, 0, 0]  # so is validation loaded


def test_a_sample_that_is_chosen_again_is_drawn_anew() -> None:
    """A sample of a rare class occurs several times in an epoch, each time with other points."""
    counts = np.zeros((40, 2), np.int64)
    counts[:, 0], counts[3, 1] = 100, 5
    places = [place for place in EpochOrder(range(40), 1, counts, 1.0) if place[1] == 3]
    assert len(places) > 10
    assert [before for _, _, before in places] == list(range(len(places)))
    loaded = Loaded(ToyBridges(10), Plain(), ("x", "y", "z"), 0)
    drawn = {loaded[place]["features"].numpy().tobytes() for place in places}
    assert len(drawn) == len(places)
    np.testing.assert_array_equal(loaded[places[5]]["features"], loaded[places[5]]["features"])


def test_samples_are_chosen_by_class_as_often_as_expected() -> None:
    """Over many epochs each class is shown as often as the formula says; without a share each sample comes once."""
    counts = np.array([[100, 0, 0], [90, 10, 0], [100, 0, 0], [50, 0, 0], [95, 4, 1], [100, 0, 0]])
    order = EpochOrder(range(6), 1, counts, 0.5)
    shown = np.zeros((400, 3))
    for epoch in range(400):
        order.set_epoch(epoch)
        rows = [row for _, row, _ in order]
        assert len(rows) == 6
        assert rows == [row for _, row, _ in order]
        shown[epoch] = counts[rows].sum(axis=0)
    expected = expected_counts(counts, 0.5).numpy()
    np.testing.assert_allclose(shown.mean(axis=0), expected, atol=4.0 * (shown.std(axis=0) / 20.0).max())
    assert expected[2] == pytest.approx(0.5 * 1 + 3 * (95 / 535 + 4 / 14 + 1) / 3)
    assert expected_counts(counts, 0.0).tolist() == counts.sum(axis=0).tolist()
    assert sorted(row for _, row, _ in EpochOrder(range(6), 1, counts, 0.0)) == list(range(6))
    assert [place[2] for place in EpochOrder(range(6), 1, counts, 0.0)] == [0] * 6
    source = ToyBridges(2)
    each = count_labels(source, [0, 3], 5)
    assert each.sum(axis=1).tolist() == [252, 252]  # four points of each sample are unlabelled


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build a data set of four toy bridges, one of them without a fraction for validation."""
    root = tmp_path_factory.mktemp("recipe")
    clouds = [write_toy(root / f"{i}", i, 2500, f"b{i}") for i in range(4)]
    (root / "set").mkdir()
    values = {"points": 256, "fewest": 64, "tile": {"voxel": 0.3, "size": 20.0, "stride": 20.0}}
    build_dataset([Source(path) for path in clouds], root / "set", dataset_settings("local", values, "test"))
    return root / "set"


@pytest.mark.parametrize("workers", [0, pytest.param(1, marks=pytest.mark.proof_only)])
def test_a_training_with_everything_goes_on_to_the_same_bytes(folder: Path, tmp_path: Path, workers: int) -> None:
    """Height, sensors, samples by class, doubt: stopped after one of two epochs and gone on with, or in one go."""
    channels = recipe_of(settings()).channels
    assert channels == ("x", "y", "z", "height")

    def run(name: str, stop_after: int | None = None, workers: int = 0) -> Path:
        sensors = recipe_of(settings()).sensors
        assert sensors == SensorSettings()
        source, held = StoredSplit(folder, "train", channels, sensors=sensors), StoredSplit(folder, "val", channels)
        (tmp_path / name).mkdir(exist_ok=True)
        chosen = settings(epochs=2, workers=workers)
        train_network(TrainingData(source, held), chosen, tmp_path / name, Silent(), stop_after=stop_after)
        return tmp_path / name

    whole = run("whole", workers=workers)
    run("stopped", stop_after=1)
    assert not (tmp_path / "stopped" / WEIGHTS).exists()
    stopped = run("stopped") if not workers else run("whole0")
    for name in (WEIGHTS, "log.csv") if workers else MADE:
        assert (whole / name).read_bytes() == (stopped / name).read_bytes()


def test_a_training_that_holds_nothing_out_takes_the_last_epoch(tmp_path: Path) -> None:
    """One bridge is enough then; stopped and gone on with, the bytes are the same; without leave it is refused."""
    with pytest.raises(InputError, match="validation=0"):
        train(tmp_path / "refused", ToyBridges(1), settings())
    chosen = settings(validation=0.0, epochs=4)
    whole = train(tmp_path / "whole", ToyBridges(1), chosen)
    train(tmp_path / "again", ToyBridges(1), chosen, stop_after=2)
    again = train(tmp_path / "again", ToyBridges(1), chosen)
    for name in MADE:
        assert (whole / name).read_bytes() == (again / name).read_bytes()
    facts = read_facts(whole)
    assert facts.training is not None
    assert (facts.training["picked_epoch"], facts.training["validation_bridges"]) == (3, [])
    assert facts.temperature == 1.0
    assert (whole / "log.csv").read_text().splitlines()[1].endswith(",,,")
    shorter = train(tmp_path / "shorter", ToyBridges(1), settings(validation=0.0, epochs=3))
    assert any(
        not torch.equal(a, b) for a, b in zip(read_weights(whole).values(), read_weights(shorter).values(), strict=True)
    )
