"""MaterialX documents: translated to where stages look for them, guarded like layers, and part of the cache's key."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from groundwork.errors import InputError
from tests.conftest import RecordProof
from tests.usd_schemas.stages import SQUARE, write_stage
from usd_schemas.flat_scene import Material, Texture
from usd_schemas.guard.guard import check_stage
from usd_schemas.reading.mtlx import named_files, read_document, translate
from usd_schemas.reading.scene_cache import load_scene
from usd_schemas.reading.stage_reader import read_stage

HEAD = '<?xml version="1.0"?>\n<materialx version="1.38" colorspace="lin_rec709"{}>\n{}\n</materialx>\n'
GRAPH = """<nodegraph name="NG">
  <constant name="tint" type="color3"><input name="value" type="color3" value="0.5, 1, 0.25"/></constant>
  <texcoord name="uv" type="vector2"/>
  <place2d name="place" type="vector2">
    <input name="texcoord" type="vector2" nodename="uv"/>
    <input name="pivot" type="vector2" value="0.5, 0.5"/><input name="scale" type="vector2" value="2, 4"/>
    <input name="rotate" type="float" value="30"/><input name="offset" type="vector2" value="0.25, -0.125"/>
  </place2d>
  <image name="color" type="color3">
    <input name="file" type="filename" value="a.png" colorspace="srgb_texture"/>
    <input name="texcoord" type="vector2" nodename="place"/>
    <input name="uaddressmode" type="string" value="mirror"/><input name="vaddressmode" type="string" value="clamp"/>
  </image>
  <multiply name="tinted" type="color3">
    <input name="in1" type="color3" nodename="color"/><input name="in2" type="color3" nodename="tint"/>
  </multiply>
  <tiledimage name="rough" type="float">
    <input name="file" type="filename" value="b.png"/><input name="uvtiling" type="vector2" value="3, 5"/>
    <input name="uvoffset" type="vector2" value="0.5, 0.25"/>
  </tiledimage>
  <image name="bump" type="vector3"><input name="file" type="filename" value="c.png"/></image>
  <normalmap name="normals" type="vector3"><input name="in" type="vector3" nodename="bump"/></normalmap>
  <output name="color_out" type="color3" nodename="tinted"/>
  <output name="rough_out" type="float" nodename="rough"/>
  <output name="normal_out" type="vector3" nodename="normals"/>
</nodegraph>
<standard_surface name="S" type="surfaceshader">
  <input name="base" type="float" value="1"/>
  <input name="base_color" type="color3" nodegraph="NG" output="color_out"/>
  <input name="specular_roughness" type="float" nodegraph="NG" output="rough_out"/>
  <input name="normal" type="vector3" nodegraph="NG" output="normal_out"/>
  <input name="metalness" type="float" value="0.75"/>
</standard_surface>
<surfacematerial name="Tiles" type="material">
  <input name="surfaceshader" type="surfaceshader" nodename="S"/>
</surfacematerial>
"""
GLTF = """<gltf_pbr name="G" type="surfaceshader">
  <input name="base_color" type="color3" value="0.8, 0.4, 0.2"/><input name="metallic" type="float" value="0.5"/>
  <input name="roughness" type="float" value="0.25"/><input name="emissive" type="color3" value="0.1, 0.2, 0.3"/>
  <input name="alpha" type="float" value="0.4"/><input name="alpha_mode" type="integer" value="2"/>
</gltf_pbr>
<surfacematerial name="Paint" type="material">
  <input name="surfaceshader" type="surfaceshader" nodename="G"/>
</surfacematerial>
"""
STAGE = """def Scope "Looks" (
    references = @./{}@</MaterialX/Materials>
) {{
}}
def Mesh "M" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
    rel material:binding = </Looks/{}>
{}}}
"""


def write_document(folder: Path, body: str, more: str = "", name: str = "look.mtlx") -> Path:
    """Write a document, and the pictures that it may name."""
    for picture in ("a", "b", "c"):
        cv2.imwrite(str(folder / f"{picture}.png"), np.full((4, 4, 3), 128, np.uint8))
    path = folder / name
    path.write_text(HEAD.format(more, body), encoding="utf-8")
    return path


def material_of(folder: Path, name: str) -> tuple[Material, tuple[str, ...]]:
    """Read the one material of a stage that takes it from the document."""
    scene = read_stage(write_stage(folder, STAGE.format("look.mtlx", name, SQUARE)))
    return scene.materials[scene.draws.material[0]], scene.warnings


def test_a_network_comes_through(tmp_path: Path, record_proof: RecordProof) -> None:
    """Images, tiling, placement, tint, normal map, address modes and constants are those of the document."""
    write_document(tmp_path, GRAPH)
    material, said = material_of(tmp_path, "Tiles")
    assert said == ()
    assert material.metallic == 0.75
    assert material.base_texture is not None
    assert material.base_texture.wrap == ("mirror", "clamp")
    assert material.base_texture.srgb
    assert material.base_texture.gain == (0.5, 1.0, 0.25)
    # place2d: about the pivot divide by the scale, turn clockwise, subtract the offset.
    place, turn = material.base_texture, np.deg2rad(-30.0)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    worst = 0.0
    for point in ([0.0, 0.0], [1.0, 0.0], [0.3, 0.9]):
        wanted = rotation @ ((np.array(point) - 0.5) / [2, 4]) - [0.25, -0.125] + 0.5
        angle = np.deg2rad(place.rotation)
        own = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        apart = np.abs(own @ (np.array(point) * place.scale) + place.translation - wanted).max()
        assert apart < 1e-12
        worst = max(worst, float(apart))
    rough, normal = Texture(str(tmp_path / "b.png"), False), Texture(str(tmp_path / "c.png"), False)
    assert material.roughness_texture is not None
    assert (material.roughness_texture.file, material.roughness_texture.scale) == (rough.file, (3.0, 5.0))
    assert material.roughness_texture.translation == (-0.5, -0.25)
    assert material.normal_texture == normal
    record_proof("materialx: placement of a picture in a .mtlx", 3, 0, {"worst_texture_coordinate": worst})


def test_prims_lie_where_other_programs_put_them(tmp_path: Path) -> None:
    """Materials below /MaterialX/Materials with their surface inside, node graphs below /MaterialX/NodeGraphs."""
    layer = translate(read_document(write_document(tmp_path, GRAPH)))
    assert layer.defaultPrim == "MaterialX"
    for path in (
        "/MaterialX/Materials/Tiles",
        "/MaterialX/Materials/Tiles/ND_standard_surface_surfaceshader",
        "/MaterialX/Materials/Tiles/NG/color",
        "/MaterialX/NodeGraphs/NG/color",
    ):
        assert layer.GetPrimAtPath(path), path


def test_gltf_surfaces(tmp_path: Path) -> None:
    """gltf_pbr with constants: color, metallic, roughness, emission, and blended alpha."""
    write_document(tmp_path, GLTF)
    material, said = material_of(tmp_path, "Paint")
    assert said == ()
    assert material.base_color == pytest.approx((0.8, 0.4, 0.2))
    assert (material.metallic, material.roughness, material.opacity) == pytest.approx((0.5, 0.25, 0.4))
    assert material.emissive == pytest.approx((0.1, 0.2, 0.3))
    assert material.blends


def test_nothing_is_included(tmp_path: Path) -> None:
    """An XInclude is not followed, and said."""
    write_document(tmp_path, GLTF.replace("Paint", "Hidden"), name="other.mtlx")
    include = '<xi:include href="other.mtlx"/>'
    write_document(tmp_path, include + GLTF, ' xmlns:xi="http://www.w3.org/2001/XInclude"')
    _, said = material_of(tmp_path, "Paint")
    assert said == ("./look.mtlx: the files that it includes are not read",)
    hidden, said = material_of(tmp_path, "Hidden")
    assert hidden.name == "fallback"


def test_documents_and_their_pictures_are_guarded(tmp_path: Path) -> None:
    """A picture outside the folder of the stage is refused by name; a broken document is named with its fault."""
    folder = tmp_path / "stage"
    folder.mkdir()
    (tmp_path / "secret.png").write_bytes(b"x")
    for escape in ("../secret.png", str(tmp_path / "secret.png"), "ftp:a.png"):
        document = write_document(folder, GRAPH.replace('"a.png"', f'"{escape}"'))
        assert escape in named_files(read_document(document))
        path = write_stage(folder, STAGE.format("look.mtlx", "Tiles", SQUARE))
        with pytest.raises(InputError, match=r"look\.mtlx"):
            check_stage(path, (), print)
    (folder / "look.mtlx").write_text("<materialx><a>")
    with pytest.raises(InputError, match="not readable as MaterialX"):
        check_stage(path, (), print)
    write_document(folder, GRAPH)
    check_stage(path, (), pytest.fail)


def test_a_document_is_part_of_the_key_of_the_cache(tmp_path: Path) -> None:
    """A scene is kept, and read anew when the document changes; its origin is the same in another folder."""
    origins = []
    for name in ("one", "two"):
        folder = tmp_path / name
        folder.mkdir()
        write_document(folder, GLTF)
        path = write_stage(folder, STAGE.format("look.mtlx", "Paint", SQUARE))
        origins.append(load_scene(path, folder=tmp_path / "cache").origin)
    assert origins[0] == origins[1]
    assert len(list((tmp_path / "cache").glob("*.scene"))) == 1
    write_document(tmp_path / "two", GLTF.replace("0.8, 0.4, 0.2", "0.1, 0.1, 0.1"))
    scene = load_scene(path, folder=tmp_path / "cache")
    assert scene.origin != origins[0]
    assert scene.materials[scene.draws.material[0]].base_color == pytest.approx((0.1, 0.1, 0.1))
    assert path.read_text().count("look.mtlx") == 1


def test_a_name_that_usd_cannot_write_is_refused(tmp_path: Path) -> None:
    """MaterialX reads an input of any name; USD writes identifiers alone, and the error is one line of some length."""
    path = write_document(tmp_path, GLTF.replace('"metallic"', f'"metal{"[" * 9000}"'))
    with pytest.raises(InputError, match=r"look\.mtlx: cannot be written as USD: .*invalid name") as told:
        translate(read_document(path))
    assert len(str(told.value)) < 3100
