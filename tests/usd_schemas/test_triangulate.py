"""Triangulation covers exactly the polygon: areas by the shoelace formula, orientation of every triangle."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from usd_schemas.triangulate import face_normals, triangulate

F64 = NDArray[np.float64]


def shoelace(polygon: F64) -> float:
    """Signed area of a plane polygon, shape (N, 2)."""
    x, y = polygon.T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) / 2)


def check(polygon: F64, place: F64, offset: F64) -> None:
    """Triangulate one polygon on a plane in space and compare area and orientation.

    Args:
        polygon: Counter-clockwise, shape (N, 2).
        place: Rotation, shape (3, 3).
        offset: Where it lies, shape (3,).
    """
    points = np.column_stack([polygon, np.zeros(len(polygon))]) @ place.T + offset
    count = np.array([len(polygon)])
    triangles, face = triangulate(points, count, np.arange(len(polygon)))
    corners = points[triangles]
    signed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ place[:, 2] / 2
    size = float(np.ptp(polygon, axis=0).prod())
    assert triangles.shape == (len(polygon) - 2, 3)
    assert not face.any()
    # The signed sum always fits; the sum of sizes fits only where nothing overlaps or sticks out.
    assert abs(signed).sum() == pytest.approx(shoelace(polygon), abs=1e-9 * size)
    assert signed.min() >= -1e-9 * size
    assert np.linalg.norm(face_normals(points, count, np.arange(len(polygon)))) / 2 == pytest.approx(shoelace(polygon))


def rotation(rng: np.random.Generator) -> F64:
    """Draw a rotation, shape (3, 3)."""
    matrix, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return matrix * np.sign(np.linalg.det(matrix))


def star(rng: np.random.Generator, count: int) -> F64:
    """Draw a star-shaped polygon with many reflex corners, shape (count, 2)."""
    angle = np.sort(rng.uniform(0, 2 * np.pi, count))
    angle += np.linspace(0, 1e-3, count)
    while np.diff(angle, append=angle[0] + 2 * np.pi).max() > np.pi - 0.05:
        angle = np.sort(rng.uniform(0, 2 * np.pi, count))
    return np.stack([np.cos(angle), np.sin(angle)], axis=1) * rng.uniform(0.1, 3.0, (count, 1))


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(4, 40))
def test_star_polygons(seed: int, count: int) -> None:
    """Any star-shaped polygon, anywhere in space."""
    rng = np.random.default_rng(seed)
    check(star(rng, max(count, 5) if seed % 2 else 4), rotation(rng), rng.uniform(-100, 100, 3))


def test_comb_and_spiral() -> None:
    """Polygons that no point sees whole."""
    teeth = [[x + dx, y] for x in range(8) for dx, y in ((0.0, 4.0), (0.5, 1.0))]
    comb = np.array([[0.0, 0.0], [7.5, 0.0], *teeth[::-1]])
    check(comb, np.eye(3), np.zeros(3))
    turn = np.linspace(0, 5 * np.pi, 60)
    outer = np.stack([np.cos(turn), np.sin(turn)], axis=1) * (1 + turn)[:, None]
    inner = outer[::-1] * 0.0 + np.stack([np.cos(turn), np.sin(turn)], axis=1)[::-1] * (0.4 + turn[::-1])[:, None]
    spiral = np.concatenate([outer, inner])
    check(spiral if shoelace(spiral) > 0 else spiral[::-1], np.eye(3), np.array([5e3, 0.0, 0.0]))


def test_slit_to_a_hole() -> None:
    """A square with a square hole, joined by a slit whose two sides repeat the same points."""
    outer = [[0, 0], [4, 0], [4, 4], [0, 4], [0, 0]]
    hole = [[1, 1], [1, 3], [3, 3], [3, 1], [1, 1]]
    check(np.array(outer + hole, float), np.eye(3), np.zeros(3))


def test_collinear_corners() -> None:
    """Corners in the middle of a straight edge neither add nor lose area."""
    check(np.array([[0, 0], [1, 0], [2, 0], [3, 0], [3, 2], [1.5, 2], [0, 2], [0, 1]], float), np.eye(3), np.zeros(3))


@pytest.mark.parametrize("start", range(4))
def test_concave_quad(start: int) -> None:
    """An arrow head, whichever corner it begins at."""
    check(np.roll(np.array([[0, 0], [2, -1], [0, 2], [-2, -1]], float), start, axis=0), np.eye(3), np.zeros(3))


def test_mixed_faces_keep_their_order() -> None:
    """Triangles come in the order of the faces, and faces without area give nothing."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 2, 0]], float)
    triangles, face = triangulate(points, np.array([4, 2, 3, 5]), np.array([0, 1, 2, 3, 0, 1, 3, 2, 4, 0, 1, 2, 4, 3]))
    assert face.tolist() == [0, 0, 2, 3, 3, 3]
    assert triangles[2].tolist() == [6, 7, 8]
