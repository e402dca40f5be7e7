"""The nearest point of a triangle is exact: against a dense search, and on triangles that single precision spoils."""

import numpy as np
import pytest
from numpy.typing import NDArray

from recon.truth.surface_distance import nearest_surface
from recon.truth.triangle_points import nearest_on_triangles
from render.capture import Truth
from tests.conftest import RecordProof

F64 = NDArray[np.float64]


def searched(point: F64, triangle: F64) -> float:
    """Find the least distance to a triangle by narrowing a grid of its barycentric coordinates [m]."""
    low, high, least = np.zeros(2), np.ones(2), np.inf
    for _ in range(40):
        u, v = (grid.ravel() for grid in np.meshgrid(*(np.linspace(low[i], high[i], 21) for i in (0, 1))))
        within = (u >= 0) & (v >= 0) & (u + v <= 1)
        u, v = (np.append(part[within], part[within][:0]) for part in (u, v))
        there = triangle[0] + u[:, None] * (triangle[1] - triangle[0]) + v[:, None] * (triangle[2] - triangle[0])
        far = np.linalg.norm(there - point, axis=1)
        best, width = int(np.argmin(far)), (high - low) / 8
        least = min(least, float(far[best]))
        middle = np.array([u[best], v[best]])
        low, high = np.maximum(middle - width, 0.0), np.minimum(middle + width, 1.0)
    return least


def test_nearest_points_against_a_search(record_proof: RecordProof) -> None:
    """Inside, beside every edge and beyond every corner, the distance is the least that a search finds."""
    rng = np.random.default_rng(0)
    corners, points = rng.normal(size=(60, 3, 3)), rng.normal(size=(60, 3)) * 1.5
    corners[50:, 2] = corners[50:, 0] + 0.3 * (corners[50:, 1] - corners[50:, 0])  # of no area
    found = nearest_on_triangles(points, corners, np.arange(60))
    far = np.linalg.norm(found - points, axis=1)
    wanted = np.array([searched(point, triangle) for point, triangle in zip(points, corners, strict=True)])
    np.testing.assert_allclose(far[:50], wanted[:50], atol=1e-6)
    assert (far[50:] <= wanted[50:] + 1e-9).all()
    weights = np.linalg.lstsq(np.block([[corners[0].T], [np.ones((1, 3))]]), np.append(found[0], 1.0), rcond=None)[0]
    assert (weights > -1e-9).all()
    worst = float(np.abs(far[:50] - wanted[:50]).max())
    record_proof("recon: nearest point of a triangle against a search", 50, 0, {"worst_error_m": worst})


def test_a_triangle_that_is_a_point_is_nearest_there() -> None:
    """Three equal corners: that point, whatever is asked."""
    corners = np.repeat(np.array([[[1.0, 2.0, 3.0]], [[-4.0, 0.0, 0.5]]]), 3, axis=1)
    points = np.array([[0.0, 0.0, 0.0], [-4.0, 0.0, 0.5]])
    np.testing.assert_array_equal(nearest_on_triangles(points, corners, np.arange(2)), corners[:, 0])


def test_thin_triangles_keep_their_millimeters(monkeypatch: pytest.MonkeyPatch, record_proof: RecordProof) -> None:
    """Points beside two slivers 350 m long and a millimeter wide: 1 to 50 cm off, right to less than a tenth of a mm.

    Of the two the engine may take the farther one: half a millimeter aside, at 1 cm, makes 0.05 mm.
    """
    rng = np.random.default_rng(1)
    shares = rng.uniform(0.05, 0.95, 400)
    along = np.array([300.0, 170.0, 40.0])
    start, width = np.array([-150.0, -90.0, 12.0]), np.array([0.0, 0.0, 1e-3])
    strip = np.array([[start, start + along, start + along + width], [start, start + along + width, start + width]])
    normal = np.cross(along, width)
    normal /= np.linalg.norm(normal)
    aside = rng.uniform(0.01, 0.5, 400)
    points = start + shares[:, None] * along + 0.5 * width + aside[:, None] * normal
    surface = (strip, np.ones(2, np.uint32), np.array([4, 4], np.uint8))
    monkeypatch.setattr(Truth, "surface", lambda _: surface)
    far, labels = nearest_surface(points, Truth.__new__(Truth))
    np.testing.assert_allclose(far, aside, atol=6e-5)
    assert set(labels) == {4}
    worst = float(np.abs(far - aside).max())
    record_proof("recon: surface distance on slivers of 350 m by 1 mm", len(far), 1, {"worst_error_m": worst})
