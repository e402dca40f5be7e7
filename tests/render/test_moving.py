"""Scenes in motion: photograph, ids, depth and shadow of each frame are those of the scene as it stands then."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from groundwork.progress import SILENT
from render.capture import read_capture, read_truth
from render.frames import render_scene
from render.gpu.context import Gl
from render.settings import RenderSettings
from render.views.camera_body import CameraBody
from render.views.prepare import prepare
from tests.conftest import RecordProof
from tests.render.scenes import CAMERA
from tests.usd_schemas.stages import SQUARE, read_body
from tests.usd_schemas.test_moments import BENDING, BLINKING, SKIN, SWARM
from usd_schemas.distortion import Distortion
from usd_schemas.flat_scene import FlatScene

SUN = """def DistantLight "Sun" {
    float inputs:intensity = 3
    bool inputs:normalize = true
}
"""
FLOOR = f"""def Mesh "Floor" {{
{SQUARE.replace("1,", "6,").replace(", 1", ", 6").replace("[6", "[1").replace("[0, 6", "[0, 1").replace("-1", "-6")}
    double3 xformOp:translate = (0, 0, -1)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""
EYE = """def Camera "Eye" {
    double3 xformOp:translate.timeSamples = {1: (0, 0, 8), 2: (0.5, 0, 8), 3: (1, 0, 8)}
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
SLIDING = f"""def Mesh "Sliding" {{
{SQUARE}    double3 xformOp:translate.timeSamples = {{1: (-2, -2, 0), 3: (2, -2, 0)}}
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""


@pytest.fixture
def scene(tmp_path: Path) -> FlatScene:
    """Read a stage with everything that may move, above a floor, under a sun from the zenith."""
    return read_body(tmp_path, EYE + SUN + FLOOR + SLIDING + BENDING + BLINKING + SWARM + SKIN)


@pytest.mark.parametrize("distorts", [False, True])
def test_every_frame_is_that_of_a_scene_that_never_moved(
    gl: Gl, ideal: RenderSettings, scene: FlatScene, distorts: bool, record_proof: RecordProof
) -> None:
    """Ids and depth of each frame are to the bit those of the scene at its moment, drawn alone; in any order."""
    settings = ideal.model_copy(update={"quality": "fast", "normals": False})
    track = replace(scene.cameras[0], distortion=Distortion(0.05, 0.0, 0.0, 0.0) if distorts else Distortion())
    body = CameraBody(track, CAMERA, None, prepare(gl, scene, settings, SILENT), scene)
    pixels = 0
    for row in (2, 0, 1):
        body.move(row)
        view = body.shoot(row)()
        alone = replace(scene.at_moment(row), moments=())
        still = CameraBody(replace(track, moments=()), CAMERA, None, prepare(gl, alone, settings, SILENT), alone)
        wanted = still.shoot(row)()
        ids = [np.concatenate([[0], one.draws.instance]) for one in (scene.at_moment(row), alone)]
        np.testing.assert_array_equal(ids[0][view.draw], ids[1][wanted.draw])
        np.testing.assert_array_equal(view.depth, wanted.depth)
        pixels += int(np.isfinite(view.depth).sum())
    lens = "bent" if distorts else "straight"
    record_proof(f"moving stage, {lens} lens: pixels equal to the bit", 3, 0, {"equal_pixels": pixels})


def test_thin_members_move_as_all_else(gl: Gl, ideal: RenderSettings, tmp_path: Path) -> None:
    """A strip of 2 cm that slides and grows: at each moment its ribbon is that of a scene that never moved."""
    scaled = "float3 xformOp:scale.timeSamples = {1: (1, 1, 1), 3: (2, 1.5, 1)}"
    black = "color3f[] primvars:displayColor = [(0, 0, 0)]"
    narrow = SQUARE.replace("(-1,", "(-0.01,").replace("(1,", "(0.01,")
    order = "    uniform token[] xformOpOrder"
    strip = SLIDING.replace(SQUARE, narrow).replace(order, f"    {scaled}\n    {black}\n{order}")
    strip = strip.replace('["xformOp:translate"]', '["xformOp:translate", "xformOp:scale"]')
    scene = read_body(tmp_path, EYE + SUN + FLOOR + strip)
    settings = ideal.model_copy(update={"quality": "standard", "normals": False})
    body = CameraBody(scene.cameras[0], CAMERA, None, prepare(gl, scene, settings, SILENT), scene)
    for row in (2, 0, 1):
        body.move(row)
        alone = replace(scene.at_moment(row), moments=())
        still = prepare(gl, alone, settings, SILENT)
        ours, wanted = body.prepared.gpu.ribbons, still.gpu.ribbons
        assert np.isfinite(ours.thickness).any()
        for name in ("surfaces", "ribbons", "thickness", "length"):
            np.testing.assert_array_equal(getattr(ours, name), getattr(wanted, name), name)
        code = body.shoot(row)().code.astype(float)
        shown = CameraBody(replace(scene.cameras[0], moments=()), CAMERA, None, still, alone).shoot(row)().code
        assert np.ptp(code, axis=1).max() > 1000
        np.testing.assert_allclose(code, shown, atol=200)  # the light volume stays that of the first moment


def test_shadows_move_with_what_throws_them(gl: Gl, ideal: RenderSettings, scene: FlatScene) -> None:
    """The floor beside the sliding square is lit where the square was, and dark below it."""
    settings = ideal.model_copy(update={"quality": "fast", "normals": False})
    slanted = replace(scene, sun=scene.sun and replace(scene.sun, direction=(0.0, 0.7, 0.7)))
    body = CameraBody(scene.cameras[0], CAMERA, None, prepare(gl, slanted, settings, SILENT), slanted)
    light = []
    for row in (0, 2):
        body.move(row)
        body.prepared.sharpen_shadows(body.prepared.shadow_squares(scene.cameras[0].poses, CAMERA), row)
        view = body.shoot(row)()
        ids = np.concatenate([[0], slanted.at_moment(row).draws.instance])[view.draw]
        floor = next(number.id for number in scene.instances if number.path == "/Floor")
        place = scene.cameras[0].poses[row]
        column, line = (int(CAMERA.cx + CAMERA.fx * (-2.0 - place[0, 3]) / 9.0), int(CAMERA.cy + CAMERA.fy * 3.5 / 9.0))
        assert ids[line, column] == floor
        light.append(float(view.code[line, column].mean()))
    assert light[0] < 0.7 * light[1]


def test_a_capture_of_what_moves_says_so(tmp_path: Path, ideal: RenderSettings, scene: FlatScene) -> None:
    """Each frame's truth has the ids at its own time, and the table marks those that move."""
    product = replace(scene.products[0], width=64, height=48)
    small = replace(scene, products=(product,))
    render_scene(small, tmp_path, ideal.model_copy(update={"quality": "fast"}), 1, SILENT)
    truth = read_truth(read_capture(tmp_path))
    assert truth is not None
    assert {row.path for row in truth.instances if row.moves} >= {"/Sliding", "/Blinking/Lamp", "/Body/Skin"}
    lamp = next(row.id for row in truth.instances if row.path == "/Blinking/Lamp")
    assert [bool((truth.instance(index) == lamp).any()) for index in range(3)][1] is False
