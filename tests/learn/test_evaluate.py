"""`falsework train` and `falsework evaluate`: from a data set to a model and its scores."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from falsework.cli import main
from groundwork.progress import Silent
from learn.evaluate import evaluate_model, score_lines
from learn.metrics import confusion, scores
from learn.sample import Sample
from learn.trained import read_facts, read_network
from tests.learn.toy import CLASSES, ToyBridges


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
    assert record["confusion"] == matrix.tolist() == np.sum(list(record["bridges"].values()), axis=0).tolist()
    assert record["mean_iou"] == scores(matrix).mean_iou
    assert sorted(record["bridges"]) == ["toy-0", "toy-1", "toy-2"]
    share = (labels[labels != 255] == 2).mean()
    assert record["calibration_error"] == pytest.approx(0.75 - share)
    assert record["risk"][-1] == pytest.approx(1 - share)
    json.dumps(record, allow_nan=False)
    assert "deck" in score_lines(record)[3]


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
    assert score_lines(record)[4].split() == ["cable", "0", "-", "-", "-", "-"]


@pytest.fixture
def data_set(monkeypatch: pytest.MonkeyPatch) -> None:
    """A data set of toy bridges in the place of one on disk."""

    def opened(folder: Path, split: str, channels: tuple[str, ...]) -> ToyBridges:
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
    chosen = ["--set", "network.counts=[64, 16]", "--set", "network.unit=2.0", "--set", "accelerator=cpu"]
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
    forest = tmp_path / "forest"
    assert call("train", data, "-o", forest, "--model", "forest", "--set", "network.trees=10") == 0
    assert call("evaluate", forest, data, "-o", tmp_path / "forest.json") == 0
    assert json.loads((tmp_path / "forest.json").read_text())["mean_iou"] > 0.8
    assert call("train", data, "-o", tmp_path / "other", "--model", "forest", "--set", "network.counts=1") == 2
    capsys.readouterr()
    assert call("train", data, "-o", tmp_path / "other", "--model", "pointnet3") == 2
    assert "pointnet2-ssg" in capsys.readouterr().err
    assert call("evaluate", tmp_path, data) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
