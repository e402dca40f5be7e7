"""A scene in one file for other programs: usdz or GLB, unchanged or with everything baked into plain textures."""

import tempfile
from pathlib import Path

from authoring.exchange.bake_down import bake_down
from authoring.exchange.glb import write_glb
from authoring.exchange.package import package_scene
from authoring.scenes.inventory import scene_files
from groundwork.errors import InputError
from groundwork.output.file import fresh_file
from usd_schemas.guard.layer_walk import Warn


def export_scene(scene: Path, out: Path, bake: bool, texels: int, warn: Warn) -> list[str]:
    """Write a scene as one file.

    Args:
        scene: Root layer.
        out: File to write, `.usdz` or `.glb`.
        bake: Bake macro and fine detail into the textures.
        texels: Texels along a side of each baked texture [px].
        warn: Called with one line for each thing that is left out.

    Returns:
        Names of the entries (usdz) or nodes (GLB).

    Raises:
        InputError: Another suffix, a scene that cannot be packaged, or an existing file that is not ours.
    """
    writers = {".usdz": package_scene, ".glb": lambda root, file: write_glb(root, file, warn)}
    if out.suffix not in writers:
        raise InputError("not a package", where=out, value=out.suffix, allowed=", ".join(writers))
    inputs = [scene, *(scene.resolve().parent / name for name in scene_files(scene))]
    with fresh_file(out, inputs) as temporary:
        if not bake:
            return writers[out.suffix](scene, temporary)
        with tempfile.TemporaryDirectory() as folder:
            return writers[out.suffix](bake_down(scene, Path(folder), texels, warn), temporary)
