"""Ribbons along a line: carriageways with their markings, and the water of a river."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.axis.alignment import Alignment
from authoring.shapes.component import Mesh
from authoring.site.covers import to_world, turn

F64 = NDArray[np.float64]
_TOP = np.array([(0, 1, 2, 3), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)])  # faces, no bottom


@dataclass(frozen=True)
class Line:
    """A center line in bridge coordinates.

    Attributes:
        station: Distance along the axis [m], shape (N,), float64.
        left: Distance to the left of the axis [m], shape (N,), float64.
        across: Shift along the cross-section that leads one meter to the line's own left [m], shape (N, 2), float64.
    """

    station: F64
    left: F64
    across: F64

    def offset(self, leftwards: float) -> F64:
        """Shift the line to its own left.

        Args:
            leftwards: Shift [m].

        Returns:
            Station and left [m], shape (N, 2), float64.
        """
        return np.stack([self.station, self.left], axis=1) + leftwards * self.across

    def length(self) -> F64:
        """Measure the distance from the first point along the line [m], shape (N,), float64."""
        return np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(self.station), np.diff(self.left)))])


def ribbon(alignment: Alignment, rows: list[F64], along: F64, across: tuple[float, ...]) -> Mesh:
    """Mesh a ribbon between parallel lines, seen from above.

    Args:
        alignment: Axis of the bridge.
        rows: Lines from left to right: station, left and world height [m], each of shape (N, 3), float64.
        along: First coordinate of `st` at the points of a line [m], shape (N,), float64.
        across: Second coordinate of `st` of each line [m].

    Returns:
        A sheet of quads.
    """
    numbers = np.arange(len(rows) * len(along)).reshape(len(rows), len(along))
    return _quads(alignment, np.concatenate(rows), numbers, along, across)


def tube(alignment: Alignment, rows: list[F64], along: F64, girth: tuple[float, ...]) -> Mesh:
    """Mesh a tube with open ends: as `ribbon`, and the last line is joined to the first, whose vertices it shares.

    Args:
        alignment: Axis of the bridge.
        rows: Lines counter-clockwise seen along the tube: station, left and world height [m], each of shape (N, 3),
            float64.
        along: First coordinate of `st` at the points of a line [m], shape (N,), float64.
        girth: Second coordinate of `st` of each line, and of the first line once more after the last [m].

    Returns:
        A sheet of quads that closes round its section.
    """
    numbers = np.arange(len(rows) * len(along)).reshape(len(rows), len(along))
    return _quads(alignment, np.concatenate(rows), np.concatenate([numbers, numbers[:1]]), along, girth)


def _quads(
    alignment: Alignment, points: F64, numbers: NDArray[np.int64], along: F64, across: tuple[float, ...]
) -> Mesh:
    """Mesh the quads between lines of vertices, whose numbers have shape (L, N)."""
    lines, count = numbers.shape
    quads, places = (
        np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=-1).reshape(-1, 4)
        for grid in (numbers, np.arange(lines * count).reshape(lines, count))
    )
    diagonal, other = points[quads[:, 2]] - points[quads[:, 0]], points[quads[:, 3]] - points[quads[:, 1]]
    normals = _corner_normals(quads, np.cross(diagonal, other))
    st = np.stack([np.tile(along, lines), np.repeat(across, count)], axis=1)
    return Mesh(
        points=to_world(alignment, points),
        face_counts=np.full(len(quads), 4, np.int32),
        corners=quads.reshape(-1).astype(np.int32),
        normals=turn(alignment, points[quads.reshape(-1)], normals).astype(np.float32),
        st=st[places.reshape(-1)].astype(np.float32),
    )


def carriageway(alignment: Alignment, line: Line, crown: F64, fall: F64, tilt: F64, half_width: float) -> Mesh:
    """Build a road surface whose edges extend into the ground.

    Args:
        alignment: Axis of the bridge.
        line: Center line.
        crown: World height on the center line [m], shape (N,), float64.
        fall: Drop from the crown to the edge [m], shape (N,), float64.
        tilt: Rise to the line's left over that [1], shape (N,), float64.
        half_width: Half the width of the surface [m].

    Returns:
        The surface and its two buried flanks.
    """
    edge = crown - fall
    profile = ((half_width, -0.5), (half_width, 0.0), (0.0, None), (-half_width, 0.0), (-half_width, -0.5))
    rows = [
        np.column_stack([line.offset(left), crown if drop is None else edge + drop + tilt * left])
        for left, drop in profile
    ]
    across = (half_width + 0.5, half_width, 0.0, -half_width, -half_width - 0.5)
    return ribbon(alignment, rows, line.length(), across)


def dashes(
    alignment: Alignment, line: Line, height: F64, left: float, dash: tuple[float, float], width: float = 0.12
) -> Mesh | None:
    """Paint a line of dashes, as thin raised strips, on a carriageway.

    Args:
        alignment: Axis of the bridge.
        line: Center line of the carriageway.
        height: World height of the surface along the painted line [m], shape (N,), float64.
        left: Distance of the painted line to the left of the center line [m].
        dash: Length of a dash and of the gap after it [m]; no gap makes a continuous line.
        width: Width of the paint [m].

    Returns:
        The strips, or None if not a single dash fits.
    """
    total, paint = line.length(), 0.012
    period = sum(dash)
    starts = np.arange(0.5, total[-1] - dash[0], period) if dash[1] > 0 else np.zeros(1)
    pieces = []
    for start in starts:
        stop = start + dash[0] if dash[1] > 0 else total[-1]
        inner = total[(total > start + 0.05) & (total < stop - 0.05)]
        at = np.concatenate([[start], inner, [stop]])
        rows = []
        for shift in (left + width / 2, left - width / 2):
            edge = line.offset(shift)
            rows.append(
                np.column_stack(
                    [
                        np.interp(at, total, edge[:, 0]),
                        np.interp(at, total, edge[:, 1]),
                        np.interp(at, total, height) + paint,
                    ]
                )
            )
        pieces.append(ribbon(alignment, rows, at, (left + width / 2, left - width / 2)))
    return merged(pieces) if pieces else None


def boxes(place: F64, ahead: F64, left: F64, up: F64, size: tuple[float, float, float]) -> Mesh:
    """Make boxes without undersides: sleepers, posts.

    Args:
        place: Middles of their tops [m], shape (N, 3), float64.
        ahead: Unit vectors along them [1], shape (N, 3), float64.
        left: Unit vectors to their left [1], shape (N, 3), float64.
        up: Unit vectors [1], shape (N, 3), float64.
        size: Along, across and down [m].
    """
    half = 0.5 * np.array(size[:2])
    signs = np.array([(-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (1.0, 1.0)]) * half
    top = place[:, None] + signs[:, :1] * ahead[:, None] + signs[:, 1:] * left[:, None]
    world = np.concatenate([top, top - size[2] * up[:, None]], axis=1).reshape(-1, 3)
    faces = (_TOP[None] + 8 * np.arange(len(place))[:, None, None]).reshape(-1, 4)
    p = world[faces]
    normal = np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    square = np.array([(0.0, 1.0), (0.0, 0.0), (1.0, 0.0), (1.0, 1.0)])
    first = np.linalg.norm(p[:, 1] - p[:, 0], axis=1)
    second = np.linalg.norm(p[:, 2] - p[:, 1], axis=1)
    start = 0.37 * (np.arange(len(faces)) % 97)
    st = square[None] * np.stack([second, first], axis=1)[:, None] + start[:, None, None]
    return Mesh(
        points=world,
        face_counts=np.full(len(faces), 4, np.int32),
        corners=faces.reshape(-1).astype(np.int32),
        normals=np.repeat(normal, 4, axis=0).astype(np.float32),
        st=st.reshape(-1, 2).astype(np.float32),
    )


def merged(meshes: list[Mesh]) -> Mesh:
    """Merge meshes.

    Args:
        meshes: At least one mesh, all with or all without `st1`.

    Returns:
        One mesh with all their faces.
    """
    starts = np.cumsum([0, *(len(mesh.points) for mesh in meshes[:-1])])
    return Mesh(
        points=np.concatenate([mesh.points for mesh in meshes]),
        face_counts=np.concatenate([mesh.face_counts for mesh in meshes]),
        corners=np.concatenate([mesh.corners + start for mesh, start in zip(meshes, starts, strict=True)]).astype(
            np.int32
        ),
        normals=np.concatenate([mesh.normals for mesh in meshes]),
        st=np.concatenate([mesh.st for mesh in meshes]),
        st1=np.concatenate([mesh.st1 for mesh in meshes]),
    )


def _corner_normals(quads: NDArray[np.int64], flat: F64) -> F64:
    """Average the normals of faces that meet at less than about 35 degrees; sharp edges stay sharp."""
    face = flat / np.linalg.norm(flat, axis=1, keepdims=True)
    corner_face = np.repeat(np.arange(len(quads)), 4)
    vertex = quads.reshape(-1)
    total = face[corner_face].copy()
    order = np.argsort(vertex, kind="stable")
    for shift in (1, 2, 3):
        for one, other in ((order[:-shift], order[shift:]), (order[shift:], order[:-shift])):
            same = vertex[one] == vertex[other]
            close = same & (np.sum(face[corner_face[one]] * face[corner_face[other]], axis=1) > 0.82)
            total[one[close]] += face[corner_face[other[close]]]
    return total / np.linalg.norm(total, axis=1, keepdims=True)
