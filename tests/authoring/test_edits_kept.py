"""Nothing that an artist did vanishes: for every kind of edit the scene shows it, or a line names the prim."""

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade

from authoring.edits.additions import Labeling
from authoring.edits.harvest import EDITS, Harvest, harvest_edits
from authoring.scenes.validate import validate_scene
from falsework.commands.edit_verbs import report_lines
from tests.authoring.box_scene import write_box_scene
from tests.conftest import Count, RecordProof
from usd_schemas import tokens
from usd_schemas.reading.shapes import SHAPES
from usd_schemas.reading.stage_reader import read_stage

SUBSTRUCTURE = "/World/Bridge/BridgeGeom/Substructure"
CAP = f"{SUBSTRUCTURE}/Pier_001_Cap"
Rng = np.random.Generator
Edit = Callable[[Usd.Stage, Rng, Path], str]


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


def bring_home(scene: Path, other: Usd.Stage, *labels: str, sound: bool = True) -> tuple[Harvest, list[str]]:
    """Save and harvest; give what was found, and the lines that a user sees."""
    other.GetRootLayer().Save()
    found = harvest_edits(Path(other.GetRootLayer().realPath), scene, Labeling.parse(labels))
    assert not sound or validate_scene(scene) == []
    return found, report_lines({name: getattr(found, name) for name in vars(found)})


def mesh_at(stage: Usd.Stage, path: str) -> UsdGeom.Mesh:
    """Add a square of two triangles."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    mesh.CreateFaceVertexCountsAttr([3, 3])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 0, 2, 3])
    mesh.CreateSubdivisionSchemeAttr("none")
    return mesh


def paint(stage: Usd.Stage, path: str, color: tuple[float, float, float]) -> UsdShade.Material:
    """Add a plain material."""
    material = UsdShade.Material.Define(stage, path)
    surface = UsdShade.Shader.Define(stage, f"{path}/Surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(*color))
    material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
    return material


def bounds(stage: Usd.Stage, path: str) -> np.ndarray:
    """World bounds of a prim [m], shape (2, 3), float64."""
    box = UsdGeom.BBoxCache(Usd.TimeCode.Default(), ["default"]).ComputeWorldBound(stage.GetPrimAtPath(path))
    found = box.ComputeAlignedRange()
    return np.array([found.GetMin(), found.GetMax()])


@pytest.mark.parametrize("kind", SHAPES)
def test_solids_come_home_as_meshes(scene: Path, other: Usd.Stage, kind: str) -> None:
    """Where they stand, as large as they are to the facets of a circle, in their color, with a label and an id."""
    prim = other.DefinePrim(f"/World/My{kind}", kind)
    UsdGeom.Xformable(prim).AddTranslateOp().Set(Gf.Vec3d(3, -40, 7))
    UsdGeom.Gprim(prim).CreateDisplayColorAttr([(0.2, 0.4, 0.6)])
    found, lines = bring_home(scene, other, "My*=vehicle")
    assert found.added == {f"My{kind}": "vehicle"}
    assert lines == [f"added       My{kind} (vehicle)"]
    stage = Usd.Stage.Open(str(scene))
    np.testing.assert_allclose(
        bounds(stage, f"/World/Additions/My{kind}"), bounds(other, f"/World/My{kind}"), atol=0.02
    )
    flat = read_stage(scene)
    (number,) = [row.id for row in flat.instances if row.path.endswith(f"/My{kind}")]
    (row,) = np.flatnonzero(flat.draws.instance == number)
    part = flat.draws.part[row]
    first, count = flat.geometry.part_first[part], flat.geometry.part_count[part]
    corners = flat.geometry.triangles[first : first + count]
    np.testing.assert_allclose(
        flat.geometry.colors[corners].reshape(-1, 3), [[0.2, 0.4, 0.6]] * corners.size, atol=1e-6
    )
    assert flat.materials[flat.draws.material[row]].use_display_color
    points = flat.geometry.positions[corners].astype(np.float64)
    outwards = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    middle = points.reshape(-1, 3).mean(axis=0)
    if kind != "Plane":
        assert np.einsum("ti,ti->t", outwards, points.mean(axis=1) - middle).min() > -1e-9


def test_references_and_instances_come_home(scene: Path, other: Usd.Stage, tmp_path: Path) -> None:
    """Each body of a referenced model, instanced or not, with its materials; labeled by the name of the whole."""
    truck = Usd.Stage.CreateNew(str(tmp_path / "truck.usda"))
    truck.SetDefaultPrim(UsdGeom.Xform.Define(truck, "/Truck").GetPrim())
    for name, color in (("Cab", (0.9, 0.1, 0.1)), ("Box", (0.1, 0.1, 0.9))):
        body = mesh_at(truck, f"/Truck/{name}")
        UsdShade.MaterialBindingAPI.Apply(body.GetPrim()).Bind(paint(truck, f"/Truck/Paint{name}", color))
    truck.Save()  # not atomic: a test's own file
    for number in range(2):
        prim = other.DefinePrim(f"/World/Truck_{number}", "Xform")
        prim.GetReferences().AddReference("./truck.usda")
        prim.SetInstanceable(number == 1)
        UsdGeom.Xformable(prim).AddTranslateOp().Set(Gf.Vec3d(0, -30 - 10 * number, 0))
    found, lines = bring_home(scene, other, "Truck_*=vehicle")
    assert found.added == {"Box": "vehicle", "Box_2": "vehicle", "Cab": "vehicle", "Cab_2": "vehicle"}
    assert found.left_out == []
    assert len(lines) == 1
    flat = read_stage(scene)
    first = {row.path.rpartition("/")[2]: np.flatnonzero(flat.draws.instance == row.id)[:1] for row in flat.instances}
    colors = {
        name: flat.materials[flat.draws.material[rows[0]]].base_color for name, rows in first.items() if len(rows)
    }
    assert colors["Cab_2"] == pytest.approx((0.9, 0.1, 0.1))
    assert colors["Box"] == pytest.approx((0.1, 0.1, 0.9))


def test_faces_keep_the_materials_of_their_own(scene: Path, other: Usd.Stage) -> None:
    """A new mesh of two materials is drawn in both."""
    mesh = mesh_at(other, "/World/Sign")
    for name, faces, color in (("Red", [0], (0.9, 0.0, 0.0)), ("Blue", [1], (0.0, 0.0, 0.9))):
        binding = UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim())
        subset = binding.CreateMaterialBindSubset(name, faces)
        UsdShade.MaterialBindingAPI.Apply(subset.GetPrim()).Bind(paint(other, f"/World/Looks/{name}", color))
    UsdShade.MaterialBindingAPI(mesh).SetMaterialBindSubsetsFamilyType("partition")
    found, _ = bring_home(scene, other)
    assert found.left_out == []
    flat = read_stage(scene)
    (number,) = [row.id for row in flat.instances if row.path.endswith("/Sign")]
    rows = np.flatnonzero(flat.draws.instance == number)
    colors = {flat.materials[material].base_color for material in flat.draws.material[rows]}
    assert {tuple(round(value, 3) for value in color) for color in colors} == {(0.9, 0.0, 0.0), (0.0, 0.0, 0.9)}


def test_what_is_hidden_is_hidden(scene: Path, other: Usd.Stage) -> None:
    """A hidden group is one opinion; its parts are not drawn; shown again, they are."""
    UsdGeom.Imageable(other.GetPrimAtPath(SUBSTRUCTURE)).MakeInvisible()
    found, lines = bring_home(scene, other)
    assert found == Harvest(hidden=["Substructure"])
    assert lines == ["hidden      Substructure"]
    assert not [row for row in read_stage(scene).instances if row.path.startswith(SUBSTRUCTURE)]
    UsdGeom.Imageable(other.GetPrimAtPath(SUBSTRUCTURE)).MakeVisible()
    assert bring_home(scene, other)[0] == Harvest()
    assert [row for row in read_stage(scene).instances if row.path.startswith(SUBSTRUCTURE)]


def test_edits_count_for_the_look_that_the_file_chose(scene: Path, tmp_path: Path) -> None:
    """A file over the scene that chooses another look paints that one, says so, and leaves the scene's choice alone."""
    over = Usd.Stage.CreateNew(str(tmp_path / "over.usda"))
    over.GetRootLayer().TransferContent(Sdf.Layer.FindOrOpen(str(scene)))
    over.GetRootLayer().subLayerPaths = ["./scene/scene.usda"]
    for prim in ("/World/Site", "/World/Bridge", "/World/Background"):
        spec = over.GetRootLayer().GetPrimAtPath(prim)
        spec.referenceList.ClearEdits()
        for name in list(spec.variantSets.keys()):
            del spec.variantSets[name]
    over.GetPrimAtPath(tokens.BRIDGE).GetVariantSet("look").SetVariantSelection("clean")
    surface = UsdShade.Shader(over.GetPrimAtPath(f"{tokens.BRIDGE}/BridgeLooks/Role_PierConcrete/Surface"))
    surface.GetInput("diffuseColor").Set(Gf.Vec3f(0.5, 0.25, 0.125))
    found, _ = bring_home(scene, over)
    assert found.recoloured == ["Role_PierConcrete"]
    assert found.left_out == [
        "look=clean is selected in the file, so the edits apply to it; select it in the scene with: "
        "scene set look=clean"
    ]
    text = (scene.parent / EDITS).read_text(encoding="utf-8")
    assert '"clean" {' in text
    assert '"weathered" {' not in text


def _curve(stage: Usd.Stage, rng: Rng, folder: Path) -> str:
    curve = UsdGeom.BasisCurves.Define(stage, "/World/Rope")
    curve.CreatePointsAttr([tuple(row) for row in rng.random((4, 3)).tolist()])
    curve.CreateCurveVertexCountsAttr([4])
    return "Rope"


def _typed(kind: str) -> Edit:
    def edit(stage: Usd.Stage, rng: Rng, folder: Path) -> str:
        stage.DefinePrim(f"/World/Thing{kind}", kind)
        return f"Thing{kind}"

    return edit


def _instancer(stage: Usd.Stage, rng: Rng, folder: Path) -> str:
    instancer = UsdGeom.PointInstancer.Define(stage, "/World/Fence")
    mesh_at(stage, "/World/Fence/Post")
    instancer.CreatePrototypesRel().SetTargets(["/World/Fence/Post"])
    instancer.CreatePositionsAttr([tuple(row) for row in rng.random((3, 3)).tolist()])
    instancer.CreateProtoIndicesAttr([0, 0, 0])
    return "Fence"


def _renamed(stage: Usd.Stage, rng: Rng, folder: Path) -> str:
    editor = Usd.NamespaceEditor(stage)
    editor.RenamePrim(stage.GetPrimAtPath(CAP), "Kapitell")
    editor.ApplyEdits()
    return "Pier_001_Cap"


def _reparented(stage: Usd.Stage, rng: Rng, folder: Path) -> str:
    editor = Usd.NamespaceEditor(stage)
    editor.MovePrimAtPath(CAP, "/World/Bridge/BridgeGeom/Superstructure/Pier_001_Cap")
    editor.ApplyEdits()
    return "Pier_001_Cap"


def _on_cap(change: Callable[[Usd.Prim, Rng], object]) -> Edit:
    def edit(stage: Usd.Stage, rng: Rng, folder: Path) -> str:
        change(stage.GetPrimAtPath(CAP), rng)
        return "Pier_001_Cap"

    return edit


def _to_solid(prim: Usd.Prim, rng: Rng) -> None:
    for name in ("points", "faceVertexCounts", "faceVertexIndices", "normals", "primvars:st", "primvars:st:indices"):
        prim.RemoveProperty(name)
    prim.SetTypeName("BasisCurves")


def _split(prim: Usd.Prim, rng: Rng) -> None:
    binding = UsdShade.MaterialBindingAPI(prim)
    for number in range(2):
        subset = binding.CreateMaterialBindSubset(f"Half{number}", [number])
        UsdShade.MaterialBindingAPI.Apply(subset.GetPrim()).Bind(
            paint(prim.GetStage(), f"/World/Looks/P{number}", tuple(rng.random(3).tolist()))
        )


def _animated(prim: Usd.Prim, rng: Rng) -> None:
    op = UsdGeom.Xformable(prim).GetOrderedXformOps()[0]
    for code in range(2):
        op.Set(Gf.Vec3d(*(5.0 * rng.random(3)).tolist()), code)


def _coat(stage: Usd.Stage, rng: Rng, folder: Path) -> str:
    surface = UsdShade.Shader(stage.GetPrimAtPath("/World/Bridge/BridgeLooks/Role_PierConcrete/Surface"))
    surface.CreateInput("clearcoat", Sdf.ValueTypeNames.Float).Set(float(rng.uniform(0.2, 1.0)))
    return "Role_PierConcrete"


def _other_shader(stage: Usd.Stage, rng: Rng, folder: Path) -> str:
    surface = UsdShade.Shader(stage.GetPrimAtPath("/World/Bridge/BridgeLooks/Role_PierConcrete/Surface"))
    surface.GetIdAttr().Set("ND_standard_surface_surfaceshader")
    return "Role_PierConcrete"


def _unworn(stage: Usd.Stage, rng: Rng, folder: Path) -> str:
    paint(stage, "/World/Looks/Spare", tuple(rng.random(3).tolist()))
    return "Spare"


def _sky(stage: Usd.Stage, rng: Rng, folder: Path) -> str:
    UsdLux.DomeLight.Define(stage, "/World/NightSky")
    return "NightSky"


def _glow(stage: Usd.Stage, rng: Rng, folder: Path) -> str:
    UsdLux.MeshLightAPI.Apply(mesh_at(stage, "/World/Screen").GetPrim())
    return "Screen"


def _cage(stage: Usd.Stage, rng: Rng, folder: Path) -> str:
    mesh_at(stage, "/World/Stone").GetSubdivisionSchemeAttr().Set("catmullClark")
    return "Stone"


def _lens(stage: Usd.Stage, rng: Rng, folder: Path) -> str:
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/World/Surveys/global/global_Camera"))
    camera.GetFocalLengthAttr().Set(camera.GetFocalLengthAttr().Get() * float(rng.uniform(1.1, 2.0)))
    return "global_Camera"


def _gone(path: str) -> Edit:
    def edit(stage: Usd.Stage, rng: Rng, folder: Path) -> str:
        stage.RemovePrim(path)
        return path.rpartition("/")[2]

    return edit


EDITS_OF_EACH_KIND: dict[str, Edit] = {
    "curve": _curve,
    "instancer": _instancer,
    "points": _typed("Points"),
    "patch": _typed("NurbsPatch"),
    "volume": _typed("Volume"),
    "skeleton": _typed("Skeleton"),
    "strange type": _typed("Cloth"),
    "empty mesh": _typed("Mesh"),
    "tetrahedra": _typed("TetMesh"),
    "renamed": _renamed,
    "reparented": _reparented,
    "relabelled": _on_cap(lambda prim, rng: prim.GetAttribute(tokens.USER_COMPONENT).Set("column")),
    "relabelled by schema": _on_cap(lambda prim, rng: prim.GetAttribute("semantics:labels:class").Set(["column"])),
    "purpose": _on_cap(lambda prim, rng: UsdGeom.Imageable(prim).CreatePurposeAttr("guide")),
    "note": _on_cap(lambda prim, rng: prim.CreateAttribute("userProperties:note", Sdf.ValueTypeNames.Int).Set(7)),
    "vertex paint": _on_cap(lambda prim, rng: UsdGeom.Gprim(prim).CreateDisplayColorAttr([(0.1, 0.2, rng.random())])),
    "subdivided": _on_cap(lambda prim, rng: UsdGeom.Mesh(prim).CreateSubdivisionSchemeAttr("loop")),
    "another type": _on_cap(_to_solid),
    "two materials": _on_cap(_split),
    "animated": _on_cap(_animated),
    "inactive": _on_cap(lambda prim, rng: prim.SetActive(False)),
    "coat": _coat,
    "other shader": _other_shader,
    "unworn material": _unworn,
    "sky": _sky,
    "mesh light": _glow,
    "cage": _cage,
    "lens": _lens,
    "no sun": _gone("/World/Environment/Sun"),
    "no camera": _gone("/World/Surveys/global/global_Camera"),
    "no deck": _gone("/World/Bridge/BridgeGeom/Superstructure/Deck_000"),
}


@pytest.mark.parametrize("kind", EDITS_OF_EACH_KIND)
def test_every_kind_of_edit_is_told(
    scene: Path, other: Usd.Stage, tmp_path: Path, kind: str, proof_count: Count, record_proof: RecordProof
) -> None:
    """What cannot come home is named, whatever its values; what is not edited is not named."""
    before = other.GetRootLayer().ExportToString()
    count, told = proof_count(1, 10), 0
    for seed in range(count):
        other.GetRootLayer().ImportFromString(before)
        name = EDITS_OF_EACH_KIND[kind](other, np.random.default_rng(seed), tmp_path)
        found, lines = bring_home(scene, other, sound=seed > 0)
        assert any(name in line for line in lines), lines
        told += 1
        named = {word.strip(",:") for line in [*found.left_out, *found.missing] for word in line.split()}
        assert "Deck_001" not in named
        assert "Pier_001_Footing" not in named
    record_proof(f"import-edits: {kind} is told by name", count, 0, {"told": told})
