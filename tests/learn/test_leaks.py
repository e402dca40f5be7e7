"""Nothing of the test is in the training: no bridge, no point, and nothing that depends on either."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from authoring.scenes.manifest import SceneRecipe, write_scene_manifest
from authoring.settings import AuthoringSettings
from falsework.cli import main
from falsework.scenario import load_scenario, scene_seed
from groundwork.canonical import folder_digest
from learn.datasets.labeled_cloud import SourceFacts
from learn.datasets.layout import MANIFEST, read_facts, read_piece
from learn.datasets.settings import dataset_settings
from learn.datasets.split import split_bridges
from learn.trained import FACTS, WEIGHTS
from tests.house.house import ROOT
from tests.learn.toy_bridge import write_toy

CUT = (
    "--set",
    "points=128",
    "--set",
    "fewest=1",
    "--set",
    'test=["b4"]',
    "--set",
    "tile.voxel=0.4",
    "--set",
    "tile.size=40.0",
    "--set",
    "tile.stride=40.0",
)
NET = ("--epochs", "1", "--batch", "8", "--set", "network.counts=[64, 16]", "--set", "accelerator=cpu")


def call(*words: object) -> int:
    """Run the command line."""
    with pytest.raises(SystemExit) as left:
        main([str(word) for word in words])
    return int(left.value.code or 0)


@given(
    st.lists(st.tuples(st.integers(0, 12), st.booleans(), st.booleans()), min_size=1, max_size=40),
    st.integers(0, 99),
    st.tuples(st.floats(0, 1), st.floats(0, 1), st.floats(0.01, 1)),
)
def test_no_bridge_is_in_two_splits(
    drawn: list[tuple[int, bool, bool]], seed: int, shares: tuple[float, float, float]
) -> None:
    """Whatever looks, worlds and sensors of whichever bridges; what is for the test alone is in no other split."""
    sources = [
        SourceFacts(f"{i}", f"b{bridge}", f"d{i}", "mesh", evaluate_only=only, test=kept)
        for i, (bridge, only, kept) in enumerate(drawn)
    ]
    whole = [share / sum(shares) for share in shares]
    found = split_bridges(sources, dataset_settings("local", {"seed": seed, "shares": whole}, "test"))
    assert found.keys() == {source.bridge for source in sources}  # one split each
    assert {found[s.bridge] for s in sources if s.evaluate_only or s.test} <= {"test"}
    assert split_bridges(sources[::-1], dataset_settings("local", {"seed": seed, "shares": whole}, "test")) == found


@pytest.fixture(scope="module")
def chains(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Train twice on the same four bridges in two looks each; the bridge of the test is another one each time."""
    root = tmp_path_factory.mktemp("leaks")
    shared = [write_toy(root / f"b{i}_{look}", 10 * i + look, 1500, f"b{i}") for i in range(4) for look in range(2)]
    for number in range(2):
        tests = [
            write_toy(root / f"test{number}_{look}", 90 + 7 * number + look, 1500, f"b4{number}") for look in (0, 1)
        ]
        assert call("dataset", "local", *shared, *tests, "-o", root / f"set{number}", *CUT) == 0
        assert call("train", root / f"set{number}", "-o", root / f"net{number}", *NET) == 0
    return root


def test_a_manifest_keeps_the_test_apart(chains: Path) -> None:
    """No bridge and no source of the test split is in another; nor is any point of a training piece in a test piece."""
    facts = read_facts(chains / "set0")
    parts = {split: [row for row in facts.pieces if row.split == split] for split in ("train", "val", "test")}
    assert all(parts.values())
    for key in ("bridge", "source"):
        sets = [{getattr(row, key) for row in rows} for rows in parts.values()]
        assert sum(map(len, sets)) == len(set().union(*sets))
    assert {row.bridge for row in parts["test"]} == {"b40"}
    places = {
        split: {
            tuple(place)
            for row in rows
            for place in (read_piece(chains / "set0", row, ()).coord + np.array(row.origin)).round(3).tolist()
        }
        for split, rows in parts.items()
    }
    assert len(places["train"]) > 1000
    assert not places["train"] & places["test"]
    assert not places["val"] & places["test"]


def test_the_test_has_no_part_in_what_is_trained(chains: Path) -> None:
    """With other bridges in the test, training and validation splits and the trained weights are the same bytes."""
    first, second = (json.loads((chains / f"set{n}" / MANIFEST).read_text()) for n in (0, 1))
    assert first["sources"] != second["sources"]
    for split in ("train", "val"):
        a, b = ([row for row in found["pieces"] if row["split"] == split] for found in (first, second))
        assert a == b
        assert folder_digest(chains / "set0" / split) == folder_digest(chains / "set1" / split)
    assert (chains / "net0" / WEIGHTS).read_bytes() == (chains / "net1" / WEIGHTS).read_bytes()


def test_a_model_knows_its_bridges_and_evaluate_says_so(chains: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The bridges of a model are those of its two splits; scores on them are announced as too good, others are not."""
    facts = read_facts(chains / "set0")
    training = json.loads((chains / "net0" / FACTS).read_text())["training"]
    for key, split in (("training_bridges", "train"), ("validation_bridges", "val")):
        assert training[key] == sorted({row.bridge for row in facts.pieces if row.split == split})
    assert not {*training["training_bridges"], *training["validation_bridges"]} & {"b40"}
    for split, told in (("test", False), ("train", True), ("val", True)):
        capsys.readouterr()
        assert call("evaluate", chains / "net0", chains / "set0", "--split", split) == 0
        assert ("was trained on" in capsys.readouterr().err) is told


def test_the_bridges_of_the_first_model_are_not_forgotten(
    chains: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A model that began with another one is announced on the bridges of that one, too."""
    alone = [chains / f"test1_{look}" for look in (0, 1)]
    other = [write_toy(tmp_path / f"o{i}", 70 + i, 1500, f"o{i}") for i in range(2)]
    assert call("dataset", "local", *alone, *other, "-o", tmp_path / "set", *CUT, "--set", 'test=["b41"]') == 0
    assert call("train", tmp_path / "set", "-o", tmp_path / "net", "--init", chains / "net0", *NET) == 0
    capsys.readouterr()
    assert call("evaluate", tmp_path / "net", chains / "set0", "--split", "val") == 0
    assert "was trained on" in capsys.readouterr().err
    assert call("evaluate", tmp_path / "net", chains / "set0", "--split", "test") == 0
    assert "was trained on" not in capsys.readouterr().err


def write_run(folder: Path, scenes: list[tuple[str, int, str]]) -> Path:
    """Write a run of toys.

    Args:
        folder: Folder to make.
        scenes: Of each scene the bridge, the seed and the text of its look.
    """
    for number, (bridge, seed, look) in enumerate(scenes):
        scene = folder / "scenes" / f"{number:04d}"
        for sensor in range(2):
            write_toy(scene / "cloud" / f"c{sensor}", 10 * number + sensor, 1500, bridge)
        (scene / "stage/bridge/looks/aged").mkdir(parents=True)
        (scene / "stage/bridge/looks/aged/look.usda").write_text(look)
        (scene / "stage/bridge/bridge.usda").write_text("the same in all scenes")
        write_scene_manifest(SceneRecipe(AuthoringSettings(), seed), scene / "stage")
    return folder


def test_no_look_and_no_seed_of_the_test_is_in_training(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The manifest of a data set says the seed and the looks of each scene of a run; those of the test are its own."""
    run = write_run(tmp_path / "run", [(f"b{i}", 100 + i, f"look {i}") for i in range(5)])
    assert call("dataset", "local", run, "-o", tmp_path / "set", *CUT) == 0
    assert "may be too good" not in capsys.readouterr().err
    facts = read_facts(tmp_path / "set")
    parts = {split: [row.source for row in facts.pieces if row.split == split] for split in ("train", "val", "test")}
    assert all(parts.values())
    for key in ("seed", "look"):
        sets = [{facts.sources[number][key] for number in numbers} for numbers in parts.values()]
        assert all(sets)
        assert not {None, ""} & set().union(*sets)
        assert sum(map(len, sets)) == len(set().union(*sets)) == 5
    assert {facts.sources[number]["seed"] for number in parts["test"]} == {104}


def test_a_shared_seed_or_look_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Where another bridge has the seed or the look of the test, `dataset` says so; clouds without a run state none."""
    scenes = [(f"b{i}", 100 + i, f"look {i}") for i in range(4)]
    for words, seed, look in (("a seed", 100, "its own"), ("a look", 104, "look 0")):
        run = write_run(tmp_path / words, [*scenes, ("b4", seed, look)])
        assert call("dataset", "local", run, "-o", tmp_path / f"set {words}", *CUT) == 0
        (line,) = [line for line in capsys.readouterr().err.splitlines() if "may be too good" in line]
        assert f"the test has {words} in common with the training: 0004/c0, 0004/c1" in line
    plain = [write_toy(tmp_path / f"{i}", i, 1500, f"b{i}") for i in range(5)]
    assert call("dataset", "local", *plain, "-o", tmp_path / "plain", *CUT) == 0
    assert {(source["seed"], source["look"]) for source in read_facts(tmp_path / "plain").sources} == {(None, "")}


def test_no_scenario_of_a_test_has_a_seed_of_the_training() -> None:
    """Every scene of the scenarios that learning uses has a seed of its own."""
    seeds: list[int] = []
    for name in ("learning", "pseudo-korea", "pseudo-illinois", "paper-local", "paper-global"):
        scenario = load_scenario(ROOT / "scenarios" / f"{name}.toml")
        seeds += [scene_seed(scenario.seed, index) for index in range(scenario.scenes)]
    assert len(seeds) > 600
    assert len(set(seeds)) == len(seeds)
