"""Faces of swept solids: computed once for each kind of solid, independent of its points."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from authoring.shapes.component import F64, I32, I64
from authoring.shapes.sections import is_convex, triangulate
from authoring.shapes.topology import Corners, corner_topology, cross

Pieces = tuple[tuple[int, ...], ...]

_FLAT = 1e-9  # [m], largest distance of a quad's corner from its plane before it is split


@dataclass(frozen=True)
class Net:
    """Faces of a swept solid; shared by all solids of one kind, and therefore never changed.

    Attributes:
        counts: Corners of each face, shape (F,), int32.
        chart: Chart of each face: 0 for the sides, 1 and 2 for the ends, shape (F,), int32.
        source: Row of each corner's texture coordinates: those of the quads, of the first and of the last outline,
            shape (C,), int64.
        hand: Signs of each corner's texture coordinates so that no chart is mirrored as seen from outside: v of the
            sides, the horizontal of an end [1], shape (C, 2), float64.
        corners: How the corners are connected.
    """

    counts: I32
    chart: I32
    source: I64
    hand: F64
    corners: Corners


@lru_cache(maxsize=512)
def net(count: int, size: int, twisted: bytes, first: Pieces, last: Pieces, left_handed: bool) -> Net:
    """Build the faces of a solid: sides (twisted ones as two triangles each, listed last), and both ends.

    Args:
        count: Number of outlines.
        size: Corners of each.
        twisted: One row of `twisted_quads`.
        first: How the first outline is cut.
        last: How the last one is.
        left_handed: The outlines' plane and the sweep form a left-handed frame: faces are reversed.
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
    counts, chart = np.repeat(per_face, faces).astype(np.int32), np.repeat(charts, faces).astype(np.int32)
    if left_handed:
        order = _reverse_faces(counts)
        source, vertex = source[order], vertex[order]
    hands = np.array([(1.0, 1.0), (1.0, 1.0), (-1.0, 1.0)] if left_handed else [(1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)])
    corners = corner_topology(counts.tobytes(), vertex.astype(np.int32).tobytes())
    for shared in (counts, chart):
        shared.flags.writeable = False
    return Net(counts, chart, source.astype(np.int64), hands[chart[corners.face]], corners)


def twisted_quads(rings: F64) -> list[bytes]:
    """Find which quads between the rings of some solids are not plane.

    Args:
        rings: Points [m], shape (N, S, P, 3), float64.

    Returns:
        For each solid one flag a quad; empty for none.
    """
    points, quads = rings.reshape(len(rings), -1, 3), _quads(*rings.shape[1:3])
    a, b, c, d = (points.take(corner, axis=1) for corner in quads.T)
    across = cross(c - a, d - b)
    off = np.einsum("...d,...d->...", b - a, across)
    twisted = off * off > _FLAT * _FLAT * np.einsum("...d,...d->...", across, across)
    return [flags.tobytes() if some else b"" for flags, some in zip(twisted, twisted.any(axis=1).tolist(), strict=True)]


def end_pieces(outlines: F64) -> list[Pieces]:
    """Cut the end faces of some solids into convex pieces.

    Args:
        outlines: Corners, counter-clockwise [m], shape (N, P, 2), float64.

    Returns:
        Corner numbers of the pieces of each.
    """
    if is_convex(outlines):
        return [(tuple(range(outlines.shape[1])),)] * len(outlines)
    # Members of one section differ in position; only the section is cut.
    return [_cut(section.tobytes()) for section in np.round(outlines - outlines[:, :1], 13)]


@lru_cache(maxsize=512)
def _quads(count: int, size: int) -> I32:
    """Number the corners of the quads between outlines, shape ((S - 1) P, 4), int32."""
    ring = size * np.arange(count)[:, None]
    low, high = ring + np.arange(size), ring + np.arange(1, size + 1) % size
    return np.stack([low[:-1], high[:-1], high[1:], low[1:]], axis=2).reshape(-1, 4).astype(np.int32)


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
