"""A scene in one file for others: usdz or GLB, as it is or with everything burnt into plain textures."""

import tempfile
from pathlib import Path

from authoring.exchange.bake_down import bake_down
from authoring.exchange.glb import write_glb
from authoring.exchange.package import package_scene
from groundwork.errors import InputError
from usd_schemas.guard.layer_walk import Warn


def export_scene(scene: Path, out: Path, bake: bool, texels: int, warn: Warn) -> list[str]:
    """Write a scene as one file.

    Args:
        scene: Root layer.
        out: File to write, `.usdz` or `.glb`.
        bake: Burn macro and fine detail into the textures.
        texels: Texels along a side of each baked texture [px].
        warn: Called with one line for each thing that is left out.

    Returns:
        Names of the entries (usdz) or nodes (GLB).

    Raises:
        InputError: Another suffix, or a scene that cannot be packaged.
    """
    writers = {".usdz": lambda root: package_scene(root, out), ".glb": lambda root: write_glb(root, out, warn)}
    if out.suffix not in writers:
        raise InputError("not a package", where=out, value=out.suffix, allowed=", ".join(writers))
    if not bake:
        return writers[out.suffix](scene)
    with tempfile.TemporaryDirectory() as folder:
        return writers[out.suffix](bake_down(scene, Path(folder), texels, warn))
