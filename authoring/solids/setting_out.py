"""Layout of many small steel plates, bars and bolts: made in bridge coordinates, then moved to the world together."""

from dataclasses import replace

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.shapes.component import F64, I32
from authoring.shapes.topology import cross
from authoring.solids.sweep import Axis, Surface

_AXES: dict[Axis, tuple[int, int, int]] = {"station": (1, 2, 0), "left": (0, 2, 1), "above": (0, 1, 2)}
_APART = 0.004  # [m] between the pieces of a chart
_HEXAGON = np.stack([np.cos(np.pi / 3.0 * np.arange(6)), np.sin(np.pi / 3.0 * np.arange(6))], axis=1)


def prisms(outlines: F64, low: F64, high: F64, axis: Axis, far: F64 | None = None) -> Surface:
    """Extrude convex outlines, each between its own two ends, into one surface of triangles with three charts.

    Args:
        outlines: Sections, counter-clockwise [m], shape (N, P, 2), float64; their plane as in `sweep`.
        low: Where each solid begins along the axis [m], shape (N,), float64.
        high: Where it ends [m], shape (N,), float64.
        axis: Which way the solids run.
        far: Sections at the far ends, for inclined bars [m], shape (N, P, 2), float64; default: the same.

    Returns:
        Closed surface in bridge coordinates; `to_world` finds its normals.
    """
    count, size = outlines.shape[:2]
    first, second, run = _AXES[axis]
    rings = np.empty((count, 2, size, 3))
    sections = np.stack([outlines, outlines if far is None else far], axis=1)
    rings[..., first], rings[..., second] = sections[..., 0], sections[..., 1]
    rings[..., run] = np.stack([low, high], axis=1)[:, :, None]
    way = rings[:, 1].mean(axis=1) - rings[:, 0].mean(axis=1)
    length = np.linalg.norm(way, axis=1)
    # The sides are unrolled: an edge that is not perpendicular to the bar has a component along it.
    edge = np.roll(rings[:, 0], -1, axis=1) - rings[:, 0]
    slip = np.einsum("nij,nj->ni", edge, way / length[:, None])
    square = np.sqrt(np.maximum(np.sum(edge * edge, axis=2) - slip * slip, 0.0))
    girth = np.concatenate([np.zeros((count, 1)), np.cumsum(square, axis=1)], axis=1)
    lag = np.concatenate([np.zeros((count, 1)), np.cumsum(slip, axis=1)], axis=1)
    girth += np.concatenate([[0.0], np.cumsum(girth[:-1, -1] + _APART)])[:, None]
    j, k = np.arange(size), np.roll(np.arange(size), -1)
    sides = np.stack([j, k, k + size, j, k + size, j + size], axis=1)  # two triangles a side
    a, b = np.stack([lag, girth], axis=-1)[:, :-1], np.stack([lag, girth], axis=-1)[:, 1:]
    side_st = np.stack([a, b, b, a, b, a], axis=2)
    side_st[..., 0] += length[:, None, None] * np.array([0.0, 0.0, 1.0, 0.0, 1.0, 1.0])
    fan = np.stack([np.zeros(size - 2, int), np.arange(1, size - 1), np.arange(2, size)], axis=1).ravel()
    back = fan.reshape(-1, 3)[:, ::-1].ravel()
    drop = outlines[..., 1].min(axis=1)
    rise = np.concatenate([[0.0], np.cumsum((outlines[..., 1].max(axis=1) - drop + _APART)[:-1])])
    flat = outlines - np.stack([outlines[..., 0].min(axis=1), drop - rise], axis=1)[:, None]
    starts = (2 * size * np.arange(count))[:, None]
    corners = np.concatenate([(part + starts).ravel() for part in (sides.ravel(), back, fan + size)]).astype(np.int32)
    st = np.concatenate([side_st.reshape(-1, 2), flat[:, back].reshape(-1, 2), flat[:, fan].reshape(-1, 2)])
    if axis == "left":  # (station, above, left) is a left-handed frame
        corners, st = corners.reshape(-1, 3)[:, ::-1].ravel(), st.reshape(-1, 3, 2)[:, ::-1].reshape(-1, 2)
    chart = np.repeat(np.arange(3, dtype=np.int32), count * np.array([2 * size, size - 2, size - 2]))
    return _triangles(rings.reshape(-1, 3), corners, st, chart)


def plates(low: F64, high: F64, axis: Axis) -> Surface:
    """Build rectangular plates.

    Args:
        low: Lowest station, left and height of each [m], shape (N, 3), float64.
        high: Highest station, left and height of each [m], shape (N, 3), float64.
        axis: Which way their texture runs.
    """
    first, second, run = _AXES[axis]
    x, y = np.stack([low[:, first], high[:, first]]), np.stack([low[:, second], high[:, second]])
    outlines = np.stack([x[[0, 1, 1, 0]].T, y[[0, 0, 1, 1]].T], axis=2)
    return prisms(outlines, low[:, run], high[:, run], axis)


def bolts(heads: F64, across: float, reach: tuple[float, float], axis: Axis) -> Surface:
    """Build the hexagonal heads of bolts.

    Args:
        heads: Station, left and height of each, on the face that they stand on [m], shape (N, 3), float64.
        across: Width over the corners [m].
        reach: From that face to either end of a head, the smaller first [m].
        axis: Which way the bolts point.
    """
    first, second, run = _AXES[axis]
    outlines = heads[:, None, (first, second)] + 0.5 * across * _HEXAGON
    return prisms(outlines, heads[:, run] + reach[0], heads[:, run] + reach[1], axis)


def shifted(surface: Surface, offset: F64) -> Surface:
    """Move a surface in bridge coordinates.

    Args:
        surface: In bridge coordinates.
        offset: Along, left and up [m], shape (3,), float64.
    """
    return replace(surface, points=surface.points + offset)


def in_one_chart(surface: Surface) -> Surface:
    """Place all charts of a surface beside each other, as one: so that members of many pieces are packed quickly.

    Args:
        surface: Any number of charts.
    """
    chart = np.repeat(surface.chart, surface.face_counts)
    count = int(chart.max()) + 1
    low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    np.minimum.at(low, chart, surface.st)
    np.maximum.at(high, chart, surface.st)
    size = high - low + _APART
    widest = max(float(size[:, 0].max()), float(np.sqrt(np.sum(size[:, 0] * size[:, 1]))))
    corner, reach, shelf = np.zeros((count, 2)), 0.0, np.zeros(2)
    for number in np.lexsort((np.arange(count), -size[:, 1])):
        if shelf[0] + size[number, 0] > widest + 1e-9:
            shelf = np.array([0.0, reach])
        corner[number] = shelf
        shelf = shelf + np.array([size[number, 0], 0.0])
        reach = max(reach, shelf[1] + size[number, 1])
    return replace(surface, st=surface.st - (low - corner)[chart], chart=np.zeros_like(surface.chart))


def to_world(surfaces: list[Surface], place: Alignment) -> list[Surface]:
    """Transform flat-sided surfaces from bridge coordinates to the world.

    Args:
        surfaces: Triangles in bridge coordinates.
        place: Axis of the bridge.
    """
    if not surfaces:
        return []
    points = place.point(*np.concatenate([surface.points for surface in surfaces]).T)
    firsts = np.cumsum([0, *(len(surface.points) for surface in surfaces)])
    faces = [surface.corners.reshape(-1, 3) + first for surface, first in zip(surfaces, firsts[:-1], strict=True)]
    a, b, c = points[np.concatenate(faces).T]
    normals = cross(b - a, c - a)
    normals /= np.sqrt(np.sum(normals * normals, axis=1, keepdims=True))
    ends = np.cumsum([len(surface.corners) for surface in surfaces])[:-1]
    placed = zip(surfaces, np.split(points, firsts[1:-1]), np.split(np.repeat(normals, 3, axis=0), ends), strict=True)
    return [replace(surface, points=own, normals=normals) for surface, own, normals in placed]


def _triangles(points: F64, corners: I32, st: F64, chart: I32) -> Surface:
    """Collect triangles; charts that are mirrored as seen from outside are flipped."""
    faces = st.reshape(-1, 3, 2)
    one, other = faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0]
    mirrored = np.bincount(chart, one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]) < 0.0
    st = st * np.where(mirrored[np.repeat(chart, 3)][:, None], (1.0, -1.0), (1.0, 1.0))
    count = len(corners) // 3
    return Surface(points, np.full(count, 3, np.int32), corners, np.zeros((len(corners), 3)), st, chart)
