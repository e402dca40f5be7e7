"""A user's own labeled patch and classes: from a class map over a trained model to a labeled scan."""

from __future__ import annotations

import json
from pathlib import Path

import laspy
import numpy as np
import pytest
import torch

from falsework.cli import main
from groundwork.errors import InputError
from learn.datasets.build import Source, build_dataset
from learn.datasets.export import export_dataset
from learn.datasets.settings import dataset_settings
from learn.datasets.stored import StoredSplit
from learn.predict.class_sum import sum_classes
from learn.trained import read_facts, read_weights
from tests.learn.toy_bridge import DECK_HEIGHT, toy_cloud, write_toy

CUT = (
    "--set",
    "points=256",
    "--set",
    "fewest=1",
    "--set",
    "tile.voxel=0.3",
    "--set",
    "tile.size=20.0",
    "--set",
)
APART, OVERLAPPING = "tile.stride=20.0", "tile.stride=10.0"
NET = (
    "--model",
    "pointnet2-ssg",
    "--epochs",
    "3",
    "--batch",
    "2",
    "--set",
    "network.counts=[64, 16]",
    "--set",
    "network.unit=2.0",
    "--set",
    "accelerator=cpu",
)
CLASS_MAP = """title = "of our office"
column = "classification"
[[code]]
id = 70
name = "walkway"
[[code]]
id = 12
name = "leg"
[[code]]
id = 41
name = "meadow"
"""
NUMBERS = {"deck_slab": 70, "column": 12, "pier_cap": 12, "ground": 41}


def call(*words: object) -> int:
    """Run the command line."""
    with pytest.raises(SystemExit) as left:
        main([str(word) for word in words])
    return int(left.value.code or 0)


def write_patch(path: Path, seed: int) -> np.ndarray:
    """Write a scan with the office's numbers; a tenth of it has a number that the map lacks."""
    cloud = toy_cloud(seed, 4000)
    codes = np.array([NUMBERS.get(name, 0) for name in cloud.components], np.uint8)[cloud.columns["component"]]
    codes[::10] = 5
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = np.full(3, 0.001), np.array([4e5, 5e6, 0.0])
    record = laspy.LasData(header)
    record.x, record.y, record.z = cloud.columns["coord"].T
    record.classification = codes
    record.write(str(path))
    return codes


@pytest.fixture(scope="module")
def office(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Train on three bridges of ours, then the head alone on one labeled patch with other classes."""
    root = tmp_path_factory.mktemp("office")
    clouds = [write_toy(root / f"{i}", i, 3000, f"b{i}") for i in range(3)]
    (root / "mine.toml").write_text(CLASS_MAP)
    write_patch(root / "patch.laz", 7)
    assert call("dataset", "local", *clouds, "-o", root / "set", *CUT, APART) == 0
    assert call("train", root / "set", "-o", root / "net", *NET) == 0
    words = (root / "patch.laz", "--class-map", root / "mine.toml", "--table", "own")
    assert call("dataset", "local", *words, "-o", root / "patchset", *CUT, OVERLAPPING) == 0
    tuned = (
        "--init",
        root / "net",
        "--freeze-encoder",
        "--epochs",
        "3",
        "--batch",
        "2",
        "--set",
        "validation=0",
        "--set",
        "accelerator=cpu",
    )
    assert call("train", root / "patchset", "-o", root / "mine", *tuned) == 0
    return root


def test_the_head_learns_other_classes_and_the_encoder_stays(office: Path) -> None:
    """Network, its settings and channels are those of the first model; the way down keeps its weights bit by bit."""
    first, second = read_facts(office / "net"), read_facts(office / "mine")
    assert second.classes == ("leg", "meadow", "walkway")
    assert (second.network, second.settings) == (first.network, first.settings)
    assert second.channels == first.channels == ("x", "y", "z", "height")
    before, after = read_weights(office / "net"), read_weights(office / "mine")
    down = [name for name in before if name.startswith("down.")]
    assert len(down) > 10
    assert all(torch.equal(before[name], after[name]) for name in down)
    assert not torch.equal(before["up.0.0.linear.weight"], after["up.0.0.linear.weight"])


def test_the_model_of_the_package_starts_a_training(
    office: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It needs no path; samples that are cut otherwise are told, with the options that cut them alike."""
    words = (office / "patch.laz", "--class-map", office / "mine.toml", "--table", "own", "-o", tmp_path / "set")
    assert call("dataset", "local", *words, *CUT, OVERLAPPING, "--set", "points=1024") == 0
    tuned = ("--init", "shipped", "--freeze-encoder", "--epochs", "1", "--batch", "2", "--set", "accelerator=cpu")
    assert call("train", tmp_path / "set", "-o", tmp_path / "mine", *tuned, "--set", "validation=0") == 0
    told = capsys.readouterr()
    assert read_facts(tmp_path / "mine").network == "pointnext-s"
    assert "cut otherwise than those of" in told.err + told.out
    assert "--set tile.voxel=0.15" in told.err + told.out
    assert (
        call(
            "train",
            office / "patchset",
            "-o",
            tmp_path / "again",
            "--init",
            office / "mine",
            *tuned[2:],
            "--set",
            "validation=0",
        )
        == 0
    )
    told = capsys.readouterr()
    assert "cut otherwise" not in told.err + told.out


def test_another_scan_is_labeled_with_the_users_numbers(office: Path, tmp_path: Path) -> None:
    """Eight points in ten of a bridge that neither training saw have the office's number; boxes name its classes."""
    codes = write_patch(tmp_path / "scan.laz", 8)
    words = ("predict", tmp_path / "scan.laz", "-o", tmp_path / "out.laz", "--model", office / "mine", "--unit", "m")
    assert call(*words) == 0
    labeled = laspy.read(tmp_path / "out.laz")
    found = np.asarray(labeled["predicted_class"])
    assert set(np.unique(found)) <= {70, 12, 41}
    known = codes != 5
    share = (found[known] == codes[known]).mean()
    assert share > 0.8
    assert share > np.bincount(codes[known]).max() / known.sum() + 0.3
    record = json.loads((tmp_path / "out.instances.json").read_text())
    assert record["classes"] == {"12": "leg", "41": "meadow", "70": "walkway"}
    high = np.array(labeled.xyz)[:, 2] - 30.0 > DECK_HEIGHT - 0.3
    assert (found[high] == 70).mean() > 0.8
    assert call(*words, "--classes", "leg") == 0
    assert set(np.unique(laspy.read(tmp_path / "out.laz")["predicted_class"])) == {12, 255}


def test_what_does_not_go_with_own_classes_is_refused(
    office: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Another table, a class that the map lacks, clouds of ours, noise as a class, a forest to go on with."""
    with pytest.raises(InputError, match="do not determine"):
        sum_classes(("leg",), "own", "kim2023", ())
    with pytest.raises(InputError, match="no such class"):
        sum_classes(("leg",), "own", "", ("arm",))
    for values, words in (({}, "a cloud has none"), ({"noisy_class": True}, "no class for noisy points")):
        (tmp_path / words).mkdir()
        settings = dataset_settings("local", {"table": "own", **values}, "test")
        with pytest.raises(InputError, match=words):
            build_dataset([Source(office / "0")], tmp_path / words, settings)
    assert call("train", office / "patchset", "-o", tmp_path / "f", "--model", "forest", "--init", office / "net") == 2
    assert "a forest cannot start from another model" in capsys.readouterr().err


def test_a_label_without_a_class_is_refused(tmp_path: Path) -> None:
    """A data set that was edited: the error names the file and the classes."""
    toy = write_toy(tmp_path / "a", 0, 3000, "b0")
    settings = dataset_settings("local", {"mode": "metric", "points": 64, "fewest": 1, "tile": {"voxel": 0.5}}, "test")
    build_dataset([Source(toy)], tmp_path / "set", settings)
    (piece, *_) = sorted((tmp_path / "set" / "train").iterdir())
    labels = np.load(piece / "segment.npy")
    labels[0] = 30
    np.save(piece / "segment.npy", labels)
    split = StoredSplit(tmp_path / "set", "train")
    for read in (lambda: split.sample(0, 1), lambda: export_dataset(tmp_path / "set", "s3dis", tmp_path / "out")):
        with pytest.raises(InputError, match=r"segment\.npy: not a class id .found 30.*-1 to 3"):
            read()
