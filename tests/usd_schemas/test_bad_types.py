"""Whatever type an artist's file gives an attribute, the rest of the stage is read, and the prim is named."""

from pathlib import Path

import pytest

from tests.conftest import RecordProof
from tests.usd_schemas.stages import SQUARE, area, read_body

GOOD = f'def Mesh "Good" {{\n{SQUARE}\n}}\n'
VALUES = {
    "float2[]": "[(1, 2), (3, 4), (5, 6)]",
    "float3[]": "[(1, 2, 3), (0, 0, 1)]",
    "float3": "(1, 2, 3)",
    "float[]": "[1, 2, 3, 4]",
    "int[]": "[7, -1]",
    "double": "3.5",
    "string": '"no"',
    "string[]": '["no", "neither"]',
    "bool": "true",
    "matrix4d": "((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))",
    "asset": "@nowhere.png@",
}
MESH = (
    "points",
    "faceVertexCounts",
    "faceVertexIndices",
    "normals",
    "primvars:normals",
    "primvars:st",
    "primvars:displayColor",
    "doubleSided",
    "orientation",
    "subdivisionScheme",
    "holeIndices",
    "visibility",
    "xformOp:translate",
    "cornerIndices",
    "creaseIndices",
    "creaseLengths",
    "creaseSharpnesses",
    "extent",
    "purpose",
)
SHAPES = {"Sphere": "radius", "Cube": "size", "Cone": "height", "Cylinder": "axis", "Plane": "width"}
OTHERS = {
    "Camera": ("focalLength", "horizontalAperture", "clippingRange", "projection", "falsework:cal:fx"),
    "DistantLight": ("inputs:intensity", "inputs:color", "inputs:angle", "inputs:normalize", "inputs:exposure"),
    "DomeLight": ("inputs:intensity", "inputs:color", "inputs:texture:file", "inputs:texture:format"),
    "SphereLight": ("inputs:intensity", "inputs:radius", "inputs:normalize"),
    "PointInstancer": ("positions", "protoIndices", "orientations", "invisibleIds", "scales", "ids"),
    "RenderProduct": ("resolution", "dataWindowNDC", "aspectRatioConformPolicy", "pixelAspectRatio"),
}


@pytest.mark.parametrize("name", MESH)
def test_a_mesh_of_wrong_types_costs_itself(name: str, tmp_path: Path, record_proof: RecordProof) -> None:
    """For every attribute of a mesh and every wrong type of it, the mesh beside it is drawn whole."""
    least = float("inf")
    for kind, value in VALUES.items():
        own = "\n".join(line for line in SQUARE.splitlines() if f" {name} =" not in line)
        order = 'uniform token[] xformOpOrder = ["xformOp:translate"]' if name.startswith("xformOp") else ""
        scene = read_body(tmp_path, f'{GOOD}def Mesh "Bad" {{\n{own}\n{kind} {name} = {value}\n{order}\n}}\n')
        least = min(least, float(area(scene)))
        assert least >= 4.0, f"{kind} {name}"
    record_proof(f"bad types: {name} of a mesh", len(VALUES), 0, {"least_area_of_the_sound_mesh_m2": least})


@pytest.mark.parametrize(("kind", "value"), VALUES.items())
def test_points_of_another_type_are_named(kind: str, value: str, tmp_path: Path) -> None:
    """A mesh whose points are no points is left out by name, with the reason."""
    own = "\n".join(line for line in SQUARE.splitlines() if " points =" not in line)
    scene = read_body(tmp_path, f'{GOOD}def Mesh "Bad" {{\n{own}\n{kind} points = {value}\n}}\n')
    assert area(scene) == pytest.approx(4.0)
    assert any(line.startswith("/Bad: ") and line.endswith(": not drawn") for line in scene.warnings), scene.warnings


@pytest.mark.parametrize("shape", SHAPES)
def test_a_shape_of_wrong_types_costs_itself(shape: str, tmp_path: Path) -> None:
    """So it is with spheres and the like."""
    for kind, value in VALUES.items():
        scene = read_body(tmp_path, f'{GOOD}def {shape} "Bad" {{\n{kind} {SHAPES[shape]} = {value}\n}}\n')
        assert area(scene) >= 4.0, kind


@pytest.mark.parametrize("prim", OTHERS)
def test_cameras_lights_and_instancers_of_wrong_types_cost_themselves(prim: str, tmp_path: Path) -> None:
    """So it is with cameras, lights, instancers and products."""
    for name in OTHERS[prim]:
        for kind, value in VALUES.items():
            rel = "rel prototypes = </Good>\nint[] protoIndices = [0]\n" if prim == "PointInstancer" else ""
            rel = rel.partition("int[]")[0] if name == "protoIndices" else rel
            rel += "rel camera = </Eye>" if prim == "RenderProduct" else ""
            body = f'{GOOD}def Camera "Eye" {{}}\ndef {prim} "Bad" {{\n{rel}\n{kind} {name} = {value}\n}}\n'
            assert area(read_body(tmp_path, body)) >= 4.0, f"{kind} {name}"


def test_normals_of_another_length_or_type_are_ignored_by_name(tmp_path: Path) -> None:
    """Too few normals, or normals of two numbers, leave a flat mesh and a line."""
    for text in ("normal3f[] normals = [(0, 0, 1)]", "float2[] normals = [(0, 1), (1, 0)]"):
        scene = read_body(tmp_path, f'def Mesh "Bad" {{\n{SQUARE}\n{text}\n}}\n')
        assert area(scene) == pytest.approx(4.0)
        assert any(line.startswith("/Bad: normals ") for line in scene.warnings), scene.warnings


def test_points_that_are_not_finite_cost_their_faces(tmp_path: Path) -> None:
    """One NaN or huge corner takes its own face along, is named, and the other face stays; in a cage, too."""
    for bad in ("nan", "inf", "1e30"):
        for scheme in ("none", "catmullClark"):
            body = f"""def Mesh "M" {{
            point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), ({bad}, 0, 0), (2, 1, 0)]
            int[] faceVertexCounts = [4, 4]
            int[] faceVertexIndices = [0, 1, 2, 3, 1, 4, 5, 2]
            uniform token subdivisionScheme = "{scheme}"
            }}"""
            scene = read_body(tmp_path, body)
            assert area(scene) == pytest.approx(1.0)
            assert any("1 of 2 faces are left out" in line for line in scene.warnings)


@pytest.mark.parametrize("radius", ["inf", "nan", "1e30"])
def test_a_shape_without_a_finite_size_is_left_out(radius: str, tmp_path: Path) -> None:
    """A sphere of infinite radius is named, and the rest of the stage is drawn."""
    scene = read_body(tmp_path, f'{GOOD}def Sphere "Bad" {{\ndouble radius = {radius}\n}}\n')
    assert any("/Bad: its size is not finite: not drawn" in line for line in scene.warnings)
    assert len(scene.draws.part) == 1


def test_what_usd_says_of_a_wrong_type_is_the_cause_alone(tmp_path: Path) -> None:
    """A line about a translation that is a word names no source file of USD."""
    text = 'string xformOp:translate = "x"\nuniform token[] xformOpOrder = ["xformOp:translate"]'
    scene = read_body(tmp_path, f'{GOOD}def Cube "Bad" {{\n{text}\n}}\n')
    line = next(line for line in scene.warnings if line.startswith("/Bad:"))
    assert ".cpp" not in line
    assert "opVal (x)" in line
