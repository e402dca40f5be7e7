"""Shadow maps of the sun: one of the bridge and a coarse one of its surroundings, drawn once; a sharp one of a square.

The sharp map is only drawn again when the camera leaves its square.
"""

import moderngl
import numpy as np
from numpy.typing import NDArray

from render.gpu.context import Gl
from render.gpu.gpu_scene import GpuScene, run_commands
from render.gpu.programs import Programs, set_uniform
from render.light.daylight import Daylight
from render.light.shadow_squares import SHARP_TEXEL, ShadowSquares, share_squares
from usd_schemas.pinhole import Pinhole

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_NEAR_MARGIN = 6.0  # [m] the map of the bridge reaches beyond the region of interest
_FAR_REACH = 300.0  # [m] shadows farther away are not drawn
_FILTER = 4  # [px] a map is not used this close to its edge, because the filter would read beyond it
_CUT_OUT_UNIT = 5  # the light's own textures stay bound from image to image, in the units before
_SUNK = 0.02  # [m] by which lines on a road lie deeper in the maps, so that what they cover is not in their shadow
_NOWHERE = np.array([1.0, 0.0, 0.0, -1.0])
SHARP, NEAR, FAR = range(3)


class Shadows:
    """Depth as seen from the sun, three square maps side by side: sharp, near and far.

    Attributes:
        texture: Depth texture, three times as wide as high.
        axes: Scene position, counted from the anchor, to right and up of the sun's view [m] and to the map's depth [1],
            shape (3, 4), float64.
        maps: For each map 1 / half width [1/m], center along right and up in half widths, and how far from the center
            it may be used [1], shape (3, 4), float64.
        angle: Angular diameter of the sun [rad].
    """

    def __init__(
        self, gl: Gl, programs: Programs, gpu: GpuScene, light: Daylight, box: tuple[F64, F64], size: int
    ) -> None:
        """Draw the two maps of the scene; the sharp one stays empty.

        Args:
            gl: Open context.
            programs: Shader programs.
            gpu: Uploaded scene.
            light: Its light, with a sun.
            box: Lower and upper corner of the region of interest [m], each of shape (3,), float64.
            size: Side of each map [px].
        """
        self._gl, self._programs, self._gpu, self._size = gl, programs, gpu, size
        context = gl.context
        self.texture = context.depth_texture((3 * size, size))
        self.texture.compare_func = ""
        self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self.texture.repeat_x = self.texture.repeat_y = False
        self._framebuffer = context.framebuffer(depth_attachment=self.texture)
        low, high = gpu.lower.min(axis=0), gpu.upper.max(axis=0)
        self.axes = _sun_axes(light.sun_direction, _corners(low, high) - gpu.anchor)
        self.angle = light.sun_angle
        self.maps = np.tile(_NOWHERE, (3, 1))
        self._center: tuple[float, float] | None = None
        self._low, self._high = _flat_boxes(self.axes[:2], gpu)
        bounds = {
            NEAR: (box[0] - _NEAR_MARGIN, box[1] + _NEAR_MARGIN),
            FAR: (np.maximum(low, box[0] - _FAR_REACH), np.minimum(high, box[1] + _FAR_REACH)),
        }
        for number, corners in bounds.items():
            flat = (_corners(*corners) - gpu.anchor) @ self.axes[:2, :3].T
            half = float(np.max(np.ptp(flat, axis=0))) / 2 + 0.1
            self._draw(number, (flat.min(axis=0) + flat.max(axis=0)) / 2, half)

    def release(self) -> None:
        """Release the maps."""
        self._framebuffer.release()
        self.texture.release()

    def squares(self, poses: F64, camera: Pinhole) -> ShadowSquares:
        """Choose the squares in which the cameras of a survey need sharp shadows.

        Args:
            poses: camera_to_world [m], shape (N, 4, 4), float64.
            camera: Intrinsics of every view.
        """
        across = self.axes[:2].copy()
        across[:, 3] -= across[:, :3] @ self._gpu.anchor
        return share_squares(poses, camera, across, self._size)

    def sharpen(self, center: F64) -> None:
        """Draw the sharp map of a square, unless it is already drawn.

        Args:
            center: Its middle along right and up of the sun's view [m], shape (2,), float64.
        """
        wanted = (float(center[0]), float(center[1]))
        if wanted != self._center:
            self._center = wanted
            self._draw(SHARP, center, SHARP_TEXEL * self._size / 2)

    def uniforms(self) -> dict[str, object]:
        """List the surface shader's uniforms for looking up shadows."""
        length = 1.0 / float(np.linalg.norm(self.axes[2, :3]))
        return {
            "sun_axes": self.axes[:, :3].astype(np.float32).tobytes(),
            "sun_depth": length,
            "sun_blur": 2.0 * float(np.tan(self.angle / 2)),
        }

    def seen_from(self, eye: F64) -> dict[str, object]:
        """List the surface shader's uniforms that change with the camera.

        Args:
            eye: Camera center, counted from the anchor [m], shape (3,), float64.
        """
        place = self.axes[:, :3] @ eye + self.axes[:, 3]
        return {"sun_eye": tuple(place.tolist()), "shadow_maps": self.maps.astype(np.float32).tobytes()}

    def _draw(self, number: int, center: F64, half: float) -> None:
        """Draw one map of the square around a position in the sun's view [m]."""
        size, context, gpu = self._size, self._gl.context, self._gpu
        self.maps[number] = [1 / half, *(-center / half), 1.0 - 2.0 * _FILTER / size]
        clip = np.vstack([self.axes, [0.0, 0.0, 0.0, 1.0]])
        clip[:2] /= half
        clip[:2, 3] += self.maps[number, 1:3]
        reached = np.all((self._low <= center + half) & (self._high >= center - half), axis=1)
        reached &= ~gpu.ribbons.embedded  # shadows of what is hidden in a surface would show through thin ribbons
        gpu.place(gpu.anchor)
        gpu.bind()
        framebuffer = self._framebuffer
        framebuffer.viewport = framebuffer.scissor = (number * size, 0, size, size)
        framebuffer.use()
        framebuffer.clear(depth=1.0, viewport=framebuffer.viewport)
        context.enable_only(moderngl.DEPTH_TEST)
        context.depth_func = "<"
        _draw_depth(self._gl, self._programs, gpu, clip, np.flatnonzero(reached & ~gpu.ribbons.lying))
        clip[:, 3] -= _SUNK * clip[:, 2]
        _draw_depth(self._gl, self._programs, gpu, clip, np.flatnonzero(reached & gpu.ribbons.lying))


def depth_groups(gpu: GpuScene, rows: I64) -> list[tuple[tuple[str, ...], int, I64]]:
    """Group draws by whether their silhouette needs a cut-out texture.

    Args:
        gpu: Uploaded scene.
        rows: Draws, shape (N,), int64.

    Returns:
        Features, material, and rows of the draws, shape (M,), int64, of each group; the material is used if there
        are features.
    """
    rows = rows[~gpu.transparent_draws[rows]]
    cut_out = gpu.cut_out[rows]
    groups: list[tuple[tuple[str, ...], int, I64]] = [((), 0, rows[~cut_out])] if not cut_out.all() else []
    return groups + [(("HAS_ALBEDO", "CUT_OUT"), *group) for group in gpu.grouped(rows[cut_out])]


def _draw_depth(gl: Gl, programs: Programs, gpu: GpuScene, clip: F64, reached: I64) -> None:
    waiting = 0
    for features, material, rows in depth_groups(gpu, reached):
        program = programs.get("surface.vert", "shadow.frag", features)
        set_uniform(program, "clip_from_relative", np.asarray(clip.T, np.float32).tobytes())
        if features:
            gpu.bind_material(material)
            variant = gpu.variants[gpu.variant_rows[rows[0]]]
            assert variant.arrays[0] is not None
            gpu.wraps.bind(_CUT_OUT_UNIT, variant.arrays[0], variant.wraps[0])
            set_uniform(program, "albedo_array", _CUT_OUT_UNIT)
        commands = gl.context.buffer(gpu.commands[rows].tobytes())
        vertices = gpu.vertex_array(gl.context, program)
        waiting = run_commands(gl.functions.flush, vertices, commands, gpu.triangles(rows), 0, waiting)
        vertices.release()
        commands.release()
    gpu.wraps.clear()


def _sun_axes(to_sun: F64, casters: F64) -> F64:
    """Compute right and up of the sun's view [m], and its depth: 0 before the nearest caster, 1 behind the farthest."""
    up = np.array([0.0, 0.0, 1.0]) if abs(to_sun[2]) < 0.99 else np.array([0.0, 1.0, 0.0])
    right = np.cross(up, to_sun)
    right /= np.linalg.norm(right)
    height = casters @ to_sun
    nearest, farthest = height.max() + 0.5, height.min() - 0.5
    axes = np.zeros((3, 4))
    axes[0, :3], axes[1, :3] = right, np.cross(to_sun, right)
    axes[2, :3], axes[2, 3] = -to_sun / (nearest - farthest), nearest / (nearest - farthest)
    return axes


def _flat_boxes(across: F64, gpu: GpuScene) -> tuple[F64, F64]:
    """Bound each draw in the sun's view: lower and upper corners [m], each shape (D, 2)."""
    middle = ((gpu.lower + gpu.upper) / 2 - gpu.anchor) @ across[:, :3].T
    reach = (gpu.upper - gpu.lower) / 2 @ np.abs(across[:, :3]).T
    return middle - reach, middle + reach


def _corners(low: F64, high: F64) -> F64:
    mask = np.array([[row >> axis & 1 for axis in range(3)] for row in range(8)])
    return np.where(mask, high, low)
