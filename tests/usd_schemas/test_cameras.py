"""Cameras and products: one convention from USD's frustum through our pinhole to COLMAP, and which images there are."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom

from groundwork.errors import InputError
from groundwork.slug import slug
from tests.usd_schemas.stages import SQUARE, Z_UP, bounds, read_body, write_stage
from usd_schemas.apis import SurveyFacts, apply_survey
from usd_schemas.distortion import Distortion
from usd_schemas.flat_scene import CameraTrack, FlatScene
from usd_schemas.pinhole import Pinhole, lens_from_pinhole, look_at, pinhole_from_lens, project
from usd_schemas.reading.choices import StageChoices
from usd_schemas.reading.stage_reader import read_stage

GROUND = f'def Mesh "Ground" {{\n{SQUARE}}}\n'


def camera(name: str, content: str = "") -> str:
    """Write a camera of 24 mm on 36 x 27 mm."""
    lens = "float focalLength = 0.24\nfloat horizontalAperture = 0.36\nfloat verticalAperture = 0.27\n"
    return f'def Camera "{name}" {{\n{lens}float2 clippingRange = (0.2, 1000)\n{content}\n}}\n'


def matrix(values: np.ndarray) -> str:
    """Write a USD camera's transform, given camera_to_world with axes right, down, forward."""
    usd = (values @ np.diag([1.0, -1.0, -1.0, 1.0])).T
    rows = ", ".join("(" + ", ".join(repr(float(v)) for v in row) + ")" for row in usd)
    return f'matrix4d xformOp:transform = ({rows})\nuniform token[] xformOpOrder = ["xformOp:transform"]\n'


def pixel_by_usd(path: Path, prim: str, point: np.ndarray, width: int, height: int) -> np.ndarray:
    """Project a stage point with USD's own frustum [px]."""
    stage = Usd.Stage.Open(str(path))
    frustum = UsdGeom.Camera(stage.GetPrimAtPath(prim)).GetCamera(Usd.TimeCode.EarliestTime()).frustum
    ndc = (frustum.ComputeViewMatrix() * frustum.ComputeProjectionMatrix()).Transform(Gf.Vec3d(*point.tolist()))
    return np.array([(ndc[0] + 1) / 2 * width, (1 - ndc[1]) / 2 * height])


@pytest.mark.parametrize("header", [Z_UP, 'upAxis = "Y"\n metersPerUnit = 0.01'])
def test_a_known_corner_lands_on_one_pixel(header: str, tmp_path: Path) -> None:
    """USD's frustum, our pinhole and pycolmap agree within 0.01 px, offsets and units included; 0.5 px is noticed."""
    import pycolmap

    offsets = "float horizontalApertureOffset = 0.013\nfloat verticalApertureOffset = -0.021\n"
    pose = look_at(np.array([4.0, -7.0, 3.0]), np.array([0.2, 0.1, 0.3]))
    path = write_stage(tmp_path, GROUND + camera("Cam", offsets + matrix(pose)), header)
    scene = read_stage(path)
    track, product = scene.cameras[0], scene.products[0]
    assert (product.width, product.height) == (1280, 960)
    pinhole = pinhole_from_lens(track.lens, product.width, product.height)
    corner = np.array([1.0, 1.0, 0.0])
    expected = pixel_by_usd(path, "/Cam", corner, product.width, product.height)
    unit = 1.0 if header == Z_UP else 0.01
    world = corner * unit if header == Z_UP else np.array([corner[0], -corner[2], corner[1]]) * unit
    ours, depth = project(world[None], pinhole, track.poses[0])
    local = np.linalg.inv(track.poses[0]) @ np.append(world, 1.0)
    colmap = pycolmap.Camera(
        model="PINHOLE",
        width=pinhole.width,
        height=pinhole.height,
        params=[pinhole.fx, pinhole.fy, pinhole.cx, pinhole.cy],
    )
    theirs = np.asarray(colmap.img_from_cam(local[:3][None])).reshape(2)
    np.testing.assert_allclose(ours[0], expected, atol=0.01)
    np.testing.assert_allclose(theirs, expected, atol=0.01)
    assert depth[0] == pytest.approx(local[2])
    shifted = Pinhole(pinhole.width, pinhole.height, pinhole.fx, pinhole.fy, pinhole.cx - 0.5, pinhole.cy - 0.5)
    assert np.abs(project(world[None], shifted, track.poses[0])[0][0] - expected).min() > 0.4


def test_lens_round_trip() -> None:
    """Intrinsics to lens attributes and back, and the aperture widens where aspects differ."""
    pinhole = Pinhole(1280, 960, 900.0, 900.0, 655.3, 470.7)
    again = pinhole_from_lens(lens_from_pinhole(pinhole, 0.036, 0.01), 1280, 960)
    np.testing.assert_allclose(again.matrix(), pinhole.matrix())
    wide = pinhole_from_lens(lens_from_pinhole(pinhole, 0.036), 1920, 960)
    assert wide.fx == pytest.approx(900.0)


def test_scale_above_a_camera_is_taken_out(tmp_path: Path) -> None:
    """A parent in other units moves the camera but leaves its axes of length one."""
    scale = 'float3 xformOp:scale = (2, 2, 2)\nuniform token[] xformOpOrder = ["xformOp:scale"]\n'
    pose = look_at(np.array([1.0, -2.0, 3.0]), np.zeros(3))
    body = f'def Xform "Rig" {{\n{scale}{camera("Cam", matrix(pose))}}}\n'
    track = read_body(tmp_path, GROUND + body).cameras[0]
    np.testing.assert_allclose(track.poses[0, :3, :3], pose[:3, :3], atol=1e-12)
    np.testing.assert_allclose(track.poses[0, :3, 3], pose[:3, 3] * 2)


def poses(count: int) -> list[np.ndarray]:
    """Make poses on a line."""
    return [look_at(np.array([10.0 + k, -5.0, 3.0]), np.zeros(3)) for k in range(count)]


def write_survey(folder: Path) -> Path:
    """Write a stage with a survey of three images through our own schemas."""
    path = write_stage(folder, GROUND)
    stage = Usd.Stage.Open(str(path))
    prim = UsdGeom.Camera.Define(stage, "/World/Surveys/Local/Local_Camera")
    operation = prim.AddTransformOp()
    for code, pose in enumerate(poses(3)):
        operation.Set(Gf.Matrix4d((pose @ np.diag([1.0, -1.0, -1.0, 1.0])).T.tolist()), code)
    pinhole = Pinhole(960, 720, 640.0, 640.0, 480.0, 360.0)
    apply_survey(
        prim,
        SurveyFacts(
            "local",
            "local",
            5,
            1.5,
            ("000000", "000001", "000002"),
            pinhole,
            0.024,
            np.arange(9.0).reshape(3, 3),
            (1.0, 1.0, 2.0),
            np.array([0.0, 2.0, 4.0]),
            Distortion(-0.1, 0.02, 1e-4, -2e-4),
            0.02,
            "Falsework",
            "Test 24",
            -np.arange(9.0).reshape(3, 3),
            (0.5, 0.2, 0.1),
        ),
    )
    stage.GetRootLayer().Save()
    return path


def test_survey_camera(tmp_path: Path) -> None:
    """A survey has one image a sampled code, with its names, GPS, calibration and facts."""
    scene = read_stage(write_survey(tmp_path))
    track = scene.cameras[0]
    np.testing.assert_allclose(track.poses, poses(3), atol=1e-12)
    assert (track.name, track.image_names) == ("local", ("000000", "000001", "000002"))
    assert track.calibration == Pinhole(960, 720, 640.0, 640.0, 480.0, 360.0)
    assert track.sensor_width == 0.024
    assert (track.distortion, track.readout_time) == (Distortion(-0.1, 0.02, 1e-4, -2e-4), 0.02)
    assert (track.make, track.model, track.attitude_sigma) == ("Falsework", "Test 24", (0.5, 0.2, 0.1))
    assert track.attitude is not None
    np.testing.assert_allclose(track.attitude, -np.arange(9.0).reshape(3, 3))
    assert track.gps is not None
    np.testing.assert_allclose(track.gps, np.arange(9.0).reshape(3, 3))
    assert track.facts == {"kind": "local", "seed": 5, "spacing": 1.5, "capture_times": [0.0, 2.0, 4.0]}
    assert [(product.name, product.width, product.height) for product in scene.products] == [("local", 960, 720)]


KEYS = """double3 xformOp:translate.timeSamples = {{
    {first}: (0, 0, 5),
    {last}: (8, 0, 5),
}}
uniform token[] xformOpOrder = ["xformOp:translate"]
"""


@pytest.mark.parametrize("on_parent", [False, True])
def test_an_animated_camera_has_every_frame(on_parent: bool, tmp_path: Path) -> None:
    """Two keys on a camera or its parent: every whole frame of the stage, interpolated."""
    keys = KEYS.format(first=1, last=5)
    body = f'def Xform "Rig" {{\n{keys}{camera("Cam")}}}\n' if on_parent else camera("Cam", keys)
    frames = read_body(tmp_path, GROUND + body, Z_UP + "\n startTimeCode = 2\n endTimeCode = 4").cameras[0]
    np.testing.assert_allclose(frames.poses[:, 0, 3], [2.0, 4.0, 6.0])
    assert frames.image_names == ("000000", "000001", "000002")
    longer = read_body(tmp_path, GROUND + body, Z_UP + "\n startTimeCode = 0\n endTimeCode = 90").cameras[0]
    np.testing.assert_allclose(longer.poses[:, 0, 3], [0.0, 2.0, 4.0, 6.0, 8.0])
    elsewhere = read_body(tmp_path, GROUND + body, Z_UP + "\n startTimeCode = 50\n endTimeCode = 90").cameras[0]
    np.testing.assert_allclose(elsewhere.poses, longer.poses)
    unbounded = read_body(tmp_path, GROUND + body).cameras[0]
    np.testing.assert_allclose(unbounded.poses[:, 0, 3], [0.0, 2.0, 4.0, 6.0, 8.0])


@pytest.mark.parametrize("last", ["300000.5", "1e300"])
def test_keys_too_far_apart_leave_the_camera_out(last: str, tmp_path: Path) -> None:
    """More frames than can be asked for are none, and how to choose some is said; the stage's time codes limit them."""
    body = GROUND + camera("Far", KEYS.format(first=0, last=last)) + camera("B")
    scene = read_body(tmp_path, body)
    assert [track.name for track in scene.cameras] == ["B"]
    said = next(line for line in scene.warnings if line.startswith("/Far"))
    assert said.startswith("/Far: it moves for ")
    assert "--frame FIRST:LAST" in said
    assert said.endswith(": the camera is left out")
    chosen = read_stage(write_stage(tmp_path, body), choices=StageChoices(frames=(1.0, 2.0)))
    assert [len(track.poses) for track in chosen.cameras] == [2, 2]
    limited = read_body(tmp_path, body, Z_UP + "\n startTimeCode = 2\n endTimeCode = 4")
    assert [len(track.poses) for track in limited.cameras] == [3, 1]


def test_reset_stack_stops_the_search_for_motion(tmp_path: Path) -> None:
    """What a camera has cut itself off from does not animate it."""
    still = 'uniform token[] xformOpOrder = ["!resetXformStack!", "xformOp:translate"]'
    still += "\ndouble3 xformOp:translate = (1, 1, 1)"
    body = f'def Xform "Rig" {{\n{KEYS.format(first=1, last=5)}{camera("Cam", still)}}}\n'
    assert read_body(tmp_path, GROUND + body).cameras[0].poses.shape == (1, 4, 4)


def test_orthographic_and_broken_cameras_are_left_out(tmp_path: Path) -> None:
    """Each is named, and where none is left a framing camera stands in."""
    body = camera("Ortho", 'token projection = "orthographic"')
    body += 'def Camera "Blind" {\nfloat focalLength = 0\n}\n' + camera("Nan", matrix(np.full((4, 4), np.nan)))
    scene = read_body(tmp_path, GROUND + body)
    assert [camera.name for camera in scene.cameras] == ["framing"]
    assert {line.split(":")[0] for line in scene.warnings} >= {"/Ortho", "/Blind", "/Nan"}


def test_a_zoom_is_named(tmp_path: Path) -> None:
    """A lens with samples of several times is that of the first, and says so; equal samples are no zoom."""
    samples = "{ 1: 20, 5: 200 }"
    body = f'def Camera "Zoom" {{\nfloat focalLength.timeSamples = {samples}\nfloat horizontalAperture = 36\n'
    body += "float verticalAperture = 27\n" + KEYS.format(first=1, last=5) + "}\n"
    scene = read_body(tmp_path, GROUND + body)
    assert scene.cameras[0].lens.focal_length == 20.0
    assert "/Zoom: focalLength changes with time: all images have one lens, the earliest" in scene.warnings
    still = read_body(tmp_path, GROUND + body.replace("200", "20"))
    assert not any("changes with time" in line for line in still.warnings)


@pytest.mark.parametrize("told", ["/mnt/photos", "../../x", "a/b", "images..", ".hidden", "x" * 300])
def test_a_survey_is_a_plain_file_name(told: str, tmp_path: Path) -> None:
    """A survey id that leads elsewhere or is too long is changed to a slug, and said; so is the name of its product."""
    scene = read_body(tmp_path, GROUND + camera("A", f'uniform token falsework:survey:id = "{told}"') + camera("_B"))
    names = [slug(told), slug("_B")]
    assert [product.name for product in scene.products] == [track.name for track in scene.cameras] == names
    said = [line for line in scene.warnings if "is not a plain file name" in line]
    assert [line.partition(":")[0] for line in said] == (["/A"] if told != names[0] else []) + ["/_B"]


@pytest.mark.parametrize(
    ("told", "reason"),
    [
        (("../../evil", "b"), "'../../evil' is not a plain file name"),
        (("a/b", "c"), "'a/b' is not a plain file name"),
        (("", "c"), "'' is not a plain file name"),
        (("a", "A"), "one occurs twice"),
        (("gain", "recipe"), ""),
        (("one",), ""),
    ],
)
def test_images_have_plain_file_names(told: tuple[str, ...], reason: str, tmp_path: Path) -> None:
    """Names of images that lead elsewhere or are equal give way to numbers, and are said; too few of them give way."""
    names = ", ".join(f'"{name}"' for name in told)
    content = KEYS.format(first=1, last=2) + f"uniform string[] falsework:survey:imageNames = [{names}]"
    scene = read_body(tmp_path, GROUND + camera("A", content))
    assert scene.cameras[0].image_names == (told if told[0] == "gain" else ("000000", "000001"))
    said = [line for line in scene.warnings if "imageNames" in line]
    wanted = f"/A: its falsework:survey:imageNames are not used, because {reason}: numbers are"
    assert said == ([wanted] if reason else [])


PRODUCTS = """
def Scope "Render" {
    def RenderSettings "Settings" {
        rel products = [</Render/Small>, </Render/Lost>, </Render/Large>]
        rel camera = </B>
        uniform int2 resolution = (640, 480)
    }
    def RenderProduct "Small" {
        rel camera = </A>
        uniform int2 resolution = (320, 240)
    }
    def RenderProduct "Large" {
    }
    def RenderProduct "Lost" {
        rel camera = </Nowhere>
    }
    def RenderProduct "Unlisted" {
        rel camera = </A>
    }
}
"""


def test_products(tmp_path: Path) -> None:
    """The settings' products in their order; camera and resolution fall back to the settings."""
    header = Z_UP + '\n renderSettingsPrimPath = "/Render/Settings"'
    scene = read_body(tmp_path, GROUND + camera("A") + camera("B") + PRODUCTS, header)
    found = [(p.name, scene.cameras[p.camera].path, p.width, p.height) for p in scene.products]
    assert found == [("A", "/A", 320, 240), ("B", "/B", 640, 480)]
    assert any(line.startswith("/Render/Lost") for line in scene.warnings)


@pytest.mark.parametrize(
    ("cameras", "products", "names"),
    [
        (("X/a", "Y/a", "a_2"), (), ["a", "a_3", "a_2"]),
        (("X/a", "Y/a", "a"), (), ["a", "a_2", "a_3"]),
        (("a", "A"), (), ["a", "A_2"]),
        (("X/a", "Y/a", "b"), ("b", "b", "c"), ["a", "b_2", "b"]),
    ],
)
def test_products_have_names_of_their_own(
    cameras: tuple[str, ...], products: tuple[str, ...], names: list[str], tmp_path: Path
) -> None:
    """No two captures are in one folder: a later one of a name gives way, and to no name that another one has."""
    body = GROUND
    for path in cameras:
        parent, _, name = path.rpartition("/")
        body += f'def Xform "{parent}" {{\n{camera(name)}}}\n' if parent else camera(name)
    for row, name in enumerate(products):
        body += f'def Scope "P{row}" {{\ndef RenderProduct "{name}" {{\nrel camera = </{cameras[row]}>\n}}\n}}\n'
    scene = read_body(tmp_path, body)
    assert [scene.cameras[product.camera].path for product in scene.products] == [f"/{path}" for path in cameras]
    assert [product.name for product in scene.products] == names


def test_what_a_product_asks_for_beyond_is_named(tmp_path: Path) -> None:
    """Policies, windows, stretched pixels and foreign variables: one line each, from the product or the settings."""
    body = """def Scope "Render" {
        def RenderSettings "Settings" {
            rel products = [</Render/Odd>, </Render/Plain>]
            uniform token aspectRatioConformPolicy = "cropAperture"
        }
        def RenderProduct "Odd" {
            rel camera = </A>
            uniform int2 resolution = (640, 200)
            uniform float4 dataWindowNDC = (0, 0, 0.5, 1)
            uniform float pixelAspectRatio = 2
            rel orderedVars = [</Render/rgb>, </Render/Ci>]
        }
        def RenderProduct "Plain" {
            rel camera = </B>
            uniform int2 resolution = (640, 480)
            rel orderedVars = </Render/rgb>
        }
        def RenderVar "rgb" {
            uniform string sourceName = "rgb"
        }
        def RenderVar "Ci" {
            uniform string sourceName = "Ci"
        }
    }"""
    header = Z_UP + '\n renderSettingsPrimPath = "/Render/Settings"'
    scene = read_body(tmp_path, GROUND + camera("A") + camera("B") + body, header)
    assert [line for line in scene.warnings if line.startswith("/Render")] == [
        "/Render/Odd: aspectRatioConformPolicy cropAperture is read as expandAperture",
        "/Render/Odd: dataWindowNDC is left out: the whole image is rendered",
        "/Render/Odd: pixelAspectRatio 2 is left out: pixels are square",
        "/Render/Odd: RenderVars Ci are not among rgb, depth, semantic, instance, normal: not written",
    ]


def test_choosing_a_survey(tmp_path: Path) -> None:
    """One product with its camera; an unknown one is bad input that lists the others."""
    path = write_stage(tmp_path, GROUND + camera("A") + camera("B"))
    chosen = read_stage(path, survey="B")
    assert [track.path for track in chosen.cameras] == ["/B"]
    assert [(product.name, product.camera) for product in chosen.products] == [("B", 0)]
    assert chosen.origin == read_stage(path).origin
    with pytest.raises(InputError, match=r"survey: no such survey on the stage .*'C'.*allowed: A, B"):
        read_stage(path, survey="C")


def test_a_lens_that_cannot_be(tmp_path: Path) -> None:
    """Coefficients that fold inside the image, or of a model that we do not know, leave the camera out by name."""
    path = write_survey(tmp_path)
    stage = Usd.Stage.Open(str(path))
    prim = stage.GetPrimAtPath("/World/Surveys/Local/Local_Camera")
    prim.GetAttribute("falsework:cal:k1").Set(-0.9)
    stage.GetRootLayer().Save()
    assert any("Local_Camera: a distortion of k1 -0.9" in line for line in read_stage(path).warnings)
    prim.GetAttribute("falsework:cal:model").Set("THIN_PRISM_FISHEYE")
    stage.GetRootLayer().Save()
    scene = read_stage(path)
    assert any("Local_Camera: falsework:cal:model THIN_PRISM_FISHEYE" in line for line in scene.warnings)
    assert [camera.name for camera in scene.cameras] == ["framing"]


def inside(scene: FlatScene, track: CameraTrack) -> tuple[np.ndarray, np.ndarray]:
    """Project the corners of the scene's box."""
    product = scene.products[0]
    low, high = bounds(scene)
    corners = np.array([[(low, high)[bit][axis] for axis, bit in enumerate(bits)] for bits in np.ndindex(2, 2, 2)])
    return project(corners, pinhole_from_lens(track.lens, product.width, product.height), track.poses[0])


@pytest.mark.parametrize("size", [0.01, 1.0, 5000.0])
def test_framing_camera(size: float, tmp_path: Path) -> None:
    """Without a camera the whole scene is in the picture, seen from the south-west and above, and fills it."""
    scale = (
        f'double3 xformOp:scale = ({size}, {size * 3}, {size / 2})\nuniform token[] xformOpOrder = ["xformOp:scale"]'
    )
    scene = read_body(tmp_path, f'def Cube "C" {{\n{scale}\n}}')
    track = scene.cameras[0]
    assert scene.products[0].name == track.name == "framing"
    pixels, depth = inside(scene, track)
    share = np.abs(pixels / [1280, 960] - 0.5).max() * 2
    assert 0.85 < share <= 0.9 + 1e-9
    assert depth.min() > track.near
    eye = track.poses[0, :3, 3]
    assert eye[0] < 0
    assert eye[1] < 0
    assert eye[2] > 0
