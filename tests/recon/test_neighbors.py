"""Neighbors and depth ranges read off sparse points whose angles are known."""

import numpy as np
import pytest
from numpy.typing import NDArray

from recon.dense.neighbors import View, angle_weight, choose_sources, choose_views, covisibility
from recon.settings import DenseSettings
from recon.sfm.colmap_model import SparseModel
from usd_schemas.pinhole import Pinhole, look_at

F64 = NDArray[np.float64]
SETTINGS = DenseSettings()


def model_of(eyes: list[tuple[float, float, float]], points: F64, seen: NDArray[np.bool_]) -> SparseModel:
    """Make a model of cameras that look at the origin; `seen` says which camera sees which point."""
    poses = np.stack([look_at(np.array(eye), np.zeros(3)) for eye in eyes])
    obs_point, obs_image = np.nonzero(seen.T)
    return SparseModel(
        tuple(f"{row:03d}" for row in range(len(eyes))),
        poses,
        "SIMPLE_RADIAL",
        (100.0, 50.0, 50.0, 0.0),
        points,
        np.zeros((len(points), 3), np.uint8),
        np.zeros(len(points)),
        obs_point,
        obs_image,
        np.zeros((len(obs_point), 2)),
    )


def on_circle(*degrees: float) -> list[tuple[float, float, float]]:
    """Stand 10 m from the origin at angles [deg]."""
    return [(10 * np.cos(np.radians(a)), 10 * np.sin(np.radians(a)), 0.0) for a in degrees]


@pytest.fixture
def cloud() -> F64:
    """Scatter points about the origin."""
    return np.random.default_rng(0).normal(0, 0.3, (200, 3))


def test_covisibility_has_a_plain_twin(cloud: F64) -> None:
    """The score of a pair is a sum over the points that both see, symmetric, 0 below a dozen."""
    rng = np.random.default_rng(1)
    eyes = on_circle(0, 4, 9, 17, 33)
    seen = rng.random((5, 200)) < 0.6
    seen[4] = False
    seen[4, :8] = True
    model = model_of(eyes, cloud, seen)
    score = covisibility(model, SETTINGS)
    np.testing.assert_array_equal(score, score.T)
    for first, second in ((0, 1), (1, 3), (2, 3)):
        total = 0.0
        for point in np.flatnonzero(seen[first] & seen[second]):
            a, b = np.array(eyes[first]) - cloud[point], np.array(eyes[second]) - cloud[point]
            long, short = sorted((np.linalg.norm(a), np.linalg.norm(b)))[::-1]
            angle = np.degrees(np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b)))
            total += float(angle_weight(np.array([angle]), SETTINGS)[0]) * (short / long) ** 2
        assert score[first, second] == pytest.approx(total, rel=1e-9)
    assert not score[4].any()


def test_useful_angles_win(cloud: F64) -> None:
    """A view under 8 degrees is best; one under half a degree or sixty is no use at all."""
    model = model_of(on_circle(0, 0.5, 8, 25, 60), cloud, np.ones((5, 200), bool))
    first = choose_views(model, SETTINGS)[0]
    assert first.sources[0] == 2
    assert set(first.sources.tolist()) <= {2, 3}
    weights = angle_weight(np.array([0.5, 1.25, 8.0, 20.0, 31.0]), SETTINGS)
    assert weights[2] == 1.0
    assert weights[0] == weights[1] == weights[4] == 0.0
    assert 0.0 < weights[3] < 0.3


def test_depths_reach_beyond_the_points(cloud: F64) -> None:
    """The range holds every point's depth with room to spare, but not one wild point in a thousand."""
    wild = np.concatenate([cloud] * 5 + [np.array([[9.5, 0.0, 0.0]])])
    view = choose_views(model_of(on_circle(0, 8), wild, np.ones((2, len(wild)), bool)), SETTINGS)[0]
    depth = 10.0 - cloud[:, 0]
    assert 0.5 * depth.min() < view.near < depth.min()
    assert depth.max() < view.far < 4 * depth.max()


def test_views_on_both_sides_come_before_one_beside_another(cloud: F64) -> None:
    """Of two views that stand together the second loses to one on the other side."""
    view = choose_views(model_of(on_circle(0, 8, 8.3, -10), cloud, np.ones((4, 200), bool)), SETTINGS)[0]
    assert view.sources[0] in (1, 2)
    assert view.sources[1] == 3


def test_a_lonely_image_has_no_sources(cloud: F64) -> None:
    """An image that shares nothing is measured with nothing."""
    seen = np.ones((3, 200), bool)
    seen[2] = False
    assert len(choose_views(model_of(on_circle(0, 8, 16), cloud, seen), SETTINGS)[2].sources) == 0


def test_sources_ahead_count_for_the_part_that_they_show() -> None:
    """Two views across make two pictures; of views half ahead it takes more, and one straight ahead is no use."""
    camera = Pinhole(160, 120, 130.0, 132.0, 80.0, 60.0)
    eyes = np.array(
        [
            [0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.7, 0.9, 0.1],
            [-0.7, 0.9, 0.0],
            [0.8, 0.0, 0.0],
            [-0.8, 0.0, 0.0],
            [0.0, 0.0, 0.7],
        ]
    )
    poses = np.stack([look_at(eye, np.array([0.0, 6.0, 0.0])) for eye in eyes])
    across = View(0, np.array([4, 5, 6]), 4.0, 9.0)
    assert choose_sources(across, poses, camera, 2) == (4, 5)
    ahead = View(0, np.array([1, 2, 3, 4, 5, 6]), 4.0, 9.0)
    assert choose_sources(ahead, poses, camera, 2) == (2, 3, 4)
    assert choose_sources(View(0, np.array([1]), 4.0, 9.0), poses, camera, 2) == ()
