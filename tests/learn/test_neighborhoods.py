"""Searches find what brute force finds, pyramids survive rigid motions, and the cache hands out the same rows."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from groundwork.errors import InputError
from learn.models.backbone import COORD, batched, completed, geometry_of
from learn.models.registry import NETWORKS, build_network
from learn.neighborhoods.batches import Batches, farthest_by_kernel, farthest_in_turn
from learn.neighborhoods.cache import cached_pyramid, pyramid_key
from learn.neighborhoods.farthest import farthest_points
from learn.neighborhoods.pyramids import Indices, farthest_pyramid, random_pyramid
from learn.neighborhoods.trees import Trees
from tests.learn import literal_networks as literal

SEEDS = st.integers(0, 10_000)
ONE, MANY = Trees(), Batches()


def cloud(seed: int, count: int = 200) -> np.ndarray:
    """Draw positions in a unit cube."""
    return np.random.default_rng(seed).random((count, 3)).astype(np.float32)


@given(SEEDS, st.integers(1, 200))
def test_farthest_points_equal_the_textbook_loop(seed: int, count: int) -> None:
    """Point 0 first, then the same rows in the same order."""
    coord = cloud(seed)
    assert np.array_equal(farthest_points(coord, count), literal.farthest(coord, count))


def test_equally_far_points_go_by_their_number() -> None:
    """On a grid with ties everywhere, and with every point repeated, the lowest number wins."""
    grid = np.stack(np.meshgrid(*[np.arange(4)] * 3), axis=-1).reshape(-1, 3).astype(np.float32)
    coord = np.concatenate([grid, grid])
    chosen = farthest_points(coord, 64)
    assert np.array_equal(chosen, literal.farthest(coord, 64))
    assert sorted(chosen) == list(range(64))  # no repeat as long as another place is left


@given(SEEDS, st.floats(0.02, 1.0), st.integers(1, 40))
def test_balls_equal_brute_force(seed: int, radius: float, count: int) -> None:
    """Nearest first, no farther than the radius, filled up with the first."""
    coord = cloud(seed)
    assert np.array_equal(ONE.ball(coord, coord[:50], radius, count), literal.ball(coord, coord[:50], radius, count))


def test_a_point_on_the_ball_is_inside_and_an_empty_ball_has_the_nearest() -> None:
    """Distance equal to the radius counts; a center far from every point sees the one nearest to it."""
    coord = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]], np.float32)
    assert ONE.ball(coord, coord[:1], 1.0, 3).tolist() == [[0, 1, 0]]
    assert ONE.ball(coord, np.array([[9, 0, 0]], np.float32), 1.0, 3).tolist() == [[2, 2, 2]]


@given(SEEDS, st.integers(1, 200))
def test_nearest_points_equal_brute_force(seed: int, count: int) -> None:
    """The k nearest, nearest first, itself among them."""
    coord = cloud(seed)
    wanted = np.argsort(literal.distances(coord[:50], coord), axis=1, kind="stable")[:, :count]
    assert np.array_equal(ONE.nearest(coord, coord[:50], count), wanted)


def test_more_points_than_there_are_is_refused() -> None:
    """One line that says how many are needed."""
    both = torch.from_numpy(cloud(0))[None]
    for search in (
        lambda: farthest_points(cloud(0), 201),
        lambda: ONE.nearest(cloud(0), cloud(0), 201),
        lambda: MANY.farthest(both, 201),
        lambda: MANY.nearest(both, both, 201),
    ):
        with pytest.raises(InputError, match="201 or more"):
            search()


@pytest.mark.parametrize("name", NETWORKS)
def test_a_batch_has_the_pyramids_of_its_clouds(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Torch, all clouds at once and distances in parts, finds the rows that trees find cloud by cloud."""
    monkeypatch.setattr("learn.neighborhoods.batches._DISTANCES", 1 << 21)
    network: Any = build_network(name, {}, 3, 5)
    clouds = [cloud(seed, 4096) for seed in range(2)]
    alone = batched([geometry_of(network, coord) for coord in clouds])
    together = completed(network, {COORD: torch.from_numpy(np.stack(clouds))})
    assert alone.keys() == together.keys()
    for key, rows in alone.items():
        assert torch.equal(rows, together[key]), key


@pytest.mark.parametrize("error", [ImportError(), RuntimeError("no C compiler")])
def test_without_a_compiler_points_are_chosen_in_turn(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    """Triton is not there, or cannot compile its kernel: the same rows, one after the other."""

    def fails(*_: object) -> None:
        raise error

    kernel = ModuleType("learn.neighborhoods.farthest_kernel")
    setattr(kernel, "farthest_on_gpu", fails)  # noqa: B010
    monkeypatch.setitem(sys.modules, kernel.__name__, kernel)
    coord = torch.from_numpy(cloud(0))[None]
    assert torch.equal(farthest_by_kernel(coord, 50), farthest_in_turn(coord, 50))


def test_a_batch_orders_ties_by_number_and_fills_its_balls() -> None:
    """As one cloud: the lowest number among equally far points; few or no points in a ball; fewer points than asked."""
    grid = np.stack(np.meshgrid(*[np.arange(4)] * 3), axis=-1).reshape(-1, 3).astype(np.float32)
    coord = np.concatenate([grid, grid])
    assert np.array_equal(MANY.farthest(torch.from_numpy(coord)[None], 64)[0].numpy(), ONE.farthest(coord, 64))
    line = torch.tensor([[[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]])
    assert MANY.ball(line, line[:, :1], 1.0, 5).tolist() == [[[0, 1, 0, 0, 0]]]
    assert MANY.ball(line, torch.tensor([[[9.0, 0, 0]]]), 1.0, 3).tolist() == [[[2, 2, 2]]]


def test_the_random_pyramid_keeps_a_random_subset_at_every_level() -> None:
    """Rows are distinct, levels nest, neighbours and the nearest kept point are those of brute force."""
    coord = cloud(1, 512)
    pyramid = random_pyramid(coord, (4, 2), 8, 0, ONE)
    here = coord
    for level, ratio in enumerate((4, 2)):
        kept = pyramid[f"kept{level}"]
        assert len(set(kept.tolist())) == len(kept) == len(here) // ratio
        apart = literal.distances(here, here)
        assert np.array_equal(pyramid[f"near{level}"], np.argsort(apart, axis=1, kind="stable")[:, :8])
        assert np.array_equal(pyramid[f"up{level}"][:, 0], np.argmin(apart[:, kept], axis=1))
        here = here[kept]
    first = pyramid["kept0"].astype(float)
    assert abs(first.mean() - 255.5) < 60  # 4.6 standard deviations of the mean of 128 rows of 512
    assert not np.array_equal(np.sort(first), np.arange(128))
    assert not np.array_equal(first, random_pyramid(coord, (4, 2), 8, 1, ONE)["kept0"])


def equal(one: Indices, other: Indices) -> bool:
    """Compare two pyramids."""
    return one.keys() == other.keys() and all(np.array_equal(one[name], other[name]) for name in one)


@given(SEEDS, st.floats(0.25, 4.0), st.booleans())
def test_pyramids_do_not_change_under_rigid_motion_and_scale(seed: int, scale: float, mirrored: bool) -> None:
    """Turned, mirrored and scaled alike in all directions, radii too, a cloud has the same rows."""
    coord = cloud(seed)
    turned = coord @ Rotation.random(rng=np.random.default_rng(seed)).as_matrix().T * [1, -1 if mirrored else 1, 1]
    moved = (scale * turned).astype(np.float32)
    rings = [[(0.2, 8)], [(0.4, 8)]]
    scaled = [[(scale * radius, count) for radius, count in level] for level in rings]
    # A point within a rounding error of a ball's surface, or of another's distance, may change sides: leave those out.
    apart = np.sort(literal.distances(coord, coord), axis=1)
    gaps = min(np.diff(apart, axis=1).min(), abs(apart - 0.2).min(), abs(apart - 0.4).min())
    if gaps > 2e-6:
        assert equal(farthest_pyramid(coord, (50, 10), rings, ONE), farthest_pyramid(moved, (50, 10), scaled, ONE))
        assert equal(random_pyramid(coord, (4, 2), 8, 0, ONE), random_pyramid(moved, (4, 2), 8, 0, ONE))


def test_the_cache_reads_what_it_wrote(tmp_path: Path) -> None:
    """The second call builds nothing; another cloud or another parameter does; a torn file is built anew."""
    calls: list[int] = []

    def build(coord: np.ndarray) -> Indices:
        calls.append(len(coord))
        return farthest_pyramid(coord, (20, 5), [[(0.2, 4)], [(0.4, 4)]], ONE)

    coord = cloud(1)
    first = cached_pyramid(tmp_path, coord, {"a": 1}, build)
    assert equal(first, cached_pyramid(tmp_path, coord, {"a": 1}, build))
    assert len(calls) == 1
    assert all(rows.dtype == np.int32 for rows in cached_pyramid(tmp_path, coord, {"a": 1}, build).values())
    cached_pyramid(tmp_path, coord, {"a": 2}, build)
    cached_pyramid(tmp_path, cloud(2), {"a": 1}, build)
    assert len(calls) == 3
    (file,) = tmp_path.glob(f"*/{pyramid_key(coord, {'a': 1})}.npz")
    for torn in (file.read_bytes()[:-100], b"", b"no archive"):
        file.write_bytes(torn)
        assert equal(first, cached_pyramid(tmp_path, coord, {"a": 1}, build))
    assert len(calls) == 6
    np.savez(file, kept0=np.array([object()], dtype=object))
    assert equal(first, cached_pyramid(tmp_path, coord, {"a": 1}, build))
    assert len(calls) == 7
    assert equal(first, cached_pyramid(None, coord, {"a": 1}, build))


def test_each_network_has_its_own_key() -> None:
    """Whatever changes a pyramid changes its parameters."""
    variants = [
        ("pointnet2-ssg", {}),
        ("pointnet2-ssg", {"unit": 2.0}),
        ("pointnet2-ssg", {"counts": (512, 64)}),
        ("pointnet2-msg", {}),
        ("pointnext-s", {}),
        ("pointnext-b", {}),
        ("pointnext-s", {"radius": 0.2}),
        ("pointnext-s", {"neighbours": 16}),
        ("randlanet", {}),
        ("randlanet", {"neighbours": 8}),
        ("randlanet", {"ratios": (4, 4, 4, 4, 4)}),
        ("randlanet", {"sampling_seed": 1}),
    ]
    keys = []
    for name, settings in variants:
        network = build_network(name, settings, 3, 4)
        parameters = getattr(network, "pyramid_parameters")()  # noqa: B009
        keys.append(pyramid_key(cloud(0), parameters))
    assert len(set(keys)) == len(variants)
