"""Runs inside Blender's own Python: renders a few frames of a scene with one engine, and tells what each cost.

What Blender has loaded for a frame it keeps for the next (`use_persistent_data`).

Usage: python in_blender.py REQUEST_JSON, with `script` (folder of open_scene.py), `scene`, `survey`, `engine`,
`samples`, `frames`, `folder` for the images, and `answer`, the file for the figures.
"""

import json
import os
import resource
import sys
import time
from pathlib import Path
from typing import Any

import bpy  # pyright: ignore[reportMissingImports]

_WARM_UP = 10  # [%] of the size for the first frame: scene and shaders are made ready all the same


def main(request: dict[str, Any]) -> None:
    """Open the scene, and render one frame after the other.

    Args:
        request: See above.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    sys.path.insert(0, request["script"])
    from open_scene import open_scene  # pyright: ignore[reportMissingImports]

    open_scene(request["scene"], request["survey"])
    scene = bpy.context.scene
    engine, samples = request["engine"], request["samples"]
    scene.render.engine = engine
    scene.render.use_persistent_data = True
    scene.render.image_settings.file_format = "JPEG"
    scene.render.image_settings.quality = 95
    if engine == "CYCLES":
        scene.cycles.device, scene.cycles.samples, scene.cycles.use_denoising = "CPU", samples, True
    rows = []
    for number, frame in enumerate(request["frames"]):
        scene.frame_set(frame)
        scene.render.resolution_percentage = 100 if number else _WARM_UP
        scene.render.filepath = str(Path(request["folder"]) / f"{engine}_{frame:06d}.jpg")
        cpu, wall = _cpu(), time.perf_counter()
        bpy.ops.render.render(write_still=True)
        spent = {"cpu": _cpu() - cpu, "wall": time.perf_counter() - wall}
        rows.append({**spent, "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9})
    Path(request["answer"]).write_text(json.dumps(rows), encoding="utf-8")


def _cpu() -> float:
    times = os.times()
    return times.user + times.system


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
