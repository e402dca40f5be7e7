"""Runs inside Blender's own Python: Cycles draws views of a scene, and its linear radiance is kept as it is.

Usage: python light_in_blender.py REQUEST_JSON, with `script` (folder of open_scene.py), `scene`, `poses`
(camera_to_world, axes right, down, forward), `width`, `height`, `focal` [px], `samples`, `bounces`, `folder` for the
images, and `answer`, which lists their files: float32, shape (height, width, 3), rows from the top.
"""

import json
import math
import sys
from pathlib import Path
from typing import Any

import bpy  # pyright: ignore[reportMissingImports]
import numpy as np
from mathutils import Matrix  # pyright: ignore[reportMissingImports]


def main(request: dict[str, Any]) -> None:
    """Open the scene, and draw one view after the other.

    Args:
        request: See above.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    sys.path.insert(0, request["script"])
    from open_scene import open_scene  # pyright: ignore[reportMissingImports]

    open_scene(request["scene"])
    scene = bpy.context.scene
    _choose_cycles(scene, request["samples"], request["bounces"])
    width, height = request["width"], request["height"]
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = width, height, 100
    lens = bpy.data.cameras.new("light")
    lens.sensor_fit, lens.angle = "HORIZONTAL", 2.0 * math.atan(0.5 * width / request["focal"])
    lens.clip_start, lens.clip_end = 0.1, 1e5
    scene.camera = bpy.data.objects.new("light", lens)
    scene.collection.objects.link(scene.camera)
    files = []
    for number, pose in enumerate(request["poses"]):
        scene.camera.matrix_world = Matrix(pose) @ Matrix.Diagonal((1.0, -1.0, -1.0, 1.0))
        scene.render.filepath = str(Path(request["folder"]) / f"light_{number}.exr")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        image.colorspace_settings.name = "Non-Color"  # the numbers as they stand in the file
        pixels = np.array(image.pixels[:], np.float32).reshape(height, width, 4)[::-1, :, :3]
        files.append(str(Path(request["folder"]) / f"light_{number}.npy"))
        np.save(files[-1], pixels)
    Path(request["answer"]).write_text(json.dumps(files), encoding="utf-8")


def _choose_cycles(scene: Any, samples: int, bounces: int) -> None:
    """Let Cycles follow light as far as asked, and write radiance without a film's curve."""
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples, scene.cycles.use_denoising = "CPU", samples, False
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = bounces
    scene.cycles.sample_clamp_direct = scene.cycles.sample_clamp_indirect = 0.0
    scene.view_settings.exposure = 0.0
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_mode = "RGB"
    scene.render.image_settings.color_depth = "32"


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
