"""The files of a flattened layer: those that its shaders and lights read are copied beside it, others are removed."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from pxr import Sdf

from authoring.foreign.textures import copy_texture
from groundwork.errors import InputError
from usd_schemas.guard.layer_walk import Warn

READ = "inputs:"  # namespace of the inputs of shaders, materials and lights
_ASSETS = (Sdf.ValueTypeNames.Asset, Sdf.ValueTypeNames.AssetArray)
_NOTES = ("assetInfo", "customData", "clips")  # dictionaries of prims and properties that may contain file names
_NAMED = 5


def localize(layer: Sdf.Layer, folder: Path, file: Path, holder: Callable[[str], str], warn: Warn) -> None:
    """Copy the files that a flattened layer reads, and make it refer only to these copies.

    File names that are not read, such as `assetInfo.identifier` of a referenced model, are removed: these files are not
    part of the scene.

    Args:
        layer: Flattened layer in memory, whose paths are absolute.
        folder: Existing folder that will hold the layer; receives `textures/`.
        file: The file that it came from, for errors.
        holder: Returns the prim that refers to a path, for errors.
        warn: Called with one line about attributes that are left out.

    Raises:
        InputError: A file that a shader or light reads is missing.
    """
    names: dict[str, str] = {}

    def moved(value: Any) -> Any:
        if not isinstance(value, Sdf.AssetPath):
            return Sdf.AssetPathArray([moved(one) for one in value])
        path = value.path
        if path and path not in names:
            found = copy_texture(path, folder / "textures")
            if not found:
                raise InputError(
                    "texture not found",
                    where=file,
                    field=holder(path) or None,
                    value=_short(path, file),
                    hint="Export it again with its textures beside it",
                )
            names[path] = f"./textures/{found}"
        return Sdf.AssetPath(names.get(path, ""))

    left: list[str] = []
    for spec in _specs(layer):
        _strip_notes(spec)
        if not isinstance(spec, Sdf.AttributeSpec) or spec.typeName not in _ASSETS:
            continue
        if spec.name.startswith(READ):
            _rewrite(layer, spec, moved)
            continue
        named = f"{spec.path.GetPrimPath().name}.{spec.name}"
        left += [f"{named} ({_short(path, file)})" for path in sorted({path for path in _paths(layer, spec) if path})]
        spec.owner.RemoveProperty(spec)
    layer.customLayerData = _without_paths(layer.customLayerData)
    if left:
        more = f" and {len(left) - _NAMED} more" if len(left) > _NAMED else ""
        warn(f"files that no shader and no light uses are left out: {', '.join(left[:_NAMED])}{more}")


def _specs(layer: Sdf.Layer) -> list[Any]:
    paths: list[Sdf.Path] = []
    layer.Traverse(Sdf.Path.absoluteRootPath, paths.append)
    specs = [layer.GetObjectAtPath(path) for path in paths]
    return [spec for spec in specs if isinstance(spec, Sdf.PrimSpec | Sdf.PropertySpec)]


def _rewrite(layer: Sdf.Layer, spec: Sdf.AttributeSpec, moved: Callable[[Any], Any]) -> None:
    if spec.HasDefaultValue():
        spec.default = moved(spec.default)
    for code in layer.ListTimeSamplesForPath(spec.path):
        layer.SetTimeSample(spec.path, code, moved(layer.QueryTimeSample(spec.path, code)))


def _paths(layer: Sdf.Layer, spec: Sdf.AttributeSpec) -> Iterator[str]:
    codes = layer.ListTimeSamplesForPath(spec.path)
    for value in [spec.default, *(layer.QueryTimeSample(spec.path, code) for code in codes)]:
        yield from [value.path] if isinstance(value, Sdf.AssetPath) else [one.path for one in value or ()]


def _strip_notes(spec: Sdf.PrimSpec | Sdf.PropertySpec) -> None:
    for key in _NOTES:
        if spec.HasInfo(key):
            before = dict(spec.GetInfo(key))
            after = _without_paths(before)
            if not after:
                spec.ClearInfo(key)
            elif after != before:
                spec.SetInfo(key, after)


def _without_paths(notes: dict[str, Any]) -> dict[str, Any]:
    """Remove paths from a metadata dictionary, at any depth; dictionaries left empty are removed, too."""
    kept = {}
    for key, value in notes.items():
        if isinstance(value, Sdf.AssetPath | Sdf.AssetPathArray):
            continue
        inner = _without_paths(value) if isinstance(value, dict) else value
        if inner != {} or value == {}:
            kept[key] = inner
    return kept


def _short(path: str, file: Path) -> str:
    return path.removeprefix(f"{file.resolve().parent}/")
