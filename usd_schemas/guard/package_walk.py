"""Check of usdz packages: no layer in one may refer to a file outside."""

import re
from pathlib import Path
from zipfile import BadZipFile, ZipFile

from pxr import Ar, Sdf, UsdUtils

from groundwork.errors import InputError
from groundwork.foreign_file import check_regular
from usd_schemas.reading.parse_errors import reason_of

MOST_LAYERS = 20_000  # of one package, including packages inside it
_ELSEWHERE = re.compile(r"^(?:[A-Za-z][A-Za-z0-9+.-]*:|[/\\])")  # a scheme, a drive or an absolute path
_CLIMBS = re.compile(r"(?:^|\[)\.\./")  # a path above the root of a package, as USD writes it


def check_package(file: Path, where: str) -> None:
    """Check every layer of a package, even if the root layer does not reach it, and of nested packages.

    Args:
        file: `.usdz` file.
        where: Its name in the error.

    Raises:
        InputError: Not a package, a layer that cannot be read, or a path that is absolute, remote or leaves the
            package.
    """
    check_regular(file)
    try:
        with ZipFile(file) as archive:
            names = archive.namelist()
    except (BadZipFile, OSError, ValueError, NotImplementedError):
        raise InputError("not readable as a usdz package", where=where, hint="Check the file") from None
    pending = [f"{file}[{name}]" for name in names if is_layer(name)]
    seen: set[str] = set()
    while pending:
        identifier = pending.pop()
        if identifier in seen:
            continue
        seen.add(identifier)
        if len(seen) > MOST_LAYERS:
            raise InputError("holds too many layers", where=where, allowed=f"up to {MOST_LAYERS}")
        inside = f"{where}[{identifier.partition('[')[2]}"
        layer = _opened(identifier, inside)
        for name in named_by(layer, identifier):
            target = found_by(layer, name)
            if _ELSEWHERE.match(name) or _CLIMBS.search(target) or not target.startswith(f"{file}["):
                raise InputError(
                    f"{name} leads out of the package",
                    where=inside,
                    allowed="files inside the package",
                    hint="Package it again with all the files that it uses",
                )
            if is_layer(target.rstrip("]")):
                pending.append(target)


def is_layer(name: str) -> bool:
    """Tell whether a name's suffix is that of a layer or a package.

    Args:
        name: File name, or path inside a package.
    """
    return bool(Sdf.FileFormat.FindByExtension(name.rpartition(".")[2]))


def named_by(layer: Sdf.Layer, identifier: str) -> list[str]:
    """List every file that a layer refers to in any arc, variant or attribute, with expressions evaluated.

    Args:
        layer: An open layer.
        identifier: Its path; inside a package, if it is in one.
    """
    arcs = list(layer.GetCompositionAssetDependencies())
    bare = {name.strip("`\"' ") for name in arcs if Sdf.VariableExpression.IsExpression(name)}
    named = {name for group in UsdUtils.ExtractExternalReferences(identifier) for name in group}
    return sorted(name for name in (named - bare) | {evaluated(layer, name) for name in arcs} if name)


def evaluated(layer: Sdf.Layer, name: str) -> str:
    """Evaluate an asset path that is an expression with the layer's own variables; others are returned unchanged.

    Args:
        layer: Layer that holds it.
        name: Asset path as authored.
    """
    if not Sdf.VariableExpression.IsExpression(name):
        return name
    result = Sdf.VariableExpression(name).Evaluate(dict(layer.expressionVariables))
    return str(result.value) if isinstance(result.value, str) else ""


def found_by(layer: Sdf.Layer, name: str) -> str:
    """Find the file that USD would open for a name: it also searches the current folder.

    Args:
        layer: Layer that holds the name.
        name: Asset path.

    Returns:
        Where it is or would be, as USD writes it.
    """
    path = Sdf.ComputeAssetPathRelativeToLayer(layer, name)
    return str(Ar.GetResolver().Resolve(path)) or path


def _opened(identifier: str, where: str) -> Sdf.Layer:
    try:
        layer = Sdf.Layer.FindOrOpen(identifier)
    except Exception as error:
        raise InputError(f"not readable as USD: {reason_of(error)}", where=where, hint="Check the file") from None
    if layer is None:
        raise InputError("not readable as USD", where=where, hint="Check the file")
    return layer
