"""Windows for buildings without any: rows of panes with surrounds on every plain wall near the bridge."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.solids import Frame, box
from authoring.imported.model import Building, face_normals
from authoring.shapes.component import Mesh, Scatter
from authoring.site.ways import merged

F64 = NDArray[np.float64]

NEAR = 320.0  # [m] from the bridge's middle
STOREY, SILL = 3.1, 0.95  # [m]
_PANE = (1.2, 1.45)  # width and height of a window [m]
_PITCH = 2.7  # [m] between windows
_SPARE = 0.6  # [m] of wall beside the outer windows, and above the top row
_PLAIN = 0.9  # share of its upright rectangle that a wall must fill to get windows [1]
_MOST = 24_000  # windows


@dataclass(frozen=True)
class _Wall:
    """A plain wall: an upright rectangle.

    Attributes:
        foot: Its lower left corner, seen from outside [m], shape (3,), float64.
        along: Unit direction to its right, seen from outside, shape (2,), float64.
        width: Its width [m].
        height: Its height [m].
    """

    foot: F64
    along: F64
    width: float
    height: float


def window_runs(buildings: tuple[Building, ...], middle: F64, first_id: int) -> tuple[Scatter, ...]:
    """Put windows on walls.

    Args:
        buildings: Buildings in the scene.
        middle: The middle of the bridge in plan [m], shape (2,), float64.
        first_id: Instance id of the run.

    Returns:
        One run of all windows, the nearest first; none if there is no wall for them.
    """
    positions, yaws = [np.zeros((0, 3))], [np.zeros(0)]
    for building in buildings:
        if len(building.walls) and np.linalg.norm(building.corners[:, :2].mean(axis=0) - middle) < NEAR:
            for wall in _plain_walls(building.walls):
                spots = _spots(wall)
                positions.append(spots)
                yaws.append(np.full(len(spots), np.arctan2(wall.along[1], wall.along[0])))
    places, turns = np.concatenate(positions), np.concatenate(yaws)
    near = np.argsort(np.linalg.norm(places[:, :2] - middle, axis=1), kind="stable")[:_MOST]
    if not len(near):
        return ()
    count = len(near)
    prototype = (tuple((role, mesh) for role, mesh in _window()),)
    place = (places[near], turns[near], np.ones((count, 3)))
    return (Scatter("City_Windows", "window", "Buildings", prototype, np.zeros(count, np.int32), *place, (first_id,)),)


def _plain_walls(triangles: F64) -> list[_Wall]:
    """Gather the triangles of a building's walls by plane, and keep the planes in which they fill a rectangle."""
    normals = face_normals(triangles)
    upright = np.abs(normals[:, 2]) < 0.02
    triangles, normals = triangles[upright], normals[upright]
    offset = np.sum(triangles[:, 0] * normals, axis=1)
    keys = np.round(np.column_stack([normals[:, :2] * 40.0, offset * 10.0])).astype(np.int64)
    _, plane = np.unique(keys, axis=0, return_inverse=True)
    walls = []
    for number in range(int(plane.max()) + 1 if len(plane) else 0):
        chosen = plane.reshape(-1) == number
        wall = _rectangle(triangles[chosen], normals[chosen][0])
        if wall is not None:
            walls.append(wall)
    return walls


def _rectangle(triangles: F64, normal: F64) -> _Wall | None:
    along = np.array([-normal[1], normal[0]])
    along /= np.linalg.norm(along)
    corners = triangles.reshape(-1, 3)
    right, up = corners[:, :2] @ along, corners[:, 2]
    width, height = float(np.ptp(right)), float(np.ptp(up))
    edges = triangles[:, 1:] - triangles[:, :1]
    area = 0.5 * float(np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum())
    if area < _PLAIN * width * height:
        return None
    first = corners[int(np.argmin(right))]
    return _Wall(np.array([*first[:2], float(up.min())]), along, width, height)


def _spots(wall: _Wall) -> F64:
    """Place the windows of a wall: middles of their outer faces [m], shape (N, 3), float64."""
    columns = int((wall.width - 2.0 * _SPARE - _PANE[0]) / _PITCH) + 1 if wall.width > 2 * _SPARE + _PANE[0] else 0
    rows = int((wall.height - SILL - _PANE[1] - _SPARE) / STOREY) + 1 if wall.height > SILL + _PANE[1] + _SPARE else 0
    along = 0.5 * wall.width + (np.arange(columns) - 0.5 * (columns - 1)) * _PITCH
    up = SILL + 0.5 * _PANE[1] + np.arange(rows) * STOREY
    x, z = (grid.ravel() for grid in np.meshgrid(along, up))
    return np.column_stack([wall.foot[:2] + x[:, None] * wall.along, wall.foot[2] + z])


def _window() -> list[tuple[str, Mesh]]:
    """Model a window about the middle of its place in the wall, x to its right and y into the wall."""
    frame = Frame(0.0, 0.0, 0.0, 0.0)
    wide, tall = 0.5 * _PANE[0], 0.5 * _PANE[1]
    panes = [box(frame, (side * 0.5 * wide, 0.0, 0.0), (0.5 * wide - 0.03, 0.03, tall - 0.03)) for side in (-1.0, 1.0)]
    surround = [
        box(frame, (0.0, 0.0, 0.0), (wide + 0.08, 0.02, tall + 0.08)),
        box(frame, (0.0, -0.03, -tall - 0.1), (wide + 0.14, 0.11, 0.05)),
    ]
    return [("window", merged(panes)), ("concrete", merged(surround))]
