"""Validation: a sound scene has no findings; each fault, in whatever variant, is found and named."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade

from authoring.layers.surveys import camera_path
from authoring.scenes.validate import surfaces, validate_scene
from groundwork.errors import InputError
from tests.authoring.box_scene import write_box_scene

CAP = "/World/Bridge/BridgeGeom/Substructure/Pier_001_Cap"
DECK = "/World/Bridge/BridgeGeom/Superstructure/Deck_000"
CAMERA = camera_path("global")


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write one sound scene to copy from."""
    return write_box_scene(tmp_path_factory.mktemp("sound")).parent


@pytest.fixture
def scene(sound: Path, tmp_path: Path) -> Path:
    """Copy the sound scene, free to be spoilt."""
    shutil.copytree(sound, tmp_path / "scene")
    return tmp_path / "scene/scene.usda"


def test_sound_scene_has_no_findings(sound: Path) -> None:
    """USD's validators and ours are silent in every variant."""
    assert validate_scene(sound / "scene.usda") == []


def test_prototypes_are_no_surfaces(sound: Path) -> None:
    """The walk meets the instancer, and not what stands below it."""
    paths = [str(prim.GetPath()) for prim in surfaces(Usd.Stage.Open(str(sound / "scene.usda")))]
    assert any(path.endswith("Railing_R_Posts") for path in paths)
    assert not any("Prototype" in path for path in paths)


def _unknown_class(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath(DECK).GetAttribute("semantics:labels:class").Set(["decking"])


def _wrong_class(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath(DECK).GetAttribute("semantics:labels:class").Set(["girder"])


def _unlabeled(stage: Usd.Stage) -> None:
    UsdGeom.Cube.Define(stage, "/World/Bridge/BridgeGeom/Superstructure/Loose")


def _no_faces(stage: Usd.Stage) -> None:
    body = UsdGeom.Mesh(stage.GetPrimAtPath(DECK))
    body.GetFaceVertexCountsAttr().Set([])
    body.GetFaceVertexIndicesAttr().Set([])


def _same_id(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath(DECK).GetAttribute("falsework:component:instanceId").Set(2)


def _same_id_as_a_repeat(stage: Usd.Stage) -> None:
    stage.GetPrimAtPath(DECK).GetAttribute("falsework:component:instanceId").Set(23)


def _same_name(stage: Usd.Stage) -> None:
    UsdGeom.Xform.Define(stage, "/World/Site/Deck_000")


def _half_sample(stage: Usd.Stage) -> None:
    (operation,) = UsdGeom.Camera(stage.GetPrimAtPath(CAMERA)).GetOrderedXformOps()
    operation.Set(Gf.Matrix4d(1.0), 0.5)


def _other_lens(stage: Usd.Stage) -> None:
    UsdGeom.Camera(stage.GetPrimAtPath(CAMERA)).GetFocalLengthAttr().Set(0.2401)


def _broken_kind(stage: Usd.Stage) -> None:
    Usd.ModelAPI(stage.GetPrimAtPath("/World/Bridge/BridgeGeom")).SetKind("subcomponent")


def _binding_without_schema(stage: Usd.Stage) -> None:
    prim = UsdGeom.Xform.Define(stage, "/World/Site/Bare").GetPrim()
    prim.CreateRelationship("material:binding").SetTargets(["/World/Bridge/BridgeLooks/Role_CapConcrete"])


def _unknown_shader(stage: Usd.Stage) -> None:
    UsdShade.Shader.Define(stage, "/World/Bridge/BridgeLooks/Stray/Loose").CreateIdAttr("NoSuchShader")


def test_faces_that_move_with_time_are_faces(scene: Path) -> None:
    """A mesh whose faces are given at a time, as animations are, is not empty."""
    stage = Usd.Stage.Open(str(scene))
    stage.SetEditTarget(Sdf.Layer.FindOrOpen(str(scene.parent / "edits/user.usda")))
    body = UsdGeom.Mesh(stage.GetPrimAtPath(DECK))
    for attribute in (body.GetFaceVertexCountsAttr(), body.GetFaceVertexIndicesAttr(), body.GetPointsAttr()):
        value = attribute.Get()
        attribute.Set(Sdf.ValueBlock())
        attribute.Set(value, 1.0)
    stage.Save()
    assert not [line for line in validate_scene(scene) if "without faces" in line]


@pytest.mark.parametrize(
    ("spoil", "expected"),
    [
        (_unknown_class, f"{DECK}: class 'decking' is not in the class table"),
        (_wrong_class, f"{DECK}: component 'deck_slab' belongs to class 'deck', not 'girder'"),
        (_unlabeled, "/World/Bridge/BridgeGeom/Superstructure/Loose: has no component label"),
        (_no_faces, f"{DECK}: a mesh without faces"),
        (_same_id, "instance id 2: used by 2 prims"),
        (_same_id_as_a_repeat, "instance id 23: used by 2 prims"),
        (_same_name, "prim name Deck_000: used 2 times"),
        (_half_sample, f"{CAMERA}: time samples are not 0 to N - 1"),
        (_other_lens, f"{CAMERA}: lens"),
        (_broken_kind, "/World/Bridge/BridgeGeom/Superstructure: kind 'component' below a prim that is not a group"),
        (_binding_without_schema, "[MissingMaterialBindingAPI]"),
        (_unknown_shader, "NoSuchShader"),
    ],
)
def test_each_fault_is_named(scene: Path, spoil: Callable[[Usd.Stage], None], expected: str) -> None:
    """A fault written into the user's layer is found, wherever it stands."""
    stage = Usd.Stage.Open(str(scene))
    stage.SetEditTarget(Sdf.Layer.FindOrOpen(str(scene.parent / "edits/user.usda")))
    spoil(stage)
    stage.GetEditTarget().GetLayer().Export(str(scene.parent / "edits/user.usda"))  # not atomic: a test's own file
    del stage
    assert any(expected in line for line in validate_scene(scene))


def test_fault_in_a_variant_names_it(scene: Path) -> None:
    """What is wrong in a look that is not selected is found, with the look's name, and once only."""
    look = scene.parent / "bridge/looks/clean/look.usda"
    look.write_text(look.read_text().replace('"UsdPreviewSurface"', '"NoSuchSurface"'))  # not atomic: a test's own file
    findings = validate_scene(scene)
    assert findings
    assert all(line.endswith("(look=clean)") for line in findings)
    assert len(set(findings)) == len(findings)


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ("/etc/hostname", "must start with ./ and have no .."),
        ("../outside.png", "must start with ./ and have no .."),
        ("./a/../../outside.png", "must start with ./ and have no .."),
        ("https:x.png", "must start with ./ and have no .."),
        ("./textures/gone.png", "there is no such file"),
    ],
)
def test_paths_stay_inside(scene: Path, path: str, expected: str) -> None:
    """A texture path that leaves the scene, or leads nowhere, is found in a look that is not selected."""
    look = scene.parent / "bridge/looks/clean/look.usda"
    layer = Sdf.Layer.FindOrOpen(str(look))
    surface = layer.GetPrimAtPath("/Look/Role_CapConcrete/Surface")
    Sdf.AttributeSpec(surface, "inputs:file", Sdf.ValueTypeNames.Asset).default = Sdf.AssetPath(path)
    layer.Save()  # not atomic: a test's own file
    findings = validate_scene(scene)
    assert any(expected in line and "bridge/looks/clean/look.usda" in line for line in findings)


def test_missing_layer_is_found(scene: Path) -> None:
    """A survey whose file is gone is named."""
    (scene.parent / "surveys/global.usdc").unlink()
    assert any("surveys/surveys.usda: ./global.usdc: there is no such file" in line for line in validate_scene(scene))


def test_no_stage_is_bad_input(tmp_path: Path) -> None:
    """A file that is not USD is an error of the user's."""
    (tmp_path / "scene.usda").write_text("not a stage")  # not atomic: a test's own file
    with pytest.raises(InputError, match="not readable as a USD stage"):
        validate_scene(tmp_path / "scene.usda")
