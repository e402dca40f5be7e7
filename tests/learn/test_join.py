"""The verbs of learning as one chain: clouds, data set, model, scores, labeled scan."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest
from numpy.typing import NDArray

from falsework.cli import main
from groundwork.errors import InputError
from learn.datasets.class_tables import class_table
from learn.datasets.stored import StoredSplit
from learn.predict.model import named_model
from learn.predict.trained_model import TrainedModel, read_trained_model
from learn.trained import FACTS, TrainedNetwork
from recon.cloud import read_cloud, write_cloud
from recon.formats.laz import write_laz
from tests.learn.toy_bridge import toy_cloud, write_toy
from usd_schemas.taxonomies import taxonomy

COUNT = 2000
HIDDEN = (
    "instance",
    "confidence",
    "label_margin_px",
    "uncertainty",
    "uncertainty_min",
    "uncertainty_max",
    "uncertainty_relative",
    "displacement",
    "surface_distance",
    "reprojection_error",
)
CUT = (
    "--set",
    "points=256",
    "--set",
    "fewest=1",
    "--set",
    'test=["b3"]',
    "--set",
    "tile.voxel=0.3",
    "--set",
    "tile.size=20.0",
    "--set",
    "tile.stride=10.0",
)
MODELS = {
    "forest": ("--model", "forest", "--set", "network.trees=12", "--set", "network.scales=[8, 24]"),
    "net": (
        "--model",
        "pointnet2-ssg",
        "--epochs",
        "3",
        "--batch",
        "4",
        "--set",
        "network.counts=[64, 16]",
        "--set",
        "network.unit=2.0",
        "--set",
        "accelerator=cpu",
    ),
}


def call(*words: object) -> int:
    """Run the command line."""
    with pytest.raises(SystemExit) as left:
        main([str(word) for word in words])
    return int(left.value.code or 0)


@pytest.fixture(scope="module")
def chain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write clouds of four bridges, and make a data set and two models of them with the verbs.

    The bridge of the test is written as LAZ first, and its cloud takes the rounded positions of the file. Another scan,
    `small.laz`, is of a bridge of 8 m on as much ground: few tiles.
    """
    root = tmp_path_factory.mktemp("chain")
    few = toy_cloud(3, 500).columns["coord"]
    few[:, :2] = [4e5, 5e6] + np.array([0.2, 0.3]) * (few[:, :2] - [4e5, 5e6])
    write_laz(root / "small.laz", toy_cloud(3, 500, "b3", coord=few))
    write_laz(root / "scan.laz", toy_cloud(3, COUNT, "b3"))
    rounded = np.array(laspy.read(root / "scan.laz").xyz)
    clouds = [write_toy(root / f"{i}", i, COUNT, f"b{i}", **({"coord": rounded} if i == 3 else {})) for i in range(4)]
    assert call("dataset", "local", *clouds, "-o", root / "set", *CUT) == 0
    for name, words in MODELS.items():
        assert call("train", root / "set", "-o", root / name, *words) == 0
        assert call("evaluate", root / name, root / "set", "-o", root / f"{name}.json") == 0
    return root


def grid(places: NDArray[np.float64]) -> list[tuple[int, ...]]:
    """Give the steps of the file, 0.1 mm, that lie nearest to positions."""
    return [tuple(row) for row in np.rint(places * 1e4).astype(np.int64).tolist()]


def votes(model: TrainedModel, split: StoredSplit) -> dict[tuple[int, ...], NDArray[np.float64]]:
    """Sum what a model says of each point over all samples of a split, by the point's place."""
    found: dict[tuple[int, ...], NDArray[np.float64]] = {}
    for index in range(len(split)):
        patch, rows = split.piece(index)
        (told,) = model.trained.probabilities([split.sample(index, 0)])
        for place, likely in zip(grid(patch.coord[rows] + patch.origin), told, strict=True):
            found[place] = found.get(place, np.zeros(len(likely))) + likely
    return found


@pytest.mark.parametrize("name", list(MODELS))
def test_a_scan_gets_what_the_scored_model_says(chain: Path, tmp_path: Path, name: str) -> None:
    """The labeled copy has the classes that the scored model gives the test split's points; most of them are right."""
    out = tmp_path / "labelled.laz"
    assert call("predict", chain / "scan.laz", "-o", out, "--model", chain / name, "--unit", "m") == 0
    labeled = laspy.read(out)
    predicted = np.asarray(labeled["predicted_class"])
    model = read_trained_model(chain / name)
    said = votes(model, StoredSplit(chain / "set", "test", model.channels))
    ids = {row.name: row.id for row in taxonomy("kim2023").rows}
    table = [ids[name] for name in class_table("kim2023").names]
    known = [(row, said[place]) for row, place in enumerate(grid(np.array(labeled.xyz))) if place in said]
    assert len(known) == len(said) > 1000
    for row, likely in known:
        best = np.flatnonzero(likely > likely.max() - 1e-4 * likely.sum())  # sums in another order may differ there
        assert predicted[row] in {table[i] for i in best}
    truth = np.array(table)[labels_of(chain)]
    majority = np.bincount(truth).max() / len(truth)
    assert np.mean(predicted == truth) > majority + (0.3 if name == "forest" else 0.1)
    record = json.loads((chain / f"{name}.json").read_text())
    assert record["overall_accuracy"] == pytest.approx(np.mean(predicted == truth), abs=0.05)


def labels_of(chain: Path) -> NDArray[np.int64]:
    """Give the true class of each point of the scan."""
    from learn.datasets.class_tables import labels_of_cloud

    return labels_of_cloud(read_cloud(chain / "3"), class_table("kim2023")).astype(np.int64)


def test_a_second_prediction_replaces_its_former_output_alone(
    chain: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Our own copy and boxes are written anew; a stranger's file in the place of either is refused and stays."""
    words = ("predict", chain / "small.laz", "--model", chain / "forest", "--unit", "m", "-o")
    out = tmp_path / "labelled.laz"
    assert call(*words, out) == 0
    first = out.read_bytes()
    assert call(*words, out, "--classes", "deck") == 0
    assert set(np.unique(laspy.read(out)["predicted_class"])) == {3, 255}
    assert call(*words, out) == 0
    assert out.read_bytes() == first
    capsys.readouterr()
    assert call(*words, tmp_path / "labelled.las") == 2
    assert "belongs to labelled.laz" in capsys.readouterr().err
    scan = tmp_path / "labelled.las"  # of the user, beside boxes that speak of the .laz
    scan.write_bytes(b"years of scanning")
    assert call(*words, scan) == 2
    assert scan.read_bytes() == b"years of scanning"
    scan.unlink()
    for name in ("other.laz", "other.instances.json"):
        stranger = tmp_path / name
        stranger.write_text('{"mine": 1}')
        capsys.readouterr()
        assert call(*words, tmp_path / "other.laz") == 2
        assert "did not write" in capsys.readouterr().err
        assert stranger.read_text() == '{"mine": 1}'
        stranger.unlink()
        assert sorted(path.name for path in tmp_path.iterdir()) == ["labelled.instances.json", "labelled.laz"]
    assert call("evaluate", chain / "forest", chain / "set", "-o", chain / "forest" / "model.json") == 2
    assert call("evaluate", chain / "forest", chain / "set", "-o", chain / "scan.laz") == 2
    assert call(*words, chain / "forest" / "out.laz") == 2
    assert "lies inside an input" in capsys.readouterr().err


@pytest.mark.parametrize("again", [False, True])
def test_a_prediction_killed_between_copy_and_boxes_is_repeated_without_ado(
    chain: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, again: bool
) -> None:
    """Whichever rename is the last one, first prediction or second: the same command ends with the same two files."""
    words = ("predict", chain / "small.laz", "--model", chain / "forest", "--unit", "m", "-o")
    out, boxes = tmp_path / "labelled.laz", tmp_path / "labelled.instances.json"
    assert call(*words, out) == 0
    whole = out.read_bytes(), boxes.read_bytes()
    rename = Path.replace
    kills = 4 if again else 2  # labels and boxes; in place of former ones the boxes are written twice
    for dies in range(kills):
        out.unlink()
        boxes.unlink()
        if again:
            assert call(*words, out, "--classes", "deck") == 0
        left = [dies]

        def replace(self: Path, target: Path, left: list[int] = left) -> Path:
            if Path(target).parent == tmp_path and left[0] == 0:
                raise SystemExit(137)
            left[0] -= Path(target).parent == tmp_path
            return rename(self, target)

        with monkeypatch.context() as patched:
            patched.setattr(Path, "replace", replace)
            call(*words, out)
        assert call(*words, out) == 0
        assert (out.read_bytes(), boxes.read_bytes()) == whole
        assert len(list(tmp_path.iterdir())) == 2


def test_a_cloud_is_labeled_by_the_unit_it_says(
    chain: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Our own LAZ needs no --unit; a cloud's folder without one says how to make it; a run without clouds fails."""
    out = tmp_path / "labelled.laz"
    assert call("predict", chain / "scan.laz", "--model", chain / "forest", "-o", out) == 0
    assert json.loads((tmp_path / "labelled.instances.json").read_text())["meters_per_unit"] == 1.0
    capsys.readouterr()
    assert call("predict", chain / "3", "--model", chain / "forest", "-o", out) == 2
    assert "falsework export" in capsys.readouterr().err
    (tmp_path / "run" / "scenes" / "0000").mkdir(parents=True)
    assert call("dataset", "local", tmp_path / "run", "-o", tmp_path / "set") == 2
    assert "the run has no cloud" in capsys.readouterr().err


def test_clouds_of_a_run_are_told_apart_and_empty_splits_are_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Named by scene and cloud; one bridge leaves validation and test empty, and a network refuses to train on it."""
    for scene in ("0000", "0001"):
        write_toy(tmp_path / "run" / "scenes" / scene / "cloud" / "local", int(scene), COUNT, "b0")
    assert call("dataset", "local", tmp_path / "run", "-o", tmp_path / "set", *CUT[:4], *CUT[6:]) == 0
    said = capsys.readouterr().err
    assert "val is empty: the sources show 1 bridge" in said
    assert "test is empty" in said
    assert [row["name"] for row in json.loads((tmp_path / "set" / "dataset.json").read_text())["sources"]] == [
        "0000/local",
        "0001/local",
    ]
    assert "| 0001/local | mesh |" in (tmp_path / "set" / "README.md").read_text()
    assert call("train", tmp_path / "set", "-o", tmp_path / "model", *MODELS["net"]) == 2
    assert "too few bridges" in capsys.readouterr().err
    for words, told in {("--set", "shares=1"): "three numbers", ("--set", "tile=3"): "tile.size=10"}.items():
        assert call("dataset", "local", tmp_path / "run", "-o", tmp_path / "other", *words) == 2
        assert told in capsys.readouterr().err
    assert call("train", tmp_path / "set", "-o", tmp_path / "model", "--epochs", 0) == 2
    assert "--epochs: " in capsys.readouterr().err


@pytest.mark.parametrize("name", list(MODELS))
def test_what_no_scan_knows_leaves_the_logits_unchanged(chain: Path, tmp_path: Path, name: str) -> None:
    """Shuffled uncertainty, confidence, margin and instance of the clouds change no logit of validation and test."""
    rng = np.random.default_rng(4)
    clouds = []
    for number in range(4):
        cloud = read_cloud(chain / f"{number}")
        order = rng.permutation(len(cloud))
        for column in HIDDEN:
            cloud.columns[column][:] = cloud.columns[column][order]
        clouds.append(tmp_path / f"{number}")
        clouds[-1].mkdir()
        write_cloud(clouds[-1], cloud)
    assert call("dataset", "local", *clouds, "-o", tmp_path / "set", *CUT) == 0
    model = read_trained_model(chain / name)
    moved = 0
    for split in ("val", "test"):
        before, after = (StoredSplit(root / "set", split, model.channels) for root in (chain, tmp_path))
        assert len(before) == len(after) > 20
        for index in range(0, len(before), 3):
            moved += int((before.piece(index)[0].uncertainty != after.piece(index)[0].uncertainty).sum())
            samples = before.sample(index, 0), after.sample(index, 0)
            a, b = (logits(model, sample) for sample in samples)
            np.testing.assert_array_equal(a, b)
    assert moved > 1000


def logits(model: TrainedModel, sample: Any) -> NDArray[np.float32]:
    """Ask a network for its logits; a forest has none, and gives probabilities."""
    if not isinstance(model.trained, TrainedNetwork):
        return model.probabilities([sample])[0]
    import torch

    from learn.models.backbone import batched, geometry_of

    module: Any = model.trained.module
    with torch.no_grad():
        return module(torch.from_numpy(sample.features)[None], batched([geometry_of(module, sample.coord)]))[0].numpy()


def test_models_that_cannot_label_a_scan_are_refused(chain: Path, tmp_path: Path) -> None:
    """The paper's windows, a model without its data set, a torn one, no folder: each in one line."""
    facts = json.loads((chain / "forest" / FACTS).read_text())
    assert facts["data"]["table"] == "kim2023"
    assert facts["data"]["scaling"] == {"kind": "constant", "length": 10.0}
    cases: list[tuple[dict[str, Any], str]] = [
        ({"data": {"settings": {**facts["data"]["settings"], "mode": "paper"}}}, "paper's windows"),
        ({"data": {}}, "does not state its data set"),
        ({"data": {"settings": {**facts["data"]["settings"], "tile": 3}}}, "tile"),
        ({"channels": ["x", "y", "truth"]}, "an input that scans do not have"),
        ({"format": "something"}, "not a model"),
    ]
    for number, (changes, said) in enumerate(cases):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / "model.safetensors").write_bytes((chain / "forest" / "model.safetensors").read_bytes())
        (folder / FACTS).write_text(json.dumps({**facts, **changes}))
        with pytest.raises(InputError, match=said) as caught:
            named_model(str(folder))
        assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="not a model"):
        named_model(str(chain / "set"))
    with pytest.raises(InputError, match="no such model"):
        named_model(str(tmp_path / "nothing"))
