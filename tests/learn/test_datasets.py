"""Data sets: what is cut, drawn and split is what was said; truth has no part in what a network sees."""

from __future__ import annotations

import dataclasses
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from groundwork.canonical import folder_digest
from groundwork.errors import InputError
from learn.datasets.build import Source, build_dataset
from learn.datasets.class_tables import class_table, labels_of_cloud
from learn.datasets.labeled_cloud import SourceFacts, read_labeled
from learn.datasets.layout import MANIFEST, PieceRow, read_facts, read_piece, write_piece
from learn.datasets.patch import Patch
from learn.datasets.settings import DatasetSettings, dataset_settings
from learn.datasets.split import split_bridges
from learn.datasets.stored import StoredSplit
from learn.datasets.windows import cut_windows
from recon.cloud import COLUMNS, OBSERVATION_COLUMNS, read_cloud
from tests.learn.toy_bridge import DECK_HEIGHT, LENGTH, WIDTH, toy_cloud, write_toy
from tests.manifest_faults import manifest_faults
from usd_schemas.components import class_id
from usd_schemas.taxonomies import taxonomy

ALL = ("x", "y", "z", "red", "green", "blue", "nx", "ny", "nz", "n_views", "height")
SMALL = {"points": 256, "fewest": 64, "tile": {"voxel": 0.2}}
COUNT = 6_000


def settings(kind: str = "local", **values: object) -> DatasetSettings:
    """Settings of a small data set."""
    return dataset_settings(kind, {**SMALL, **values}, "test")


def build(folder: Path, clouds: list[Path], **values: object) -> Path:
    """Build a data set from clouds of ours."""
    kind = str(values.pop("kind", "local"))
    folder.mkdir()
    build_dataset([Source(path) for path in clouds], folder, settings(kind, **values))
    return folder


@pytest.fixture(scope="module")
def clouds(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Write clouds of four bridges; the first one twice, as two looks of it would be."""
    folder = tmp_path_factory.mktemp("clouds")
    return [write_toy(folder / f"{i}", i, COUNT, f"b{min(i, 3)}") for i in range(4)] + [
        write_toy(folder / "again", 9, COUNT, "b0")
    ]


@pytest.fixture(scope="module")
def metric(clouds: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the metric data set of all clouds."""
    return build(tmp_path_factory.mktemp("sets") / "metric", clouds)


def test_a_bridge_stays_in_one_split(metric: Path) -> None:
    """Both clouds of one bridge lie in one split, all three splits hold bridges, and no bridge is in two."""
    facts = read_facts(metric)
    split_of: dict[str, set[str]] = {}
    for row in facts.pieces:
        split_of.setdefault(row.bridge, set()).add(row.split)
    assert len(split_of) == 4
    assert all(len(found) == 1 for found in split_of.values())
    assert set().union(*split_of.values()) == {"train", "val", "test"}
    assert {row.source for row in facts.pieces if row.bridge == "b0"} == {0, 4}


def test_the_same_clouds_make_the_same_bytes(clouds: list[Path], metric: Path, tmp_path: Path) -> None:
    """Two builds are equal byte for byte, the manifest proves the files, and names no place of this machine."""
    again = build(tmp_path / "again", clouds)
    assert folder_digest(again) == folder_digest(metric)
    assert manifest_faults(metric, MANIFEST) == []
    assert str(clouds[0].parent) not in (metric / MANIFEST).read_text() + (metric / "README.md").read_text()
    victim = next(metric.glob("train/*/color.npy"))
    kept = victim.read_bytes()
    victim.write_bytes(kept[:-1] + bytes([kept[-1] ^ 1]))
    assert manifest_faults(metric, MANIFEST) == [f"{victim.relative_to(metric).as_posix()}: changed"]
    victim.write_bytes(kept)


def test_inputs_are_a_whitelist(clouds: list[Path], metric: Path, tmp_path: Path) -> None:
    """Shuffled labels, instances, uncertainty, confidence and margins leave the samples to be scored as they were."""
    rng = np.random.default_rng(5)
    shuffled = []
    for number, path in enumerate(clouds):
        cloud = read_cloud(path)
        order = rng.permutation(len(cloud))
        names = (
            "segment",
            "instance",
            "component",
            "confidence",
            "label_margin_px",
            "uncertainty",
            "uncertainty_min",
            "uncertainty_max",
            "displacement",
            "surface_distance",
            "surface_class",
        )
        changed: dict[str, Any] = {name: cloud.columns[name][order] for name in names}
        shuffled.append(write_toy(tmp_path / path.name, [0, 1, 2, 3, 9][number], COUNT, cloud.bridge, **changed))
    other = build(tmp_path / "set", shuffled)
    for split in ("val", "test"):
        before, after = StoredSplit(metric, split, ALL), StoredSplit(other, split, ALL)
        assert len(before) == len(after) > 10
        moved = 0
        for index in range(len(before)):
            a, b = before.sample(index, 1), after.sample(index, 2)
            np.testing.assert_array_equal(a.coord, b.coord)
            np.testing.assert_array_equal(a.features, b.features)
            moved += int((a.labels != b.labels).sum())
        assert moved > 0  # the labels did change


def test_ids_that_a_piece_cannot_hold_are_refused(tmp_path: Path) -> None:
    """An instance id beyond int32 is not written, and a class id beyond a byte not read: neither turns into another."""
    piece = Patch(
        np.zeros((2, 3), np.float32),
        {},
        np.array([3, 255], np.uint8),
        np.zeros(2, np.float32),
        np.zeros(3),
        0,
        np.arange(2),
        np.array([1, 2**31 - 1]),
    )
    row = PieceRow("a", "train", "b", 0, 2, 1, 0, (0.0, 0.0, 0.0))
    write_piece(tmp_path / "train" / "a", piece)
    back = read_piece(tmp_path, row, (), identified=True)
    assert back.labels.tolist() == [3, 255]
    assert back.instance is not None
    assert back.instance.tolist() == [1, 2**31 - 1]
    with pytest.raises(InputError, match=r"2147483648.*up to 2147483647"):
        write_piece(tmp_path / "train" / "b", dataclasses.replace(piece, instance=np.array([1, 2**31])))
    assert not (tmp_path / "train" / "b").exists()
    for number in (-2, 255, 259):
        np.save(tmp_path / "train" / "a" / "segment.npy", np.array([3, number], np.int32))
        with pytest.raises(InputError, match=rf"segment\.npy.*{number}.*-1 to 254"):
            read_piece(tmp_path, row, ())


WATCHED: list[set[str]] = []  # where the paths that are opened go while a test watches


def _watch(event: str, words: tuple[object, ...]) -> None:
    if event == "open" and WATCHED:
        WATCHED[0].add(str(words[0]))


sys.addaudithook(_watch)


def test_metric_cutting_reads_nothing_but_points(tmp_path: Path) -> None:
    """Beside the columns of the clouds nothing of a scene is opened, though stage and capture lie there."""
    for name in ("stage/scene.usda", "capture/local/truth/surface.npz", "cloud/a/observations.json"):
        (tmp_path / "scene" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "scene" / name).write_bytes(b"truth")
    clouds = [write_toy(tmp_path / "scene" / "cloud" / f"{i}", i, 3000, f"b{i}") for i in range(3)]
    WATCHED.append(set())
    try:
        build(tmp_path / "set", clouds)
    finally:
        opened = WATCHED.pop()
    inside = {Path(path) for path in opened if path.startswith(str(tmp_path / "scene"))}
    known = {"cloud.json", *(f"{name}.npy" for name in [*COLUMNS, *OBSERVATION_COLUMNS])}
    assert inside
    assert {path.name for path in inside} <= known


def test_test_draws_visit_every_point(metric: Path) -> None:
    """Draws of a piece together hold each of its points, none more than once before the last draw is topped up."""
    source = StoredSplit(metric, "test")
    seen: dict[str, list[np.ndarray]] = {}
    for index in range(len(source)):
        row = source._items[index][0]
        seen.setdefault(row.name, []).append(source.piece(index)[1])
    rows = {row.name: row for row in source.facts.pieces}
    for name, draws in seen.items():
        drawn, points = np.concatenate(draws), rows[name].points
        assert all(len(draw) == 256 for draw in draws)
        assert np.array_equal(np.sort(drawn[:points]), np.arange(points))
        assert len(drawn) - points < 256


def test_noise_is_left_out_of_training_alone(metric: Path) -> None:
    """Training holds nothing over 0.1 m; validation and test hold as large a share of it as the clouds."""
    facts = read_facts(metric)
    for split, expected in (("train", 0.0), ("val", np.exp(-0.1 / 0.06)), ("test", np.exp(-0.1 / 0.06))):
        noisy = np.concatenate(
            [read_piece(metric, row, ()).uncertainty > 0.1 for row in facts.pieces if row.split == split]
        )
        assert abs(noisy.mean() - expected) < (0.02 if expected else 1e-12)


def test_training_samples_follow_the_seed(metric: Path) -> None:
    """The same seed gives the same sample, another one another; a change is rigid but for one factor in the range."""
    source, plain = StoredSplit(metric, "train", ALL), StoredSplit(metric, "train", ALL, augment=False)
    first, again, other = source.sample(3, 7), source.sample(3, 7), source.sample(3, 8)
    np.testing.assert_array_equal(first.coord, again.coord)
    np.testing.assert_array_equal(first.features, again.features)
    assert not np.array_equal(first.coord, other.coord)
    raw = plain.sample(3, 7)
    np.testing.assert_array_equal(raw.labels, first.labels)
    a, b = raw.coord - raw.coord[0], first.coord - first.coord[0]
    far = np.linalg.norm(a, axis=1) > 0.05
    ratio = np.linalg.norm(b[far], axis=1) / np.linalg.norm(a[far], axis=1)
    assert np.ptp(ratio) < 1e-4
    assert 0.8 <= ratio[0] <= 1.25
    np.testing.assert_allclose(np.abs(first.features[:, 8]), 1.0, atol=1e-6)  # nz: turned about the vertical only


def test_metric_samples_have_one_scale_and_stand_on_the_ground(metric: Path) -> None:
    """A tile of 10 m at scale 10 spans one unit; the deck, 8 m above the ground, is at 0.8 in every tile."""
    source = StoredSplit(metric, "test")
    decks = []
    for index in range(len(source)):
        sample = source.sample(index, 0)
        assert np.abs(sample.coord[:, :2]).max() <= 0.5 + 1e-6
        decks += sample.coord[sample.labels == source.classes.index("deck"), 2].tolist()
    np.testing.assert_allclose(decks, DECK_HEIGHT / 10.0, atol=0.02 + 0.04)  # deck +-0.2 m, ground wave +-0.2 m


def test_paper_windows(clouds: list[Path]) -> None:
    """Windows are 10 m long and 2 m apart, hold all points of their boxes, deck and 12 m wide, ground to top."""
    cloud = read_labeled(clouds[0], None, class_table("kim2023"))
    windows = list(cut_windows(cloud, settings(mode="paper").window, "toy"))
    assert len(windows) == int((LENGTH - 10.0) / 2.0)  # the outer half percent of the deck is cut, one step
    coord = cloud.coord - np.array([4e5, 5e6, 30.0])
    starts = []
    for window in windows:
        inside = coord[window.rows]
        x = inside[:, 0]
        starts.append(x.min())
        box = (coord[:, 0] > x.min() + 0.6) & (coord[:, 0] < x.max() - 0.6) & (np.abs(coord[:, 1]) < 0.5 * WIDTH + 5.5)
        assert set(np.flatnonzero(box)) <= set(window.rows)  # the axis that the deck's points give is off by 1 degree
        assert 9.8 < np.ptp(x) < 10.6
        assert np.abs(inside[:, 1]).max() <= 0.5 * (WIDTH + 12.2)
    np.testing.assert_allclose(np.diff(starts), 2.0, atol=0.1)


def test_the_papers_local_set(clouds: list[Path], tmp_path: Path) -> None:
    """Samples reach from 0 to 1 along their longest side; pieces of one bridge are in several splits."""
    folder = build(tmp_path / "set", clouds, mode="paper", split="random")
    facts = read_facts(folder)
    for split in ("train", "val", "test"):
        source = StoredSplit(folder, split)
        assert source.classes == ("background", "column", "pier_cap", "deck")
        sample = source.sample(0, 3)
        assert sample.coord.shape == (256, 3)
        assert sample.coord.min() == 0.0
        assert np.isclose(sample.coord.max(), 1.0)
        assert set(np.unique(sample.labels)) <= {0, 1, 2, 3}
    assert len({row.split for row in facts.pieces if row.bridge == "b1"}) == 3
    share = np.mean([row.split == "train" for row in facts.pieces])
    assert 0.4 < share < 0.8


@pytest.mark.parametrize("mode", ["paper", "metric"])
def test_the_global_set(clouds: list[Path], tmp_path: Path, mode: str) -> None:
    """Noisy points are the seventeenth class, in every split; one cloud is one draw in the paper's way."""
    folder = build(tmp_path / "set", clouds, kind="global", mode=mode, points=2048)
    facts = read_facts(folder)
    assert facts.classes == class_table("falsework", noisy=True).names
    assert len(facts.classes) == 17
    for split in ("train", "val", "test"):
        source = StoredSplit(folder, split, augment=False)
        sample = source.sample(0, 0)
        patch, _ = source.piece(0)
        noisy = patch.uncertainty > 0.1
        assert ((patch.labels == facts.classes.index("noisy_point")) == noisy).all()
        assert noisy.any()
        assert sample.coord.shape == (2048, 3)
        if mode == "paper":
            assert len(source) == len({row.source for row in facts.pieces if row.split == split})


def test_a_stratified_draw_keeps_small_classes(clouds: list[Path], tmp_path: Path) -> None:
    """Training draws keep so many points of every class that is there; the test's draws do not look at labels."""
    folder = build(tmp_path / "set", clouds, kind="global", mode="paper", points=600, stratified=60)
    train = StoredSplit(folder, "train", augment=False)
    for index in range(len(train)):
        counts = np.bincount(train.sample(index, 5).labels, minlength=17)
        assert counts[counts > 0].min() >= 60
    test = StoredSplit(folder, "test")
    assert min(np.bincount(test.sample(0, 0).labels)[[12]]) < 60
    mixed = build(
        tmp_path / "random", clouds, kind="global", mode="paper", points=600, stratified=60, split="random", test=["b1"]
    )
    for row in read_facts(mixed).pieces:
        assert (row.points > 600) == (row.split == "train")  # a training draw is made of all points
        assert row.split == "test" or row.bridge != "b1"
    assert "train" in {row.split for row in read_facts(mixed).pieces}


def test_labels_follow_the_component_and_the_table() -> None:
    """A component has its class in every table; a class that someone relabelled stands above the component."""
    cloud = toy_cloud(count=500)
    for name in ("falsework", "kim2023", "semanticbridge", "asprs"):
        table = class_table(name)
        found = labels_of_cloud(cloud, table)
        for kind, component in enumerate(cloud.components):
            if component and name != "falsework":
                assert {table.names[k] for k in np.unique(found[cloud.columns["component"] == kind])} == {
                    taxonomy(name).row_of(component).name
                }
    columns = {**cloud.columns, "segment": np.full(500, 8, np.uint8)}  # all relabelled: column
    table = class_table("kim2023")
    relabelled = labels_of_cloud(type(cloud)(**{**vars(cloud), "columns": columns}), table)
    assert {table.names[k] for k in np.unique(relabelled)} == {"column"}


def test_bridges_are_split_by_hash_alone(clouds: list[Path]) -> None:
    """Order of the sources changes no split; shares are met; a bridge that is named goes to the test."""
    known = [SourceFacts(str(i), f"{i:02d}", str(i), "mesh") for i in range(20)]
    splits = split_bridges(known, settings())
    assert splits == split_bridges(known[::-1], settings())
    assert [list(splits.values()).count(name) for name in ("train", "val", "test")] == [12, 4, 4]
    assert splits != split_bridges(known, settings(seed=1))
    named = split_bridges(known, settings(test=["07", "11", "02"]))
    assert {bridge for bridge, split in named.items() if split == "test"} == {"02", "07", "11"}
    assert [list(named.values()).count(name) for name in ("train", "val")] == [13, 4]
    held = split_bridges(known, settings(test=["07"], shares=(0.0, 0.0, 1.0)))
    assert set(held.values()) == {"test"}  # nothing else is wanted
    with pytest.raises(InputError, match="exactly one bridge"):
        split_bridges(known, settings(test=["0"]))


def test_bad_input_is_one_line(clouds: list[Path], metric: Path, tmp_path: Path) -> None:
    """Clouds without a bridge or a deck, the same one twice, none, channels that are truth: each named in one line."""
    nameless = write_toy(tmp_path / "nameless", bridge="")
    with pytest.raises(InputError, match="does not state its bridge"):
        build(tmp_path / "a", [nameless])
    with pytest.raises(InputError, match="the same points are given twice"):
        build(tmp_path / "b", [clouds[0], clouds[0]])
    with pytest.raises(InputError, match="no piece is left"):
        build(tmp_path / "c", clouds, fewest=100_000)
    with pytest.raises(InputError, match=r"not a channel .*'uncertainty'"):
        StoredSplit(metric, "train", ("x", "uncertainty"))
    with pytest.raises(InputError, match="no cloud is named"):
        build(tmp_path / "d", [])
    count = 3000
    ground = {"component": np.full(count, 3, np.uint16), "segment": np.full(count, class_id("background"), np.uint8)}
    bare = write_toy(tmp_path / "bare", 5, count, **ground)
    with pytest.raises(InputError, match=r"no labeled deck for windows along the bridge.*Use --mode metric") as caught:
        build(tmp_path / "e", [bare], mode="paper")
    assert "bare" in str(caught.value)
    with pytest.raises(InputError, match=r"a table of keys, not a value.*tile\.size=10"):
        settings(tile=3)
    with pytest.raises(InputError, match="times stride"):
        settings(tile={"size": 10.0, "stride": 3.0})
    stored = json.loads((metric / MANIFEST).read_text())
    changes: list[tuple[dict[str, Any], str]] = [
        ({"format_version": 9}, "of this version"),
        ({"pieces": [{"name": "x"}]}, "missing or of a wrong kind"),
        ({"inputs": ["uncertainty"]}, "invalid inputs"),
        ({"pieces": [{**stored["pieces"][0], "name": "../../x"}]}, "leads out of the data set"),
        ({"pieces": [{**stored["pieces"][0], "points": 0}]}, "invalid piece"),
    ]
    for number, (change, words) in enumerate(changes):
        folder = tmp_path / f"changed{number}"
        folder.mkdir()
        (folder / MANIFEST).write_text(json.dumps({**stored, **change}))
        with pytest.raises(InputError, match=words):
            read_facts(folder)


def test_what_moves_is_left_out_unless_asked_for(tmp_path: Path) -> None:
    """Points with an uncertainty and no distance to a surface, which lie on what moves, are no part of a data set."""
    still = toy_cloud(1)
    distance = np.full(len(still.columns["coord"]), 0.01, np.float32)
    distance[::5] = np.nan
    sure = np.full(len(distance), 0.01, np.float32)
    path = write_toy(tmp_path / "cloud", 1, surface_distance=distance, uncertainty=sure)
    table = class_table("falsework")
    kept = read_labeled(path, None, table)
    np.testing.assert_array_equal(kept.coord, read_cloud(path).columns["coord"][~np.isnan(distance)])
    assert len(kept.labels) == len(kept.coord) == len(kept.inputs["color"])
    assert len(read_labeled(path, None, table, moving=True)) == len(distance)
    facts = [settings().moving, settings(moving=True).moving]
    assert facts == [False, True]


def test_a_stray_point_is_told_with_its_source(tmp_path: Path) -> None:
    """One point 5,000 km away: no cubes can be numbered over that, and the user must know in which cloud it lies."""
    good = write_toy(tmp_path / "good", 0, 2_000)
    coord = toy_cloud(1, 2_000).columns["coord"]
    coord[7] += 5e6
    stray = write_toy(tmp_path / "stray", 1, 2_000, "b1", coord=coord)
    with pytest.raises(InputError, match=f"^{stray}: .*stray points"):
        build_dataset([Source(good), Source(stray)], tmp_path / "set", settings("local", mode="metric"))
