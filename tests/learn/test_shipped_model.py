"""The command that makes the model of the package, on toys: held bridges stay out, and the card says what was done."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.shipped.card import card_text
from benchmarks.shipped.lean import choose, lean_model, leaning, measure
from benchmarks.shipped.mean import mean_model
from benchmarks.shipped.model import (
    STRIDE,
    bridge_of,
    check_unseen,
    clouds_below,
    dataset_of,
    ship,
    train_on,
)
from benchmarks.shipped.pack import STEP, chosen_rows, pack, unpack, write_pack
from benchmarks.shipped.robustness import page
from benchmarks.shipped.scan_scores import Labeled, label_scan, read_labeled_scan
from benchmarks.shipped.selection import joined, judge_cloud, judge_kept, overlapping
from benchmarks.shipped.selection import page as selection_page
from groundwork.canonical import file_digest
from groundwork.errors import InputError
from groundwork.files import read_json, write_json
from learn.datasets.class_tables import is_background
from learn.datasets.layout import read_facts, read_piece
from learn.datasets.patch import Scaling, make_sample
from learn.datasets.settings import DatasetSettings, dataset_settings
from learn.metrics import scores
from learn.predict.trained_model import read_trained_model
from learn.trained import WEIGHTS, read_weights, write_model
from learn.trained import read_facts as read_model_facts
from learn.training.start import seen_by
from tests.learn.toy_bridge import toy_cloud, write_toy

# A small network on small samples: what is tested here depends on neither. So many fast steps that it says several
# classes; after two usual ones it says one at every point, and two equal predictions prove little.
SAMPLES = 32
SMALL: dict[str, Any] = {
    "epochs": 3,
    "learning_rate": 0.02,
    "batch": 2,
    "precision": "32-true",
    "network": {"width": 8, "neighbours": 8},
}


def small_samples(kind: str, values: dict[str, Any], where: str) -> DatasetSettings:
    """Choose a quarter of the usual points of a sample."""
    return dataset_settings(kind, {**values, "points": 1024}, where)


@pytest.fixture(scope="module", autouse=True)
def small() -> Iterator[None]:
    """Let every data set here have small samples."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("benchmarks.shipped.model.dataset_settings", small_samples)
        yield


@pytest.fixture(scope="module")
def made(small: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three toy bridges; a model of 48 steps; one bridge picks the epoch, one is for the test."""
    root = tmp_path_factory.mktemp("shipped")
    for number, name in enumerate(("train", "pick", "test")):
        write_toy(root / "clouds" / name / "mesh", number, 4_000, f"{name}bridge")
    (root / "scenes").symlink_to(root / "clouds")  # as the scenes of a run are
    clouds = [root / "clouds" / path.relative_to(root / "scenes") for path in clouds_below([root / "scenes"])]
    dataset_of(clouds, ["pick", "test"], 0, root / "dataset")
    train_on(root / "dataset", ["pick"], root / "model", SMALL, SAMPLES)
    ship(root / "model", root / "shipped")
    (root / "shipped" / "README.md").write_text(
        card_text(root / "shipped", root / "dataset", {"test mesh": root / "clouds" / "test" / "mesh"}, ["pick"])
    )
    return root


@pytest.fixture(scope="module")
def labeled(made: Path) -> Labeled:
    """What the shipped model says of the test scan, as a prediction finds it."""
    found = label_scan(read_labeled_scan(made / "clouds" / "test" / "mesh"), read_trained_model(made / "shipped"))
    # So that comparisons bite; no share, as 48 steps end a little differently on other processors.
    assert (np.bincount(found.found["kim2023"]) >= 20).sum() >= 3
    return found


def test_held_bridges_are_not_trained_on(made: Path) -> None:
    """Only the bridge that nobody holds is in the split for training; the epoch was picked on the one named."""
    facts = read_facts(made / "dataset")
    assert {row.bridge for row in facts.pieces if row.split == "train"} == {"trainbridge"}
    model = read_trained_model(made / "shipped")
    assert model.trained.facts.training is not None
    assert model.trained.facts.training["validation_bridges"] == ["pickbridge"]


def test_a_packed_data_set_is_the_same_to_the_centimeter(made: Path, tmp_path: Path) -> None:
    """Two packs make one data set: places, labels and bridges of every piece that was kept."""
    facts = read_facts(made / "dataset")
    rows = chosen_rows(made / "dataset", facts, ["pick"], land=1, every=1)
    assert {row.bridge for row in rows} == {"trainbridge", "pickbridge"}
    write_pack(tmp_path / "one.pack", facts, rows, pack(made / "dataset", rows))
    unpack([tmp_path / "one.pack", tmp_path / "one.pack"], tmp_path / "whole")
    again = read_facts(tmp_path / "whole")
    assert [row.source for row in again.pieces] == [
        row.source + turn * len(facts.sources) for turn in (0, 1) for row in rows
    ]
    for row, kept in zip(again.pieces, [*rows, *rows], strict=True):
        found, truth = (
            read_piece(root, which, ()) for root, which in ((tmp_path / "whole", row), (made / "dataset", kept))
        )
        assert row.bridge == kept.bridge
        assert row.split == kept.split
        nearest = [np.abs(truth.coord - point).max(axis=1) for point in found.coord[:: len(found) // 20]]
        assert max(away.min() for away in nearest) <= 0.5 * STEP + 1e-4
        assert np.array_equal(np.sort(found.labels), np.sort(truth.labels))
        assert all(
            found.labels[place * (len(found) // 20)] == truth.labels[away.argmin()]
            for place, away in enumerate(nearest)
        )


def test_the_shipped_weights_are_the_trained_ones_and_tiles_overlap(made: Path) -> None:
    """Every array is equal; what differs is how far the tiles of a prediction lie apart."""
    before, after = read_weights(made / "model"), read_weights(made / "shipped")
    assert before.keys() == after.keys()
    assert all(bool((before[name] == after[name]).all()) for name in before)
    assert read_trained_model(made / "shipped").tile.stride == STRIDE
    assert read_trained_model(made / "model").tile.stride == 2 * STRIDE


def test_the_card_says_what_was_done(made: Path, labeled: Labeled) -> None:
    """The hash of the weights, the part of every bridge, and the scores of the test scan as they are found again."""
    card = (made / "shipped" / "README.md").read_text()
    assert file_digest(made / "shipped" / WEIGHTS) in card
    parts = {row.split("|")[1].strip(): row.split("|")[2].strip() for row in card.splitlines() if row.startswith("| `")}
    assert parts == {"`trainbridge`": "training", "`pickbridge`": "epoch", "`testbridge`": "test"}
    right = (labeled.truth["kim2023"] == labeled.found["kim2023"])[labeled.truth["kim2023"] != 255].mean()
    assert f"{right:.3f}" in next(line for line in card.splitlines() if line.startswith("| test mesh"))


def test_units_axes_and_places_cost_nothing(made: Path, tmp_path: Path) -> None:
    """Feet, y up and a place 1,000 km away are the same scan to the model, whatever it has learnt."""
    coord = toy_cloud(2, 1_500).columns["coord"]
    coord[:, 0] = 4e5 + 0.25 * (coord[:, 0] - 4e5)  # ten meters of bridge: few tiles
    scan = read_labeled_scan(write_toy(tmp_path / "short", 2, 1_500, "shortbridge", coord=coord))
    lines = page({"toy": scan}, read_trained_model(made / "shipped"), "a toy").splitlines()
    rows = {
        line.split("|")[1].strip(): [cell.strip() for cell in line.split("|")[2:-1]] for line in lines if "|" in line
    }
    for way in ("feet", "y up", "moved by 1,000 km"):
        assert np.abs([float(value) for value in rows[way][:4]]).max() < 0.02, way
        assert rows[way][4] == "yes"
    assert "falsely bridge" in rows["scan"]


def test_a_cloud_that_says_no_bridge_is_refused(tmp_path: Path) -> None:
    """Older clouds are named by the geometry in the manifest beside them."""
    cloud = write_toy(tmp_path / "0000" / "tls", 0, 100, "")
    with pytest.raises(InputError, match="which bridge"):
        bridge_of(cloud)
    write_json(tmp_path / "0000" / "manifest.json", {"files": {"bridge/geometry.usdc": "abc"}})
    assert bridge_of(cloud) == "abc"


def test_candidates_are_judged_as_the_shipped_model_would_be(made: Path, labeled: Labeled) -> None:
    """A candidate's confusion is that of the model that would be shipped, and the page says its mean IoU."""
    cloud = made / "clouds" / "test" / "mesh"
    row = joined("pointnext-s", 1.25, [judge_cloud(overlapping(made / "model"), cloud, np.inf)])
    found = labeled.matrix("kim2023")
    np.testing.assert_array_equal(row.matrices["mesh"]["kim2023"], found)
    text = selection_page({"toy": replace(row, apart={"mesh": (30, 400)})}, 1)
    assert "| toy       | 7.5% | 7.5% |" in text
    assert f"| {scores(found).mean_iou:.3f} |" in text
    assert "| toy " in text


def test_what_was_judged_is_kept(made: Path, tmp_path: Path) -> None:
    """A second call reads what the first one found; another reach is judged anew."""
    cloud, work = made / "clouds" / "test" / "mesh", tmp_path / "kept"
    first = judge_kept(work, made / "model", cloud, np.inf)
    (kept,) = work.iterdir()
    write_json(kept, {**read_json(kept), "seconds": 123.0})
    second = judge_kept(work, made / "model", cloud, np.inf)
    assert second.seconds == 123.0
    assert (second.kind, second.apart, second.points) == (first.kind, first.apart, first.points)
    np.testing.assert_array_equal(second.matrices["falsework"], first.matrices["falsework"])
    assert judge_kept(work, made / "model", cloud, 20.0).seconds < 123.0
    assert len(list(work.iterdir())) == 2


def test_a_forest_is_a_candidate(made: Path) -> None:
    """Trained on the same varied samples, it knows the same kinds and is read like a network."""
    settings = {"model": "forest", "network": {"trees": 2, "depth": 4, "points": 500, "scales": [10]}}
    train_on(made / "dataset", ["pick"], made / "forest", settings, 4)
    forest, network = read_trained_model(made / "forest"), read_trained_model(made / "model")
    assert forest.trained.facts.network == "forest"
    assert forest.classes == network.classes


def test_what_is_far_from_a_bridge_is_counted_apart(made: Path, tmp_path: Path) -> None:
    """Ground up to 60 m beside the bridge: what a candidate calls bridge beyond 30 m from its box, point by point."""
    toy = toy_cloud(5, 4_000).columns
    coord, ground = toy["coord"].copy(), toy["component"] == 3
    coord[:, 0] = 4e5 + 0.25 * (coord[:, 0] - 4e5)  # ten meters of bridge: few tiles
    coord[ground, 1] = 5e6 + 4.0 * (coord[ground, 1] - 5e6)
    cloud = write_toy(tmp_path / "wide", 5, 4_000, "widebridge", coord=coord)
    model = overlapping(made / "model")
    false, count = judge_cloud(model, cloud, np.inf).apart
    found = label_scan(read_labeled_scan(cloud), model)
    low, high = coord[~ground].min(axis=0) - 30.0, coord[~ground].max(axis=0) + 30.0
    far = ((found.place[:, :2] < low[:2]) | (found.place[:, :2] > high[:2])).any(axis=1)
    assert count == far.sum() > 500
    assert false == (found.found["falsework"][far] != 0).sum()
    near = joined("pointnext-s", 1.25, [judge_cloud(model, cloud, 20.0)])
    assert near.apart["mesh"] == (0, 0)
    assert 0 < near.matrices["mesh"]["kim2023"].sum() < len(found.place)
    assert "scans of bridges that training held back, up to 20 m round each, labeled" in selection_page(
        {"a": near}, 1, 20.0
    )


def test_a_model_that_leans_says_what_was_measured(made: Path, tmp_path: Path) -> None:
    """The summand in the bias multiplies the odds of the surroundings by what was asked for, at every point."""
    lean_model(made / "model", 1.5, tmp_path / "leant")
    plain, leant = overlapping(made / "model"), overlapping(tmp_path / "leant")
    rest = is_background(plain.classes)
    patch = read_piece(made / "dataset", read_facts(made / "dataset").pieces[0], ())
    sample = make_sample(patch, np.arange(len(patch))[:4096], ("z",), Scaling("constant", 10.0))
    before, after = plain.probabilities([sample])[0], leant.probabilities([sample])[0]
    np.testing.assert_allclose(after, leaning(before, rest, 1.5), atol=1e-5)
    odds = [told[:, rest].sum(axis=1) / told[:, ~rest].sum(axis=1) for told in (before, after)]
    np.testing.assert_allclose(odds[1] / odds[0], np.exp(1.5), rtol=1e-3)


def test_the_lean_is_the_best_of_those_that_are_enough(made: Path, labeled: Labeled) -> None:
    """Among the rows with few false points that with the highest mean IoU; where none has, the least false one."""
    rows = [(0.0, 0.30, {"a": 0.9, "b": 0.9}), (1.0, 0.02, {"a": 0.5, "b": 0.7}), (2.0, 0.01, {"a": 0.6, "b": 0.5})]
    assert choose(rows) == 1.0
    assert choose(rows[:1]) == 0.0
    scan = read_labeled_scan(made / "clouds" / "test" / "mesh")
    found = measure(overlapping(made / "model"), [scan])
    assert found[0][0] == 0.0
    assert found[0][2]["kim2023"] == pytest.approx(scores(labeled.matrix("kim2023")).mean_iou)


def test_what_a_model_began_with_is_not_forgotten(made: Path, tmp_path: Path) -> None:
    """A further training knows the bridges of the first, says so in the card, and is not tested on one of them."""
    assert seen_by(made / "model") == ["pickbridge", "trainbridge"]
    write_toy(tmp_path / "clouds" / "other", 7, 4_000, "otherbridge")
    dataset_of(clouds_below([tmp_path / "clouds", made / "clouds" / "pick"]), ["pick"], 0, tmp_path / "dataset")
    train_on(tmp_path / "dataset", ["pick"], tmp_path / "model", SMALL, 4, made / "model")
    assert seen_by(tmp_path / "model") == ["otherbridge", "pickbridge", "trainbridge"]
    card = card_text(tmp_path / "model", tmp_path / "dataset", {}, ["pick"])
    parts = {row.split("|")[1].strip(): row.split("|")[2].strip() for row in card.splitlines() if row.startswith("| `")}
    assert parts == {"`trainbridge`": "the model before", "`otherbridge`": "training", "`pickbridge`": "epoch"}
    with pytest.raises(InputError, match="has learnt from it"):
        check_unseen(tmp_path / "model", ["train"])
    check_unseen(tmp_path / "model", ["test"])


def test_a_mean_lies_between_two_models(made: Path, tmp_path: Path) -> None:
    """Every weight a quarter of the way; with all of the second it is the second; another network is refused."""
    lean_model(made / "model", 2.0, tmp_path / "other")
    mean_model(made / "model", tmp_path / "other", 0.25, tmp_path / "mean")
    mean_model(made / "model", tmp_path / "other", 1.0, tmp_path / "whole")
    first, second, mean = (read_weights(path) for path in (made / "model", tmp_path / "other", tmp_path / "mean"))
    for name, value in mean.items():
        if value.is_floating_point():
            np.testing.assert_allclose(value, 0.75 * first[name] + 0.25 * second[name], rtol=1e-5, atol=1e-7)
        assert value.dtype == second[name].dtype
    assert not np.allclose(mean["head.2.bias"], second["head.2.bias"])
    whole = read_weights(tmp_path / "whole")
    assert all(np.array_equal(whole[name], value) for name, value in second.items())
    write_model(tmp_path / "net", replace(read_model_facts(made / "model"), channels=("x",)), first)
    with pytest.raises(InputError, match="another model"):
        mean_model(made / "model", tmp_path / "net", 0.5, tmp_path / "no")
