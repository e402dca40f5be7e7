"""The sun's shadows: two maps drawn once per scene, a fine one around the bridge and a coarse one for the rest."""

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from render.daylight import Daylight
from render.gpu_scene import GpuScene
from render.programs import Programs, set_uniform

F64 = NDArray[np.float64]

_NEAR_MARGIN = 6.0  # [m] the fine map reaches beyond the region of interest
_FAR_REACH = 300.0  # [m] no shadow is drawn farther from it
_LIFT_TEXELS = 1.6  # how far a look-up is moved off the surface, in texels


@dataclass(frozen=True)
class ShadowMap:
    """Depth as seen from the sun; the left half of the texture is the fine map, the right half the coarse one.

    Attributes:
        texture: Depth texture, compared on look-up.
        axes: Scene position, counted from the anchor, to right and up of the sun's view [m] and to the map's depth [1],
            shape (3, 4), float64.
        maps: For the fine and the coarse map 1 / half width, centre along right and up in half widths, and how far from
            the centre it may be used [1], shape (2, 4), float64.
        lifts: How far a look-up moves along the normal in each map [m].
    """

    texture: moderngl.Texture
    axes: F64
    maps: F64
    lifts: tuple[float, float]


def draw_shadows(
    context: moderngl.Context, programs: Programs, gpu: GpuScene, light: Daylight, box: tuple[F64, F64], size: int
) -> ShadowMap:
    """Draw both maps.

    Args:
        context: Open context.
        programs: Shader programs.
        gpu: Uploaded scene.
        light: Its light, with a sun.
        box: Lower and upper corner of the region of interest [m], each of shape (3,), float64.
        size: Side of each map [px].
    """
    texture = context.depth_texture((2 * size, size))
    framebuffer = context.framebuffer(depth_attachment=texture)
    framebuffer.clear(depth=1.0)
    framebuffer.use()
    low, high = gpu.lower.min(axis=0), gpu.upper.max(axis=0)
    near = (box[0] - _NEAR_MARGIN, box[1] + _NEAR_MARGIN)
    far = (np.maximum(low, box[0] - _FAR_REACH), np.minimum(high, box[1] + _FAR_REACH))
    axes = _sun_axes(light.sun_direction, _corners(low, high) - gpu.anchor)
    maps = np.array([_fit(axes, _corners(*bounds) - gpu.anchor, size) for bounds in (near, far)])
    gpu.place(gpu.anchor)
    gpu.bind()
    context.enable_only(moderngl.DEPTH_TEST)
    context.depth_func = "<"
    context.polygon_offset = (1.5, 2.0)
    for half in range(2):
        framebuffer.viewport = (half * size, 0, size, size)
        framebuffer.scissor = framebuffer.viewport
        clip = np.vstack([axes, [0.0, 0.0, 0.0, 1.0]])
        clip[:2] *= maps[half, 0]
        clip[:2, 3] += maps[half, 1:3]
        _draw_depth(context, programs, gpu, clip)
    context.polygon_offset = (0.0, 0.0)
    texture.compare_func = "<="
    texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
    texture.repeat_x = texture.repeat_y = False
    framebuffer.release()
    fine, coarse = (_LIFT_TEXELS * 2 / (size * maps[:, 0])).tolist()
    return ShadowMap(texture, axes, maps, (fine, coarse))


def depth_groups(gpu: GpuScene) -> list[tuple[tuple[str, ...], moderngl.TextureArray | None, NDArray[np.int64]]]:
    """Split all draws by what their silhouette needs: nothing, or a cut-out texture.

    Args:
        gpu: Uploaded scene.

    Returns:
        Features, texture array, and rows of the draws, shape (M,), int64, of each group.
    """
    keys = [
        (("HAS_ALBEDO", "CUT_OUT"), variant.arrays[0]) if "CUT_OUT" in variant.features else ((), None)
        for variant in gpu.variants
    ]
    groups = []
    for key in dict.fromkeys(keys):
        members = [row for row, other in enumerate(keys) if other == key]
        groups.append((*key, np.flatnonzero(np.isin(gpu.variant_rows, members))))
    return groups


def _draw_depth(context: moderngl.Context, programs: Programs, gpu: GpuScene, clip: F64) -> None:
    for features, array, rows in depth_groups(gpu):
        program = programs.get("surface.vert", "shadow.frag", features)
        set_uniform(program, "clip_from_relative", np.asarray(clip.T, np.float32).tobytes())
        if array is not None:
            array.use(0)
            set_uniform(program, "albedo_array", 0)
        commands = context.buffer(gpu.commands[rows].tobytes())
        vertices = gpu.vertex_array(context, program)
        vertices.render_indirect(commands, moderngl.TRIANGLES, len(rows))
        vertices.release()
        commands.release()


def _sun_axes(to_sun: F64, casters: F64) -> F64:
    """Right and up of the sun's view [m], and its depth: 0 before the nearest caster, 1 behind the farthest."""
    up = np.array([0.0, 0.0, 1.0]) if abs(to_sun[2]) < 0.99 else np.array([0.0, 1.0, 0.0])
    right = np.cross(up, to_sun)
    right /= np.linalg.norm(right)
    height = casters @ to_sun
    nearest, farthest = height.max() + 0.5, height.min() - 0.5
    axes = np.zeros((3, 4))
    axes[0, :3], axes[1, :3] = right, np.cross(to_sun, right)
    axes[2, :3], axes[2, 3] = -to_sun / (nearest - farthest), nearest / (nearest - farthest)
    return axes


def _fit(axes: F64, corners: F64, size: int) -> F64:
    """Fit a square map to a box: one row of `ShadowMap.maps`."""
    flat = corners @ axes[:2, :3].T
    center = (flat.min(axis=0) + flat.max(axis=0)) / 2
    half = float(np.max(flat.max(axis=0) - flat.min(axis=0))) / 2 + 0.1
    return np.array([1 / half, -center[0] / half, -center[1] / half, 1.0 - 6.0 / size])


def _corners(low: F64, high: F64) -> F64:
    mask = np.array([[row >> axis & 1 for axis in range(3)] for row in range(8)])
    return np.where(mask, high, low)
