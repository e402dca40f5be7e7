"""A stage becomes a capture through the child process: same bytes every time, truth untouched by looks."""

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from groundwork.canonical import folder_digest
from groundwork.child import run_child
from groundwork.errors import InputError
from groundwork.progress import SILENT
from render.capture import load_image, read_capture, read_truth
from render.detail.surveyed_scene import product_camera
from render.frames import render_scene, render_stage
from render.settings import RenderSettings
from tests.render.prepared_here import prepared_here
from tests.render.scenes import random_scene
from usd_schemas.reading.stage_reader import read_stage

STAGE = """#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
)
def Xform "World" {{
    def Mesh "Plate" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-5, -5, 0), (5, -5, 0), (5, 5, 0), (-5, 5, 0)]
        texCoord2f[] primvars:st = [(0, 0), (4, 0), (4, 4), (0, 4)] (interpolation = "vertex")
        rel material:binding = </World/Look>
        int userProperties:instanceId = 70000
        string userProperties:class = "deck"
    }}
    def Cube "Box" {{
        double size = 2
        double3 xformOp:translate = (0.5, 0, 1)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
    def Material "Look" {{
        token outputs:surface.connect = </World/Look/Surface.outputs:surface>
        def Shader "Surface" {{
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = </World/Look/Picture.outputs:rgb>
            token outputs:surface
        }}
        def Shader "Picture" {{
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @./{texture}.png@
            token inputs:sourceColorSpace = "sRGB"
            token inputs:wrapS = "repeat"
            token inputs:wrapT = "repeat"
            float2 inputs:st.connect = </World/Look/Reader.outputs:result>
            float3 outputs:rgb
        }}
        def Shader "Reader" {{
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }}
    }}
    def Camera "Drone" {{
        float focalLength = 0.24
        float horizontalAperture = 0.36
        float verticalAperture = 0.27
        float2 clippingRange = (0.1, 1000)
        double3 xformOp:translate.timeSamples = {{ 0: (0, -9, 4), 1: (1, -9, 4), 2: (2, -9, 5) }}
        float3 xformOp:rotateXYZ = (65, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
    }}
}}
def Scope "Render" {{
    def RenderProduct "local" {{
        rel camera = </World/Drone>
        uniform int2 resolution = (160, 120)
    }}
}}
"""

SMALL = RenderSettings(shadow_size=512, volume_probes=1500, volume_rays=32, normals=True)


@pytest.fixture(autouse=True)
def _prepared() -> Iterator[None]:
    """Leave nothing to a child where a test draws in this process; a renderer in a child has children as ever."""
    with prepared_here():
        yield


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    """Write a plate with a texture and a box, seen by a moving camera."""
    return write_plate(tmp_path / "scene")


def write_plate(folder: Path) -> Path:
    """Write the stage and two pictures for its plate; give its file."""
    folder.mkdir()
    for name, seed in (("plain", 1), ("other", 2)):
        noise = np.random.default_rng(seed).integers(40, 220, (64, 64, 3), np.uint8)
        cv2.imwrite(str(folder / f"{name}.png"), noise)
    path = folder / "scene.usda"
    path.write_text(STAGE.format(texture="plain"))
    return path


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Draw the stage once in this process, with everything on."""
    folder = tmp_path_factory.mktemp("drawn")
    with prepared_here():
        draw(write_plate(folder / "scene"), folder / "capture", SMALL)
    return folder / "capture"


def render(stage: Path, folder: Path, settings: RenderSettings, seed: int = 3) -> dict[str, object]:
    """Render in a child process."""
    folder.mkdir()
    request = {
        "scene": str(stage),
        "folder": str(folder),
        "settings": settings.model_dump(),
        "seed": seed,
        "survey": "",
    }
    return run_child("render.frames", request, time_limit=120, memory_limit=4)


def draw(stage: Path, folder: Path, settings: RenderSettings, seed: int = 3) -> None:
    """Render in this process, which is quicker."""
    folder.mkdir()
    render_stage(stage, folder, settings, seed, SILENT)


def test_child_writes_a_capture_and_repeats_it_byte_for_byte(
    drawn: Path, stage: Path, tmp_path: Path, small: RenderSettings
) -> None:
    """A child and this process, the same bytes; the capture reads back with a 32-bit id."""
    assert small == SMALL
    answer = render(stage, tmp_path / "a", small)
    assert answer["frames"] == 3
    assert folder_digest(tmp_path / "a") == folder_digest(drawn)
    capture = read_capture(tmp_path / "a")
    truth = read_truth(capture)
    assert truth is not None
    assert capture.size == (160, 120)
    assert [image.name for image in capture.images] == ["000000", "000001", "000002"]
    assert abs(capture.prior.focal_px / truth.camera.fx - 1) <= 0.01
    assert capture.prior.focal_px != truth.camera.fx
    assert load_image(capture, 1).std() > 10
    assert 70000 in truth.instance(0)
    deck = next(row.id for row in truth.classes if row.name == "deck")
    np.testing.assert_array_equal(truth.semantic(0)[truth.instance(0) == 70000], deck)
    assert str(tmp_path) not in "".join(p.read_text() for p in (tmp_path / "a").rglob("*.json"))


def test_another_texture_or_seed_changes_photographs_only(drawn: Path, stage: Path, tmp_path: Path) -> None:
    """Depth, ids, labels, normals, poses and surface stay byte-equal."""
    draw(stage, tmp_path / "seed", SMALL, seed=4)
    stage.write_text(STAGE.format(texture="other"))
    draw(stage, tmp_path / "look", SMALL)
    for other in ("look", "seed"):
        assert folder_digest(drawn / "images") != folder_digest(tmp_path / other / "images")
        for kind in ("depth", "semantic", "instance", "normal"):
            assert folder_digest(drawn / "truth" / kind) == folder_digest(tmp_path / other / "truth" / kind)
        for name in ("poses.json", "instances.json", "surface.npz"):
            assert (drawn / "truth" / name).read_bytes() == (tmp_path / other / "truth" / name).read_bytes()


def test_noise_off_leaves_truth_alone(drawn: Path, stage: Path, tmp_path: Path, ideal: RenderSettings) -> None:
    """The ideal camera sees the same truth; its photographs are PNG, and repeat without any seed."""
    draw(stage, tmp_path / "ideal", ideal)
    draw(stage, tmp_path / "again", ideal, seed=9)
    assert folder_digest(drawn / "truth/depth") == folder_digest(tmp_path / "ideal/truth/depth")
    assert folder_digest(tmp_path / "ideal/images") == folder_digest(tmp_path / "again/images")
    assert sorted(path.suffix for path in (tmp_path / "ideal/images").iterdir()) == [".png"] * 3


def test_bad_requests_are_one_line(stage: Path, tmp_path: Path, small: RenderSettings) -> None:
    """No such survey, no such device, a transform that is not finite."""
    with pytest.raises(InputError, match="no such survey"):
        render_stage(stage, tmp_path, small, 1, SILENT, survey="nowhere")
    scene = random_scene(2, np.zeros(3), count=3)
    with pytest.raises(InputError, match="device"):
        render_scene(scene, tmp_path, small.model_copy(update={"device": "17"}), 1, SILENT)
    scene.draws.transform[1, 0, 3] = np.nan
    with pytest.raises(InputError, match=r"/Part_2: a transform is not finite"):
        render_scene(scene, tmp_path, small, 1, SILENT)


def test_product_camera_prefers_the_calibration_at_its_own_size(stage: Path) -> None:
    """At another size the lens decides."""
    track = read_stage(stage).cameras[0]
    camera = product_camera(track, 320, 240)
    assert camera.fx == pytest.approx(320 * 24 / 36)
    exact = product_camera(random_scene(1, np.zeros(3), count=2).cameras[0], 160, 120)
    assert (exact.fx, exact.cx) == (140.0, 81.3)
