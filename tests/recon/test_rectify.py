"""Rectification of any motion: equal rows, depth from disparity, parts of pairs, and pairs that cannot be rectified."""

import numpy as np
import pytest
from numpy.typing import NDArray

from recon.dense.rectify import rectify, source_maps
from usd_schemas.pinhole import Pinhole, look_at, project

F64 = NDArray[np.float64]
CAMERA = Pinhole(160, 120, 130.0, 132.0, 81.0, 58.5)
TARGET = np.array([0.0, 6.0, 0.0])
MOTIONS = {
    "right": (0.8, 0.0, 0.0),
    "left": (-0.8, 0.0, 0.0),
    "up": (0.0, 0.0, 0.7),
    "down": (0.1, 0.0, -0.7),
    "diagonal": (0.6, 0.1, -0.5),
    "partly forward": (0.8, 0.4, 0.1),
}


def pose_at(offset: tuple[float, float, float], roll: float = 0.0) -> F64:
    """Look at the target from an offset, the camera rolled about its axis [rad]."""
    pose = look_at(np.array(offset), TARGET)
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(roll), -np.sin(roll)], [np.sin(roll), np.cos(roll)]]
    return pose @ turn


@pytest.mark.parametrize("name", sorted(MOTIONS))
def test_rows_agree_and_disparity_is_depth(name: str) -> None:
    """A point lands on the same row of both images, its disparity tells its depth, and the maps lead back to it."""
    reference, source = pose_at((0.0, 0.0, 0.0), 0.3), pose_at(MOTIONS[name], -0.2)
    pair = rectify(CAMERA, reference, source, 4.0, 9.0)
    assert pair is not None
    rng = np.random.default_rng(3)
    pixels = rng.uniform([20, 20], [140, 100], (200, 2))
    depth = rng.uniform(4.5, 8.5, 200)
    rays = np.column_stack([(pixels - [CAMERA.cx, CAMERA.cy]) / [CAMERA.fx, CAMERA.fy], np.ones(200)])
    world = (rays * depth[:, None]) @ reference[:3, :3].T + reference[:3, 3]
    places = []
    for pose, turn, center in ((reference, pair.left, pair.left_center), (source, pair.right, pair.right_center)):
        local = (world - pose[:3, 3]) @ pose[:3, :3] @ turn.T
        places.append(local[:, :2] / local[:, 2:] * pair.focal + center)
        common_depth = local[:, 2]
    np.testing.assert_allclose(places[0][:, 1], places[1][:, 1], atol=1e-9)
    disparity = places[0][:, 0] - places[1][:, 0]
    np.testing.assert_allclose(pair.focal * pair.baseline / (disparity + pair.infinity), common_depth, rtol=1e-9)
    assert disparity.min() >= 0.0
    assert disparity.max() < pair.disparities
    assert places[0].min() >= 0.0  # nothing of the reference is cut off
    assert (places[0] <= pair.size).all()
    for right, pose in ((False, reference), (True, source)):
        seen, _ = project(world, CAMERA, pose)
        columns, rows = source_maps(pair, CAMERA, right)
        inside = ((places[right] > 1.0) & (places[right] < np.array(pair.size) - 1.0)).all(axis=1)
        assert inside.mean() > 0.6
        # Where the map is nearly linear, its value between pixel centers is the mean of those around.
        np.testing.assert_allclose(_between(columns, places[right][inside]), seen[inside, 0] - 0.5, atol=0.02)
        np.testing.assert_allclose(_between(rows, places[right][inside]), seen[inside, 1] - 0.5, atol=0.02)


@pytest.mark.parametrize("motion", [(0.7, 0.9, 0.1), (-0.2, 0.8, -0.6), (0.9, -1.2, 0.0)])
def test_of_a_motion_forwards_the_part_beside_it_is_kept(motion: tuple[float, float, float]) -> None:
    """Half of the picture and more has equal rows and its depth; no ray within 30 degrees of the motion does."""
    reference, source = pose_at((0.0, 0.0, 0.0), 0.3), pose_at(motion, -0.2)
    pair = rectify(CAMERA, reference, source, 4.0, 9.0)
    assert pair is not None
    assert 0.35 <= pair.share < 0.9
    assert pair.share == pytest.approx(min(plain_share(pair.left), plain_share(pair.right)), abs=0.02)
    rng = np.random.default_rng(4)
    pixels = rng.uniform(0, [CAMERA.width, CAMERA.height], (20_000, 2))
    depth = rng.uniform(4.5, 8.5, len(pixels))
    rays = np.column_stack([(pixels - [CAMERA.cx, CAMERA.cy]) / [CAMERA.fx, CAMERA.fy], np.ones(len(pixels))])
    world = (rays * depth[:, None]) @ reference[:3, :3].T + reference[:3, 3]
    places, fronts = [], []
    for pose, turn, center in ((reference, pair.left, pair.left_center), (source, pair.right, pair.right_center)):
        local = (world - pose[:3, 3]) @ pose[:3, :3] @ turn.T
        places.append(local[:, :2] / local[:, 2:] * pair.focal + center)
        fronts.append(local[:, 2])
    held = (fronts[0] > 0) & ((places[0] >= [pair.disparities, 0.0]) & (places[0] <= pair.size)).all(axis=1)
    assert pair.share - 0.05 < held.mean()
    np.testing.assert_allclose(places[0][held, 1], places[1][held, 1], atol=1e-9)
    disparity = places[0][held, 0] - places[1][held, 0]
    np.testing.assert_allclose(pair.focal * pair.baseline / (disparity + pair.infinity), fronts[0][held], rtol=1e-9)
    assert disparity.min() >= 0.0
    assert disparity.max() < pair.disparities
    ahead = (source[:3, 3] - reference[:3, 3]) / np.linalg.norm(source[:3, 3] - reference[:3, 3])
    along = world[held] - reference[:3, 3]
    cosine = np.abs(along @ ahead) / np.linalg.norm(along, axis=1)
    assert cosine.max() < np.cos(np.radians(29.0))
    for right, pose in ((False, reference), (True, source)):
        seen, _ = project(world[held], CAMERA, pose)
        columns, rows = source_maps(pair, CAMERA, right)
        where = places[right][held]
        inside = ((where > 1.0) & (where < np.array(pair.size) - 1.0)).all(axis=1)
        assert inside.mean() > 0.6
        np.testing.assert_allclose(_between(columns, where[inside]), seen[inside, 0] - 0.5, atol=0.02)
        np.testing.assert_allclose(_between(rows, where[inside]), seen[inside, 1] - 0.5, atol=0.02)


def plain_share(turn: F64) -> float:
    """Count the pixels of an image whose rays are at most 60 degrees off the plane's axis, along it and across."""
    held = 0
    for i, j in np.ndindex(CAMERA.height, CAMERA.width):
        x, y, z = turn @ [(j + 0.5 - CAMERA.cx) / CAMERA.fx, (i + 0.5 - CAMERA.cy) / CAMERA.fy, 1.0]
        held += z > 0 and abs(np.arctan2(x, z)) <= np.pi / 3 and abs(np.arctan2(y, z)) <= np.pi / 3
    return held / (CAMERA.height * CAMERA.width)


def test_more_disparities_than_opencv_counts_are_cut_off() -> None:
    """A sixteenth of a pixel must fit into 16 bits with its sign: what is nearer is not measured, the rest is."""
    large = Pinhole(16, 12, 13_000.0, 13_200.0, 8.0, 6.0)
    pair = rectify(large, pose_at((0.0, 0.0, 0.0)), pose_at((0.8, 0.0, 0.0)), 1.0, 9.0)
    assert pair is not None
    assert pair.disparities * 16 < 2**15
    assert pair.disparities % 16 == 0


def test_what_lies_beside_is_whole() -> None:
    """Of a motion across the view, nothing is left out."""
    pair = rectify(CAMERA, pose_at((0.0, 0.0, 0.0)), pose_at((0.8, 0.0, 0.0)), 4.0, 9.0)
    assert pair is not None
    assert pair.share == 1.0


def _between(image: NDArray[np.float32], places: F64) -> F64:
    """Read an image between pixel centers, which lie at +0.5."""
    low = np.floor(places - 0.5).astype(int)
    (x, y), (a, b) = low.T, (places - 0.5 - low).T
    above = (1 - a) * image[y, x] + a * image[y, x + 1]
    return (1 - b) * above + b * ((1 - a) * image[y + 1, x] + a * image[y + 1, x + 1])


@pytest.mark.parametrize(
    ("offset", "target"),
    [
        ((0.0, 1.5, 0.0), (0.0, 6.0, 0.0)),
        ((0.4, 1.5, 0.0), (0.0, 6.0, 0.0)),
        ((0.0, 0.0, 0.0), (0.0, 6.0, 0.0)),
        ((0.0, 12.0, 0.0), (0.0, 6.0, 0.0)),
    ],
)
def test_motion_towards_the_scene_is_refused(
    offset: tuple[float, float, float], target: tuple[float, float, float]
) -> None:
    """Straight ahead, nearly so, no motion at all, and two cameras face to face: nothing to rectify."""
    source = look_at(np.array(offset), np.array(target))
    assert rectify(CAMERA, pose_at((0.0, 0.0, 0.0)), source, 4.0, 9.0) is None
