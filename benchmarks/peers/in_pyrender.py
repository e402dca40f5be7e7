"""Runs in an environment of its own that has pyrender: renders the triangles of a scene, color, depth and shadows.

Usage: python in_pyrender.py REQUEST_JSON, with `scene` (an .npz of triangles), `frames`, and `answer`, the file
for the figures. pyrender 0.1.45 is of 2021: it wants numpy < 2, and PYOPENGL_PLATFORM=egl.
"""

import json
import os
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pyrender  # pyright: ignore[reportMissingImports]


def main(request: dict[str, Any]) -> None:
    """Load the triangles, and render one frame after the other.

    Args:
        request: See above.
    """
    data = np.load(request["scene"])
    width, height, fx, fy, cx, cy = data["camera"].tolist()
    scene = pyrender.Scene(ambient_light=[0.3, 0.3, 0.3])
    starts = data["start"]
    for row in range(len(starts) - 1):
        part = slice(int(starts[row]), int(starts[row + 1]))
        material = pyrender.MetallicRoughnessMaterial(baseColorFactor=[*data["color"][row].tolist(), 1.0])
        corners = data["corners"][part].reshape(-1, 3)
        sides = np.cross(
            data["corners"][part][:, 1] - data["corners"][part][:, 0],
            data["corners"][part][:, 2] - data["corners"][part][:, 0],
        )
        normals = np.repeat(sides / np.maximum(np.linalg.norm(sides, axis=1, keepdims=True), 1e-12), 3, axis=0)
        mesh = pyrender.Primitive(positions=corners, normals=normals.astype(np.float32), material=material, mode=4)
        scene.add(pyrender.Mesh([mesh]))
    sun = np.eye(4)
    sun[:3, :3] = data["sun"]
    scene.add(pyrender.DirectionalLight(intensity=4.0), pose=sun)
    camera = scene.add(pyrender.IntrinsicsCamera(fx, fy, cx, cy, znear=0.1, zfar=5000.0))
    renderer = pyrender.OffscreenRenderer(int(width), int(height))
    rows = []
    for frame in request["frames"]:
        scene.set_pose(camera, data["poses"][frame] @ np.diag([1.0, -1.0, -1.0, 1.0]))
        cpu, wall = _cpu(), time.perf_counter()
        renderer.render(scene, flags=pyrender.RenderFlags.SHADOWS_DIRECTIONAL)
        rows.append({"cpu": _cpu() - cpu, "wall": time.perf_counter() - wall})
    Path(request["answer"]).write_text(json.dumps(rows), encoding="utf-8")


def _cpu() -> float:
    times = os.times()
    return times.user + times.system


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
