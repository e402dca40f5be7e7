"""Flattening of a stage to one layer: selected variants, every arc resolved, textures beside it."""

from pathlib import Path

from pxr import Sdf, Usd, UsdUtils

from authoring.foreign.prototypes import name_prototypes
from authoring.foreign.textures import copy_texture
from authoring.layers.layer import export
from authoring.layers.on_site import ROOT
from groundwork.errors import InputError
from groundwork.output.file import SIGNATURE, fresh_file
from usd_schemas import tokens

SUFFIXES = (".usda", ".usdc", ".usd")
_GENERATOR = "generator"


def flatten_scene(scene: Path, out: Path) -> list[str]:
    """Flatten a stage into one file.

    A texture below the folder of that file is referred to in place; others are copied to `<stem>_textures/` beside it.

    Args:
        scene: Root layer.
        out: File to write, `.usda` or `.usdc`.

    Returns:
        Textures that were not found, by their names in the stage.

    Raises:
        InputError: Not a stage, a file name that USD cannot write, or a file that was not flattened here.
    """
    if out.suffix not in SUFFIXES:
        raise InputError("not a USD layer", where=out, value=out.suffix, allowed=", ".join(SUFFIXES))
    try:
        stage = Usd.Stage.Open(str(scene.resolve()))
    except Exception as error:
        raise InputError("not readable as a USD stage", where=scene, hint="Check the file") from error
    inputs = [Path(layer.realPath) for layer in stage.GetUsedLayers() if layer.realPath]
    with fresh_file(out, inputs, _is_ours) as temporary:
        return _flatten(stage, out, temporary)


def _flatten(stage: Usd.Stage, out: Path, temporary: Path) -> list[str]:
    """Write the layer under a temporary name beside its final one."""
    home, missing = temporary.parent, []

    def move(path: str) -> str:
        file = Path(path)
        if not path or (file.is_file() and file.resolve().is_relative_to(home)):
            return f"./{file.resolve().relative_to(home).as_posix()}" if path else path
        name = copy_texture(path, home / f"{out.stem}_textures")
        if not name:
            missing.append(path)
        return f"./{out.stem}_textures/{name}" if name else path

    layer = flat_layer(stage)
    layer.customLayerData = {**layer.customLayerData, _GENERATOR: SIGNATURE}
    UsdUtils.ModifyAssetPaths(layer, move)
    export(layer, temporary)
    return sorted(set(missing))


def _is_ours(path: Path) -> bool:
    """Check whether a file is a layer that was flattened here."""
    try:
        layer = Sdf.Layer.OpenAsAnonymous(str(path), metadataOnly=True)
    except Exception:  # not a layer
        return False
    return layer.customLayerData.get(_GENERATOR) == SIGNATURE


def flat_layer(stage: Usd.Stage) -> Sdf.Layer:
    """Flatten a stage, with the metadata of a root layer, and without its location.

    Args:
        stage: Any stage.
    """
    layer = stage.Flatten(addSourceFileComment=False)
    layer.documentation = stage.GetRootLayer().documentation
    name_prototypes(layer)
    holder = layer.GetPrimAtPath(tokens.BACKGROUND)
    if holder is not None and ROOT in holder.nameChildren and holder.nameChildren[ROOT].specifier == Sdf.SpecifierClass:
        del holder.nameChildren[ROOT]  # the site has inherited it: nothing refers to it any more
    return layer
