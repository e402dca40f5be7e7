"""What other hosts see of a scene: names and versions of assets, parameters, what a viewport frames and draws."""

import hashlib
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom

from authoring.layers.stand_in import is_heavy, stand_in
from authoring.scenes.validate import validate_scene
from authoring.shapes.component import Mesh
from tests.authoring.small_scene import SMALL, write_small_scene
from tests.conftest import RecordProof
from usd_schemas import tokens
from usd_schemas.flat_scene import FlatScene
from usd_schemas.reading.stage_reader import read_stage


@pytest.fixture(scope="module")
def green_scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Author a scene with trees and hedges."""
    world = {"name": "countryside", "countryside": {"reach": 400, "buildings": 1, "trees": 12, "hedge_bushes": 10}}
    site = {**SMALL["site"], "fine_spacing": 2.0, "coarse_spacing": 8.0}  # type: ignore[dict-item]
    return write_small_scene(tmp_path_factory.mktemp("green"), background=world, site=site)


@pytest.fixture(scope="module")
def drawn(green_scene: Path) -> list[tuple[object, ...]]:
    """All that is drawn of the scene."""
    return _facts(read_stage(green_scene))


def test_assets_say_what_they_are(green_scene: Path, record_proof: RecordProof) -> None:
    """Bridge, site and background have a kind, a name, a version, and the file that they are, which is there."""
    stage = Usd.Stage.Open(str(green_scene))
    for path, kind, name, file in (
        (tokens.BRIDGE, "assembly", "beam_bridge", "bridge/bridge.usda"),
        (tokens.SITE, "component", "site", "site/site.usda"),
        (tokens.BACKGROUND, "component", "countryside", "background/countryside/countryside.usda"),
    ):
        prim = stage.GetPrimAtPath(path)
        info = prim.GetAssetInfo()
        assert Usd.ModelAPI(prim).GetKind() == kind
        assert (info["name"], set(info)) == (name, {"identifier", "name", "version"})
        assert info["version"]
        assert Path(Usd.ModelAPI(prim).GetAssetIdentifier().resolvedPath) == (green_scene.parent / file).resolve()
    findings = validate_scene(green_scene)
    assert findings == []
    record_proof("stage/hosts: assets with kind, name, version and file", 3, 7, {"findings": len(findings)})


def test_labels_can_be_read_by_people(
    green_scene: Path, drawn: list[tuple[object, ...]], tmp_path: Path, record_proof: RecordProof
) -> None:
    """Each asset's labels are a text layer; as a binary one, as before version 9, they say the same."""
    layers = sorted(path.relative_to(green_scene.parent).as_posix() for path in green_scene.parent.rglob("semantics.*"))
    assert layers == ["background/countryside/semantics.usda", "bridge/semantics.usda", "site/semantics.usda"]
    shutil.copytree(green_scene.parent, tmp_path / "old")
    text, payload = tmp_path / "old" / layers[1], tmp_path / "old/bridge/payload.usda"
    Sdf.Layer.OpenAsAnonymous(str(text)).Export(str(text.with_suffix(".usdc")))  # not atomic: a test's own file
    text.unlink()
    former = payload.read_text(encoding="utf-8").replace("semantics.usda", "semantics.usdc")
    payload.write_text(former, encoding="utf-8")
    assert _facts(read_stage(tmp_path / "old/scene.usda")) == drawn
    assert validate_scene(tmp_path / "old/scene.usda") == []
    record_proof("stage/hosts: label layers that are text", len(layers), 7, {"draws_alike": len(drawn)})


def test_parameters_are_typed_attributes(stored_scene: Path, record_proof: RecordProof) -> None:
    """Each number, word and truth of the JSON is an attribute of its own; lists of numbers too; none says otherwise."""
    stage = Usd.Stage.Open(str(stored_scene))
    prim = stage.GetPrimAtPath(tokens.BRIDGE)
    assert prim.HasAPI("FalseworkParametersAPI")
    told = json.loads(prim.GetAttribute("falsework:bridge:parameters").Get())
    attributes = {
        one.GetName(): one.Get() for one in prim.GetAuthoredAttributes() if "falsework:parameters:" in one.GetName()
    }
    for name, value in attributes.items():
        found = told
        for word in name.split(":")[2:]:
            found = found[word]
        assert (list(value) if isinstance(found, list) else value) == found, name
        kinds = {bool: "bool", int: "int", float: "double", str: "token", list: "double[]"}
        assert str(prim.GetAttribute(name).GetTypeName()) == kinds[type(found)], name
    assert len(attributes) == _count(told) > 80
    assert attributes["falsework:parameters:record:top:parapets:height"] == pytest.approx(0.8, abs=0.5)
    record_proof("stage/hosts: typed parameters of a bridge", len(attributes), 7, {"of_the_json": _count(told)})


def test_a_viewport_frames_the_bridge(green_scene: Path, record_proof: RecordProof) -> None:
    """By the hint of the world, as viewports take it; without the hint the land reaches to the horizon."""
    stage = Usd.Stage.Open(str(green_scene))
    sizes = []
    for use_hint in (True, False):
        cache = UsdGeom.BBoxCache(Usd.TimeCode.Default(), ["default", "render"], use_hint)
        box = cache.ComputeWorldBound(stage.GetPseudoRoot()).ComputeAlignedRange()
        sizes.append(np.array([box.GetMin(), box.GetMax()]))
    bridge = UsdGeom.BBoxCache(Usd.TimeCode.Default(), ["default"]).ComputeWorldBound(
        stage.GetPrimAtPath(tokens.BRIDGE)
    )
    exact = bridge.ComputeAlignedRange()
    np.testing.assert_allclose(sizes[0], [exact.GetMin(), exact.GetMax()], atol=1e-3)
    framed, land = (np.ptp(size, axis=0)[:2] for size in sizes)
    assert land.min() > 10 * framed.max()
    record_proof(
        "stage/hosts: what a viewport frames", 1, 7, {"framed_m": float(framed.max()), "land_m": float(land.min())}
    )


def test_viewports_draw_stand_ins(
    green_scene: Path, drawn: list[tuple[object, ...]], tmp_path: Path, record_proof: RecordProof
) -> None:
    """Heavy plants have eight faces of the same extent for viewports; ours draws the plants as if there were none."""
    stage = Usd.Stage.Open(str(green_scene))
    light, full, shared = 0, 0, 0
    stand_ins = [prim for prim in stage.TraverseAll() if prim.GetName().endswith("_Proxy")]
    for prim in stand_ins:
        if prim.IsA(UsdGeom.Mesh):
            shared += prim.IsAbstract()
            plant = stage.GetPrimAtPath(str(prim.GetPath()).removesuffix("_Proxy"))
            extents = [np.array(UsdGeom.Mesh(one).GetExtentAttr().Get()) for one in (prim, plant)]
            np.testing.assert_array_equal(extents[0], extents[1])
            assert UsdGeom.Imageable(prim).ComputePurpose() == "proxy"
            assert UsdGeom.Imageable(plant).ComputePurpose() == "render"
            faces = [len(UsdGeom.Mesh(one).GetFaceVertexCountsAttr().Get()) for one in (prim, plant)]
            light, full = light + faces[0], full + faces[1]
    assert 0 < 8 * light < full
    assert 0 < shared < len(stand_ins)  # of native instances, and of instancers
    shutil.copytree(green_scene.parent, tmp_path / "bare")
    edits = Sdf.Layer.FindOrOpen(str(tmp_path / "bare/edits/user.usda"))
    for prim in stand_ins:
        Sdf.CreatePrimInLayer(edits, prim.GetPath()).SetInfo("active", False)
    edits.Save()
    assert _facts(read_stage(tmp_path / "bare/scene.usda")) == drawn
    record_proof(
        "stage/hosts: faces of plants and of their stand-ins", len(stand_ins), 7, {"plants": full, "stand_ins": light}
    )


def test_a_stand_in_is_closed_and_faces_outwards() -> None:
    """Every edge is shared by two faces; normals lead away from the middle, whatever the extent."""
    points = np.array([[0.0, 0, 0], [2, 0, 1], [0, 5, 3], [1, 1, 7]])
    shape = stand_in(
        Mesh(points, np.array([3], np.int32), np.array([0, 1, 2], np.int32), *[np.zeros((3, 2), np.float32)] * 2)
    )
    faces = shape.corners.reshape(-1, 3)
    edges = {tuple(pair) for face in faces.tolist() for pair in zip(face, face[1:] + face[:1], strict=True)}
    assert len(edges) == 24
    assert edges == {pair[::-1] for pair in edges}
    middle = shape.points[faces].mean(axis=1) - shape.points.mean(axis=0)
    assert np.einsum("fi,fi->f", middle, shape.normals[::3]).min() > 0
    assert not is_heavy(shape)
    np.testing.assert_array_equal(shape.points.min(axis=0), points.min(axis=0))
    np.testing.assert_array_equal(shape.points.max(axis=0), points.max(axis=0))


def _count(told: object) -> int:
    if isinstance(told, dict):
        return sum(_count(value) for value in told.values())
    if isinstance(told, list):
        return int(bool(told) and all(isinstance(one, int | float) for one in told))
    return int(told is not None)


def _facts(flat: FlatScene) -> list[tuple[object, ...]]:
    """All that is drawn, in any order: triangles, place, id, class and material of each draw."""
    geometry, draws = flat.geometry, flat.draws
    rows = []
    for row, part in enumerate(draws.part):
        first, count = int(geometry.part_first[part]), int(geometry.part_count[part])
        corners = geometry.triangles[first : first + count]
        shape = b"".join(array[corners].tobytes() for array in (geometry.positions, geometry.normals, geometry.st))
        number, label = int(draws.instance[row]), int(draws.label[row])
        material = flat.materials[draws.material[row]].name
        rows.append((number, label, material, hashlib.sha256(shape).hexdigest(), draws.transform[row].tobytes()))
    return sorted(rows)
