"""Sweeping a section along a line: closed solids with metric texture coordinates and the charts for an atlas."""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np

from authoring.alignment import Alignment
from authoring.component import F64, I32
from authoring.sections import inset, is_convex, triangulate

Axis = Literal["station", "left", "above"]

GROOVE_DEPTH = 0.010  # [m], of a false joint
_SMOOTH_COSINE = float(np.cos(np.radians(25.0)))
_NEAR_RING = 0.05  # [m] from another ring within which none is inserted: longer than chamfers and grooves
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
        lengths: Texture length at each outline [m], shape (S,), or at each of its corners, shape (S, P), float64;
            default: the arc length.
        girth_of: Number of the outline whose girth each outline's texture follows, shape (S,), int32; default: its own.

    Returns:
        Closed surface, normals outward.
    """
    sections, along, lengths, girth_of = _stepped(sections, along, axis, place, lengths, girth_of)
    count, size = sections.shape[:2]
    rings = _rings(sections, along, axis, place)
    if lengths is None:
        lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(rings, axis=0), axis=2).mean(axis=1))])
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
    if axis == "station":
        rings = _missing_rings(np.array(along), place)
        depth = np.insert(depth, np.searchsorted(along, rings), 0.0).tolist()
        along = np.insert(along, np.searchsorted(along, rings), rings).tolist()
    lengths = _run_lengths(outline, np.array(along), np.array(depth), axis, place)
    drawn = {d: inset(outline, d) if d > 0.0 else outline for d in set(depth)}
    sections = np.array([drawn[d] for d in depth])
    # Every smaller outline has a full one for a neighbour, whose girth its texture follows.
    full = [k if d == 0.0 else (k + 1 if k + 1 < len(depth) else k - 1) for k, d in enumerate(depth)]
    return sweep(sections, np.array(along), axis, place, lengths=lengths, girth_of=np.array(full, np.int32))


def _run_lengths(outline: F64, along: F64, depth: F64, axis: Axis, place: Alignment) -> F64:
    """Measure the texture's length at each ring of a prism: upright between planes that may slope, corner by corner.

    Returns:
        Lengths [m], shape (S,), or (S, P) for an upright prism, float64.
    """
    if axis == "above":
        rings = _rings(np.broadcast_to(outline, (len(along), *outline.shape)), along, axis, place)
        steps = np.sqrt(np.sum(np.diff(rings, axis=0) ** 2, axis=2))
        run = np.cumsum(np.hypot(steps, np.diff(depth)[:, None]), axis=0)
        return np.concatenate([np.zeros((1, len(outline))), run])
    line = np.zeros((3, len(along)))
    if axis == "station" and place.plan:
        line[1:] = outline.mean(axis=0)[:, None]  # on a curve a member's own line counts
    line[("station", "left", "above").index(axis)] = along
    steps = np.linalg.norm(np.diff(place.point(*line), axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(np.hypot(steps, np.diff(depth)))])


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
    ends = np.cumsum(face_counts)
    starts = ends - face_counts
    face = np.repeat(np.arange(len(face_counts)), face_counts)
    following = np.arange(1, len(corners) + 1)
    following[ends - 1] = starts
    at = points[corners]
    centred = at - at[starts][face]
    normal = _unit(np.add.reduceat(_cross(centred, centred[following]), starts, axis=0))  # Newell's normal
    # A table of every vertex's corners, rows filled up with a corner whose face has no normal.
    order = np.argsort(corners, kind="stable")
    valence = np.bincount(corners, minlength=len(points))
    slot = np.arange(len(corners)) - np.repeat(np.cumsum(valence) - valence, valence)
    faces = np.full((len(points), int(valence.max())), len(normal))
    faces[corners[order], slot] = face[order]
    around = np.concatenate([normal, np.zeros((1, 3))])[faces[corners]]
    near = np.einsum("ckd,cd->ck", around, normal[face]) > _SMOOTH_COSINE
    return _unit(np.einsum("ckd,ck->cd", around, near.astype(np.float64)))


def _cross(a: F64, b: F64) -> F64:
    """Cross products of rows; numpy's own is several times slower on short arrays."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)


def _unit(vectors: F64) -> F64:
    return vectors / np.sqrt(np.einsum("nd,nd->n", vectors, vectors))[:, None]


def _missing_rings(along: F64, place: Alignment) -> F64:
    """List the stations that a sweep needs between its own; none so close to one that it would cut a chamfer."""
    rings = place.steps(float(along[0]), float(along[-1]))
    if len(rings) == 0:
        return rings
    nearest = np.searchsorted(along, rings)
    return rings[np.minimum(rings - along[nearest - 1], along[nearest] - rings) > _NEAR_RING]


def _stepped(
    sections: F64, along: F64, axis: Axis, place: Alignment, lengths: F64 | None, girth_of: I32 | None
) -> tuple[F64, F64, F64 | None, I32]:
    """Insert the rings that a sweep along a curved axis needs, between the given ones in proportion."""
    girth_of = np.arange(len(along), dtype=np.int32) if girth_of is None else girth_of
    rings = _missing_rings(along, place) if axis == "station" else np.zeros(0)
    if len(rings) == 0:
        return sections, along, lengths, girth_of
    after = np.searchsorted(along, rings)
    share = ((rings - along[after - 1]) / (along[after] - along[after - 1]))[:, None, None]
    between = sections[after - 1] + share * (sections[after] - sections[after - 1])
    moved = np.arange(len(along)) + np.searchsorted(rings, along)  # new numbers of the given rings
    girth = np.insert(moved[girth_of], after, after + np.arange(len(rings)))
    if lengths is not None:
        lengths = np.insert(lengths, after, np.interp(rings, along, lengths))
    return (
        np.insert(sections, after, between, axis=0), np.insert(along, after, rings), lengths, girth.astype(np.int32),
    )  # fmt: skip


def _rings(sections: F64, along: F64, axis: Axis, place: Alignment) -> F64:
    first, second, run = sections[..., 0], sections[..., 1], along[:, None]
    bridge = {"station": (run, first, second), "left": (first, run, second), "above": (first, second, run)}[axis]
    return place.point(*bridge)


def _sides(sections: F64, rings: F64, lengths: F64, girth_of: I32) -> _Faces:
    count, size = sections.shape[:2]
    guide = sections[girth_of]
    here, there = np.arange(size), (np.arange(size) + 1) % size
    edge = guide[:, there] - guide
    length = np.sqrt(np.einsum("spk,spk->sp", edge, edge))
    end = np.cumsum(length, axis=1)
    start = end - length
    if not np.array_equal(girth_of, np.arange(count)):
        # On a chamfer's ring the outline is smaller: its corners keep their distance along their own side.
        drift = sections - guide
        edge /= length[..., None]
        # At a corner that points inward the smaller outline's sides are longer: they end where the full ones do, so
        # that no two sides share texture.
        start = np.maximum(start, start + np.einsum("spk,spk->sp", drift, edge))
        end = np.minimum(end, end + np.einsum("spk,spk->sp", drift[:, there], edge))
    ring = size * np.arange(count)[:, None]
    low, high = ring + here, ring + there
    quads = np.stack([low[:-1], high[:-1], high[1:], low[1:]], axis=2).reshape(-1, 4)
    along = lengths if lengths.ndim == 2 else np.repeat(lengths[:, None], size, axis=1)
    u = np.stack([along[:-1], along[:-1, there], along[1:, there], along[1:]], axis=2)
    v = np.stack([start[:-1], end[:-1], end[1:], start[1:]], axis=2)
    st = np.stack([u, v], axis=3).reshape(-1, 4, 2)
    a, b, c, d = rings.reshape(-1, 3)[quads.T]
    across = _cross(c - a, d - b)
    off = np.einsum("nd,nd->n", b - a, across)
    twisted = off * off > _FLAT * _FLAT * np.einsum("nd,nd->n", across, across)
    if not twisted.any():
        return _Faces(np.full(len(quads), 4, np.int32), quads.ravel().astype(np.int32), st.reshape(-1, 2))
    halves = quads[twisted][:, [[0, 1, 2], [0, 2, 3]]].reshape(-1)
    halves_st = st[twisted][:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 2)
    counts = np.concatenate([np.full(int((~twisted).sum()), 4), np.full(2 * int(twisted.sum()), 3)])
    return _Faces(
        counts.astype(np.int32),
        np.concatenate([quads[~twisted].ravel(), halves]).astype(np.int32),
        np.concatenate([st[~twisted].reshape(-1, 2), halves_st]),
    )


def _cap(outline: F64, first_vertex: int, *, back: bool) -> _Faces:
    # Members of one section differ by where they lie; what is cut is the section.
    pieces = _pieces(np.round(outline - outline[0], 13).tobytes())
    flat = (pieces[:, ::-1] if back else pieces).ravel()
    return _Faces(
        np.full(len(pieces), pieces.shape[1], np.int32), (flat + first_vertex).astype(np.int32), outline[flat]
    )


@lru_cache(maxsize=4096)
def _pieces(section: bytes) -> I32:
    outline = np.frombuffer(section).reshape(-1, 2)
    return np.arange(len(outline), dtype=np.int32)[None] if is_convex(outline) else triangulate(outline)


def _reverse_faces(face_counts: I32) -> I32:
    starts = np.concatenate([[0], np.cumsum(face_counts)[:-1]])
    face = np.repeat(np.arange(len(face_counts)), face_counts)
    within = np.arange(int(face_counts.sum())) - starts[face]
    return (starts[face] + face_counts[face] - 1 - within).astype(np.int32)


def _unmirrored(surface: Surface) -> Surface:
    """Flip the charts that read mirrored from outside: v on the sides, the horizontal on the ends."""
    ends = np.cumsum(surface.face_counts)
    starts = ends - surface.face_counts
    following = np.arange(1, len(surface.corners) + 1)
    following[ends - 1] = starts
    s, t = surface.st.T
    per_face = np.add.reduceat(s * t[following] - s[following] * t, starts)
    mirrored = np.bincount(surface.chart, per_face) < 0.0
    if not mirrored.any():
        return surface
    factor = np.ones((len(mirrored), 2))
    factor[mirrored, (np.arange(len(mirrored)) == 0)[mirrored].astype(int)] = -1.0
    return replace(surface, st=surface.st * np.repeat(factor[surface.chart], surface.face_counts, axis=0))
