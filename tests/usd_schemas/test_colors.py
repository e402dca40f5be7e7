"""Colors without a material: those of instances, of instancers, and of primvars that a shader names."""

from pathlib import Path

import numpy as np
import pytest

from tests.usd_schemas.stages import SQUARE, read_body
from usd_schemas.flat_scene import FlatScene

RED, GREEN, BLUE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
SQUARE_MESH = f'def Mesh "M" {{\n{SQUARE}\n%s\n}}\n'


def drawn(scene: FlatScene) -> list[tuple[float, ...]]:
    """List the color of each draw, whether a material or the vertices hold it."""
    geometry, found = scene.geometry, []
    for part, row in zip(scene.draws.part.tolist(), scene.draws.material.tolist(), strict=True):
        material = scene.materials[row]
        first = geometry.triangles[geometry.part_first[part]][0]
        found.append(tuple(geometry.colors[first].tolist()) if material.use_display_color else material.base_color)
    return found


def colored(value: str, interpolation: str = "constant") -> str:
    """Write a displayColor."""
    return f'color3f[] primvars:displayColor = [{value}] (interpolation = "{interpolation}")'


def test_each_instance_has_its_own_color(tmp_path: Path) -> None:
    """Instances of one mesh wear the displayColor of their own roots, and share its vertices; none stands for gray."""
    body = 'class "Proto" {\n' + SQUARE_MESH % "" + "}\n"
    for name, color in (("A", "(1, 0, 0)"), ("B", "(0, 1, 0)"), ("C", "")):
        own = colored(color) if color else ""
        body += f'def Xform "{name}" (instanceable = true\n references = </Proto>) {{\n{own}\n}}\n'
    scene = read_body(tmp_path, body)
    assert drawn(scene) == [RED, GREEN, (0.5, 0.5, 0.5)]
    assert len(scene.geometry.part_first) == 1


def test_a_color_of_the_mesh_itself_wins(tmp_path: Path) -> None:
    """A mesh in an instance keeps its own displayColor."""
    body = 'class "Proto" {\n' + SQUARE_MESH % colored("(0, 0, 1)") + "}\n"
    body += f'def Xform "A" (instanceable = true\n references = </Proto>) {{\n{colored("(1, 0, 0)")}\n}}\n'
    assert drawn(read_body(tmp_path, body)) == [BLUE]


INSTANCER = """def PointInstancer "P" {
    point3f[] positions = [(0, 0, 0), (3, 0, 0), (6, 0, 0)]
    int[] protoIndices = [0, 0, 0]
    int64[] ids = [7, 8, 9]
    int64[] invisibleIds = [%s]
    rel prototypes = [</P/M>]
    %s
    def Mesh "M" {%s
    %s
    }
}
"""


def test_instancers_color_what_they_place(tmp_path: Path) -> None:
    """Each place has its own color, hidden places take none away, and one color serves all."""
    three = colored("(1, 0, 0), (0, 1, 0), (0, 0, 1)", "vertex")
    assert drawn(read_body(tmp_path, INSTANCER % ("", three, SQUARE, ""))) == [RED, GREEN, BLUE]
    assert drawn(read_body(tmp_path, INSTANCER % ("8", three, SQUARE, ""))) == [RED, BLUE]
    assert drawn(read_body(tmp_path, INSTANCER % ("", colored("(0, 1, 0)"), SQUARE, ""))) == [GREEN] * 3
    own = colored("(1, 0, 0)")
    assert drawn(read_body(tmp_path, INSTANCER % ("", three, SQUARE, own))) == [RED] * 3
    scene = read_body(tmp_path, INSTANCER % ("", colored("(1, 0, 0), (0, 1, 0)", "vertex"), SQUARE, ""))
    assert any("does not fit the instances" in line for line in scene.warnings)


def test_many_colors_are_kept_to_a_shade(tmp_path: Path) -> None:
    """More colors of instances than are kept: each is within a thirtieth of its own."""
    colors = np.random.default_rng(1).random((5000, 3)).astype(np.float32)
    rows = ", ".join(f"({r}, {g}, {b})" for r, g, b in colors.tolist())
    places = ", ".join(f"({n}, 0, 0)" for n in range(5000))
    body = INSTANCER % ("", colored(rows, "vertex"), SQUARE, "")
    body = body.replace("(0, 0, 0), (3, 0, 0), (6, 0, 0)", places).replace("[0, 0, 0]", str([0] * 5000))
    body = body.replace("int64[] ids = [7, 8, 9]", "")
    scene = read_body(tmp_path, body)
    assert np.abs(np.array(drawn(scene)) - colors).max() <= 0.5 / 15 + 1e-6
    assert len(scene.materials) <= 2 + 4096


READER = """def Material "Mat" {
    token outputs:surface.connect = </Mat/S.outputs:surface>
    def Shader "S" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </Mat/P.outputs:result>
        token outputs:surface
    }
    def Shader "P" {
        uniform token info:id = "UsdPrimvarReader_float3"
        string inputs:varname = "Col"
        float3 inputs:fallback = (0, 0, 1)
        float3 outputs:result
    }
}
def Mesh "M" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    rel material:binding = </Mat>
"""


@pytest.mark.parametrize(
    ("interpolation", "values"),
    [
        ("constant", "(1, 0, 0)"),
        ("uniform", "(1, 0, 0)"),
        ("vertex", "(1, 0, 0), (1, 0, 0), (1, 0, 0), (1, 0, 0)"),
        ("faceVarying", "(1, 0, 0), (1, 0, 0), (1, 0, 0), (1, 0, 0)"),
    ],
)
def test_shaders_read_colors_of_any_name(interpolation: str, values: str, tmp_path: Path) -> None:
    """A surface that reads the primvar Col shows it, not displayColor; where it is missing, the reader's fallback."""
    other = colored("(0, 1, 0)")
    own = f'color3f[] primvars:Col = [{values}] (interpolation = "{interpolation}")'
    assert drawn(read_body(tmp_path, READER + SQUARE + other + "\n" + own + "\n}\n")) == [RED]
    assert drawn(read_body(tmp_path, READER + SQUARE + other + "\n}\n")) == [BLUE]
