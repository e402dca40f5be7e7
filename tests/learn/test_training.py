"""A training learns, gives the same bytes again, goes on where it was stopped, and writes a model that predicts."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from groundwork.errors import InputError
from groundwork.progress import Silent
from learn.metrics import confusion, scores
from learn.neighborhoods.trees import Trees
from learn.trained import FACTS, WEIGHTS, read_facts, read_network, read_weights
from learn.training.event_file import EVENTS
from learn.training.loader import EpochOrder, hold_out
from learn.training.settings import TrainSettings
from learn.training.start import begin_with
from learn.training.train import TrainingData, train_network
from tests.learn.toy import CLASSES, ToyBridges

LOG = "log.csv"
SMALL: dict[str, Any] = {"counts": (64, 16), "unit": 2.0}


@pytest.fixture(autouse=True)
def one_thread() -> None:
    """Small tensors gain nothing from threads."""
    torch.set_num_threads(1)


def settings(**changed: Any) -> TrainSettings:
    """Choose a training of a second."""
    base = {"network": SMALL, "epochs": 10, "batch": 2, "accelerator": "cpu", "seed": 3}
    return TrainSettings(**{**base, **changed})


def train(folder: Path, chosen: TrainSettings | None = None, source: ToyBridges | None = None, **more: Any) -> Path:
    """Train on six toy bridges, two of them held out."""
    folder.mkdir(exist_ok=True)
    train_network(TrainingData(source or ToyBridges(6)), chosen or settings(), folder, Silent(), **more)
    return folder


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One training, shared by the tests that only look at it."""
    torch.set_num_threads(1)
    return train(tmp_path_factory.mktemp("model"))


def score(folder: Path) -> float:
    """Score a model on bridges that the training never saw."""
    model, source = read_network(folder), ToyBridges(3, first=50)
    matrix = np.zeros((len(model.classes),) * 2, np.int64)
    for row in range(len(source)):
        sample = source.sample(row, 1)
        (found,) = model.probabilities([sample])
        assert np.allclose(found.sum(axis=1), 1.0, atol=1e-5)
        matrix += confusion(sample.labels, found.argmax(axis=1), len(model.classes))
    return scores(matrix).mean_iou


def test_a_training_learns_what_can_be_learnt(trained: Path) -> None:
    """The mean IoU on bridges never seen is far above that of chance, a fifth."""
    assert score(trained) > 0.8
    assert sorted(path.name for path in trained.iterdir()) == [LOG, EVENTS, FACTS, WEIGHTS]


def test_shuffled_labels_teach_nothing(tmp_path: Path) -> None:
    """With labels that have nothing to do with their points, a model is no better than chance."""
    assert score(train(tmp_path, source=ToyBridges(6, shuffled=True))) < 0.35


def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(trained: Path, tmp_path: Path) -> None:
    """Weights, facts and log, bit by bit; where another training was stopped, this one begins anew all the same."""
    again = train(tmp_path / "again", settings(seed=4), stop_after=1)
    assert (again / "last.ckpt").is_file()
    train(again)
    for name in (WEIGHTS, FACTS, LOG, EVENTS):
        assert (again / name).read_bytes() == (trained / name).read_bytes()
    one, other = (train(tmp_path / f"{seed}", settings(seed=seed, epochs=1)) for seed in (3, 4))
    assert (other / WEIGHTS).read_bytes() != (one / WEIGHTS).read_bytes()


def test_a_stopped_training_goes_on_to_the_same_bytes(trained: Path, tmp_path: Path) -> None:
    """Stopped after two of ten epochs, and called again."""
    train(tmp_path, stop_after=2)
    assert not (tmp_path / WEIGHTS).exists()
    assert len((tmp_path / "log.csv").read_text().splitlines()) == 3
    train(tmp_path)
    for name in (WEIGHTS, FACTS, LOG, EVENTS):
        assert (tmp_path / name).read_bytes() == (trained / name).read_bytes()


def test_a_training_that_diverges_ends_with_a_clear_error(tmp_path: Path) -> None:
    """In the epoch in which the loss is not finite any more, and without a model."""

    class Spoiled(ToyBridges):
        def sample(self, index: int, seed: int) -> Any:
            found = super().sample(index, seed)
            return type(found)(found.coord, np.full_like(found.features, np.nan), found.labels, found.channels)

    with pytest.raises(InputError, match=r"learning_rate: the training diverged: in epoch 1 its .*Lower"):
        train(tmp_path, settings(validation=0.0), source=Spoiled(6))
    assert not (tmp_path / FACTS).exists()


def test_an_error_in_a_process_that_loads_samples_keeps_its_words(tmp_path: Path) -> None:
    """One line, without the traceback that torch adds."""

    class Broken(ToyBridges):
        def sample(self, index: int, seed: int) -> Any:
            if index:
                raise InputError("a label without a class", where="a.npy", hint="Make it again")
            return super().sample(index, seed)

    with pytest.raises(InputError) as caught:
        train(tmp_path, settings(workers=1), source=Broken(6))
    assert str(caught.value) == "a.npy: a label without a class. Make it again"


def test_the_neighborhoods_of_validation_are_searched_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They are kept while the training goes on, also after an interruption, unless they need too much space."""
    searched: list[int] = []
    search = Trees.ball
    monkeypatch.setattr(Trees, "ball", lambda *given: searched.append(1) or search(*given))
    counts = []
    for most in (4e9, 1.0):
        monkeypatch.setattr("learn.training.loader._CACHE_BYTES", most)
        folder = tmp_path / f"{most:g}"
        train(folder, settings(epochs=3), stop_after=1)
        files = len(list((folder / "pyramids").rglob("*.npz"))) if most > 1.0 else 2
        assert files == 2  # samples of the bridge that is held out
        searched.clear()
        train(folder, settings(epochs=3))
        assert not (folder / "pyramids").exists()
        counts.append(len(searched))
    each = counts[1] // (2 * 12 + 2)  # of two epochs, and of the temperature
    assert counts == [(2 * 10 + 2) * each, (2 * 12 + 2) * each]
    assert (tmp_path / "4e+09" / WEIGHTS).read_bytes() == (tmp_path / "1" / WEIGHTS).read_bytes()


def test_a_damaged_checkpoint_is_refused(tmp_path: Path) -> None:
    """A flipped bit that PyTorch does not see, a torn file, a foreign object: one line, and nothing executes."""
    train(tmp_path, stop_after=1)
    path = tmp_path / "last.ckpt"
    whole = path.read_bytes()
    flipped, middle = bytearray(whole), len(whole) // 2
    flipped[middle] ^= 1
    path.write_bytes(flipped)
    torch.load(path, weights_only=True)
    torch.save({"state_dict": Marker(tmp_path / "executed")}, tmp_path / "foreign")
    for data in (bytes(flipped), whole[:middle], (tmp_path / "foreign").read_bytes(), b"\x80\x04."):
        path.write_bytes(data)
        with pytest.raises(InputError, match=r"damaged checkpoint.*Remove it"):
            train(tmp_path)
    assert not (tmp_path / "executed").exists()


class Marker:
    """An object that writes a file where it is unpickled."""

    def __init__(self, path: Path) -> None:
        """Remember the file."""
        self.path = path

    def __reduce__(self) -> Any:
        """Name the call."""
        return Path.touch, (self.path,)


def test_bfloat16_learns_as_well_and_gives_the_same_bytes(tmp_path: Path) -> None:
    """Mixed precision on a CPU: far above chance, the weights stay float32, and two short trainings are equal."""
    short = [train(tmp_path / name, settings(precision="bf16-mixed", epochs=2)) for name in ("a", "b")]
    assert (short[0] / WEIGHTS).read_bytes() == (short[1] / WEIGHTS).read_bytes()
    folder = train(tmp_path / "whole", settings(precision="bf16-mixed"))
    assert {weight.dtype for weight in read_weights(folder).values()} <= {torch.float32, torch.int64}
    assert score(folder) > 0.7


def test_the_earliest_of_the_best_epochs_is_picked(trained: Path) -> None:
    """By the mean IoU of validation, as the log has it; validation shows bridges of its own."""
    rows = [line.split(",") for line in (trained / "log.csv").read_text().splitlines()]
    column = rows[0].index("miou")
    values = [float(row[column]) for row in rows[1:]]
    facts = read_facts(trained)
    assert facts.training is not None
    assert facts.training["picked_epoch"] == values.index(max(values))
    held = facts.training["validation_bridges"]
    training, _ = hold_out(ToyBridges(6), 0.2, 3)
    assert held
    assert not set(held) & {ToyBridges(6).bridge(row) for row in training}


def test_noisy_points_have_a_head_of_their_own(tmp_path: Path) -> None:
    """With a class of noisy points the modern recipe splits the heads, and says so in the model."""
    chosen, classes = settings(epochs=1), (*CLASSES, "noisy_point")
    facts = read_facts(train(tmp_path / "modern", chosen, ToyBridges(6, classes=classes)))
    assert facts.noisy == 3
    sample = ToyBridges(1).sample(0, 0)
    assert read_network(tmp_path / "modern").probabilities([sample])[0].sum(axis=1) == pytest.approx(1.0, abs=1e-5)
    paper = settings(epochs=1, recipe="paper")
    assert read_facts(train(tmp_path / "paper", paper, ToyBridges(6, classes=classes))).noisy is None


def test_a_training_begins_with_a_model_and_leaves_its_encoder_alone(trained: Path, tmp_path: Path) -> None:
    """Frozen, the way down keeps its weights and statistics bit by bit; the head is drawn anew for other classes."""
    classes = ("ground", "pier", "slab", "noisy_point")
    chosen = settings(epochs=1, freeze_encoder=True)
    train(tmp_path, chosen, ToyBridges(6, classes=classes), init=trained)
    before, after = read_weights(trained), read_weights(tmp_path)
    down = [name for name in before if name.startswith("down.")]
    assert down
    assert all(torch.equal(before[name], after[name]) for name in down)
    assert not torch.equal(before["up.0.0.linear.weight"], after["up.0.0.linear.weight"])
    assert after["head.2.weight"].shape[0] == 4
    with pytest.raises(InputError, match="the --init model has other inputs"):
        begin_with(torch.nn.Identity(), trained, ("red", "green", "blue"), classes)
    with pytest.raises(InputError, match="random, and would stay so"):
        train(tmp_path / "random", chosen)
    scaled = tmp_path / "scaled"
    shutil.copytree(trained, scaled)
    stored = json.loads((scaled / FACTS).read_text())
    stored["data"] = {"scaling": {"kind": "constant", "length": 10.0}}
    (scaled / FACTS).write_text(json.dumps(stored))
    data = TrainingData(ToyBridges(6), facts={"scaling": {"kind": "constant", "length": 5.0}})
    with pytest.raises(InputError, match="another scale than those of the model's training"):
        train_network(data, settings(), tmp_path / "other", Silent(), init=scaled)


def test_a_model_is_refused_where_it_does_not_fit(trained: Path, tmp_path: Path) -> None:
    """Other channels, another version, torn weights, a pickle: one line each, and nothing executes."""
    sample = ToyBridges(1).sample(0, 0)
    other = type(sample)(sample.coord, sample.features, sample.labels, ("red", "green", "blue"))
    with pytest.raises(InputError, match="channels of the model"):
        read_network(trained).probabilities([other])
    record = json.loads((trained / FACTS).read_text())
    weights = (trained / WEIGHTS).read_bytes()
    cases: list[tuple[dict[str, Any], bytes, str]] = [
        ({"format_version": 99}, weights, "another version"),
        ({"format": "something"}, weights, "not a model"),
        ({"classes": None}, weights, "damaged"),
        ({"temperature": -1}, weights, "damaged"),
        ({"network": "resnet"}, weights, "no such network"),
        ({"settings": {"counts": [64, 16, 8]}}, weights, "do not fit"),
        ({"settings": {"nonsense": 1}}, weights, "unknown key"),
        ({}, weights[:-10], "not readable as safetensors"),
        ({}, b"\x80\x04cos\nsystem\n(S'true'\ntR.", "not readable as safetensors"),
    ]
    for number, (changes, data, said) in enumerate(cases):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / FACTS).write_text(json.dumps({**record, **changes}))
        (folder / WEIGHTS).write_bytes(data)
        with pytest.raises(InputError, match=said):
            read_network(folder)
    with pytest.raises(InputError, match="not a model"):
        read_network(tmp_path)


def test_what_cannot_be_trained_is_refused(tmp_path: Path) -> None:
    """One bridge alone, one class alone, bridges on both sides."""
    with pytest.raises(InputError, match="another bridge"):
        train(tmp_path, source=ToyBridges(1))
    one_class = ToyBridges(3)
    one_class.sample = lambda index, seed: _of_one_class(ToyBridges(3), index, seed)  # type: ignore[method-assign]
    with pytest.raises(InputError, match="have one class"):
        train(tmp_path, source=one_class)
    with pytest.raises(InputError, match="have a bridge in common"):
        train_network(TrainingData(ToyBridges(3), ToyBridges(1)), settings(), tmp_path, Silent())
    if not torch.cuda.device_count():
        with pytest.raises(InputError, match="torch can use no GPU"):
            train(tmp_path, settings(accelerator="gpu"))


def test_more_devices_than_gpus_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One GPU, two asked for, by name or by `auto`: a clear line before anything is loaded."""
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 1)
    for accelerator in ("gpu", "auto"):
        with pytest.raises(InputError, match="more processes than GPUs"):
            train(tmp_path, settings(accelerator=accelerator, devices=2))


def _of_one_class(source: ToyBridges, index: int, seed: int) -> Any:
    sample = source.sample(index, seed)
    return type(sample)(sample.coord, sample.features, np.zeros_like(sample.labels), sample.channels)


def test_every_epoch_has_its_own_order_and_every_sample_once() -> None:
    """Decided by seed and epoch alone."""
    order, again = EpochOrder(range(10, 20), 1), EpochOrder(range(10, 20), 1)
    first = list(order)
    assert sorted(row for _, row, _ in first) == list(range(10, 20))
    order.set_epoch(1)
    again.set_epoch(1)
    assert list(order) == list(again)
    assert [row for _, row, _ in order] != [row for _, row, _ in first]
