"""Looking into a scene, comparing, copying and passing it on: each against what was done to it."""

import json
import shutil
import struct
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdValidation

from authoring.exchange.export import export_scene
from authoring.exchange.flatten import flatten_scene
from authoring.exchange.glb import write_glb
from authoring.exchange.package import ALIGNMENT, package_scene
from authoring.scenes.checkout import checkout_scene
from authoring.scenes.diff import diff_scenes
from authoring.scenes.inventory import take_inventory
from authoring.scenes.validate import surfaces, validate_scene
from authoring.variants.add import set_choices
from groundwork.canonical import file_digest
from groundwork.errors import InputError
from groundwork.output.lock import sole_writer
from tests.authoring.small_scene import file_bytes
from usd_schemas.flat_scene import world_triangles
from usd_schemas.reading.stage_reader import read_stage

DECK = "/World/Bridge/BridgeGeom/Superstructure/Deck_000"
WALL = "/World/Bridge/BridgeGeom/Substructure/Abutment_000_Wall"


def test_inventory_counts_what_is_there(stored_scene: Path) -> None:
    """Counts add up to the surfaces of the stage and the triangles of the renderer's reader; hashes are the files'."""
    found = take_inventory(stored_scene)
    ids = [row["id"] for row in found.members]
    assert ids == sorted(set(ids))
    assert ids[0] > 0
    assert "background" not in {row["class"] for row in found.members}
    assert {"deck", "abutment"} <= {row["class"] for row in found.members}
    shown = list(surfaces(Usd.Stage.Open(str(stored_scene))))
    assert sum(found.components.values()) == sum(found.classes.values()) == len(shown)
    assert found.triangles == len(world_triangles(read_stage(stored_scene))[0])
    assert found.selected == {"background": "none", "light": "default", "look": "weathered"}
    assert found.choices["look"] == ["clean", "weathered"]
    assert found.surveys["global"]["width"] == 160
    assert found.layers["bridge/geometry.usdc"] == file_digest(stored_scene.parent / "bridge/geometry.usdc")
    assert found.changed == []


def test_hashes_know_no_folder(stored_scene: Path, own_scene: Path) -> None:
    """A copy elsewhere has the same hashes; one changed texture changes the scene's, and is named."""
    assert take_inventory(own_scene) == take_inventory(stored_scene)
    texture = own_scene.parent / "bridge/looks/clean/textures/detail.png"
    texture.write_bytes(texture.read_bytes() + b"\0")  # not atomic: a test's own file
    found = take_inventory(own_scene)
    assert found.scene_hash != take_inventory(stored_scene).scene_hash
    assert found.changed == ["bridge/looks/clean/textures/detail.png: changed"]


def test_scene_does_not_differ_from_its_copy(stored_scene: Path, own_scene: Path) -> None:
    """No prim and no file differs."""
    found = diff_scenes(stored_scene, own_scene)
    assert found.same
    assert found.layers == {}


def test_each_edit_is_told_apart(stored_scene: Path, own_scene: Path) -> None:
    """Five edits of five kinds are found, each under its own name, and nothing else."""
    stage = Usd.Stage.Open(str(own_scene))
    stage.SetEditTarget(Sdf.Layer.FindOrOpen(str(own_scene.parent / "edits/user.usda")))
    wall = UsdGeom.Xformable(stage.GetPrimAtPath(WALL))
    (operation,) = wall.GetOrderedXformOps()
    operation.Set(operation.Get() + Gf.Vec3d(0.3, 0.4, 0))
    deck = UsdGeom.Mesh(stage.GetPrimAtPath(DECK))
    points = np.array(deck.GetPointsAttr().Get())
    points[0, 2] += 0.01
    deck.GetPointsAttr().Set(points)
    rubber = stage.GetPrimAtPath("/World/Bridge/BridgeLooks/Role_BearingRubber/Surface")
    UsdShade.Shader(rubber).GetInput("metallic").Set(0.5)
    diaphragm = next(prim for prim in surfaces(stage) if prim.GetName().startswith("Diaphragm"))
    diaphragm.GetAttribute("semantics:labels:class").Set(["beam"])
    UsdGeom.Cube.Define(stage, "/World/Bridge/BridgeGeom/Furniture/Sign/Plate")
    gone = next(
        prim for prim in surfaces(stage) if prim.GetName().startswith(("Coping", "Parapet", "Railing", "Barrier"))
    )
    gone.SetActive(False)
    stage.GetEditTarget().GetLayer().Save()  # not atomic: a test's own file
    found = diff_scenes(stored_scene, own_scene)
    assert found.moved == {WALL: pytest.approx(0.5, abs=1e-6)}
    assert found.reshaped == [DECK]
    role = "/World/Bridge/BridgeLooks/Role_BearingRubber"
    # the further sheets of a role specialize its first one, and follow it
    assert found.look.keys() == {str(prim.GetPath()) for prim in surfaces(stage) if _wears(prim).startswith(role)}
    assert all(before == after and before.startswith(role) for before, after in found.look.values())
    assert list(found.relabelled) == [str(diaphragm.GetPath())]
    assert found.added == ["/World/Bridge/BridgeGeom/Furniture/Sign"]
    assert found.removed == [str(gone.GetPath())]
    assert found.layers == {"edits/user.usda": "changed"}


def test_another_look_changes_looks_only(stored_scene: Path, own_scene: Path) -> None:
    """Every surface of the bridge looks different, and nothing moved or changed its name."""
    set_choices(own_scene, {"look": "clean"}, print)
    found = diff_scenes(stored_scene, own_scene)
    stage = Usd.Stage.Open(str(own_scene))
    bridge = [prim for prim in surfaces(stage) if str(prim.GetPath()).startswith("/World/Bridge/")]
    assert found.look.keys() == {str(prim.GetPath()) for prim in bridge if prim.IsA(UsdGeom.Gprim)}
    assert found.selections == {"look": ["weathered", "clean"]}
    others = (found.moved, found.reshaped, found.relabelled, found.light, found.added, found.removed)
    assert [one for one in others if one] == []


def test_checkout_is_editable_and_replaces_nothing(stored_scene: Path, tmp_path: Path) -> None:
    """A copy of read-only files can be changed, and a second checkout never takes its place."""
    store = tmp_path / "store"
    shutil.copytree(stored_scene.parent, store)
    for path in store.rglob("*"):
        if path.is_file():
            path.chmod(0o444)
    root = checkout_scene(store, tmp_path / "mine")
    assert file_bytes(root.parent) == file_bytes(store)
    set_choices(root, {"look": "clean"}, print)
    with pytest.raises(InputError, match="not empty"):
        checkout_scene(store, tmp_path / "mine")
    with sole_writer(tmp_path / "busy"), pytest.raises(InputError, match="another command is writing this folder"):
        checkout_scene(store, tmp_path / "busy")
    with pytest.raises(InputError, match=r"holds no scene\.usda"):
        checkout_scene(tmp_path, tmp_path / "other")


@pytest.mark.parametrize("inside", [True, False])
def test_flattened_scene_looks_the_same(stored_scene: Path, own_scene: Path, tmp_path: Path, inside: bool) -> None:
    """One layer without arcs, whose textures are found beside it, reads as the same scene."""
    out = (own_scene.parent if inside else tmp_path / "flat") / "flat.usda"
    assert flatten_scene(own_scene, out) == []
    assert str(tmp_path) not in out.read_text()
    if not inside:
        shutil.rmtree(own_scene.parent)
    whole, flat = read_stage(stored_scene), read_stage(out)
    np.testing.assert_array_equal(whole.geometry.positions, flat.geometry.positions)
    np.testing.assert_array_equal(whole.draws.transform, flat.draws.transform)
    np.testing.assert_array_equal(whole.draws.label, flat.draws.label)
    pairs = [(one.base_texture, two.base_texture) for one, two in zip(whole.materials, flat.materials, strict=True)]
    assert [one is None for one, _ in pairs] == [two is None for _, two in pairs]
    assert all(file_digest(Path(one.file)) == file_digest(Path(two.file)) for one, two in pairs if one and two)


def test_package_is_the_same_from_two_folders(stored_scene: Path, own_scene: Path, tmp_path: Path) -> None:
    """Equal bytes, whatever the folder and the times of the files; USD opens it and finds nothing wrong."""
    names = package_scene(stored_scene, tmp_path / "a.usdz")
    package_scene(own_scene, tmp_path / "b.usdz")
    assert (tmp_path / "a.usdz").read_bytes() == (tmp_path / "b.usdz").read_bytes()
    assert names[0] == "scene.usda"
    with zipfile.ZipFile(tmp_path / "a.usdz") as archive:
        for entry in archive.infolist():
            name_length, extra_length = struct.unpack_from("<HH", _bytes(tmp_path / "a.usdz"), entry.header_offset + 26)
            assert (entry.header_offset + 30 + name_length + extra_length) % ALIGNMENT == 0
            assert entry.compress_type == zipfile.ZIP_STORED
    stage = Usd.Stage.Open(str(tmp_path / "a.usdz"))
    assert len(list(surfaces(stage))) == len(list(surfaces(Usd.Stage.Open(str(stored_scene)))))
    registry = UsdValidation.ValidationRegistry()
    validators = [
        registry.GetOrLoadValidatorByName(one.name) for one in registry.GetAllValidatorMetadata() if "sdz" in one.name
    ]
    assert validators
    assert [error.GetMessage() for error in UsdValidation.ValidationContext(validators).Validate(stage)] == []


def test_package_takes_nothing_from_outside(own_scene: Path, tmp_path: Path) -> None:
    """A scene that leans on a file elsewhere is refused, with the file's name."""
    (tmp_path / "elsewhere.usda").write_text('#usda 1.0\ndef Xform "A"\n{\n}\n')  # not atomic: a test's own file
    layer = Sdf.Layer.FindOrOpen(str(own_scene))
    layer.subLayerPaths.append("../elsewhere.usda")
    layer.Save()  # not atomic: a test's own file
    with pytest.raises(InputError, match=r"elsewhere\.usda"):
        package_scene(own_scene, tmp_path / "a.usdz")


def test_glb_names_prims_and_labels(stored_scene: Path, tmp_path: Path) -> None:
    """Every drawn part is a node with its class; the model stands y-up where the scene stands z-up."""
    import trimesh

    names = export_scene(stored_scene, tmp_path / "scene.glb", False, 64, print)
    data = _bytes(tmp_path / "scene.glb")
    document = json.loads(data[20 : 20 + struct.unpack_from("<I", data, 12)[0]])
    nodes = {node["name"]: node for node in document["nodes"] if "mesh" in node}
    assert set(nodes) == set(names)
    assert len(names) == len(read_stage(stored_scene).draws.part)
    assert nodes["Deck_000"]["extras"]["class"] == "deck"
    assert nodes["Deck_000"]["extras"]["path"] == DECK
    loaded = trimesh.load_scene(tmp_path / "scene.glb")
    corners = world_triangles(read_stage(stored_scene))[0].reshape(-1, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    np.testing.assert_allclose(loaded.bounds, [[low[0], low[2], -high[1]], [high[0], high[2], -low[1]]], atol=1e-3)


LEAF = """#usda 1.0
(metersPerUnit = 1
 upAxis = "Z")
def Mesh "Card" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "vertex")
    uniform token subdivisionScheme = "none"
    rel material:binding = </Leaf>
}
def Material "Leaf" {
    token outputs:surface.connect = </Leaf/S.outputs:surface>
    def Shader "S" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </Leaf/T.outputs:rgb>
        float inputs:opacity.connect = </Leaf/T.outputs:a>
        float inputs:opacityThreshold = 0.5
        token outputs:surface
    }
    def Shader "T" {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @./leaf.png@
        float2 inputs:st.connect = </Leaf/R.outputs:result>
        float3 outputs:rgb
        float outputs:a
    }
    def Shader "R" {
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }
}
"""


def test_glb_cuts_out_what_the_stage_cuts_out(tmp_path: Path) -> None:
    """A leaf on a card keeps its alpha, to the bit, and the threshold; other pictures stay JPEG without one."""
    pixels = np.full((8, 8, 4), (20, 160, 40, 255), np.uint8)
    pixels[:, :3, 3] = 0
    cv2.imwrite(str(tmp_path / "leaf.png"), pixels)
    (tmp_path / "leaf.usda").write_text(LEAF)
    np.testing.assert_array_equal(_cut_out(tmp_path / "leaf.usda"), pixels)


def test_glb_cuts_out_by_a_mask(tmp_path: Path) -> None:
    """A leaf of one color, and an inverted mask in the green of another file: both are in the picture, not black."""
    mask = np.zeros((8, 8, 3), np.uint8)
    mask[:, :3, 1] = 255
    cv2.imwrite(str(tmp_path / "leaf.png"), mask)
    text = LEAF.replace("diffuseColor.connect = </Leaf/T.outputs:rgb>", "diffuseColor = (0, 1, 0)")
    text = text.replace("T.outputs:a>", "T.outputs:g>").replace("float outputs:a", "float outputs:g")
    inverted = "float4 inputs:scale = (-1, -1, -1, -1)\nfloat4 inputs:bias = (1, 1, 1, 1)\nfloat3 outputs:rgb"
    (tmp_path / "leaf.usda").write_text(text.replace("float3 outputs:rgb", inverted))
    expected = np.full((8, 8, 4), (0, 255, 0, 255), np.uint8)
    expected[:, :3, 3] = 0
    np.testing.assert_array_equal(_cut_out(tmp_path / "leaf.usda"), expected)


def _cut_out(stage: Path) -> np.ndarray:
    """Write a stage of one material as GLB, and read its picture: blue, green, red, opacity."""
    write_glb(stage, stage.with_suffix(".glb"), print)
    data = _bytes(stage.with_suffix(".glb"))
    length = struct.unpack_from("<I", data, 12)[0]
    document = json.loads(data[20 : 20 + length])
    (material,), (image,) = document["materials"], document["images"]
    assert (material["alphaMode"], material["alphaCutoff"]) == ("MASK", 0.5)
    assert "baseColorFactor" not in material["pbrMetallicRoughness"]
    assert image["mimeType"] == "image/png"
    view = document["bufferViews"][image["bufferView"]]
    start = 20 + length + 8 + view.get("byteOffset", 0)
    picture = np.frombuffer(data[start : start + view["byteLength"]], np.uint8)
    return np.asarray(cv2.imdecode(picture, cv2.IMREAD_UNCHANGED))


def test_glb_is_byte_reproducible(stored_scene: Path, own_scene: Path, tmp_path: Path) -> None:
    """Two folders, one file."""
    export_scene(stored_scene, tmp_path / "a.glb", False, 64, print)
    export_scene(own_scene, tmp_path / "b.glb", False, 64, print)
    assert _bytes(tmp_path / "a.glb") == _bytes(tmp_path / "b.glb")


def test_baked_package_needs_no_detail(own_scene: Path, tmp_path: Path) -> None:
    """Baked: no bridge material has detail left, all read the atlas, and two runs give the same bytes."""
    for name in ("a", "b"):
        export_scene(own_scene, tmp_path / f"{name}.usdz", True, 128, print)
    assert _bytes(tmp_path / "a.usdz") == _bytes(tmp_path / "b.usdz")
    stage = Usd.Stage.Open(str(tmp_path / "a.usdz"))
    for prim in surfaces(stage):
        if str(prim.GetPath()).startswith("/World/Bridge/") and UsdGeom.PrimvarsAPI(prim).HasPrimvar("st1"):
            material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
            assert material.GetPrim().GetName().endswith("_Baked")
            assert not material.GetPrim().HasAPI("FalseworkDetailAPI")


def test_unknown_package_is_refused(stored_scene: Path, tmp_path: Path) -> None:
    """The line tells which there are."""
    with pytest.raises(InputError, match=r"\.usdz, \.glb"):
        export_scene(stored_scene, tmp_path / "scene.fbx", False, 64, print)


def test_checked_out_scene_is_sound(stored_scene: Path, tmp_path: Path) -> None:
    """Validation finds nothing in a copy."""
    assert validate_scene(checkout_scene(stored_scene.parent, tmp_path / "mine")) == []


def _wears(prim: Usd.Prim) -> str:
    material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
    return str(material.GetPath())


def _bytes(path: Path) -> bytes:
    return path.read_bytes()
