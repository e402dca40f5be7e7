"""One point in each cube: equal to a slow twin, whether thinned at once or in parts, and always a part of the whole."""

from pathlib import Path

import numpy as np
import pytest

from recon.sampling import sample_lidar
from recon.sampling.thinning import one_in_each_cube
from tests.recon.scanned_scenes import deck_on_walls, scanned
from tests.recon.test_sample_mesh import sampled, two_triangles


def slow_twin(points: np.ndarray, size: float, ranks: np.ndarray) -> list[int]:
    """Go through the points one after the other."""
    best: dict[tuple[int, ...], int] = {}
    for row, point in enumerate(points):
        cell = tuple(int(np.floor(value / size)) for value in point)
        if cell not in best or ranks[row] < ranks[best[cell]]:
            best[cell] = row
    return sorted(best.values())


@pytest.mark.parametrize("size", [0.04, 0.5, 3.0])
def test_equals_the_slow_twin_in_any_parts(size: float) -> None:
    """Negative coordinates included; parts that are thinned first change nothing."""
    rng = np.random.default_rng(3)
    points, ranks = rng.normal((1e4, 0.0, -0.5), 1.0, (800, 3)), rng.random(800)
    rows = one_in_each_cube(points, size, ranks)
    assert rows.tolist() == slow_twin(points, size, ranks)
    first = one_in_each_cube(points[:300], size, ranks[:300])
    second = 300 + one_in_each_cube(points[300:], size, ranks[300:])
    both = np.concatenate([first, second])
    np.testing.assert_array_equal(both[one_in_each_cube(points[both], size, ranks[both])], rows)


def test_every_point_of_a_cube_may_stay() -> None:
    """Of four points in one cube each stays as often as the others: the choice follows no order of the scan."""
    rng = np.random.default_rng(0)
    points = np.repeat([[0.6], [0.7], [0.8], [0.9]], 3, axis=1)
    stays = np.bincount([int(one_in_each_cube(points, 1.0, rng.random(4))[0]) for _ in range(2000)], minlength=4)
    assert np.abs(stays - 500).max() < 100  # five standard deviations


def test_a_thinned_mesh_cloud_is_a_part_of_the_whole(tmp_path: Path) -> None:
    """Same draws, fewer points, one a cube at most, and every cube of the whole cloud still has one."""
    whole = sampled(two_triangles(), tmp_path / "whole", points=4000, noise=0.01, seed=5).columns
    thin = sampled(two_triangles(), tmp_path / "thin", points=4000, noise=0.01, seed=5, voxel=0.1).columns
    rows = {tuple(point): row for row, point in enumerate(whole["coord"].tolist())}
    kept = [rows[tuple(point)] for point in thin["coord"].tolist()]
    assert 100 < len(kept) < 2000
    for name, values in thin.items():
        np.testing.assert_array_equal(values, whole[name][kept])
    cells = np.floor(thin["coord"] / 0.1)
    assert len(np.unique(cells, axis=0)) == len(cells) == len(np.unique(np.floor(whole["coord"] / 0.1), axis=0))


def test_a_long_scan_is_thinned_on_the_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Thinned at the end, or whenever some hundred points lie loose: the same cloud, of points of the whole one."""
    how = {"angular_step": 1.0, "stations": 2, "seed": 1, "reach": 30.0}
    whole = scanned(deck_on_walls(), tmp_path / "whole", **how).columns
    thin = scanned(deck_on_walls(), tmp_path / "thin", voxel=0.5, **how).columns
    monkeypatch.setattr(sample_lidar, "_LOOSE", 500)
    often = scanned(deck_on_walls(), tmp_path / "often", voxel=0.5, **how).columns
    assert 500 < len(thin["coord"]) < 0.9 * len(whole["coord"])
    for name, values in thin.items():
        np.testing.assert_array_equal(often[name], values)
    assert {tuple(point) for point in thin["coord"].tolist()} < {tuple(point) for point in whole["coord"].tolist()}
    cells = np.floor(thin["coord"] / 0.5)
    assert len(np.unique(cells, axis=0)) == len(cells)
    monkeypatch.setattr(
        sample_lidar, "MOST_POINTS", len(thin["coord"]) + 500
    )  # what is left counts, not what was measured
    assert len(scanned(deck_on_walls(), tmp_path / "much", voxel=0.5, **how)) == len(cells)
