"""Files that the layers of a stage refer to, read layer by layer without composition."""

import re
import shlex
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from pxr import Sdf

from groundwork.errors import InputError
from usd_schemas.guard.package_walk import check_package, found_by, named_by
from usd_schemas.reading.mtlx import SUFFIX, named_files, read_document
from usd_schemas.reading.parse_errors import reason_of

Warn = Callable[[str], None]

_REMOTE = re.compile(r"^[A-Za-z][A-Za-z0-9+.-]+:")  # a drive letter is one letter
_SHALLOW = 2  # number of parts of a path such as /home, which contains too much to be allowed
_TILES = re.compile(r"<UDIM>|<UVTILE>|<ATTR:[^>]*>")


@dataclass(frozen=True)
class Bounds:
    """Folders in which files of a stage are allowed.

    Attributes:
        home: Folder of the root layer; lines name files relative to it.
        roots: Resolved folders.
    """

    home: Path
    roots: tuple[Path, ...]

    def contain(self, file: Path) -> bool:
        """Tell whether a resolved path is inside one of the roots.

        Args:
            file: Resolved path.
        """
        return any(file.is_relative_to(root) for root in self.roots)

    def name(self, file: Path) -> str:
        """Return a readable path of a file.

        Args:
            file: Resolved path.
        """
        return f"./{file.relative_to(self.home).as_posix()}" if file.is_relative_to(self.home) else str(file)


def walk_layers(path: Path, bounds: Bounds, warn: Warn) -> tuple[Path, ...]:
    """Follow every arc and asset of a stage, also of unselected variants, and refuse files outside the folders.

    Args:
        path: Resolved path of the root layer.
        bounds: Folders in which the files must be.
        warn: Called with one line for each file that is not there.

    Returns:
        Every layer file, the root layer first.

    Raises:
        InputError: A path that leads out of the folders, is absolute, or remote; or a layer that cannot be read.
    """
    pending, layers, missing = [path], [], set()
    while pending:
        file = pending.pop(0)
        if file in layers:
            continue
        layers.append(file)
        layer = open_layer(file, bounds)
        if file.suffix == ".usdz":
            check_package(file, bounds.name(file))
            continue
        for name in named_by(layer, str(file)):
            target = _target(layer, file, name, bounds)
            if _TILES.search(name):
                _check_tiles(file, name, bounds, warn)
                continue
            if target in missing:
                continue
            if target.exists() and not (target.is_file() or target.is_dir()):
                raise InputError(f"{name} is a pipe or a device", where=bounds.name(file), allowed="regular files")
            if not target.exists():
                _refuse_found(layer, file, name, bounds)
                missing.add(target)
                warn(f"{bounds.name(file)}{_holder(layer, name)}: there is no file {name}")
            elif Sdf.FileFormat.FindByExtension(target.suffix.lstrip(".")):
                pending.append(target)
            elif target.suffix.lower() == SUFFIX:
                _walk_document(target, bounds, warn)
    return tuple(layers)


def _walk_document(file: Path, bounds: Bounds, warn: Warn) -> None:
    """Check a MaterialX document: its textures must be in the allowed folders too."""
    document = read_document(file)
    for name in named_files(document):
        target = _inside(file, name, bounds, "")
        if _TILES.search(name):
            _check_tiles(file, name, bounds, warn)
        elif target.exists() and not target.is_file():
            raise InputError(f"{name} is not an image", where=bounds.name(file), allowed="regular files")
        elif not target.exists():
            warn(f"{bounds.name(file)}: there is no file {name}")


def _check_tiles(file: Path, name: str, bounds: Bounds, warn: Warn) -> None:
    """Check the tiles of a texture, which may be links out of the allowed folders."""
    folder, _, last = name.partition("[")[0].rpartition("/")
    form = re.compile("\\d{4}".join(map(re.escape, _TILES.split(last))))
    place = (file.parent / folder).resolve()
    tiles = sorted(one for one in place.iterdir() if form.fullmatch(one.name)) if place.is_dir() else []
    for tile in tiles:
        target = _inside(file, f"{folder}/{tile.name}" if folder else tile.name, bounds, "")
        if not target.is_file():
            raise InputError(f"{tile.name} is not an image", where=bounds.name(file), allowed="regular files")
    if not tiles and file.suffix != ".usdz":
        warn(f"{bounds.name(file)}: there is no tile of {name}")


def open_layer(file: Path, bounds: Bounds) -> Sdf.Layer:
    """Open one layer file.

    Args:
        file: Resolved path.
        bounds: Folder that its name in the error is relative to.

    Raises:
        InputError: USD cannot read it.
    """
    try:
        layer = Sdf.Layer.FindOrOpen(str(file))
    except Exception as error:
        what = f"not readable as USD: {reason_of(error)}"
        raise InputError(what, where=bounds.name(file), hint="Check the file") from None
    if layer is None:
        raise InputError("not readable as USD", where=bounds.name(file), hint="Check the file")
    return layer


def _refuse_found(layer: Sdf.Layer, file: Path, name: str, bounds: Bounds) -> None:
    """Refuse a missing file if USD would find one of that name in another folder."""
    found = found_by(layer, name).partition("[")[0]
    if found and Path(found).exists() and not bounds.contain(Path(found).resolve()):
        raise InputError(
            f"{name} is not there, and USD would read it from {Path(found).parent}",
            where=f"{bounds.name(file)}{_holder(layer, name)}",
            allowed="files below the folder of the root layer",
            hint="Copy the file there",
        )


def _target(layer: Sdf.Layer, file: Path, name: str, bounds: Bounds) -> Path:
    try:
        return _inside(file, name, bounds, "")
    except InputError:
        return _inside(file, name, bounds, _holder(layer, name))


def _inside(file: Path, name: str, bounds: Bounds, holder: str) -> Path:
    """Resolve a name; refuse a file outside the allowed folders."""
    remote = bool(_REMOTE.match(name))
    try:
        target = (file.parent / name.partition("[")[0]).resolve()
    except (OSError, ValueError):  # too long, circular links, or NUL
        raise InputError("not a file name", where=bounds.name(file), value=name) from None
    if remote or not bounds.contain(target):
        how = "is remote" if remote else "leads out of the allowed folders"
        raise InputError(
            f"{name} {how}",
            where=f"{bounds.name(file)}{holder}",
            allowed="files below the folder of the root layer",
            hint="Copy the file there" + ("" if remote else f", or add {_allowing(bounds, target)}"),
        )
    return target


def _allowing(bounds: Bounds, target: Path) -> str:
    """Return the option that would allow a file: the common folder of file and stage, or the file's own folder."""
    shared = [folder for folder in bounds.home.parents if target.is_relative_to(folder)]
    near = shared[0] if shared and len(shared[0].parts) > _SHALLOW else target.parent
    return f"--allow-root {shlex.quote(str(near))}"


def _holder(layer: Sdf.Layer, name: str) -> str:
    """Find the first prim of a layer that refers to a file; called only for errors."""
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
