"""Differences of two scenes: moved, reshaped, recoloured, relabelled, added and removed prims."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt

from authoring.layers.selection import selected
from authoring.scenes.inventory import scene_files
from groundwork.canonical import file_digest
from groundwork.errors import InputError
from usd_schemas import tokens
from usd_schemas.apis import direct_label, read_component

TOLERANCE = 1e-6  # [m], [1] precision of the values in scenes

_SHAPE = {
    "points",
    "faceVertexCounts",
    "faceVertexIndices",
    "positions",
    "orientations",
    "scales",
    "protoIndices",
    "normals",
    "radius",
    "height",
    "size",
    "width",
    "length",
    "axis",
    "widths",
    "curveVertexCounts",
    "focalLength",
    "horizontalAperture",
    "verticalAperture",
    "horizontalApertureOffset",
    "verticalApertureOffset",
}


@dataclass
class SceneDiff:
    """Paths of prims in the second scene (of those removed: in the first), sorted.

    Attributes:
        selections: Axis to its choice before and after.
        moved: Prims whose own transform differs, to the distance of their origin [m]; prims below are not listed.
        reshaped: Prims with other points, faces, lens or other measures.
        look: Prims whose material differs, to the material before and after.
        relabelled: Prims with another component, class or id, to both.
        light: Lights with other values or textures.
        added: Prims that only the second scene has; the uppermost only.
        removed: Prims that only the first scene has; the uppermost only.
        layers: Files that differ, to `added`, `removed` or `changed`.
    """

    selections: dict[str, list[str]] = field(default_factory=dict)
    moved: dict[str, float] = field(default_factory=dict)
    reshaped: list[str] = field(default_factory=list)
    look: dict[str, list[str]] = field(default_factory=dict)
    relabelled: dict[str, list[list[str]]] = field(default_factory=dict)
    light: list[str] = field(default_factory=list)
    added: list[str] = field(default_factory=list)
    removed: list[str] = field(default_factory=list)
    layers: dict[str, str] = field(default_factory=dict)

    @property
    def same(self) -> bool:
        """Whether the composed scenes agree; their files may differ nevertheless."""
        return not any(value for name, value in vars(self).items() if name not in ("layers", "selections"))


def diff_scenes(first: Path, second: Path) -> SceneDiff:
    """Compare two composed scenes, with the variants that each selects.

    Prims are matched by path; the others by their stable id.

    Args:
        first: Root layer before.
        second: Root layer after.

    Raises:
        InputError: USD cannot open one of them.
    """
    before, after = _open(first), _open(second)
    result = SceneDiff(selections=_selections(before, after), layers=_layers(first, second))
    left, right = _prims(before), _prims(after)
    pairs = {path: path for path in left.keys() & right.keys()}
    new, gone = right.keys() - pairs.keys(), left.keys() - pairs.keys()
    theirs, ours = _by_id(right[path] for path in new), _by_id(left[path] for path in gone)
    pairs |= {ours[name]: theirs[name] for name in ours.keys() & theirs.keys()}
    looks = (_Looks(), _Looks())
    for path in sorted(pairs):
        _compare(left[path], right[pairs[path]], looks, result)
    result.added = _uppermost(right.keys() - set(pairs.values()))
    result.removed = _uppermost(left.keys() - pairs.keys())
    return result


def _open(path: Path) -> Usd.Stage:
    try:
        return Usd.Stage.Open(str(path.resolve()))
    except Exception as error:
        raise InputError("not readable as a USD stage", where=path, hint="Check the file") from error


def _prims(stage: Usd.Stage) -> dict[Sdf.Path, Usd.Prim]:
    prims = (prim for prim in stage.Traverse() if not prim.IsA(UsdShade.Material) and not prim.IsA(UsdShade.Shader))
    return {prim.GetPath(): prim for prim in prims}


def _by_id(prims: Iterable[Usd.Prim]) -> dict[str, Sdf.Path]:
    ids = [(str(prim.GetAttribute(tokens.USER_FALSEWORK_ID).Get() or ""), prim.GetPath()) for prim in prims]
    count = Counter(name for name, _ in ids)
    return {name: path for name, path in ids if name and count[name] == 1}


def _compare(before: Usd.Prim, after: Usd.Prim, looks: tuple["_Looks", "_Looks"], result: SceneDiff) -> None:
    path = str(after.GetPath())
    is_light = after.HasAPI(UsdLux.LightAPI)
    if after.IsA(UsdGeom.Xformable) and not is_light:
        distance = _distance(before, after)
        if distance is not None:
            result.moved[path] = round(distance, 6)
    if any(_differ(before, after, name) for name in _SHAPE):
        result.reshaped.append(path)
    if is_light and _values(before) != _values(after):
        result.light.append(path)
    if after.IsA(UsdGeom.Gprim) or after.IsA(UsdGeom.Subset):
        names = [look.name(prim) for look, prim in zip(looks, (before, after), strict=True)]
        contents = [look.content(prim) for look, prim in zip(looks, (before, after), strict=True)]
        if contents[0] != contents[1]:
            result.look[path] = names
    labels = [_label(before), _label(after)]
    if labels[0] != labels[1]:
        result.relabelled[path] = labels


def _distance(before: Usd.Prim, after: Usd.Prim) -> float | None:
    """Compute how far a prim's origin has moved [m]; None where its transform has not changed."""
    poses = []
    for prim in (before, after):
        xform = UsdGeom.Xformable(prim)
        codes = sorted({code for op in xform.GetOrderedXformOps() for code in op.GetTimeSamples()})
        times = [Usd.TimeCode(code) for code in codes] or [Usd.TimeCode.EarliestTime()]
        poses.append(np.array([xform.GetLocalTransformation(time) for time in times]))
    if poses[0].shape != poses[1].shape:
        return float("nan") if len(poses[0]) == len(poses[1]) else 0.0
    if np.abs(poses[0] - poses[1]).max() <= TOLERANCE:
        return None
    meters = UsdGeom.GetStageMetersPerUnit(after.GetStage())
    return float(np.linalg.norm(poses[0][:, 3, :3] - poses[1][:, 3, :3], axis=1).max()) * meters


def _differ(before: Usd.Prim, after: Usd.Prim, name: str) -> bool:
    left, right = (prim.GetAttribute(name) for prim in (before, after))
    if not left and not right:
        return False
    one, two = (attribute.Get(Usd.TimeCode.EarliestTime()) if attribute else None for attribute in (left, right))
    if one is None or two is None or isinstance(one, str):
        return one != two
    ours, theirs = (_numbers(value) for value in (one, two))
    return ours.shape != theirs.shape or bool(np.abs(ours - theirs).max(initial=0.0) > TOLERANCE)


def _numbers(value: Any) -> np.ndarray:
    if isinstance(value, Vt.QuathArray | Vt.QuatfArray):
        return np.array([[turn.GetReal(), *turn.GetImaginary()] for turn in value], np.float64)
    return np.asarray(value, np.float64)


def _label(prim: Usd.Prim) -> list[str]:
    facts = read_component(prim)
    ids = facts.instance_ids or (facts.instance_id,)
    names = [direct_label(prim, taxonomy) for taxonomy in (tokens.COMPONENT_TAXONOMY, tokens.CLASS_TAXONOMY)]
    return [*names, facts.kind, ",".join(str(number) for number in ids if number)]


def _values(prim: Usd.Prim) -> dict[str, Any]:
    """Collect the values of a prim's own attributes, files by their content."""
    return {attribute.GetName(): _plain(attribute.Get()) for attribute in prim.GetAttributes()}


def _plain(value: Any) -> Any:
    if isinstance(value, Sdf.AssetPath):
        file = Path(str(value.resolvedPath))
        return file_digest(file) if value.resolvedPath and file.is_file() else value.path
    return value


class _Looks:
    """Materials of one scene, each read once."""

    def __init__(self) -> None:
        self._known: dict[str, Any] = {}

    def name(self, prim: Usd.Prim) -> str:
        """Return the name of the material bound to a prim."""
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        return str(material.GetPath()) if material else ""

    def content(self, prim: Usd.Prim) -> Any:
        """Collect the whole content of a prim's material."""
        path = self.name(prim)
        if path not in self._known:
            root = prim.GetStage().GetPrimAtPath(path) if path else None
            below = Usd.PrimRange(root) if root else ()
            self._known[path] = {str(part.GetPath())[len(path) :]: (_values(part), _wires(part)) for part in below}
        return self._known[path]


def _wires(prim: Usd.Prim) -> list[tuple[str, str]]:
    return [
        (attribute.GetName(), str(source.MakeRelativePath(prim.GetPath())))
        for attribute in prim.GetAttributes()
        for source in attribute.GetConnections()
    ]


def _selections(before: Usd.Stage, after: Usd.Stage) -> dict[str, list[str]]:
    one, two = selected(before), selected(after)
    return {
        axis: [one.get(axis, ""), two.get(axis, "")]
        for axis in sorted(one.keys() | two.keys())
        if one.get(axis) != two.get(axis)
    }


def _layers(first: Path, second: Path) -> dict[str, str]:
    one, two = scene_files(first), scene_files(second)
    lines = {name: "added" for name in two.keys() - one.keys()}
    lines |= {name: "removed" for name in one.keys() - two.keys()}
    lines |= {name: "changed" for name in one.keys() & two.keys() if one[name] != two[name]}
    return dict(sorted(lines.items()))


def _uppermost(paths: Iterable[Sdf.Path]) -> list[str]:
    kept: list[Sdf.Path] = []
    for path in sorted(paths):
        if not kept or not path.HasPrefix(kept[-1]):
            kept.append(path)
    return [str(path) for path in kept]
