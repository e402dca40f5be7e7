"""Draws views of an uploaded scene: photograph, ids and depth of one view come from one pass over the same samples."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import moderngl
import numpy as np
from numpy.typing import NDArray

from render.gpu.camera import clip_from_camera, clip_from_relative, visible_boxes
from render.gpu.context import Gl
from render.gpu.facets import CORNER_FORMAT, CORNER_NAMES
from render.gpu.gpu_scene import GpuScene, run_commands
from render.gpu.materials import SLOTS
from render.gpu.programs import Programs, set_uniform
from render.light.illumination import FIRST_FREE_UNIT, Lamps
from render.light.shadows import depth_groups
from render.views.blending import Blending
from usd_schemas.pinhole import Pinhole

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
U16 = NDArray[np.uint16]
U32 = NDArray[np.uint32]

_RESOLVED = 64  # rows of finer samples' means that are taken at once
_LARGE = 100.0  # [px] a triangle; what is made of smaller ones costs more to draw twice than it hides


@dataclass(frozen=True)
class View:
    """What one pass sees.

    Attributes:
        code: Square root of linear radiance over `BRIGHTEST` [65535], shape (H, W, 3), uint16.
        draw: Row of the draw plus 1, 0 for sky, shape (H, W), uint32.
        depth: Planar depth [m], +inf for sky, shape (H, W), float32.
        normal: Unit normals in world axes [1], zero for sky, shape (H, W, 3), float32, or None.
        triangle: Triangle within the draw's part, shape (H, W), uint32, or None.
    """

    code: U16
    draw: U32
    depth: F32
    normal: F32 | None
    triangle: U32 | None = None


class Painter:
    """Draws views of one scene at one size."""

    def __init__(
        self, gl: Gl, programs: Programs, gpu: GpuScene, lamps: Lamps, camera: Pinhole, quality: str, extra: str = "",
        finer: int = 1, cards: bool = False,
    ) -> None:  # fmt: skip
        """Make the targets.

        Args:
            gl: Open context.
            programs: Shader programs.
            gpu: Uploaded scene.
            lamps: What lights it.
            camera: Intrinsics of every view.
            quality: `fast`, `standard` or `fine`.
            extra: `NORMALS` or `TRIANGLES` for one more exact image, or empty.
            finer: How many times finer than the photograph the exact images are, along rows and columns.
            cards: Everything is drawn as a grey card.
        """
        self._gl, self._programs, self._camera = gl, programs, camera
        self._fine, self._finer, self._apart = quality == "fine", finer, quality == "fine" or finer > 1
        context = gl.context
        exact = (finer * camera.width, finer * camera.height)
        rows = min(_RESOLVED, camera.height) if self._fine else camera.height
        self._color = context.texture((camera.width, rows), 4, dtype="nu2")
        self._truth = [context.texture(exact, 1, dtype="u4"), context.texture(exact, 1, dtype="f4")]
        self._extra = (extra,) if extra else ()
        if extra:
            channels, kind = (4, "f2") if extra == "NORMALS" else (1, "u4")
            self._truth.append(context.texture(exact, channels, dtype=kind))
        self._exact = self._framebuffer(self._truth if self._apart else [self._color, *self._truth])
        if self._apart:
            doubled = (2 * camera.width, 2 * camera.height)
            self._samples = context.texture(doubled, 4, dtype="nu2") if self._fine else self._color
            self._photo = self._framebuffer([self._samples])
            self._resolved = context.framebuffer([self._color])
        self._depth = context.framebuffer([self._truth[1]], self._exact.depth_attachment)
        self._shaded = self._photo if self._apart else self._exact
        self._nearest = context.framebuffer(depth_attachment=self._shaded.depth_attachment)
        self._blending: Blending | None = None
        self._readers = {image: context.framebuffer([image]) for image in (self._color, *self._truth)}
        self._corners = context.buffer(reserve=1 << 16, dynamic=True)
        self._arrays: dict[moderngl.Program, moderngl.VertexArray] = {}
        self._features = (
            *lamps.features,
            *(("SOFT",) if quality != "fast" else ()),
            *(("GREY_CARD",) if cards else ()),
        )
        self._commands = context.buffer(reserve=max(1, gpu.commands.nbytes), dynamic=True)
        self._aim_at(gpu, lamps)

    def _aim_at(self, gpu: GpuScene, lamps: Lamps) -> None:
        self._gpu, self._lamps = gpu, lamps
        self._blended = gpu.blended
        self._solid = ~gpu.cut_out & ~self._blended
        if self._blended.any() and self._blending is None:
            color = self._samples if self._fine else self._color
            self._blending = Blending(self._gl, self._programs, color, self._shaded.depth_attachment)
            self._solid_truth = self._gl.context.framebuffer(self._truth, self._exact.depth_attachment)

    def move(self, gpu: GpuScene, lamps: Lamps) -> None:
        """Draw another moment of the scene from now on.

        Args:
            gpu: The scene, uploaded.
            lamps: What lights it.
        """
        for array in self._arrays.values():
            array.release()
        self._arrays.clear()
        if gpu.commands.nbytes > self._commands.size:
            self._commands.orphan(gpu.commands.nbytes)
        self._aim_at(gpu, lamps)

    def draw(self, camera_to_world: F64, near: float) -> View:
        """Draw one view.

        Args:
            camera_to_world: Camera pose, shape (4, 4), float64.
            near: Near plane [m].
        """
        return self.draw_bands(camera_to_world[None], [(0, self._camera.height)], near)

    def draw_bands(self, poses: F64, bands: Sequence[tuple[int, int]], near: float) -> View:
        """Draw one view whose rows were read out one band after the other while the camera moved.

        Args:
            poses: Camera pose of each band [m], shape (B, 4, 4), float64.
            bands: First row of each band and the row after its last; rows of no band stay empty.
            near: Near plane [m].
        """
        self._clear_rows(0, self._camera.height)
        for pose, (first, end) in zip(poses, bands, strict=True):
            self._draw_band(pose, first, end, near)
        return self._read(0, self._camera.height)

    def draw_window(self, pose: F64, window: tuple[int, int], near: float) -> View:
        """Draw some rows of a view, and return these alone.

        Args:
            pose: Camera pose [m], shape (4, 4), float64.
            window: First row, and the row after the last.
            near: Near plane [m].
        """
        first, end = window
        self._clear_rows(first, end)
        self._draw_band(pose, first, end, near)
        return self._read(first, end)

    def _draw_band(self, pose: F64, first: int, end: int, near: float) -> None:
        gpu, camera = self._gpu, self._camera
        band = replace(camera, height=end - first, cy=camera.cy - first)
        rows = visible_boxes(gpu.lower, gpu.upper, band, pose)
        gpu.place(pose[:3, 3])
        gpu.bind()
        clip = clip_from_relative(camera, pose, near).T.tobytes()
        opaque, through = rows[~self._blended[rows]], rows[self._blended[rows]]
        if self._apart:
            samples = 2 if self._fine else 1
            self._draw_nearest((samples * first, samples * end), opaque, clip, pose[:3, 3])
            self._open(self._photo, samples * first, samples * end)
            self._draw_surfaces(opaque, clip, pose, self._features)
            self._draw_sky(pose, ())
            self._draw_blended((samples * first, samples * end), through, clip, pose)
            self._open(self._exact, self._finer * first, self._finer * end)
            self._draw_ids(rows, clip)
        else:
            self._draw_nearest((first, end), opaque, clip, pose[:3, 3])
            self._open(self._exact, first, end)
            self._draw_surfaces(opaque, clip, pose, self._features + self._extra)
            self._draw_sky(pose, self._extra)
            self._draw_blended((first, end), through, clip, pose)
            if len(through):
                self._open(self._solid_truth, first, end)
                self._draw_ids(through, clip)
        if "TRIANGLES" not in self._extra:
            self._draw_facets((first, end), rows, clip, pose, near)

    def _open(self, framebuffer: moderngl.Framebuffer, first: int, end: int) -> None:
        """Let some rows of a framebuffer be cleared and drawn on."""
        framebuffer.scissor = (0, first, framebuffer.width, end - first)
        framebuffer.use()
        context = self._gl.context
        context.enable_only(moderngl.DEPTH_TEST)
        context.depth_func, context.front_face = ">", "cw"  # rows run downwards, so that windings look reversed

    def _clear_rows(self, first: int, end: int) -> None:
        if self._apart:
            samples = 2 if self._fine else 1
            self._open(self._photo, samples * first, samples * end)
            self._clear(self._photo, 1)
        self._open(self._exact, self._finer * first, self._finer * end)
        self._clear(self._exact, 0 if self._apart else 1)

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
            functions.clear_color(colors + 1, (np.inf, 0.0, 0.0, 0.0))
        if len(framebuffer.color_attachments) > colors + 2:
            if "TRIANGLES" in self._extra:
                functions.clear_ids(colors + 2)
            else:
                functions.clear_color(colors + 2, (0.0, 0.0, 0.0, 0.0))

    def _draw_nearest(self, span: tuple[int, int], rows: NDArray[np.int64], clip: bytes, eye: F64) -> None:
        """Find the depth of what is large before anything is shaded: what it hides then costs no shading.

        Images do not change by it: a surface is drawn where nothing is nearer, in whatever order.
        """
        gpu, rows = self._gpu, rows[self._solid[rows]]
        half = np.linalg.norm(gpu.upper[rows] - gpu.lower[rows], axis=1) / 2
        away = np.linalg.norm((gpu.lower[rows] + gpu.upper[rows]) / 2 - eye, axis=1)
        pixels = (self._camera.fx * half / np.maximum(away, half)) ** 2
        rows = rows[pixels >= _LARGE * gpu.commands["count"][rows] / 3]
        if not len(rows):
            return
        self._open(self._nearest, *span)
        self._write_commands([rows])
        program = self._programs.get("surface.vert", "shadow.frag")
        set_uniform(program, "clip_from_relative", clip)
        self._run(program, rows, 0, 0)

    def _draw_surfaces(self, rows: NDArray[np.int64], clip: bytes, pose: F64, features: tuple[str, ...]) -> None:
        self._gl.context.depth_func = ">="
        self._shade(self._gpu.grouped(rows), clip, pose, features)

    def _draw_blended(self, span: tuple[int, int], rows: NDArray[np.int64], clip: bytes, pose: F64) -> None:
        """Blend what light shines through over the photograph, from the farthest to the nearest."""
        if not len(rows) or self._blending is None:
            return
        gpu = self._gpu
        away = np.linalg.norm((gpu.lower[rows] + gpu.upper[rows]) / 2 - pose[:3, 3], axis=1)
        ordered = rows[np.argsort(-away, kind="stable")]
        groups = [(int(gpu.material_rows[row]), np.array([row])) for row in ordered]
        self._blending.begin(span)
        for group in groups:
            for culled in ("front", "back"):  # the far side of each body first
                self._gl.context.cull_face = culled
                self._shade([group], clip, pose, self._features)
        self._blending.end(span)

    def _shade(
        self, groups: list[tuple[int, NDArray[np.int64]]], clip: bytes, pose: F64, features: tuple[str, ...]
    ) -> None:
        self._write_commands([members for _, members in groups])
        first = waiting = 0
        aimed: set[moderngl.Program] = set()
        for material, members in groups:
            variant = self._gpu.variants[self._gpu.variant_rows[members[0]]]
            self._gpu.wear(material)
            program = self._programs.get("surface.vert", "surface.frag", features + variant.features)
            if program not in self._arrays:
                self._lamps.shine_on(program)
            for unit, (array, wrap) in enumerate(zip(variant.arrays, variant.wraps, strict=True), FIRST_FREE_UNIT):
                if array is not None:
                    self._gpu.wraps.bind(unit, array, wrap)
            if program not in aimed:
                aimed.add(program)
                for unit, name in enumerate(SLOTS, FIRST_FREE_UNIT):
                    set_uniform(program, f"{name}_array", unit)
                set_uniform(program, "clip_from_relative", clip)
                self._lamps.aim(program, pose[:3, 3] - self._gpu.anchor)
            waiting = self._run(program, members, first, waiting)
            first += len(members)
        self._gpu.wraps.clear()

    def _draw_ids(self, rows: NDArray[np.int64], clip: bytes) -> None:
        groups = depth_groups(self._gpu, rows)
        self._write_commands([members for *_, members in groups])
        first = waiting = 0
        for features, material, members in groups:
            program = self._programs.get("surface.vert", "ids.frag", self._extra + features)
            if features:
                self._gpu.wear(material)
                variant = self._gpu.variants[self._gpu.variant_rows[members[0]]]
                assert variant.arrays[0] is not None
                self._gpu.wraps.bind(FIRST_FREE_UNIT, variant.arrays[0], variant.wraps[0])
                set_uniform(program, "albedo_array", FIRST_FREE_UNIT)
            set_uniform(program, "clip_from_relative", clip)
            waiting = self._run(program, members, first, waiting)
            first += len(members)
        self._gpu.wraps.clear()

    def _draw_facets(self, span: tuple[int, int], rows: NDArray[np.int64], clip: bytes, pose: F64, near: float) -> None:
        """Draw the depth of long thin triangles anew, where they are what is seen."""
        visible = np.zeros(len(self._solid), bool)
        visible[rows] = True
        corners = self._gpu.facets.seen(visible, self._camera, span, pose, near, self._gpu.origins)
        if not len(corners):
            return
        self._open(self._depth, *span)
        self._gl.context.depth_func = "=="
        program = self._programs.get("surface.vert", "facet.frag", ("FACET",))
        set_uniform(program, "clip_from_relative", clip)
        if corners.nbytes > self._corners.size:
            self._corners.orphan(2 * corners.nbytes)
        self._corners.write(corners.tobytes())
        if program not in self._arrays:
            content = [(self._corners, CORNER_FORMAT, *CORNER_NAMES)]
            self._arrays[program] = self._gl.context.vertex_array(program, content)
        self._arrays[program].render(moderngl.TRIANGLES, len(corners))

    def _draw_sky(self, pose: F64, features: tuple[str, ...]) -> None:
        program = self._programs.get("sky.vert", "sky.frag", features)
        if program not in self._arrays:
            self._lamps.shine_on(program)
            self._arrays[program] = self._gl.context.vertex_array(program, [])
        clip = clip_from_camera(self._camera, 1.0)[:2, :3]
        from_clip = np.array(
            [[1 / clip[0, 0], 0, -clip[0, 2] / clip[0, 0]], [0, 1 / clip[1, 1], -clip[1, 2] / clip[1, 1]], [0, 0, 1]]
        )
        set_uniform(program, "world_from_clip", (pose[:3, :3] @ from_clip).T.astype(np.float32).tobytes())
        self._gl.context.depth_func = ">="
        self._arrays[program].render(moderngl.TRIANGLES, 3)

    def _resolve(self, first: int, count: int) -> None:
        """Take the means of finer samples, of some rows of the photograph."""
        self._open(self._resolved, 0, count)
        self._gl.context.enable_only(moderngl.NOTHING)
        program = self._programs.get("sky.vert", "downsample.frag")
        if program not in self._arrays:
            self._arrays[program] = self._gl.context.vertex_array(program, [])
        self._samples.use(FIRST_FREE_UNIT)
        set_uniform(program, "samples", FIRST_FREE_UNIT)
        set_uniform(program, "first_row", first)
        self._arrays[program].render(moderngl.TRIANGLES, 3)

    def _write_commands(self, groups: list[NDArray[np.int64]]) -> None:
        if any(len(rows) for rows in groups):
            self._commands.write(self._gpu.commands[np.concatenate(groups)].tobytes())

    def _run(self, program: moderngl.Program, rows: NDArray[np.int64], first: int, waiting: int) -> int:
        """Draw some rows, whose commands begin at the `first`; `waiting` and the result are as of `run_commands`."""
        triangles, vertices = self._gpu.triangles(rows), self._vertex_array(program)
        return run_commands(self._gl.functions.flush, vertices, self._commands, triangles, first, waiting)

    def _vertex_array(self, program: moderngl.Program) -> moderngl.VertexArray:
        if program not in self._arrays:
            self._arrays[program] = self._gpu.vertex_array(self._gl.context, program)
        return self._arrays[program]

    def _read(self, first: int, end: int) -> View:
        code = self._read_code(first, end)
        self._exact.scissor = None  # pyright: ignore[reportAttributeAccessIssue]  # else what comes next keeps to some rows
        self._exact.use()
        first, end = self._finer * first, self._finer * end
        draw = self._rows(self._truth[0], first, end, np.uint32, 1)[..., 0]
        depth = self._rows(self._truth[1], first, end, np.float32, 1)[..., 0]
        if not self._extra:
            return View(code, draw, depth, None)
        if "TRIANGLES" in self._extra:
            return View(code, draw, depth, None, self._rows(self._truth[2], first, end, np.uint32, 1)[..., 0])
        normal = self._rows(self._truth[2], first, end, np.float16, 4)[..., :3]
        return View(code, draw, depth, normal.astype(np.float32))

    def _read_code(self, first: int, end: int) -> U16:
        """Read some rows of the photograph; OpenCV drops the fourth number many times faster than a slice does."""
        code = np.empty((end - first, self._camera.width, 3), np.uint16)
        if not self._fine:
            cv2.cvtColor(self._rows(self._color, first, end, np.uint16, 4), cv2.COLOR_RGBA2RGB, dst=code)
            return code
        for top in range(0, end - first, _RESOLVED):
            count = min(_RESOLVED, end - first - top)
            self._resolve(first + top, count)
            band = self._rows(self._color, 0, count, np.uint16, 4)
            cv2.cvtColor(band, cv2.COLOR_RGBA2RGB, dst=code[top : top + count])
        return code

    def _rows(self, image: moderngl.Texture, first: int, end: int, kind: type, channels: int) -> NDArray[Any]:
        """Read some rows of an image back, shape (rows, W, channels)."""
        width, height = image.size
        if (first, end) == (0, height):
            data = image.read()
        else:
            data = self._readers[image].read((0, first, width, end - first), channels, dtype=image.dtype)
        return np.frombuffer(data, kind).reshape(end - first, width, channels)
