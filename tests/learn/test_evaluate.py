"""`falsework train` and `falsework evaluate`: from a data set to a model and its scores."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from falsework.cli import main
from falsework.commands.train_verbs import _scored, _voxel
from groundwork.errors import InputError
from groundwork.progress import SILENT, Silent
from learn.datasets.build import Source, build_dataset
from learn.datasets.settings import dataset_settings
from learn.datasets.stored import StoredSplit
from learn.evaluate import evaluate_model
from learn.metrics import confusion, scores
from learn.predict.class_sum import summed_model
from learn.sample import Sample
from learn.scoring.table import score_lines
from learn.trained import ModelFacts, read_facts, read_network
from tests.learn.toy import CLASSES, ToyBridges
from tests.learn.toy_bridge import write_toy


class Certain:
    """A model that calls every point deck, three quarters sure."""

    def probabilities(self, samples: Sequence[Sample]) -> list[np.ndarray]:
        """Give the same probabilities everywhere."""
        return [np.tile(np.array([0.125, 0.125, 0.75], np.float32), (len(s.coord), 1)) for s in samples]


def test_scores_come_from_one_matrix_and_bridges_add_up() -> None:
    """The matrices of the bridges sum to the whole one, from which every score follows."""
    source = ToyBridges(3)
    record = evaluate_model(Certain(), source, Silent())
    labels = np.concatenate([source.sample(row, 0).labels for row in range(6)])
    matrix = confusion(labels, np.full(len(labels), 2), 3)
    bridges = [row["confusion"] for row in record["bridges"].values()]
    assert record["confusion"] == matrix.tolist() == np.sum(bridges, axis=0).tolist()
    assert record["mean_iou"] == scores(matrix).mean_iou
    assert sorted(record["bridges"]) == ["toy-0", "toy-1", "toy-2"]
    share = (labels[labels != 255] == 2).mean()
    assert record["calibration_error"] == pytest.approx(0.75 - share)
    assert record["risk"][-1] == pytest.approx(1 - share)
    json.dumps(record, allow_nan=False)
    assert score_lines(record)[4].split()[1] == "deck"
    assert record["sure"]["classes"] == record["classes"]
    assert record["by_uncertainty"]["points"] == [0, 0, *[int((labels != 255).sum())] * 3]


def test_a_class_that_does_not_occur_has_no_score() -> None:
    """Null in the record, a dash in the table."""
    names = (*CLASSES, "cable")

    class Four(ToyBridges):
        @property
        def classes(self) -> tuple[str, ...]:
            return names

    record = evaluate_model(Certain(), Four(1), Silent())
    assert record["classes"]["cable"] == {"points": 0, "accuracy": None, "precision": None, "iou": None, "f1": None}
    assert record["classes_averaged"] == 3
    assert score_lines(record)[5].replace("|", "").split() == ["cable", "0", "-", "-", "-", "-"]
    assert record["confusion_shares"][3] == [None] * 4


class Wavering:
    """A model of the toy's components whose answer is a fixed hash of the sample and the place in it."""

    classes = ("ground", "column", "pier_cap", "deck_slab", "deck_top")

    def probabilities(self, samples: Sequence[Sample]) -> list[np.ndarray]:
        """Give random probabilities that lean to the height of a point, so that votes differ and matter."""
        told = []
        for sample in samples:
            rng = np.random.default_rng(int(np.abs(sample.features).sum() * 1e3))
            height = sample.coord[:, 2]
            lean = np.stack([-height, 0.4 + 0 * height, height - 0.3, height, height - 0.2], axis=1)
            raw = np.exp(4.0 * lean + rng.normal(0.0, 1.5, lean.shape))
            told.append((raw / raw.sum(axis=1, keepdims=True)).astype(np.float32))
        return told


@pytest.fixture(scope="module")
def overlapping(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set of three bridges, two in the test, whose tiles overlap fourfold and whose last draws are topped up."""
    place = tmp_path_factory.mktemp("overlapping")
    clouds = [write_toy(place / f"{i}", i, 6_000, f"b{i}") for i in range(3)]
    (place / "set").mkdir()
    chosen = {"points": 256, "fewest": 64, "test": ["b1", "b2"], "tile": {"voxel": 0.3}, "shares": (1.0, 0.0, 0.0)}
    build_dataset([Source(path) for path in clouds], place / "set", dataset_settings("local", chosen, "test"))
    return place / "set"


def test_every_point_counts_once_with_the_mean_of_its_votes_as_scikit_learn_scores_it(overlapping: Path) -> None:
    """Means over a dictionary of points, then scikit-learn: accuracy, IoU, precision, F1, matrix, those by threshold.

    A point is known by its uncertainty, which no other one has, so that the rows of ours have no part in it.
    """
    from sklearn import metrics

    source = StoredSplit(overlapping, "test")
    model = summed_model(Wavering(), Wavering.classes, "components", "kim2023", source.classes)
    votes: dict[tuple[str, bytes], list[np.ndarray]] = {}
    labels: dict[tuple[str, bytes], tuple[int, float]] = {}
    for row in range(len(source)):
        patch, drawn = source.piece(row)
        (told,) = model.probabilities([source.sample(row, 0)])
        for point, answer in zip(drawn, told, strict=True):
            key = (source.bridge(row), patch.uncertainty[point].tobytes())
            votes.setdefault(key, []).append(answer)
            labels[key] = int(patch.labels[point]), float(patch.uncertainty[point])
    assert np.mean([len(found) for found in votes.values()]) > 4.0
    truth = np.array([labels[key][0] for key in votes])
    found = np.array([np.mean(rows, axis=0, dtype=np.float64).argmax() for rows in votes.values()])
    record = evaluate_model(model, source, SILENT)
    assert record["points"] == len(votes)
    assert record["votes"] == sum(map(len, votes.values()))
    places = range(len(source.classes))
    each: dict[str, Any] = {"average": None}  # its types know no None, its manual does
    assert record["confusion"] == metrics.confusion_matrix(truth, found, labels=places).tolist()
    rows = list(record["classes"].values())
    assert [row["iou"] for row in rows] == pytest.approx(metrics.jaccard_score(truth, found, **each))
    assert [row["accuracy"] for row in rows] == pytest.approx(metrics.recall_score(truth, found, **each))
    assert [row["precision"] for row in rows] == pytest.approx(metrics.precision_score(truth, found, **each))
    assert [row["f1"] for row in rows] == pytest.approx(metrics.f1_score(truth, found, **each))
    assert record["overall_accuracy"] == pytest.approx(metrics.accuracy_score(truth, found))
    assert record["mean_accuracy"] == pytest.approx(metrics.balanced_accuracy_score(truth, found))
    uncertainty = np.array([labels[key][1] for key in votes], np.float32)
    for limit, value in zip(record["by_uncertainty"]["thresholds"], record["by_uncertainty"]["mean_iou"], strict=True):
        kept = uncertainty <= limit
        assert value == pytest.approx(metrics.jaccard_score(truth[kept], found[kept], average="macro"))
    sure = metrics.jaccard_score(truth[uncertainty <= 0.1], found[uncertainty <= 0.1], **each)
    assert [row["iou"] for row in record["sure"]["classes"].values()] == pytest.approx(sure)
    for bridge, scored in record["bridges"].items():
        mine = np.array([key[0] == bridge for key in votes])
        assert scored["mean_iou"] == pytest.approx(metrics.jaccard_score(truth[mine], found[mine], average="macro"))


class Knowing:
    """A model that knows the true class of each point."""

    def probabilities(self, samples: Sequence[Sample]) -> list[np.ndarray]:
        """Tell it with certainty."""
        return [np.eye(4, dtype=np.float32)[sample.labels] for sample in samples]


def test_the_command_scores_training_samples_as_they_are(overlapping: Path) -> None:
    """A model that knows the truth has no error on train; a source of samples drawn at random has no truth."""
    facts = ModelFacts("pointnet2-ssg", {}, (), ("x", "y", "z"), {})
    source: Any = _scored(facts, overlapping, "train")
    assert evaluate_model(Knowing(), source, SILENT)["mean_iou"] == 1.0
    sample, truth = source.sample(0, 5), source.truth(0)
    size = 10.0 * np.ptp(sample.coord, axis=0)  # 10 m are scaled to 1
    assert np.allclose(np.ptp(truth.coord, axis=0), size, atol=1e-4)
    with pytest.raises(InputError, match="at random"):
        StoredSplit(overlapping, "train", augment=False).truth(0)


def test_a_model_that_knows_the_truth_has_panoptic_quality_one(overlapping: Path) -> None:
    """Against the connected parts of the true classes every instance matches; those modeled are one a class here."""
    source = StoredSplit(overlapping, "test")
    record = evaluate_model(Knowing(), source, SILENT, _voxel(source))
    assert record["panoptic"]["link"] == 0.6  # its points are up to two cubes of 0.3 m apart
    assert record["panoptic"]["parts"]["mean"] == record["mean_iou"] == 1.0
    assert record["calibration_error"] == 0.0
    modeled = record["panoptic"]["modelled"]["classes"]
    assert {name: row["true"] for name, row in modeled.items()} == {
        "background": 2,
        "column": 2,
        "pier_cap": 2,
        "deck": 2,
    }


def test_what_cannot_be_scored_is_one_line(overlapping: Path, tmp_path: Path) -> None:
    """Classes that do not determine the table, and pieces that do not know their points."""
    with pytest.raises(InputError, match="do not determine"):
        summed_model(Wavering(), ("pier", "deck"), "kim2020", "kim2023", ("background", "column", "pier_cap", "deck"))
    with pytest.raises(InputError, match="other classes"):
        summed_model(Wavering(), ("deck",), "kim2023", "components", ("kerb",))
    old = tmp_path / "old"
    shutil.copytree(overlapping, old)
    manifest = json.loads((old / "dataset.json").read_text())
    (old / "dataset.json").write_text(json.dumps({**manifest, "format_version": 1}))
    assert len(StoredSplit(old, "train").sample(0, 0).coord) == 256
    with pytest.raises(InputError, match="Make the data set again"):
        evaluate_model(Wavering(), StoredSplit(old, "test"), SILENT)


@pytest.fixture
def data_set(monkeypatch: pytest.MonkeyPatch) -> None:
    """A data set of toy bridges in the place of one on disk."""

    def opened(folder: Path, split: str, channels: tuple[str, ...], **_: object) -> ToyBridges:
        assert channels == ("x", "y", "z")
        first = {"train": 0, "val": 20, "test": 40}[split]
        return ToyBridges(2 if split != "train" else 4, first=first)

    module: Any = ModuleType("learn.datasets.stored")
    module.StoredSplit = opened
    monkeypatch.setitem(sys.modules, "learn.datasets.stored", module)


def call(*words: object) -> int:
    """Run the command line."""
    with pytest.raises(SystemExit) as left:
        main([str(word) for word in words])
    return int(left.value.code or 0)


@pytest.mark.usefixtures("data_set")
def test_the_command_line_trains_and_evaluates(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What was chosen stands in the model, the JSON is the record; a wrong word is one line and exit code 2."""
    model, data = tmp_path / "model", tmp_path / "data"
    data.mkdir()
    (data / "dataset.json").write_text("{}")
    chosen = [
        "--channels",
        "x,y,z",
        "--set",
        "network.counts=[64, 16]",
        "--set",
        "network.unit=2.0",
        "--set",
        "accelerator=cpu",
    ]
    assert call("train", data, "-o", model, "--epochs", 2, "--batch", 2, *chosen) == 0
    facts = read_facts(model)
    assert facts.settings == {"counts": [64, 16], "unit": 2.0}
    assert facts.training is not None
    assert facts.training["validation_bridges"] == ["toy-20", "toy-21"]
    capsys.readouterr()
    assert call("evaluate", model, data, "-o", tmp_path / "scores.json", "--json") == 0
    printed = json.loads(capsys.readouterr().out)
    record = json.loads((tmp_path / "scores.json").read_text())
    assert printed == {"version": 1, **record}
    assert record == evaluate_model(read_network(model), ToyBridges(2, first=40), Silent())
    page = (tmp_path / "scores.md").read_text()
    assert page.startswith("<!-- made by falsework -->")
    assert page.splitlines()[3:] == score_lines(record)
    assert call("evaluate", model, data, "-o", tmp_path / "scores.json") == 0  # its own files are replaced
    (tmp_path / "notes.md").write_text("mine")
    assert call("evaluate", model, data, "-o", tmp_path / "notes.json") == 2
    assert (tmp_path / "notes.md").read_text() == "mine"
    assert not (tmp_path / "notes.json").exists()
    forest = tmp_path / "forest"
    assert (
        call("train", data, "-o", forest, "--model", "forest", "--channels", "x,y,z", "--set", "network.trees=10") == 0
    )
    assert call("evaluate", forest, data, "-o", tmp_path / "forest.json") == 0
    assert json.loads((tmp_path / "forest.json").read_text())["mean_iou"] > 0.8
    assert call("train", data, "-o", tmp_path / "other", "--model", "forest", "--set", "network.counts=1") == 2
    capsys.readouterr()
    assert call("train", data, "-o", tmp_path / "other", "--model", "pointnet3", "--channels", "x,y,z") == 2
    assert "pointnet2-ssg" in capsys.readouterr().err
    assert call("evaluate", tmp_path, data) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_the_demo_refuses_options_that_it_would_ignore(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Recipe, batch and a frozen encoder are its own, as the other options are."""
    for words in (("--recipe", "paper"), ("--batch", 4), ("--freeze-encoder",)):
        assert call("train", "--demo", "-o", tmp_path / "model", *words) == 2
        assert f"{words[0]}: not allowed with --demo" in capsys.readouterr().err
