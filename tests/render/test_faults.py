"""Stages that nobody would make on purpose: drawn right, or refused in one line, never a crash or a wrong label."""

import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from groundwork.errors import InputError
from groundwork.progress import SILENT
from render.capture import read_capture, read_truth
from render.frames import render_scene, render_stage
from render.gpu.context import Gl
from render.gpu.textures import TextureKey, load_textures
from render.settings import RenderSettings
from render.views.prepare import prepare
from tests.conftest import RecordProof
from tests.render.oracle import Oracle, judge
from tests.render.scenes import CAMERA, SceneBuilder, box_corners, placed
from tests.render.test_frames import STAGE
from tests.render.test_truth import draw_views
from usd_schemas.distortion import Distortion
from usd_schemas.flat_scene import FlatScene, world_triangles
from usd_schemas.pinhole import look_at


@pytest.fixture
def plain(small: RenderSettings) -> RenderSettings:
    """Draw as cheaply as it goes."""
    return small.model_copy(update={"quality": "fast", "normals": False})


def held_against_rays(gl: Gl, scene: FlatScene, settings: RenderSettings) -> float:
    """Judge every view of a scene; return the smallest share of equal ids."""
    corners, ids, _ = world_triangles(scene)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    oracle = Oracle(corners[area > 0], ids[area > 0])
    names = np.concatenate([[0], scene.draws.instance]).astype(np.uint32)
    equal = []
    for view, pose in zip(draw_views(gl, scene, settings), scene.cameras[0].poses, strict=True):
        depth, expected, _ = oracle.cast(CAMERA, pose[None], ((0, CAMERA.height),))
        verdict = judge(names[view.draw], view.depth, expected, depth)
        assert verdict.stray == 0.0
        assert verdict.median < 5e-7
        equal.append(verdict.equal)
    return min(equal)


def test_degenerate_meshes_hide_nothing(gl: Gl, plain: RenderSettings, record_proof: RecordProof) -> None:
    """Triangles that are points or lines, a box squashed to a plane, one squashed to a line: the rest is as it was."""
    builder = SceneBuilder()
    builder.add_box(placed((0, 0, 0), (2, 2, 2), 0.3), 1)
    flat = box_corners()
    flat[::2] = flat[::2, :1]
    flat[1::4, 2] = flat[1::4, 1]
    with np.errstate(invalid="ignore"):
        builder.add_mesh(flat, placed((0.5, -2, 0)), 2)
    builder.normals[-1] = np.nan_to_num(builder.normals[-1])
    builder.add_box(placed((2, -1.5, 0.3), (1, 1, 0)), 3)
    builder.add_box(placed((-2, -1.5, 0.3), (1, 0, 0)), 4)
    poses = np.array(
        [look_at(np.array([1.0, -7.0, 2.5]), np.zeros(3)), look_at(np.array([-5.0, -3, 3.0]), np.zeros(3))]
    )
    equal = held_against_rays(gl, builder.build(poses), plain)
    assert equal >= 0.9995
    record_proof("render: degenerate meshes", 2, 0, {"ids_equal": equal})


def test_a_camera_inside_a_mesh_sees_it_from_within(gl: Gl, plain: RenderSettings, record_proof: RecordProof) -> None:
    """Walls all round, at their depth; nothing of what is outside."""
    builder = SceneBuilder()
    builder.add_box(placed((0, 0, 0), (6, 5, 4)), 1)
    builder.add_box(placed((1.5, 0.5, 0), (1, -1, 1), 0.5), 2)
    builder.add_box(placed((20, 0, 0), (9, 9, 9)), 3)
    poses = np.array([look_at(np.array([-1.0, 0.2, 0.1]), target) for target in np.eye(3) * 3 + [0.0, 0.1, 0.0]])
    scene = builder.build(poses)
    equal = held_against_rays(gl, scene, plain)
    assert equal >= 0.9995
    assert not any(np.isin(view.draw, [0, 3]).any() for view in draw_views(gl, scene, plain))
    record_proof("render: camera inside a mesh", 3, 0, {"ids_equal": equal})


def test_ten_thousand_prims(gl: Gl, plain: RenderSettings, record_proof: RecordProof) -> None:
    """Every one has its id; a frame stays a matter of milliseconds."""
    builder, box = SceneBuilder(), box_corners()
    side = 100
    for number in range(side * side):
        row, column = divmod(number, side)
        builder.add_mesh(box, placed((row * 1.5, column * 1.5, 0), (1, 1, 1 + number % 7)), number + 1)
    middle = np.array([75.0, 75.0, 0.0])
    poses = np.array([look_at(middle + np.array([0, -3, 60]), middle), look_at(np.array([-20.0, -15, 30]), middle)])
    scene = builder.build(poses)
    equal = held_against_rays(gl, scene, plain)
    assert equal >= 0.999  # a prim is some two pixels wide here: every other pixel is an edge
    painter = prepare(gl, scene, plain, SILENT).painter(CAMERA, sharp=True)
    painter.draw(poses[0], 0.1)
    begin = time.process_time()
    for _ in range(5):
        painter.draw(poses[0], 0.1)
    seconds = (time.process_time() - begin) / 5
    record_proof("render: ten thousand prims", 2, 0, {"ids_equal": equal, "cpu_s_a_frame": seconds})


def test_a_texture_of_a_hundred_megabytes(gl: Gl, tmp_path: Path, record_proof: RecordProof) -> None:
    """It is reduced on the way, keeps its mean, and the next one is loaded as if nothing had been."""
    side = 5888
    row = np.random.default_rng(1).integers(60, 140, (64, side, 3), np.uint8)
    path = tmp_path / "huge.bmp"
    cv2.imwrite(str(path), np.tile(row, (side // 64, 1, 1)))
    (tmp_path / "nothing.png").write_bytes(b"")
    assert path.stat().st_size > 100e6
    keys = [TextureKey(str(path), False, "vector"), TextureKey(str(tmp_path / "nothing.png"), True)]
    slots, warnings = load_textures(gl, keys, [], 1024, 1.0)
    assert slots[keys[0]].side == 1024
    assert slots[keys[0]].mean == pytest.approx((row.mean() / 255,) * 3, abs=0.01)
    assert len(warnings) == 1
    assert "nothing.png" in warnings[0]
    record_proof("render: texture of 100 MB, and one of no bytes", 2, 1, {"bytes": path.stat().st_size})


def test_images_without_size(tmp_path: Path, plain: RenderSettings, record_proof: RecordProof) -> None:
    """A product of 0 x 0 pixels is left out by name; one of 1 x 1 is a capture like any other, with a bent lens too."""
    text = STAGE.format(texture="absent")
    path = tmp_path / "scene.usda"
    path.write_text(text.replace("(160, 120)", "(0, 0)"))
    (tmp_path / "none").mkdir()
    with pytest.raises(InputError, match="no such survey"):
        render_stage(path, tmp_path / "none", plain, 1, SILENT, survey="local")
    builder = SceneBuilder()
    builder.add_box(placed((0, 0, 0), (200, 2, 200)), 5)
    scene = builder.build(look_at(np.array([0.0, -7, 0.1]), np.zeros(3))[None])
    tiny, depths = replace(scene.products[0], width=1, height=1), list[float]()
    for name, bend in (("straight", Distortion()), ("bent", Distortion(k1=-0.05))):
        (tmp_path / name).mkdir()
        track = replace(scene.cameras[0], distortion=bend)
        render_scene(replace(scene, products=(tiny,), cameras=(track,)), tmp_path / name, plain, 1, SILENT)
        truth = read_truth(read_capture(tmp_path / name))
        assert truth is not None
        np.testing.assert_array_equal(truth.instance(0), [[5]])
        depths.append(float(truth.depth(0)[0, 0]))
    error = max(abs(depth - 6.0) for depth in depths)
    assert error < 6e-3
    record_proof("render: images without size", 1 + len(depths), 0, {"depth_error_m": error})
