"""The greedy choice of views, against a hand-made case and a plain twin."""

import numpy as np
import pytest
from scipy import sparse
from scipy.spatial.transform import Rotation

from authoring.surveys.coverage import Wanted, choose_views


def test_greedy_choice_takes_what_adds_most() -> None:
    """Elements count once a place, preferred neighbors go first, and nothing is taken below its worth."""
    shows = sparse.csr_matrix(np.array([[1, 1, 1, 0], [1, 1, 1, 0], [0, 1, 1, 0], [0, 0, 0, 1]]))
    poses = np.tile(np.eye(4), (4, 1, 1))
    poses[:, 0, 3] = [0.0, 0.0, 50.0, 90.0]
    place, needs, worth = np.array([0, 0, 1, 2]), np.full(4, 2), np.ones(4, np.int64)
    wanted = Wanted(shows, needs, worth)
    assert choose_views(wanted, poses, place, 1, 9).tolist() == [0, 2, 3]  # the second view of place 0 adds nothing
    assert choose_views(wanted, poses, place, 2, 9).tolist() == [0, 2]
    assert choose_views(wanted, poses, place, 1, 1).tolist() == [0]
    poses[3, 0, 3] = 1.0  # next to the first: three times one is more than two
    assert choose_views(wanted, poses, place, 1, 9).tolist() == [0, 3, 2]
    np.testing.assert_array_equal(needs, 2)
    again = sparse.csr_matrix(np.array([[1, 1, 0, 0], [1, 0, 1, 1], [1, 0, 0, 0]]))  # both of place 0 show the first
    apart = np.tile(np.eye(4), (3, 1, 1))
    apart[2, 0, 3] = 50.0
    twice = Wanted(again, np.array([2, 1, 1, 1]), worth)
    assert choose_views(twice, apart, np.array([0, 0, 1]), 1, 9).tolist() == [1, 0, 2]  # it is still wanted once
    nobody = Wanted(sparse.csr_matrix((0, 4)), needs, worth)
    assert choose_views(nobody, np.zeros((0, 4, 4)), np.zeros(0, np.int64), 1, 9).shape == (0,)


@pytest.mark.parametrize("seed", range(4))
def test_greedy_choice_has_a_plain_twin(seed: int) -> None:
    """View after view by loops: needs, worth, places, and neighbors within 3.5 m and 46 degrees."""
    rng = np.random.default_rng(seed)
    shows, place = rng.random((30, 12)) < 0.3, np.sort(rng.integers(0, 12, 30))
    poses = np.tile(np.eye(4), (30, 1, 1))
    poses[:, :3, 3] = rng.uniform(0, 8, (30, 3))
    poses[:, :3, :3] = Rotation.from_euler("x", rng.uniform(-90, 90, (30, 1)), degrees=True).as_matrix()
    needs, worth = rng.integers(1, 3, 12), rng.integers(1, 5, 12)
    left, factor, chosen = needs.copy(), np.ones(30, np.int64), []
    alive = shows.copy()
    while True:
        gains = [int(worth[row & (left > 0)].sum()) for row in alive]
        gains = [gain if gain >= 2 else 0 for gain in gains]
        best = int(np.argmax(gains * factor))
        if gains[best] < 2 or len(chosen) == 20:
            break
        chosen.append(best)
        shown = alive[best].copy()
        left -= shown
        alive[np.ix_(place == place[best], shown)] = False
        for other in range(30):
            near = np.linalg.norm(poses[other, :3, 3] - poses[best, :3, 3]) <= 3.5
            if near and poses[other, :3, 2] @ poses[best, :3, 2] >= np.cos(np.radians(46.0)):
                factor[other] = 3
    wanted = Wanted(sparse.csr_matrix(shows.astype(np.int64)), needs, worth)
    assert choose_views(wanted, poses, place, 2, 20).tolist() == chosen
    assert len(chosen) > 4
