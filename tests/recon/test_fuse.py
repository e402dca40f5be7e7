"""Fusion against its plain twin, and what becomes of planes, floating points and narrow angles."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from recon.dense.dense_child import DepthMaps
from recon.dense.fuse import DepthView, fuse_view
from recon.dense.pixel_fates import PIXEL_FATES
from recon.dense.smooth import smooth
from recon.dense.undistort import working_camera
from tests.recon.test_undistort import model_with
from tests.recon.wavy_plane import WavyPlane
from usd_schemas.pinhole import Pinhole, look_at, project, unproject

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]
CAMERA = Pinhole(48, 36, 60.0, 62.0, 24.5, 17.5)
LENS = np.array([60.0, 62.0, 24.5, 17.5])
PLANE = WavyPlane(np.array([0.4, -np.sqrt(0.84), 0.0]), -4.0)
POSES = [
    look_at(np.array([x, 0.0, z]), np.array([0.3 * x, 5.0, 0.0]))
    for x, z in ((0.0, 0.0), (0.7, 0.1), (-0.6, 0.0), (0.1, 0.6))
]


def view_of(image: int, depth: F64) -> DepthView:
    """Make a view with the plane's normal and a color of its own."""
    near = np.where(np.isfinite(depth), depth, 0.0).astype(np.float32)
    normal = np.tile((POSES[image][:3, :3].T @ PLANE.normal).astype(np.float32), (*depth.shape, 1))
    color = np.full((*depth.shape, 3), 10 * image, np.uint8)
    return DepthView(
        image, near, normal, color, np.zeros(depth.shape, bool), POSES[image], np.zeros(depth.shape, np.uint8)
    )


def planes(noise: float = 0.0, seed: int = 0) -> list[DepthView]:
    """See the plane from four places, its depths disturbed by a share."""
    rng = np.random.default_rng(seed)
    return [
        view_of(i, PLANE.depth(CAMERA, pose) * (1 + noise * rng.normal(size=(36, 48)))) for i, pose in enumerate(POSES)
    ]


def twin(
    views: list[DepthView], min_views: int, tolerance: float, min_angle: float
) -> tuple[list[tuple[F64, list[int]]], list[U8]]:
    """Fuse the first view with the others, one pixel at a time, in world coordinates; tell the fates of all pixels."""
    reference, others = views[0], views[1:]
    names = [np.full(view.depth.shape, "no_depth", object) for view in views]
    found = []
    for i, j in np.ndindex(reference.depth.shape):
        z = float(reference.depth[i, j])
        if z <= 0.0 or reference.used[i, j]:
            continue
        point = unproject(np.array([[j + 0.5, i + 0.5]]), np.array([z]), CAMERA, reference.pose)[0]
        parts, weights, agreeing, through = [point], [1 / z**2], [reference], 0
        pixels = [(0, i, j)]
        for number, other in enumerate(others, 1):
            pixel, depth = project(point[None], CAMERA, other.pose)
            (s, t), expected = pixel[0], float(depth[0])
            if expected <= 0.0 or not (0 <= s < CAMERA.width and 0 <= t < CAMERA.height):
                continue
            there = depth_between(other.depth, s, t)
            if there > 0.0 and abs(there - expected) <= tolerance * expected:
                parts.append(unproject(pixel, np.array([there]), CAMERA, other.pose)[0])
                weights.append(1 / there**2)
                agreeing.append(other)
                pixels.append((number, int(t), int(s)))
            elif there > 1.02 * expected:
                through += 1
        if len(agreeing) < min_views:
            names[0][i, j] = "views"
            continue
        if 2 * through >= len(agreeing):
            names[0][i, j] = "seen_through"
            continue
        mean = np.average(parts, axis=0, weights=weights)
        rays = [(mean - view.pose[:3, 3]) / np.linalg.norm(mean - view.pose[:3, 3]) for view in agreeing]
        if max(np.degrees(np.arccos(np.clip(a @ b, -1, 1))) for a in rays for b in rays) < min_angle:
            names[0][i, j] = "angle"
            continue
        images = sorted(view.image for view in agreeing if is_inside(mean, view.pose))
        if len(images) >= min_views:
            found.append((mean, images))
        for number, row, column in pixels:
            if len(images) >= min_views or names[number][row, column] != "in_points":
                names[number][row, column] = "in_points" if len(images) >= min_views else "views"
    return found, [np.vectorize(PIXEL_FATES.index, otypes=[np.uint8])(name) for name in names]


def is_inside(point: F64, pose: F64) -> bool:
    """Tell whether a camera sees a point, by its frame alone."""
    (pixel,), _ = project(point[None], CAMERA, pose)
    return bool(0 <= pixel[0] < CAMERA.width and 0 <= pixel[1] < CAMERA.height)


def depth_between(depth: NDArray[np.float32], s: float, t: float) -> float:
    """Read a depth between pixel centers by its inverse, or the nearest one where surfaces change."""
    x, y = int(np.floor(s - 0.5)), int(np.floor(t - 0.5))
    if min(x, y) >= 0 and x + 1 < depth.shape[1] and y + 1 < depth.shape[0]:
        around = depth[y : y + 2, x : x + 2].astype(float)
        if around.min() > 0 and around.max() - around.min() <= 0.05 * around.min():
            a, b = s - 0.5 - x, t - 0.5 - y
            return float(1 / (np.array([1 - b, b]) @ (1 / around) @ np.array([1 - a, a])))
    return float(depth[int(t), int(s)])


@pytest.mark.parametrize(
    ("min_views", "tolerance", "min_angle", "happens"),
    [(2, 0.01, 7.0, {0, 1, 2, 3, 4}), (3, 0.01, 10.0, {0, 1, 3, 4})],
)
def test_fusion_has_a_plain_twin(min_views: int, tolerance: float, min_angle: float, happens: set[int]) -> None:
    """The compiled loops give the points, their views and the fate of every pixel that a slow loop gives."""
    views = planes(noise=0.8 * tolerance, seed=min_views)
    rng = np.random.default_rng(7)
    for view in views:
        view.depth[rng.random(view.depth.shape) < 0.1] = 0.0
        view.depth[rng.random(view.depth.shape) < 0.1] *= 0.8
        view.used[:] = rng.random(view.used.shape) < 0.1
    expected, fates = twin(views, min_views, tolerance, min_angle)
    assert set(np.unique(fates[0]).tolist()) == happens
    fused = fuse_view(views[0], views[1:], LENS, min_views, tolerance, min_angle)
    for view, fate in zip(views, fates, strict=True):
        np.testing.assert_array_equal(view.fate, fate)
    assert len(fused.points) == len(expected) > 100
    np.testing.assert_allclose(fused.points, [point for point, _ in expected], atol=1e-9)
    split = np.split(fused.image, np.cumsum(fused.counts)[:-1])
    assert [part.tolist() for part in split] == [images for _, images in expected]


@pytest.mark.parametrize(("back", "stays"), [(0.0, False), (1.25, True)])
def test_what_is_given_up_at_a_rim_is_no_point(back: float, stays: bool) -> None:
    """Pixels that only make a point beyond a rim count as seen by too few; one that is part of a point stays so."""
    reference, other = view_of(0, np.full((36, 48), 5.0)), view_of(1, np.full((36, 48), 5.0 + back))
    sideways = (47.995 - 24.5 - 23.0 * 5.0 / (5.0 + back)) * (5.0 + back) / 60.0  # takes the last column to 0.005 px
    pose = np.eye(4)
    pose[:3, 3] = [-sideways, 0.0, -back]
    views = [replace(reference, pose=np.eye(4)), replace(other, pose=pose)]
    fused = fuse_view(views[0], views[1:], LENS, 2, 0.01, 0.1)
    assert len(fused.points) == 47 * 36
    names = np.array(PIXEL_FATES)
    assert set(names[views[0].fate[:, :47]].flat) == {"in_points"}
    assert set(names[views[0].fate[:, 47]]) == {"views"}
    asked = views[1].used[:, 47]
    assert asked.any()
    assert set(names[views[1].fate[asked, 47]]) == {"in_points" if stays else "views"}


def test_a_plane_comes_back() -> None:
    """Points on the plane, its normal, observations where the cameras see them, each pixel used once."""
    views = planes()
    fused = fuse_view(views[0], views[1:], LENS, 3, 0.01, 1.0)
    assert len(fused.points) > 0.5 * views[0].depth.size
    away = np.abs(fused.points @ PLANE.normal - PLANE.offset)
    assert (away < 2e-5).mean() > 0.9
    assert away.max() < 0.02  # at an image's rim the nearest pixel must do
    np.testing.assert_allclose(fused.normals @ PLANE.normal, 1.0, atol=1e-5)
    point = np.repeat(np.arange(len(fused.counts)), fused.counts)
    for image, pose in enumerate(POSES):
        mine = fused.image == image
        pixels, _ = project(fused.points[point[mine]], CAMERA, pose)
        np.testing.assert_allclose(fused.uv[mine], pixels, atol=1e-4)
    assert (np.diff(fused.image.astype(int))[np.diff(point) == 0] > 0).all()
    means = np.array([part.mean() * 10 for part in np.split(fused.image, np.cumsum(fused.counts)[:-1])])
    np.testing.assert_allclose(fused.colors[:, 0], means, atol=0.51)
    before = views[1].used.copy()
    assert before.mean() > 0.3
    again = fuse_view(views[1], [views[0], *views[2:]], LENS, 3, 0.01, 1.0)
    own = again.uv[again.image == 1]
    assert not before[own[:, 1].astype(int), own[:, 0].astype(int)].any()


def test_what_others_see_through_goes() -> None:
    """A patch that floats before the plane in two maps goes when as many views see the plane behind it."""
    views = planes()
    for view in views[:2]:
        patch = WavyPlane(PLANE.normal, PLANE.offset + 0.8, reach=np.inf).depth(CAMERA, view.pose)
        view.depth[12:20, 18:28] = patch[12:20, 18:28]
    fused = fuse_view(views[0], views[1:], LENS, 2, 0.01, 1.0)
    assert len(fused.points) > 100
    assert np.abs(fused.points @ PLANE.normal - PLANE.offset).max() < 0.1


def test_a_narrow_angle_makes_no_point() -> None:
    """Rays that are nearly parallel fix no depth."""
    views = planes()
    widest = fuse_view(views[0], views[1:2], LENS, 2, 0.01, 1.0)
    assert len(widest.points) > 100
    assert not len(fuse_view(planes()[0], planes()[1:2], LENS, 2, 0.01, 12.0).points)


def test_smoothing_keeps_planes_and_cuts_edges() -> None:
    """A plane keeps its depth and gets its normal; noise shrinks; the rim of a step is dropped on its near side."""
    true = PLANE.depth(CAMERA, POSES[0])
    depth, normal = smooth(true.astype(np.float32), LENS)
    np.testing.assert_allclose(depth, true, rtol=2e-6)
    np.testing.assert_allclose(normal @ (POSES[0][:3, :3].T @ PLANE.normal), 1.0, atol=1e-4)
    rng = np.random.default_rng(2)
    noisy = true * (1 + 0.004 * rng.normal(size=true.shape))
    steady, _ = smooth(noisy.astype(np.float32), LENS)
    inner = (slice(3, -3), slice(3, -3))
    assert np.std((steady / true)[inner] - 1) < 0.4 * np.std((noisy / true)[inner] - 1)
    step = np.full((36, 48), 5.0, np.float32)
    step[:, 16:] = 8.0
    cut, _ = smooth(step, LENS)
    assert (cut[:, 14:16] == 0).all()
    np.testing.assert_allclose(cut[:, :14], 5.0, rtol=1e-6)
    np.testing.assert_allclose(cut[:, 16:], 8.0, rtol=1e-6)


def test_thin_members_stay() -> None:
    """Of a bar two pixels wide before a wall both stay, of one three wide the middle does."""
    for wide, kept in ((2, [20, 21]), (3, [21])):
        for upright in (True, False):
            wall = np.full((36, 48), 8.0, np.float32)
            bar = wall if upright else wall.T
            bar[:, 20 : 20 + wide] = 5.0
            steady, _ = smooth(wall, LENS)
            seen = (steady if upright else steady.T) == 5.0
            assert np.flatnonzero(seen[10]).tolist() == kept


def test_views_of_small_images_keep_few_files_open(tmp_path: Path) -> None:
    """Thousands of small maps fit into the memory, but a process has no thousand files."""
    model = replace(model_with((8.0, 4.0, 4.0, 0.0)), names=("a",) * 400, poses=np.tile(np.eye(4), (400, 1, 1)))
    maps = DepthMaps(tmp_path, model, working_camera(model, (8, 8), 1))
    height, width = maps.marks(0)[0].shape
    before = len(list(Path("/proc/self/fd").iterdir()))
    for row in range(400):
        maps.put_image(row, np.zeros((height, width, 3), np.uint8))
        maps.put_depth(row, np.zeros((height, width), np.float32))
        maps.depth_view(row)
    assert len(list(Path("/proc/self/fd").iterdir())) - before < 300
