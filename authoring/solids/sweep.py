"""Sweeping a section along a line: closed solids with metric texture coordinates and the charts for an atlas."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.shapes.component import F64, I32
from authoring.shapes.nets import end_pieces, net, twisted_quads
from authoring.shapes.topology import normals_at

Axis = Literal["station", "left", "above"]

_NEAR_RING = 0.05  # [m] least distance of an inserted ring from others: longer than chamfers and grooves


@dataclass(frozen=True)
class Surface:
    """The closed surface of a member, before it has an id.

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
        place: Transforms bridge coordinates to the world.
        lengths: Texture length at each outline [m], shape (S,), or at each of its corners, shape (S, P), float64;
            default: the arc length.
        girth_of: Number of the outline whose circumference each outline's texture uses, shape (S,), int32; default: its
            own.

    Returns:
        Closed surface, normals outward.
    """
    sections, along, lengths, girth_of = _stepped(sections, along, axis, place, lengths, girth_of)
    rings = placed(sections, along[:, None], axis, place)
    if lengths is None:
        lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(rings, axis=0), axis=2).mean(axis=1))])
    lengths = lengths if lengths.ndim == 2 else lengths[:, None]
    return closed(sections[None], rings[None], lengths[None], girth_of, twisted_quads(rings[None]), axis)[0]


def closed(
    sections: F64, rings: F64, lengths: F64, girth_of: I32 | None, twisted: list[bytes], axis: Axis
) -> list[Surface]:
    """Close several solids of the same kind, each from its own rings.

    Args:
        sections: Outlines of each, counter-clockwise [m], shape (N, S, P, 2), float64.
        rings: The same in the world [m], shape (N, S, P, 3), float64.
        lengths: Texture length at each outline [m], shape (N, S, 1), or at each of its corners, shape (N, S, P).
        girth_of: Number of the outline whose circumference each outline's texture uses, shape (S,), int32, or None.
        twisted: Quads of each solid that are not plane; see `twisted_quads`.
        axis: Which way the sweep runs.

    Returns:
        Closed surfaces, normals outward.
    """
    count, size = sections.shape[1:3]
    firsts, lasts = end_pieces(sections[:, 0]), end_pieces(sections[:, -1])
    side_st = _side_st(sections, lengths, girth_of).reshape(len(sections), -1, 2)
    st = np.concatenate([side_st, sections[:, 0], sections[:, -1]], axis=1)
    # (station, above, left) is a left-handed frame: its faces are reversed.
    makes = [net(count, size, *key, axis == "left") for key in zip(twisted, firsts, lasts, strict=True)]
    surfaces: dict[int, Surface] = {}
    for make in {id(make): make for make in makes}.values():
        rows = [row for row, other in enumerate(makes) if other is make]
        points = rings[rows].reshape(len(rows), -1, 3)
        normals, texture = normals_at(points, make.corners), st[rows].take(make.source, axis=1) * make.hand
        for row, *own in zip(rows, points, normals, texture, strict=True):
            surfaces[row] = Surface(own[0], make.counts, make.corners.vertex, own[1], own[2], make.chart)
    return [surfaces[row] for row in range(len(sections))]


def turned(surface: Surface) -> Surface:
    """Rotate the texture of a member's sides by 90 degrees, for a member that runs across its sweep.

    Args:
        surface: Result of `sweep` or of an extrusion.
    """
    side = np.repeat(surface.chart == 0, surface.face_counts)
    return replace(surface, st=np.where(side[:, None], surface.st[:, ::-1] * (1.0, -1.0), surface.st))


def joined(surfaces: list[Surface]) -> Surface:
    """Merge several closed solids into one surface.

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


def missing_rings(along: F64, place: Alignment) -> F64:
    """List the stations that a sweep needs between its own; none so close to one that it would cut a chamfer.

    Args:
        along: Stations of the outlines, rising [m], shape (S,), float64.
        place: Axis that the sweep follows.

    Returns:
        Stations, rising [m], shape (K,), float64.
    """
    rings = place.steps(float(along[0]), float(along[-1]))
    if len(rings) == 0:
        return rings
    nearest = np.searchsorted(along, rings)
    return rings[np.minimum(rings - along[nearest - 1], along[nearest] - rings) > _NEAR_RING]


def placed(sections: F64, along: F64, axis: Axis, place: Alignment) -> F64:
    """Transform outlines to the world.

    Args:
        sections: Outlines in the plane of the two other axes [m], shape (..., P, 2), float64.
        along: Where they lie along the axis [m], shape (..., 1), float64.
        axis: Which way the sweep runs.
        place: Transforms bridge coordinates to the world.

    Returns:
        World positions [m], shape (..., P, 3), float64.
    """
    first, second = sections[..., 0], sections[..., 1]
    bridge = {"station": (along, first, second), "left": (first, along, second), "above": (first, second, along)}[axis]
    return place.point(*bridge)


def _stepped(
    sections: F64, along: F64, axis: Axis, place: Alignment, lengths: F64 | None, girth_of: I32 | None
) -> tuple[F64, F64, F64 | None, I32 | None]:
    """Insert the rings that a sweep along a curved axis needs, between the given ones in proportion."""
    rings = missing_rings(along, place) if axis == "station" else np.zeros(0)
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


def _side_st(sections: F64, lengths: F64, girth_of: I32 | None) -> F64:
    """Find the texture coordinates of the quads between outlines [m], shape (N, S - 1, P, 4, 2), float64."""
    solids, count, size = sections.shape[:3]
    guide = sections if girth_of is None else sections[:, girth_of]
    there = np.arange(1, size + 1) % size
    edge = guide.take(there, axis=2) - guide
    length = np.sqrt(np.einsum("nspk,nspk->nsp", edge, edge))
    end = np.cumsum(length, axis=2)
    start = end - length
    if girth_of is not None and not np.array_equal(girth_of, np.arange(count)):
        # On a chamfer's ring the outline is smaller: its corners keep their distance along their own side.
        drift = sections - guide
        edge /= length[..., None]
        # At a corner that points inward the smaller outline's sides are longer: they end where the full ones do, so
        # that no two sides share texture.
        start = np.maximum(start, start + np.einsum("nspk,nspk->nsp", drift, edge))
        end = np.minimum(end, end + np.einsum("nspk,nspk->nsp", drift[:, :, there], edge))
    st = np.empty((solids, count - 1, size, 4, 2))
    ahead = lengths if lengths.shape[2] == 1 else lengths[:, :, there]
    before, after = slice(None, -1), slice(1, None)
    for corner, (run, girth, ring) in enumerate(
        ((lengths, start, before), (ahead, end, before), (ahead, end, after), (lengths, start, after))
    ):
        st[..., corner, 0], st[..., corner, 1] = run[:, ring], girth[:, ring]
    return st
