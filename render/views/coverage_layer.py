"""Coverage layer: members thinner than a pixel, composited with their coverage of each pixel."""

import cv2
import moderngl
import numpy as np
from numpy.typing import NDArray

from render.gpu.context import Gl

AWAY_UNIT = 13  # after those of light, materials and draws
_ROWS = 64  # of the photograph, at once
U16 = NDArray[np.uint16]


class CoverageLayer:
    """An image of ribbons alone: linear light times the share covered, and that share."""

    def __init__(self, gl: Gl, behind: moderngl.Framebuffer) -> None:
        """Make the target.

        Args:
            gl: Open context.
            behind: Framebuffer whose depth hides ribbons.
        """
        self._gl, context = gl, gl.context
        self._image = context.texture(behind.size, 4, dtype="f2")
        self._target = context.framebuffer([self._image], behind.depth_attachment)
        self._away: moderngl.Texture | None = None  # depth of ribbons [m], where transparent surfaces may hide them
        self._measured = self._target
        self._reader = context.framebuffer([self._image])
        self._touched = False

    def clear(self) -> None:
        """Begin a view."""
        self._touched = False

    def bind(self, first: int, end: int, rows: int, *, panes: bool = False) -> None:
        """Prepare for drawing ribbons on some rows of the photograph.

        Args:
            first: First row.
            end: Row after the last.
            rows: Rows of the whole photograph.
            panes: Whether transparent surfaces are drawn after them.
        """
        context, scale = self._gl.context, self._image.height // rows
        self._target.scissor = None  # pyright: ignore[reportAttributeAccessIssue]
        if not self._touched:
            self._reader.use()  # else the scissor of the framebuffer in use limits what is cleared
            self._reader.clear()
        self._touched = True
        self._target.scissor = (0, scale * first, self._target.width, scale * (end - first))
        self._target.depth_mask = self._measured.depth_mask = False
        if panes and self._away is None:
            self._away = context.texture(self._image.size, 1, dtype="f4")
            self._measured = context.framebuffer([self._image, self._away], self._target.depth_attachment)
            self._measured.depth_mask = False
        target = self._measured if panes else self._target
        target.scissor = self._target.scissor
        target.use()
        context.enable_only(moderngl.DEPTH_TEST)
        self._gl.functions.blend_only(0)
        context.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA

    def open_panes(self) -> None:
        """Prepare for drawing transparent surfaces over the ribbons behind them, on the rows chosen by `bind`.

        A transparent surface over a ribbon over the scene equals the surface over the scene where no ribbon covers it,
        and the surface over the ribbon elsewhere: its light is weighted by the share that ribbons cover, which it does
        not change.
        """
        context = self._gl.context
        self._target.use()
        context.enable_only(moderngl.DEPTH_TEST | moderngl.BLEND | moderngl.CULL_FACE)
        context.front_face = "cw"
        context.blend_func = (  # pyright: ignore[reportAttributeAccessIssue]  # its type knows two of the four
            moderngl.DST_ALPHA,
            moderngl.ONE_MINUS_SRC_ALPHA,
            moderngl.ZERO,
            moderngl.ONE,
        )
        assert self._away is not None
        self._away.use(AWAY_UNIT)

    def covered(self, first: int, end: int, rows: int) -> NDArray[np.bool_]:
        """Find the pixels of the photograph that ribbons cover, even slightly; shape (end - first, W), bool.

        Args:
            first: First row.
            end: Row after the last.
            rows: Rows of the whole photograph.
        """
        scale = self._image.height // rows
        found = np.zeros((end - first, self._image.width // scale), bool)
        for top in range(first, end, _ROWS) if self._touched else ():
            share = self._read(scale * top, scale * (min(top + _ROWS, end) - top))[..., 3] > 0
            for row in range(scale):
                for column in range(scale):
                    found[top - first : top - first + _ROWS] |= share[row::scale, column::scale]
        return found

    def composite(self, code: U16, first: int, end: int, rows: int) -> None:
        """Composite the ribbons over some rows of a photograph, in place.

        Args:
            code: Square root of linear radiance over the brightest one [65535], shape (end - first, W, 3), uint16.
            first: First row.
            end: Row after the last.
            rows: Rows of the whole photograph.
        """
        if not self._touched:
            return
        for top in range(first, end, _ROWS):
            bottom = min(top + _ROWS, end)
            self._composite_band(code[top - first : bottom - first], top, self._image.height // rows)

    def _composite_band(self, code: U16, first: int, scale: int) -> None:
        """Composite some rows, `scale` times as many in the layer, over those of a photograph, in place."""
        data = self._read(scale * first, scale * len(code))
        if scale > 1:
            small = (code.shape[1], code.shape[0])
            data = cv2.resize(data.astype(np.float32), small, interpolation=cv2.INTER_AREA)
        place = np.flatnonzero(data[..., 3].reshape(-1).view(np.uint16 if scale == 1 else np.uint32))
        ribbon_light = data.reshape(-1, 4)[place].astype(np.float32)
        pixels = code.reshape(-1, 3)
        light = (pixels[place].astype(np.float32) / 65535) ** 2 * (1 - ribbon_light[:, 3:]) + ribbon_light[:, :3]
        pixels[place] = np.rint(np.sqrt(np.minimum(light, 1)) * 65535).astype(np.uint16)

    def _read(self, first: int, count: int) -> NDArray[np.float16]:
        """Read some rows of the layer, shape (count, W, 4)."""
        box = (0, first, self._image.width, count)
        return np.frombuffer(self._reader.read(box, 4, dtype="f2"), np.float16).reshape(count, box[2], 4)
