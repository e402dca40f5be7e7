"""Detection of bars in meshes: straight or slightly curved members with a small cross-section.

A stay, a hanger, a rail, a post or a road marking narrower than a pixel is hit by only some of the samples. To draw it
with its coverage of each pixel, its axis and cross-section must be known.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from render.gpu.embedded import Faces, embedded_faces
from render.gpu.welding import mixed, welded_places
from usd_schemas.flat_scene import FlatScene

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

_SLENDER = 6.0  # least ratio of length to thickness; shorter bars need no ribbon
_STEP = 2.0  # an edge along a bar is at least this many times as long as the longest one of its cross-sections
_ROUND_FROM = 6  # corners from which on a cross-section may be round
_ROUNDNESS = 0.15  # largest difference of the radii of a round cross-section [1]
_ROUNDEST = 1.0  # [m] thickest round bar: the main cable of a large suspension bridge
_BROADEST = 0.35  # [m] broadest flat one: a road marking
_THICKEST = 0.25  # [m] thickest of all others: thicker ones may be half embedded
_TIP = 0.01  # half axes at a pointed end, as a share of those at the other end, because its directions are needed
_BLOCK = 4  # corners of a rectangle
_OBLONG = 0.5  # square of its height over its width, at most, for principal axes that are certain [1]
_FLAT = 0.03  # [m] largest thickness of a flat one


@dataclass(frozen=True)
class Bars:
    """Bars of all parts of a geometry, as runs of segments from one cross-section to the next, in mesh-local axes.

    Attributes:
        part: Part of each segment, ascending, shape (S,), int64.
        ends: Middles of the two cross-sections of a segment [stage units], shape (S, 2, 3), float64.
        first: First half axis of these [stage units], shape (S, 2, 3), float64.
        second: Second half axis, shorter than the first [stage units], shape (S, 2, 3), float64.
        round: Whether the cross-section is an ellipse, else a rectangle, shape (S,), bool.
        vertex: A vertex of each of the two, whose texture coordinates and color are used, shape (S, 2), int64.
        vertices: Vertices of the geometry that lie on bars, ascending, shape (M,), int64.
        segment: A segment that each of these belongs to, shape (M,), int64.
        end: Which end of the segment the vertex belongs to, shape (M,), int64.
        embedded: Whether a segment is what stands out of a surface of an embedded bar, its second half axis leading to
            its exposed face, shape (S,), bool.
    """

    part: I64
    ends: F64
    first: F64
    second: F64
    round: NDArray[np.bool_]
    vertex: I64
    vertices: I64
    segment: I64
    end: I64
    embedded: NDArray[np.bool_]


def find_bars(scene: FlatScene) -> Bars:
    """Find the bars of a scene; meshes with cut-outs or blending have none.

    Args:
        scene: A scene.
    """
    geometry = scene.geometry
    place, part, edges = _edges(scene)
    if not len(edges):
        sections = np.zeros((0, 2, 3))
        none = np.zeros(0, np.int64)
        no, two = np.zeros(0, bool), np.zeros((0, 2), np.int64)
        return Bars(none, sections, sections, sections, no, two, none, none, none, no)
    count, used = len(part), place >= 0
    positions = np.zeros((count, 3))
    positions[place[used]] = geometry.positions[used]
    body = _joined(edges, count)
    length = np.linalg.norm(positions[edges[:, 0]] - positions[edges[:, 1]], axis=1)
    across = length < _longest_across(body[edges[:, 0]], length, int(body.max(initial=-1)) + 1)[body[edges[:, 0]]]
    ring = _joined(edges[across], count)
    path = _paths(ring, body, edges[~across])
    bars = _segments(place, part, positions, ring, path)
    faces = embedded_faces(scene, positions, part, body)
    return _with_faces(bars, faces, place, part) if len(faces.ends) else bars


def _edges(scene: FlatScene) -> tuple[I64, I64, I64]:
    """Find the position of each vertex, the part of each position, and the edges, of parts that may have bars."""
    geometry = scene.geometry
    unfit = np.array([material.opacity_threshold > 0 or material.blends for material in scene.materials])
    usable = np.zeros(len(geometry.part_first), bool)
    moments = [scene.at_moment(number).draws for number in range(len(scene.moments) or 1)]
    for draws in moments:
        usable[draws.part] = True
    for draws in moments:
        usable[draws.part[unfit[draws.material]]] = False
    part_of = np.repeat(np.arange(len(geometry.part_first)), geometry.part_count)
    order = np.concatenate(
        [np.arange(f, f + c) for f, c in zip(geometry.part_first.tolist(), geometry.part_count.tolist(), strict=True)]
        or [np.zeros(0, np.int64)]
    )
    kept = usable[part_of]
    order, part_of = order[kept], part_of[kept]
    corners = geometry.triangles[order].astype(np.int64)
    owner = np.full(len(geometry.positions), -1, np.int64)
    owner[corners.ravel()] = np.repeat(part_of, 3)
    used = np.flatnonzero(owner >= 0)
    key = mixed(welded_places(geometry)[used].astype(np.uint64), owner[used].astype(np.uint64))
    place = np.full(len(owner), -1, np.int64)
    place[used] = np.unique(key, return_inverse=True)[1]
    part = np.zeros(int(place.max(initial=-1)) + 1, np.int64)
    part[place[used]] = owner[used]
    ends = place[corners]
    edges = np.sort(np.concatenate([ends[:, [0, 1]], ends[:, [1, 2]], ends[:, [2, 0]]]), axis=1)
    edges = np.unique(edges, axis=0)
    return place, part, edges[edges[:, 0] != edges[:, 1]]


def _joined(edges: I64, count: int) -> I64:
    """Number the connected components of edges, shape (count,)."""
    from scipy.sparse import coo_matrix  # its memory is not needed for drawing
    from scipy.sparse.csgraph import connected_components

    graph = coo_matrix((np.ones(len(edges), np.int8), (edges[:, 0], edges[:, 1])), (count, count))
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)


def _longest_across(body: I64, length: F64, count: int) -> F64:
    """Find for each body the edge length that separates edges of cross-sections from those along it, shape (count,).

    It is where the sorted lengths increase most; 0 for a body whose lengths increase evenly.
    """
    order = np.lexsort((length, body))
    body, length = body[order], length[order]
    rise = length[1:] / np.maximum(length[:-1], 1e-9)
    rise[body[1:] != body[:-1]] = 0
    best = np.zeros(count)
    np.maximum.at(best, body[1:], rise)
    at = np.flatnonzero((rise == best[body[1:]]) & (rise >= _STEP))
    limit = np.zeros(count)
    limit[body[at]] = np.sqrt(length[at] * length[at + 1])
    return limit


def _paths(ring: I64, body: I64, along: I64) -> I64:
    """Connect cross-sections by the edges along a body, if these form a single open path.

    Returns:
        Pairs of cross-sections that follow each other, shape (P, 2).
    """
    pairs = np.sort(ring[along], axis=1)
    pairs = np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0)
    count = int(ring.max(initial=-1)) + 1
    of_body = np.zeros(count, np.int64)
    of_body[ring] = body
    bodies = int(body.max(initial=-1)) + 1
    neighbors = np.bincount(pairs.ravel(), minlength=count)
    crowded = np.zeros(bodies, bool)
    crowded[of_body[neighbors > 2]] = True
    open_path = np.bincount(of_body[pairs[:, 0]], minlength=bodies) == np.bincount(of_body, minlength=bodies) - 1
    return pairs[(open_path & ~crowded)[of_body[pairs[:, 0]]]]


def _segments(place: I64, part: I64, positions: F64, ring: I64, path: I64) -> Bars:
    """Keep the segments that are slender and thin."""
    count = int(ring.max(initial=-1)) + 1
    order = np.argsort(ring, kind="stable")
    sizes = np.bincount(ring, minlength=count)
    starts = np.cumsum(sizes) - sizes
    wanted = np.unique(path)
    middle, first, second, is_round = (
        np.zeros((count, 3)),
        np.zeros((count, 3)),
        np.zeros((count, 3)),
        np.zeros(count, bool),
    )
    one, two = path[:, 0], path[:, 1]
    next_to = np.zeros(count, np.int64)
    next_to[one], next_to[two] = two, one
    for row in wanted.tolist():
        corners = positions[order[starts[row] : starts[row] + sizes[row]]]
        middle[row], first[row], second[row], is_round[row] = _section(corners)
        if sizes[row] > _BLOCK and not is_round[row]:  # a short piece at the end of a bar: seen along it
            other = next_to[row]
            way = positions[order[starts[other] : starts[other] + sizes[other]]].mean(axis=0) - middle[row]
            way /= max(np.linalg.norm(way), 1e-12)
            flat = corners - np.outer((corners - middle[row]) @ way, way)
            _, first[row], second[row], _ = _section(flat)
    length = np.linalg.norm(middle[one] - middle[two], axis=1)
    broad = 2 * np.maximum(np.linalg.norm(first[one], axis=1), np.linalg.norm(first[two], axis=1))
    thick = 2 * np.maximum(np.linalg.norm(second[one], axis=1), np.linalg.norm(second[two], axis=1))
    both = is_round[one] & is_round[two]
    limit = np.where(both, _ROUNDEST, np.where(thick < _FLAT, _BROADEST, _THICKEST))
    kept = (broad > 0) & (broad <= limit) & (length >= _STEP * broad)
    body = _joined(path, count)[one]
    total = np.bincount(body, length, count)
    kept &= total[body] >= _SLENDER * broad
    return _listed(place, part, (ring, order, starts), path[kept], (middle, first, second), both[kept])


def _section(corners: F64) -> tuple[F64, F64, F64, bool]:
    """Find middle and half axes of a cross-section from its corners, the longer axis first, and whether it is round."""
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2 if len(corners) < 3 else corners.mean(axis=0)
    if len(corners) == 1:
        return middle, np.zeros(3), np.zeros(3), False
    spokes = corners - middle
    if len(corners) == 2:
        return middle, spokes[0], np.zeros(3), False
    size, axes = np.linalg.eigh(spokes.T @ spokes)
    if len(corners) == _BLOCK and size[1] < _OBLONG * size[2]:  # a rectangle, or paint that thins out at its edges
        middling = np.abs(spokes @ axes).mean(axis=0)
        return middle, axes[:, 2] * middling[2], axes[:, 1] * middling[1], False
    if len(corners) == _BLOCK:  # its sides, because a square has no principal axes
        away = np.linalg.norm(corners[1:] - corners[0], axis=1)
        near = 1 + np.argsort(away)[:2]
        sides = (corners[near] - corners[0]) / 2
        if np.linalg.norm(sides[0]) < np.linalg.norm(sides[1]):
            sides = sides[::-1]
        return middle, sides[0], sides[1], False
    radii = np.linalg.norm(spokes, axis=1)
    if (
        len(corners) >= _ROUND_FROM
        and size[1] > (1 - _ROUNDNESS) * size[2]
        and radii.max() - radii.min() < _ROUNDNESS * radii.max()
    ):
        mean = (1 + np.cos(np.pi / len(corners))) / 2  # a polygon is narrower than its circle
        return middle, axes[:, 2] * radii.mean() * mean, axes[:, 1] * radii.mean() * mean, True
    reach = np.abs(spokes @ axes).max(axis=0)
    return middle, axes[:, 2] * reach[2], axes[:, 1] * reach[1], False


def _listed(
    place: I64,
    part: I64,
    rings: tuple[I64, I64, I64],
    path: I64,
    sections: tuple[F64, F64, F64],
    is_round: NDArray[np.bool_],
) -> Bars:
    """Sort segments by their parts, and list the vertices that belong to them."""
    ring, order, starts = rings
    of_ring = part[order[starts]] if len(starts) else np.zeros(0, np.int64)
    rows = np.argsort(of_ring[path[:, 0]], kind="stable")
    path, is_round = path[rows], is_round[rows]
    middle, first, second = sections
    segment = np.full(len(starts), -1, np.int64)
    end = np.zeros(len(starts), np.int64)
    for side in (1, 0):
        segment[path[:, side]], end[path[:, side]] = np.arange(len(path)), side
    of_place = np.zeros(len(ring), np.int64)
    used = np.flatnonzero(place >= 0)
    of_place[place[used][::-1]] = used[::-1]
    members = used[segment[ring[place[used]]] >= 0]
    own = ring[place[members]]
    return Bars(
        of_ring[path[:, 0]],
        middle[path],
        _pointed(first[path]),
        _pointed(second[path]),
        is_round,
        of_place[order[starts]][path],
        members,
        segment[own],
        end[own],
        np.zeros(len(path), bool),
    )


def _with_faces(bars: Bars, faces: Faces, place: I64, part: I64) -> Bars:
    """Add what stands out of embedded bars to bodies without other segments."""
    used = np.flatnonzero(place >= 0)
    taken = np.zeros(len(faces.ends) + 1, bool)
    taken[faces.face[place[bars.vertices]]] = True
    row = np.full(len(taken), -1)
    kept = np.flatnonzero(~taken[:-1])
    row[kept] = len(bars.part) + np.arange(len(kept))
    of_place = np.zeros(len(part), np.int64)
    of_place[place[used][::-1]] = used[::-1]
    members = used[row[faces.face[place[used]]] >= 0]
    aside, up = (np.repeat(axis[kept][:, None], 2, axis=1) for axis in (faces.aside, faces.up))
    parts = np.concatenate([bars.part, part[faces.corner[kept, 0]]])
    order = np.argsort(parts, kind="stable")
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    vertices = np.concatenate([bars.vertices, members])
    by_vertex = np.argsort(vertices, kind="stable")
    return Bars(
        parts[order],
        np.concatenate([bars.ends, faces.ends[kept]])[order],
        np.concatenate([bars.first, aside])[order],
        np.concatenate([bars.second, up])[order],
        np.append(bars.round, np.zeros(len(kept), bool))[order],
        np.concatenate([bars.vertex, of_place[faces.corner[kept]]])[order],
        vertices[by_vertex],
        rank[np.append(bars.segment, row[faces.face[place[members]]])][by_vertex],
        np.append(bars.end, faces.end[place[members]])[by_vertex],
        np.append(bars.embedded, np.ones(len(kept), bool))[order],
    )


def _pointed(axes: F64) -> F64:
    """Set the half axes of a pointed end to the directions of the other end, shape (S, 2, 3)."""
    size = np.linalg.norm(axes, axis=2, keepdims=True)
    return np.where(size < _TIP * size[:, ::-1], _TIP * axes[:, ::-1], axes)
