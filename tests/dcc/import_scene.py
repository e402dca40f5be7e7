"""Runs inside Blender: opens one of our scenes and writes down what arrived.

Usage: python import_scene.py SCENE FACTS_JSON
"""

import json
import sys
from pathlib import Path

import bpy  # pyright: ignore[reportMissingImports]


def main(scene_file: str, facts: str) -> None:
    """Import and measure.

    Args:
        scene_file: Our `scene.usda`.
        facts: JSON file to write.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.usd_import(filepath=scene_file)
    scene = bpy.context.scene
    cameras = [thing for thing in scene.objects if thing.type == "CAMERA"]
    found = []
    for camera in sorted(cameras, key=lambda thing: thing.name):
        poses = []
        for frame in range(scene.frame_start, scene.frame_end + 1):
            scene.frame_set(frame)
            poses.append([list(row) for row in camera.matrix_world])
        lens = camera.data
        found.append(
            {
                "name": camera.name,
                "lens": lens.lens,
                "sensor": lens.sensor_width,
                "near": lens.clip_start,
                "poses": poses,
            }
        )
    boxes = {}
    for thing in scene.objects:
        if thing.type == "MESH" and len(thing.data.vertices):
            placed = [thing.matrix_world @ vertex.co for vertex in thing.data.vertices]
            boxes[thing.name] = [
                [min(c) for c in zip(*placed, strict=True)],
                [max(c) for c in zip(*placed, strict=True)],
            ]
    images = sorted({Path(image.filepath).name for image in bpy.data.images if image.size[0] > 0})
    frames = [scene.frame_start, scene.frame_end]
    Path(facts).write_text(
        json.dumps({"cameras": found, "boxes": boxes, "images": images, "frames": frames}), encoding="utf-8"
    )


if __name__ == "__main__":
    main(*sys.argv[1:3])
