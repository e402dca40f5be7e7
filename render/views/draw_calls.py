"""Draws a scene into the bound framebuffer: depth alone, surfaces, transparent surfaces, ids, the sky."""

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from render.gpu.camera import clip_from_camera
from render.gpu.context import Gl
from render.gpu.facets import CORNER_FORMAT, CORNER_NAMES
from render.gpu.gpu_scene import GpuScene, run_commands
from render.gpu.materials import SLOTS
from render.gpu.programs import Programs, set_uniform
from render.light.illumination import FIRST_FREE_UNIT, Lamps
from render.light.shadows import depth_groups
from render.views.coverage_layer import AWAY_UNIT
from usd_schemas.pinhole import Pinhole

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_LARGE = 100.0  # [px] a triangle; for meshes of smaller ones, drawing the depth first costs more than it saves


@dataclass(frozen=True)
class Sight:
    """Camera, pose and projection of a view.

    Attributes:
        camera: Intrinsics.
        pose: Camera pose [m], shape (4, 4), float64.
        near: Near plane [m].
        clip: Projection of positions relative to the camera, in OpenGL's layout.
        waterline: Height above the camera below which shaders of reflections draw nothing [m].
        projection: Clip from camera axes [1], shape (4, 4), float64; None for the camera's own.
        pixels: Pixels of the photograph from clip space, by columns [px]; None for the camera's own.
    """

    camera: Pinhole
    pose: F64
    near: float
    clip: bytes
    waterline: float = 0.0
    projection: F64 | None = None
    pixels: tuple[float, float, float, float] | None = None

    @property
    def eye(self) -> F64:
        """Camera center [m], shape (3,), float64."""
        return self.pose[:3, 3]


class DrawCalls:
    """Draws rows of one scene at a time.

    Attributes:
        more: Further uniforms of surfaces, by name.
    """

    def __init__(self, gl: Gl, programs: Programs, gpu: GpuScene, lamps: Lamps, half_size: tuple[float, float]) -> None:
        """Create the buffers of draw commands.

        Args:
            gl: Open context.
            programs: Shader programs.
            gpu: Uploaded scene.
            lamps: Its lights.
            half_size: Half the width and height of the image that ribbons are drawn on [px].
        """
        self._gl, self._programs, self._half_size = gl, programs, half_size
        self._commands = gl.context.buffer(reserve=max(1, gpu.commands.nbytes), dynamic=True)
        self._corners = gl.context.buffer(reserve=1 << 16, dynamic=True)
        self._arrays: dict[moderngl.Program, moderngl.VertexArray] = {}
        self.more: dict[str, object] = {}
        self.move(gpu, lamps)

    def move(self, gpu: GpuScene, lamps: Lamps) -> None:
        """Switch to another moment of the scene.

        Args:
            gpu: The scene, uploaded.
            lamps: Its lights.
        """
        for array in self._arrays.values():
            array.release()
        self._arrays.clear()
        if gpu.commands.nbytes > self._commands.size:
            self._commands.orphan(gpu.commands.nbytes)
        self._gpu, self._lamps = gpu, lamps
        self._solid = ~gpu.cut_out & ~gpu.blended
        self._tables = {"": gpu.commands, "FADES": gpu.ribbons.surfaces, "RIBBON": gpu.ribbons.ribbons}

    def worth_hiding(self, rows: I64, sight: Sight) -> I64:
        """Choose the draws whose depth is drawn first, because they hide more shading than that costs, shape (M,).

        Args:
            rows: Draws, shape (N,), int64.
            sight: The view.
        """
        gpu, rows = self._gpu, rows[self._solid[rows]]
        half = np.linalg.norm(gpu.upper[rows] - gpu.lower[rows], axis=1) / 2
        away = np.linalg.norm((gpu.lower[rows] + gpu.upper[rows]) / 2 - sight.eye, axis=1)
        pixels = (sight.camera.fx * half / np.maximum(away, half)) ** 2
        return rows[pixels >= _LARGE * gpu.commands["count"][rows] / 3]

    def depth(self, rows: I64, sight: Sight) -> None:
        """Draw depth alone.

        Args:
            rows: Draws, shape (N,), int64.
            sight: The view.
        """
        self._write_commands([rows], "")
        program = self._programs.get("surface.vert", "shadow.frag")
        set_uniform(program, "clip_from_relative", sight.clip)
        self._run(program, rows, 0, 0, "")

    def surfaces(self, rows: I64, sight: Sight, features: tuple[str, ...], kind: str = "") -> None:
        """Shade draws.

        Args:
            rows: Draws, shape (N,), int64.
            sight: The view.
            features: Features of their shaders.
            kind: Empty for all of them, `FADES` for bars that fade where they are thin, `RIBBON` for their ribbons.
        """
        self._gl.context.depth_func = ">="
        self._shade(self._gpu.grouped(rows), sight, features + (("BAR", kind) if kind else ()), kind)

    def panes(self, rows: I64, sight: Sight, features: tuple[str, ...]) -> None:
        """Shade transparent surfaces, from the farthest to the nearest.

        Args:
            rows: Draws, shape (N,), int64.
            sight: The view.
            features: Features of their shaders.
        """
        context, gpu = self._gl.context, self._gpu
        away = np.linalg.norm((gpu.lower[rows] + gpu.upper[rows]) / 2 - sight.eye, axis=1)
        context.depth_func = ">="
        for row in rows[np.argsort(-away, kind="stable")]:
            for culled in ("front", "back"):  # the far side of each body first
                context.cull_face = culled
                self._shade([(int(gpu.material_rows[row]), np.array([row]))], sight, features, "")
        context.cull_face = "back"

    def ids(self, rows: I64, sight: Sight, extra: tuple[str, ...]) -> None:
        """Draw ids and depth, without shading.

        Args:
            rows: Draws, shape (N,), int64.
            sight: The view.
            extra: `NORMALS` or `TRIANGLES` if one more image is drawn.
        """
        self._silhouettes("ids.frag", rows, sight, extra)

    def cut_depth(self, rows: I64, sight: Sight, extra: tuple[str, ...]) -> None:
        """Draw depth alone, of cut-outs too.

        Args:
            rows: Draws, shape (N,), int64.
            sight: The view.
            extra: Features of the shaders of cut-outs.
        """
        self._silhouettes("shadow.frag", rows, sight, extra)

    def _silhouettes(self, shader: str, rows: I64, sight: Sight, extra: tuple[str, ...]) -> None:
        """Draw rows with a shader that needs no material but for the opacity of cut-outs."""
        groups = depth_groups(self._gpu, rows)
        self._write_commands([members for *_, members in groups], "")
        first = waiting = 0
        for features, material, members in groups:
            program = self._programs.get("surface.vert", shader, extra + features)
            if features:
                self._gpu.bind_material(material)
                variant = self._gpu.variants[self._gpu.variant_rows[members[0]]]
                assert variant.arrays[0] is not None
                self._gpu.wraps.bind(FIRST_FREE_UNIT, variant.arrays[0], variant.wraps[0])
                set_uniform(program, "albedo_array", FIRST_FREE_UNIT)
            set_uniform(program, "clip_from_relative", sight.clip)
            waiting = self._run(program, members, first, waiting, "")
            first += len(members)
        self._gpu.wraps.clear()

    def facets(self, corners: NDArray[np.void], sight: Sight) -> None:
        """Draw the depth of long thin triangles again, where they are visible.

        Args:
            corners: Their corners, shape (N,), as `Facets.seen` gives them.
            sight: The view.
        """
        self._gl.context.depth_func = "=="
        program = self._programs.get("surface.vert", "facet.frag", ("FACET",))
        set_uniform(program, "clip_from_relative", sight.clip)
        if corners.nbytes > self._corners.size:
            self._corners.orphan(2 * corners.nbytes)
        self._corners.write(corners.tobytes())
        if program not in self._arrays:
            content = [(self._corners, CORNER_FORMAT, *CORNER_NAMES)]
            self._arrays[program] = self._gl.context.vertex_array(program, content)
        self._arrays[program].render(moderngl.TRIANGLES, len(corners))

    def sky(self, sight: Sight, features: tuple[str, ...]) -> None:
        """Draw the sky where nothing else is drawn.

        Args:
            sight: The view.
            features: Features of its shader.
        """
        program = self._programs.get("sky.vert", "sky.frag", features)
        if program not in self._arrays:
            self._lamps.shine_on(program)
            self._arrays[program] = self._gl.context.vertex_array(program, [])
        clip = clip_from_camera(sight.camera, 1.0) if sight.projection is None else sight.projection
        from_clip = np.linalg.inv(clip[[0, 1, 3], :3])
        set_uniform(program, "world_from_clip", (sight.pose[:3, :3] @ from_clip).T.astype(np.float32).tobytes())
        self._gl.context.depth_func = ">="
        self._arrays[program].render(moderngl.TRIANGLES, 3)

    def _shade(self, groups: list[tuple[int, I64]], sight: Sight, features: tuple[str, ...], kind: str) -> None:
        self._write_commands([members for _, members in groups], kind)
        first = waiting = 0
        aimed: set[moderngl.Program] = set()
        for material, members in groups:
            variant = self._gpu.variants[self._gpu.variant_rows[members[0]]]
            self._gpu.bind_material(material)
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
                set_uniform(program, "clip_from_relative", sight.clip)
                set_uniform(program, "half_size", self._half_size)
                set_uniform(program, "pixels", sight.pixels or (self._half_size[0], 0.0, 0.0, self._half_size[1]))
                set_uniform(program, "ribbons_away", AWAY_UNIT)
                set_uniform(program, "waterline", sight.waterline)
                for name, value in self.more.items():
                    set_uniform(program, name, value)
                self._lamps.aim(program, sight.eye - self._gpu.anchor)
            waiting = self._run(program, members, first, waiting, kind)
            first += len(members)
        self._gpu.wraps.clear()

    def _write_commands(self, groups: list[I64], kind: str) -> None:
        if any(len(rows) for rows in groups):
            self._commands.write(self._tables[kind][np.concatenate(groups)].tobytes())

    def _run(self, program: moderngl.Program, rows: I64, first: int, waiting: int, kind: str) -> int:
        """Draw rows, whose commands begin at number `first`; `waiting` and the result are as for `run_commands`."""
        triangles = self._tables[kind]["count"][rows].astype(np.int64) // 3
        if program not in self._arrays:
            make = self._gpu.bar_array if kind else self._gpu.vertex_array
            self._arrays[program] = make(self._gl.context, program)
        return run_commands(self._gl.functions.flush, self._arrays[program], self._commands, triangles, first, waiting)
