"""Author, edit in the real Blender, bring the edits home: the layer holds those edits and nothing else."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from pxr import Usd, UsdGeom, UsdShade

from authoring.edits.harvest import EDITS
from authoring.layers.layer import export
from authoring.layers.root import edits_layer
from authoring.scenes.validate import validate_scene
from tests.conftest import RecordProof
from tests.dcc.round_trip import Y_UP_CENTIMETERS, Edit, copy_scene, harvest, opinions, trip
from usd_schemas.reading.stage_reader import read_stage

pytestmark = pytest.mark.dcc

SUBSTRUCTURE, SUPERSTRUCTURE = "/World/Bridge/BridgeGeom/Substructure", "/World/Bridge/BridgeGeom/Superstructure"
PAINTED = "/World/Bridge{look=weathered}BridgeLooks/Role_PierConcrete/Surface"
FOUR_CHANGES: tuple[Edit, ...] = (
    ("move", "Pier_001", [1.5, 0.0, 0.0]),
    ("push_vertex", "Deck_000", 0, [0.0, 0.0, 0.3]),
    ("paint", "Role_PierConcrete", [0.6, 0.1, 0.1]),
    ("add_cube", "Crate", [5.0, -9.0, 6.0], 1.6),
)


@pytest.fixture(scope="module")
def edited(original: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """Make the four changes in Blender."""
    return trip(original, tmp_path_factory.mktemp("edited"), FOUR_CHANGES)


@pytest.fixture(scope="module")
def home(original: Path, edited: tuple[Path, dict[str, Any]], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Bring them into a copy of the scene."""
    scene = copy_scene(original, tmp_path_factory.mktemp("home") / "scene")
    found = harvest(scene, edited[0], "Crate=wing_wall")
    assert found.added == {"Crate": "wing_wall"}
    assert found.missing == []
    return scene


def test_scene_arrives_ready_to_work_in(original: Path, edited: tuple[Path, dict[str, Any]]) -> None:
    """The script sets camera, resolution, rate and range; classes, ids and materials are there to be read."""
    facts, scene = edited[1], read_stage(original)
    assert facts["camera"] == "global_Camera"
    assert facts["size"] == [480, 360, 100]
    assert facts["fps"] == [24, 1.0]
    assert facts["frames"] == [0, len(scene.cameras[0].poses) - 1]
    numbers = {row.path.rsplit("/", 1)[-1]: row for row in scene.instances if row.path.startswith("/World/Bridge/")}
    assert len(numbers) > 50
    for name, row in numbers.items():
        told = facts["properties"][name]
        assert (told["instanceId"], told["class"], told["component"]) == (row.id, row.class_name, row.component)
        assert facts["index"][name] == row.id
        assert facts["materials"][name][0].startswith("Role_")


def test_sky_stands_where_its_sun_is(original: Path, edited: tuple[Path, dict[str, Any]]) -> None:
    """Blender shows the brightest texel of the sky, up and round, where the sun light comes from.

    Blender looks a direction d up in its picture at u = 1/2 - atan2(y, x) / 2 pi and v = 1/2 + asin(z) / pi.
    """
    scene, sky = read_stage(original), edited[1]["sky"]
    assert scene.sun is not None
    assert scene.dome is not None
    assert sky["image"] == Path(scene.dome.file).name
    ((kind, *angles),) = sky["turns"]
    assert kind == "POINT"
    np.testing.assert_allclose(angles[:2], 0.0, atol=1e-6)
    with OpenEXR.File(scene.dome.file) as picture:
        light = picture.channels()["RGB"].pixels.sum(axis=-1)
    row, column = np.unravel_index(light.argmax(), light.shape)
    x, y, z = scene.sun.direction
    u = (0.5 - (np.arctan2(y, x) + angles[2]) / (2 * np.pi)) % 1.0
    v = 0.5 + np.arcsin(z) / np.pi
    assert (column + 0.5) / light.shape[1] == pytest.approx(u, abs=0.01)
    assert 1.0 - (row + 0.5) / light.shape[0] == pytest.approx(v, abs=0.01)


@pytest.mark.parametrize(
    "options",
    [
        pytest.param({}, marks=pytest.mark.proof_only),
        pytest.param({"root_prim_path": ""}, marks=pytest.mark.proof_only),
        {"use_instancing": True},
        pytest.param({"merge_parent_xform": True}, marks=pytest.mark.proof_only),
        Y_UP_CENTIMETERS,
    ],
)
def test_round_trip_without_edits_writes_an_empty_layer(
    options: dict[str, object], original: Path, tmp_path: Path, record_proof: RecordProof
) -> None:
    """Single precision, renamed materials and nested meshes are no edits."""
    scene = copy_scene(original, tmp_path / "scene")
    found = harvest(scene, trip(original, tmp_path / "out", [], **options)[0])
    opinions = {kind: value for kind, value in asdict(found).items() if value}
    assert opinions == {}
    export(edits_layer(), tmp_path / "empty.usda")
    assert (scene.parent / EDITS).read_bytes() == (tmp_path / "empty.usda").read_bytes()
    name = f"stage/dcc: no edits, exported with {', '.join(options) or 'defaults'}: an empty layer"
    record_proof(name, len(read_stage(scene).instances), 7, {"opinions": len(opinions)})


def test_layer_holds_the_four_changes_and_no_other(original: Path, home: Path, record_proof: RecordProof) -> None:
    """Translations of the pier's parts, points of one deck, one color inside the look, one new object."""
    found = opinions(home)
    crate = found.pop("/World/Additions/Crate")
    assert {"points", "xformOp:transform", "semantics:labels:component", "userProperties:falseworkId"} <= crate
    piers = {path for path in found if path.startswith(f"{SUBSTRUCTURE}/Pier_001_")}
    assert len(piers) >= 3
    assert all(found.pop(path) == {"xformOp:translate"} for path in piers)
    assert found == {
        f"{SUPERSTRUCTURE}/Deck_000": {"points", "extent", "normals"},
        PAINTED: {"inputs:diffuseColor"},
    }
    opinions_more = len(found) - 2
    record_proof("stage/dcc: four edits in Blender", 4, 7, {"moved_parts": len(piers), "other_opinions": opinions_more})


def test_edits_have_the_values_of_blender(original: Path, home: Path) -> None:
    """1.5 m along x and not a micrometer elsewhere; one vertex of the deck; the cube where it was put."""
    before, after = (Usd.Stage.Open(str(path)) for path in (original, home))
    for prim in before.GetPrimAtPath(SUBSTRUCTURE).GetChildren():
        old, new = (
            np.array(UsdGeom.Xformable(stage.GetPrimAtPath(prim.GetPath())).GetLocalTransformation())[3, :3]
            for stage in (before, after)
        )
        step = [1.5, 0.0, 0.0] if prim.GetName().startswith("Pier_001") else [0.0, 0.0, 0.0]
        np.testing.assert_allclose(new - old, step, atol=1e-6)
    old, new = (
        np.array(UsdGeom.Mesh(stage.GetPrimAtPath(f"{SUPERSTRUCTURE}/Deck_000")).GetPointsAttr().Get())
        for stage in (before, after)
    )
    assert np.flatnonzero(np.abs(new - old).max(axis=1) > 0).tolist() == [0]
    np.testing.assert_allclose(new[0] - old[0], [0.0, 0.0, 0.3], atol=1e-6)
    box = UsdGeom.BBoxCache(Usd.TimeCode.Default(), ["default"]).ComputeWorldBound(
        after.GetPrimAtPath("/World/Additions/Crate")
    )
    assert np.allclose(box.ComputeAlignedRange().GetMin(), [4.2, -9.8, 5.2], atol=1e-6)
    row = next(row for row in read_stage(home).instances if row.path.endswith("Crate"))
    assert (row.component, row.class_name) == ("wing_wall", "abutment")
    assert row.id not in {other.id for other in read_stage(original).instances}


def test_color_belongs_to_the_look(home: Path, original: Path) -> None:
    """Another look shows its own concrete; switching back shows the edit again."""
    stage, plain = Usd.Stage.Open(str(home)), Usd.Stage.Open(str(original))
    look = stage.GetPrimAtPath("/World/Bridge").GetVariantSet("look")
    assert _color(stage) == pytest.approx((0.6, 0.1, 0.1))
    look.SetVariantSelection("clean")
    plain.GetPrimAtPath("/World/Bridge").GetVariantSet("look").SetVariantSelection("clean")
    assert _color(stage) == _color(plain)
    look.SetVariantSelection("weathered")
    assert _color(stage) == pytest.approx((0.6, 0.1, 0.1))


def test_edited_scene_is_sound_and_harvests_to_the_same_bytes(home: Path, edited: tuple[Path, dict[str, Any]]) -> None:
    """Validation finds nothing in any variant; a second harvest of the same file changes nothing."""
    assert validate_scene(home) == []
    layer = (home.parent / EDITS).read_bytes()
    harvest(home, edited[0], "Crate=wing_wall")
    assert (home.parent / EDITS).read_bytes() == layer


def test_second_session_goes_on_from_the_first(home: Path, tmp_path: Path) -> None:
    """What is opened with edits comes back with them, and with what was done since."""
    scene = copy_scene(home, tmp_path / "scene")
    before = opinions(scene)
    out, _ = trip(scene, tmp_path / "out", [("turn", "Abutment_000_Backwall", [0.0, 0.0, 0.01])])
    harvest(scene, out)
    after = opinions(scene)
    turned = after.pop(f"{SUBSTRUCTURE}/Abutment_000_Backwall")
    assert turned == {"xformOp:transform", "xformOpOrder"}
    assert after == before


def test_every_other_kind_of_edit(original: Path, tmp_path: Path) -> None:
    """Faces, texture coordinates, textures, materials, copies, own labels and deletions; in other units too."""
    scene = copy_scene(original, tmp_path / "scene")
    image = next(scene.parent.glob("site/textures/*albedo.*"))
    other = tmp_path / f"painted{image.suffix}"
    other.write_bytes(image.read_bytes())
    edits: list[Edit] = [
        ("bevel", "Pier_001_Cap"),
        ("subdivide", "Deck_001"),
        ("slide_uv", "Kerb_000_L", "st", 0.25),
        ("repaint", "Role_DeckConcrete", str(other)),
        ("assign_material", "Abutment_000_Wall", "Rust", [0.4, 0.2, 0.1]),
        ("assign_material", "Abutment_002_Wall", "Role_DeckAsphalt", []),
        ("duplicate", "Pier_001_Footing", [0.0, 0.0, -2.0]),
        ("delete", "Coping_000_L"),
        ("add_cube", "Van", [3.0, 0.0, 8.0], 2.0),
        ("say", "Van", "component", "vehicle"),
        ("add_cube", "Rock 1", [0.0, 12.0, 1.0], 2.0),
    ]
    out, _ = trip(original, tmp_path / "out", edits, **Y_UP_CENTIMETERS)
    found = harvest(scene, out)
    assert found.moved == []
    assert found.reshaped == ["Pier_001_Cap", "Deck_001", "Kerb_000_L"]
    assert found.recoloured == ["Role_DeckConcrete", "Abutment_000_Wall", "Abutment_002_Wall"]
    assert found.added == {"Pier_001_Footing_001": "pier_footing", "Rock_1": "background", "Van": "vehicle"}
    assert found.missing == ["Coping_000_L"]
    assert validate_scene(scene) == []
    stage = Usd.Stage.Open(str(scene))
    assert opinions(scene)[f"{SUPERSTRUCTURE}/Kerb_000_L"] == {"primvars:st", "primvars:st:indices"}
    assert _bound(stage, "Abutment_000_Wall") == "Added_Rust"
    assert _bound(stage, "Abutment_002_Wall") == "Role_DeckAsphalt"
    brought = scene.parent / f"edits/textures/Role_DeckConcrete_diffuseColor{image.suffix}"
    assert brought.read_bytes() == image.read_bytes()
    assert stage.GetPrimAtPath("/World/Bridge/BridgeGeom/Furniture/Coping_000_L").IsActive()
    cache = UsdGeom.BBoxCache(Usd.TimeCode.Default(), ["default"])
    van = cache.ComputeWorldBound(stage.GetPrimAtPath("/World/Additions/Van")).ComputeAlignedRange()
    assert np.allclose([van.GetMin(), van.GetMax()], [[2, -1, 7], [4, 1, 9]], atol=1e-4)
    assert harvest(scene, out, remove=True).removed == ["Coping_000_L"]
    assert not Usd.Stage.Open(str(scene)).GetPrimAtPath("/World/Bridge/BridgeGeom/Furniture/Coping_000_L").IsActive()


def _color(stage: Usd.Stage) -> tuple[float, ...] | str:
    surface = UsdShade.Shader(stage.GetPrimAtPath("/World/Bridge/BridgeLooks/Role_PierConcrete/Surface"))
    (source, *_) = surface.GetInput("diffuseColor").GetValueProducingAttributes()
    if UsdShade.Output.IsOutput(source):
        return Path(UsdShade.Shader(source.GetPrim()).GetInput("file").Get().path).name
    return tuple(source.Get())


def _bound(stage: Usd.Stage, name: str) -> str:
    prim = stage.GetPrimAtPath(f"{SUBSTRUCTURE}/{name}")
    return UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0].GetPath().name
