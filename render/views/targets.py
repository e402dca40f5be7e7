"""The images that a painter draws on: the photograph, the exact ones, and how their rows are cleared and read."""

from dataclasses import dataclass
from typing import Any

import cv2
import moderngl
import numpy as np
from numpy.typing import NDArray

from render.gpu.context import Gl
from render.gpu.programs import Programs, set_uniform
from render.light.illumination import FIRST_FREE_UNIT
from usd_schemas.pinhole import Pinhole

F32 = NDArray[np.float32]
U16 = NDArray[np.uint16]
U32 = NDArray[np.uint32]

_RESOLVED = 64  # rows of the photograph that are read at once


@dataclass(frozen=True)
class View:
    """The images of one view.

    Attributes:
        code: Square root of linear radiance over `BRIGHTEST` [65535], shape (H, W, 3), uint16.
        draw: Row of the draw plus 1, 0 for sky, shape (H, W), uint32.
        depth: Planar depth [m], +inf for sky, shape (H, W), float32.
        normal: Unit normals in world axes [1], zero for sky, shape (H, W, 3), float32, or None.
        triangle: Triangle within the draw's part, shape (H, W), uint32, or None.
        middle: What the samples of `code` show, as `draw`, shape (H, W), uint32, where `draw` is finer; or None.
    """

    code: U16
    draw: U32
    depth: F32
    normal: F32 | None
    triangle: U32 | None = None
    middle: U32 | None = None


def mended(view: View, again: View) -> View:
    """Replace the pixels of a view that have no depth by those of another.

    Args:
        view: The view.
        again: The same view, drawn in another way.
    """
    wrong = ~(view.depth > 0.0)
    finer = len(wrong) // len(view.code)
    coarse = wrong.reshape(len(view.code), finer, -1, finer).any(axis=(1, 3))

    images: dict[str, Any] = dict(vars(view))
    for name, image in images.items():
        if image is not None:
            where = coarse if name in ("code", "middle") else wrong
            images[name] = image.copy()
            images[name][where] = getattr(again, name)[where]
    return View(**images)


class Targets:
    """The images of one size.

    Attributes:
        apart: Whether photograph and exact images come from separate passes.
        samples: Samples of the photograph along each side of a pixel.
        finer: Resolution of the exact images as a multiple of the photograph's.
        shaded: Framebuffer on which surfaces are shaded.
        color: The photograph's code where it is shaded, shape (samples H, samples W, 4).
        exact: Framebuffer of ids and depth, together with the photograph unless they have a separate pass.
        truth: Framebuffer of ids and depth alone, with the depth buffer of `exact`.
        depth: Framebuffer of the depth image alone, with the same depth buffer.
        nearest: Framebuffer of the depth of shaded surfaces alone.
        extra: `NORMALS` or `TRIANGLES` in a tuple if one more exact image is drawn.
    """

    def __init__(self, gl: Gl, programs: Programs, camera: Pinhole, extra: str, finer: int, *, fine: bool) -> None:
        """Create the images.

        Args:
            gl: Open context.
            programs: Shader programs.
            camera: Intrinsics of every view.
            extra: `NORMALS` or `TRIANGLES` for one more exact image, or empty.
            finer: Resolution of the exact images as a multiple of the photograph's, along rows and columns.
            fine: Whether the photograph has 2x2 samples per pixel.
        """
        self._gl, self._programs, self._width = gl, programs, camera.width
        self.apart, self.samples, self.finer = fine or finer > 1, 2 if fine else 1, finer
        self.extra = (extra,) if extra else ()
        context, exact = gl.context, (finer * camera.width, finer * camera.height)
        rows = min(_RESOLVED, camera.height) if fine else camera.height
        self._means = self.color = context.texture((camera.width, rows), 4, dtype="nu2")
        self._truth = [context.texture(exact, 1, dtype="u4"), context.texture(exact, 1, dtype="f4")]
        if extra:
            channels, kind = (4, "f2") if extra == "NORMALS" else (1, "u4")
            self._truth.append(context.texture(exact, channels, dtype=kind))
        self.exact = self.shaded = self._framebuffer(self._truth if self.apart else [self.color, *self._truth])
        if fine:
            self.color = context.texture((2 * camera.width, 2 * camera.height), 4, dtype="nu2")
            self._resolved = context.framebuffer([self._means])
        self._middle = context.texture((camera.width, camera.height), 1, dtype="u4") if finer > 1 and not fine else None
        if self.apart:
            self.shaded = self._framebuffer([self.color] + ([] if self._middle is None else [self._middle]))
        self.truth = context.framebuffer(self._truth, self.exact.depth_attachment)
        self.depth = context.framebuffer([self._truth[1]], self.exact.depth_attachment)
        self.nearest = context.framebuffer(depth_attachment=self.shaded.depth_attachment)
        images = (self._means, *self._truth, *(() if self._middle is None else (self._middle,)))
        self._readers = {image: context.framebuffer([image]) for image in images}
        self._arrays: dict[moderngl.Program, moderngl.VertexArray] = {}

    def bind(self, framebuffer: moderngl.Framebuffer, first: int, end: int) -> None:
        """Bind a framebuffer for drawing on some of its rows.

        Args:
            framebuffer: The framebuffer.
            first: Its first row.
            end: The row after the last.
        """
        framebuffer.scissor = (0, first, framebuffer.width, end - first)
        framebuffer.use()
        context = self._gl.context
        context.enable_only(moderngl.DEPTH_TEST)
        context.depth_func, context.front_face = ">", "cw"  # rows run downwards, so that windings look reversed

    def clear(self, first: int, end: int) -> None:
        """Clear some rows of a view.

        Args:
            first: First row.
            end: Row after the last.
        """
        if self.apart:
            self.bind(self.shaded, self.samples * first, self.samples * end)
            self._clear(self.shaded, 1)
        self.bind(self.exact, self.finer * first, self.finer * end)
        self._clear(self.exact, 0 if self.apart else 1)

    def read(self, first: int, end: int) -> View:
        """Read some rows of a view.

        Args:
            first: First row.
            end: Row after the last.
        """
        code = self._read_code(first, end)
        self.exact.scissor = None  # pyright: ignore[reportAttributeAccessIssue]  # else later draws are limited
        self.exact.use()
        middle = None if self._middle is None else self._rows(self._middle, first, end, np.uint32, 1)[..., 0]
        first, end = self.finer * first, self.finer * end
        draw = self._rows(self._truth[0], first, end, np.uint32, 1)[..., 0]
        depth = self._rows(self._truth[1], first, end, np.float32, 1)[..., 0]
        if not self.extra:
            return View(code, draw, depth, None)
        if "TRIANGLES" in self.extra:
            triangle = self._rows(self._truth[2], first, end, np.uint32, 1)[..., 0]
            return View(code, draw, depth, None, triangle, middle)
        normal = self._rows(self._truth[2], first, end, np.float16, 4)[..., :3]
        return View(code, draw, depth, normal.astype(np.float32))

    def _framebuffer(self, colors: list[moderngl.Texture]) -> moderngl.Framebuffer:
        width, height = colors[0].size
        depth = self._gl.context.depth_texture((width, height))
        self._gl.functions.make_depth_float(depth.glo, width, height)
        return self._gl.context.framebuffer(colors, depth)

    def _clear(self, framebuffer: moderngl.Framebuffer, colors: int) -> None:
        """Clear the `colors` photographs of a framebuffer, and what follows them: ids, depth, one image more."""
        functions = self._gl.functions
        functions.clear_depth(0.0)
        for attachment in range(colors):
            functions.clear_color(attachment, (0.0, 0.0, 0.0, 0.0))
        if len(framebuffer.color_attachments) > colors:
            functions.clear_ids(colors)
        if len(framebuffer.color_attachments) > colors + 1:
            functions.clear_color(colors + 1, (np.inf, 0.0, 0.0, 0.0))
        if len(framebuffer.color_attachments) > colors + 2:
            if "TRIANGLES" in self.extra:
                functions.clear_ids(colors + 2)
            else:
                functions.clear_color(colors + 2, (0.0, 0.0, 0.0, 0.0))

    def _read_code(self, first: int, end: int) -> U16:
        """Read some rows of the photograph; OpenCV drops the fourth channel much faster than a slice."""
        code = np.empty((end - first, self._width, 3), np.uint16)
        for top in range(0, end - first, _RESOLVED):  # all rows at once would take 10 MB more
            count, start = min(_RESOLVED, end - first - top), first + top
            if self.samples > 1:
                self._resolve(start, count)
                start = 0
            band = self._rows(self._means, start, start + count, np.uint16, 4)
            cv2.cvtColor(band, cv2.COLOR_RGBA2RGB, dst=code[top : top + count])
        return code

    def _resolve(self, first: int, count: int) -> None:
        """Average the finer samples of some rows of the photograph."""
        self.bind(self._resolved, 0, count)
        self._gl.context.enable_only(moderngl.NOTHING)
        program = self._programs.get("sky.vert", "downsample.frag")
        if program not in self._arrays:
            self._arrays[program] = self._gl.context.vertex_array(program, [])
        self.color.use(FIRST_FREE_UNIT)
        set_uniform(program, "samples", FIRST_FREE_UNIT)
        set_uniform(program, "first_row", first)
        self._arrays[program].render(moderngl.TRIANGLES, 3)

    def _rows(self, image: moderngl.Texture, first: int, end: int, kind: type, channels: int) -> NDArray[Any]:
        """Read some rows of an image back, shape (rows, W, channels)."""
        width, height = image.size
        if (first, end) == (0, height):
            data = image.read()
        else:
            data = self._readers[image].read((0, first, width, end - first), channels, dtype=image.dtype)
        return np.frombuffer(data, kind).reshape(end - first, width, channels)
