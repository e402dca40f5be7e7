"""Long thin triangles keep every digit of their depth, in whole images and in bands of them."""

import numpy as np
import pytest
from numpy.typing import NDArray

from groundwork.progress import SILENT
from render.gpu.context import Gl
from render.gpu.facets import find_facets
from render.settings import RenderSettings
from render.views.passes import Painter
from render.views.prepare import prepare
from tests.render.scenes import SceneBuilder, placed
from usd_schemas.flat_scene import FlatScene
from usd_schemas.pinhole import Pinhole, look_at

F64 = NDArray[np.float64]

CAMERA = Pinhole(480, 360, 320.0, 320.0, 240.0, 180.0)
NEAR = 0.1
AT = np.array([5.0e5, 4.6e6, 120.0])
HEIGHTS = (0.0, 0.16, 0.4, 0.9, 1.05)  # [m] of five rails, each 240 m long and as wide as a hand
STRIP = np.array([[[-9.0, -0.05, 0], [231, -0.05, 0], [231, 0.05, 0]], [[-9, -0.05, 0], [231, 0.05, 0], [-9, 0.05, 0]]])


def rails() -> tuple[FlatScene, F64]:
    """Lay rails side by side on their heights, and look along them from above."""
    builder = SceneBuilder()
    for row, height in enumerate(HEIGHTS):
        place = AT + np.array([0.0, 0.5 * row - 1.0, height])
        builder.add_mesh(STRIP, placed((place[0], place[1], place[2]), turn=0.01 * row), row + 1)
    pose = look_at(AT + np.array([-2.0, -0.3, 1.6]), AT + np.array([14.0, 0.4, 0.0]))
    return builder.build(pose[None], CAMERA), pose


def true_depth(pose: F64, draw: NDArray[np.uint32]) -> F64:
    """Depth at which the ray of each pixel meets the horizontal plane of the rail that is seen there [m]."""
    rows, columns = np.nonzero(draw)
    rays = np.stack([(columns + 0.5 - CAMERA.cx) / CAMERA.fx, (rows + 0.5 - CAMERA.cy) / CAMERA.fy, np.ones(len(rows))])
    height = AT[2] + np.array(HEIGHTS)[draw[rows, columns].astype(int) - 1]
    return (height - pose[2, 3]) / (pose[2, :3] @ rays)


@pytest.mark.parametrize("quality", ["fast", "standard", "fine"])
def test_depth_of_rails_is_that_of_their_planes(gl: Gl, small: RenderSettings, quality: str) -> None:
    """Every pixel of five rails, to a part in two millions; the rasterizer loses more than a hundred-thousandth."""
    scene, pose = rails()
    painter = prepare(gl, scene, small.model_copy(update={"quality": quality}), SILENT).painter(CAMERA, sharp=True)
    view = painter.draw(pose, NEAR)
    assert set(np.unique(view.draw)) == {0, 1, 2, 3, 4, 5}
    seen = view.draw > 0
    expected = true_depth(pose, view.draw)
    assert np.max(np.abs(view.depth[seen] / expected - 1)) < 5e-7
    assert np.all(np.isposinf(view.depth[~seen]))
    bands = [(0, 100), (100, 181), (181, 360)]
    banded = painter.draw_bands(np.repeat(pose[None], 3, axis=0), bands, NEAR)
    np.testing.assert_array_equal(banded.depth, view.depth)
    np.testing.assert_array_equal(painter.draw_window(pose, (150, 222), NEAR).depth, view.depth[150:222])


def test_it_is_the_planes_that_keep_the_digits(gl: Gl, small: RenderSettings, monkeypatch: pytest.MonkeyPatch) -> None:
    """The rasterizer alone is twenty times worse, and agrees on what is seen where."""
    scene, pose = rails()
    painter = prepare(gl, scene, small, SILENT).painter(CAMERA, sharp=True)
    exact = painter.draw(pose, NEAR)
    monkeypatch.setattr(Painter, "_draw_facets", lambda *_: None)
    raw = painter.draw(pose, NEAR)
    for name in ("code", "draw", "normal"):
        np.testing.assert_array_equal(getattr(raw, name), getattr(exact, name))
    seen = raw.draw > 0
    expected = true_depth(pose, raw.draw)
    lost, left = (np.max(np.abs(view.depth[seen] / expected - 1)) for view in (raw, exact))
    assert lost > max(5e-6, 20 * left)


def test_facets_near_a_flight_are_all_that_its_cameras_find() -> None:
    """From each camera, and from where one strays to, the same corners in the same order; from far away, none."""
    scene, pose = rails()
    facets, rng = find_facets(scene, np.zeros(3)), np.random.default_rng(3)
    everything, origins = np.ones(len(scene.draws.part), bool), scene.draws.transform[:, :3, 3]
    poses = np.repeat(pose[None], 20, axis=0)
    poses[:, :3, 3] += rng.normal(0.0, 0.8, (20, 3))
    strayed = poses.copy()
    strayed[:, :3, 3] += rng.normal(0.0, 0.02, (20, 3))
    stray = float(np.linalg.norm(strayed - poses, axis=1).max())
    near = facets.near(poses[:, :3, 3], 1.001 * stray)
    found = 0
    for eye in (*poses, *strayed):
        view = (everything, CAMERA, (0, CAMERA.height), eye, NEAR, origins)
        expected = facets.seen(*view)
        np.testing.assert_array_equal(near.seen(*view), expected)
        found += len(expected)
    assert found > 100
    assert not len(facets.near(poses[:, :3, 3] + [0.0, 0.0, 1e5], stray).draw)


def test_facets_are_those_that_are_slender_in_the_world() -> None:
    """A unit cube stretched to a rail counts, each of its long sides; the cube, and what has no area, does not."""
    builder = SceneBuilder()
    builder.add_box(placed((0.0, 0.0, 0.0)), 1)
    builder.add_box(placed((0.0, 5.0, 0.0), (-240.0, 0.07, 0.15), 0.3), 2)
    flat, thin = [[0.0, 0, 0], [50, 0, 0], [99, 0, 0]], [[0.0, 0, 0], [9, 0, 0], [9, 0.1, 0]]
    with np.errstate(invalid="ignore"):  # what has no area has no normal
        builder.add_mesh(np.array([flat, thin]), np.eye(4), 3)
    facets = find_facets(builder.build(np.eye(4)[None]), np.array([1.0, 2.0, 3.0]))
    assert facets.draw.tolist() == [1] * 8 + [2]
    world = facets.corners + facets.anchor
    np.testing.assert_allclose(world[-1], [[0, 0, 0], [9, 0, 0], [9, 0.1, 0]], atol=1e-7)
    sides = np.linalg.norm(world - np.roll(world, 1, axis=1), axis=2)
    area = np.linalg.norm(np.cross(world[:, 1] - world[:, 0], world[:, 2] - world[:, 0]), axis=1) / 2
    np.testing.assert_allclose(facets.slenderness, sides.max(axis=1) ** 3 / (2 * area), rtol=1e-6)
    for corner in range(3):
        reach = np.einsum("an,na->n", facets.normals, facets.corners[:, corner])
        np.testing.assert_allclose(reach, facets.heights, atol=1e-5)


def edge_on(rng: np.random.Generator, count: int) -> F64:
    """Draw triangles in planes through the camera at the origin, 60 to 300 m in front of it, shape (count, 3, 3)."""
    middle = np.stack([rng.integers(10, 470, count), rng.integers(10, 350, count)], axis=1) + 0.5
    turn = rng.uniform(0.0, np.pi, count)
    along, beside = np.stack([np.cos(turn), np.sin(turn)], axis=1), 10.0 ** rng.uniform(-4.5, -2.5, (3, count, 1))
    place = middle + along * rng.uniform(-30.0, 30.0, (3, count, 1)) + beside * rng.normal(size=(3, count, 2))
    right, down = np.moveaxis((place - [CAMERA.cx, CAMERA.cy]) / CAMERA.fx, -1, 0)
    rays = np.stack([np.ones_like(right), -right, -down], axis=-1)
    return np.swapaxes(rays * rng.uniform(60.0, 300.0, (3, count, 1)), 0, 1)


@pytest.mark.parametrize("quality", ["fast", "standard", "fine"])
def test_where_a_triangle_has_no_depth_the_wall_before_it_is_seen(
    gl: Gl, small: RenderSettings, quality: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Seen edge-on it would lie before everything with a depth that is no number; no other pixel changes."""
    builder, pose = SceneBuilder(), look_at(np.zeros(3), np.array([1.0, 0.0, 0.0]))
    wall = np.array([[[50.0, -60, -60], [50, 60, -60], [50, 60, 60]], [[50, -60, -60], [50, 60, 60], [50, -60, 60]]])
    builder.add_mesh(wall, np.eye(4), 1)
    builder.add_mesh(edge_on(np.random.default_rng(0), 30_000), np.eye(4), 2)
    scene = builder.build(pose[None], CAMERA)
    painter = prepare(gl, scene, small.model_copy(update={"quality": quality}), SILENT).painter(CAMERA, sharp=True)
    view, lower = painter.draw(pose, NEAR), painter.draw_window(pose, (100, 300), NEAR)
    monkeypatch.setattr(Painter, "_mended", lambda _, raw, *__: raw)
    raw = painter.draw(pose, NEAR)
    wrong = ~(raw.depth > 0.0)
    assert wrong.sum() >= 3
    assert np.all(view.draw[wrong] == 1)
    np.testing.assert_allclose(view.depth[wrong], 50.0, rtol=1e-6)
    for name in ("draw", "depth"):
        np.testing.assert_array_equal(getattr(view, name)[~wrong], getattr(raw, name)[~wrong])
        np.testing.assert_array_equal(getattr(lower, name), getattr(view, name)[100:300])
