"""What a stage says and nobody reads: one line a kind, and none for a stage that says no such thing."""

from pathlib import Path

import pytest

from tests.conftest import RecordProof
from tests.usd_schemas.stages import SQUARE, read_body

MESH = f'def Mesh "M" {{\n{SQUARE}}}\n'
FAMILY = f"""def Xform "{{}}" (
    prepend apiSchemas = ["GeomModelAPI"]
    kind = "component"
) {{{{
    uniform token model:drawMode = "cards"
    def Mesh "M" {{{{
{SQUARE}}}}}
}}}}
"""
FAR = """def Camera "{}" {{
    float2 clippingRange = (0.1, {})
    double3 xformOp:translate = (0, 0, 9)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""
SAID = {
    "drawMode": (
        FAMILY.format("A") + FAMILY.format("B"),
        "/A: model:drawMode cards is left out: its geometry is drawn (and 1 more)",
    ),
    "light linking": (
        MESH + 'def DistantLight "Sun" {\n rel collection:lightLink:excludes = </M>\n}\n',
        "/Sun: lightLink is left out: the light shines on everything",
    ),
    "shadow linking": (
        MESH + 'def DistantLight "Sun" {\n uniform bool collection:shadowLink:includeRoot = 0\n}\n',
        "/Sun: shadowLink is left out: the light is shadowed by everything",
    ),
    "mesh light": (
        MESH.replace('"M"', '"M" (prepend apiSchemas = ["MeshLightAPI"])'),
        "/M: MeshLightAPI is left out: the mesh is drawn, but emits no light",
    ),
    "volume": (MESH + 'def Volume "Smoke" {}\n', "/Smoke: Volume is not drawn"),
    "curves": (MESH + 'def BasisCurves "Hair" {}\n', "/Hair: BasisCurves without width is not drawn"),
    "displayOpacity": (
        MESH.replace(SQUARE, SQUARE + "float[] primvars:displayOpacity = [0.5]\n"),
        "/M: displayOpacity is left out: drawn opaque",
    ),
    "refraction": (
        MESH
        + 'def Shader "S" {\n uniform token info:id = "UsdPreviewSurface"\n float inputs:ior = 2.4\n'
        + " float inputs:metallic = 0.5\n}\n",
        "/S: ior is left out: drawn as 1.5",
    ),
    "shine of a light": (
        MESH + 'def DistantLight "Sun" {\n float inputs:specular = 0\n}\n',
        "/Sun: inputs:specular is left out",
    ),
    "focus": (MESH + 'def Camera "C" {\n float fStop = 2.8\n}\n', "/C: fStop is left out: everything is sharp"),
    "far plane": (
        MESH + FAR.format("C", 8.0) + FAR.format("D", 10.0) + FAR.format("E", 8.5),
        "/C: its far clipping plane is left out: what lies beyond is drawn (and 1 more)",
    ),
    "boundary": (
        MESH.replace('"none"', '"catmullClark"\n token interpolateBoundary = "none"'),
        "/M: interpolateBoundary none is read as edgeAndCorner: the faces at its boundary are drawn",
    ),
    "shutter": (
        MESH + 'def Camera "C" {\n double shutter:open = -0.25\n double shutter:close = 0.25\n}\n',
        "/C: the shutter's interval is left out: there is no motion blur",
    ),
}


@pytest.mark.parametrize("name", SAID)
def test_what_is_left_out_is_said(name: str, tmp_path: Path, record_proof: RecordProof) -> None:
    """One line, which names the first prim and counts the others."""
    body, line = SAID[name]
    said = read_body(tmp_path, body).warnings
    assert line in said
    record_proof(f"left out and said: {name}", 1, 0, {"lines": said.count(line)})


def test_nothing_is_said_of_a_plain_stage(tmp_path: Path) -> None:
    """A mesh, a light and a camera that say nothing unusual cost no line of this kind."""
    plain = 'def Shader "S" {\n uniform token info:id = "UsdPreviewSurface"\n float inputs:ior = 1.5\n}\n'
    plain += plain.replace('"S"', '"Gem"').replace("1.5", "2.4")
    scene = read_body(tmp_path, MESH + 'def DistantLight "Sun" {}\ndef Camera "C" {}\n' + plain)
    assert scene.warnings == ("1 parts have no material: drawn in displayColor or gray",)
