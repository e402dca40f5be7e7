"""Training samples for strangers' scans: what varies is what was said, and labels stay with their points."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from learn.datasets import clutter
from learn.datasets.build import Source, build_dataset
from learn.datasets.class_tables import class_table
from learn.datasets.ground import estimate_ground
from learn.datasets.layout import read_piece
from learn.datasets.settings import dataset_settings
from learn.datasets.stored import StoredSplit
from learn.datasets.varied import SomeSamples, Variation, VariedSplit, draw_piece, draw_tilt, vary
from learn.predict.class_sum import sum_classes
from tests.learn.toy_bridge import toy_cloud, write_toy
from usd_schemas.components import component_classes

STILL = {"thinned": 0.0, "halved": 0.0, "bare": 0.0, "tilt": 0.0, "jitter": 0.0, "lift": 0.0}


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set of components of two bridges, nothing held out, nothing turned, mirrored or scaled."""
    place = tmp_path_factory.mktemp("varied")
    clouds = [write_toy(place / f"{i}", i, 24_000, f"b{i}") for i in range(2)]
    chosen = {
        "points": 512,
        "fewest": 64,
        "table": "components",
        "shares": (1.0, 0.0, 0.0),
        "tile": {"voxel": 0.1},
        "augment": {"flip": False, "rotate": False, "scale": (1.0, 1.0)},
    }
    (place / "set").mkdir()
    build_dataset([Source(path) for path in clouds], place / "set", dataset_settings("local", chosen, "test"))
    return place / "set"


def varied(stored: Path, **chosen: float) -> VariedSplit:
    """Samples that vary in what is named alone."""
    return VariedSplit(StoredSplit(stored, "train"), Variation(samples=40, **{**STILL, **chosen}))  # type: ignore[arg-type]


def test_components_are_classes_and_lead_into_every_other_table(stored: Path) -> None:
    """Labels are component kinds; each of them is summed into the class that the tables give it."""
    names = StoredSplit(stored, "train").classes
    assert names == tuple(component_classes())
    sample = varied(stored).sample(0, 0)
    assert {names[label] for label in np.unique(sample.labels)} <= {"deck_slab", "column", "ground", "pier_cap"}
    summing = sum_classes(names, "components", "", ())
    assert summing.table == "falsework"
    for number, name in enumerate(names):
        assert summing.names[int(summing.matrix[number].argmax())] == component_classes()[name]
    assert class_table("components", noisy=True).names[-1] == "noisy_point"


def test_samples_follow_the_seed_and_clouds_take_turns(stored: Path) -> None:
    """The same seed gives the same sample, another one another; every cloud comes equally often."""
    source = VariedSplit(StoredSplit(stored, "train"), Variation(samples=40))
    first, again, other = source.sample(3, 1), source.sample(3, 1), source.sample(3, 2)
    assert np.array_equal(first.features, again.features)
    assert not np.array_equal(first.features, other.features)
    assert [source.bridge(row) for row in range(4)] == ["b0", "b1", "b0", "b1"]
    assert len(source) == 40
    assert len(VariedSplit(source.split, source.settings, ("b1",)).sample(0, 0).coord) == 512
    some = SomeSamples(source, [5, 7])
    assert (len(some), some.bridge(0)) == (2, "b1")
    assert np.array_equal(some.sample(0, 9).coord, source.sample(5, 9).coord)


def test_a_still_sample_is_a_piece_and_each_change_does_what_it_says(stored: Path) -> None:
    """Nothing changed: points of the piece. Thinned: fewer places. Halved: a narrower one. Bare: ground alone."""
    still, bared = varied(stored), varied(stored, bare=1.0)
    plain = still.sample(1, 4)
    facts = StoredSplit(stored, "train").facts
    pieces = [read_piece(stored, row, ()) for row in facts.pieces]
    known = {
        point.tobytes(): label
        for piece in pieces
        for point, label in zip(facts.scaling.apply(piece.coord), piece.labels, strict=True)
    }
    assert [known[point.tobytes()] for point in plain.coord] == plain.labels.tolist()
    thinned = varied(stored, thinned=1.0, least=0.1)
    places = [len(np.unique(thinned.sample(row, 0).coord, axis=0)) for row in range(40)]
    assert min(places) < 100 < max(places)
    ground = [row for row in range(40) if not still.sample(row, 0).labels.any()]
    bare = [row for row in range(40) if not bared.sample(row, 0).labels.any()]  # 0 is ground
    assert len(bare) > 20 + len(ground)
    halved = varied(stored, halved=1.0)
    areas = [
        np.prod(np.ptp(source.sample(row, 0).coord[:, :2], axis=0)) for row in range(10) for source in (still, halved)
    ]
    assert sum(areas[1::2]) < 0.9 * sum(areas[::2])
    lifted = varied(stored, lift=2.0).sample(1, 4)
    assert len(known.keys() & {point.tobytes() for point in lifted.coord}) < 10


def test_a_bridge_that_was_cut_out_stands_on_its_own_ground(stored: Path) -> None:
    """Nothing but the bridge is left, and the ground that is estimated from that alone is at height zero."""
    facts, settings = StoredSplit(stored, "train").facts, Variation(**{**STILL, "alone": 1.0})  # type: ignore[arg-type]
    cut = 0
    for row in facts.pieces:
        piece = read_piece(stored, row, ())
        patch = vary(piece, np.array([0]), settings, np.random.default_rng(0))
        own = piece.labels != 0
        if own.sum() < 256:
            assert len(patch) == len(piece)
            continue
        np.testing.assert_array_equal(patch.labels, piece.labels[own])
        np.testing.assert_allclose(np.diff(patch.coord, axis=0), np.diff(piece.coord[own], axis=0), atol=1e-5)
        coord = patch.coord.astype(np.float64)
        level = estimate_ground(coord).below(coord[:, :2].mean(axis=0, keepdims=True), np.inf)
        assert abs(float(level[0])) < 1e-5
        cut += 1
    assert cut > 3


def test_rare_classes_are_seen_where_pieces_are_chosen_by_class() -> None:
    """A class in one of 100 pieces: chosen by class, one half of the choices fall on it."""
    counts = np.zeros((100, 2), np.int64)
    counts[:, 0], counts[41, 1] = 50, 1
    rng = np.random.default_rng(0)
    assert np.mean([draw_piece(counts, 1.0, rng) == 41 for _ in range(400)]) == pytest.approx(0.5, abs=0.1)
    assert np.mean([draw_piece(counts, 0.0, rng) == 41 for _ in range(400)]) < 0.05


def test_a_tilt_is_a_rotation_by_no_more_than_was_said() -> None:
    """Orthogonal, right-handed, and the vertical leans by at most the largest angle."""
    rng = np.random.default_rng(1)
    for _ in range(50):
        turn = draw_tilt(4.0, rng)
        assert np.allclose(turn @ turn.T, np.eye(3))
        assert np.linalg.det(turn) == pytest.approx(1.0)
        assert np.degrees(np.arccos(min(1.0, turn[2, 2]))) <= 4.0 + 1e-6


@pytest.fixture(scope="module")
def wide(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set of one bridge with so wide a ground that most pieces hold nothing but that."""
    place = tmp_path_factory.mktemp("wide")
    coord = toy_cloud(0, 40_000).columns["coord"].copy()
    ground = toy_cloud(0, 40_000).columns["component"] == 3
    coord[ground, 1] = 5e6 + 4.0 * (coord[ground, 1] - 5e6)
    cloud = write_toy(place / "c", 0, 40_000, "b0", coord=coord)
    chosen = {"points": 512, "fewest": 32, "table": "components", "shares": (1.0, 0.0, 0.0), "tile": {"voxel": 0.1}}
    (place / "set").mkdir()
    build_dataset([Source(cloud)], place / "set", dataset_settings("local", chosen, "test"))
    return place / "set"


def test_pieces_without_a_bridge_are_drawn_as_often_as_said(wide: Path) -> None:
    """Of all samples the share that was asked for, and what the other draws give by themselves."""
    bridge = [i for i, name in enumerate(component_classes()) if component_classes()[name] != "background"]
    shares = []
    for empty in (0.0, 0.5, 1.0):
        source = varied(wide, by_class=1.0, empty=empty)
        shares.append(np.mean([not np.isin(source.sample(row, 0).labels, bridge).any() for row in range(40)]))
    plain, half, whole = shares
    assert whole == 1.0
    assert half == pytest.approx(0.5 + 0.5 * plain, abs=0.2)
    assert plain < 0.5


def test_where_every_piece_shows_a_bridge_the_draws_are_the_usual_ones(tmp_path: Path) -> None:
    """Nothing without a bridge to draw from: the pieces that there are, with their bridge."""
    toy = toy_cloud(0, 24_000).columns
    coord = toy["coord"].copy()
    coord[:, 1] = 5e6 + 0.3 * (coord[:, 1] - 5e6)  # one row of tiles, all with some deck
    (tmp_path / "set").mkdir()
    chosen = {"points": 64, "fewest": 32, "table": "components", "shares": (1.0, 0.0, 0.0), "tile": {"voxel": 0.1}}
    source = Source(write_toy(tmp_path / "c", 0, 24_000, "b0", coord=coord))
    build_dataset([source], tmp_path / "set", dataset_settings("local", chosen, "test"))
    drawn = varied(tmp_path / "set", empty=1.0)
    assert all(drawn.sample(row, 0).labels.any() for row in range(20))


def test_plants_are_shaken_more_than_the_rest(stored: Path) -> None:
    """Of two pieces alike but for their labels, only points of plants move, by no more than the draw allows."""
    facts = StoredSplit(stored, "train").facts
    piece = read_piece(stored, facts.pieces[0], ())
    settings = Variation(**{**STILL, "rustle": 0.5})  # type: ignore[arg-type]
    label = int(np.bincount(piece.labels).argmax())
    moved = vary(piece, np.array([0]), settings, np.random.default_rng(3), np.array([label]))
    way = np.linalg.norm(moved.coord - piece.coord, axis=1)
    plants = piece.labels == label
    assert 0.02 < np.sqrt((way[plants] ** 2).mean() / 3.0) < 0.55
    np.testing.assert_allclose(way[~plants], 0.0, atol=1e-6)
    still = vary(piece, np.array([0]), settings, np.random.default_rng(3))
    np.testing.assert_allclose(still.coord, piece.coord, atol=1e-6)


def test_made_up_land_is_drawn_as_often_as_said(stored: Path) -> None:
    """All samples, or some: no part of a bridge, kinds that the table has, the same for the same seed."""
    source = varied(stored, clutter=1.0)
    samples = [source.sample(row, 0) for row in range(40)]
    seen = {source.classes[label] for sample in samples for label in np.unique(sample.labels)}
    assert {"ground", "roof", "building", "tree", "vehicle", "water"} <= seen <= set(clutter.KINDS)
    assert np.array_equal(samples[5].coord, source.sample(5, 0).coord)
    some = varied(stored, clutter=0.3, by_class=1.0)
    toys = {"deck_slab", "column", "pier_cap"}
    parts = [bool({some.classes[label] for label in np.unique(some.sample(row, 0).labels)} & toys) for row in range(40)]
    assert 0.3 < np.mean(parts) < 0.95


def test_made_up_land_stays_in_its_square_and_stands_on_the_ground() -> None:
    """Points within the square, one in each cube, the ground about level zero, crowns and roofs above it."""
    code = {kind: number for number, kind in enumerate(clutter.KINDS)}
    for seed in range(30):
        coord, labels = clutter.draw_clutter(20.0, 0.15, code, np.random.default_rng(seed))
        assert (np.abs(coord[:, :2]) <= 10.0).all()
        assert len(np.unique(np.floor(coord.astype(np.float64) / 0.15), axis=0)) > 0.99 * len(coord)
        ground = coord[np.isin(labels, [code["ground"], code["road"]]), 2]
        if len(ground) > 50:
            assert abs(float(np.median(ground))) < 6.0
            roofs = coord[labels == code["roof"], 2]
            assert len(roofs) == 0 or roofs.mean() > ground.mean() + 1.0
        assert len(coord) > 300


def test_a_pulse_meets_leaves_as_densely_as_they_stand() -> None:
    """In a large crown the depth of the first leaf below the surface is exponential with the density of the leaves."""
    rng = np.random.default_rng(0)
    place = rng.uniform(-0.5, 0.5, (4000, 2))
    code = {kind: number for number, kind in enumerate(clutter.KINDS)}
    land = clutter._Land(place, np.full(4000, -200.0), np.zeros(4000, np.uint8), code, 0.5, 10.0, [])
    passed = np.ones(4000, bool)
    body = (np.array([0.0, 0.0, 0.0]), np.array([50.0, 50.0, 40.0]))
    clutter._pass_leaves(land, passed, body, 0.5, "tree", rng)
    first, second = (points for points, _ in land.extra)
    depth = 40.0 * np.sqrt(1.0 - ((first[:, :2] / 50.0) ** 2).sum(axis=1)) - first[:, 2]
    assert depth.mean() == pytest.approx(2.0, rel=0.08)
    assert np.quantile(depth, 0.5) == pytest.approx(2.0 * np.log(2.0), rel=0.1)
    assert (first[:, 2] - second[:, 2]).mean() == pytest.approx(2.8, rel=0.08)
    assert not passed.any()
