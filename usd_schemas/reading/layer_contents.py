"""The files that a stage depends on, found without composing it: the content of every layer that any arc can reach."""

from pathlib import Path

from pxr import Ar, Sdf, Tf, UsdUtils

from groundwork.canonical import file_digest
from groundwork.errors import InputError
from usd_schemas.reading.mtlx import SUFFIX, named_files, read_document
from usd_schemas.reading.tiles import MARK, tiles_of

_VARIABLE = "${"  # the meaning of an asset path with a variable depends on other layers
_THERE, _MISSING = "there", "missing"


def layer_contents(path: Path) -> dict[str, str] | None:
    """Hash every layer that a stage can read, including those of unselected variants.

    Args:
        path: A USD file.

    Returns:
        Hash of each layer by its name, which is relative to the folder of the root layer if it is below that; and for
        each other file that a layer refers to, whether it exists. None if that needs a composition.
    """
    root = path.resolve()
    if not root.is_file():
        return None
    quiet = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        with Ar.ResolverContextBinder(Ar.GetResolver().CreateDefaultContextForAsset(str(root))):
            return _walk(root)
    except Tf.ErrorException:  # a layer that cannot be read: composition reports it
        return None
    finally:
        del quiet


def name_from(home: Path, file: Path) -> str:
    """Name a file relative to a folder if it is below it, else by its whole path.

    Args:
        home: Resolved folder.
        file: Resolved path.
    """
    return f"./{file.relative_to(home).as_posix()}" if file.is_relative_to(home) else file.as_posix()


def _walk(root: Path) -> dict[str, str] | None:
    found: dict[str, str] = {}
    pending = [root]
    while pending:
        file = pending.pop()
        name = name_from(root.parent, file)
        if name in found:
            continue
        found[name] = file_digest(file)
        if file.suffix == ".usdz":  # a package contains all files that it reads
            continue
        layer = Sdf.Layer.FindOrOpen(str(file))
        named = {asset for group in UsdUtils.ExtractExternalReferences(str(file)) for asset in group}
        if layer is None or any(
            _VARIABLE in asset or Sdf.VariableExpression.IsExpression(asset)
            for asset in named.union(layer.GetCompositionAssetDependencies())
        ):
            return None
        for asset in sorted(named):
            target = _resolve(layer, asset)
            if MARK in asset:
                found[f"{name}: {asset}"] = _tiles(layer.ComputeAbsolutePath(asset))
            elif target is None:
                found[f"{name}: {asset}"] = _MISSING
            elif Sdf.FileFormat.FindByExtension(target.suffix.lstrip(".")):
                pending.append(target)
            elif target.suffix.lower() == SUFFIX:
                _add_document(root.parent, target, found)
            else:
                found[name_from(root.parent, target)] = _THERE
    return found


def _add_document(home: Path, file: Path, found: dict[str, str]) -> None:
    """Add a MaterialX document: its content, and whether its textures exist."""
    name = name_from(home, file)
    found[name] = file_digest(file)
    try:
        pictures = named_files(read_document(file))
    except InputError:
        return
    for picture in pictures:
        target = (file.parent / picture).resolve()
        if MARK in picture:
            found[f"{name}: {picture}"] = _tiles(str(file.parent / picture))
        elif target.is_file():
            found[name_from(home, target)] = _THERE
        else:
            found[f"{name}: {picture}"] = _MISSING


def _resolve(layer: Sdf.Layer, asset: str) -> Path | None:
    resolved = str(Ar.GetResolver().Resolve(layer.ComputeAbsolutePath(asset.partition("[")[0])))
    return Path(resolved).resolve() if resolved and Path(resolved).is_file() else None


def _tiles(pattern: str) -> str:
    return ",".join(map(str, tiles_of(pattern))) or _MISSING
