"""Round members in space: cables, stays and hangers, and the sleeves that hold their ends."""

from dataclasses import dataclass

import numpy as np

from authoring.component import F64, I32
from authoring.sweep import Surface

MAIN_SIDES, STAY_SIDES, HANGER_SIDES = 16, 12, 8
CHORD_SAG = 0.010  # [m] that a cable's chords may leave its curve


@dataclass(frozen=True)
class Plane:
    """A plane that cuts the first end of a round member.

    Attributes:
        point: Any point of it [m], shape (3,), float64.
        normal: Its unit normal [1], shape (3,), float64.
    """

    point: F64
    normal: F64


def tube(points: F64, radius: float | F64, sides: int, cut: Plane | None = None) -> Surface:
    """Sweep a round section along a line in space and close both ends.

    The rings stand square to the line, in a frame that is carried along without turning about it. Points may repeat
    where the radius changes: that makes a step.

    Args:
        points: World positions along the axis [m], shape (N, 3), float64.
        radius: Of the whole member, or at each point [m], shape (N,), float64.
        sides: Corners of a ring.
        cut: Plane that the first end is cut along instead of square to the axis; meant for straight members.

    Returns:
        Closed surface, normals outward, `st` along the axis and round it.
    """
    radii = np.broadcast_to(np.asarray(radius, np.float64), (len(points),))
    tangents, first, second = _frames(points)
    angle = 2.0 * np.pi * (np.arange(sides) + 0.5) / sides
    radial = np.cos(angle)[None, :, None] * first[:, None] + np.sin(angle)[None, :, None] * second[:, None]
    rings = points[:, None] + radii[:, None, None] * radial
    off = np.zeros(sides)
    if cut is not None:
        off = (cut.point - rings[0]) @ cut.normal / (tangents[0] @ cut.normal)
        rings[0] += off[:, None] * tangents[0]
    run, step = np.linalg.norm(np.diff(points, axis=0), axis=1), np.diff(radii)
    slope = np.stack([run, -step], axis=1) / np.hypot(run, step)[:, None]
    lengths = np.repeat(np.cumsum([0.0, *np.hypot(run, step)])[:, None], sides, axis=1)
    lengths[0] += off
    corners, normals, st = _sides(radial, tangents, slope, lengths, radii)
    chart = np.repeat(np.where(run == 0.0, np.arange(1, len(run) + 1), 0), sides)  # a step has a chart of its own
    if len(points) > 2 and np.ptp(tangents, axis=0).max() > 1e-12:  # a bent tube's quads are not flat
        order = [0, 1, 2, 0, 2, 3]
        corners, normals, st = corners[:, order], normals[:, order], st[:, order]
        counts, chart = np.full(2 * len(corners), 3, np.int32), np.repeat(chart, 2)
    else:
        counts = np.full(len(corners), 4, np.int32)
    flat = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    back = np.arange(sides)[::-1]
    begin = -tangents[0] if cut is None else -cut.normal * np.sign(tangents[0] @ cut.normal)
    st_begin, st_end = flat[back] * (-radii[0], radii[0]), flat * radii[-1]
    if cut is not None:
        # The cut face is an ellipse: its texture is laid in its own plane.
        across = np.cross(begin, first[0] if abs(begin @ first[0]) < 0.9 else second[0])
        across /= np.linalg.norm(across)
        local = (rings[0] - points[0])[back]
        st_begin = np.stack([local @ across, local @ np.cross(begin, across)], axis=1)
    return Surface(
        points=rings.reshape(-1, 3),
        face_counts=np.concatenate([counts, np.full(2, sides, np.int32)]),
        corners=np.concatenate([corners.ravel(), back, np.arange(sides) + (len(points) - 1) * sides]).astype(np.int32),
        normals=np.concatenate([normals.reshape(-1, 3), np.tile(begin, (sides, 1)), np.tile(tangents[-1], (sides, 1))]),
        st=np.concatenate([st.reshape(-1, 2), st_begin, st_end]),
        chart=np.unique(np.concatenate([chart, len(run) + 1 + np.arange(2)]), return_inverse=True)[1].astype(np.int32),
    )


def bar(begin: F64, end: F64, radius: float, sides: int) -> Surface:
    """Build a straight round member.

    Args:
        begin: World position of its first end [m], shape (3,), float64.
        end: World position of its last end [m], shape (3,), float64.
        radius: Of its section [m].
        sides: Corners of its section.
    """
    return tube(np.stack([begin, end]), radius, sides)


def chords(sag: float, share: float = 1.0) -> int:
    """Count the chords of equal run that keep a parabola within CHORD_SAG.

    Args:
        sag: Of the whole parabola in its middle [m].
        share: Part of its run that is built [1].
    """
    return max(1, int(np.ceil(share * np.sqrt(sag / CHORD_SAG))))


def _frames(points: F64) -> tuple[F64, F64, F64]:
    """Find the tangent and two normals at every point, carried along by the least turn."""
    run = np.diff(points, axis=0)
    length = np.linalg.norm(run, axis=1)
    unit = run[length > 0.0] / length[length > 0.0][:, None]
    before = np.concatenate([[0], np.cumsum(length > 0.0)])  # of the real chords, how many end at each point
    low, high = np.clip(before - 1, 0, len(unit) - 1), np.clip(before, 0, len(unit) - 1)
    repeated = np.concatenate([length == 0.0, [False]]) | np.concatenate([[False], length == 0.0])
    low = np.where(repeated, high, low)
    tangents = unit[low] + unit[high]
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    upright = abs(tangents[0, 2]) > 0.999
    start = np.array([1.0, 0.0, 0.0]) if upright else np.cross([0.0, 0.0, 1.0], tangents[0])
    first = np.empty_like(tangents)
    first[0] = start - (start @ tangents[0]) * tangents[0]
    for k in range(1, len(tangents)):
        first[k] = first[k - 1] - (first[k - 1] @ tangents[k]) * tangents[k]
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return tangents, first, np.cross(tangents, first)


def _sides(radial: F64, tangents: F64, slope: F64, lengths: F64, radii: F64) -> tuple[I32, F64, F64]:
    """List the quads between the rings: corners, normals and texture, shapes (Q, 4), (Q, 4, 3) and (Q, 4, 2)."""
    count, size = lengths.shape
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(count - 1), np.arange(size), indexing="ij"))
    ring, spoke = np.stack([i, i, i + 1, i + 1], axis=1), np.stack([j, j + 1, j + 1, j], axis=1)
    away, rise = slope[i, 0][:, None, None], slope[i, 1][:, None, None]
    normals = away * radial[ring, spoke % size] + rise * tangents[ring]
    # The larger ring's girth holds on both sides of a taper, so that the texture is not squeezed.
    reach = np.maximum(radii[i], radii[i + 1]) * (2.0 * np.sin(np.pi / size))
    st = np.stack([lengths[ring, spoke % size], -spoke * reach[:, None]], axis=2)
    flat = slope[i, 0] == 0.0
    angle, wide = 2.0 * np.pi * (spoke[flat] + 0.5) / size, radii[ring[flat]]
    st[flat] = np.stack([wide * np.cos(angle) * slope[i[flat], 1][:, None], wide * np.sin(angle)], axis=2)
    return (ring * size + spoke % size).astype(np.int32), normals, st
