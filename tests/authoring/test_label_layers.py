"""Label layers: another table in force, the older schema beside the labels, and the mirrors that stand in for them."""

import shutil
from pathlib import Path
from typing import get_args

import pytest
from pxr import Sdf, Usd, UsdSemantics

from authoring.layers.change import change_layer
from authoring.layers.root import SUBLAYERS
from authoring.scene import author_scene
from authoring.scenes.labels import write_replicator_layer, write_taxonomy_layer
from authoring.scenes.manifest import changed_files
from authoring.scenes.validate import validate_scene
from authoring.settings import AuthoringSettings, LabelSettings
from groundwork.errors import InputError
from groundwork.progress import SILENT
from usd_schemas import tokens
from usd_schemas.apis import apply_labels
from usd_schemas.flat_scene import FlatScene
from usd_schemas.reading.stage_reader import read_stage
from usd_schemas.taxonomies import BASE, TAXONOMIES, taxonomy

SMALL: dict[str, object] = {
    "bridge": {
        "family": "beam",
        "service": "road",
        "alignment": {"kind": "straight", "skew": 0, "profile": "grade"},
        "beam": {"spans": [12.0, 12.0]},
    },
    "look": {"texels": 256},
    "light": {"sky_height": 64},
    "site": {
        **{"half_width": 40, "run_out": 40, "fine_spacing": 2.0, "coarse_spacing": 8.0},
        "scatter": {"tufts": 20, "stones": 10, "shrubs": 5, "reeds": 5},
    },
    "background": {"countryside": {"reach": 400, "buildings": 2, "trees": 10, "hedge_bushes": 5}},
    "survey": [{"kind": "global", "images": 8, "spacing": 30.0, "width": 160, "height": 120}],
}


def author(folder: Path, **sections: object) -> Path:
    """Author a small scene with some sections changed."""
    author_scene(AuthoringSettings.model_validate({**SMALL, **sections}), 7, folder, SILENT)
    return folder


@pytest.fixture(scope="module")
def authored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Author one scene with the default labels."""
    return author(tmp_path_factory.mktemp("labels"))


@pytest.fixture(scope="module")
def before(authored: Path) -> FlatScene:
    """Read the scene with the default labels."""
    return read_stage(authored / "scene.usda")


@pytest.fixture
def scene(authored: Path, tmp_path: Path) -> Path:
    """Copy the scene for a test that changes it."""
    return shutil.copytree(authored, tmp_path / "scene")


def labels_of(flat: FlatScene) -> dict[int, tuple[str, str, set[int]]]:
    """Map instance ids to component, class and the class ids that are drawn."""
    drawn: dict[int, set[int]] = {}
    for number, label in zip(flat.draws.instance.tolist(), flat.draws.label.tolist(), strict=True):
        drawn.setdefault(number, set()).add(label)
    return {row.id: (row.component, row.class_name, drawn[row.id]) for row in flat.instances}


def sublayers(folder: Path) -> list[str]:
    """List the sublayers of a scene, strongest first."""
    layer = Sdf.Layer.OpenAsAnonymous(str(folder / "scene.usda"))
    return list(layer.subLayerPaths)


def test_nothing_is_switched_on_by_default(authored: Path) -> None:
    """The base table needs no layer, and the older schema is not written; every table may be chosen."""
    assert sublayers(authored) == list(SUBLAYERS)
    assert not (authored / "compat_replicator.usda").exists()
    assert get_args(LabelSettings.model_fields["taxonomy"].annotation) == TAXONOMIES


USED = ("asprs", "ifc43", "semanticbridge")  # the others with --proof, or where a test switches to them


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in USED else pytest.mark.proof_only) for name in TAXONOMIES]
)
def test_a_table_reaches_what_is_drawn(before: FlatScene, scene: Path, name: str) -> None:
    """Every instance has the class that the table gives to its component, and nothing else of the scene changes."""
    write_taxonomy_layer(scene, name)
    after = read_stage(scene / "scene.usda")
    table = taxonomy(name)
    assert after.classes == table.rows
    assert after.warnings == before.warnings
    assert after.draws.instance.tolist() == before.draws.instance.tolist()
    kinds = {number: component for number, (component, _, _) in labels_of(before).items()}
    assert {number: row[1:] for number, row in labels_of(after).items()} == {
        number: (table.row_of(kind).name, {table.row_of(kind).id}) for number, kind in kinds.items()
    }
    assert len(set(kinds.values())) > 12


def test_switching_back_leaves_no_trace_in_the_root_layer(authored: Path, scene: Path) -> None:
    """One table is in force at a time, below the user's edits; the base table is the scene as it was."""
    for name in ("kim2023", "ifc43"):
        write_taxonomy_layer(scene, name)
        assert sublayers(scene) == [SUBLAYERS[0], f"./taxonomies/{name}.usdc", *SUBLAYERS[1:]]
        assert validate_scene(scene / "scene.usda") == []
        assert changed_files(scene) == []
    write_taxonomy_layer(scene, BASE)
    assert (scene / "scene.usda").read_bytes() == (authored / "scene.usda").read_bytes()
    with pytest.raises(InputError, match="unknown taxonomy"):
        write_taxonomy_layer(scene, "kim")
    (scene / "artefact.json").write_text("{}")
    with pytest.raises(InputError, match="read-only"):
        write_taxonomy_layer(scene, "kim2023")


def test_what_comes_later_is_classed_too(scene: Path) -> None:
    """A relabelled part, a new one and one that says a class alone follow the table without the layer being redone."""
    write_taxonomy_layer(scene, "semanticbridge")
    path = "/World/Bridge/BridgeGeom"
    stage = Usd.Stage.Open(str(scene / "edits/user.usda"))
    for name, component in (("Extra", "deck_top"), ("Sign", "traffic_sign")):
        apply_labels(stage.DefinePrim(f"{path}/{name}", "Cube"), component, 0)
    for name, label in (("Says", "column"), ("Own", "high_vegetation")):
        cube = stage.DefinePrim(f"{path}/{name}", "Cube")
        UsdSemantics.LabelsAPI.Apply(cube, tokens.CLASS_TAXONOMY).CreateLabelsAttr([label])
    by_hand = stage.DefinePrim(f"{path}/Hand", "Cube")
    apply_labels(by_hand, "deck_top", 0)
    UsdSemantics.LabelsAPI(by_hand, tokens.CLASS_TAXONOMY).GetLabelsAttr().Set(["parapet"])
    stage.GetRootLayer().Save()
    rows = {row.path.removeprefix(f"{path}/"): row.class_name for row in read_stage(scene / "scene.usda").instances}
    expected = {"Extra": "top_surface", "Sign": "traffic_sign", "Says": "pillar", "Own": "high_vegetation"}
    assert {name: rows[name] for name in (*expected, "Hand")} == {**expected, "Hand": "railing"}


def test_a_table_without_a_row_is_found(scene: Path) -> None:
    """Validation names each prim whose component the table in force lacks, and a table that cannot be used."""
    write_taxonomy_layer(scene, "hgcnn")
    path = scene / "taxonomies/hgcnn.usdc"
    whole = Sdf.Layer.OpenAsAnonymous(str(path)).ExportToString()
    change_layer(path, lambda layer: layer.ImportFromString(whole.replace('"deck_slab"', '"deck_slap"')))
    findings = validate_scene(scene / "scene.usda")
    assert findings
    assert all("component 'deck_slab' has no class in the taxonomy 'hgcnn'" in line for line in findings)
    change_layer(path, lambda layer: layer.ImportFromString(whole.replace('"electric_pole", "noisy', '"pole", "noisy')))
    assert any("labelNames and labelClasses do not fit" in line for line in validate_scene(scene / "scene.usda"))


@pytest.mark.parametrize("name", [pytest.param(BASE, marks=pytest.mark.proof_only), "kim2023"])
def test_older_schema_equals_the_labels(scene: Path, name: str) -> None:
    """Prim by prim, in each background: type and data say what LabelsAPI says, the class as the table has it."""
    write_replicator_layer(scene)
    write_taxonomy_layer(scene, name)  # which writes the other anew
    assert sublayers(scene)[1] == "./compat_replicator.usda"
    table = taxonomy(name)
    stage = Usd.Stage.Open(str(scene / "scene.usda"))
    backgrounds = stage.GetPrimAtPath(tokens.BACKGROUND).GetVariantSet("background")
    counts = []
    for variant in backgrounds.GetVariantNames():
        stage.SetEditTarget(stage.GetSessionLayer())
        backgrounds.SetVariantSelection(variant)
        prims = list(stage.TraverseAll())
        assert all(prim.IsDefined() for prim in prims if str(prim.GetPath()).startswith(tokens.BACKGROUND))
        labels = [labels_api(prim) for prim in prims]
        for label in labels:
            if tokens.CLASS_TAXONOMY in label:
                component = label.get(tokens.COMPONENT_TAXONOMY, "")
                label[tokens.CLASS_TAXONOMY] = table.class_of(component, label[tokens.CLASS_TAXONOMY])
        assert [semantics_api(prim) for prim in prims] == labels
        counts.append(sum(map(bool, labels)))
    assert counts[0] > counts[1] > 20, "countryside has more labels than none"
    assert validate_scene(scene / "scene.usda") == []


def labels_api(prim: Usd.Prim) -> dict[str, str]:
    """Map taxonomies to the label that LabelsAPI gives to a prim."""
    schemas = UsdSemantics.LabelsAPI.GetDirectTaxonomies(prim)
    return {str(name): str(UsdSemantics.LabelsAPI(prim, name).GetLabelsAttr().Get()[0]) for name in schemas}


def semantics_api(prim: Usd.Prim) -> dict[str, str]:
    """Map types to the data that the older schema gives to a prim, read from the schema list and the attributes."""
    schemas = prim.GetMetadata("apiSchemas")
    names = [name for name in (schemas.GetAppliedItems() if schemas else []) if name.startswith("SemanticsAPI:")]
    places = [f"semantic:{name.partition(':')[2]}:params" for name in names]
    found = {prim.GetAttribute(f"{p}:semanticType").Get(): prim.GetAttribute(f"{p}:semanticData").Get() for p in places}
    assert len(found) == len([a for a in prim.GetAuthoredAttributes() if a.GetName().endswith(":semanticData")])
    return found


@pytest.mark.parametrize("name", [pytest.param(BASE, marks=pytest.mark.proof_only), "kim2023"])
def test_mirrors_stand_in_for_lost_labels(scene: Path, tmp_path: Path, name: str) -> None:
    """A stage that lost LabelsAPI and our component kinds reads the same from the `userProperties:` mirrors."""
    write_taxonomy_layer(scene, name)
    flat = Usd.Stage.Open(str(scene / "scene.usda")).Flatten()
    flat.Export(str(tmp_path / "whole.usdc"))
    lost: list[Sdf.Path] = []
    flat.Traverse(Sdf.Path.absoluteRootPath, lost.append)
    with Sdf.ChangeBlock():
        for path in lost:
            if path.IsPropertyPath() and path.name.startswith(("semantics:labels:", "falsework:component:kind")):
                spec = flat.GetAttributeAtPath(path)
                spec.owner.RemoveProperty(spec)
            elif path.IsPrimPath():
                flat.GetPrimAtPath(path).ClearInfo("apiSchemas")
    flat.Export(str(tmp_path / "stripped.usdc"))
    left: list[Sdf.Path] = []
    flat.Traverse(Sdf.Path.absoluteRootPath, left.append)
    assert any("semantics:labels" in path.pathString for path in lost)
    assert not any("semantics:labels" in path.pathString for path in left)
    whole, stripped = read_stage(tmp_path / "whole.usdc"), read_stage(tmp_path / "stripped.usdc")
    assert labels_of(stripped) == labels_of(whole) == labels_of(read_stage(scene / "scene.usda"))
    assert stripped.draws.label.tolist() == whole.draws.label.tolist()
    assert len(set(whole.draws.label.tolist())) > 2
    for path in lost:  # the mirrors were all that was left: without them everything is background
        if path.IsPropertyPath() and path.name.startswith("userProperties:c"):
            spec = flat.GetAttributeAtPath(path)
            spec.owner.RemoveProperty(spec)
    flat.Export(str(tmp_path / "bare.usdc"))
    assert set(read_stage(tmp_path / "bare.usdc").draws.label.tolist()) == {0}


def test_settings_switch_the_layers(tmp_path: Path) -> None:
    """A scenario's `[labels]` section: the scene is authored with the layers in place, sound and in its manifest."""
    folder = author(tmp_path, background={"name": "none"}, labels={"taxonomy": "hgcnn", "replicator": True})
    assert sublayers(folder)[1:3] == ["./compat_replicator.usda", "./taxonomies/hgcnn.usdc"]
    assert validate_scene(folder / "scene.usda") == []
    assert changed_files(folder) == []
    assert read_stage(folder / "scene.usda").classes == taxonomy("hgcnn").rows
