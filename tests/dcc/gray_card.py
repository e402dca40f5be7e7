"""Runs inside Blender: imports a stage with a level card and measures its radiance with Cycles.

Usage: python gray_card.py REQUEST_JSON, with `file` (the stage), `facts` (the JSON file to write).
"""

import json
import sys
from pathlib import Path
from typing import Any

import bpy  # pyright: ignore[reportMissingImports]

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "authoring" / "exchange" / "blender"))
from open_scene import open_scene  # pyright: ignore[reportMissingImports]


def main(request: dict[str, Any]) -> None:
    """Open, render, measure.

    Args:
        request: See above.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    open_scene(request["file"])
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.seed = 256, False, 1
    picture = str(Path(request["facts"]).with_suffix(".exr"))
    scene.render.image_settings.file_format, scene.render.filepath = "OPEN_EXR", picture
    bpy.ops.render.render(write_still=True)
    pixels = list(bpy.data.images.load(picture).pixels)
    color = [sum(pixels[channel::4]) / (len(pixels) // 4) for channel in range(3)]
    suns = [lamp.energy * 2.0**lamp.exposure for lamp in bpy.data.lights if lamp.type == "SUN"]
    Path(request["facts"]).write_text(json.dumps({"colour": color, "suns": suns}), encoding="utf-8")


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
