"""Distances to roads: those within the reach are exact, whatever is left out beyond it."""

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.byways import Byway, road_distance

F64 = NDArray[np.float64]


def random_road(rng: np.random.Generator, count: int) -> Byway:
    """Draw a winding road whose width changes along it."""
    turn = np.cumsum(rng.normal(0.0, 0.1, count))
    ahead = np.column_stack([np.cos(turn), np.sin(turn)])
    middle = rng.uniform(-150.0, 150.0, 2) + 1.5 * np.cumsum(ahead, axis=0)
    half = rng.uniform(1.5, 4.0, count)[:, None] * np.column_stack([-ahead[:, 1], ahead[:, 0]])
    level = np.zeros((count, 1))
    return Byway(np.hstack([middle + half, level]), np.hstack([middle - half, level]), 2.5)


def plainly(byways: list[Byway], place: F64) -> float:
    """Measure the distance of one place to every piece of every road, one after the other."""
    found = np.inf
    for byway in byways:
        wide = 0.5 * np.linalg.norm((byway.left - byway.right)[:, :2], axis=1)
        for k in range(len(wide) - 1):
            a, b = byway.middle[k], byway.middle[k + 1]
            share = min(max(float((place - a) @ (b - a)) / float((b - a) @ (b - a)), 0.0), 1.0)
            apart = float(np.linalg.norm(place - a - share * (b - a)))
            found = min(found, apart - (1.0 - share) * wide[k] - share * wide[k + 1])
    return found


def test_distances_are_those_to_the_nearest_piece() -> None:
    """A plain loop over all pieces finds the same; without roads all distances are infinite."""
    rng = np.random.default_rng(3)
    byways = [random_road(rng, count) for count in (2, 33, 90)]
    places = rng.uniform(-300.0, 300.0, (60, 2))
    np.testing.assert_allclose(road_distance(byways, places), [plainly(byways, place) for place in places], atol=1e-9)
    assert np.isinf(road_distance([], places)).all()


def test_a_reach_changes_no_bit_within_it() -> None:
    """Distances up to the reach have the same bytes as without one, and all others lie beyond it."""
    rng = np.random.default_rng(4)
    byways = [random_road(rng, count) for count in (40, 200, 120)]
    places = rng.uniform(-600.0, 600.0, (4000, 2))
    whole = road_distance(byways, places)
    for reach in (0.0, 5.0, 60.0):
        near = road_distance(byways, places, reach)
        assert np.minimum(near, reach).tobytes() == np.minimum(whole, reach).tobytes()
        assert 0 < np.sum(whole <= reach) < len(places)
        assert np.isinf(near).any()
