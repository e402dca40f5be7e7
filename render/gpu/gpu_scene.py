"""A scene in OpenGL buffers: all vertices in one, all draws in another, and the draw commands of one view."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from render.gpu.bars import Bars
from render.gpu.context import Gl
from render.gpu.facets import Facets
from render.gpu.materials import ROW, MaterialTable, Variant
from render.gpu.ribbons import Ribbons, shape_attributes, upload_ribbons
from render.gpu.row_texture import DRAW_UNIT, row_texture
from render.gpu.wraps import Wraps
from usd_schemas.flat_scene import ALIKE, FlatScene, Geometry

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

VERTEX_NAMES = ("in_position", "in_normal", "in_st", "in_st1", "in_color")
_ATTRIBUTES = dict(zip(VERTEX_NAMES, (("3f", 12), ("3f", 12), ("2f", 8), ("2f", 8), ("4f2", 8)), strict=True))
_VERTEX = np.dtype([("p", "3f4"), ("n", "3f4"), ("st", "2f4"), ("st1", "2f4"), ("color", "4f2")])
# One row of the shader's draws: rows of the linear map, then of its cofactors; with the second, its `sides`.
_DRAW = np.dtype([("linear", "(3,4)f4"), ("cofactor", "(3,4)f4")])
# DrawElementsIndirectCommand
COMMAND = np.dtype([("count", "u4"), ("instances", "u4"), ("first", "u4"), ("vertex", "u4"), ("draw", "u4")])
_WAITING = 30_000  # triangles; a driver on the CPU needs 0.5 kB for each that it has not drawn yet, up to 36 MB
_AT_ONCE = 1 << 15  # vertices
_APART = 256  # [bytes] from one material to the next: drivers require this alignment of uniform blocks


@dataclass(frozen=True)
class GpuScene:
    """The uploaded scene, with the data that views need on the CPU.

    Attributes:
        vertices: Vertex buffer.
        indices: Triangle buffer.
        draw_numbers: Instanced attribute 0, 1, 2 …; a command's base instance selects its draw.
        draws: Draw rows, in the layout of `row_texture`.
        materials: Material rows, `_APART` bytes from one to the next.
        offsets: Instanced attribute: camera-relative origin of each draw [m], written for each view.
        origins: Origin of each draw's mesh in the world [m], shape (D, 3), float64.
        lower: Lower corner of each draw's box [m], shape (D, 3), float64.
        upper: Upper corner of each draw's box [m], shape (D, 3), float64.
        commands: Draw command of each draw, shape (D,), dtype `COMMAND`.
        variants: Material variants in use.
        variant_rows: Row in `variants` of each draw, shape (D,), int64.
        material_rows: Row of the material of each draw, shape (D,), int64.
        anchor: Origin of positions in the shading [m], shape (3,), float64.
        facets: Triangles whose depth may have to be drawn again.
        ribbons: Members that may be thinner than a pixel.
        of_material: Row in `variants` of each material, shape (M,), int64.
        wraps: Samplers for textures that do not repeat.
    """

    vertices: moderngl.Buffer
    indices: moderngl.Buffer
    draw_numbers: moderngl.Buffer
    draws: moderngl.Texture
    materials: moderngl.Buffer
    offsets: moderngl.Buffer
    origins: F64
    lower: F64
    upper: F64
    commands: NDArray[np.void]
    variants: tuple[Variant, ...]
    variant_rows: I64
    material_rows: I64
    anchor: F64
    facets: Facets
    ribbons: Ribbons
    of_material: I64
    wraps: Wraps

    def moved(self, context: moderngl.Context, scene: FlatScene, facets: Facets) -> "GpuScene":
        """Return the same meshes and materials with the draws of another moment of the scene.

        Args:
            context: Open context.
            scene: The scene at that moment.
            facets: Its triangles whose depth may have to be drawn again.
        """
        placed = _placed(context, scene, self.of_material)
        return replace(self, facets=facets, ribbons=self.ribbons.moved(scene.draws, placed["commands"]), **placed)

    def release_places(self) -> None:
        """Release the buffers of `moved`."""
        for held in (self.draw_numbers, self.draws, self.offsets):
            held.release()

    @property
    def cut_out(self) -> NDArray[np.bool_]:
        """Tell which draws have cut-out textures, shape (D,)."""
        return np.array(["CUT_OUT" in variant.features for variant in self.variants])[self.variant_rows]

    @property
    def blended(self) -> NDArray[np.bool_]:
        """Tell which draws are blended, shape (D,)."""
        return np.array(["BLEND" in variant.features for variant in self.variants])[self.variant_rows]

    @cached_property
    def waters(self) -> NDArray[np.bool_]:
        """Tell which draws are water, shape (D,)."""
        return np.array(["WATER" in variant.features for variant in self.variants])[self.variant_rows]

    @property
    def transparent_draws(self) -> NDArray[np.bool_]:
        """Tell which draws are left out of truth and shadows, shape (D,)."""
        return np.array([variant.mostly_transparent for variant in self.variants])[self.variant_rows]

    def place(self, eye: F64) -> None:
        """Compute every draw's origin relative to a point, subtracted in float64.

        Args:
            eye: The point [m], shape (3,), float64.
        """
        self.offsets.write((self.origins - eye).astype(np.float32).tobytes())

    def bind(self) -> None:
        """Bind the rows of draws that the shaders read."""
        self.draws.use(DRAW_UNIT)

    def bind_material(self, material: int) -> None:
        """Bind a material for the following draws.

        Args:
            material: Its row.
        """
        self.materials.bind_to_uniform_block(0, offset=_APART * material, size=ROW.itemsize)

    def grouped(self, rows: I64) -> list[tuple[int, I64]]:
        """Split ordered draws by material, each in the order given.

        Args:
            rows: Draws in the order in which they should be drawn, shape (N,), int64.

        Returns:
            Material and rows of its draws, shape (M,), int64, of each group; the first draws' groups first.
        """
        kinds = self.material_rows[rows]
        present, first = np.unique(kinds, return_index=True)
        return [(int(kind), rows[kinds == kind]) for kind in present[np.argsort(first)]]

    def triangles(self, rows: I64) -> I64:
        """Count the triangles of some draws, shape (N,), int64.

        Args:
            rows: Draws, shape (N,), int64.
        """
        return self.commands["count"][rows].astype(np.int64) // 3

    def vertex_array(self, context: moderngl.Context, program: moderngl.Program) -> moderngl.VertexArray:
        """Connect a program to the buffers; attributes that it does not use are skipped.

        Args:
            context: Open context.
            program: Compiled program.

        Returns:
            OpenGL's vertex array over the vertex buffer, shape (V,).
        """
        used = [name for name in VERTEX_NAMES if name in program]
        formats = [code if name in used else f"{size}x" for name, (code, size) in _ATTRIBUTES.items()]
        content = [
            (self.vertices, " ".join(formats), *used),
            (self.draw_numbers, "1u4/i", "in_draw"),
            (self.offsets, "3f4/i", "in_offset"),
        ]
        return context.vertex_array(program, content, self.indices)

    def bar_array(self, context: moderngl.Context, program: moderngl.Program) -> moderngl.VertexArray:
        """Connect a program to the buffers of bars, as `vertex_array` does to those of all.

        Args:
            context: Open context.
            program: Compiled program.

        Returns:
            OpenGL's vertex array over the vertices of bars, shape (B,).
        """
        ribbons, (shapes, names) = self.ribbons, shape_attributes(program)
        used = [name for name in VERTEX_NAMES if name in program]
        formats = [code if name in used else f"{size}x" for name, (code, size) in _ATTRIBUTES.items()]
        content = [
            (ribbons.vertices, " ".join(formats), *used),
            (ribbons.shapes, shapes, *names),
            (self.draw_numbers, "1u4/i", "in_draw"),
            (self.offsets, "3f4/i", "in_offset"),
        ]
        return context.vertex_array(program, content, ribbons.indices)


def upload_scene(gl: Gl, scene: FlatScene, table: MaterialTable, anchor: F64, facets: Facets, bars: Bars) -> GpuScene:
    """Check a scene and upload it to buffers.

    Args:
        gl: Open context.
        scene: Scene to upload.
        table: Its materials.
        anchor: Origin of positions in the shading [m], shape (3,), float64.
        facets: Triangles whose depth may have to be drawn again.
        bars: Members that may be thinner than a pixel.

    Raises:
        InputError: Nothing to draw, an index out of range, or a number that is not finite.
    """
    check_scene(scene)
    geometry, context = scene.geometry, gl.context
    count = len(geometry.positions)
    vertices = context.buffer(reserve=max(count, 1) * _VERTEX.itemsize)
    for first in range(0, count, _AT_ONCE):  # a copy of all of them, and its bytes, would take 50 MB
        block = _vertices(geometry, slice(first, first + _AT_ONCE))
        vertices.write(block.tobytes(), offset=first * _VERTEX.itemsize)
    materials = np.zeros((len(table.rows), _APART // 4), np.float32)
    materials[:, : ROW.itemsize // 4] = _numbers(table.rows)
    variants = tuple(dict.fromkeys(table.variants))
    number = {variant: row for row, variant in enumerate(variants)}
    of_material = np.array([number[variant] for variant in table.variants], np.int64)
    placed = _placed(context, scene, of_material)
    return GpuScene(
        vertices=vertices,
        indices=context.buffer(np.ascontiguousarray(geometry.triangles, np.uint32)),
        materials=context.buffer(materials.tobytes()),
        variants=variants,
        of_material=of_material,
        anchor=anchor,
        facets=facets,
        wraps=Wraps(gl.functions),
        ribbons=upload_ribbons(context, scene, bars, partial(_vertices, geometry), placed["commands"]),
        **placed,
    )


def _vertices(geometry: Geometry, rows: slice | I64) -> NDArray[np.void]:
    """Convert some rows of a geometry's vertices to the shaders' format."""
    positions = geometry.positions[rows]
    vertices = np.zeros(len(positions), _VERTEX)
    vertices["p"], vertices["n"] = positions, geometry.normals[rows]
    vertices["st"], vertices["st1"] = geometry.st[rows], geometry.st1[rows]
    vertices["color"][:, :3] = geometry.colors[rows]
    return vertices


def _placed(context: moderngl.Context, scene: FlatScene, of_material: I64) -> dict[str, Any]:
    """Upload the positions of all draws: the fields of a `GpuScene` that change when objects move."""
    geometry, draws = scene.geometry, scene.draws
    count = len(draws.part)
    linear = draws.transform[:, :3, :3]
    rows = np.zeros(count, _DRAW)
    rows["linear"][..., :3] = linear
    mirrored = np.linalg.det(linear) < 0
    rows["cofactor"][..., :3] = _cofactors(linear) * np.where(mirrored, -1.0, 1.0)[:, None, None]
    rows["linear"][:, 1, 3] = np.where(geometry.part_double_sided[draws.part] == ALIKE, 2, mirrored)
    commands = np.zeros(count, COMMAND)
    commands["count"], commands["first"] = geometry.part_count[draws.part] * 3, geometry.part_first[draws.part] * 3
    commands["instances"], commands["draw"] = 1, np.arange(count)
    lower, upper = draw_boxes(scene)
    return {
        "draw_numbers": context.buffer(np.arange(count, dtype=np.uint32).tobytes()),
        "draws": row_texture(context, _numbers(rows)),
        "offsets": context.buffer(reserve=count * 12, dynamic=True),
        "origins": draws.transform[:, :3, 3].copy(),
        "lower": lower,
        "upper": upper,
        "commands": commands,
        "variant_rows": of_material[draws.material],
        "material_rows": draws.material.astype(np.int64),
    }


def run_commands(
    flush: Callable[[], None],
    vertices: moderngl.VertexArray,
    commands: moderngl.Buffer,
    triangles: I64,
    first: int,
    waiting: int,
) -> int:
    """Run draw commands, and flush whenever many triangles are waiting; this changes no pixel.

    Args:
        flush: OpenGL's.
        vertices: Vertex array that they draw, shape (V,).
        commands: Draw commands, some of which are run.
        triangles: Number of triangles of each of these, shape (N,), int64.
        first: Number of the first of them.
        waiting: Triangles that are already waiting.

    Returns:
        Triangles that are waiting now.
    """
    total = waiting + np.cumsum(triangles)
    ends = np.flatnonzero(np.diff(total // _WAITING, prepend=0)) + 1
    for start, end in pairwise([0, *ends.tolist()]):
        vertices.render_indirect(commands, moderngl.TRIANGLES, end - start, first=first + start)
        flush()
    done = int(ends[-1]) if len(ends) else 0
    if done < len(total):
        vertices.render_indirect(commands, moderngl.TRIANGLES, len(total) - done, first=first + done)
    return int(total[-1]) % _WAITING


def check_scene(scene: FlatScene) -> None:
    """Refuse data that a driver would silently draw wrongly.

    Args:
        scene: Scene to check.

    Raises:
        InputError: Nothing to draw, an index out of range, or a number that is not finite.
    """
    geometry, draws = scene.geometry, scene.draws
    if not len(draws.part) or not len(geometry.triangles):
        raise InputError("the stage has no visible geometry", hint="Check visibility, purpose and loaded payloads")
    finite = np.isfinite(draws.transform).all(axis=(1, 2))
    if not finite.all():
        ids = {row.id: row.path for row in scene.instances}
        bad = int(draws.instance[np.argmin(finite)])
        raise InputError(
            "a transform is not finite", field=ids.get(bad, f"instance {bad}"), hint="Correct its xformOps"
        )
    if not np.isfinite(geometry.positions).all():
        raise InputError("a mesh has positions that are not finite", hint="Correct its points")
    last = geometry.part_first.astype(np.int64) + geometry.part_count
    tables = (
        (geometry.triangles, len(geometry.positions)),
        (draws.part, len(geometry.part_first)),
        (draws.material, len(scene.materials)),
        (last, len(geometry.triangles) + 1),
    )
    if any(len(rows) and not 0 <= int(rows.min()) <= int(rows.max()) < limit for rows, limit in tables):
        raise InputError("the flat scene has an index out of range", hint="Read the stage again")


def draw_boxes(scene: FlatScene) -> tuple[F64, F64]:
    """Find the axis-aligned box of each draw.

    Args:
        scene: A scene.

    Returns:
        Lower and upper corners [m], each of shape (D, 3), float64.
    """
    geometry, draws = scene.geometry, scene.draws
    low, high = np.zeros((len(geometry.part_first), 3)), np.zeros((len(geometry.part_first), 3))
    for part in np.unique(draws.part):
        first, count = geometry.part_first[part], geometry.part_count[part]
        corners = geometry.positions[geometry.triangles[first : first + count].ravel()]
        if len(corners):
            low[part], high[part] = corners.min(axis=0), corners.max(axis=0)
    center, half = (low + high)[draws.part] / 2, (high - low)[draws.part] / 2
    linear = draws.transform[:, :3, :3]
    middle = np.einsum("dij,dj->di", linear, center) + draws.transform[:, :3, 3]
    reach = np.einsum("dij,dj->di", np.abs(linear), half)
    return middle - reach, middle + reach


def _numbers(rows: NDArray[np.void]) -> NDArray[np.float32]:
    """Flatten rows whose fields are all float32; shape (N, numbers)."""
    return rows.view(np.float32).reshape(len(rows), -1)


def _cofactors(linear: F64) -> F64:
    """Compute the cofactors, which transform normals and exist even without an inverse; shape (D, 3, 3)."""
    rows = np.cross(np.roll(linear, -1, axis=1), np.roll(linear, -2, axis=1))
    size = np.abs(rows).max(axis=(1, 2), keepdims=True)
    return rows / np.where(size > 0, size, 1.0)
