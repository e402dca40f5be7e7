"""Subdivision surfaces: Catmull and Clark's rules on a cage of polygons, with creases, corners and boundaries.

Source: Catmull and Clark, Recursively generated B-spline surfaces on arbitrary topological meshes, 1978; DeRose, Kass
and Truong, Subdivision surfaces in character animation, SIGGRAPH 1998 (creases of finite sharpness).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

FOREVER = 10.0  # sharpness of an infinitely sharp crease, as defined by UsdGeom


@dataclass(frozen=True)
class Cage:
    """A polygon mesh that defines a smooth surface.

    Attributes:
        points: Positions [stage units], shape (V, 3), float64.
        counts: Corners of each face, shape (F,), int64.
        corners: Vertex of each corner, shape (C,), int64.
        creases: Pairs of vertices, the smaller first, shape (E, 2), int64.
        crease_sharpness: Number of refinements for which each of them stays sharp [1], shape (E,), float64.
        corner_sharpness: The same for each vertex [1], shape (V,), float64.
        sharp_corners: Whether vertices of a single face keep their positions.
        parent: Face of the first cage that contains each face, shape (F,), int64.
    """

    points: F64
    counts: I64
    corners: I64
    creases: I64
    crease_sharpness: F64
    corner_sharpness: F64
    sharp_corners: bool
    parent: I64


@dataclass(frozen=True)
class _Edges:
    """Edges of a cage: ends, edge of each corner and the next, number of faces, mean of their centers, sharpness."""

    ends: I64
    of_corner: I64
    faces: I64
    centers: F64
    sharpness: F64


def refine(cage: Cage, values: list[F64]) -> tuple[Cage, list[F64]]:
    """Refine a cage once: each face of n corners becomes n quads.

    Args:
        cage: The cage.
        values: Values at its corners [any unit], each of shape (C, W), float64, interpolated bilinearly over each face.

    Returns:
        The finer cage, and the values at its corners [any unit], each of shape (4 C, W), float64.
    """
    owner = np.repeat(np.arange(len(cage.counts)), cage.counts)
    ahead, behind = _neighbors(cage.counts)
    centers = _means(cage.points[cage.corners], owner, len(cage.counts))
    edges = _edges(cage, owner, ahead, centers)
    middle = (cage.points[edges.ends[:, 0]] + cage.points[edges.ends[:, 1]]) / 2
    smooth = np.where((edges.faces == 2)[:, None], (middle + edges.centers) / 2, middle)
    share = np.clip(edges.sharpness, 0.0, 1.0)[:, None]
    edge_points = smooth * (1.0 - share) + middle * share
    moved = _moved(cage, edges, owner, centers, middle)
    vertex, edge, face = 0, len(moved), len(moved) + len(edge_points)
    quads = np.stack(
        [vertex + cage.corners, edge + edges.of_corner, face + owner, edge + edges.of_corner[behind]], axis=1
    )
    finer = Cage(
        np.concatenate([moved, edge_points, centers]),
        np.full(len(quads), 4, np.int64),
        quads.reshape(-1),
        *_worn(edges, edge),
        np.concatenate([_less(cage.corner_sharpness), np.zeros(len(edge_points) + len(centers))]),
        cage.sharp_corners,
        cage.parent[owner],
    )
    return finer, [_spread(one, owner, ahead, behind, len(cage.counts)) for one in values]


def smooth_normals(cage: Cage, areas: F64) -> tuple[F64, I64]:
    """Find normals that vary smoothly, except across edges that are still sharp.

    Args:
        cage: A refined cage.
        areas: Area vector of each face [any unit²], shape (F, 3), float64.

    Returns:
        Sums of area vectors [any unit²], shape (N, 3), float64, and the row of each corner, shape (C,), int64.
    """
    owner = np.repeat(np.arange(len(cage.counts)), cage.counts)
    ahead, _ = _neighbors(cage.counts)
    edges = _edges(cage, owner, ahead, np.zeros((len(cage.counts), 3)))
    order = np.argsort(edges.of_corner, kind="stable")
    first = order[:-1][edges.of_corner[order[:-1]] == edges.of_corner[order[1:]]]
    second = order[1:][edges.of_corner[order[:-1]] == edges.of_corner[order[1:]]]
    kept = edges.sharpness[edges.of_corner[first]] < 1.0
    first, second = first[kept], second[kept]
    # A corner and its next one are on the edge; of the neighbor's two, the one at the same vertex matches.
    same = cage.corners[first] == cage.corners[second]
    pairs = [
        (first, np.where(same, second, ahead[second])),
        (ahead[first], np.where(same, ahead[second], second)),
    ]
    rows, columns = (np.concatenate(side) for side in zip(*pairs, strict=True))
    group = _joined(rows, columns, len(cage.corners))
    sums = [np.bincount(group, areas[owner, axis], group.max(initial=0) + 1) for axis in range(3)]
    return np.stack(sums, axis=1).astype(np.float64), group


def _joined(rows: I64, columns: I64, count: int) -> I64:
    """Number the groups of linked corners; a group has the smallest of its numbers."""
    label = np.arange(count)
    while True:
        former = label.copy()
        np.minimum.at(label, rows, former[columns])
        np.minimum.at(label, columns, former[rows])
        label = label[label]
        if np.array_equal(label, former):
            return np.unique(label, return_inverse=True)[1].astype(np.int64)


def _neighbors(counts: I64) -> tuple[I64, I64]:
    """Find the next and the previous corner of each corner in its face."""
    number = np.arange(counts.sum())
    first = np.repeat(np.cumsum(counts) - counts, counts)
    last = first + np.repeat(counts, counts) - 1
    return np.where(number == last, first, number + 1), np.where(number == first, last, number - 1)


def _means(rows: F64, owner: I64, count: int) -> F64:
    many = np.maximum(np.bincount(owner, minlength=count), 1)[:, None]
    return np.stack([np.bincount(owner, rows[:, axis], count) for axis in range(rows.shape[1])], axis=1) / many


def _edges(cage: Cage, owner: I64, ahead: I64, centers: F64) -> _Edges:
    pairs = np.sort(np.stack([cage.corners, cage.corners[ahead]], axis=1), axis=1)
    width = len(cage.points)
    keys, of_corner = np.unique(pairs[:, 0] * width + pairs[:, 1], return_inverse=True)
    faces = np.bincount(of_corner, minlength=len(keys))
    sharpness = np.where(faces == 2, 0.0, np.inf)
    if len(cage.creases) and len(keys):
        wanted = cage.creases[:, 0] * width + cage.creases[:, 1]
        place = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        known = keys[place] == wanted
        np.maximum.at(sharpness, place[known], cage.crease_sharpness[known])
    ends = np.stack([keys // width, keys % width], axis=1)
    return _Edges(ends, of_corner, faces, _means(centers[owner], of_corner, len(keys)), sharpness)


def _moved(cage: Cage, edges: _Edges, owner: I64, centers: F64, middle: F64) -> F64:
    """Compute the new positions of the vertices of a cage."""
    count, points = len(cage.points), cage.points
    ends = edges.ends.reshape(-1)
    valence = np.bincount(ends, minlength=count)
    around = np.bincount(cage.corners, minlength=count)
    many = np.maximum(valence, 1)[:, None]
    faces = _means(centers[owner], cage.corners, count)
    edge = _means(np.repeat(middle, 2, axis=0), ends, count)
    smooth = (faces + 2.0 * edge + (many - 3.0) * points) / many
    sharp = np.repeat(edges.sharpness, 2)
    is_sharp = sharp > 0.0
    creases = np.bincount(ends, is_sharp, count)
    other = edges.ends[:, ::-1].reshape(-1)
    along = np.stack([np.bincount(ends[is_sharp], points[other[is_sharp], axis], count) for axis in range(3)], axis=1)
    crease = (along + 6.0 * points) / 8.0
    # The sharpness of a vertex is the mean of its edges' sharpness: below 1, smooth and sharp rules are blended.
    held = np.clip(np.bincount(ends, np.where(is_sharp, np.minimum(sharp, 1.0), 0.0), count), 0.0, None)
    share = np.clip(held / np.maximum(creases, 1), 0.0, 1.0)[:, None]
    result = np.where((creases == 2)[:, None], smooth * (1.0 - share) + crease * share, smooth)
    result = np.where((creases > 2)[:, None], smooth * (1.0 - share) + points * share, result)
    fixed = np.clip(cage.corner_sharpness, 0.0, 1.0)[:, None]
    if cage.sharp_corners:
        fixed = np.maximum(fixed, ((around == 1) & (valence == 2))[:, None])
    return np.where((around == 0)[:, None], points, result * (1.0 - fixed) + points * fixed)


def _less(sharpness: F64) -> F64:
    return np.where(sharpness >= FOREVER, sharpness, np.maximum(sharpness - 1.0, 0.0))


def _worn(edges: _Edges, first: int) -> tuple[I64, F64]:
    """Return both halves of each crease, with a sharpness reduced by one."""
    sharp = np.flatnonzero((edges.sharpness > 1.0) & (edges.faces == 2))
    halves = np.stack([edges.ends[sharp].reshape(-1), np.repeat(first + sharp, 2)], axis=1)
    return halves, np.repeat(_less(edges.sharpness[sharp]), 2)


def _spread(values: F64, owner: I64, ahead: I64, behind: I64, faces: int) -> F64:
    """Compute values at the corners of the finer faces: vertex, next edge's middle, center, previous edge's middle."""
    middle = _means(values, owner, faces)[owner]
    halves = (values + values[ahead]) / 2
    return np.stack([values, halves, middle, halves[behind]], axis=1).reshape(-1, values.shape[1])
