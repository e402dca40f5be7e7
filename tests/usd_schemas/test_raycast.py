"""Ray casting and distances against closed forms, also far from the origin."""

import numpy as np
import pytest
from numpy.typing import NDArray

from usd_schemas.raycast import NOTHING, RayScene

F64 = NDArray[np.float64]


def two_rectangles(offset: F64) -> tuple[F64, NDArray[np.uint32]]:
    """Two rectangles of 2 x 2.6 facing up at z = 0 (id 5) and z = 3 (id 9), the upper one shifted by 1 along x."""
    square = np.array([[[-1, -1, 0], [1, -1, 0], [1, 1, 0]], [[-1, -1, 0], [1, 1, 0], [-1, 1, 0]]], float) * [
        1.0,
        1.3,
        1.0,
    ]
    corners = np.concatenate([square, square + np.array([1.0, 0.0, 3.0])]) + offset
    return corners, np.array([5, 5, 9, 9], np.uint32)


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (5e5 + 0.37, 4.6e6 + 0.21, 30.0)])
def test_first_hit_and_misses(offset: tuple[float, ...]) -> None:
    """The nearer rectangle hides the farther one; a miss is +inf, `NOTHING` and id 0; far away nothing is lost."""
    place = np.array(offset)
    scene = RayScene(*two_rectangles(place))
    origins = np.array([[0.5, 0.2, 10.0], [-0.5, 0.2, 10.0], [9.0, 0.0, 10.0], [0.5, 0.2, -4.0]]) + place
    directions = np.array([[0, 0, -1], [0, 0, -2], [0, 0, -1], [0, 0, 1]], float)
    distance, triangle, ids = scene.cast(origins, directions)
    np.testing.assert_allclose(distance, [7.0, 5.0, np.inf, 4.0], rtol=1e-6)
    assert ids.tolist() == [9, 5, 0, 5]
    assert triangle[2] == NOTHING
    assert (triangle[[0, 1, 3]] // 2).tolist() == [1, 0, 0]


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (5e5 + 0.37, 4.6e6 + 0.21, 30.0)])
def test_distance_to_the_surface(offset: tuple[float, ...]) -> None:
    """Distances above, below, beside an edge and beyond a corner."""
    place = np.array(offset)
    scene = RayScene(*two_rectangles(place))
    points = np.array([[-0.5, 0.0, 1.0], [0.5, 0.0, 2.5], [-4.0, 0.0, 0.0], [5.0, 5.0, 3.0]]) + place
    distance, triangle = scene.distance(points)
    np.testing.assert_allclose(distance, [1.0, 0.5, 3.0, np.hypot(3.0, 3.7)], rtol=1e-5)
    assert (triangle // 2).tolist() == [0, 1, 0, 1]


def test_no_triangles() -> None:
    """An empty scene is never hit."""
    scene = RayScene(np.zeros((0, 3, 3)), np.zeros(0, np.uint32))
    distance, triangle, ids = scene.cast(np.zeros((2, 3)), np.ones((2, 3)))
    assert np.isinf(distance).all()
    assert triangle.tolist() == [NOTHING, NOTHING]
    assert ids.tolist() == [0, 0]
