"""Whether a scene's bridge and site are still drawn as they were: what is added is made for those drawn now."""

import hashlib
from pathlib import Path

import numpy as np
from pxr import Sdf

from authoring.layers.assets import Pieces
from authoring.layers.geometry import Asset, geometry_layer
from authoring.scenes.manifest import is_as_written
from groundwork.errors import InputError

_FILE = "geometry.usdc"
_SHAPES = ("points", "primvars:st1", "positions", "protoIndices")


def check_redrawn(scene: Path, asset: Asset, name: str, pieces: Pieces) -> None:
    """Refuse to add to a scene whose bridge, or site, another version of Falsework drew differently.

    A file that somebody has changed is not compared.

    Args:
        scene: Root layer of the scene.
        asset: Paths of the asset's parts.
        name: Name of its folder.
        pieces: The asset, drawn again from the scene's recipe.

    Raises:
        InputError: It is drawn differently.
    """
    file = f"{name}/{_FILE}"
    if not is_as_written(scene.parent, file):
        return
    if _shapes(Sdf.Layer.FindOrOpen(str(scene.parent / file))) != _shapes(geometry_layer(asset, pieces)):
        raise InputError(
            f"another version of Falsework authored it: today its {name} would be another one, and what is added would "
            "not fit",
            where=scene.parent,
            hint="Author the scene again: falsework author",
        )


def _shapes(layer: Sdf.Layer) -> dict[str, str]:
    """Hash the arrays that tell the shapes of a layer's prims, by their paths."""
    found: dict[str, str] = {}

    def read(path: Sdf.Path) -> None:
        if path.IsPropertyPath() and path.name in _SHAPES:
            values = np.ascontiguousarray(layer.GetAttributeAtPath(path).default)
            found[str(path)] = hashlib.sha256(values.tobytes()).hexdigest()

    layer.Traverse(Sdf.Path.absoluteRootPath, read)
    return found
