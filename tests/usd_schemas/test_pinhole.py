"""The camera convention: pixel centers, projection and its inverse, aiming."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from usd_schemas.pinhole import Pinhole, look_at, project, unproject

CAMERA = Pinhole(1280, 960, 900.0, 910.0, 655.3, 470.7)


@given(seed=st.integers(0, 2**32 - 1))
def test_unproject_inverts_project(seed: int) -> None:
    """Pixels and depths lead back to the same points, also far from the origin."""
    rng = np.random.default_rng(seed)
    offset = np.array([5e5, 4.6e6, 100.0]) * rng.integers(0, 2)
    pose = look_at(rng.uniform(-50, 50, 3) + offset, rng.uniform(-50, 50, 3) + offset)
    points = unproject(rng.uniform(0, 1280, (20, 2)), rng.uniform(0.5, 200, 20), CAMERA, pose)
    pixels, depth = project(points, CAMERA, pose)
    np.testing.assert_allclose(unproject(pixels, depth, CAMERA, pose), points, atol=1e-6)
    np.testing.assert_allclose(pose[:3, :3].T @ pose[:3, :3], np.eye(3), atol=1e-9)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0)


def test_axes_right_down_forward() -> None:
    """Looking north from the south: east is right, up is smaller rows, north is depth."""
    pose = look_at(np.array([0.0, -10.0, 0.0]), np.zeros(3))
    pixels, depth = project(np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 1], [0, -20, 0]]), CAMERA, pose)
    np.testing.assert_allclose(pixels[:3], [[655.3, 470.7], [745.3, 470.7], [655.3, 379.7]])
    np.testing.assert_allclose(depth, [10, 10, 10, -10])


def test_agrees_with_opencv_up_to_half_a_pixel() -> None:
    """OpenCV counts from pixel centers: its principal point is ours minus 0.5, and so are its pixels."""
    import cv2

    points = np.random.default_rng(3).uniform(-1, 1, (10, 3)) + np.array([0, 0, 5])
    matrix = CAMERA.matrix() - np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])
    theirs, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), matrix, np.zeros(4))
    ours, _ = project(points, CAMERA, np.eye(4))
    np.testing.assert_allclose(ours - 0.5, theirs[:, 0], atol=1e-9)


@pytest.mark.parametrize("up", [1.0, -1.0])
def test_straight_up_and_down(up: float) -> None:
    """Along the up axis there is no right: the world's x is taken."""
    pose = look_at(np.zeros(3), np.array([0.0, 0.0, up]))
    np.testing.assert_allclose(pose[:3, 0], [1, 0, 0])
    np.testing.assert_allclose(pose[:3, 2], [0, 0, up])
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0)


def test_a_camera_looks_at_its_target_and_stands_upright() -> None:
    """The target lies straight ahead, z up is y down in the image, the frame is a rotation."""
    eye, target = np.array([3.0, -20.0, 7.0]), np.array([1.0, 2.0, 0.5])
    pose = look_at(eye, target)
    ahead = np.array([0.0, 0.0, float(np.linalg.norm(target - eye))])
    np.testing.assert_allclose(pose[:3, :3].T @ (target - eye), ahead, atol=1e-9)
    np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0)
    assert pose[2, 1] < 0.0
    assert pose[2, 0] == 0.0
