"""Round members in space: cables, stays and hangers, and the sleeves at their ends."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from authoring.shapes.component import F64, I32, I64
from authoring.shapes.topology import cross
from authoring.solids.sweep import Surface

MAIN_SIDES, STAY_SIDES, HANGER_SIDES = 16, 12, 8
CHORD_SAG = 0.010  # [m] largest distance of a cable's chords from its curve


@dataclass(frozen=True)
class Plane:
    """A plane that cuts the first end of a round member, or one for each of several.

    Attributes:
        point: Any point of it [m], shape (3,) or (M, 3), float64.
        normal: Its unit normal [1], shape (3,) or (M, 3), float64.
    """

    point: F64
    normal: F64


def tube(points: F64, radius: float | F64, sides: int, cut: Plane | None = None) -> Surface:
    """Sweep a round section along one line in space; as `tubes`.

    Args:
        points: World positions along the axis [m], shape (N, 3), float64.
        radius: Of the whole member, or at each point [m], shape (N,), float64.
        sides: Corners of a ring.
        cut: Plane that the first end is cut along instead of perpendicular to the axis; meant for straight members.

    Returns:
        Closed surface, normals outward, `st` along the axis and round it.
    """
    return tubes(points[None], radius, sides, cut)[0]


def tubes(points: F64, radius: float | F64, sides: int, cut: Plane | None = None) -> list[Surface]:
    """Sweep round sections along lines in space and close both ends.

    The rings are perpendicular to the line, in a frame that does not rotate about it. Points may repeat where the
    radius changes: this makes a step.

    Args:
        points: World positions along the axis of each member [m], shape (M, N, 3), float64; the same ones repeat.
        radius: Of all members, or at each point [m], shape (N,), float64.
        sides: Corners of a ring.
        cut: Plane that the first ends are cut along instead of perpendicular to the axis; meant for straight members.

    Returns:
        For each a closed surface, normals outward, `st` along the axis and round it.
    """
    count = points.shape[1]
    radii = np.broadcast_to(np.asarray(radius, np.float64), (count,))
    tangents, first, second = _frames(points)
    angle = 2.0 * np.pi * (np.arange(sides) + 0.5) / sides
    flat = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    radial = flat[:, :1] * first[:, :, None] + flat[:, 1:] * second[:, :, None]
    rings = points[:, :, None] + radii[:, None, None] * radial
    off = np.zeros((len(points), sides))
    if cut is not None:
        point, normal = (np.broadcast_to(value, (len(points), 3)) for value in (cut.point, cut.normal))
        slant_there = np.sum(tangents[:, 0] * normal, axis=1)
        off = np.einsum("mpd,md->mp", point[:, None] - rings[:, 0], normal) / slant_there[:, None]
        rings[:, 0] += off[..., None] * tangents[:, :1]
    way = np.diff(points, axis=1)
    run, step = np.sqrt(np.sum(way * way, axis=2)), np.diff(radii)
    slant = np.hypot(run, step)
    slope = np.stack([run, np.broadcast_to(-step, run.shape)], axis=2) / slant[..., None]
    lengths = np.zeros((*points.shape[:2], sides))
    lengths[:, 1:] = np.cumsum(slant, axis=1)[..., None]
    lengths[:, 0] += off
    normals, st = _sides(radial, tangents, slope, lengths, radii)
    # A bent tube's quads are not flat.
    halved = count > 2 and float(np.ptp(tangents, axis=1).max()) > 1e-12
    net = _tube_net(count, sides, (run[0] == 0.0).tobytes(), halved)
    normals, st = (values.reshape(len(points), -1, values.shape[-1])[:, net.source] for values in (normals, st))
    begin, ends, st_ends = _ends(points, rings, (tangents, first, second), flat, radii, cut)
    normals = np.concatenate([normals, np.repeat(np.stack([begin, ends], axis=1), sides, axis=1)], axis=1)
    st = np.concatenate([st, st_ends], axis=1)
    return [
        Surface(rings[row].reshape(-1, 3), net.counts, net.corners, normals[row], st[row], net.chart)
        for row in range(len(points))
    ]


def chords(sag: float, share: float = 1.0) -> int:
    """Count the chords of equal run that keep a parabola within CHORD_SAG.

    Args:
        sag: Of the whole parabola in its middle [m].
        share: Part of its run that is built [1].
    """
    return max(1, int(np.ceil(share * np.sqrt(sag / CHORD_SAG))))


def _frames(points: F64) -> tuple[F64, F64, F64]:
    """Find the tangent and two normals at every point of each line, transported with the least rotation."""
    run = np.diff(points, axis=1)
    length = np.sqrt(np.sum(run * run, axis=2))
    real = length[0] > 0.0
    unit = run[:, real] / length[:, real][..., None]
    before = np.concatenate([[0], np.cumsum(real)])  # number of chords with a length that end at each point
    low, high = np.clip(before - 1, 0, unit.shape[1] - 1), np.clip(before, 0, unit.shape[1] - 1)
    repeated = np.concatenate([~real, [False]]) | np.concatenate([[False], ~real])
    low = np.where(repeated, high, low)
    tangents = unit[:, low] + unit[:, high]
    tangents /= np.sqrt(np.sum(tangents * tangents, axis=2, keepdims=True))
    start = np.zeros((len(points), 3))
    start[:, 0], start[:, 1] = -tangents[:, 0, 1], tangents[:, 0, 0]  # level, square to the tangent
    start[np.abs(tangents[:, 0, 2]) > 0.999] = (1.0, 0.0, 0.0)
    first = np.empty_like(tangents)
    first[:, 0] = start
    for k in range(len(points[0])):
        carried = first[:, max(k - 1, 0)]
        along = np.einsum("md,md->m", carried, tangents[:, k])
        first[:, k] = carried - along[:, None] * tangents[:, k]
    first /= np.sqrt(np.sum(first * first, axis=2, keepdims=True))
    return tangents, first, cross(tangents, first)


def _sides(radial: F64, tangents: F64, slope: F64, lengths: F64, radii: F64) -> tuple[F64, F64]:
    """Find normals and texture of the quads between the rings, shapes (M, Q, 4, 3) and (M, Q, 4, 2)."""
    count, size = lengths.shape[1:]
    ring, spoke = _grid(count, size)
    i, there = ring[:, 0], spoke % size
    away, rise = slope[:, i, 0][..., None, None], slope[:, i, 1][..., None, None]
    normals = away * radial[:, ring, there] + rise * tangents[:, ring]
    # The larger ring's circumference is used on both sides of a taper, so that the texture is not compressed.
    reach = np.maximum(radii[i], radii[i + 1]) * (2.0 * np.sin(np.pi / size))
    st = np.empty((*normals.shape[:3], 2))
    st[..., 0], st[..., 1] = lengths[:, ring, there], -spoke * reach[:, None]
    flat = slope[0, i, 0] == 0.0
    if flat.any():
        angle, wide = 2.0 * np.pi * (spoke[flat] + 0.5) / size, radii[ring[flat]]
        st[:, flat] = np.stack(
            np.broadcast_arrays(wide * np.cos(angle) * slope[:, i[flat], 1][..., None], wide * np.sin(angle)), axis=-1
        )
    return normals, st


def _ends(
    points: F64, rings: F64, frames: tuple[F64, F64, F64], flat: F64, radii: F64, cut: Plane | None
) -> tuple[F64, F64, F64]:
    """Find the normals of both ends of each tube, shapes (M, 3), and their texture, shape (M, 2 P, 2)."""
    tangents, first, second = frames
    st = np.empty((len(points), 2, len(flat), 2))
    st[:, 0], st[:, 1] = flat[::-1] * (-radii[0], radii[0]), flat * radii[-1]
    begin = -tangents[:, 0]
    if cut is not None:
        # The cut face is an ellipse: its texture is mapped in its own plane.
        begin = -cut.normal * np.sign(np.sum(tangents[:, 0] * cut.normal, axis=1))[:, None]
        beside = np.abs(np.einsum("md,md->m", begin, first[:, 0])) < 0.9
        across = cross(begin, np.where(beside[:, None], first[:, 0], second[:, 0]))
        across /= np.sqrt(np.sum(across * across, axis=1, keepdims=True))
        local = (rings[:, 0] - points[:, :1])[:, ::-1]
        for axis, side in enumerate((across, cross(begin, across))):
            st[:, 0, :, axis] = np.einsum("mpd,md->mp", local, side)
    return begin, tangents[:, -1], st.reshape(len(points), -1, 2)


@dataclass(frozen=True)
class _TubeNet:
    """Faces of a tube, and the row of the quads' corners that each corner of the sides is, shape (C,), int64."""

    counts: I32
    corners: I32
    chart: I32
    source: I64


@lru_cache(maxsize=256)
def _tube_net(count: int, sides: int, steps: bytes, halved: bool) -> _TubeNet:
    """Build the faces of a tube.

    Args:
        count: Number of rings.
        sides: Corners of each.
        steps: For each chord, one flag: it has no length, and so a chart of its own.
        halved: Quads are cut into two triangles.
    """
    ring, spoke = _grid(count, sides)
    quads = np.arange(ring.size).reshape(-1, 4)
    own = np.where(np.frombuffer(steps, bool), np.arange(1, count), 0)
    chart = np.repeat(own, sides * (2 if halved else 1))
    source = (quads[:, [0, 1, 2, 0, 2, 3]] if halved else quads).ravel()
    corners = (ring * sides + spoke % sides).ravel()[source]
    last = np.arange(sides)
    counts = np.concatenate([np.full(len(chart), 3 if halved else 4), np.full(2, sides)])
    return _TubeNet(
        counts.astype(np.int32),
        np.concatenate([corners, last[::-1], last + (count - 1) * sides]).astype(np.int32),
        np.unique(np.concatenate([chart, count + np.arange(2)]), return_inverse=True)[1].astype(np.int32),
        source,
    )


@lru_cache(maxsize=256)
def _grid(count: int, size: int) -> tuple[I64, I64]:
    """Number ring and spoke of the corners of the quads between rings, shapes ((N - 1) P, 4), int64."""
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(count - 1), np.arange(size), indexing="ij"))
    return np.stack([i, i, i + 1, i + 1], axis=1), np.stack([j, j + 1, j + 1, j], axis=1)
