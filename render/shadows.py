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
        matrices: Scene position, counted from the anchor, to texture place and depth, shape (2, 4, 4), float64.
        lifts: How far a look-up moves along the normal in each map [m].
        texel: Height of a texel in texture space [1].
    """

    texture: moderngl.Texture
    matrices: F64
    lifts: tuple[float, float]
    texel: float


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
    matrices, lifts = np.zeros((2, 4, 4)), [0.0, 0.0]
    gpu.place(gpu.anchor)
    gpu.bind()
    context.enable_only(moderngl.DEPTH_TEST)
    context.depth_func = "<"
    context.polygon_offset = (1.5, 2.0)
    for half, bounds in enumerate((near, far)):
        clip, width = _sun_clip(light.sun_direction, bounds, (low, high), gpu.anchor)
        framebuffer.viewport = (half * size, 0, size, size)
        framebuffer.scissor = framebuffer.viewport
        _draw_depth(context, programs, gpu, clip)
        halved = np.array([[0.25, 0, 0, 0.25 + 0.5 * half], [0, 0.5, 0, 0.5], [0, 0, 1, 0], [0, 0, 0, 1]])
        matrices[half] = halved @ clip
        lifts[half] = _LIFT_TEXELS * width / size
    context.polygon_offset = (0.0, 0.0)
    texture.compare_func = "<="
    texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
    texture.repeat_x = texture.repeat_y = False
    framebuffer.release()
    return ShadowMap(texture, matrices, (lifts[0], lifts[1]), 1.0 / size)


def depth_groups(gpu: GpuScene) -> list[tuple[tuple[str, ...], moderngl.TextureArray | None, NDArray[np.int64]]]:
    """Split all draws by what their silhouette needs: nothing, or a cut-out texture.

    Args:
        gpu: Uploaded scene.

    Returns:
        Features, texture array, and rows of the draws of each group.
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


def _sun_clip(to_sun: F64, bounds: tuple[F64, F64], casters: tuple[F64, F64], anchor: F64) -> tuple[F64, float]:
    """Fit a square parallel projection to a box, deep enough for every caster; also its width [m]."""
    up = np.array([0.0, 0.0, 1.0]) if abs(to_sun[2]) < 0.99 else np.array([0.0, 1.0, 0.0])
    right = np.cross(up, to_sun)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(to_sun, right), to_sun])
    seen, all_casters = _corners(*bounds) - anchor, _corners(*casters) - anchor
    flat, depth = seen @ axes.T, all_casters @ to_sun
    center = (flat.min(axis=0) + flat.max(axis=0)) / 2
    width = float(np.max(flat.max(axis=0)[:2] - flat.min(axis=0)[:2])) * 1.01 + 0.1
    nearest, farthest = float(depth.max()) + 0.5, float(depth.min()) - 0.5
    clip = np.eye(4)
    clip[0, :3], clip[0, 3] = axes[0] * 2 / width, -center[0] * 2 / width
    clip[1, :3], clip[1, 3] = axes[1] * 2 / width, -center[1] * 2 / width
    clip[2, :3], clip[2, 3] = -to_sun / (nearest - farthest), nearest / (nearest - farthest)
    return clip, width


def _corners(low: F64, high: F64) -> F64:
    mask = np.array([[row >> axis & 1 for axis in range(3)] for row in range(8)])
    return np.where(mask, high, low)
