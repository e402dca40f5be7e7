"""Blending of transparent surfaces over a photograph in linear light."""

from typing import Any

import moderngl

from render.gpu.context import Gl
from render.gpu.programs import Programs, set_uniform
from render.light.illumination import FIRST_FREE_UNIT


class Blending:
    """A copy of a photograph in linear light, into which surfaces are blended."""

    def __init__(self, gl: Gl, programs: Programs, color: moderngl.Texture, depth: Any) -> None:
        """Create the textures and framebuffers.

        Args:
            gl: Open context.
            programs: Shader programs.
            color: The photograph's code, shape (H, W, 4).
            depth: The depth of its opaque surfaces.
        """
        context = gl.context
        self._gl, self._programs, self._color = gl, programs, color
        self._linear = context.texture(color.size, 4, dtype="f4")
        self._copy = context.framebuffer([self._linear])
        self._surfaces = context.framebuffer([self._linear], depth)
        self._coded = context.framebuffer([color])
        self._arrays: dict[moderngl.Program, moderngl.VertexArray] = {}

    def begin(self, span: tuple[int, int]) -> None:
        """Copy some rows, and enable blending into them.

        Args:
            span: First row, and the row after the last.
        """
        context = self._gl.context
        self._fill(self._copy, span, "linear.frag", "codes", self._color)
        self._open(self._surfaces, span)
        context.enable_only(moderngl.DEPTH_TEST | moderngl.BLEND | moderngl.CULL_FACE)
        context.depth_func, context.front_face = ">=", "cw"  # as for opaque surfaces
        context.blend_func = (
            moderngl.SRC_ALPHA,
            moderngl.ONE_MINUS_SRC_ALPHA,
            moderngl.ONE,
            moderngl.ONE_MINUS_SRC_ALPHA,
        )  # pyright: ignore[reportAttributeAccessIssue]
        self._surfaces.depth_mask = False

    def end(self, span: tuple[int, int]) -> None:
        """Copy the result back into the photograph.

        Args:
            span: As for `begin`.
        """
        self._surfaces.depth_mask = True
        self._gl.context.cull_face = "back"
        self._fill(self._coded, span, "coded.frag", "blended", self._linear)
        self._gl.context.enable_only(moderngl.DEPTH_TEST)

    def _open(self, framebuffer: moderngl.Framebuffer, span: tuple[int, int]) -> None:
        framebuffer.scissor = (0, span[0], framebuffer.width, span[1] - span[0])
        framebuffer.use()

    def _fill(
        self, target: moderngl.Framebuffer, span: tuple[int, int], shader: str, name: str, source: moderngl.Texture
    ) -> None:
        self._open(target, span)
        self._gl.context.enable_only(moderngl.NOTHING)
        program = self._programs.get("sky.vert", shader)
        if program not in self._arrays:
            self._arrays[program] = self._gl.context.vertex_array(program, [])
        source.use(FIRST_FREE_UNIT)
        set_uniform(program, name, FIRST_FREE_UNIT)
        self._arrays[program].render(moderngl.TRIANGLES, 3)
