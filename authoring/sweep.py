"""Sweeping a section along a line: closed solids with metric texture coordinates and the charts for an atlas."""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np

from authoring.alignment import Alignment
from authoring.component import F64, I32, I64
from authoring.sections import inset, is_convex, triangulate

Axis = Literal["station", "left", "above"]
Pieces = tuple[tuple[int, ...], ...]

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
class _Corners:
    """How the corners of a mesh hang together, whatever its points are.

    Attributes:
        starts: First corner of each face, shape (F,), int64.
        face: Face of each corner, shape (C,), int64.
        following: Next corner round the same face, shape (C,), int64.
        around: Faces round the vertex of each corner, rows filled up with F, shape (C, K), int64.
    """

    starts: I64
    face: I64
    following: I64
    around: I64


@dataclass(frozen=True)
class _Net:
    """Faces of a swept solid, whatever its points are; shared by all of one make, and so never written to.

    Attributes:
        counts: Corners of each face, shape (F,), int32.
        corners: Vertex number of each face corner, shape (C,), int32.
        chart: Chart of each face: 0 for the sides, 1 and 2 for the ends, shape (F,), int32.
        source: Row of each corner's texture coordinates: those of the quads, of the first and of the last outline,
            shape (C,), int64.
    """

    counts: I32
    corners: I32
    chart: I32
    source: I64


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
    rings = _rings(sections, along, axis, place)
    if lengths is None:
        lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(rings, axis=0), axis=2).mean(axis=1))])
    points = rings.reshape(-1, 3)
    # (station, above, left) is a left-handed frame: its faces are turned round.
    net = _net(*sections.shape[:2], _twisted(rings), _pieces(sections[0]), _pieces(sections[-1]), axis == "left")
    st = np.concatenate([_side_st(sections, lengths, girth_of).reshape(-1, 2), sections[0], sections[-1]])[net.source]
    normals = corner_normals(points, net.counts, net.corners)
    return _unmirrored(Surface(points, net.counts, net.corners, normals, st, net.chart))


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
    net = _neighbours(face_counts.astype(np.int32).tobytes(), corners.astype(np.int32).tobytes())
    at = points[corners]
    centred = at - at[net.starts][net.face]
    normal = _unit(np.add.reduceat(_cross(centred, centred[net.following]), net.starts, axis=0))  # Newell's normal
    around = np.concatenate([normal, np.zeros((1, 3))])[net.around]
    near = np.einsum("ckd,cd->ck", around, normal[net.face]) > _SMOOTH_COSINE
    return _unit(np.einsum("ckd,ck->cd", around, near.astype(np.float64)))


@lru_cache(maxsize=512)
def _neighbours(face_counts: bytes, corners: bytes) -> _Corners:
    counts, vertex = np.frombuffer(face_counts, np.int32), np.frombuffer(corners, np.int32)
    ends = np.cumsum(counts)
    starts = ends - counts
    face = np.repeat(np.arange(len(counts)), counts)
    following = np.arange(1, len(vertex) + 1)
    following[ends - 1] = starts
    # A table of every vertex's corners, rows filled up with a corner whose face has no normal.
    order = np.argsort(vertex, kind="stable")
    valence = np.bincount(vertex)
    slot = np.arange(len(vertex)) - np.repeat(np.cumsum(valence) - valence, valence)
    faces = np.full((len(valence), int(valence.max())), len(counts))
    faces[vertex[order], slot] = face[order]
    return _Corners(starts.astype(np.int64), face, following, faces[vertex])


def _cross(a: F64, b: F64) -> F64:
    """Cross products of rows; numpy's own is several times slower on short arrays."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    out = np.empty_like(a)
    out[:, 0], out[:, 1], out[:, 2] = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return out


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
) -> tuple[F64, F64, F64 | None, I32 | None]:
    """Insert the rings that a sweep along a curved axis needs, between the given ones in proportion."""
    rings = _missing_rings(along, place) if axis == "station" else np.zeros(0)
    if len(rings) == 0:
        return sections, along, lengths, girth_of
    after = np.searchsorted(along, rings)
    share = ((rings - along[after - 1]) / (along[after] - along[after - 1]))[:, None, None]
    between = sections[after - 1] + share * (sections[after] - sections[after - 1])
    if girth_of is not None:
        moved = np.arange(len(along)) + np.searchsorted(rings, along)  # new numbers of the given rings
        girth_of = np.insert(moved[girth_of], after, after + np.arange(len(rings))).astype(np.int32)
    if lengths is not None:
        lengths = np.insert(lengths, after, np.interp(rings, along, lengths))
    return np.insert(sections, after, between, axis=0), np.insert(along, after, rings), lengths, girth_of


def _rings(sections: F64, along: F64, axis: Axis, place: Alignment) -> F64:
    first, second, run = sections[..., 0], sections[..., 1], along[:, None]
    bridge = {"station": (run, first, second), "left": (first, run, second), "above": (first, second, run)}[axis]
    return place.point(*bridge)


def _side_st(sections: F64, lengths: F64, girth_of: I32 | None) -> F64:
    """Find the texture coordinates of the quads between outlines [m], shape (S - 1, P, 4, 2), float64."""
    count, size = sections.shape[:2]
    guide = sections if girth_of is None else sections[girth_of]
    there = np.arange(1, size + 1) % size
    edge = guide[:, there] - guide
    length = np.sqrt(np.einsum("spk,spk->sp", edge, edge))
    end = np.cumsum(length, axis=1)
    start = end - length
    if girth_of is not None and not np.array_equal(girth_of, np.arange(count)):
        # On a chamfer's ring the outline is smaller: its corners keep their distance along their own side.
        drift = sections - guide
        edge /= length[..., None]
        # At a corner that points inward the smaller outline's sides are longer: they end where the full ones do, so
        # that no two sides share texture.
        start = np.maximum(start, start + np.einsum("spk,spk->sp", drift, edge))
        end = np.minimum(end, end + np.einsum("spk,spk->sp", drift[:, there], edge))
    st = np.empty((count - 1, size, 4, 2))
    along = lengths if lengths.ndim == 2 else lengths[:, None]
    ahead = along[:, there] if lengths.ndim == 2 else along
    st[..., 0, 0], st[..., 1, 0], st[..., 2, 0], st[..., 3, 0] = along[:-1], ahead[:-1], ahead[1:], along[1:]
    st[..., 0, 1], st[..., 1, 1], st[..., 2, 1], st[..., 3, 1] = start[:-1], end[:-1], end[1:], start[1:]
    return st


def _twisted(rings: F64) -> bytes:
    """Tell which quads between rings leave their plane, one flag each; empty for none."""
    a, b, c, d = rings.reshape(-1, 3)[_quads(*rings.shape[:2]).T]
    across = _cross(c - a, d - b)
    off = np.einsum("nd,nd->n", b - a, across)
    twisted = off * off > _FLAT * _FLAT * np.einsum("nd,nd->n", across, across)
    return twisted.tobytes() if twisted.any() else b""


@lru_cache(maxsize=512)
def _quads(count: int, size: int) -> I32:
    """Number the corners of the quads between outlines, shape ((S - 1) P, 4), int32."""
    ring = size * np.arange(count)[:, None]
    low, high = ring + np.arange(size), ring + np.arange(1, size + 1) % size
    return np.stack([low[:-1], high[:-1], high[1:], low[1:]], axis=2).reshape(-1, 4).astype(np.int32)


@lru_cache(maxsize=512)
def _net(count: int, size: int, twisted: bytes, first: Pieces, last: Pieces, turned_round: bool) -> _Net:
    """Lay the faces of a solid: sides, those that are twisted as two triangles each at the end, and both ends.

    Args:
        count: Number of outlines.
        size: Corners of each.
        twisted: Result of `_twisted`.
        first: How the first outline is cut.
        last: How the last one is.
        turned_round: Corners go round the other way.
    """
    quads, rows = _quads(count, size), np.arange(4 * (count - 1) * size).reshape(-1, 4)
    split = np.frombuffer(twisted, bool) if twisted else np.zeros(len(quads), bool)
    halves = np.array([[0, 1, 2], [0, 2, 3]])
    front, back = np.array(first, np.int32)[:, ::-1], np.array(last, np.int32)
    sides = np.concatenate([rows[~split].ravel(), rows[split][:, halves].ravel()])
    source = np.concatenate([sides, rows.size + front.ravel(), rows.size + size + back.ravel()])
    vertex = np.concatenate([quads.ravel()[sides], front.ravel(), (count - 1) * size + back.ravel()])
    sizes = [(4, int((~split).sum()), 0), (3, 2 * int(split.sum()), 0), (front.shape[1], len(front), 1)]
    sizes.append((back.shape[1], len(back), 2))
    per_face, faces, charts = np.array(sizes).T
    counts = np.repeat(per_face, faces).astype(np.int32)
    if turned_round:
        order = _reverse_faces(counts)
        source, vertex = source[order], vertex[order]
    net = _Net(counts, vertex.astype(np.int32), np.repeat(charts, faces).astype(np.int32), source.astype(np.int64))
    for shared in (net.counts, net.corners, net.chart):
        shared.flags.writeable = False
    return net


def _pieces(outline: F64) -> Pieces:
    # Members of one section differ by where they lie; what is cut is the section.
    return _cut(np.round(outline - outline[0], 13).tobytes())


@lru_cache(maxsize=4096)
def _cut(section: bytes) -> Pieces:
    outline = np.frombuffer(section).reshape(-1, 2)
    if is_convex(outline):
        return (tuple(range(len(outline))),)
    return tuple((int(a), int(b), int(c)) for a, b, c in triangulate(outline))


def _reverse_faces(face_counts: I32) -> I32:
    starts = np.concatenate([[0], np.cumsum(face_counts)[:-1]])
    face = np.repeat(np.arange(len(face_counts)), face_counts)
    within = np.arange(int(face_counts.sum())) - starts[face]
    return (starts[face] + face_counts[face] - 1 - within).astype(np.int32)


def _unmirrored(surface: Surface) -> Surface:
    """Flip the charts that read mirrored from outside: v on the sides, the horizontal on the ends."""
    net = _neighbours(surface.face_counts.tobytes(), surface.corners.tobytes())
    s, t = np.ascontiguousarray(surface.st.T)
    per_face = np.add.reduceat(s * t[net.following] - s[net.following] * t, net.starts)
    mirrored = np.bincount(surface.chart, per_face) < 0.0
    if not mirrored.any():
        return surface
    factor = np.ones((len(mirrored), 2))
    factor[mirrored, (np.arange(len(mirrored)) == 0)[mirrored].astype(int)] = -1.0
    return replace(surface, st=surface.st * factor[surface.chart[net.face]])
