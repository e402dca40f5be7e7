"""Bars in OpenGL buffers: surfaces that fade out where they are few pixels thick, and the ribbons that replace them.

A ribbon is a strip that faces the camera, drawn with the bar's coverage of each pixel.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from render.gpu.bars import Bars
from usd_schemas.flat_scene import Draws, FlatScene

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

BAR_NAMES = ("in_axis", "in_first", "in_second", "in_shape")
_BAR_FORMATS = ("3f4", "3f4", "3f4", "3f4")
# Vector to the segment's other end, half axes of the cross-section here; then side of a ribbon, 1 if it is round or
# `_NOT_A_BAR` or `_EMBEDDED` or 0, and 1 at one end of a segment, -1 at the other.
_BAR = np.dtype([("axis", "3f4"), ("first", "3f4"), ("second", "3f4"), ("shape", "3f4")])
_NOT_A_BAR = -1.0
_EMBEDDED = 0.25
WIDEST = 2.5  # [px] from this thickness on only the surface is drawn; as in bar.glsl
SAMPLED_WIDEST = 1.2  # [px] the same where edges have further samples, as in surface.frag
_EDGED = 8.0 / WIDEST  # the same of bars with edges over that of others; as in bar.glsl
_FLAT = 1e-2  # bars thinner than this share of their width have no two sides that are seen; as in bar.glsl
_SHORTEST = 8.0  # [px]; shorter ones, such as distant grass, do not look like lines, and are many
_ROWS = 4.0  # by which embedded bars may be shorter: a row of sleepers is seen where a single one is not [1]
_BEYOND = 0.5  # [stage units] by which a sleeper's body and fastenings reach beyond its exposed face at most
_LEAST = 1e-3  # [m] smallest thickness of a flat bar seen from the side
_PAINT = 0.012  # [m] largest thickness of a line on a road, part of which is below the surface
_BROAD = 8.0  # least ratio of its width to its thickness [1]
_LEVEL = 0.7  # least upward part of its unit normal [1]


@dataclass(frozen=True)
class PartBars:
    """Positions of the bars of each part of a geometry, and their size in mesh-local axes.

    Attributes:
        first: First triangle of its surfaces and of its ribbons, shape (P, 2), int64.
        count: Number of these triangles, 0 without bars, shape (P, 2), int64.
        thickness: Thickness of its thinnest bar [stage units], of one with edges divided by `_EDGED`, +inf without any,
            shape (P,), float64.
        length: Length of its longest segment [stage units], of an embedded one times `_ROWS`, shape (P,), float64.
        embedded: Whether it consists of bars embedded in a surface, shape (P,), bool.
        lying: Whether it mostly consists of bars that are so thin that they lie on a surface, such as lines on a road,
            shape (P,), bool.
    """

    first: I64
    count: I64
    thickness: F64
    length: F64
    embedded: NDArray[np.bool_]
    lying: NDArray[np.bool_]

    def placed(self, draws: Draws, commands: NDArray[np.void]) -> dict[str, Any]:
        """Compute the fields of `Ribbons` that depend on the draws.

        Args:
            draws: The draws.
            commands: Their draw commands, shape (D,).
        """
        part, scale = draws.part, np.linalg.norm(draws.transform[:, :3, :3], axis=1)
        tables = [commands.copy(), commands.copy()]
        for kind, table in enumerate(tables):
            table["count"], table["first"] = 3 * self.count[part, kind], 3 * self.first[part, kind]
        thickness = np.full(len(part), np.inf)
        np.multiply(self.thickness[part], scale.min(axis=1), out=thickness, where=self.count[part, 1] > 0)
        length = self.length[part] * scale.max(axis=1)
        kinds = {"embedded": self.embedded[part], "lying": self.lying[part]}
        return {"surfaces": tables[0], "ribbons": tables[1], "thickness": thickness, "length": length, **kinds}


@dataclass(frozen=True)
class Ribbons:
    """Bars of a scene that may be thinner than a pixel.

    Attributes:
        vertices: Vertices of the parts that have bars, then four for each segment.
        shapes: Attributes of these that describe their bars.
        indices: Triangles of both.
        surfaces: Draw command of the surfaces of each draw, shape (D,), dtype as the scene's.
        ribbons: Draw command of the ribbons of each draw, shape (D,), dtype as the scene's.
        thickness: Thickness of the thinnest bar of each draw [m], of one with edges divided by `_EDGED`, +inf without
            any, shape (D,), float64.
        length: Length of the longest segment of each draw [m], of an embedded one times `_ROWS`, shape (D,), float64.
        embedded: Whether a draw consists of bars embedded in a surface, shape (D,), bool.
        lying: Whether a draw mostly consists of bars so thin that they lie on a surface, shape (D,), bool.
        parts: Positions of the bars of each part.
    """

    vertices: moderngl.Buffer
    shapes: moderngl.Buffer
    indices: moderngl.Buffer
    surfaces: NDArray[np.void]
    ribbons: NDArray[np.void]
    thickness: F64
    length: F64
    embedded: NDArray[np.bool_]
    lying: NDArray[np.bool_]
    parts: PartBars

    def moved(self, draws: Draws, commands: NDArray[np.void]) -> "Ribbons":
        """Return the same bars, at the positions of another moment of the scene.

        Args:
            draws: The draws at that moment.
            commands: Their draw commands, shape (D,).
        """
        return replace(self, **self.parts.placed(draws, commands))

    def thin(
        self, rows: I64, lower: F64, upper: F64, eye: F64, focal: float, *, sampled: bool = False
    ) -> NDArray[np.bool_]:
        """Tell which draws have bars that may be thinner than a pixel in a view, shape (N,).

        Args:
            rows: Draws, shape (N,), int64.
            lower: Lower corner of each draw's box [m], shape (D, 3), float64.
            upper: Upper corner of each draw's box [m], shape (D, 3), float64.
            eye: Camera center [m], shape (3,), float64.
            focal: Focal length [px].
            sampled: Whether edges have further samples, so that only the thinnest bars need ribbons.
        """
        widest = SAMPLED_WIDEST if sampled else WIDEST
        one, other = np.abs(lower[rows] - eye), np.abs(upper[rows] - eye)
        farthest = np.linalg.norm(np.maximum(one, other), axis=1)
        inside = (lower[rows] <= eye) & (upper[rows] >= eye)
        nearest = np.linalg.norm(np.where(inside, 0.0, np.minimum(one, other)), axis=1)
        is_long = self.length[rows] * focal > _SHORTEST * nearest
        return is_long & (self.thickness[rows] * focal < widest * farthest)

    def upwards(self, rows: I64) -> I64:
        """Order draws so that what is embedded in a surface comes before what stands on it, shape (N,).

        Args:
            rows: Draws, shape (N,), int64.
        """
        return rows[np.argsort(~self.embedded[rows], kind="stable")]


def upload_ribbons(
    context: moderngl.Context,
    scene: FlatScene,
    bars: Bars,
    vertices: Callable[[I64], NDArray[np.void]],
    commands: NDArray[np.void],
) -> Ribbons:
    """Upload the bars of a scene to buffers.

    Args:
        context: Open context.
        scene: The scene.
        bars: Its bars.
        vertices: Returns some of its vertices in the renderer's format, positions in mesh-local axes [stage units].
        commands: Draw command of each draw, shape (D,).
    """
    geometry = scene.geometry
    counts = np.bincount(bars.part, minlength=len(geometry.part_first))
    parts = np.flatnonzero(counts)
    lying, tops = level_bars(scene, bars, parts)
    second = np.where((tops == 0).all(axis=1)[:, None, None], bars.second, 0.0)
    bars = replace(bars, ends=bars.ends + tops[:, None], second=second)
    runs = [
        np.arange(geometry.part_first[part], geometry.part_first[part] + geometry.part_count[part]) for part in parts
    ]
    corners = geometry.triangles[np.concatenate([np.zeros(0, np.int64), *runs])].astype(np.int64)
    used, places = np.unique(corners.ravel(), return_inverse=True)
    strips = np.arange(4 * len(bars.part)).reshape(-1, 2, 2) + len(used)  # by segment, end and side
    quads = strips.reshape(-1, 4)[:, [0, 1, 2, 2, 1, 3]]
    ends = np.repeat(bars.vertex.reshape(-1), 2)
    every = vertices(np.concatenate([used, ends]))
    every["p"][len(used) :] = np.repeat(bars.ends.reshape(-1, 3), 2, axis=0)
    shapes = np.concatenate([_surface_shapes(bars, used), _ribbon_shapes(bars)])
    surfaces = np.where(counts > 0, geometry.part_count, 0)
    found = PartBars(
        np.stack([_starts(surfaces), len(corners) + 2 * _starts(counts)], axis=1),
        np.stack([surfaces, 2 * counts], axis=1).astype(np.int64),
        *_sizes(bars, len(counts)),
        _embedded(scene, bars, parts),
        lying,
    )
    return Ribbons(
        context.buffer(every.tobytes() or bytes(4)),
        context.buffer(shapes.tobytes() or bytes(4)),
        context.buffer(np.concatenate([places.ravel(), quads.ravel()]).astype(np.uint32).tobytes() or bytes(4)),
        parts=found,
        **found.placed(scene.draws, commands),
    )


def shape_attributes(program: moderngl.Program) -> tuple[str, list[str]]:
    """Describe the attributes of shapes that a program reads, for moderngl.

    Args:
        program: Compiled program.

    Returns:
        Formats, and the names of the attributes.
    """
    names = [name for name in BAR_NAMES if name in program]
    formats = [
        code if name in names else f"{int(code[0]) * 4}x" for name, code in zip(BAR_NAMES, _BAR_FORMATS, strict=True)
    ]
    return " ".join(formats), names


def _surface_shapes(bars: Bars, used: I64) -> NDArray[np.void]:
    shapes = np.zeros(len(used), _BAR)
    shapes["shape"][:] = [0.0, _NOT_A_BAR, 1.0]
    on, segment, end = np.searchsorted(used, bars.vertices), bars.segment, bars.end
    shapes["axis"][on] = bars.ends[segment, 1 - end] - bars.ends[segment, end]
    shapes["first"][on], shapes["second"][on] = bars.first[segment, end], bars.second[segment, end]
    shapes["shape"][on, 1] = np.where(bars.embedded, _EMBEDDED, bars.round)[segment]
    return shapes


def _ribbon_shapes(bars: Bars) -> NDArray[np.void]:
    shapes = np.zeros((len(bars.part), 2, 2), _BAR)
    way = bars.ends[:, 1] - bars.ends[:, 0]
    shapes["axis"] = np.stack([way, -way], axis=1)[:, :, None]
    shapes["first"], shapes["second"] = bars.first[:, :, None], bars.second[:, :, None]
    shapes["shape"][..., 0] = [-1.0, 1.0]
    shapes["shape"][..., 1] = np.where(bars.embedded, _EMBEDDED, bars.round)[:, None, None]
    shapes["shape"][..., 2] = np.array([1.0, -1.0])[:, None]
    return shapes.reshape(-1)


def _sizes(bars: Bars, parts: int) -> tuple[F64, F64]:
    """Compute the thickness of the thinnest bar and length of the longest segment of each part, each shape (P,)."""
    least, longest = np.full(parts, np.inf), np.zeros(parts)
    first, second = np.linalg.norm(bars.first, axis=-1), np.linalg.norm(bars.second, axis=-1)
    edged = ~bars.round & ~bars.embedded & (second >= _FLAT * first).any(axis=1)
    thickness = np.maximum(2 * np.minimum(second, first).min(axis=1), _LEAST)
    np.minimum.at(least, bars.part, thickness / np.where(edged, _EDGED, 1.0))
    length = np.linalg.norm(bars.ends[:, 1] - bars.ends[:, 0], axis=-1) * np.where(bars.embedded, _ROWS, 1.0)
    np.maximum.at(longest, bars.part, length)
    return least, longest


def _embedded(scene: FlatScene, bars: Bars, parts: I64) -> NDArray[np.bool_]:
    """Tell which of the parts that have bars consist of embedded ones, shape (P,): nothing reaches far beyond these."""
    geometry = scene.geometry
    found = np.zeros(len(geometry.part_first), bool)
    for part in parts[np.isin(parts, bars.part[bars.embedded])].tolist():
        own = bars.part == part
        faces = (bars.ends[own, :, None] + bars.first[own][:, :, None] * [[1], [-1]]).reshape(-1, 3)
        first = geometry.part_first[part]
        corners = geometry.positions[geometry.triangles[first : first + geometry.part_count[part]].ravel()]
        beyond = np.maximum(faces.min(axis=0) - corners.min(axis=0), corners.max(axis=0) - faces.max(axis=0)).max()
        found[part] = bars.embedded[own].all() and beyond < _BEYOND
    return found


def level_bars(scene: FlatScene, bars: Bars, parts: I64) -> tuple[NDArray[np.bool_], F64]:
    """Find level bars so thin that they lie on a surface, such as lines on a road.

    Args:
        scene: The scene.
        bars: Its bars.
        parts: Parts that have bars, shape (B,), int64.

    Returns:
        Which parts mostly consist of such bars, shape (P,); the way from the middle of each of these bars to its top,
        zero for all others [stage units], shape (S, 3).
    """
    geometry, draws = scene.geometry, scene.draws
    first, second = np.linalg.norm(bars.first, axis=-1).min(axis=1), np.linalg.norm(bars.second, axis=-1).max(axis=1)
    normal = np.cross(bars.ends[:, 1] - bars.ends[:, 0], bars.first[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    thin = ~bars.round & ~bars.embedded & (first >= _BROAD * second)
    found, tops = np.zeros(len(geometry.part_first), bool), np.zeros((len(thin), 3))
    for part in parts.tolist():
        own = np.arange(*np.searchsorted(bars.part, [part, part + 1]).tolist())
        place = draws.transform[draws.part == part, :3, :3]
        if not len(place):  # invisible in the first image
            continue
        scale = np.linalg.norm(place[:, :, 0], axis=1).max(initial=0.0)
        up = normal[own] @ place[:, 2].T / max(scale, 1e-12)
        level = ((up > _LEVEL).all(axis=1) | (up < -_LEVEL).all(axis=1)) & thin[own]
        flat = own[level & (2 * scale * second[own] <= _PAINT)]
        start = geometry.part_first[part]
        corners = geometry.triangles[start : start + geometry.part_count[part]]
        on = bars.vertices[np.isin(bars.segment, flat)]
        if len(flat) and 2 * np.count_nonzero(np.isin(corners, on)) >= corners.size:
            found[part] = True
            side = np.where(up[np.searchsorted(own, flat), 0] < 0, -1.0, 1.0)
            tops[flat] = normal[flat] * (side * np.maximum(second[flat], _LEAST / 2))[:, None]
    return found, tops


def _starts(counts: I64) -> I64:
    return np.cumsum(counts) - counts
