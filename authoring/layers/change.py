"""Changing a layer that is on disk: opened outside USD's cache, changed, and written as a whole."""

import tempfile
from collections.abc import Callable
from pathlib import Path

from pxr import Sdf

from groundwork.errors import InputError
from groundwork.files import MANIFEST, write_bytes, write_text


def change_layer(path: Path, change: Callable[[Sdf.Layer], None]) -> None:
    """Change a layer file.

    A binary layer saved in place keeps its old content, which makes the file larger, and other stages of the process
    would see an incomplete change; therefore both formats are rewritten.

    Args:
        path: Layer file.
        change: Called with a copy of the layer in memory.
    """
    layer = Sdf.Layer.OpenAsAnonymous(str(path))
    change(layer)
    if path.suffix == ".usda":
        write_text(path, layer.ExportToString())
    else:
        with tempfile.TemporaryDirectory() as scratch:
            file = Path(scratch) / f"layer{path.suffix}"
            layer.Export(str(file))  # not atomic: a scratch file; `write_bytes` renames it
            write_bytes(path, file.read_bytes())
    known = Sdf.Layer.Find(str(path.resolve()))
    if known is not None:
        known.Reload(force=True)


def check_editable(path: Path) -> None:
    """Refuse to change stored results.

    Args:
        path: Layer file, or the folder that would receive one.

    Raises:
        InputError: It is read-only, or lies in a result of a run.
    """
    place = path.resolve()
    folders = [place, *place.parents]
    if place.stat().st_mode & 0o200 == 0 or any((folder / MANIFEST).is_file() for folder in folders):
        raise InputError("is a stored result and read-only", where=path, hint="Edit a copy: falsework scene checkout")
