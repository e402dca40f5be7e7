"""Stages written by hand, one for each thing that a stage may say, from the file to color, depth and ids of pixels.

Camera 8 m above the origin, looking down; under a plain white dome a matt surface shows its own color.
"""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from groundwork.progress import SILENT
from render.gpu.context import Gl
from render.settings import RenderSettings
from render.views.prepare import prepare
from render.views.targets import View
from tests.conftest import RecordProof
from tests.render.scenes import CAMERA
from tests.usd_schemas.stages import SQUARE, Z_UP, write_stage
from tests.usd_schemas.test_foreign_materials import omni, standard
from tests.usd_schemas.test_materials import network, texture
from usd_schemas.flat_scene import FlatScene
from usd_schemas.pinhole import project
from usd_schemas.reading.scene_cache import load_scene

F64 = NDArray[np.float64]
Color = tuple[float, float, float]
Point = tuple[float, float, float]

EYE = """def Camera "Eye" {
    double3 xformOp:translate = (0, 0, 8)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
DOME = 'def DomeLight "Sky" {}\n'
FLOOR = f"""def Mesh "Floor" {{
    {SQUARE.replace("1", "9").replace("[9,", "[1,").replace("[0, 9, 2, 3]", "[0, 1, 2, 3]")}
    color3f[] primvars:displayColor = [(0.1, 0.1, 0.1)] (interpolation = "constant")
    double3 xformOp:translate = (0, 0, -1)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""
FLOOR_SEEN = ((0.1, 0.1, 0.1), -1.0)
RED = 'color3f[] primvars:displayColor = [(0.8, 0, 0)] (interpolation = "constant")\n'
RED_SEEN = ((0.8, 0.0, 0.0), 0.0)


@dataclass(frozen=True)
class Picture:
    """A drawn stage."""

    scene: FlatScene
    view: View
    light: F64

    def seen(self, x: float, y: float, z: float) -> tuple[F64, float, int]:
        """Tell what the pixel shows that looks at a point: color, height [m] and instance id."""
        (u, v), _ = (rows[0] for rows in project(np.array([[x, y, z]]), CAMERA, self.scene.cameras[0].poses[0]))
        row, column = int(v), int(u)
        ids = np.concatenate([[0], self.scene.draws.instance])
        draw = self.view.draw[row, column]
        return self.light[row, column], 8.0 - float(self.view.depth[row, column]), int(ids[draw])


def take(gl: Gl, settings: RenderSettings, folder: Path, *bodies: str, quality: str = "fast") -> Picture:
    """Write a stage with camera and floor, read it as the renderer does, and draw it."""
    path = write_stage(folder, EYE + FLOOR + "\n".join(bodies), Z_UP)
    scene = load_scene(path, folder=folder / "cache")
    prepared = prepare(gl, scene, settings.model_copy(update={"quality": quality, "normals": False}), SILENT)
    view = prepared.painter(CAMERA, sharp=True).draw(scene.cameras[0].poses[0], 0.1)
    return Picture(scene, view, (view.code.astype(np.float64) / 65535) ** 2 * 16.0)


def mesh(more: str, name: str = "M", points: str = SQUARE) -> str:
    """Write a red square of 2 x 2 m, or another mesh."""
    return f'def Mesh "{name}" {{\n{points}{RED}{more}\n}}\n'


def moved(op: str) -> str:
    """Write one transform."""
    name = op.split(" = ")[0].split(" ")[1]
    return f'{op}\nuniform token[] xformOpOrder = ["{name}"]\n'


NOTCHED = """
    point3f[] points = [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (0, -1, 0), (-2, 2, 0)]
    int[] faceVertexCounts = [5]
    int[] faceVertexIndices = [0, 1, 2, 3, 4]
    uniform token subdivisionScheme = "none"
"""
CAGE = """
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)]
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [3, 2, 1, 0, 4, 5, 6, 7, 0, 1, 5, 4, 1, 2, 6, 5, 2, 3, 7, 6, 3, 0, 4, 7]
"""
STRIP = """
    point3f[] points = [(-1, -1, 0), (0, -1, 0), (1, -1, 0), (-1, 1, 0), (0, 1, 0), (1, 1, 0)]
    int[] faceVertexCounts = [4, 4]
    int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4]
    uniform token subdivisionScheme = "none"
"""
BLUE = """def Material "Blue" {
    token outputs:surface.connect = </Blue/S.outputs:surface>
    def Shader "S" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0, 0, 0.6)
        token outputs:surface
    }
}
"""
BLUE_SEEN = ((0.0, 0.0, 0.6), 0.0)
SUBSET = """def GeomSubset "Right" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    uniform token elementType = "face"
    uniform token familyName = "materialBind"
    int[] indices = [1]
    rel material:binding = </Blue>
}"""
PROTOTYPE = f'class "Proto" {{\n{mesh("")}}}\n'
INSTANCES = PROTOTYPE + "".join(
    f'def Xform "I{name}" (instanceable = true\n references = </Proto>) {{\n'
    f"{moved(f'double3 xformOp:translate = ({x}, 0, 0)')}}}\n"
    for name, x in (("a", -2), ("b", 2))
)
INSTANCER = f"""def PointInstancer "Many" {{
    point3f[] positions = [(-2, 0, 0), (2, 0, 0), (0, 9, 0)]
    int[] protoIndices = [0, 0, 0]
    rel prototypes = </Many/P>
    int64[] invisibleIds = [2]
    uniform int[] falsework:component:instanceIds = [7, 8, 9]
    def Xform "P" {{
        {mesh("")}
    }}
}}
"""
LEFT = 'uniform token orientation = "leftHanded"\nuniform bool doubleSided = 0'
VERTEX_COLORS = """color3f[] primvars:displayColor = [(0, 0, 0), (0.8, 0, 0), (0.8, 0, 0), (0, 0, 0)] (
    interpolation = "vertex")"""
SHAPES: dict[str, tuple[str, list[tuple[Point, tuple[Color | None, float]]]]] = {
    "concave polygon": (mesh("", points=NOTCHED), [((0, 0, -1), FLOOR_SEEN), ((-1.5, 0, 0), RED_SEEN)]),
    "face subsets": (BLUE + mesh(SUBSET, points=STRIP), [((-0.5, 0, 0), RED_SEEN), ((0.5, 0, 0), BLUE_SEEN)]),
    "negative scale": (mesh(moved("float3 xformOp:scale = (-2, 1, 1)")), [((1.5, 0, 0), RED_SEEN)]),
    "left-handed": (mesh(LEFT, points=SQUARE.replace("[0, 1, 2, 3]", "[3, 2, 1, 0]")), [((0, 0, 0), RED_SEEN)]),
    "cage": (
        mesh('uniform token subdivisionScheme = "none"', points=CAGE),
        [((0, 0, 1), ((0.8, 0, 0), 1.0)), ((0.9, 0.9, 1), (None, 1.0))],
    ),
    "instances": (INSTANCES, [((-2, 0, 0), RED_SEEN), ((2, 0, 0), RED_SEEN), ((0, 0, -1), FLOOR_SEEN)]),
    "point instancer": (INSTANCER, [((-2, 0, 0), RED_SEEN), ((2, 0, 0), RED_SEEN), ((0, 0, -1), FLOOR_SEEN)]),
    "purpose guide": (mesh('uniform token purpose = "guide"'), [((0, 0, -1), FLOOR_SEEN)]),
    "purpose proxy": (mesh('uniform token purpose = "proxy"'), [((0, 0, -1), FLOOR_SEEN)]),
    "purpose render": (mesh('uniform token purpose = "render"'), [((0, 0, 0), RED_SEEN)]),
    "invisible": (mesh('token visibility = "invisible"'), [((0, 0, -1), FLOOR_SEEN)]),
    "colours of vertices": (
        mesh(VERTEX_COLORS).replace(RED, ""),
        [((-0.9, 0, 0), ((0.04, 0, 0), 0.0)), ((0.5, 0, 0), ((0.6, 0, 0), 0.0))],
    ),
    "native shape": (f'def Cube "C" {{\ndouble size = 2\n{RED}}}\n', [((0, 0, 1), ((0.8, 0, 0), 1.0))]),
}


@pytest.mark.parametrize("name", SHAPES)
def test_shapes(name: str, gl: Gl, ideal: RenderSettings, tmp_path: Path, record_proof: RecordProof) -> None:
    """Color and depth of a pixel or two of each kind of geometry."""
    body, expected = SHAPES[name]
    picture = take(gl, ideal, tmp_path, body, DOME)
    off = [0.0]
    for point, (color, height) in expected:
        light, seen, number = picture.seen(*point)
        if color is not None:
            np.testing.assert_allclose(light, color, atol=0.02)
            off.append(float(np.abs(light - color).max()))
        assert seen == pytest.approx(height, abs=1e-5)
        assert number > 0
    if name == "point instancer":
        assert [picture.seen(x, 0, 0)[2] for x in (-2, 2)] == [7, 8]
    depth = max(abs(picture.seen(*point)[1] - height) for point, (_, height) in expected)
    record_proof(
        f"any stage: {name}", len(expected), 0, {"greatest_color_error": max(off), "greatest_depth_error_m": depth}
    )


def surface(body: str) -> str:
    """Take the texture coordinates of a square from 0 to 1."""
    return body.replace("(3,3)", "(1,1)")


IMAGE = 'def Shader "I" {{\nuniform token info:id = "ND_image_{}"\nasset inputs:file = @./{}.png@\n{} outputs:out\n}}\n'
ORANGE = "diffuseColor = (0.6, 0.3, 0.1)"
STRANGER = network("").replace("UsdPreviewSurface", "StrangerSurface")
DETAIL = """asset falsework:detail:texture = @./white.png@
        uniform float[] falsework:detail:periods = [0.5]
        uniform float[] falsework:detail:amplitudes = [0.2]
        asset falsework:detail:macroTexture = @./quarter.png@"""
CUT = "color3f inputs:diffuseColor.connect = </Mat/A.outputs:rgb>\nfloat inputs:opacity.connect = </Mat/A.outputs:a>\n"
TINTED = "color3f inputs:diffuse_tint = (0.5, 1, 1)\nasset inputs:diffuse_texture = @./sides.png@"
SIDES = [((-0.5, 0, 0), (0.8, 0, 0)), ((0.5, 0, 0), (0, 0, 0.8))]
GRAY = (0.5, 0.5, 0.5)
MATERIALS: dict[str, tuple[str, list[tuple[Point, Color]], int]] = {
    "preview constant": (network(f"color3f inputs:{ORANGE}"), [((0, 0, 0), (0.6, 0.3, 0.1))], 0),
    "preview texture": (
        network(
            "color3f inputs:diffuseColor.connect = </Mat/A.outputs:rgb>",
            texture("A", "./sides.png")
            .replace("(0.25, 0.5)", "(1, 1)")
            .replace("rotation = 30", "rotation = 0")
            .replace("(0.1, 0.2)", "(0, 0)"),
        ),
        SIDES,
        0,
    ),
    "preview texture, turned by UsdTransform2d": (
        network(
            "color3f inputs:diffuseColor.connect = </Mat/A.outputs:rgb>",
            texture("A", "./sides.png")
            .replace("(0.25, 0.5)", "(1, 1)")
            .replace("rotation = 30", "rotation = 90")
            .replace("(0.1, 0.2)", "(0, 0)"),
        ),
        [((0, 0.5, 0), (0.8, 0, 0)), ((0, -0.5, 0), (0, 0, 0.8))],
        0,
    ),
    "cut-out": (
        network(
            CUT + "float inputs:opacityThreshold = 0.5",
            texture("A", "./leaf.png")
            .replace("(0.25, 0.5)", "(1, 1)")
            .replace("rotation = 30", "rotation = 0")
            .replace("(0.1, 0.2)", "(0, 0)"),
        ),
        [((-0.5, 0, -1), FLOOR_SEEN[0]), ((0.5, 0, 0), (0.8, 0.8, 0.8))],
        0,
    ),
    "detail": (network(f"color3f inputs:{ORANGE}", "", DETAIL), [((0, 0, 0), (0.36, 0.18, 0.06))], 0),
    "displayColor": (mesh(""), [((0, 0, 0), (0.8, 0, 0))], 0),
    "OmniPBR constant": (
        omni(f"color3f inputs:{ORANGE.replace('diffuseColor', 'diffuse_color_constant')}"),
        [((0, 0, 0), (0.6, 0.3, 0.1))],
        0,
    ),
    "OmniPBR texture": (surface(omni(TINTED)), [((-0.5, 0, 0), (0.4, 0, 0)), ((0.5, 0, 0), (0, 0, 0.8))], 0),
    "standard_surface constant": (
        standard("float inputs:base = 0.5\ncolor3f inputs:base_color = (0.6, 0.4, 0.2)"),
        [((0, 0, 0), (0.3, 0.2, 0.1))],
        0,
    ),
    "standard_surface texture": (
        surface(
            standard(
                "color3f inputs:base_color.connect = </Mat/I.outputs:out>", IMAGE.format("color3", "sides", "color3f")
            )
        ),
        SIDES,
        0,
    ),
    "unknown": (STRANGER, [((0, 0, 0), GRAY)], 1),
    "unknown with displayColor": (STRANGER.replace(SQUARE, SQUARE + RED), [((0, 0, 0), (0.8, 0, 0))], 1),
    "missing texture": (
        network("color3f inputs:diffuseColor.connect = </Mat/A.outputs:rgb>", texture("A", "./gone.png")),
        [((0, 0, 0), GRAY)],
        1,
    ),
}


def write_pictures(folder: Path) -> None:
    """Write red left of blue, a leaf whose left half is not there, white, and a quarter of it."""
    coded = round(255 * (1.055 * 0.8 ** (1 / 2.4) - 0.055))
    sides, leaf = np.zeros((64, 64, 3), np.uint8), np.full((64, 64, 4), coded, np.uint8)
    sides[:, :32, 2], sides[:, 32:, 0] = coded, coded  # OpenCV: blue, green, red
    leaf[..., 3] = np.repeat([[0] * 32 + [255] * 32], 64, axis=0)
    white, quarter = np.full((16, 16), 255, np.uint8), np.full((16, 16, 3), 64, np.uint8)
    for name, pixels in (("sides", sides), ("leaf", leaf), ("white", white), ("quarter", quarter)):
        cv2.imwrite(str(folder / f"{name}.png"), pixels)


@pytest.mark.parametrize("name", MATERIALS)
def test_materials(name: str, gl: Gl, ideal: RenderSettings, tmp_path: Path, record_proof: RecordProof) -> None:
    """Color of a pixel or two of each kind of material; the unknown costs one warning and is drawn all the same."""
    write_pictures(tmp_path)
    body, expected, warned = MATERIALS[name]
    picture = take(gl, ideal, tmp_path, body, DOME)
    assert len([line for line in picture.scene.warnings if "parts have no material" not in line]) == warned
    off = [np.abs(picture.seen(*point)[0] - color).max() for point, color in expected]
    assert max(off) <= 0.02
    record_proof(f"any stage: material, {name}", len(expected), 0, {"greatest_color_error": float(max(off))})


TURN = "float3 xformOp:rotateXYZ = {}"
SUN = 'def DistantLight "Sun" {{\nfloat inputs:intensity = 3\nbool inputs:normalize = 1\n{}}}\n'
LAMP = 'def SphereLight "Lamp" {{\nfloat inputs:radius = 0.1\nfloat inputs:intensity = 40\n{}}}\n'
CARD = network(f"color3f inputs:{ORANGE}\nfloat inputs:roughness = 1")
LIGHTS: dict[str, tuple[str, float]] = {
    "DistantLight": (SUN.format(moved(TURN.format("(60, 0, 0)"))), 3 * 0.5 / np.pi),
    "DomeLight": ('def DomeLight "Sky" {\nfloat inputs:intensity = 0.5\nfloat inputs:exposure = 1\n}\n', 1.0),
    "SphereLight": (LAMP.format(moved("double3 xformOp:translate = (0, 0, 2)")), 40 * (0.1 / 2) ** 2),
}


@pytest.mark.parametrize("name", LIGHTS)
def test_lights(name: str, gl: Gl, ideal: RenderSettings, tmp_path: Path, record_proof: RecordProof) -> None:
    """Radiance of a matt card under each kind of light, in closed form."""
    body, radiance = LIGHTS[name]
    picture = take(gl, ideal, tmp_path, CARD, body)
    ratio = picture.seen(0, 0, 0)[0] / (np.array([0.6, 0.3, 0.1]) * radiance)
    np.testing.assert_allclose(ratio, 1.0, atol=0.01)
    record_proof(f"any stage: light, {name}", 1, 0, {"greatest_relative_error": float(np.abs(ratio - 1).max())})
    assert not [line for line in picture.scene.warnings if "Light" in line]


def flat_picture(path: Path, value: tuple[int, int, int]) -> None:
    """Write a picture of one color: red, green, blue."""
    cv2.imwrite(str(path), np.full((16, 16, 3), value[::-1], np.uint8))


@pytest.mark.parametrize("quality", ["standard", "fine"])
def test_normal_map_and_roughness_map_act_as_what_they_say(
    quality: str, gl: Gl, ideal: RenderSettings, tmp_path: Path
) -> None:
    """A map that says 20 degrees shades as a card turned by 20 degrees; a map of 0.4 shines as a constant of 0.4."""
    lean = np.deg2rad(20.0)
    coded = [round(127.5 * (1 + value)) for value in (np.sin(lean), 0.0, np.cos(lean))]
    flat_picture(tmp_path / "lean.png", (coded[0], coded[1], coded[2]))
    flat_picture(tmp_path / "rough.png", (0, 102, 0))
    sun = SUN.format(moved(TURN.format("(0, 40, 0)")))
    maps = "normal3f inputs:normal.connect = </Mat/N.outputs:rgb>\n"
    maps += "float inputs:roughness.connect = </Mat/R.outputs:g>\n"
    placed = texture("N", "./lean.png").replace("rotation = 30", "rotation = 0") + texture("R", "./rough.png")
    base = f"color3f inputs:{ORANGE}\n"
    mapped = take(gl, ideal, tmp_path, surface(network(base + maps, placed)), sun, quality=quality)
    turned = network(base + "float inputs:roughness = 0.4").replace(SQUARE, SQUARE + moved(TURN.format("(0, 20, 0)")))
    plain = take(gl, ideal, tmp_path, turned, sun, quality=quality)
    level = take(gl, ideal, tmp_path, network(base + "float inputs:roughness = 0.4"), sun, quality=quality)
    light, expected, other = (picture.seen(0, 0, 0)[0] for picture in (mapped, plain, level))
    np.testing.assert_allclose(light, expected, rtol=0.02)
    assert np.abs(other / expected - 1).max() > 0.1
    assert expected[2] > 1.3 * 0.1 * 3 * np.cos(lean) / np.pi  # it shines
