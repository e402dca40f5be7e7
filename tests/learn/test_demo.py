"""The demonstration: its clouds are whole and apart, and a network learns from them what simple answers do not know."""

from __future__ import annotations

import time
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from scipy.spatial import KDTree

from benchmarks.speed_unit import slower
from falsework.cli import main
from groundwork.progress import Silent
from learn.datasets.class_tables import class_table
from learn.datasets.labeled_cloud import read_labeled
from learn.datasets.settings import TileSettings
from learn.datasets.tiles import thin
from learn.demo import demo
from learn.demo.clouds import FILE, STEP, VOXEL, DemoCloud, demo_clouds, pack_clouds, thin_cloud, write_demo_cloud
from learn.demo.demo import TEST, demo_table, run_demo
from learn.demo.ready_made import CUT, small_enough
from recon.cloud import read_cloud
from tests.conftest import RecordProof
from tests.learn.toy_bridge import write_toy


@pytest.fixture(autouse=True)
def one_thread() -> None:
    """Small tensors gain nothing from threads."""
    torch.set_num_threads(1)


def test_the_shipped_clouds_are_what_is_promised(tmp_path: Path) -> None:
    """A few megabytes; four bridges of three families are held out; every bridge is another one and has all classes."""
    clouds = demo_clouds()
    assert len(files("learn").joinpath("demo", FILE).read_bytes()) < 3_000_000
    assert len({cloud.bridge for cloud in clouds}) == len({cloud.name for cloud in clouds}) == len(clouds) >= 16
    assert set(TEST) <= {cloud.name for cloud in clouds}
    assert len({name.rstrip("0123456789") for name in TEST}) >= 2
    for cloud in clouds:
        folder = tmp_path / cloud.name
        folder.mkdir()
        write_demo_cloud(cloud, folder)
        found = read_labeled(folder, None, class_table("kim2023"))
        assert np.bincount(found.labels, minlength=4)[:4].min() > 40
        assert (found.labels != 255).all()
        assert np.ptp(found.coord[:, 0]) < 400.0


def test_a_cloud_goes_into_the_file_and_out_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Positions to half a step, one point a cube, labels as in the cloud that it was thinned from."""
    write_toy(tmp_path / "toy", 3, 6000)
    small = thin_cloud(tmp_path / "toy", "toy3")
    (tmp_path / "demo").mkdir()
    pack_clouds([small, small], tmp_path / "demo" / FILE)
    monkeypatch.setattr("learn.demo.clouds.files", lambda room: tmp_path)
    found = demo_clouds()
    assert len(found) == 2
    for cloud in found:
        np.testing.assert_allclose(cloud.coord, small.coord, atol=1e-9)
        assert np.array_equal(cloud.kind, small.kind)
        assert (cloud.name, cloud.bridge, cloud.kinds) == ("toy3", "b0", small.kinds)
    (tmp_path / "back").mkdir()
    write_demo_cloud(found[0], tmp_path / "back")
    cloud, table = read_cloud(tmp_path / "toy"), class_table("kim2023")
    middle = np.round(thin(cloud.columns["coord"], {}, TileSettings(voxel=VOXEL)).coord.mean(axis=0))
    apart, found_rows = KDTree(cloud.columns["coord"]).query(read_cloud(tmp_path / "back").columns["coord"] + middle)
    assert apart.max() <= 0.5 * STEP * np.sqrt(3.0) + 1e-9
    rows = np.asarray(found_rows)
    wanted = read_labeled(tmp_path / "toy", None, table).labels[rows]
    assert (read_labeled(tmp_path / "back", None, table).labels == wanted).mean() > 0.98  # some are as near to another
    cubes = np.floor((cloud.columns["coord"][rows] - np.floor(cloud.columns["coord"].min(axis=0))) / VOXEL)
    assert len(np.unique(cubes, axis=0)) > 0.98 * len(rows)


@pytest.fixture(scope="module")
def toys(tmp_path_factory: pytest.TempPathFactory) -> list[DemoCloud]:
    """Thin clouds of five toy bridges."""
    root = tmp_path_factory.mktemp("toys")
    return [thin_cloud(write_toy(root / f"{i}", i, 2500, f"b{i}"), f"toy{i}") for i in range(5)]


SMALL: dict[str, Any] = {"network": {"counts": [64, 16], "unit": 2.0, "dropout": 0.0}, "batch": 2}


def test_the_simple_answers_are_what_they_say(toys: list[DemoCloud], tmp_path: Path) -> None:
    """The largest class has its share as IoU and the others none; a table names every row, class and bridge once."""
    classes, rows = run_demo(tmp_path, Silent(), clouds=toys, test=("toy1", "toy4"), changed={**SMALL, "epochs": 16})
    assert [row.name for row in rows] == ["network", "forest on the height alone", "the class with most points"]
    network, forest, majority = rows
    assert sorted(majority.iou.tolist())[:3] == [0.0, 0.0, 0.0]
    assert majority.mean == pytest.approx(majority.iou.max() / 4)
    assert 0.3 < majority.iou.max() < 0.7
    assert forest.mean > majority.mean + 0.2
    assert forest.iou[classes.index("deck")] > 0.9  # no other class is as high
    assert network.mean > majority.mean + 0.2
    assert set(network.bridges) == {"toy1", "toy4"}
    text = "\n".join(demo_table(classes, rows))
    for word in (*classes, "toy1", "toy4"):
        assert text.count(word) == 1
    assert text.count("network") == text.count("forest on the height alone") == 2


def test_the_command(
    toys: list[DemoCloud], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It writes a model and prints the table; what does not go with --demo is refused, and a call without data, too."""
    named = [replace(cloud, name=name) for cloud, name in zip(toys, ("a", "b", "beam26", "c", "slab34"), strict=True)]
    monkeypatch.setattr(demo, "demo_clouds", lambda: named)
    monkeypatch.setattr(demo, "MODEL", {**demo.MODEL, **SMALL})
    for words, code, said in (
        (("--demo", "--epochs", "1", "-o", tmp_path / "model"), 0, "IoU on bridges never seen"),
        ((tmp_path, "--demo", "-o", tmp_path / "x"), 2, "has its own"),
        (("--demo", "--model", "forest", "-o", tmp_path / "x"), 2, "has its own"),
        (("-o", tmp_path / "x"), 2, "no data set is given"),
    ):
        with pytest.raises(SystemExit) as left:
            main(["train", *map(str, words)])
        assert int(left.value.code or 0) == code
        assert said in "".join(capsys.readouterr())
    assert sorted(path.name for path in (tmp_path / "model").iterdir())[-2:] == ["model.json", "model.safetensors"]


def test_the_clouds_are_written_as_a_data_set(
    toys: list[DemoCloud], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One folder a bridge with its points and labels, a card with the true counts, and `dataset local` reads them."""
    monkeypatch.setattr("learn.demo.clouds.demo_clouds", lambda: toys)
    out = tmp_path / "bridges"
    with pytest.raises(SystemExit) as left:
        main(["dataset", "demo", "-o", str(out)])
    assert not left.value.code
    total = sum(len(toy.coord) for toy in toys)
    assert f"{len(toys)} bridges, {total:,} points" in capsys.readouterr().out
    card = (out / "README.md").read_text()
    for toy in toys:
        cloud = read_cloud(out / toy.name)
        assert np.array_equal(cloud.columns["coord"], toy.coord)
        names = {row.id: row.name for row in cloud.classes}
        counts = {names[i]: int(n) for i, n in enumerate(np.bincount(cloud.columns["segment"])) if n}
        listed = ", ".join(f"{name} {n:,}" for name, n in sorted(counts.items(), key=lambda item: -item[1]))
        assert f"| {toy.name} | {len(toy.coord):,} | {listed} |" in card
    with pytest.raises(SystemExit) as left:
        main(["dataset", "local", *(str(out / toy.name) for toy in toys), "-o", str(tmp_path / "set"), *CUT.split()])
    assert not left.value.code
    named = [replace(toy, name=name) for toy, name in zip(toys, ("beam26", "big", "c", "d", "slab34"), strict=True)]
    most = total - len(toys[1].coord) // 2 - max(len(toy.coord) for toy in toys[2:4])
    assert {"beam26", "slab34"} <= {cloud.name for cloud in small_enough(named, most)}
    assert sum(len(cloud.coord) for cloud in small_enough(named, most)) <= most
    assert small_enough(named, total) == named


@pytest.mark.proof_only
def test_the_demonstration_learns_and_shuffled_labels_teach_nothing(tmp_path: Path, record_proof: RecordProof) -> None:
    """At least 0.6 on four bridges never seen, above both simple answers; with shuffled labels no more than chance."""
    for name in ("model", "mixed"):
        (tmp_path / name).mkdir()
    begun = time.process_time()
    _, rows = run_demo(tmp_path / "model", Silent())
    spent = time.process_time() - begun
    network, forest, majority = rows
    slow = max(1.0, slower("numpy"))  # how many times slower this machine is than the one of the pages
    assert spent / slow < 300.0  # [s] of processor time
    assert len(network.bridges) == 4
    assert (network.iou > 0).all()
    assert network.mean >= 0.6
    assert network.mean > forest.mean > majority.mean
    rng = np.random.default_rng(0)
    train = [cloud for cloud in demo_clouds() if cloud.name not in TEST]
    mixed = [replace(cloud, kind=rng.permutation(cloud.kind)) for cloud in train]
    mixed += [cloud for cloud in demo_clouds() if cloud.name in TEST]
    _, (shuffled, *_) = run_demo(tmp_path / "mixed", Silent(), clouds=mixed, changed={"epochs": 1})
    assert shuffled.mean < 0.25
    record_proof(
        "learn: train --demo",
        len(network.bridges),
        0,
        {
            "miou": network.mean,
            "miou_height_forest": forest.mean,
            "miou_majority": majority.mean,
            "miou_shuffled_labels": shuffled.mean,
            "cpu_s": round(spent),
            "cpu_s_of_the_reference": round(spent / slow),
        },
    )
