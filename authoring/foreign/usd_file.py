"""A user's USD file as one layer, to be copied into a layer of a scene."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pxr import Sdf, Usd, UsdShade, UsdUtils

from authoring.foreign.prototypes import name_prototypes
from groundwork.errors import InputError, MissingError
from usd_schemas.guard.layer_walk import Warn
from usd_schemas.reading.mtlx import Adopted
from usd_schemas.reading.parse_errors import reason_of


def open_foreign(file: Path, warn: Warn) -> Usd.Stage:
    """Open a user's file completely, including MaterialX documents.

    Args:
        file: USD file, checked by `usd_schemas.guard.guard.check_stage` if its origin is unknown.
        warn: Called with one line for each thing of a document that was not read.

    Raises:
        InputError: Missing, not USD, or a prim is bound to a missing material.
    """
    if not file.is_file():
        raise MissingError("no such file", where=file, hint="Check the path")
    try:
        documents = Adopted(file)  # the stage keeps the composed layers
        stage = Usd.Stage.Open(str(file.resolve()), Usd.Stage.LoadAll)
    except Exception as error:
        what = f"not readable as USD: {reason_of(error)}"
        raise InputError(what, where=file, allowed="usda, usdc, usd, usdz") from error
    for note in documents.notes:
        warn(note)
    for prim in Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()):
        for target in UsdShade.MaterialBindingAPI(prim).GetDirectBindingRel().GetTargets():
            if not stage.GetPrimAtPath(target):
                raise InputError(
                    "has a material that is not in the file",
                    where=file,
                    field=str(prim.GetPath()),
                    value=str(target),
                    hint="Export it with its materials, below one root prim",
                )
    return stage


def flatten_foreign(stage: Usd.Stage) -> Sdf.Layer:
    """Flatten a stage, including its selected variants and references.

    Args:
        stage: The stage.

    Returns:
        A layer in memory whose asset paths are absolute.
    """
    quiet = UsdUtils.CoalescingDiagnosticDelegate()  # suppresses messages about metadata that USD does not know
    try:
        layer = stage.Flatten(addSourceFileComment=False)
    finally:
        del quiet
    name_prototypes(layer)
    return layer


def adopt(source: Sdf.Layer, target: Sdf.Layer, place: Sdf.Path) -> None:
    """Copy every root prim of a layer below a prim of another, with all targets pointing there.

    Args:
        source: Flattened layer.
        target: Layer that receives the prims.
        place: Prim of it.
    """
    roots = {prim.path for prim in source.rootPrims}
    for path in sorted(roots):
        Sdf.CopySpec(source, path, target, place.AppendChild(path.name))

    def moved(path: Sdf.Path) -> Sdf.Path:
        outside = not path.HasPrefix(place) and path.GetPrefixes()[:1] and path.GetPrefixes()[0] in roots
        return path.ReplacePrefix(Sdf.Path.absoluteRootPath, place) if outside else path

    def repoint(path: Sdf.Path) -> None:
        spec = target.GetObjectAtPath(path)
        if isinstance(spec, Sdf.RelationshipSpec):
            _replace(spec.targetPathList, moved)
        elif isinstance(spec, Sdf.AttributeSpec):
            _replace(spec.connectionPathList, moved)
        elif isinstance(spec, Sdf.PrimSpec):
            _replace(spec.referenceList, lambda arc: arc if arc.assetPath else Sdf.Reference("", moved(arc.primPath)))

    target.Traverse(place, repoint)


def safe_name(stem: str) -> str:
    """Convert a file's stem to a prim or variant name.

    Args:
        stem: Any text.
    """
    name = re.sub(r"[^A-Za-z0-9_]", "_", stem)[:60]
    return name if name[:1].isalpha() else f"user_{name}"


def holder_of(stage: Usd.Stage, path: str) -> str:
    """Find the material, else the prim, that refers to a file.

    Args:
        stage: The stage of a user's file.
        path: Absolute path of the file.
    """
    for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
        for attribute in prim.GetAttributes():
            value = attribute.Get()
            if isinstance(value, Sdf.AssetPath) and value.path and path.endswith(value.path.removeprefix("./")):
                while prim and not prim.IsA(UsdShade.Material) and not prim.GetParent().IsPseudoRoot():
                    prim = prim.GetParent()
                return str(prim.GetPath())
    return ""


def _replace(listing: Any, moved: Callable[[Any], Any]) -> None:
    items = list(listing.GetAppliedItems())
    if items:
        listing.ClearEditsAndMakeExplicit()
        for item in items:
            listing.explicitItems.append(moved(item))
