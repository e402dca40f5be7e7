"""Depth of planes in closed form, what bland images give, and plain twins of the compiled loops."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from recon.dense import depth_sgm
from recon.dense.depth_sgm import PosedImage, consensus_depth, depth_of_disparity, match, measure_depth, textured
from recon.dense.rectify import rectify
from tests.recon.wavy_plane import WavyPlane
from usd_schemas.pinhole import Pinhole, look_at

F64 = NDArray[np.float64]
CAMERA = Pinhole(160, 120, 150.0, 150.0, 80.0, 60.0)
SLANTED = WavyPlane(np.array([0.6, -0.8, 0.0]), -4.0)  # about 5 m ahead, turned by 37 degrees
EYES = ((0.0, 0.0, 0.0), (0.5, 0.0, 0.05), (-0.5, 0.0, -0.05), (0.05, 0.0, 0.5))


def see(plane: WavyPlane) -> list[PosedImage]:
    """Photograph a plane from four places."""
    poses = [look_at(np.array(eye), np.array([0.2 * eye[0], 5.0, 0.0])) for eye in EYES]
    return [PosedImage(plane.gray(CAMERA, pose), pose) for pose in poses]


@pytest.fixture(scope="module")
def views() -> list[PosedImage]:
    """Photograph the slanted plane."""
    return see(SLANTED)


def measured(views: list[PosedImage], camera: Pinhole = CAMERA) -> NDArray[np.float32]:
    """Measure the first view's depth with the others."""
    everywhere = np.ones((CAMERA.height, CAMERA.width), bool)
    return measure_depth(views[0], views[1:], camera, everywhere, (2.5, 15.0), 0.01)


def test_a_slanted_plane_has_its_depth(views: list[PosedImage]) -> None:
    """Nearly every pixel, a tenth of a pixel's disparity; half a pixel of shift would show."""
    true = SLANTED.depth(CAMERA, views[0].pose)
    depth = measured(views)
    known = depth > 0
    assert known[8:-8, 12:-12].mean() > 0.9
    error = depth[known] / true[known] - 1.0
    a_pixel = np.median(true) / (CAMERA.fx * 0.5)  # of disparity, as a share of the depth
    assert np.median(np.abs(error)) < 0.12 * a_pixel
    limit = 0.03 * a_pixel  # OpenCV rounds a disparity's sixteenths one way
    assert abs(np.median(error)) < limit
    biases = []
    for half in (-0.5, 0.5):
        camera = Pinhole(CAMERA.width, CAMERA.height, CAMERA.fx, CAMERA.fy, CAMERA.cx + half, CAMERA.cy)
        moved = SLANTED.depth(camera, views[0].pose)
        biases.append(abs(np.median(depth[known] / moved[known] - 1.0)))
    assert max(biases) > 1.5 * limit


def test_beside_a_motion_forwards_depth_is_measured() -> None:
    """The way ahead shows no parallax, but most of the rest of the picture has its depth."""
    poses = [look_at(np.array(eye), np.array([eye[0], 9.0, 0.0])) for eye in ((0.0, 0.0, 0.0), (0.4, 0.5, 0.0))]
    plane = WavyPlane(np.array([0.0, -1.0, 0.0]), -4.0)
    pictures = [PosedImage(plane.gray(CAMERA, pose), pose) for pose in poses]
    depth, true = measured(pictures), plane.depth(CAMERA, poses[0])
    known = depth > 0
    assert known[20:-20, 40:80].mean() > 0.9
    assert not known[:, -40:].any()
    assert np.median(np.abs(depth[known] / true[known] - 1.0)) < 0.003


def test_exact_disparities_are_exact_depths(views: list[PosedImage]) -> None:
    """Disparities of the plane in closed form come back as its depth, up to their sixteenths of a pixel."""
    reference, source = views[0].pose, views[3].pose  # one above the other: the rows run upright
    pair = rectify(CAMERA, reference, source, 2.5, 15.0)
    assert pair is not None
    width, height = pair.size
    column, row = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    rays = (
        np.stack(
            [
                (column - pair.left_center[0]) / pair.focal,
                (row - pair.left_center[1]) / pair.focal,
                np.ones_like(column),
            ],
            axis=-1,
        )
        @ pair.left
        @ reference[:3, :3].T
    )
    common = (SLANTED.offset - SLANTED.normal @ reference[:3, 3]) / (rays @ SLANTED.normal)
    disparity = pair.focal * pair.baseline / common - pair.infinity
    sixteenths = np.where((common > 0) & (disparity >= 0), np.round(16 * disparity), -16).astype(np.int16)
    lens = np.array([CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy])
    plane = np.array([pair.focal, *pair.left_center, pair.focal * pair.baseline, pair.infinity])
    everywhere = np.ones((CAMERA.height, CAMERA.width), bool)
    depth = depth_of_disparity(sixteenths, pair.left, plane, np.linalg.inv(source) @ reference, lens, everywhere)
    true = SLANTED.depth(CAMERA, reference)
    known = depth > 0
    assert known.mean() > 0.7
    step = true**2 / (pair.focal * pair.baseline) / 16  # [m] that a sixteenth of a pixel is worth
    assert (np.abs(depth - true)[known] < step[known]).mean() > 0.99
    everywhere[:, :80] = False
    assert not depth_of_disparity(sixteenths, pair.left, plane, np.linalg.inv(source) @ reference, lens, everywhere)[
        :, :80
    ].any()


def test_the_sky_beside_a_plane_stays_empty() -> None:
    """A plane before an even sky: nothing grows over its silhouette by more than a pixel."""
    board = WavyPlane(np.array([0.0, -1.0, 0.0]), -5.0, seed=4, reach=1.2)
    views = see(board)
    rng = np.random.default_rng(0)
    noisy = [
        PosedImage(np.clip(view.gray + rng.normal(0, 0.5, view.gray.shape), 0, 255).astype(np.uint8), view.pose)
        for view in views
    ]
    depth, there = measured(noisy), np.isfinite(board.depth(CAMERA, views[0].pose))
    near_board = cv2.dilate(there.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    assert not (depth[~near_board] > 0).any()
    inner = cv2.erode(there.astype(np.uint8), np.ones((9, 9), np.uint8)) > 0
    assert (depth[inner] > 0).mean() > 0.85


def test_bland_images_have_no_depth(views: list[PosedImage]) -> None:
    """A bare wall with a sensor's noise: not one pixel; and the mask is about gray values alone."""
    rng = np.random.default_rng(1)
    bare = [
        PosedImage(np.clip(rng.normal(128, 0.4, view.gray.shape), 0, 255).astype(np.uint8), view.pose) for view in views
    ]
    assert not measured(bare).any()
    assert textured(views[0].gray).mean() > 0.95


def test_strips_give_what_the_whole_gives(views: list[PosedImage], monkeypatch: pytest.MonkeyPatch) -> None:
    """An image that is matched in strips to save memory has nearly the same disparities."""
    pair = rectify(CAMERA, views[0].pose, views[3].pose, 2.5, 15.0)
    assert pair is not None
    whole = match(views[0].gray, views[3].gray, pair, CAMERA)
    monkeypatch.setattr(depth_sgm, "_CUBE", 1)
    parts = match(views[0].gray, views[3].gray, pair, CAMERA)
    assert whole.shape[0] > 128  # or there would be one strip
    assert (np.abs(whole.astype(int) - parts) <= 2).mean() > 0.97


def test_agreement_has_a_plain_twin() -> None:
    """The depth that most sources share, their weighted mean; a lone one stays, contradicted ones go."""
    rng = np.random.default_rng(5)
    depths = (5.0 + rng.integers(0, 4, (4, 12, 15)) * 0.2 + rng.normal(0, 0.01, (4, 12, 15))).astype(np.float32)
    depths[rng.random(depths.shape) < 0.5] = 0.0
    weights = np.array([1.0, 3.0, 2.0, 0.5])
    found = consensus_depth(depths, weights, 0.01, 2)
    for i, j in np.ndindex(12, 15):
        column = depths[:, i, j].astype(float)
        known = np.flatnonzero(column)
        groups = [[q for q in known if abs(column[q] - column[p]) <= 0.01 * column[p]] for p in known]
        best = max(groups, key=lambda group: (len(group), weights[group].sum()), default=[])
        expected = 0.0
        if len(best) >= 2 or len(known) == 1:
            expected = float(weights[best] @ column[best] / weights[best].sum())
        assert found[i, j] == pytest.approx(expected, rel=1e-6)
    assert (found > 0).any()
    assert (found == 0).any()
