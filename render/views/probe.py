"""Check of the driver: whether one small frame is drawn correctly, pixel by pixel.

`python -m render.views.probe` serves one request {device, frame} of a parent process.
"""

from dataclasses import asdict
from typing import Any

import numpy as np

from groundwork.child import answer_parent
from groundwork.progress import SILENT, Progress
from render.gpu.context import Gl, open_context
from render.settings import RenderSettings
from render.views.prepare import prepare
from usd_schemas.components import class_rows
from usd_schemas.flat_scene import Draws, FlatScene, Geometry, Material, Sun
from usd_schemas.pinhole import Pinhole

_SIDE = 64  # [px]
_DEPTH = 2.0  # [m]


def wrong_pixels(gl: Gl) -> int:
    """Draw a wall that fills the left half of a 64x64 frame, and count the pixels that are wrong.

    Args:
        gl: Open context.

    Returns:
        Pixels whose surface or depth is wrong [px].
    """
    camera = Pinhole(_SIDE, _SIDE, _SIDE, _SIDE, _SIDE / 2, _SIDE / 2)
    prepared = prepare(gl, _left_wall(), RenderSettings(quality="fast", shadow_size=256), SILENT)
    view = prepared.painter(camera, sharp=True).draw(np.eye(4), 0.1)
    wall = np.broadcast_to(np.arange(_SIDE) < _SIDE // 2, (_SIDE, _SIDE))
    right = (view.draw == wall) & np.where(wall, np.abs(view.depth - _DEPTH) < 1e-5, np.isinf(view.depth))
    return int((~right).sum())


def _left_wall() -> FlatScene:
    """Build a quad at x <= 0, across the optical axis of a camera at the origin that looks along +z."""
    positions = np.array([[-9, -9, _DEPTH], [0, -9, _DEPTH], [0, 9, _DEPTH], [-9, 9, _DEPTH]], np.float32)
    flat = np.zeros((4, 2), np.float32)
    geometry = Geometry(
        positions,
        np.tile(np.array([0, 0, -1], np.float32), (4, 1)),
        flat,
        flat,
        np.ones((4, 3), np.float32),
        np.array([[0, 2, 1], [0, 3, 2]], np.uint32),
        np.array([0], np.int32),
        np.array([2], np.int32),
        np.array([1], np.uint8),
    )
    draws = Draws(
        np.array([0], np.int32),
        np.eye(4)[None],
        np.array([0], np.int32),
        np.array([1], np.uint32),
        np.array([0], np.uint8),
    )
    sun = Sun((0.0, 0.6, -0.8), (3.0, 3.0, 3.0))
    return FlatScene(geometry, draws, (Material("grey"),), sun, None, (), (), (), class_rows(), (), "probe")


def _serve(request: dict[str, Any], progress: Progress) -> dict[str, Any]:
    gl = open_context(str(request.get("device", "auto")))
    try:
        answer = asdict(gl.driver)
        return {**answer, "wrong_pixels": wrong_pixels(gl)} if request.get("frame") else answer
    finally:
        gl.close()


if __name__ == "__main__":
    answer_parent(_serve)
