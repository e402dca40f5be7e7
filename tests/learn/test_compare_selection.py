"""Which windows an arm is trained on: by a slow count; which bridges are held out; and draws that arms share."""

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from groundwork.errors import InputError
from groundwork.progress import SILENT
from learn.compare.experiment import ExperimentSettings, Part, experiment_settings, read_part
from learn.compare.pieces import CloudSource, PieceCounts, counts_of, cut_pieces, read_window
from learn.compare.preset import preset_names
from learn.compare.selection import CutScene, check_bridges, losses_of, share_out, windows_of, windows_to_test
from learn.compare.sources import HeldWindows, TrainingWindows, WindowPlace
from learn.datasets.class_tables import class_table
from learn.datasets.labeled_cloud import read_labeled
from learn.datasets.windows import cut_windows
from tests.learn.toy_bridge import toy_cloud, write_toy


def experiment(**more: object) -> ExperimentSettings:
    """Give an experiment with three arms of one set and two tests."""
    values = {
        "arms": {"a": ["a"], "b": ["b"], "ab": ["a", "b"]},
        "tests": {"a": "a", "b": "b"},
        "fewest": 10,
        "shares": (0.5, 0.1, 0.4),
    }
    return ExperimentSettings.model_validate({**values, **more})


def random_scenes(seed: int) -> list[CutScene]:
    """Draw the counts of ten bridges of two clouds; some bridges lack one."""
    rng = np.random.default_rng(seed)
    scenes = []
    for number in range(10):
        counts = {}
        for cloud in ("a", "b"):
            if rng.random() < 0.85:
                whole = rng.integers(0, 30, 12)
                counts[cloud] = PieceCounts(tuple(whole.tolist()), tuple((whole * rng.random(12)).astype(int).tolist()))
        scenes.append(CutScene("bridges", f"{number:04d}", f"hash{number}", Path(f"/{number}"), counts))
    return scenes


@pytest.mark.parametrize("windows", ["all", "pair"])
@pytest.mark.parametrize("seed", range(4))
def test_windows_are_those_that_everything_compared_shows(windows: str, seed: int) -> None:
    """Equal to going through all windows one by one; validation and training share no bridge with the tests."""
    settings, scenes = experiment(windows=windows), random_scenes(seed)
    splits = share_out(settings, {"bridges": [scene.bridge for scene in scenes]})
    assert sorted(splits.values()) == ["test"] * 4 + ["train"] * 5 + ["val"]
    assert settings.groups == ((("a", "b", "ab"),) if windows == "all" else (("a", "b"), ("a", "ab"), ("b", "ab")))
    for group in settings.groups:
        clouds = {part.cloud for arm in group for part in settings.parts(arm)}
        for arm, split in itertools.product(group, ("train", "val")):
            wanted = [
                (scene.name, part.cloud, number)
                for part in settings.parts(arm)
                for scene in scenes
                for number in range(12)
                if splits["bridges", scene.bridge] == split
                and all(cloud in scene.counts for cloud in clouds)
                and all(
                    (scene.counts[cloud].quiet if split == "train" else scene.counts[cloud].all)[number] >= 10
                    for cloud in clouds
                )
            ]
            found = windows_of(scenes, splits, settings, arm=arm, group=group, split=split)
            assert [(place.folder.name.zfill(4), place.cloud, place.number) for place in found] == wanted
    tested = {
        name: {(place.folder, place.number) for place in windows_to_test(scenes, splits, settings, name)}
        for name in "ab"
    }
    assert (tested["a"] == tested["b"]) == (windows == "all")
    assert all(splits["bridges", f"hash{folder.name}"] == "test" for places in tested.values() for folder, _ in places)
    for row in losses_of(scenes, splits, settings):
        assert row.common <= row.valid <= row.candidates


def test_sets_that_are_only_tested_or_only_trained_on() -> None:
    """Illinois is for the test alone; of the others none is held out; a bridge in both is refused."""
    settings = experiment(arms={"k": ["korea/tls"]}, tests={"i": "illinois/local"})
    splits = share_out(settings, {"korea": ["x", "y", "z"], "illinois": ["i"]})
    assert splits["illinois", "i"] == "test"
    assert sorted(split for (name, _), split in splits.items() if name == "korea") == ["train", "train", "val"]
    with pytest.raises(InputError, match="for training and in a set for the test"):
        share_out(settings, {"korea": ["x", "y", "z"], "illinois": ["x"]})
    held = experiment(held=("ha",))
    assert share_out(held, {"bridges": ["hash", "b", "c", "d"]})["bridges", "hash"] == "test"


@pytest.mark.parametrize("mode", ["metric", "paper", "whole"])
def test_all_clouds_of_a_bridge_lie_in_the_same_windows(mode: str, tmp_path: Path) -> None:
    """Two clouds of one bridge: same boxes in the world; what a window holds lies in its box, and none is missing."""
    paths = {name: write_toy(tmp_path / name, seed, 6000, "b") for seed, name in enumerate("ab")}
    settings = experiment(mode=mode, tile={"voxel": 0.05, "stride": 10.0}).cut
    out = tmp_path / "pieces"
    out.mkdir()
    cut_pieces([CloudSource(name, path) for name, path in paths.items()], out, settings, SILENT)
    counts = counts_of(out)
    assert len(counts["a"].all) == len(counts["b"].all) >= {"metric": 12, "paper": 12, "whole": 1}[mode]
    windows = range(len(counts["a"].all))
    for name, path in paths.items():
        cloud = read_labeled(path, None, class_table("kim2023"))
        patches = [read_window(out, name, number) for number in windows]
        assert [len(patch) for patch in patches] == list(counts[name].all)
        assert sum(counts[name].quiet) == sum(int((patch.uncertainty <= 0.1).sum()) for patch in patches)
        if mode == "whole":
            assert len(patches[0]) == len(cloud)
            np.testing.assert_array_equal(patches[0].labels, cloud.labels)
    if mode == "paper":  # laid along the first cloud: those that a data set of it would have
        cloud = read_labeled(paths["a"], None, class_table("kim2023"))
        slow = list(cut_windows(cloud, settings.window, "a"))
        assert [len(window.rows) for window in slow] == list(counts["a"].all)
    if mode == "metric":
        squares = [[read_window(out, name, number) for name in "ab"] for number in windows]
        for first, second in squares:
            if len(first) and len(second):
                np.testing.assert_allclose(first.origin[:2], second.origin[:2])  # height: each from its own points
                for patch in (first, second):
                    assert np.abs(patch.coord[:, :2]).max() <= 5.0 + 1e-3


def test_arms_draw_alike_whatever_their_number_of_windows(tmp_path: Path) -> None:
    """Same index, same share of the windows; every window comes up; held windows are drawn until they are seen."""
    path = write_toy(tmp_path / "a", 0, 6000, "b")
    out = tmp_path / "pieces"
    out.mkdir()
    settings = experiment(points=64, tile={"voxel": 0.2, "stride": 10.0})
    cut_pieces([CloudSource("a", path)], out, settings.cut, SILENT)
    scene = CutScene("bridges", "0", "h", out, counts_of(out))
    splits = {("bridges", "h"): "train"}
    alone = experiment(arms={"a": ["a"]}, tests={"a": "a"}, points=64, fewest=100)
    places = windows_of([scene], splits, alone, arm="a", group=("a",), split="train")
    assert len(places) > 3
    for count in (3, 50):
        source = TrainingWindows(places, settings.sampling, count)
        assert len(source) == count
        first, second = source.sample(1, 7), source.sample(1, 7)
        np.testing.assert_array_equal(first.coord, second.coord)
        assert not np.array_equal(source.sample(1, 8).coord, first.coord)
        assert first.features.shape == (64, 3)
    held = HeldWindows(places, settings.sampling, 10_000)
    seen = {tuple(row) for number in range(len(held)) for row in held.sample(number, 0).coord.round(5).tolist()}
    scaled = (settings.sampling.scaling.apply(read_window(out, "a", place.number).coord) for place in places)
    whole = {tuple(row) for coord in scaled for row in coord.round(5).tolist()}
    assert seen == whole


def test_a_filter_leaves_out_what_it_says_in_training_alone(tmp_path: Path) -> None:
    """An arm sees the points up to its own uncertainty, the others those up to the common one; a test sees all."""
    out = tmp_path / "pieces"
    out.mkdir()
    still = {"flip": False, "rotate": False, "scale": [1.0, 1.0]}
    settings = experiment(mode="whole", filters={"b": 0.2, "ab": 1000.0}, points=8000, augment=still)
    cloud = toy_cloud(0, 3000)
    uncertainty = cloud.columns["uncertainty"]
    cut_pieces([CloudSource("a", write_toy(tmp_path / "a", 0, 3000))], out, settings.cut, SILENT)
    places = [WindowPlace(out, "a", 0, "b0", counts_of(out)["a"].all[0])]
    seen = {}
    for arm in ("a", "b", "ab"):
        sample = TrainingWindows(places, settings.sampling_of(arm), 1).sample(0, 0)
        seen[arm] = len(np.unique(sample.coord, axis=0))
    held = HeldWindows(places, settings.sampling, 10)
    wanted = {"a": (uncertainty <= 0.1).sum(), "b": (uncertainty <= 0.2).sum(), "ab": len(cloud)}
    assert seen == wanted
    assert sorted(held.truth(0).row[: len(cloud)]) == list(range(len(cloud)))


def test_what_is_held_for_a_test_says_which_point_is_which(tmp_path: Path) -> None:
    """A point that overlapping tiles share has one row; rows lead to the cloud's places and labels."""
    out = tmp_path / "pieces"
    out.mkdir()
    settings = experiment(points=64, tile={"voxel": 0.3, "stride": 5.0})
    cut_pieces([CloudSource("a", write_toy(tmp_path / "a", 0, 6000))], out, settings.cut, SILENT)
    counts = counts_of(out)["a"].all
    places = [WindowPlace(out, "a", number, "b0", points) for number, points in enumerate(counts) if points >= 64]
    held = HeldWindows(places, settings.sampling, 10_000)
    known: dict[int, tuple[np.ndarray, int]] = {}
    for index in range(len(held)):
        truth, sample = held.truth(index), held.sample(index, 0)
        assert (truth.cloud, held.bridge(index)) == (0, "b0")
        for row, coord, label in zip(truth.row.tolist(), truth.coord, sample.labels.tolist(), strict=True):
            before = known.setdefault(row, (coord, label))
            np.testing.assert_allclose(before[0], coord, atol=1e-5)
            assert before[1] == label
    assert len(known) < sum(counts)  # tiles overlap


def test_too_few_bridges_are_said_before_anything_is_made() -> None:
    """No bridge for a test, for an arm, for validation; a forest needs none of the last."""
    settings = experiment(tests={"b": "b"})
    names = {f"h{number}": split for number, split in enumerate(("train", "train", "val", "test"))}
    splits = {("bridges", bridge): split for bridge, split in names.items()}
    both = [("bridges", bridge, {"a", "b"}) for bridge in names]
    check_bridges(settings, splits, both)
    for gone, reason in (("h3", "left to test"), ("h2", "left to validate")):
        with pytest.raises(InputError, match=reason):
            check_bridges(settings, splits, [row for row in both if row[1] != gone])
    check_bridges(experiment(tests={"b": "b"}, models=("forest",)), splits, [row for row in both if row[1] != "h2"])
    with pytest.raises(InputError, match="left to train"):
        check_bridges(
            settings, splits, [("bridges", bridge, {"b"} if bridge < "h2" else {"a", "b"}) for bridge in names]
        )
    with pytest.raises(InputError, match="can be held out"):
        share_out(experiment(held=("zz",)), {"bridges": ["a", "b", "c"]})


def test_presets_and_what_is_refused() -> None:
    """Every preset of the package loads; parts are read; what cannot be is one line."""
    assert preset_names() == (
        "global",
        "sensor-matrix",
        "sparse-or-dense",
        "task-local-1",
        "task-local-2",
        "task-local-3",
        "uncertainty-filter",
    )
    for name in preset_names():
        assert experiment_settings(name, {"seeds": 2}).seeds == 2
    assert experiment_settings("sensor-matrix", {}).parts("visible_noise") == (
        Part("bridges", "visible", "local+dense"),
    )
    assert read_part("korea/tls~ local") == Part("korea", "tls", "local")
    for given, reason in (
        ({"pairs": [["mesh", "mash"]]}, "mash"),
        ({"arms": {"x": ["a b"]}}, "no such clouds"),
        ({"shares": [1, 1, 1]}, "add up to 1"),
        ({"sede": 1}, "Did you mean 'seeds'"),
        ({"filters": {"mesh": 0.05}}, "0.1 .noisy. to 1000"),
        ({"filters": {"m": 1.0}}, "not an arm"),
        ({"filters": {"mesh": 1.0}, "noisy_class": True}, "cannot be combined"),
        ({"channels": ["x", "uncertainty"]}, "not a channel"),
        ({"channels": ["height"], "mode": "paper"}, "needs mode"),
    ):
        with pytest.raises(InputError, match=reason):
            experiment_settings("sensor-matrix", given)
    with pytest.raises(InputError, match=r"sensor-matrix.*or a \.toml file"):
        experiment_settings("sensors", {})


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"models": ("forest", "forest")}, "models has one twice"),
        ({"pairs": (("a", "b"), ("a", "b"))}, "pairs has one twice"),
        ({"pairs": (("a", "a"),)}, "compares 'a' with itself"),
    ],
)
def test_an_experiment_counts_nothing_twice(changed: dict[str, Any], words: str) -> None:
    """Repeated models and pairs would make intervals narrower than they are."""
    arms = {"a": ("mesh",), "b": ("dense",)}
    with pytest.raises(ValueError, match=words):
        ExperimentSettings.model_validate({"arms": arms, "tests": {"t": "dense"}, **changed})
