"""What the layers of a stage refer to, read one by one without composing them."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from pxr import Sdf, UsdUtils

from groundwork.errors import InputError

Warn = Callable[[str], None]

_REMOTE = re.compile(r"^[A-Za-z][A-Za-z0-9+.-]+:")  # a drive letter is one letter
_TILES = re.compile(r"<UDIM>|<UVTILE>|<ATTR:[^>]*>")


@dataclass(frozen=True)
class Bounds:
    """Where files of a stage may lie.

    Attributes:
        home: Folder of the root layer; lines name files relative to it.
        roots: Resolved folders.
    """

    home: Path
    roots: tuple[Path, ...]

    def contain(self, file: Path) -> bool:
        """Tell whether a resolved path lies below one of the roots.

        Args:
            file: Resolved path.
        """
        return any(file.is_relative_to(root) for root in self.roots)

    def name(self, file: Path) -> str:
        """Name a file as people know it.

        Args:
            file: Resolved path.
        """
        return f"./{file.relative_to(self.home).as_posix()}" if file.is_relative_to(self.home) else str(file)


def walk_layers(path: Path, bounds: Bounds, warn: Warn) -> tuple[Path, ...]:
    """Follow every arc and asset of a stage, those of unselected variants too, and refuse the first that leads outside.

    Args:
        path: Resolved path of the root layer.
        bounds: Where files may lie.
        warn: Called with one line for each file that is not there.

    Returns:
        Every layer file, the root layer first.

    Raises:
        InputError: A path that climbs out of the roots, is absolute, or remote; or a layer that cannot be read.
    """
    pending, layers, missing = [path], [], set()
    while pending:
        file = pending.pop(0)
        if file in layers:
            continue
        layers.append(file)
        layer = open_layer(file, bounds)
        for name in _references(file, layer):
            target = _target(layer, file, name, bounds)
            if target in missing or _TILES.search(name):
                continue
            if not target.exists():
                missing.add(target)
                warn(f"{bounds.name(file)}{_holder(layer, name)}: there is no file {name}")
            elif Sdf.FileFormat.FindByExtension(target.suffix.lstrip(".")):
                pending.append(target)
    return tuple(layers)


def open_layer(file: Path, bounds: Bounds) -> Sdf.Layer:
    """Open one layer file.

    Args:
        file: Resolved path.
        bounds: Names it in the error.

    Raises:
        InputError: USD cannot read it.
    """
    try:
        layer = Sdf.Layer.FindOrOpen(str(file))
    except Exception as error:
        reason = str(error).strip().splitlines()[-1].strip()
        raise InputError(f"not readable as USD: {reason}", where=bounds.name(file), mend="Check the file") from None
    if layer is None:
        raise InputError("not readable as USD", where=bounds.name(file), mend="Check the file")
    return layer


def resolve(layer: Sdf.Layer, name: str) -> str:
    """Evaluate an asset path that is an expression with the layer's own variables; others stay.

    Args:
        layer: Layer that holds it.
        name: Asset path as authored.
    """
    if not Sdf.VariableExpression.IsExpression(name):
        return name
    result = Sdf.VariableExpression(name).Evaluate(dict(layer.expressionVariables))
    return str(result.value) if isinstance(result.value, str) else ""


def _references(file: Path, layer: Sdf.Layer) -> Iterator[str]:
    if file.suffix == ".usdz":  # its paths stay in the package, but for absolute ones
        for name in layer.GetCompositionAssetDependencies():
            if name.startswith("/") or _REMOTE.match(name):
                yield name
        return
    expressions = [
        name for name in layer.GetCompositionAssetDependencies() if Sdf.VariableExpression.IsExpression(name)
    ]
    bare = {name.strip("`\"' ") for name in expressions}
    named = {name for group in UsdUtils.ExtractExternalReferences(str(file)) for name in group}
    evaluated = {resolve(layer, name) for name in expressions}
    yield from sorted(name for name in (named - bare) | evaluated if name)


def _target(layer: Sdf.Layer, file: Path, name: str, bounds: Bounds) -> Path:
    remote = bool(_REMOTE.match(name))
    target = (file.parent / name.partition("[")[0]).resolve()
    if remote or not bounds.contain(target):
        how = "is remote" if remote else "leads out of the allowed folders"
        raise InputError(
            f"{name} {how}", where=f"{bounds.name(file)}{_holder(layer, name)}",
            allowed="files below the folder of the root layer",
            mend="Copy the file there" + ("" if remote else ", or name its folder with --allow-root"),
        )  # fmt: skip
    return target


def _holder(layer: Sdf.Layer, name: str) -> str:
    """Name the first prim of a layer that names a file; only asked when something is wrong with it."""
    found: list[str] = []

    def look(path: Sdf.Path) -> None:
        spec = layer.GetObjectAtPath(path)
        if found or spec is None or path == Sdf.Path.absoluteRootPath:
            return
        texts = [str(spec.GetInfo(key)) for key in spec.ListInfoKeys()]
        if isinstance(spec, Sdf.AttributeSpec):
            texts += [str(layer.QueryTimeSample(path, time)) for time in layer.ListTimeSamplesForPath(path)[:1000]]
        if any(name in text for text in texts):
            found.append(f": {path.GetPrimPath()}")

    layer.Traverse("/", look)
    return found[0] if found else ""
