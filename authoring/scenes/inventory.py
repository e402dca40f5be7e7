"""Contents of a scene: its tree, choices, counts, surveys, and the hash of every layer."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Usd, UsdGeom, UsdUtils

from authoring.layers.selection import AXES
from authoring.scenes.manifest import changed_files
from authoring.scenes.validate import pickable_prims, surfaces
from groundwork.canonical import digest, file_digest
from groundwork.errors import InputError
from usd_schemas.apis import direct_label, read_component, read_survey
from usd_schemas.components import class_of, component_classes
from usd_schemas.reading.labels import read_taxonomy
from usd_schemas.tokens import CLASS_TAXONOMY, COMPONENT_TAXONOMY

_BACKGROUND = "background"  # class of everything outside a bridge


@dataclass(frozen=True)
class Inventory:
    """Summary of a scene.

    Attributes:
        tree: Prim path, type, kind and number of surfaces below, for the upper prims; an instance counts as one.
        choices: Axis (or prim and variant set) to the available names.
        selected: Axis to the name selected.
        components: Component kind to number of surfaces and instances; `(none)` where none is known.
        classes: Class in the active table to the same.
        members: Instance id, component kind, class and prim path of every part that is not background, by id.
        triangles: Triangles of every visible mesh, instances counted each time.
        surveys: Survey id to number of images and their size [px].
        layers: Layer or texture, relative to the scene, to SHA-256, sorted.
        scene_hash: Hash of these files.
        variant_hash: Hash of these files and the selections.
        changed: Files that differ from the manifest.
    """

    tree: list[dict[str, Any]]
    choices: dict[str, list[str]]
    selected: dict[str, str]
    components: dict[str, int]
    classes: dict[str, int]
    members: list[dict[str, Any]]
    triangles: int
    surveys: dict[str, dict[str, int]]
    layers: dict[str, str]
    scene_hash: str
    variant_hash: str
    changed: list[str]


def take_inventory(path: Path, depth: int = 4) -> Inventory:
    """Examine a stage.

    Args:
        path: Root layer of a scene, or any other stage.
        depth: Levels of the tree.

    Raises:
        InputError: USD cannot open the file.
    """
    try:
        stage = Usd.Stage.Open(str(path.resolve()))
    except Exception as error:
        raise InputError("not readable as a USD stage", where=path, hint="Check the file") from error
    shown = list(pickable_prims(stage))
    table = read_taxonomy(stage, lambda line: None)
    components: Counter[str] = Counter()
    classes: Counter[str] = Counter()
    members: list[dict[str, Any]] = []
    for prim in shown:
        component, label = _label(prim)
        named = table.class_of(component, label)
        components[component or "(none)"] += 1
        classes[named] += 1
        if label != _BACKGROUND and (number := read_component(prim).instance_id):
            members.append({"id": number, "component": component, "class": named, "path": str(prim.GetPath())})
    files = scene_files(path)
    choices, chosen = _choices(stage)
    return Inventory(
        tree=_tree(stage, shown, depth),
        choices=choices,
        selected=chosen,
        components=dict(sorted(components.items())),
        classes=dict(sorted(classes.items())),
        members=sorted(members, key=lambda row: row["id"]),
        triangles=sum(_triangles(prim) for prim in surfaces(stage)),
        surveys=_surveys(stage),
        layers=files,
        scene_hash=digest(files),
        variant_hash=digest([files, chosen]),
        changed=changed_files(path.resolve().parent),
    )


def scene_files(path: Path) -> dict[str, str]:
    """Hash every layer and texture that a stage refers to, in any variant.

    Args:
        path: Root layer.

    Returns:
        Path relative to the folder of the root layer to SHA-256, sorted.
    """
    home = path.resolve().parent
    layers, assets, _ = UsdUtils.ComputeAllDependencies(str(path.resolve()))
    files = {Path(layer.realPath) for layer in layers if layer.realPath} | {Path(str(asset)) for asset in assets}
    named = {_name(file, home): file for file in files if file.is_file()}
    return {name: file_digest(file) for name, file in sorted(named.items())}


def _name(file: Path, home: Path) -> str:
    return file.relative_to(home).as_posix() if file.is_relative_to(home) else file.name


def _label(prim: Usd.Prim) -> tuple[str, str]:
    component, label = "", ""
    while prim and not prim.IsPseudoRoot() and not label:
        component = component or direct_label(prim, COMPONENT_TAXONOMY) or read_component(prim).kind
        label = direct_label(prim, CLASS_TAXONOMY)
        if not label and component in component_classes():
            label = class_of(component)
        prim = prim.GetParent()
    return component, label or _BACKGROUND


def _choices(stage: Usd.Stage) -> tuple[dict[str, list[str]], dict[str, str]]:
    axes = {path: axis for axis, path in AXES.items()}
    choices, chosen = {}, {}
    for prim in stage.Traverse():
        for name in prim.GetVariantSets().GetNames():
            variants = prim.GetVariantSet(name)
            axis = name if axes.get(str(prim.GetPath())) == name else f"{prim.GetPath()}:{name}"
            choices[axis] = sorted(variants.GetVariantNames())
            chosen[axis] = variants.GetVariantSelection()
    return dict(sorted(choices.items())), dict(sorted(chosen.items()))


def _tree(stage: Usd.Stage, shown: list[Usd.Prim], depth: int) -> list[dict[str, Any]]:
    below: Counter[str] = Counter()
    for prim in shown:
        below.update(str(prefix) for prefix in prim.GetPath().GetPrefixes())
    rows = []
    walk = iter(Usd.PrimRange.Stage(stage))
    for prim in walk:
        path = str(prim.GetPath())
        rows.append(
            {
                "path": path,
                "type": str(prim.GetTypeName()),
                "kind": str(Usd.ModelAPI(prim).GetKind()),
                "surfaces": below[path],
            }
        )
        if prim.GetPath().pathElementCount >= depth:
            walk.PruneChildren()
    return rows


def _triangles(prim: Usd.Prim) -> int:
    if prim.IsA(UsdGeom.Mesh):
        if not _is_drawn(prim):
            return 0
        counts = UsdGeom.Mesh(prim).GetFaceVertexCountsAttr().Get()
        return 0 if counts is None else int(np.sum(np.asarray(counts) - 2))
    if not prim.IsA(UsdGeom.PointInstancer):
        return 0
    instancer = UsdGeom.PointInstancer(prim)
    targets = instancer.GetPrototypesRel().GetTargets()
    stage = prim.GetStage()
    each = [sum(_triangles(part) for part in Usd.PrimRange(stage.GetPrimAtPath(target))) for target in targets]
    rows = np.bincount(np.asarray(instancer.GetProtoIndicesAttr().Get() or [], np.int64), minlength=len(each))
    return int(np.dot(rows[: len(each)], each))


def _is_drawn(part: Usd.Prim) -> bool:
    return UsdGeom.Imageable(part).ComputePurpose() != UsdGeom.Tokens.proxy


def _surveys(stage: Usd.Stage) -> dict[str, dict[str, int]]:
    found = {}
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.Camera):
            samples = {code for op in UsdGeom.Camera(prim).GetOrderedXformOps() for code in op.GetTimeSamples()}
            facts = read_survey(prim, 0)
            size = facts.calibration
            found[facts.id or prim.GetName()] = {
                "images": max(len(samples), 1),
                "width": size.width if size else 0,
                "height": size.height if size else 0,
            }
    return found
