"""Sharp shadows: their edges against closed forms, the width of penumbras, and who shares which map."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from groundwork.canonical import folder_digest
from groundwork.progress import SILENT
from render.frames import render_scene
from render.gpu.context import Gl
from render.light.illumination import BRIGHTEST
from render.light.shadow_squares import SHARP_TEXEL, near_reach, share_squares
from render.settings import RenderSettings
from render.views.prepare import Prepared, prepare
from tests.conftest import Count, RecordProof
from tests.render.scenes import CAMERA, SceneBuilder, placed
from usd_schemas.flat_scene import FlatScene, Material, Sun, Texture
from usd_schemas.pinhole import Pinhole, look_at, unproject

F64 = NDArray[np.float64]

GRAY = Material("grey", base_color=(0.5, 0.5, 0.5), roughness=1.0)
CLOSE = Pinhole(480, 160, 240.0, 240.0, 240.0, 80.0)
SLAB = 0.2  # [m]
LENGTH = 300.0  # [m] of the bridge: its map has coarse texels


def towards(azimuth: float, height: float, angle: float) -> Sun:
    """A bright sun at an azimuth from x and a height over the horizon [deg], of an angular diameter [deg]."""
    a, h = np.radians(azimuth), np.radians(height)
    direction = (float(np.cos(h) * np.cos(a)), float(np.cos(h) * np.sin(a)), float(np.sin(h)))
    return Sun(direction, (6.0, 6.0, 6.0), angle)


def under_a_slab(above: float, sun: Sun, offset: tuple[float, float, float] = (0, 0, 0)) -> tuple[FlatScene, float]:
    """A slab along y, its right edge at x = 0, over level ground, seen by a camera 2 m over the edge of its shadow.

    Returns the scene and where on the ground the edge lies along x, counted from the offset [m].
    """
    x, y, z = offset
    builder = SceneBuilder(materials=[GRAY])
    builder.add_box(placed((x, y, z - 0.5), (LENGTH, LENGTH, 1.0)), 1)
    builder.add_box(placed((x - 5.0, y, z + above + SLAB / 2), (10.0, LENGTH, SLAB)), 2)
    # The sun stands over positive x: the upper edge of the slab's right side throws the edge of its shadow.
    upper = above + SLAB if sun.direction[0] < 0 else above
    edge = -upper * sun.direction[0] / sun.direction[2]
    eye = np.array([x + edge, y, z + min(2.0, above - 0.1)])
    pose = look_at(eye, eye - [0.0, 0.0, 1.0], np.array([0.0, 1.0, 0.0]))
    return replace(builder.build(pose[None], CLOSE), sun=sun), edge


def drawn(gl: Gl, scene: FlatScene, settings: RenderSettings) -> tuple[Prepared, F64, F64]:
    """Draw the first pose: the ground's x and its light over that of open ground, along the middle row, each (W,)."""
    track = scene.cameras[0]
    prepared = prepare(gl, scene, settings, SILENT)
    painter = prepared.painter(CLOSE, sharp=True)
    prepared.sharpen_shadows(prepared.shadow_squares(track.poses, CLOSE), 0)
    view = painter.draw(track.poses[0], 0.05)
    row = CLOSE.height // 2
    pixels = np.column_stack([np.arange(CLOSE.width) + 0.5, np.full(CLOSE.width, row + 0.5)])
    ground = unproject(pixels, view.depth[row].astype(float), CLOSE, track.poses[0])
    light = (view.code[row, :, 1].astype(float) / 65535) ** 2 * BRIGHTEST
    order = np.argsort(ground[:, 0])
    return prepared, ground[order, 0], light[order] / light.max()


def edge_of(place: F64, light: F64) -> float:
    """Where the light passes the middle between shade and sun, which it does once [m]."""
    passed = np.flatnonzero(np.diff(light > 0.5))
    assert len(passed) == 1, "acne, or a shadow torn off"
    before, after = passed[0], passed[0] + 1
    return float(
        place[before] + (0.5 - light[before]) / (light[after] - light[before]) * (place[after] - place[before])
    )


@pytest.mark.parametrize("quality", ["fast", "standard"])
def test_the_edge_of_a_shadow_lies_where_the_sun_puts_it(
    gl: Gl, ideal: RenderSettings, quality: str, proof_count: Count, record_proof: RecordProof
) -> None:
    """Within 2 cm, for suns from any side and slabs of any height, at the origin and at UTM coordinates."""
    rng = np.random.default_rng(11)
    settings = ideal.model_copy(update={"shadow_size": 2048, "quality": quality})
    worst = 0.0
    cases = proof_count(6, 40)
    for case in range(cases):
        sun = towards(rng.choice([-1, 1]) * rng.uniform(20, 160), rng.uniform(25, 65), 0.53)
        offset = (0.0, 0.0, 0.0) if case % 2 else (4.8e5, 5.1e6, 250.0)
        scene, edge = under_a_slab(rng.uniform(1.0, 8.0), sun, offset)
        _, place, light = drawn(gl, scene, settings)
        worst = max(worst, abs(edge_of(place, light) - offset[0] - edge))
        assert worst < 0.02, (case, sun, worst)
    record_proof(f"render/edges of sharp shadows: {quality}", cases, 11, {"worst_millimetres": round(1000 * worst, 1)})


def test_a_penumbra_is_as_wide_as_the_sun_makes_it(gl: Gl, ideal: RenderSettings) -> None:
    """Height over the ground times the sun's diameter, between one and a half and three texels."""
    settings = ideal.model_copy(update={"shadow_size": 2048})
    for above, angle, expected in ((5.0, 0.53, 0.0462), (3.0, 0.8, 0.0419), (5.0, 0.0, 0.030), (7.0, 2.0, 0.060)):
        scene, _ = under_a_slab(above, towards(90.0, 89.9, angle))
        _, place, light = drawn(gl, scene, settings)
        beside = np.abs(place) < 0.1
        spread = np.diff(light[beside]) / np.ptp(light[beside])
        middle = (place[beside][1:] + place[beside][:-1]) / 2
        center = np.sum(spread * middle)
        width = np.sqrt(12 * np.sum(spread * (middle - center) ** 2))  # of the box with this second moment
        assert width == pytest.approx(expected, rel=0.2), (above, angle)


def test_all_that_is_near_a_camera_lies_in_its_square(proof_count: Count) -> None:
    """Of flights of any shape, at every place within reach; far fewer squares than cameras where these are dense."""
    rng = np.random.default_rng(5)
    for _ in range(proof_count(20, 200)):
        count, size = int(rng.integers(1, 200)), int(rng.choice([256, 1024, 4096]))
        eyes = np.cumsum(rng.normal(0, 1.0, (count, 3)), axis=0)
        poses = np.array([look_at(eye, eye + rng.normal(0, 1, 3) + [1e-3, 0, 0]) for eye in eyes])
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        across = np.column_stack([turn[:2], rng.normal(0, 10, 2)])
        squares = share_squares(poses, CAMERA, across, size)
        assert len(squares.of_pose) == count
        assert set(squares.of_pose) == set(range(len(squares.centers)))
        pixels = rng.uniform([0, 0], [CAMERA.width, CAMERA.height], (64, 2))
        half = SHARP_TEXEL * size / 2 * (1 - 8 / size)
        for row, pose in enumerate(poses):
            rays = unproject(pixels, np.ones(64), CAMERA, np.eye(4))
            rays *= near_reach(size) * rng.uniform(0, 1, (64, 1)) / np.linalg.norm(rays, axis=1, keepdims=True)
            seen = (rays @ pose[:3, :3].T + pose[:3, 3]) @ across[:, :3].T + across[:, 3]
            assert np.all(np.abs(seen - squares.centers[squares.of_pose[row]]) < half)
    along = np.array([look_at(np.array([x, -8.0, 4.0]), np.array([x, 0.0, 4.0])) for x in np.linspace(0, 200, 400)])
    level = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.7, 0.7, 0.0]])
    assert len(share_squares(along, CAMERA, level, 4096).centers) <= 5


def test_shared_or_interrupted_the_shadows_are_the_same(tmp_path: Path, small: RenderSettings) -> None:
    """A flight through several squares, drawn by one, by two, and by one after half was there: the same bytes."""
    builder = SceneBuilder(materials=[GRAY])
    builder.add_box(placed((0, 0, -0.5), (60, 20, 1)), 1)
    for number in range(12):
        builder.add_box(placed((4.0 * number - 22, 0, 1), (0.3, 0.2, 2)), number + 2)
    eyes = np.array([[x, -3.0 + (number % 2), 2.0] for number, x in enumerate(np.linspace(-20, 20, 9))])
    poses = np.array([look_at(eye, eye + np.array([0.5, 2.0, -1.2])) for eye in eyes])
    scene = replace(builder.build(poses), sun=towards(40, 35, 0.53))
    settings = small.model_copy(update={"quality": "fast", "shadow_size": 256})
    folders = [tmp_path / name for name in ("alone", "shared", "halved")]
    for folder in folders:
        folder.mkdir()
    render_scene(scene, folders[0], settings, 3, SILENT)
    for share in ((1, 2), (0, 2)):
        render_scene(scene, folders[1], settings, 3, SILENT, share=share)
    render_scene(scene, folders[1], settings, 3, SILENT)
    render_scene(scene, folders[2], settings, 3, SILENT, share=(0, 2))
    render_scene(scene, folders[2], settings, 3, SILENT)
    assert len({folder_digest(folder) for folder in folders}) == 1


def test_a_picture_does_not_depend_on_those_before(gl: Gl, small: RenderSettings, tmp_path: Path) -> None:
    """From one square, from another, and from the first again, under leaves that are cut out: the same code."""
    leaf = np.full((16, 16, 4), 255, np.uint8)
    leaf[:, :8, 3] = 0
    cv2.imwrite(str(tmp_path / "leaf.png"), leaf)
    cut = Material("leaf", base_texture=Texture(str(tmp_path / "leaf.png"), True), opacity_threshold=0.5)
    builder = SceneBuilder(materials=[GRAY, cut])
    builder.add_box(placed((0, 0, -0.5), (40, 20, 1)), 1)
    builder.add_box(placed((-12, 1, 1), (1, 1, 0.1)), 2, material=1)
    builder.add_box(placed((12, 1, 1), (1, 1, 0.1)), 3, material=1)
    poses = np.array([look_at(np.array([x, -1.0, 2.0]), np.array([x, 1.0, 0.0])) for x in (-12.0, 12.0)])
    scene = replace(builder.build(poses), sun=towards(40, 50, 0.53))
    prepared = prepare(gl, scene, small.model_copy(update={"quality": "fast"}), SILENT)
    painter, squares = prepared.painter(CAMERA, sharp=True), prepared.shadow_squares(poses, CAMERA)
    assert len(squares.centers) == 2
    codes = []
    for row in (0, 1, 0):
        prepared.sharpen_shadows(squares, row)
        codes.append(painter.draw(poses[row], 0.1).code)
    np.testing.assert_array_equal(codes[0], codes[2])
    lit = codes[0][..., 1] > 0.9 * np.median(codes[0][..., 1])
    assert 0.5 < lit.mean() < 0.99


def test_the_sharp_map_is_drawn_once_a_square(gl: Gl, small: RenderSettings) -> None:
    """A picture from a square whose map is there draws none; the order of a survey visits each square once."""
    scene, _ = under_a_slab(3.0, towards(30, 40, 0.53))
    steps = np.repeat(np.arange(6.0)[None], 3, axis=0).ravel()
    poses = np.repeat(scene.cameras[0].poses, len(steps), axis=0)
    poses[:, 1, 3] += 6.0 * steps
    prepared = prepare(gl, scene, small.model_copy(update={"quality": "fast"}), SILENT)
    squares = prepared.shadow_squares(poses, CLOSE)
    assert 1 < len(squares.centers) <= 6
    order = squares.together(list(range(len(poses))))
    assert sorted(order) == list(range(len(poses)))
    assert np.count_nonzero(np.diff(squares.of_pose[order])) == len(squares.centers) - 1
    shadow = prepared.lamps.shadow
    assert shadow is not None
    drawn_maps = []
    for row in order:
        before = shadow.maps[0].copy()
        prepared.sharpen_shadows(squares, row)
        drawn_maps.append(not np.array_equal(before, shadow.maps[0]))
    assert sum(drawn_maps) == len(squares.centers)
