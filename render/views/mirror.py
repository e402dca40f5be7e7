"""Reflections in water: the scene drawn from below the water surface, once per view, small, only for the photograph."""

from dataclasses import dataclass, replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from render.gpu.camera import clip_from_relative, visible_boxes
from render.gpu.context import Gl
from render.gpu.gpu_scene import GpuScene
from render.views.draw_calls import DrawCalls, Sight
from usd_schemas.pinhole import Pinhole

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_SMALLER = 5  # pixels of the photograph along a side of one pixel of the reflection
_MOST = 40_000  # triangles
_LEAST = 2.0  # [px] of the reflection: smaller objects are not drawn, because ripples hide them
_LOWEST = 0.2  # [m] a camera closer to the water has no reflections drawn for it
_NOWHERE = -1e9  # [m] a level without any water
_FAR = 3000.0  # [m] water farther away reflects only the sky


@dataclass(frozen=True)
class Image:
    """An image of the reflections in one level of water.

    Attributes:
        level: Height of the water [m].
        eye: Camera center that it was drawn for [m], shape (3,), float64.
        clip: Projection of positions on the water, relative to that center, to the image [1], shape (4, 4), float64.
    """

    level: float
    eye: F64
    clip: F64


class Mirror:
    """Draws the reflections in the nearest water of a view."""

    def __init__(self, gl: Gl, camera: Pinhole) -> None:
        """Create the image.

        Args:
            gl: Open context.
            camera: Intrinsics of every view.
        """
        self._gl = gl
        width, height = max(1, camera.width // _SMALLER), max(1, camera.height // _SMALLER)
        scale = np.array([width / camera.width, height / camera.height])
        self._camera = Pinhole(
            width, height, camera.fx * scale[0], camera.fy * scale[1], camera.cx * scale[0], camera.cy * scale[1]
        )
        self.texture = gl.context.texture((width, height), 4, dtype="nu2")
        self.texture.repeat_x = self.texture.repeat_y = False
        depth = gl.context.depth_texture((width, height))
        gl.functions.make_depth_float(depth.glo, width, height)
        self._target = gl.context.framebuffer([self.texture], depth)

    def draw(self, gpu: GpuScene, calls: DrawCalls, pose: F64, near: float, features: tuple[str, ...]) -> Image | None:
        """Draw the reflections in the nearest water; None if no water is near.

        Args:
            gpu: The scene, uploaded.
            calls: Draws its rows.
            pose: Camera pose [m], shape (4, 4), float64.
            near: Near plane [m].
            features: Features of the surfaces' shaders.
        """
        level = self._level(gpu, pose)
        if level is None:
            return None
        eye, clip = pose[:3, 3], clip_from_relative(self._camera, pose, near).astype(np.float64)
        flipped, turned = np.diag([1.0, 1.0, -1.0, 1.0]), pose.copy()
        flipped[2, 3] = 2 * (level - eye[2])
        turned[:3, :3] = flipped[:3, :3] @ pose[:3, :3]
        sight = Sight(self._camera, turned, near, (clip @ flipped).T.astype(np.float32).tobytes())
        rows = self._worth_mirroring(gpu, pose, level)
        context = self._gl.context
        self._target.use()
        context.enable_only(moderngl.DEPTH_TEST)
        context.depth_func, context.front_face = ">", "ccw"  # mirrored, which restores the winding
        self._gl.functions.clear_depth(0.0)
        self._gl.functions.clear_color(0, (0.0, 0.0, 0.0, 0.0))
        gpu.place(eye)
        gpu.bind()
        calls.surfaces(rows, replace(sight, waterline=level - eye[2]), (*features, "ABOVE"))
        calls.sky(sight, ())
        self.texture.build_mipmaps()
        return Image(level, eye, clip)

    def _level(self, gpu: GpuScene, pose: F64) -> float | None:
        """Find the height of the nearest water in view."""
        rows = visible_boxes(gpu.lower, gpu.upper, self._camera, pose)
        rows = rows[gpu.waters[rows]]
        height = (gpu.lower[rows, 2] + gpu.upper[rows, 2]) / 2
        gap = np.maximum(np.maximum(gpu.lower[rows] - pose[:3, 3], pose[:3, 3] - gpu.upper[rows]), 0.0)
        away = np.linalg.norm(gap, axis=1)
        good = np.flatnonzero((height < pose[2, 3] - _LOWEST) & (away < _FAR))
        return float(height[good[np.argmin(away[good])]]) if len(good) else None

    def _worth_mirroring(self, gpu: GpuScene, pose: F64, level: float) -> I64:
        """Choose the draws above the water that are large in the image, the largest first if there are too many."""
        lower, upper = gpu.lower.copy(), gpu.upper.copy()
        lower[:, 2], upper[:, 2] = 2 * level - gpu.upper[:, 2], 2 * level - gpu.lower[:, 2]
        rows = visible_boxes(lower, upper, self._camera, pose)
        rows = rows[(gpu.upper[rows, 2] > level + 0.05) & ~gpu.waters[rows] & ~gpu.blended[rows]]
        half = np.linalg.norm(upper[rows] - lower[rows], axis=1) / 2
        away = np.linalg.norm((lower[rows] + upper[rows]) / 2 - pose[:3, 3], axis=1)
        pixels = self._camera.fx * half / np.maximum(away - half, 1.0)
        pixels = np.minimum(pixels, self._camera.width)
        triangles = gpu.triangles(rows)
        order = np.argsort(triangles / pixels**2, kind="stable")
        kept, left = np.zeros(len(rows), bool), _MOST
        for row in order[pixels[order] > _LEAST]:
            if triangles[row] <= left:
                kept[row] = True
                left -= int(triangles[row])
        return rows[kept]


def look_up_uniforms(image: Image | None, eye: F64, anchor: F64, unit: int) -> dict[str, object]:
    """List the uniforms of the water's shader for looking up an image.

    Args:
        image: The image; or None.
        eye: Camera center of the view [m], shape (3,), float64.
        anchor: Origin of positions in the shading [m], shape (3,), float64.
        unit: Texture unit of the image.
    """
    clip, level = np.eye(4), _NOWHERE
    if image is not None:
        moved = np.eye(4)
        moved[:3, 3] = eye - image.eye
        clip, level = image.clip @ moved, image.level - anchor[2]
    return {"mirrored_image": unit, "image_from_relative": clip.T.astype(np.float32).tobytes(), "mirror_level": level}
