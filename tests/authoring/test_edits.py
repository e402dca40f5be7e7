"""Edits of a DCC come home as a sparse layer: what was changed, no more, and where it belongs."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt

from authoring.edits.additions import Labeling
from authoring.edits.harvest import EDITS, Harvest, harvest_edits
from authoring.edits.shapes import flat_normals, read_surface
from authoring.layers.layer import export
from authoring.layers.root import edits_layer
from authoring.scenes.validate import validate_scene
from authoring.surveys.existing import existing_flight
from authoring.surveys.settings import StageSettings
from groundwork.errors import InputError
from groundwork.files import MANIFEST
from tests.authoring.box_scene import write_box_scene
from usd_schemas.reading.lights import read_lights
from usd_schemas.reading.stage_reader import read_stage

F64 = NDArray[np.float64]

SUBSTRUCTURE = "/World/Bridge/BridgeGeom/Substructure"
CAP, DECK = f"{SUBSTRUCTURE}/Pier_001_Cap", "/World/Bridge/BridgeGeom/Superstructure/Deck_000"


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write one scene to copy from."""
    return write_box_scene(tmp_path_factory.mktemp("original")).parent


@pytest.fixture
def scene(original: Path, tmp_path: Path) -> Path:
    """Copy the scene, free to be edited."""
    shutil.copytree(original, tmp_path / "scene")
    return tmp_path / "scene/scene.usda"


@pytest.fixture
def other(scene: Path, tmp_path: Path) -> Usd.Stage:
    """Open what a DCC would save: one layer with everything in it."""
    Usd.Stage.Open(str(scene)).Flatten(False).Export(str(tmp_path / "other.usda"))
    return Usd.Stage.Open(str(tmp_path / "other.usda"))


def bring_home(scene: Path, other: Usd.Stage, *labels: str, remove: bool = False) -> tuple[Harvest, str]:
    """Save and harvest; give what was found, and the layer's text."""
    other.GetRootLayer().Save()
    found = harvest_edits(Path(other.GetRootLayer().realPath), scene, Labeling.parse(labels), remove)
    return found, (scene.parent / EDITS).read_text(encoding="utf-8")


def cube(stage: Usd.Stage, path: str) -> UsdGeom.Mesh:
    """Add a mesh of one triangle."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    mesh.CreateFaceVertexCountsAttr([3])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2])
    mesh.CreateDoubleSidedAttr(True)
    return mesh


def test_no_edits_give_an_empty_layer(scene: Path, other: Usd.Stage, tmp_path: Path) -> None:
    """Noise of single precision is no edit."""
    for prim in other.GetPrimAtPath(SUBSTRUCTURE).GetChildren():
        ops = UsdGeom.Xformable(prim).GetOrderedXformOps()
        ops[0].Set(ops[0].Get() + Gf.Vec3d(2e-5))
    found, text = bring_home(scene, other)
    assert found == Harvest()
    export(edits_layer(), tmp_path / "empty.usda")
    assert text == (tmp_path / "empty.usda").read_text(encoding="utf-8")


def test_a_moved_group_is_one_opinion(scene: Path, other: Usd.Stage) -> None:
    """Its members move along, and only the one that moved on its own besides is named."""
    group = UsdGeom.Xformable(other.GetPrimAtPath(SUBSTRUCTURE))
    group.AddTranslateOp().Set(Gf.Vec3d(0, 0, 2))
    op = UsdGeom.Xformable(other.GetPrimAtPath(CAP)).GetOrderedXformOps()[0]
    op.Set(op.Get() + Gf.Vec3d(0.5, 0, 0))
    before = _place(scene)
    found, _ = bring_home(scene, other)
    assert found.moved == ["Substructure", "Pier_001_Cap"]
    np.testing.assert_allclose(_place(scene) - before, [0.5, 0.0, 2.0], atol=1e-9)
    assert validate_scene(scene) == []


def test_a_turned_sun_comes_home(scene: Path, other: Usd.Stage) -> None:
    """Its direction and strength reach what is rendered, though another sun was added before it."""
    sun = UsdLux.DistantLight(other.GetPrimAtPath("/World/Environment/Sun"))
    sun.AddRotateXYZOp().Set(Gf.Vec3f(30.0, -20.0, 15.0))
    sun.GetIntensityAttr().Set(2.5)
    expected = read_lights(other, np.eye(4), print).sun
    UsdLux.DistantLight.Define(other, "/Another")
    other.GetRootLayer().pseudoRoot.nameChildrenOrder = ["Another", "World"]
    found, _ = bring_home(scene, other)
    assert (found.moved, found.lights) == (["Sun"], {"Another": "DistantLight"})
    home = read_lights(Usd.Stage.Open(str(scene)), np.eye(4), lambda line: None).sun
    assert home is not None
    assert expected is not None
    np.testing.assert_allclose(home.direction, expected.direction, atol=1e-6)
    np.testing.assert_allclose(home.radiance, [2.5] * 3, rtol=1e-6)
    assert bring_home(scene, other)[0].moved == ["Sun"]
    assert validate_scene(scene) == []


def test_new_cameras_and_lamps_come_home(scene: Path, tmp_path: Path) -> None:
    """From a file in centimeters with y up: each pose, the lens and the lamp in meters with z up; and gone with it."""
    file = tmp_path / "centimetres.usda"
    _write_centimeters(scene, file, lamp=True)
    found = harvest_edits(file, scene, Labeling())
    assert (found.cameras, found.lights, found.moved) == ({"Drone": 3}, {"Lamp": "SphereLight"}, [])
    assert found.left_out == ["global_Camera: the file has no such Camera: it is kept"]
    assert validate_scene(scene) == []
    flat = read_stage(scene)
    (track,) = [camera for camera in flat.cameras if camera.name == "Drone"]
    np.testing.assert_allclose(track.poses[:, :3, 3], [[5.0 + step, -30.0, 8.0] for step in range(3)], atol=1e-9)
    forward = np.tile([0.0, 1.0, 0.0], (3, 1))  # along -z of a y-up world
    np.testing.assert_allclose(track.poses[:, :3, 2], forward, atol=1e-9)
    np.testing.assert_allclose(track.poses[:, :3, 1], [[0.0, 0.0, -1.0]] * 3, atol=1e-9)
    lens = (track.lens.focal_length, track.lens.horizontal_aperture, track.lens.vertical_aperture, track.near)
    assert lens == pytest.approx((0.35, 0.36, 0.24, 0.5))
    stage = Usd.Stage.Open(str(scene))
    lamp = stage.GetPrimAtPath("/World/Environment/Lamp")
    place = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(lamp)).T
    np.testing.assert_allclose(place[:3, 3], [1.0, -3.0, 2.0], atol=1e-9)
    assert UsdLux.SphereLight(lamp).GetRadiusAttr().Get() * np.cbrt(np.linalg.det(place[:3, :3])) == pytest.approx(0.1)
    assert lamp.HasAPI(UsdLux.ShapingAPI)
    flown = existing_flight(StageSettings(kind="stage", prim="Drone", width=600), flat)
    np.testing.assert_array_equal(flown.poses, track.poses)
    assert (flown.calibration.fx, flown.calibration.height) == pytest.approx((600 * 35 / 36, 400))
    before = (scene.parent / EDITS).read_bytes()
    harvest_edits(file, scene, Labeling())
    assert (scene.parent / EDITS).read_bytes() == before
    _write_centimeters(scene, file, lamp=False)
    assert harvest_edits(file, scene, Labeling()).lights == {}
    assert not Usd.Stage.Open(str(scene)).GetPrimAtPath("/World/Environment/Lamp")


def test_a_moved_survey_camera_is_a_flight_of_its_own(scene: Path, other: Usd.Stage) -> None:
    """The survey stays to the bit; what a DCC shows of it, one frame or all, is no edit."""
    before = {camera.name: camera for camera in read_stage(scene).cameras}
    camera = UsdGeom.Camera(other.GetPrimAtPath("/World/Surveys/global/global_Camera"))
    (operation,) = camera.GetOrderedXformOps()
    poses = [operation.Get(code) for code in operation.GetTimeSamples()]
    operation.GetAttr().Clear()
    operation.Set(poses[3])
    assert bring_home(scene, other)[0] == Harvest()
    for code, pose in enumerate(poses):
        operation.Set(pose * Gf.Matrix4d().SetTranslate(Gf.Vec3d(0, 0, 5)), code)
    found, _ = bring_home(scene, other)
    assert (found.cameras, found.moved) == ({"global_Camera_2": len(poses)}, [])
    after = {camera.name: camera for camera in read_stage(scene).cameras}
    np.testing.assert_array_equal(after["global"].poses, before["global"].poses)
    lifted = before["global"].poses + np.pad([[0.0], [0.0], [5.0], [0.0]], ((0, 0), (3, 0)))
    np.testing.assert_allclose(after["global_Camera_2"].poses, lifted, atol=1e-8)
    assert after["global_Camera_2"].lens == before["global"].lens
    assert validate_scene(scene) == []


def test_deletions_are_told_and_made_on_demand(scene: Path, other: Usd.Stage) -> None:
    """Without the flag the part stays; with it, it is inactive, and nothing of it is lost."""
    other.RemovePrim(CAP)
    found, text = bring_home(scene, other)
    assert (found.missing, found.removed) == (["Pier_001_Cap"], [])
    assert "active" not in text
    found, _ = bring_home(scene, other, remove=True)
    assert (found.missing, found.removed) == ([], ["Pier_001_Cap"])
    assert not Usd.Stage.Open(str(scene)).GetPrimAtPath(CAP).IsActive()
    assert validate_scene(scene) == []


def test_new_objects_keep_their_ids(scene: Path, other: Usd.Stage) -> None:
    """Labeled by rule, else by themselves, else background; numbered apart from all others, and for good."""
    cube(other, "/World/Alpha")
    cube(other, "/World/Beta").GetPrim().CreateAttribute("userProperties:component", Sdf.ValueTypeNames.String).Set(
        "kerb"
    )
    cube(other, "/World/Gamma")
    found, _ = bring_home(scene, other, "Al*=vehicle")
    assert found.added == {"Alpha": "vehicle", "Beta": "kerb", "Gamma": "background"}
    assert validate_scene(scene) == []
    numbers = _ids(scene)
    other.RemovePrim("/World/Alpha")
    cube(other, "/World/Aaron")
    bring_home(scene, other)
    again = _ids(scene)
    assert {name: again[name] for name in ("Beta", "Gamma")} == {name: numbers[name] for name in ("Beta", "Gamma")}
    assert again["Aaron"] not in numbers.values()


def test_what_no_dcc_brings_back_stays(scene: Path, other: Usd.Stage) -> None:
    """Opinions of an earlier session about light and other looks survive a harvest."""
    layer = Sdf.Layer.FindOrOpen(str(scene.parent / EDITS))
    for path in ("/World/Environment/Sun", "/World/Bridge{look=elsewhere}BridgeLooks/Role_PierConcrete"):
        spec = Sdf.CreatePrimInLayer(layer, path)
        Sdf.AttributeSpec(spec, "custom:note", Sdf.ValueTypeNames.String).default = f"kept {path}"
    layer.Save()
    _, text = bring_home(scene, other)
    assert text.count("kept /World") == 2


def test_wrong_input_is_named(scene: Path, other: Usd.Stage, tmp_path: Path) -> None:
    """Labels that are none, files of another scene, scenes without an edits layer, stored scenes."""
    with pytest.raises(InputError, match=r"--label: no such component or class \(found 'Box=tree_house'\)"):
        Labeling.parse(["Box=tree_house"])
    strange = Usd.Stage.CreateNew(str(tmp_path / "strange.usda"))
    cube(strange, "/Thing")
    with pytest.raises(InputError, match="has no prim with a userProperties:falseworkId"):
        bring_home(scene, strange)
    with pytest.raises(InputError, match="has no sublayer"):
        harvest_edits(tmp_path / "strange.usda", tmp_path / "strange.usda", Labeling())
    (scene.parent / MANIFEST).write_text("{}", encoding="utf-8")
    with pytest.raises(InputError, match="scene checkout"):
        bring_home(scene, other)


@pytest.mark.parametrize("interpolation", ["vertex", "uniform", "constant", "faceVarying"])
def test_values_of_any_interpolation_are_spread_over_the_corners(interpolation: str) -> None:
    """A square of two triangles: each interpolation gives the corner what it stands for."""
    stage = Usd.Stage.CreateInMemory()
    mesh = UsdGeom.Mesh.Define(stage, "/M")
    mesh.CreatePointsAttr([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    mesh.CreateFaceVertexCountsAttr([3, 3])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 2, 3, 0])
    rows = {"vertex": [0, 1, 2, 2, 3, 0], "uniform": [0, 0, 0, 1, 1, 1], "constant": [0] * 6, "faceVarying": range(6)}
    expected = list(rows[interpolation])
    values = np.arange((max(expected) + 1) * 2, dtype=np.float32).reshape(-1, 2)
    primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, interpolation)
    primvar.Set(Vt.Vec2fArray.FromNumpy(values))
    surface = read_surface(mesh.GetPrim())
    np.testing.assert_array_equal(surface.uvs["st"], values[expected])
    np.testing.assert_array_equal(flat_normals(surface), np.tile(np.array([0, 0, 1], np.float32), (6, 1)))


def test_a_disconnected_color_is_an_edit_inside_the_look(scene: Path, other: Usd.Stage) -> None:
    """The selected look has it; every other look is as it was."""
    stage = Usd.Stage.Open(str(scene))
    material = next(prim for prim in other.Traverse() if prim.IsA(UsdShade.Material) and "Role_" in prim.GetName())
    surface = UsdShade.Material(material).ComputeSurfaceSource()[0]
    surface.GetInput("diffuseColor").ClearSources()
    surface.GetInput("diffuseColor").Set(Gf.Vec3f(0.5, 0.25, 0.125))
    found, text = bring_home(scene, other)
    assert found.recoloured == [material.GetName()]
    look = stage.GetPrimAtPath("/World/Bridge").GetVariantSet("look").GetVariantSelection()
    layer = Sdf.Layer.OpenAsAnonymous(str(scene.parent / EDITS))
    spec = layer.GetPrimAtPath(
        f"/World/Bridge{{look={look}}}BridgeLooks/{material.GetName()}/{surface.GetPrim().GetName()}"
    )
    assert spec.attributes["inputs:diffuseColor"].default == Gf.Vec3f(0.5, 0.25, 0.125)
    assert text.count("diffuseColor") <= 2


def _write_centimeters(scene: Path, file: Path, *, lamp: bool) -> None:
    """Write the scene as one layer under a y-up root in centimeters, with a camera of three poses and a lamp."""
    flat = Usd.Stage.Open(str(scene)).Flatten(False)
    stage = Usd.Stage.CreateNew(str(file)) if not file.exists() else Usd.Stage.Open(str(file))
    stage.GetRootLayer().Clear()
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    root = UsdGeom.Xform.Define(stage, "/dcc")
    root.AddTransformOp().Set(Gf.Matrix4d(100, 0, 0, 0, 0, 0, -100, 0, 0, 100, 0, 0, 0, 0, 0, 1))
    Sdf.CopySpec(flat, "/World", stage.GetRootLayer(), "/dcc/World")
    for added in ("/dcc/World/Surveys", "/dcc/World/Environment/Lamp"):
        stage.RemovePrim(added)
    camera = UsdGeom.Camera.Define(stage, "/Drone")
    for name, value in (("Focal", 35.0), ("Horizontal", 36.0), ("Vertical", 24.0)):
        attribute = f"Create{name}{'Length' if name == 'Focal' else 'Aperture'}Attr"
        getattr(camera, attribute)(value)
    camera.CreateClippingRangeAttr(Gf.Vec2f(50.0, 1e5))
    move = camera.AddTranslateOp()
    for step in range(3):
        move.Set(Gf.Vec3d(500 + 100 * step, 800, 3000), 1 + step)
    if lamp:
        light = UsdLux.SphereLight.Define(stage, "/Lamp")
        light.CreateRadiusAttr(10.0)
        light.AddTranslateOp().Set(Gf.Vec3d(100, 200, 300))
        UsdLux.ShapingAPI.Apply(light.GetPrim())
    stage.GetRootLayer().Save()  # not atomic: a test's own file


def _place(scene: Path) -> F64:
    stage = Usd.Stage.Open(str(scene))
    return np.array(UsdGeom.XformCache().GetLocalToWorldTransform(stage.GetPrimAtPath(CAP)))[3, :3]


def _ids(scene: Path) -> dict[str, int]:
    stage = Usd.Stage.Open(str(scene))
    root = stage.GetPrimAtPath("/World/Additions")
    named = ((prim, prim.GetAttribute("falsework:component:instanceId").Get()) for prim in root.GetChildren())
    return {prim.GetName(): number for prim, number in named if number}


def test_a_normal_that_a_dcc_lost_is_no_edit(scene: Path, other: Usd.Stage) -> None:
    """On slivers Blender writes normals of nearly no length: they are the former ones, beside one that was bent."""
    path = f"{SUBSTRUCTURE}/Pier_001_Cap"
    own = UsdGeom.Mesh(other.GetPrimAtPath(path)).GetNormalsAttr()
    before = np.array(own.Get())
    lost = before.copy()
    lost[3] = (-4.8e-5, 4.8e-6, 0)
    own.Set(Vt.Vec3fArray.FromNumpy(lost))
    assert bring_home(scene, other)[0] == Harvest()
    lost[0] = (0.6, 0.0, -0.8)
    own.Set(Vt.Vec3fArray.FromNumpy(lost))
    assert bring_home(scene, other)[0].reshaped == ["Pier_001_Cap"]
    home = Usd.Stage.Open(str(scene))
    after = np.array(UsdGeom.Mesh(home.GetPrimAtPath(path)).GetNormalsAttr().Get())
    np.testing.assert_allclose(after[0], (0.6, 0.0, -0.8), atol=1e-6)
    np.testing.assert_array_equal(after[1:], before[1:])
