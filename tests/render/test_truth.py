"""Depth, ids and normals against a ray caster on the same triangles, and a corner against its projection."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import linprog

from groundwork.progress import SILENT
from render.gpu.context import Gl
from render.settings import RenderSettings
from render.views.prepare import prepare
from render.views.targets import View
from tests.render.scenes import CAMERA, SceneBuilder, placed, random_scene
from usd_schemas.flat_scene import FlatScene, world_triangles
from usd_schemas.pinhole import Pinhole, look_at, project
from usd_schemas.raycast import RayScene

F64 = NDArray[np.float64]

NEAR = 0.05


def draw_views(gl: Gl, scene: FlatScene, settings: RenderSettings, camera: Pinhole = CAMERA) -> list[View]:
    """Draw every pose of the scene's first camera."""
    painter = prepare(gl, scene, settings, SILENT).painter(camera, sharp=True)
    return [painter.draw(pose, NEAR) for pose in scene.cameras[0].poses]


def cast_rays(scene: FlatScene, pose: F64, camera: Pinhole = CAMERA) -> tuple[F64, NDArray[np.uint32], F64]:
    """Cast a ray through every pixel center: planar depth, id, geometric normal facing the camera."""
    corners, ids, _ = world_triangles(scene)
    v, u = np.mgrid[0 : camera.height, 0 : camera.width] + 0.5
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones_like(u)], axis=-1)
    rays = rays.reshape(-1, 3) @ pose[:3, :3].T
    depth, triangle, found = RayScene(corners, ids).cast(np.broadcast_to(pose[:3, 3], rays.shape), rays)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal = normal[triangle] / np.linalg.norm(normal[triangle], axis=1, keepdims=True)
    normal *= -np.sign(np.einsum("ij,ij->i", normal, rays))[:, None]
    shape = (camera.height, camera.width)
    return depth.reshape(shape), found.reshape(shape), normal.reshape(*shape, 3)


def inner(ids: NDArray[np.uint32], depth: F64) -> NDArray[np.bool_]:
    """Mark pixels whose eight neighbors show the same part without a step in depth."""
    result = np.zeros(ids.shape, bool)
    result[1:-1, 1:-1] = True
    middle = np.where(np.isfinite(depth), depth, 1e12)
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            result &= np.roll(ids, (dy, dx), (0, 1)) == ids
            result &= np.abs(np.roll(middle, (dy, dx), (0, 1)) - middle) < 0.2 * middle
    return result


OFFSETS = {
    "origin": (np.zeros(3), 1.0),
    "utm": (np.array([5.0e5, 4.6e6, 120.0]), 1.0),
    "far": (np.array([0.0, 0.0, 50.0]), 200.0),
    "tiny": (np.array([5.0e5, 4.6e6, 0.0]), 0.03),
}


@pytest.mark.parametrize("place", OFFSETS)
@pytest.mark.parametrize("quality", ["fast", "standard", "fine"])
def test_depth_and_ids_equal_the_ray_caster(gl: Gl, small: RenderSettings, place: str, quality: str) -> None:
    """Forty boxes, half of them mirrored, from 15 cm to 3 km away, at the origin and at UTM coordinates."""
    offset, scale = OFFSETS[place]
    scene = random_scene(11, offset, scale)
    ids = np.concatenate([[0], scene.draws.instance])
    settings = small.model_copy(update={"quality": quality})
    for view, pose in zip(draw_views(gl, scene, settings), scene.cameras[0].poses, strict=True):
        depth, expected, normal = cast_rays(scene, pose)
        away = inner(expected, depth)
        assert away.mean() > 0.7
        equal = ids[view.draw] == expected
        assert equal[away].mean() > 0.999
        assert equal.mean() > 0.995
        sure = away & equal & (expected > 0)
        error = np.abs(view.depth[sure] - depth[sure])
        assert np.mean(error <= 1e-3 + 1e-4 * depth[sure]) > 0.999
        assert np.median(error / depth[sure]) < 5e-7
        assert np.all(np.isposinf(view.depth[view.draw == 0]))
        assert view.normal is not None
        assert np.quantile(np.linalg.norm(view.normal - normal, axis=-1)[sure], 0.999) < 2e-3


def edge_line(inner: NDArray[np.floating], outer: NDArray[np.floating]) -> tuple[float, float]:
    """Fit the line x = a + b * y between points (x, y) inside a shape and points outside, each of shape (N, 2).

    A digital straight edge bounds the true line from both sides; the middle of the lines that keep all bounds is found
    by linear programming.
    """
    ones = np.ones(len(inner))
    scale = float(np.abs(outer - inner).max())
    bounds = np.concatenate(
        [np.column_stack([-ones, -inner[:, 1], scale * ones]), np.column_stack([ones, outer[:, 1], scale * ones])]
    )
    limits = np.concatenate([-inner[:, 0], outer[:, 0]])
    found = linprog([0, 0, -1], bounds, limits, bounds=[(None, None)] * 3)
    assert found.x[2] > 0, "the edge is not straight"
    return float(found.x[0]), float(found.x[1])


def row_edge(inside: NDArray[np.bool_]) -> tuple[float, float]:
    """Fit the line between the last pixel inside and the next one of each row [px]."""
    rows = np.flatnonzero(inside.any(axis=1) & ~inside.all(axis=1))
    last = inside.shape[1] - 1 - np.argmax(inside[rows, ::-1], axis=1)
    return edge_line(np.column_stack([last + 0.5, rows + 0.5]), np.column_stack([last + 1.5, rows + 0.5]))


def rendered_corner(draw: NDArray[np.uint32], corner: F64) -> F64:
    """Find the corner of the only shape, near a first guess, to a hundredth of a pixel."""
    inside = draw > 0
    u, v = int(corner[0]), int(corner[1])
    a, b = row_edge(inside[: v - 4])
    c, d = row_edge(inside.T[: u - 4])
    return np.array([(a + b * c) / (1 - b * d), (c + d * a) / (1 - b * d)])


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (5.0e5, 4.6e6, 30.0)])
def test_a_corner_lands_where_it_is_projected(
    gl: Gl, small: RenderSettings, offset: tuple[float, float, float]
) -> None:
    """The lower right corner of a plate within 0.01 px; half a pixel off is seen as half a pixel."""
    camera = Pinhole(1280, 960, 900.0, 910.0, 655.3, 470.7)
    builder = SceneBuilder()
    plate = np.array([[[-9.0, 0, 7], [-9, 0, -1.31], [1.87, 0, -1.52]], [[-9, 0, 7], [1.87, 0, -1.52], [1.71, 0, 7]]])
    builder.add_mesh(plate, placed(offset), 7)
    pose = look_at(np.array([0.4, -6.0, 0.3]) + offset, np.array([0.1, 0.0, 0.2]) + offset)
    scene = builder.build(pose[None], camera)
    expected, _ = project(np.array([[1.87, 0, -1.52]]) + offset, camera, pose)
    settings = small.model_copy(update={"quality": "fast"})
    found = rendered_corner(draw_views(gl, scene, settings, camera)[0].draw, expected[0])
    np.testing.assert_allclose(found, expected[0], atol=0.01)
    shifted = Pinhole(1280, 960, 900.0, 910.0, 655.8, 471.2)
    moved = rendered_corner(draw_views(gl, scene, settings, shifted)[0].draw, expected[0])
    np.testing.assert_allclose(moved - expected[0], [0.5, 0.5], atol=0.01)


def test_a_plate_before_the_camera_is_cut_at_the_near_plane(gl: Gl, small: RenderSettings) -> None:
    """Geometry that passes through the camera hides nothing behind it."""
    builder = SceneBuilder()
    builder.add_box(placed((5.0, 0.0, 0.0)), 1)
    builder.add_box(placed((0.0, 0.0, 0.0), (0.08, 0.08, 0.08)), 2)
    scene = builder.build(look_at(np.zeros(3), np.array([5.0, 0, 0]))[None])
    view = draw_views(gl, scene, small)[0]
    assert view.draw[60, 80] == 1
    assert view.depth[60, 80] == pytest.approx(4.5, rel=1e-6)
    assert 2 not in view.draw


@pytest.mark.parametrize("quality", ["fast", "standard", "fine"])
def test_a_view_does_not_depend_on_the_views_before_it(gl: Gl, small: RenderSettings, quality: str) -> None:
    """The same pose drawn first, and again after others, gives the same bits."""
    scene = random_scene(5, np.zeros(3))
    settings = small.model_copy(update={"quality": quality})
    painter = prepare(gl, scene, settings, SILENT).painter(CAMERA, sharp=True)
    poses = scene.cameras[0].poses
    first = painter.draw(poses[0], NEAR)
    painter.draw(poses[1], NEAR)
    again = painter.draw(poses[0], NEAR)
    for name in ("code", "draw", "depth", "normal"):
        np.testing.assert_array_equal(getattr(again, name), getattr(first, name))
