"""Samples as of other sensors, heights above the ground, and which points count how much."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from learn.datasets.build import Source, build_dataset
from learn.datasets.ground import estimate_ground
from learn.datasets.patch import Patch
from learn.datasets.sensors import other_sensor
from learn.datasets.settings import SensorSettings, TileSettings, dataset_settings
from learn.datasets.stored import StoredSplit
from learn.datasets.tiles import thin, with_heights
from tests.learn.toy_bridge import write_toy

NONE = SensorSettings(range=0.0, gaps=0.0, half=0.0, tilt=0.0, colorless=0.0)
CHANNELS = ("x", "y", "z", "red", "green", "blue", "nz", "height")


@cache
def piece(count: int = 4000) -> Patch:
    """Draw a piece 10 m wide, every point with a color of its own kind and its number as uncertainty."""
    rng = np.random.default_rng(0)
    coord = (rng.random((count, 3)) * 10.0 - [5.0, 5.0, 0.0]).astype(np.float32)
    inputs = {
        "color": rng.integers(1, 256, (count, 3)).astype(np.uint8),
        "normal": np.tile(np.array([0, 0, 1], np.float32), (count, 1)),
    }
    return Patch(
        coord, inputs, rng.integers(0, 4, count).astype(np.uint8), np.arange(count, dtype=np.float32), np.zeros(3), 7
    )


def changed(seed: int, count: int = 4000, **chosen: float) -> tuple[Patch, NDArray[np.float64]]:
    """Change the piece in one way alone."""
    return other_sensor(piece(count), NONE.model_copy(update=chosen), np.random.default_rng(seed))


def test_nothing_asked_for_changes_nothing() -> None:
    """Shares of zero and no tilt: the same points, upright."""
    found, lean = changed(1)
    assert np.array_equal(found.coord, piece().coord)
    assert np.array_equal(lean, np.eye(3))


def test_points_leave_whole_and_never_too_many() -> None:
    """Every column keeps the same rows, in their order; a fifth of the points stays at least, and mostly some leave."""
    fewer = 0
    for seed in range(60):
        found, _ = changed(seed, range=1.0, gaps=1.0, half=1.0)
        rows = found.uncertainty.astype(int)
        assert (np.diff(rows) > 0).all()
        assert np.array_equal(found.coord, piece().coord[rows])
        assert np.array_equal(found.labels, piece().labels[rows])
        assert np.array_equal(found.inputs["color"], piece().inputs["color"][rows])
        assert 800 <= len(found) <= 4000
        fewer += len(found) < 4000
    assert fewer > 55


def test_a_scanner_thins_with_distance() -> None:
    """Of the nearest points all are left; of the farthest, a share that falls with the square of the distance."""
    ratio = []
    for seed in range(40):
        found, _ = changed(seed, range=1.0)
        kept = np.isin(np.arange(4000), found.uncertainty.astype(int))
        rng = np.random.default_rng(seed)
        rng.random()  # the draw that decides whether
        whole = piece().coord
        place = np.array([*rng.uniform(whole.min(axis=0)[:2], whole.max(axis=0)[:2]), 1.5])
        apart = np.linalg.norm(whole - place, axis=1)
        reach = apart[~kept].min()
        assert kept[apart < reach].all()
        far = apart > 1.3 * reach
        ratio.append(kept[far].mean() / np.square(reach / apart[far]).mean())
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.1)


def test_half_a_bridge_ends_at_a_plane() -> None:
    """What is left and what is gone can be parted by a straight line on the map."""
    cut = 0
    for seed in range(20):
        found, _ = changed(seed, half=1.0)
        kept = np.isin(np.arange(4000), found.uncertainty.astype(int))
        if kept.all():
            continue
        cut += 1
        angles = np.linspace(0.0, 2.0 * np.pi, 721)
        along = piece().coord[:, :2] @ np.stack([np.cos(angles), np.sin(angles)])
        assert (along[kept].min(axis=0) - along[~kept].max(axis=0)).max() > -0.08
    assert cut > 10


def test_a_hole_is_empty() -> None:
    """There is a place among the former points round which none is left."""
    for seed in range(20):
        found, _ = changed(seed, gaps=1.0)
        gone = np.setdiff1d(np.arange(4000), found.uncertainty.astype(int))
        assert 0 < len(gone) < 2000
        between = piece().coord[gone][:, None, :2] - found.coord[None, :, :2]
        assert np.linalg.norm(between, axis=2).min(axis=1).max() > 0.2


def test_tilt_and_color() -> None:
    """A lean is a rotation about a level axis, 2 degrees in the root mean square; without color a sample is black."""
    leans = [changed(seed, 400, tilt=2.0)[1] for seed in range(300)]
    for lean in leans:
        assert np.allclose(lean @ lean.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(lean) == pytest.approx(1.0)
        assert lean[0, 1] == pytest.approx(lean[1, 0])  # no turn about the vertical
    angles = np.rad2deg(np.arccos([lean[2, 2] for lean in leans]))
    assert np.sqrt(np.mean(np.square(angles))) == pytest.approx(2.0, abs=0.3)
    black = [not changed(seed, 400, colorless=0.3)[0].inputs["color"].any() for seed in range(300)]
    assert np.mean(black) == pytest.approx(0.3, abs=0.08)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build a data set of four toy bridges."""
    root = tmp_path_factory.mktemp("sensors")
    clouds = [write_toy(root / f"{i}", i, 6000, f"b{i}") for i in range(4)]
    (root / "set").mkdir()
    values = {"points": 256, "fewest": 64, "tile": {"voxel": 0.2}}
    build_dataset([Source(path) for path in clouds], root / "set", dataset_settings("local", values, "test"))
    return root / "set"


def test_only_training_samples_change(folder: Path) -> None:
    """Training samples follow the seed; validation, test and bridges that are held out of a training are left alone."""
    sensors = SensorSettings(colorless=0.5)
    for split in ("val", "test"):
        plain, other = StoredSplit(folder, split, CHANNELS), StoredSplit(folder, split, CHANNELS, sensors=sensors)
        for index in range(0, len(plain), 5):
            sample = other.sample(index, 3)
            np.testing.assert_array_equal(plain.sample(index, 4).features, sample.features)
            assert sample.uncertainty is None
    plain, other = StoredSplit(folder, "train", CHANNELS), StoredSplit(folder, "train", CHANNELS, sensors=sensors)
    black = 0
    for index in range(40):
        sample = other.sample(index, 9)
        np.testing.assert_array_equal(sample.features, other.sample(index, 9).features)
        assert not np.array_equal(sample.coord, plain.sample(index, 9).coord)
        assert sample.uncertainty is not None
        assert sample.uncertainty.max() <= 0.1
        black += not sample.features[:, 3:6].any()
    assert 8 < black < 32
    held = other.unchanged()
    np.testing.assert_array_equal(held.sample(3, 1).features, held.sample(3, 2).features)
    assert held.sample(3, 1).uncertainty is None
    patch, rows = held.piece(3)
    np.testing.assert_allclose(held.sample(3, 1).coord, patch.coord[rows] / 10.0, atol=1e-6)


def test_height_is_metric_and_stays_with_its_point(folder: Path) -> None:
    """Mirrored, turned and leaned, a deck keeps its height of 8 m; scaled, it is scaled as its positions are."""
    source = StoredSplit(folder, "train", CHANNELS, sensors=SensorSettings())
    plain = StoredSplit(folder, "train", CHANNELS, augment=False)
    deck = source.classes.index("deck")
    factors = []
    for index in range(20):
        for sample, factor in ((plain.sample(index, 2), 1.0), (source.sample(index, 2), None)):
            heights = sample.features[sample.labels == deck, -1]
            if len(heights) < 20:
                continue
            if factor is None:
                factors.append(float(np.median(heights) / 0.8))
            else:
                np.testing.assert_allclose(heights, 0.8, atol=0.02 + 0.04)
    assert len(factors) > 10
    assert 0.76 < min(factors) < 0.95
    assert 1.05 < max(factors) < 1.3


@pytest.mark.parametrize("slope", [0.0, 0.1, 0.4])
def test_heights_follow_a_bank(slope: float) -> None:
    """On a sloping meadow the ground's points stand at nought but for the quantile, and a mast keeps its length."""
    rng = np.random.default_rng(1)
    flat = rng.uniform(-40.0, 40.0, (40_000, 2))
    ground = np.column_stack([flat, slope * flat[:, 0]])
    mast = np.column_stack([np.full(50, 3.0), np.full(50, 4.0), slope * 3.0 + np.linspace(5.0, 10.0, 50)])
    found = estimate_ground(np.concatenate([ground, mast])).heights_above(np.concatenate([ground, mast]), 10.0)
    inner = np.abs(flat).max(axis=1) < 25.0
    # the lowest fifth of the cells within 10 m lies 7 m downhill at most, the low quantile in a cell 2.5 m
    assert np.abs(found[: len(flat)][inner]).max() < slope * 10.0 + 1e-6
    assert np.ptp(found[: len(flat)][inner]) < max(0.15 * slope * 80.0, 1e-6)
    np.testing.assert_allclose(np.ptp(found[-50:]), 5.0, atol=1e-3)


def test_heights_are_bilinear_between_the_corners() -> None:
    """Point by point in Python, from the ground at the four corners of the cell; a far stray point costs nothing."""
    rng = np.random.default_rng(3)
    coord = np.concatenate([rng.uniform(-20.0, 20.0, (3000, 3)), [[1e5, -1e5, 3.0]]])
    ground = estimate_ground(coord)
    found = ground.heights_above(coord, 12.0)
    for row in rng.choice(3000, 200, replace=False):
        x, y, z = coord[row]
        i, j = np.floor(x / 5.0), np.floor(y / 5.0)
        s, t = x / 5.0 - i, y / 5.0 - j
        corners = np.array([[i, j], [i, j + 1], [i + 1, j], [i + 1, j + 1]]) * 5.0
        low = ground.below(corners, 12.0) @ [(1 - s) * (1 - t), (1 - s) * t, s * (1 - t), s * t]
        assert found[row] == pytest.approx(z - low, abs=1e-4)
    tile = TileSettings(voxel=0.2, height_reach=12.0)
    cloud = with_heights(thin(coord[:3000], {}, tile), tile)
    again = estimate_ground(cloud.coord).heights_above(cloud.coord, 12.0)
    np.testing.assert_array_equal(cloud.columns["height"], again)
