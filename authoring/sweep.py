"""Sweeping a section along a line: closed solids with metric texture coordinates and the charts for an atlas."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from authoring.alignment import Alignment
from authoring.component import F64, I32
from authoring.sections import inset, is_convex, triangulate

Axis = Literal["station", "left", "above"]

GROOVE_DEPTH = 0.010  # [m], of a false joint
_SMOOTH_COSINE = float(np.cos(np.radians(25.0)))
_FLAT = 1e-9  # [m], how far a quad may leave its plane before it is split


@dataclass(frozen=True)
class Surface:
    """The closed surface of a member, before it has an identity.

    Attributes:
        points: World positions [m], shape (V, 3), float64.
        face_counts: Corners of each face, shape (F,), int32.
        corners: Vertex number of each face corner, counter-clockwise from outside, shape (C,), int32.
        normals: Unit normal at each corner [1], shape (C, 3), float64.
        st: Texture coordinates [m], shape (C, 2), float64.
        chart: Number of the chart that each face lies in; within a chart `st` does not overlap, shape (F,), int32.
    """

    points: F64
    face_counts: I32
    corners: I32
    normals: F64
    st: F64
    chart: I32


@dataclass(frozen=True)
class _Faces:
    counts: I32
    corners: I32
    st: F64


def sweep(
    sections: F64, along: F64, axis: Axis, place: Alignment, *, lengths: F64 | None = None, girth_of: I32 | None = None
) -> Surface:
    """Sweep a section along one of the bridge's axes and close both ends.

    The section lies in the plane of the two other axes: (left, above) for `station`, (station, above) for `left`,
    (station, left) for `above`.

    Args:
        sections: Outline at each place, counter-clockwise [m], shape (S, P, 2), float64.
        along: Coordinate of each outline along the axis, rising [m], shape (S,), float64.
        axis: Which way the sweep runs.
        place: Takes bridge coordinates to the world.
        lengths: Texture length at each outline [m], shape (S,), float64; default: the arc length.
        girth_of: Number of the outline whose girth each outline's texture follows, shape (S,), int32; default: its own.

    Returns:
        Closed surface, normals outward.
    """
    count, size = sections.shape[:2]
    rings = _rings(sections, along, axis, place)
    if lengths is None:
        lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(rings, axis=0), axis=2).mean(axis=1))])
    girth_of = np.arange(count, dtype=np.int32) if girth_of is None else girth_of
    charts = [
        _sides(sections, rings, lengths, girth_of),
        _cap(sections[0], 0, back=True),
        _cap(sections[-1], (count - 1) * size, back=False),
    ]
    counts = np.concatenate([chart.counts for chart in charts]).astype(np.int32)
    corners = np.concatenate([chart.corners for chart in charts]).astype(np.int32)
    st = np.concatenate([chart.st for chart in charts])
    if axis == "left":  # (station, above, left) is a left-handed frame
        turned_round = _reverse_faces(counts)
        corners, st = corners[turned_round], st[turned_round]
    points = rings.reshape(-1, 3)
    chart = np.repeat(np.arange(3, dtype=np.int32), [len(c.counts) for c in charts])
    return _unmirrored(Surface(points, counts, corners, corner_normals(points, counts, corners), st, chart))


def prism(
    outline: F64,
    low: float,
    high: float,
    axis: Axis,
    place: Alignment,
    chamfer: float = 0.0,
    grooves: tuple[float, ...] = (),
) -> Surface:
    """Extrude an outline, chamfer the edges of both end faces, and cut V grooves round the sides.

    Args:
        outline: Section, counter-clockwise [m], shape (P, 2), float64; its plane as in `sweep`.
        low: Where the solid begins along the axis [m].
        high: Where it ends [m].
        axis: Which way the member runs.
        place: Takes bridge coordinates to the world.
        chamfer: Leg of the chamfers [m]; 0 for none.
        grooves: Where along the axis a groove lies [m], rising and well inside the ends; as deep as half its width.

    Returns:
        Closed surface, normals outward.
    """
    along = [low, low + chamfer] if chamfer > 0.0 else [low]
    depth = [chamfer, 0.0] if chamfer > 0.0 else [0.0]
    for groove in grooves:
        along += [groove - GROOVE_DEPTH, groove, groove + GROOVE_DEPTH]
        depth += [0.0, GROOVE_DEPTH, 0.0]
    along += [high - chamfer, high] if chamfer > 0.0 else [high]
    depth += [0.0, chamfer] if chamfer > 0.0 else [0.0]
    run = np.zeros((3, len(along)))
    run[("station", "left", "above").index(axis)] = along
    steps = np.linalg.norm(np.diff(place.point(*run), axis=0), axis=1)
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(steps, np.diff(depth)))])
    sections = np.stack([inset(outline, d) if d > 0.0 else outline for d in depth])
    # Every smaller outline has a full one for a neighbour, whose girth its texture follows.
    full = [k if d == 0.0 else (k + 1 if k + 1 < len(depth) else k - 1) for k, d in enumerate(depth)]
    return sweep(sections, np.array(along), axis, place, lengths=lengths, girth_of=np.array(full, np.int32))


def turned(surface: Surface) -> Surface:
    """Turn the texture of a member's sides by a quarter, for a member that runs across its sweep.

    Args:
        surface: Result of `sweep` or `prism`.
    """
    side = np.repeat(surface.chart == 0, surface.face_counts)
    st = np.where(side[:, None], surface.st[:, ::-1], surface.st)
    return _unmirrored(replace(surface, st=st))


def joined(surfaces: list[Surface]) -> Surface:
    """Put several closed solids into one surface.

    Args:
        surfaces: At least one; they do not touch.
    """
    vertices = np.cumsum([0] + [len(s.points) for s in surfaces[:-1]])
    charts = np.cumsum([0] + [int(s.chart.max()) + 1 for s in surfaces[:-1]])
    return Surface(
        points=np.concatenate([s.points for s in surfaces]),
        face_counts=np.concatenate([s.face_counts for s in surfaces]),
        corners=np.concatenate([s.corners + n for s, n in zip(surfaces, vertices, strict=True)]).astype(np.int32),
        normals=np.concatenate([s.normals for s in surfaces]),
        st=np.concatenate([s.st for s in surfaces]),
        chart=np.concatenate([s.chart + n for s, n in zip(surfaces, charts, strict=True)]).astype(np.int32),
    )


def corner_normals(points: F64, face_counts: I32, corners: I32) -> F64:
    """Find a normal for every face corner: smooth where neighbours turn by less than 25 degrees, else flat.

    Args:
        points: Positions [m], shape (V, 3), float64.
        face_counts: Corners of each face, shape (F,), int32.
        corners: Vertex number of each face corner, shape (C,), int32.

    Returns:
        Unit normals, shape (C, 3), float64.
    """
    starts = np.concatenate([[0], np.cumsum(face_counts)[:-1]])
    face = np.repeat(np.arange(len(face_counts)), face_counts)
    following = np.arange(len(corners)) + 1
    following[starts + face_counts - 1] = starts
    centred = points[corners] - points[corners[starts]][face]
    area = np.add.reduceat(np.cross(centred, centred[following]), starts, axis=0)  # Newell's normal
    normal = (area / np.linalg.norm(area, axis=1, keepdims=True))[face]
    order = np.argsort(corners, kind="stable")
    first = np.searchsorted(corners[order], corners)
    valence = np.bincount(corners)[corners]
    total = np.zeros_like(normal)
    for k in range(int(valence.max())):
        other = normal[order[np.minimum(first + k, len(order) - 1)]]
        near = (k < valence) & (np.sum(other * normal, axis=1) > _SMOOTH_COSINE)
        total += np.where(near[:, None], other, 0.0)
    return total / np.linalg.norm(total, axis=1, keepdims=True)


def _rings(sections: F64, along: F64, axis: Axis, place: Alignment) -> F64:
    first, second = sections[..., 0].ravel(), sections[..., 1].ravel()
    run = np.repeat(along, sections.shape[1])
    bridge = {"station": (run, first, second), "left": (first, run, second), "above": (first, second, run)}[axis]
    return place.point(*bridge).reshape(*sections.shape[:2], 3)


def _sides(sections: F64, rings: F64, lengths: F64, girth_of: I32) -> _Faces:
    count, size = sections.shape[:2]
    guide = sections[girth_of]
    edge = np.roll(guide, -1, axis=1) - guide
    length = np.linalg.norm(edge, axis=2)
    girth = np.concatenate([np.zeros((count, 1)), np.cumsum(length, axis=1)], axis=1)
    edge = edge / length[..., None]
    # On a chamfer's ring the outline is smaller: its corners keep their distance along the side that they belong to.
    drift = sections - guide
    start = girth[:, :-1] + np.sum(drift * edge, axis=2)
    end = girth[:, 1:] + np.sum(np.roll(drift, -1, axis=1) * edge, axis=2)
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(count - 1), np.arange(size), indexing="ij"))
    quads = np.stack([i * size + j, i * size + (j + 1) % size, (i + 1) * size + (j + 1) % size, (i + 1) * size + j], 1)
    u = lengths[np.stack([i, i, i + 1, i + 1], axis=1)]
    v = np.stack([start[i, j], end[i, j], end[i + 1, j], start[i + 1, j]], axis=1)
    st = np.stack([u, v], axis=2)
    a, b, c, d = (rings.reshape(-1, 3)[quads[:, k]] for k in range(4))
    across = np.cross(c - a, d - b)
    twisted = np.abs(np.sum((b - a) * across, axis=1)) > _FLAT * np.linalg.norm(across, axis=1)
    halves = quads[twisted][:, [[0, 1, 2], [0, 2, 3]]].reshape(-1)
    halves_st = st[twisted][:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 2)
    counts = np.concatenate([np.full(int((~twisted).sum()), 4), np.full(2 * int(twisted.sum()), 3)])
    return _Faces(
        counts.astype(np.int32),
        np.concatenate([quads[~twisted].ravel(), halves]).astype(np.int32),
        np.concatenate([st[~twisted].reshape(-1, 2), halves_st]),
    )


def _cap(outline: F64, first_vertex: int, *, back: bool) -> _Faces:
    pieces = np.arange(len(outline), dtype=np.int32)[None] if is_convex(outline) else triangulate(outline)
    flat = (pieces[:, ::-1] if back else pieces).ravel()
    return _Faces(
        np.full(len(pieces), pieces.shape[1], np.int32), (flat + first_vertex).astype(np.int32), outline[flat]
    )


def _reverse_faces(face_counts: I32) -> I32:
    starts = np.concatenate([[0], np.cumsum(face_counts)[:-1]])
    face = np.repeat(np.arange(len(face_counts)), face_counts)
    within = np.arange(int(face_counts.sum())) - starts[face]
    return (starts[face] + face_counts[face] - 1 - within).astype(np.int32)


def _unmirrored(surface: Surface) -> Surface:
    """Flip the charts that read mirrored from outside: v on the sides, the horizontal on the ends."""
    starts = np.concatenate([[0], np.cumsum(surface.face_counts)[:-1]])
    following = np.arange(len(surface.corners)) + 1
    following[starts + surface.face_counts - 1] = starts
    s, t = surface.st.T
    per_face = np.add.reduceat(s * t[following] - s[following] * t, starts)
    mirrored = np.bincount(surface.chart, per_face) < 0.0
    factor = np.ones((len(mirrored), 2))
    factor[mirrored, (np.arange(len(mirrored)) == 0)[mirrored].astype(int)] = -1.0
    return replace(surface, st=surface.st * np.repeat(factor[surface.chart], surface.face_counts, axis=0))
