"""Further samples of a photograph where surfaces meet inside a pixel; ids and depth keep their one sample.

The samples of a pixel lie on a square lattice that is turned so that all have different columns and rows: with
n * n + 1 samples, row j of a pixel lies j / (n * n + 1) of a pixel lower, and n times that to the side. An image with
so many rows for each row of pixels, sheared by n pixels for each of them, has a texel at every sample.
"""

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from render.gpu.camera import clip_from_camera
from render.gpu.context import Gl
from render.gpu.programs import Programs, set_uniform
from render.light.illumination import FIRST_FREE_UNIT
from usd_schemas.pinhole import Pinhole

F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]
U16 = NDArray[np.uint16]

_TEXELS = 3_000_000  # 12 bytes each


@dataclass(frozen=True)
class Lattice:
    """Where the samples of a pixel lie.

    Attributes:
        count: Samples in a pixel [1].
        shear: By how many pixels a row of pixels is shifted to the side [px].
    """

    count: int
    shear: int

    def size(self, width: int, rows: int) -> tuple[int, int]:
        """Compute the width and height of the image of the samples in some rows of pixels [px].

        Args:
            width: Pixels in a row [px].
            rows: Rows of pixels [px].
        """
        return width + self.shear * rows, self.count * rows

    @property
    def features(self) -> tuple[str, ...]:
        """Features of shaders that draw or read the image of samples."""
        return (f"SAMPLES {self.count}", f"SHEAR {self.shear}")


class EdgeSamples:
    """An image of the samples in some rows of pixels.

    Attributes:
        lattice: Where the samples of a pixel lie.
        rows: Most rows of pixels that the image holds [px].
        shaded: Framebuffer on which surfaces are shaded.
        nearest: Framebuffer of their depth alone.
    """

    def __init__(self, gl: Gl, programs: Programs, camera: Pinhole, count: int) -> None:
        """Create the image.

        Args:
            gl: Open context.
            programs: Shader programs.
            camera: Intrinsics of every view.
            count: Samples in a pixel, n * n + 1 [1].
        """
        self._gl, self._programs, self._camera = gl, programs, camera
        self.lattice = lattice = Lattice(count, round((count - 1) ** 0.5))
        context = gl.context
        self.rows = _rows(lattice, camera, int(context.info["GL_MAX_TEXTURE_SIZE"]))
        self._size = size = lattice.size(camera.width, self.rows)
        self._samples = context.texture(size, 4, dtype="f2")  # linear light
        depth = context.depth_texture(size)
        gl.functions.make_depth_float(depth.glo, *size)
        self.shaded = context.framebuffer([self._samples], depth)
        self.nearest = context.framebuffer(depth_attachment=depth)
        self._wanted = context.texture((camera.width, self.rows), 1, dtype="u1", alignment=1)
        self._wanted.filter = moderngl.NEAREST, moderngl.NEAREST
        self._means = context.texture((camera.width, self.rows), 4, dtype="nu2")
        self._mean = context.framebuffer([self._means])
        self._arrays: dict[moderngl.Program, moderngl.VertexArray] = {}

    def projection(self, first: int, near: float) -> F64:
        """Build the projection to the image [1], for `Sight`; shape (4, 4), float64.

        Args:
            first: Row of pixels at the top of the image.
            near: Near plane [m].
        """
        width, height = self._size
        clip = clip_from_camera(self._camera, near)
        column = 0.5 * self._camera.width * (clip[0] + clip[3])  # of pixels, times depth
        row = 0.5 * self._camera.height * (clip[1] + clip[3]) - first * clip[3]
        clip[0] = 2 / width * (column + self.lattice.shear * row) - clip[3]
        clip[1] = 2 / height * self.lattice.count * row - clip[3]
        return clip

    @property
    def pixels(self) -> tuple[float, float, float, float]:
        """Pixels of the photograph from clip space, by columns [px]."""
        across, down = self._size[0] / 2, self._size[1] / 2 / self.lattice.count
        return across, 0.0, -self.lattice.shear * down, down

    def begin(self, wanted: U8) -> None:
        """Prepare for drawing depth: samples of other pixels are blocked.

        Args:
            wanted: Pixels that get samples, shape (R, W), uint8; R is `rows` at most.
        """
        self._wanted.write(np.ascontiguousarray(wanted), (0, 0, self._camera.width, len(wanted)))
        context = self._gl.context
        self.bind(self.shaded, len(wanted))
        self._gl.functions.clear_color(0, (0.0, 0.0, 0.0, 0.0))
        self.bind(self.nearest, len(wanted))
        context.depth_func = "1"
        self._fill("edge_mask.frag")
        context.depth_func, context.front_face = ">", "cw"  # as for the photograph

    def bind(self, framebuffer: moderngl.Framebuffer, rows: int, *, keep_depth: bool = False) -> None:
        """Bind a framebuffer for drawing.

        Args:
            framebuffer: `nearest` or `shaded`.
            rows: Rows of pixels to draw.
            keep_depth: Do not write depth.
        """
        framebuffer.scissor = (0, 0, framebuffer.width, self.lattice.count * rows)
        framebuffer.depth_mask = not keep_depth
        framebuffer.use()
        self._gl.context.enable_only(moderngl.DEPTH_TEST)

    def open_panes(self, rows: int) -> None:
        """Prepare for drawing transparent surfaces over what is drawn.

        Args:
            rows: Rows of pixels to draw.
        """
        self.bind(self.shaded, rows, keep_depth=True)
        context = self._gl.context
        context.enable_only(moderngl.DEPTH_TEST | moderngl.BLEND | moderngl.CULL_FACE)
        context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA

    def end(self, code: U16, wanted: U8) -> None:
        """Put the mean light of the samples into the pixels that have them, in place.

        Args:
            code: Square root of linear radiance over a maximum [65535], shape (R, W, 3), uint16.
            wanted: As for `begin`, shape (R, W), uint8.
        """
        self._mean.scissor = (0, 0, self._mean.width, len(wanted))
        self._mean.use()
        self._gl.context.enable_only(moderngl.NOTHING)
        self._samples.use(FIRST_FREE_UNIT + 1)
        self._fill("edge_mean.frag")
        data = self._mean.read((0, 0, self._camera.width, len(wanted)), 4, dtype="nu2")
        place = np.flatnonzero(wanted)
        code.reshape(-1, 3)[place] = np.frombuffer(data, np.uint16).reshape(-1, 4)[place, :3]

    def _fill(self, shader: str) -> None:
        program = self._programs.get("sky.vert", shader, self.lattice.features)
        if program not in self._arrays:
            self._arrays[program] = self._gl.context.vertex_array(program, [])
        self._wanted.use(FIRST_FREE_UNIT)
        set_uniform(program, "wanted", FIRST_FREE_UNIT)
        set_uniform(program, "samples", FIRST_FREE_UNIT + 1)
        self._arrays[program].render(moderngl.TRIANGLES, 3)


def _rows(lattice: Lattice, camera: Pinhole, largest: int) -> int:
    """Choose how many rows of pixels an image holds, within `_TEXELS` and the driver's largest side of a texture."""
    rows = camera.height
    while rows > 1:
        width, height = lattice.size(camera.width, rows)
        if width * height <= _TEXELS and max(width, height) <= largest:
            break
        rows = rows * 15 // 16
    return rows
