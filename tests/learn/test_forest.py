"""A forest votes as scikit-learn's does, from plain arrays; its features are those of simple shapes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.numpy import load_file, save_file
from scipy.spatial.transform import Rotation
from sklearn.ensemble import RandomForestClassifier

from groundwork.errors import InputError
from groundwork.progress import Silent
from learn.models.covariance import NAMES, covariance_features
from learn.models.forest import forest_probabilities, grow_forest
from learn.trained import LEAST_SHARE, TrainedForest, forest_inputs, read_model
from learn.training.calibration import gather_scores
from learn.training.forest import train_forest
from learn.training.settings import TrainSettings
from tests.learn.toy import ToyBridges


def toy(first: int) -> tuple[np.ndarray, np.ndarray]:
    """Features and labels of a few toy bridges."""
    samples = [ToyBridges(2, first=first).sample(row, 0) for row in range(4)]
    known = np.concatenate([sample.labels for sample in samples]) != 255
    features = np.concatenate([covariance_features(sample.coord, (10, 30)) for sample in samples])
    return features[known], np.concatenate([sample.labels for sample in samples])[known]


def test_the_arrays_vote_as_scikit_learn_does(tmp_path: Path) -> None:
    """Same data, same seed: the same probabilities; and the same after a way through a file, without scikit-learn."""
    features, labels = toy(0)
    labels = np.where(labels == 2, 3, labels)  # a class without points between
    arrays = grow_forest(features, labels, 4, trees=7, depth=6, seed=5)
    peer = RandomForestClassifier(7, max_depth=6, class_weight="balanced", random_state=5, min_samples_leaf=2)
    others, _ = toy(30)
    wanted = np.zeros((len(others), 4))
    wanted[:, [0, 1, 3]] = peer.fit(features, labels).predict_proba(others)
    found = forest_probabilities(arrays, others)
    assert np.allclose(found, wanted, atol=1e-6)
    save_file(arrays, tmp_path / "forest.safetensors")
    assert np.array_equal(forest_probabilities(load_file(tmp_path / "forest.safetensors"), others), found)
    program = "import sys, learn.models.forest; print('sklearn' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_a_forest_learns_what_can_be_learnt() -> None:
    """Bridges that it never saw: more than nine points in ten are right."""
    features, labels = toy(0)
    arrays = grow_forest(features, labels, 3, trees=20, depth=10, seed=0)
    others, truth = toy(30)
    assert (forest_probabilities(arrays, others).argmax(axis=1) == truth).mean() > 0.9


def test_the_confidence_of_a_forest_is_fitted_on_other_bridges(tmp_path: Path) -> None:
    """Likelier labels on bridges of neither set, the same classes; without held-out bridges nothing changes."""
    chosen = TrainSettings(model="forest", network={"trees": 12, "depth": 5, "scales": (10, 30)})
    train_forest(ToyBridges(4), chosen, tmp_path / "plain", Silent())
    train_forest(ToyBridges(4), chosen, tmp_path / "fitted", Silent(), held=ToyBridges(3, first=20))
    plain, fitted = (read_model(tmp_path / name) for name in ("plain", "fitted"))
    assert plain.facts.temperature == 1.0
    assert fitted.facts.temperature != 1.0
    assert fitted.facts.training is not None
    assert fitted.facts.training["validation_bridges"] == sorted(
        {ToyBridges(3, first=20).bridge(row) for row in range(len(ToyBridges(3, first=20)))}
    )
    sample = ToyBridges(1, first=40).sample(0, 0)
    (before,), (after,) = plain.probabilities([sample]), fitted.probabilities([sample])
    assert isinstance(plain, TrainedForest)
    assert np.array_equal(before, forest_probabilities(plain.arrays, forest_inputs(sample, (10, 30))))
    assert np.allclose(after.sum(axis=1), 1.0, atol=1e-5)
    known = sample.labels != 255
    truth = sample.labels[known].astype(int)
    losses = [
        -float(np.log(np.maximum(found[known][np.arange(len(truth)), truth], LEAST_SHARE)).mean())
        for found in (before, after)
    ]
    assert losses[1] < losses[0]
    top = np.sort(before, axis=1)
    clear = top[:, -1] > top[:, -2] + 1e-3
    assert np.array_equal(before.argmax(axis=1)[clear], after.argmax(axis=1)[clear])


def test_the_temperature_is_fitted_on_samples_of_the_whole_validation() -> None:
    """Enough points are taken from samples at even distances; too few points are all taken, in their order."""
    asked: list[int] = []

    def score(row: int) -> tuple[torch.Tensor, torch.Tensor]:
        asked.append(row)
        return torch.full((100, 2), float(row)), torch.full((100,), row)

    found = gather_scores(range(10, 74), score, most=1500)
    assert found is not None
    assert found[1].unique().tolist() == sorted(asked) == list(range(10, 74, 4))[: len(asked)]
    assert len(asked) == 15
    whole = gather_scores(range(10), score, most=1500)
    assert whole is not None
    assert whole[0][::100, 1].tolist() == list(range(10))
    assert gather_scores([], score) is None


def test_a_torn_forest_is_refused_before_it_is_walked() -> None:
    """A circle, a child outside, a column that is not there, a missing array."""
    features, labels = toy(0)
    arrays = grow_forest(features, labels, 3, trees=2, depth=3, seed=0)
    circle, outside = arrays["left"].copy(), arrays["right"].copy()
    circle[0], outside[0] = 0, 10_000
    for wrong in (
        {"left": circle},
        {"right": outside},
        {"column": arrays["column"] + 100},
        {"first": np.array([0, 9999, 5])},
    ):
        with pytest.raises(InputError, match="damaged forest"):
            forest_probabilities({**arrays, **wrong}, features)
    with pytest.raises(InputError, match="not a forest"):
        forest_probabilities({"first": arrays["first"]}, features)
    with pytest.raises(InputError, match="one class"):
        grow_forest(features, np.zeros_like(labels), 3, trees=2, depth=3, seed=0)


def test_features_tell_lines_planes_and_walls_apart() -> None:
    """A line is linear, a floor planar and level, a wall planar and upright; a turn about z changes nothing."""
    rng = np.random.default_rng(0)
    flat = np.zeros((200, 3))
    line, floor, wall = flat.copy(), flat.copy(), flat.copy()
    line[:, 0] = rng.random(200)
    floor[:, :2], wall[:, ::2] = rng.random((200, 2)), rng.random((200, 2))
    found = {
        name: dict(zip(NAMES, covariance_features(cloud.astype(np.float32), (200,))[0], strict=False))
        for name, cloud in {"line": line, "floor": floor, "wall": wall}.items()
    }
    assert found["line"]["linearity"] == pytest.approx(1.0)
    assert found["floor"]["planarity"] > 0.7
    assert found["floor"]["scatter"] == pytest.approx(0.0, abs=1e-6)
    assert found["floor"]["verticality"] == pytest.approx(0.0, abs=1e-6)
    assert found["wall"]["verticality"] == pytest.approx(1.0, abs=1e-6)
    cloud = rng.random((300, 3)).astype(np.float32)
    turned = (cloud @ Rotation.from_euler("z", 0.7).as_matrix().T).astype(np.float32)
    assert np.allclose(covariance_features(cloud, (20,)), covariance_features(turned, (20,)), atol=1e-3)


def test_repeated_points_are_no_neighbors() -> None:
    """A draw that is filled up with repetitions has the features of its points."""
    rng = np.random.default_rng(1)
    cloud = rng.random((40, 3)).astype(np.float32)
    rows = np.concatenate([rng.permutation(40) for _ in range(20)])
    assert np.allclose(
        covariance_features(cloud[rows], (10, 30)), covariance_features(cloud, (10, 30))[rows], atol=1e-5
    )
