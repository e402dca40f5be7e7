"""A lens that distorts and a shutter that rolls: every exact image against rays, corners against their projection."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from groundwork.progress import SILENT
from render.capture import image_files, load_image, read_capture, read_truth
from render.frames import render_scene
from render.gpu.context import Gl
from render.settings import RenderSettings
from render.views.prepare import prepare
from tests.conftest import Count, RecordProof
from tests.render.oracle import Oracle, judge
from tests.render.prepared_here import prepared_here
from tests.render.scenes import SceneBuilder, placed, random_scene
from tests.render.test_truth import edge_line
from usd_schemas.distortion import NO_DISTORTION, Distortion
from usd_schemas.flat_scene import CameraTrack, FlatScene, world_triangles
from usd_schemas.pinhole import Pinhole, look_at

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

CAMERA = Pinhole(480, 360, 380.0, 383.0, 242.3, 177.9)
HALF = Pinhole(240, 180, 190.0, 191.5, 121.15, 88.95)  # the same view
BARREL = Distortion(-0.12, 0.03, 8e-4, -5e-4)
CUSHION = Distortion(0.08, -0.01, -6e-4, 4e-4)
MODELS = {
    "pinhole": (NO_DISTORTION, 0.0),
    "barrel": (BARREL, 0.0),
    "cushion": (CUSHION, 0.0),
    "rolling": (NO_DISTORTION, 0.03),
    "barrel rolling": (BARREL, 0.03),
}


@pytest.fixture(autouse=True)
def _prepared() -> Iterator[None]:
    """Cast light in this process."""
    with prepared_here():
        yield


def through(scene: FlatScene, model: str) -> FlatScene:
    """Give the scene's camera a lens and a shutter, and let it fly."""
    distortion, readout = MODELS[model]
    track = scene.cameras[0]
    facts: dict[str, object] = {"capture_times": [4.0 * row for row in range(len(track.poses))]}
    flying = replace(track, distortion=distortion, readout_time=readout, facts=facts)
    return replace(scene, cameras=(flying,), origin=model)


@pytest.mark.parametrize(("quality", "models"), [("fast", tuple(MODELS)), ("fine", ("rolling", "barrel rolling"))])
def test_every_exact_image_equals_the_ray_caster(
    tmp_path: Path,
    small: RenderSettings,
    quality: str,
    models: tuple[str, ...],
    proof_count: Count,
    record_proof: RecordProof,
) -> None:
    """Depth, ids, labels and normals of a capture as read back, for every camera model; sixty boxes, some mirrored."""
    settings = small.model_copy(update={"quality": quality, "volume_probes": 1000, "volume_rays": 16})
    figures = {}
    for model in models:
        verdicts, worst = [], 0.0
        for seed in range(proof_count(1, 10)):
            scene = through(random_scene(seed, np.array([5.0e5, 4.6e6, 120.0]), count=60), model)
            scene = at_size(scene, (HALF, CAMERA)[proof_count(0, 1)])
            folder = tmp_path / f"{model}{seed}"
            folder.mkdir()
            render_scene(scene, folder, settings, seed, SILENT)
            capture = read_capture(folder)
            truth = read_truth(capture)
            assert truth is not None
            assert truth.distortion == MODELS[model][0]
            assert (truth.readout is not None) == (MODELS[model][1] > 0)
            corners, ids, _ = world_triangles(scene)
            oracle = Oracle(corners, ids)
            labels = np.concatenate([np.zeros(1, np.uint8), 1 + np.arange(60, dtype=np.uint8) % 15])
            for index in range(3):
                depth, expected, normal = oracle.look(truth, index)
                found = truth.instance(index)
                verdicts.append(judge(found, truth.depth(index), expected, depth))
                np.testing.assert_array_equal(truth.semantic(index), labels[found])
                assert np.all(np.isposinf(truth.depth(index)) == (found == 0))
                coded = image_files.decode(folder / "truth/normal" / f"{truth.names[index]}.png") / 127.5 - 1
                sure = (found == expected) & (found > 0)
                worst = max(worst, float(np.quantile(np.abs(coded - normal)[sure], 0.999)))
        assert min(verdict.equal for verdict in verdicts) >= 0.9995, model
        assert max(verdict.stray for verdict in verdicts) == 0.0, model
        assert max(verdict.median for verdict in verdicts) < 5e-7, model
        assert max(verdict.tail for verdict in verdicts) < 5e-6, model
        assert worst < 1 / 127.5, "half a step of the 8-bit code, and float16"
        figures[f"{model}_ids_equal"] = min(verdict.equal for verdict in verdicts)
        figures[f"{model}_depth_median"] = max(verdict.median for verdict in verdicts)
        figures[f"{model}_depth_p999"] = max(verdict.tail for verdict in verdicts)
    count = len(models) * proof_count(3, 30)
    record_proof(f"render: every exact image equals the ray caster, {quality}", count, 0, figures)


def at_size(scene: FlatScene, camera: Pinhole) -> FlatScene:
    """Photograph a scene with another camera."""
    product = replace(scene.products[0], width=camera.width, height=camera.height)
    return replace(scene, cameras=(replace(scene.cameras[0], calibration=camera),), products=(product,))


def plate_corner(ids: NDArray[np.uint32], camera: Pinhole, distortion: Distortion) -> F64:
    """Find the lower right corner of the only shape in coordinates of the lens without distortion [1].

    A row's last pixel inside and the next one outside bound the edge from both sides; through the inverse of the
    distortion the edge is straight again.
    """

    def straight(rows: I64, columns: I64) -> F64:
        pixels = np.stack([columns, rows], axis=-1).astype(np.float64) + 0.5
        return distortion.undistort((pixels - [camera.cx, camera.cy]) / [camera.fx, camera.fy])

    inside = ids > 0
    rows = np.flatnonzero(inside.any(axis=1) & ~inside.all(axis=1))
    lowest = rows[-1]
    right = bounds(inside, straight, rows[rows < lowest - 25])
    columns = np.flatnonzero(inside.any(axis=0))
    below = bounds(inside.T, lambda u, v: straight(v, u)[:, ::-1], columns[columns < columns[-1] - 25])
    a, b = right
    c, d = below
    return np.array([(a + b * c) / (1 - b * d), (c + d * a) / (1 - b * d)])


def bounds(inside: NDArray[np.bool_], straight: Callable[[I64, I64], F64], rows: I64) -> tuple[float, float]:
    """Fit x = a + b y between the last point inside and the first outside of each row, by linear programming."""
    last = inside.shape[1] - 1 - np.argmax(inside[rows, ::-1], axis=1)
    return edge_line(straight(rows, last), straight(rows, last + 1))


@pytest.mark.parametrize("model", ["pinhole", "barrel", "cushion"])
def test_a_corner_lands_where_the_lens_projects_it(
    gl: Gl, small: RenderSettings, model: str, proof_count: Count, record_proof: RecordProof
) -> None:
    """Within 0.02 px of OpenCV's own projection, principal point and both focal lengths off the obvious."""
    larger = proof_count(1, 2)
    camera = Pinhole(640 * larger, 480 * larger, 450.0 * larger, 455.0 * larger, 327.65 * larger, 235.35 * larger)
    distortion = MODELS[model][0]
    builder = SceneBuilder()
    plate = np.array([[[-9.0, 0, 7], [-9, 0, -1.31], [1.87, 0, -1.52]], [[-9, 0, 7], [1.87, 0, -1.52], [1.71, 0, 7]]])
    builder.add_mesh(plate, placed((0.0, 0.0, 0.0)), 7)
    pose = look_at(np.array([0.4, -6.0, 0.3]), np.array([0.1, 0.0, 0.2]))
    scene = builder.build(pose[None], camera)
    prepared = prepare(gl, scene, small.model_copy(update={"quality": "fast", "normals": False}), SILENT)
    if distortion.is_identity:
        ids = prepared.painter(camera, sharp=True).draw(pose, 0.05).draw
    else:
        lens, wide = prepared.lens(scene, camera, distortion)
        band = (0, camera.height)
        ids = lens.look([wide.draw_window(pose, lens.window(band), 0.05)], pose[None], (band,), 0.05).draw
    found = distortion.distort(plate_corner(ids, camera, distortion)) * [camera.fx, camera.fy] + [camera.cx, camera.cy]
    world_to_camera = np.linalg.inv(pose)
    matrix = camera.matrix() - [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]
    turn = cv2.Rodrigues(world_to_camera[:3, :3])[0]
    coefficients = np.array([distortion.k1, distortion.k2, distortion.p1, distortion.p2])
    seen, _ = cv2.projectPoints(np.array([[1.87, 0, -1.52]]), turn, world_to_camera[:3, 3], matrix, coefficients)
    error = float(np.abs(found - (seen.reshape(2) + 0.5)).max())
    assert error < 0.02
    record_proof(f"render: a corner lands where it is projected, {model}", 1, 0, {"error_px": error})


def test_photograph_and_truth_share_pixels_through_the_lens(tmp_path: Path, ideal: RenderSettings) -> None:
    """Brightness steps where ids step: the resampled photograph and the looked-up truth lie on one grid."""
    scene = at_size(through(random_scene(3, np.zeros(3), count=60), "barrel rolling"), HALF)
    render_scene(scene, tmp_path, ideal.model_copy(update={"quality": "fine"}), 1, SILENT)
    capture = read_capture(tmp_path)
    truth = read_truth(capture)
    assert truth is not None
    best = []
    for index in range(3):
        gray = cv2.cvtColor(load_image(capture, index), cv2.COLOR_RGB2GRAY).astype(np.float64)
        step = np.abs(np.diff(gray, axis=1))
        edge = (np.diff(truth.instance(index).astype(np.int64), axis=1) != 0).astype(float)
        scores = {shift: float((np.roll(edge, shift, axis=1) * step).sum()) for shift in range(-3, 4)}
        best.append(max(scores, key=lambda shift: scores[shift]))
    assert best == [0, 0, 0]


def test_the_shutter_moves_as_the_flight_does(tmp_path: Path, small: RenderSettings) -> None:
    """Poses of the bands run along the flight, their middle is the image's pose, and the seed draws the trembling."""
    from render.sensor.shutter import flight_velocity, read_out

    poses = np.stack([look_at(np.array([2.0 * row, -9.0, 4.0]), np.array([2.0 * row, 0.0, 2.0])) for row in range(5)])
    scene = random_scene(1, np.zeros(3), count=4)
    facts: dict[str, object] = {"capture_times": [1.0 * row for row in range(5)]}
    track: CameraTrack = replace(scene.cameras[0], poses=poses, readout_time=0.04, facts=facts)
    np.testing.assert_allclose(flight_velocity(track), np.tile([2.0, 0, 0], (5, 1)), atol=1e-12)
    still = small.sensor.model_copy(update={"tremble_speed": 0.0, "tremble_rate": 0.0})
    readout = read_out(track, 480, still, 3)
    assert readout is not None
    assert len(readout.bands) >= 16
    assert readout.bands[0][0] == 0
    assert readout.bands[-1][1] == 480
    traveled = readout.poses[:, -1, :3, 3] - readout.poses[:, 0, :3, 3]
    np.testing.assert_allclose(traveled, np.tile([2.0 * 0.04 * 23 / 24, 0, 0], (5, 1)), atol=1e-9)
    np.testing.assert_allclose(readout.poses[..., :3, 3].mean(axis=1), poses[:, :3, 3], atol=1e-9)
    shaken = [read_out(track, 480, small.sensor, seed) for seed in (3, 3, 4)]
    assert all(one is not None for one in shaken)
    arrays = [one.poses for one in shaken if one is not None]
    np.testing.assert_array_equal(arrays[0], arrays[1])
    assert not np.array_equal(arrays[0], arrays[2])
    turned = np.einsum("bij,bkj->bik", arrays[0][2, :, :3, :3], arrays[0][2, :, :3, :3])
    np.testing.assert_allclose(turned, np.broadcast_to(np.eye(3), turned.shape), atol=1e-12)
    assert read_out(track, 480, small.sensor.model_copy(update={"rolling_shutter": False}), 3) is None
