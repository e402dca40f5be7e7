"""One layer out of a stage of many: the chosen variants, every arc resolved, textures still found beside it."""

from pathlib import Path

from pxr import Sdf, Usd, UsdUtils

from authoring.foreign.textures import copy_texture
from authoring.layers.layer import export
from groundwork.errors import InputError

SUFFIXES = (".usda", ".usdc", ".usd")


def flatten_scene(scene: Path, out: Path) -> list[str]:
    """Flatten a stage into one file.

    A texture below the folder of that file is named where it is; others are copied to `<stem>_textures/` beside it.

    Args:
        scene: Root layer.
        out: File to write, `.usda` or `.usdc`.

    Returns:
        Textures that were not found, as the stage names them.

    Raises:
        InputError: Not a stage, or a file name that USD cannot write.
    """
    if out.suffix not in SUFFIXES:
        raise InputError("not a USD layer", where=out, value=out.suffix, allowed=", ".join(SUFFIXES))
    try:
        stage = Usd.Stage.Open(str(scene.resolve()))
    except Exception as error:
        raise InputError("not readable as a USD stage", where=scene, mend="Check the file") from error
    out.parent.mkdir(parents=True, exist_ok=True)
    home, missing = out.resolve().parent, []

    def move(path: str) -> str:
        file = Path(path)
        if not path or (file.is_file() and file.resolve().is_relative_to(home)):
            return f"./{file.resolve().relative_to(home).as_posix()}" if path else path
        name = copy_texture(path, home / f"{out.stem}_textures")
        if not name:
            missing.append(path)
        return f"./{out.stem}_textures/{name}" if name else path

    layer = flat_layer(stage)
    UsdUtils.ModifyAssetPaths(layer, move)
    partial = out.with_name(f".{out.stem}.partial{out.suffix}")
    export(layer, partial)
    partial.replace(out)
    return sorted(set(missing))


def flat_layer(stage: Usd.Stage) -> Sdf.Layer:
    """Flatten a stage, with the metadata that only count on a root layer, and nothing about where it was.

    Args:
        stage: Any stage.
    """
    layer = stage.Flatten(addSourceFileComment=False)
    layer.documentation = stage.GetRootLayer().documentation
    return layer
