"""What a user's file brings into a scene: what its shaders read, mended where that is plain, and nothing by halves."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdMedia, UsdShade

from authoring.scenes.validate import validate_scene
from authoring.variants import foreign_background
from authoring.variants.add import set_choices
from groundwork.errors import InputError
from tests.authoring.small_scene import file_bytes
from tests.conftest import RecordProof
from usd_schemas import tokens
from usd_schemas.reading.stage_reader import read_stage

MODEL = """#usda 1.0
(
    customLayerData = {{
        string author = "A. Artist"
    }}
    defaultPrim = "House"
    metersPerUnit = 1
    upAxis = "Z"
)

def Xform "House" (
    assetInfo = {{
        asset identifier = @./house.usda@
        string name = "house"
        asset[] payloadAssetDependencies = [@./house.usda@]
    }}
    prepend apiSchemas = ["AuthorshipAPI:camera", "GeomModelAPI"]
    kind = "component"
)
{{
    uniform string authorship:camera:digitalSourceType = "digitalCapture"
    uniform asset model:cardTextureXNeg = @./card.png@

    def Xform "Walls" (kind = "{kind}")
    {{
        def Mesh "Wall"
        {{
            int[] faceVertexCounts = [4]
            int[] faceVertexIndices = [0, 1, 2, 3]
            point3f[] points = [(0, 200, 0), (8, 200, 0), (8, 200, 5), (0, 200, 5)]
            rel material:binding = </House/Plaster>
        }}

        def Mesh "Bare"
        {{
            int[] faceVertexCounts = [3]
            int[] faceVertexIndices = [0, 1, 2]
            point3f[] points = [(0, 210, 0), (8, 210, 0), (8, 210, 5)]
            rel material:binding = </Nowhere/Plaster>
        }}
    }}

    def Material "Plaster"
    {{
        token outputs:surface.connect = </House/Plaster/Surface.outputs:surface>

        def Shader "Surface"
        {{
            uniform token info:id = "UsdPreviewSurface"
            float3 inputs:diffuseColor.connect = </House/Plaster/Picture.outputs:rgb>
            float3 inputs:emissiveColor = (0, 0, 0)
            token outputs:surface
        }}

        def Shader "Picture"
        {{
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @./plaster.png@
            float3 outputs:rgb
        }}
    }}

    def DomeLight "Sky"
    {{
        asset inputs:texture:file = @./nowhere.exr@
    }}
}}
"""


def write_model(folder: Path, kind: str = "group") -> Path:
    """Write a town of one referenced model, whose layer has what exporters leave in and out."""
    folder.mkdir()
    for name in ("plaster.png", "card.png", "readme.png"):
        cv2.imwrite(str(folder / name), np.full((4, 4, 3), 90, np.uint8))
    (folder / "house.usda").write_text(MODEL.format(kind=kind), encoding="utf-8")
    stage = Usd.Stage.CreateNew(str(folder / "town.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    town = UsdGeom.Xform.Define(stage, "/Town").GetPrim()
    stage.SetDefaultPrim(town)
    Usd.ModelAPI(town).SetKind("assembly")
    for number in range(2):
        house = stage.DefinePrim(f"/Town/House_{number}", "Xform")
        house.GetReferences().AddReference("./house.usda")
        house.SetInstanceable(number == 1)
        UsdGeom.Xformable(house).AddTranslateOp().Set(Gf.Vec3d(30 * number, 0, 0))
    stage.Save()  # not atomic: a test's own file
    return folder / "town.usda"


def test_a_world_brings_what_its_shaders_read(own_scene: Path, tmp_path: Path, record_proof: RecordProof) -> None:
    """One texture is copied; kinds, extents, types and bindings are mended; the scene is sound and says who made it."""
    lines: list[str] = []
    set_choices(own_scene, {"background": str(write_model(tmp_path / "mine"))}, lines.append)
    place = own_scene.parent / "background/town"
    files = {path.relative_to(place).as_posix() for path in place.rglob("*") if path.is_file()}
    assert files == {"town.usda", "world.usdc", "textures/plaster.png"}
    assert validate_scene(own_scene) == []
    (card,) = [line for line in lines if "cardTextureXNeg" in line]
    assert "(card.png)" in card
    assert any("Sky" in line for line in lines)
    stage = Usd.Stage.Open(str(own_scene))
    ours = UsdMedia.AuthorshipAPI.Get(stage.GetPrimAtPath(tokens.BACKGROUND), "generator")
    assert ours.GetSoftwarePackageAttr().Get() == "falsework"
    assert not ours.GetDigitalSourceTypeAttr().HasAuthoredValue()
    house = stage.GetPrimAtPath(f"{tokens.BACKGROUND}/Background_town/Town/House_0")
    theirs = UsdMedia.AuthorshipAPI.Get(house, "camera")
    assert theirs.GetDigitalSourceTypeAttr().Get() == "digitalCapture"
    assert house.GetAssetInfo() == {"name": "house"}
    assert Usd.ModelAPI(house).GetKind() == "subcomponent"
    walls = [prim for prim in Usd.PrimRange(house) if prim.IsA(UsdGeom.Mesh)]
    assert len(walls) == 2
    for wall in walls:
        mesh = UsdGeom.Mesh(wall)
        np.testing.assert_array_equal(
            mesh.GetExtentAttr().Get(), UsdGeom.PointBased.ComputeExtent(mesh.GetPointsAttr().Get())
        )
    flat = read_stage(own_scene)
    worn = {flat.materials[row].base_texture for row in flat.draws.material}
    assert sum(texture is not None and texture.file.endswith("plaster.png") for texture in worn) == 1
    record_proof("scene set: a world brings what its shaders read", len(files), 0, {"files": len(files)})


def test_the_attribution_of_a_world_stays(own_scene: Path, tmp_path: Path) -> None:
    """What the root layer of the file says about itself is on the scene's copy of it."""
    house = write_model(tmp_path / "mine").with_name("house.usda")
    house.write_text(house.read_text(encoding="utf-8").replace("/Nowhere/", "/House/"), encoding="utf-8")
    set_choices(own_scene, {"background": str(house)}, lambda line: None)
    layer = Sdf.Layer.FindOrOpen(str(own_scene.parent / "background/house/world.usdc"))
    assert layer.customLayerData["author"] == "A. Artist"


def test_a_refused_file_changes_nothing(own_scene: Path, tmp_path: Path) -> None:
    """Neither the look that was asked for in the same breath, nor a file, nor a folder: to the byte."""
    town = write_model(tmp_path / "mine")
    (tmp_path / "mine/plaster.png").unlink()
    before, folders = file_bytes(own_scene.parent), sorted(own_scene.parent.rglob("*"))
    for choices in (
        {"look": "clean", "background": str(town)},
        {"background": str(town), "look": str(_look(tmp_path))},
        {"look": str(_look(tmp_path)), "light": "noon"},
    ):
        with pytest.raises(InputError):
            set_choices(own_scene, choices, lambda line: None)
        assert file_bytes(own_scene.parent) == before
        assert sorted(own_scene.parent.rglob("*")) == folders


def test_an_asset_is_validated_before_it_moves_in(
    own_scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Were the kinds of a world not mended, the scene would not take it, and would stay as it is."""
    monkeypatch.setattr(foreign_background, "correct", lambda layer: None)
    before, folders = file_bytes(own_scene.parent), sorted(own_scene.parent.rglob("*"))
    with pytest.raises(InputError, match=r"would make the scene invalid.*kind 'assembly' below a prim"):
        set_choices(own_scene, {"background": str(write_model(tmp_path / "mine"))}, print)
    assert file_bytes(own_scene.parent) == before
    assert sorted(own_scene.parent.rglob("*")) == folders


def test_a_look_brings_its_own_textures_only(own_scene: Path, tmp_path: Path) -> None:
    """What other materials of the file read stays there; a look of the scene is not overwritten by a name."""
    file = _look(tmp_path)
    set_choices(own_scene, {"look": str(file)}, lambda line: None)
    place = own_scene.parent / "bridge/looks/mine"
    files = {path.relative_to(place).as_posix() for path in place.rglob("*") if path.is_file()}
    assert files == {"look.usda", "textures/a.png"}
    assert validate_scene(own_scene) == []
    with pytest.raises(InputError, match="the name of a look of Falsework"):
        set_choices(own_scene, {"look": str(file.rename(file.with_name("weathered.usda")))}, print)


DOCUMENT = """<?xml version="1.0"?>
<materialx version="1.38">
  <nodegraph name="NG">
    <image name="wall" type="color3">
      <input name="file" type="filename" value="brick.png" colorspace="srgb_texture"/>
    </image>
    <output name="out" type="color3" nodename="wall"/>
  </nodegraph>
  <standard_surface name="S" type="surfaceshader">
    <input name="base_color" type="color3" nodegraph="NG" output="out"/>
  </standard_surface>
  <surfacematerial name="Brick" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="S"/>
  </surfacematerial>
</materialx>
"""


@pytest.mark.parametrize("choice", ["look", "background"])
def test_materialx_documents_come_along(choice: str, own_scene: Path, tmp_path: Path) -> None:
    """A look or a world that names a .mtlx file wears its material in the scene, which has its picture."""
    (tmp_path / "brick.mtlx").write_text(DOCUMENT, encoding="utf-8")
    cv2.imwrite(str(tmp_path / "brick.png"), np.full((4, 4, 3), 90, np.uint8))
    body = (
        'def Scope "Mine" {\ndef Material "Role_DeckConcrete" (references = @./brick.mtlx@</MaterialX/Materials/Brick>'
    )
    body += """) {}
        def Mesh "Wall" (prepend apiSchemas = ["MaterialBindingAPI"]) {
            rel material:binding = </Mine/Role_DeckConcrete>
            point3f[] points = [(0, 300, 0), (9, 300, 0), (9, 300, 9), (0, 300, 9)]
            int[] faceVertexCounts = [4]
            int[] faceVertexIndices = [0, 1, 2, 3]
        }
    }
    """
    head = '#usda 1.0\n(\ndefaultPrim = "Mine"\nmetersPerUnit = 1\nupAxis = "Z"\n)\n'
    (tmp_path / "mine.usda").write_text(head + body, encoding="utf-8")
    set_choices(own_scene, {choice: str(tmp_path / "mine.usda")}, lambda line: None)
    assert validate_scene(own_scene) == []
    (picture,) = own_scene.parent.rglob("brick.png")
    scene = read_stage(own_scene)
    worn = {scene.materials[row].base_texture for row in scene.draws.material}
    assert sum(texture is not None and texture.file == str(picture.resolve()) for texture in worn) >= 1


def test_a_wrong_light_names_the_forms(own_scene: Path) -> None:
    """Names, a date and hour, or a sky: the line says how each is written."""
    with pytest.raises(InputError, match=r"2024-12-21T10:00.*\.hdr"):
        set_choices(own_scene, {"light": "noon"}, print)


def _look(folder: Path) -> Path:
    """Write a file of two textured materials, one of them named like a role, with a light and its picture."""
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    stage.SetDefaultPrim(stage.DefinePrim("/Mine", "Scope"))
    for name, picture in (("Role_DeckConcrete", "a"), ("Wallpaper", "b")):
        cv2.imwrite(str(folder / f"{picture}.png"), np.full((4, 4, 3), 90, np.uint8))
        material = UsdShade.Material.Define(stage, f"/Mine/{name}")
        surface = UsdShade.Shader.Define(stage, f"/Mine/{name}/Surface")
        surface.CreateIdAttr("UsdPreviewSurface")
        reader = UsdShade.Shader.Define(stage, f"/Mine/{name}/Picture")
        reader.CreateIdAttr("UsdUVTexture")
        reader.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(f"./{picture}.png")
        reader.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)
        surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(reader.ConnectableAPI(), "rgb")
        material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
    UsdLux.DomeLight.Define(stage, "/Mine/Sky").CreateTextureFileAttr("./c.exr")
    stage.GetRootLayer().Export(str(folder / "mine.usda"))  # not atomic: a test's own file
    return folder / "mine.usda"
