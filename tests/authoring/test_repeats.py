"""What repeats: what one picks are native instances with ids of their own, crowds are PointInstancers, drawn alike."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSemantics, UsdShade

from authoring.edits.additions import Labeling
from authoring.edits.harvest import Harvest, harvest_edits
from authoring.exchange.flatten import flatten_scene
from authoring.foreign.usd_file import flatten_foreign
from authoring.layers import repeats
from authoring.layers.assets import Pieces
from authoring.layers.geometry import BACKGROUND
from authoring.layers.repeats import MOST_INSTANCES, are_instances, with_own_ids
from authoring.scenes.inventory import take_inventory
from authoring.scenes.validate import validate_scene
from authoring.shapes.component import Component, Mesh, Scatter
from tests.authoring.box_scene import FAR, write_box_scene
from tests.authoring.boxes import box
from tests.conftest import Count, RecordProof
from usd_schemas.apis import read_component
from usd_schemas.flat_scene import FlatScene
from usd_schemas.reading.stage_reader import read_stage

POST = ("brick", box((-0.1, -0.1, 0), (0.1, 0.1, 6)))
HEAD = ("roofing", box((-0.2, -1.0, 5.8), (0.2, 0.2, 6)))
BODY = ("brick", box((-2.2, -0.9, 0.3), (2.2, 0.9, 1.5)))
LAMPS = f"{BACKGROUND.group('Furniture')}/Town_Lamps".replace("/Background/", "/World/Background/", 1)
TOWN = 45_001


def run(name: str, kind: str, count: int, *shapes: tuple[tuple[str, Mesh], ...], seed: int = 7) -> Scatter:
    """Strew a run of one id, at random places, turns and sizes."""
    rng = np.random.default_rng(seed)
    places = np.column_stack([rng.uniform(-200, 200, count), rng.uniform(100, 500, count), rng.uniform(-1, 9, count)])
    chosen, yaw = rng.integers(0, len(shapes), count).astype(np.int32), rng.uniform(-7, 7, count)
    return Scatter(name, kind, "Furniture", shapes, chosen, places, yaw, rng.uniform(0.5, 2, (count, 3)), (TOWN,))


def town(count: int = 12) -> Pieces:
    """Set out lamps, cars and grass."""
    lamps = run("Town_Lamps", "lamp_post", count, (POST, HEAD), (POST,))
    cars = replace(
        run("Town_Cars", "vehicle", count, (BODY,), seed=8), instance_ids=tuple(range(TOWN + 1, TOWN + 1 + count))
    )
    grass = replace(run("Town_Grass", "vegetation", count, (POST,), seed=9), instance_ids=(TOWN + 1 + count,))
    return (*FAR, *with_own_ids((lamps, cars, grass), 59_999))


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write one scene with a town to copy from."""
    return write_box_scene(tmp_path_factory.mktemp("original"), town()).parent


@pytest.fixture
def scene(original: Path, tmp_path: Path) -> Path:
    """Copy the scene, free to be edited."""
    shutil.copytree(original, tmp_path / "scene")
    return tmp_path / "scene/scene.usda"


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, True),
        ({"instance_ids": (TOWN,)}, False),
        ({"kind": "shrub"}, False),
        ({"kind": "tree"}, True),
        ({"prototypes": (((POST[0], replace(POST[1], st1=np.zeros((24, 2), np.float32))),),)}, False),
        ({"prototypes": ((("Role_RailingSteel", POST[1]),),)}, False),
    ],
)
def test_who_is_picked_one_by_one(changes: dict[str, object], expected: bool) -> None:
    """Own ids, no ground cover, no atlas and no role of a look; at most as many as the rule says."""
    for count, few in ((MOST_INSTANCES, True), (MOST_INSTANCES + 1, False)):
        lamps = run("Lamps", "lamp_post", count, (POST,))
        own = replace(lamps, instance_ids=tuple(range(1, count + 1)))
        assert are_instances(replace(own, **changes)) is (expected and few)  # pyright: ignore[reportArgumentType]


def test_ids_of_their_own_come_after_all_others() -> None:
    """Each lamp gets an id that nobody had; who had one, grass, crowds and what finds no room keep theirs."""
    lamps, grass = (
        run("Lamps", "lamp_post", 5, (POST,)),
        replace(run("G", "vegetation", 5, (POST,)), instance_ids=(45_050,)),
    )
    poles, crowd = run("Poles", "pole", 4, (POST,)), replace(run("C", "tree", 501, (POST,)), instance_ids=(45_051,))
    house, *rest = with_own_ids((FAR[0], lamps, grass, poles, crowd), 45_058)
    assert house is FAR[0]
    assert [piece.instance_ids for piece in rest if isinstance(piece, Scatter)] == [
        (45_052, 45_053, 45_054, 45_055, 45_056),
        (45_050,),
        (TOWN,),
        (45_051,),
    ]


def test_each_lamp_is_a_labeled_prim_of_its_own(original: Path) -> None:
    """An instance of a shared shape, with kind, component id, labels and stable id on its root."""
    stage = Usd.Stage.Open(str(original / "scene.usda"))
    (lamps,) = [piece for piece in town() if isinstance(piece, Scatter) and piece.name == "Town_Lamps"]
    found = [prim for prim in stage.GetPrimAtPath(LAMPS).GetChildren()]
    assert [prim.GetName() for prim in found] == [f"Town_Lamps_{row:03d}" for row in range(12)]
    assert [read_component(prim).instance_id for prim in found] == list(lamps.instance_ids)
    shared: dict[int, set[str]] = {0: set(), 1: set()}
    for prim, chosen in zip(found, lamps.prototype.tolist(), strict=True):
        shared[chosen].add(str(prim.GetPrototype().GetPath()))
        assert Usd.ModelAPI(prim).GetKind() == "subcomponent"
        assert prim.GetAttribute("userProperties:falseworkId").Get() == prim.GetName()
        assert list(UsdSemantics.LabelsAPI(prim, "component").GetLabelsAttr().Get()) == ["lamp_post"]
        (leaf, *_) = prim.GetFilteredChildren(Usd.TraverseInstanceProxies())
        assert list(UsdSemantics.LabelsQuery("class", Usd.TimeCode.Default()).ComputeUniqueInheritedLabels(leaf)) == [
            "background"
        ]
        assert UsdShade.MaterialBindingAPI(leaf).ComputeBoundMaterial()[0].GetPath().name == "Background_brick"
    assert [len(prototypes) for prototypes in shared.values()] == [1, 1]
    assert stage.GetPrimAtPath(LAMPS.replace("Lamps", "Grass")).IsA(UsdGeom.PointInstancer)


def test_they_stand_where_the_generator_put_them(original: Path) -> None:
    """Place, turn and size of every instance to the micrometer, of its own id."""
    flat = read_stage(original / "scene.usda")
    for piece in town():
        if not isinstance(piece, Scatter) or piece.kind == "vegetation":
            continue
        for row, number in enumerate(piece.instance_ids):
            cos, sin = np.cos(piece.yaw[row]), np.sin(piece.yaw[row])
            turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]) * piece.scales[row]
            drawn = flat.draws.transform[flat.draws.instance == number]
            assert len(drawn) == len(piece.prototypes[piece.prototype[row]])
            np.testing.assert_allclose(drawn[:, :3, :3], np.broadcast_to(turn, drawn[:, :3, :3].shape), atol=2e-6)
            np.testing.assert_allclose(drawn[:, :3, 3], np.tile(piece.positions[row], (len(drawn), 1)), atol=2e-5)


def test_both_ways_draw_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, proof_count: Count, record_proof: RecordProof
) -> None:
    """Instances or PointInstancers: the same shapes, materials, labels and ids at the same places."""
    count = proof_count(12, 400)
    native = _rows(read_stage(write_box_scene(tmp_path / "native", town(count))))
    monkeypatch.setattr(repeats, "MOST_INSTANCES", 0)
    crowds = _rows(read_stage(write_box_scene(tmp_path / "crowds", _as_numbered(count))))
    assert native.keys() == crowds.keys()
    apart = max(float(np.abs(native[key] - crowds[key]).max()) for key in native)
    assert apart < 2e-3 * 3  # turns of PointInstancers are half floats
    record_proof("stage/repeats: native instances and PointInstancers draw alike", len(native), 7, {"apart": apart})


def _as_numbered(count: int) -> Pieces:
    """Give the town the ids that it has as native instances."""
    pieces = town(count)
    repeats_of = {piece.name: piece for piece in pieces if isinstance(piece, Scatter)}
    first = TOWN + 2 + count
    lamps = replace(repeats_of["Town_Lamps"], instance_ids=tuple(range(first, first + count)))
    return tuple(lamps if piece.name == "Town_Lamps" else piece for piece in pieces)


def _rows(flat: FlatScene) -> dict[tuple[object, ...], np.ndarray]:
    """List what is drawn by shape, material, class, id and place [dm], to its transform."""
    geometry, draws = flat.geometry, flat.draws
    runs = zip(geometry.part_first.tolist(), geometry.part_count.tolist(), strict=True)
    shapes = [geometry.positions[geometry.triangles[first : first + count]].tobytes() for first, count in runs]
    names = [material.name for material in flat.materials]
    columns = zip(draws.part, draws.material, draws.label, draws.instance, draws.transform, strict=True)
    return {
        (shapes[part], names[material], int(label), int(number), *transform[:3, 3].round(1).tolist()): transform
        for part, material, label, number, transform in columns
    }


def test_validation_and_inventory_know_them(scene: Path) -> None:
    """A sound scene has no finding; each lamp counts once; an id that two share is found."""
    assert validate_scene(scene) == []
    inventory = take_inventory(scene)
    assert {kind: inventory.components[kind] for kind in ("lamp_post", "vehicle", "vegetation")} == {
        "lamp_post": 12,
        "vehicle": 12,
        "vegetation": 1,
    }
    layer = Sdf.Layer.FindOrOpen(str(scene.parent / "background/house/geometry.usdc"))
    path = LAMPS.removeprefix("/World")
    layer.GetAttributeAtPath(f"{path}/Town_Lamps_003.falsework:component:instanceId").default = 2
    layer.Save()
    assert "instance id 2: used by 2 prims" in validate_scene(scene)


def test_flattening_keeps_them_and_their_bytes(scene: Path, tmp_path: Path) -> None:
    """USD numbers what instances share as its threads find it; here, and in a user's file, it is numbered in order."""
    texts = set()
    for number in range(4):
        flatten_scene(scene, tmp_path / f"{number}/flat.usda")
        texts.add((tmp_path / f"{number}/flat.usda").read_text(encoding="utf-8"))
    (text,) = texts
    assert "Flattened_Prototype" not in text
    stage = Usd.Stage.Open(str(tmp_path / "0/flat.usda"))
    assert sum(prim.IsInstance() for prim in stage.Traverse()) == 24
    before, after = read_stage(scene), read_stage(tmp_path / "0/flat.usda")
    assert sorted(_rows(before)) == [(*key[:1], *key[1:]) for key in sorted(_rows(after))]
    assert "/Prototype_0003" in flatten_foreign(stage).ExportToString()


@pytest.fixture
def other(scene: Path, tmp_path: Path) -> Usd.Stage:
    """Open what a DCC that keeps instances would save."""
    Usd.Stage.Open(str(scene)).Flatten(False).Export(str(tmp_path / "other.usda"))
    return Usd.Stage.Open(str(tmp_path / "other.usda"))


def bring_home(scene: Path, other: Usd.Stage, remove: bool = False) -> Harvest:
    """Save and harvest."""
    other.GetRootLayer().Save()
    return harvest_edits(Path(other.GetRootLayer().realPath), scene, Labeling(), remove)


def test_nothing_changed_is_no_edit(scene: Path, other: Usd.Stage) -> None:
    """A file with all instances as they were holds no edit."""
    assert bring_home(scene, other) == Harvest()


def test_a_lamp_that_was_moved_comes_home(scene: Path, other: Usd.Stage) -> None:
    """One instance stands elsewhere; its neighbors, its turn and its size stay."""
    before = read_stage(scene)
    moved = other.GetPrimAtPath(f"{LAMPS}/Town_Lamps_004")
    place = UsdGeom.Xformable(moved).GetOrderedXformOps()[0]
    place.Set(place.Get() + Gf.Vec3d(3, -2, 0.5))
    assert bring_home(scene, other).moved == ["Town_Lamps_004"]
    number, after = read_component(moved).instance_id, read_stage(scene)
    for one in {row.id for row in before.instances}:
        shift = _places(after, one) - _places(before, one)
        expected = [[3, -2, 0.5]] * len(shift) if one == number else np.zeros((len(shift), 3))
        np.testing.assert_allclose(shift[:, :3, 3], expected, atol=1e-5 if one == number else 0)
        assert not shift[:, :3, :3].any()


def _places(flat: FlatScene, number: int) -> np.ndarray:
    """Transforms of what has an id, in order."""
    rows = flat.draws.transform[flat.draws.instance == number]
    return rows[np.lexsort(rows[:, :3, 3].T)]


def test_a_lamp_that_was_deleted_is_told_or_goes(scene: Path, other: Usd.Stage) -> None:
    """Without `remove` it is named and stays; with it, it and only it is gone."""
    other.RemovePrim(f"{LAMPS}/Town_Lamps_004")
    assert bring_home(scene, other).missing == ["Town_Lamps_004"]
    before = {row.path for row in read_stage(scene).instances}
    assert bring_home(scene, other, remove=True).removed == ["Town_Lamps_004"]
    assert before - {row.path for row in read_stage(scene).instances} == {f"{LAMPS}/Town_Lamps_004"}
    assert validate_scene(scene) == []


def test_a_copy_of_a_lamp_is_an_addition_of_its_kind(scene: Path, other: Usd.Stage) -> None:
    """A second lamp, as artists copy one, comes home with label, material and an id of its own; the first stays."""
    home = Sdf.Path(f"{LAMPS}/Town_Lamps_004")
    Sdf.CopySpec(other.GetRootLayer(), home, other.GetRootLayer(), home.ReplaceName("Town_Lamps_004_001"))
    place = UsdGeom.Xformable(other.GetPrimAtPath(f"{home}_001")).GetOrderedXformOps()[0]
    place.Set(place.Get() + Gf.Vec3d(9, 0, 0))
    found = bring_home(scene, other)
    parts = len(other.GetPrimAtPath(home).GetPrototype().GetChildren())
    assert list(found.added.values()) == ["lamp_post"] * parts
    assert all(name.startswith("Town_Lamps_004_001_") for name in found.added)
    assert found == Harvest(added=found.added)
    assert validate_scene(scene) == []


def test_what_one_instance_cannot_say_is_told(scene: Path, other: Usd.Stage) -> None:
    """Another shape below one of them is named, and not taken."""
    shape = next(prim for prim in other.GetPrimAtPath(f"{LAMPS}/Town_Lamps_004").GetPrototype().GetChildren())
    other.GetPrimAtPath(f"{LAMPS}/Town_Lamps_004").SetInstanceable(False)
    mesh = UsdGeom.Mesh(other.GetPrimAtPath(f"{LAMPS}/Town_Lamps_004/{shape.GetName()}"))
    mesh.GetPointsAttr().Set([(x, y, 2 * z) for x, y, z in mesh.GetPointsAttr().Get()])
    found = bring_home(scene, other)
    assert found == Harvest(
        left_out=[
            "Town_Lamps_004: is an instance, and keeps the shape and material that it shares with other instances"
        ]
    )


def test_hiding_and_variants(scene: Path, other: Usd.Stage) -> None:
    """A hidden lamp is hidden at home; without the background none is drawn."""
    UsdGeom.Imageable(other.GetPrimAtPath(f"{LAMPS}/Town_Lamps_004")).MakeInvisible()
    assert bring_home(scene, other).hidden == ["Town_Lamps_004"]
    assert f"{LAMPS}/Town_Lamps_004" not in {row.path for row in read_stage(scene).instances}
    stage = Usd.Stage.Open(str(scene))
    stage.GetPrimAtPath("/World/Background").GetVariantSet("background").SetVariantSelection("none")
    assert not stage.GetPrimAtPath(LAMPS)


def test_the_house_beside_them_is_a_plain_mesh(original: Path) -> None:
    """Components stay one mesh each."""
    (house,) = [piece for piece in FAR if isinstance(piece, Component)]
    stage = Usd.Stage.Open(str(original / "scene.usda"))
    assert stage.GetPrimAtPath(f"/World{BACKGROUND.prim(house)}").IsA(UsdGeom.Mesh)
