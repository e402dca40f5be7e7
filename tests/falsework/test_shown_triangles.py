"""What is left of a stage's triangles for display: whole objects, and land without a hole."""

from collections import Counter

import numpy as np
import pytest
from numpy.typing import NDArray

from falsework.children.shown_triangles import shown_triangles

F64 = NDArray[np.float64]
BOX = np.array([[-5.0, -5.0, 0.0], [5.0, 5.0, 8.0]])  # [m] of the bridge
MOST = 3000


def hills(size: float, cells: int) -> F64:
    """Make a square of hilly land of so many cells a side [m], corners of shape (2 cells², 3, 3)."""
    x = np.linspace(-size, size, cells + 1)
    grid = np.stack(np.meshgrid(x, x, indexing="ij"), -1)
    places = np.concatenate([grid, 3.0 * np.sin(grid[..., :1] / 17.0) * np.cos(grid[..., 1:] / 23.0)], axis=-1)
    a, b, c, d = places[:-1, :-1], places[1:, :-1], places[1:, 1:], places[:-1, 1:]
    return np.concatenate([np.stack([a, b, c], -2), np.stack([a, c, d], -2)]).reshape(-1, 3, 3)


def bridge_and(corners: F64, draw: NDArray[np.uint32]) -> tuple[F64, NDArray[np.int64], NDArray[np.uint32]]:
    """Put a bridge of two triangles, draw 0, before other triangles."""
    low, high = BOX
    mid = np.array([low[0], high[1], 4.0])
    own = np.array([[low, high, mid], [high, low, [high[0], low[1], 4.0]]])
    level = np.r_[np.zeros(2, np.int64), np.ones(len(corners), np.int64)]
    return np.concatenate([own, corners]), level, np.r_[np.zeros(2, np.uint32), draw]


def edge_ends(corners: F64) -> F64:
    """Find the ends of edges that belong to one triangle only, to a tenth of a millimeter, shape (E, 2, 3)."""
    places = [tuple(place) for place in corners.reshape(-1, 3).round(4).tolist()]
    edges = Counter(
        tuple(sorted((places[3 * row + k], places[3 * row + (k + 1) % 3])))
        for row in range(len(corners))
        for k in range(3)
    )
    return np.array([edge for edge, count in edges.items() if count == 1])


@pytest.mark.parametrize("cells", [30, 120])
def test_land_has_no_hole_and_a_clean_outline(cells: int) -> None:
    """Two tiles of land, few triangles or ten times too many: its only edge is the outline at the reach."""
    land = hills(400.0, cells)
    tile = (land[..., 0].mean(axis=1) > 0.0).astype(np.uint32) + 1
    shown, rows = shown_triangles(*bridge_and(land, tile), MOST, 200.0)
    assert len(shown) == len(rows) <= MOST
    mine = rows >= 2
    assert mine.sum() == len(shown) - 2
    ends = edge_ends(shown[mine])
    away = np.linalg.norm(np.maximum(np.abs(ends[..., :2]) - 5.0, 0.0), axis=-1)
    assert away.min() > 180.0  # merged corners draw it in a little; a hole would be nearer
    assert away.max() < 203.0  # 24 straight sides about a circle
    x, y = np.moveaxis(shown[mine][..., :2], -1, 0)
    area = 0.5 * np.abs((x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (x[:, 2] - x[:, 0]) * (y[:, 1] - y[:, 0])).sum()
    assert area == pytest.approx(np.pi * 200**2 + 4 * 10 * 200 + 100, rel=0.03)
    assert set(np.unique((np.r_[0, 0, tile])[rows[mine]])) == {1, 2}


def test_small_tiles_of_land_are_land_and_have_triangles_beside_a_large_bridge() -> None:
    """Land in tiles of 20 m, beside a bridge that takes all: it is coarsened as one surface, not left out."""
    land = hills(400.0, 120)
    tile = (np.floor(land[..., :2].mean(axis=1) / 20.0).astype(int) @ [100, 1] + 5000).astype(np.uint32)
    corners, level, draw = bridge_and(land, tile)
    known = level > 0
    _, rows = shown_triangles(corners, level, draw, 2, 200.0)
    assert rows.tolist() == [0, 1]
    shown, rows = shown_triangles(corners, level, draw, 2 * MOST, 200.0, known)
    ends = edge_ends(shown[rows >= 2])
    assert np.linalg.norm(np.maximum(np.abs(ends[..., :2]) - 5.0, 0.0), axis=-1).min() > 170.0
    bridge = np.repeat(corners[:2], MOST, axis=0)
    whole = np.concatenate([bridge, land])
    level, draw = np.r_[np.zeros(2 * MOST, np.int64), level[2:]], np.r_[np.zeros(2 * MOST, np.uint32), draw[2:]]
    _, rows = shown_triangles(whole, level, draw, 2 * MOST, 200.0, level > 0)
    assert 300 < (rows >= 2 * MOST).sum() <= 0.2 * 2 * MOST


def test_objects_are_shown_whole_or_not() -> None:
    """The bridge always; of others those that look largest as long as they fit; far ones never; rows are theirs."""
    rng, count = np.random.default_rng(1), 400
    sizes = rng.integers(3, 20, count)
    middle = np.repeat(rng.uniform(-300.0, 300.0, (count, 3)), sizes, axis=0)
    corners = middle[:, None] + rng.uniform(-2.0, 2.0, (len(middle), 3, 3))
    whole, level, draw = bridge_and(corners, np.repeat(np.arange(1, count + 1), sizes).astype(np.uint32))
    shown, rows = shown_triangles(whole, level, draw, 1000, 250.0)
    np.testing.assert_array_equal(shown, whole[rows])
    assert 1000 - 20 < len(rows) <= 1000
    assert {0, 1} <= set(rows.tolist())
    kept, there = np.bincount(draw[rows], minlength=count + 1), np.bincount(draw)
    assert set(np.flatnonzero(kept)) == set(np.flatnonzero(kept == there))
    away = np.linalg.norm(np.maximum(np.maximum(BOX[0] - middle, middle - BOX[1]), 0.0), axis=1)
    assert away[rows[rows >= 2] - 2].max() < 255.0
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    weight = np.bincount(draw[2:], area / (away**2 + 100.0))
    near = np.bincount(draw[2:], away) < 245.0 * np.maximum(there, 1)
    near[0] = False
    assert np.median(weight[near & (kept > 0)]) > 2.0 * np.median(weight[near & (kept == 0)])
    assert kept[weight.argmax()] > 0


def test_nothing_changes_where_all_of_it_fits() -> None:
    """Without a reach, and with room for all: the same triangles, each once."""
    whole = bridge_and(hills(60.0, 10), np.ones(200, np.uint32))
    shown, rows = shown_triangles(*whole, MOST)
    assert sorted(rows.tolist()) == list(range(202))
    np.testing.assert_array_equal(shown, whole[0][rows])
    assert shown_triangles(*whole, 3)[1].tolist() == [0, 1]  # no room for any land
    assert shown_triangles(whole[0][:0], whole[1][:0], whole[2][:0], MOST)[1].tolist() == []
