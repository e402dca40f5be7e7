"""The blocks' pavements with their kerbs, lawns and parking lots, and the paint on the streets between them."""

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.quads import quad_mesh
from authoring.backgrounds.streets import Block, Street, TownPlan
from authoring.shapes.component import Mesh
from authoring.site.covers import Soup, cut
from authoring.site.ways import merged

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

KERB = 0.14  # height of a pavement over the street [m]
PAINT = 0.025  # height of road paint over it [m]
_STEP = 4.5  # spacing of a pavement's grid where it is cut or not level [m]
_BURIED = 0.5  # depth of curbs in the ground [m]
_LEVEL = 0.03  # difference in height up to which a block counts as level [m]
_SQUARE = 130.0  # side of the squares whose paint is one mesh [m]
_MARKED = 420.0  # distance from the site within which streets are painted [m]


def plate(plan: TownPlan, block: Block, rise: float = KERB, margin: float = 0.0) -> Mesh | None:
    """Build a pavement over a block on its free land: the upper side, and a curb all around.

    Args:
        plan: The town.
        block: The block.
        rise: Height of the plate over the ground [m].
        margin: Distance to land that must stay empty [m].

    Returns:
        The plate, or None if no land is free.
    """
    spots = block.spots(_STEP)
    columns = len(np.unique(spots[:, 0]))
    if (plan.land.room(plan.to_world(spots)) > margin + _STEP).all():
        height = plan.land.ground(plan.to_world(spots))
        if np.ptp(height) < _LEVEL:
            spots, columns = block.spots(1e4), 2
    rows = len(spots) // columns
    world = plan.to_world(spots)
    height, room = plan.land.ground(world) + rise, plan.land.room(world) - margin
    room = np.where(np.abs(room) < 0.05, 0.0, room)
    numbers = np.arange(len(spots)).reshape(columns, rows)
    low, ahead, high, beside = numbers[:-1, :-1], numbers[1:, :-1], numbers[1:, 1:], numbers[:-1, 1:]
    faces = np.stack([np.stack([low, ahead, high], -1), np.stack([low, high, beside], -1)], axis=2).reshape(-1, 3)
    upward = np.tile([0.0, 0.0, 1.0], (len(spots), 1))
    inside, _, _ = cut(Soup(np.hstack([world, height[:, None], upward, room[:, None]]), faces, ()), 0)
    if len(inside.faces) == 0:
        return None
    return _skirted(inside.rows[:, :3], inside.faces)


def street_paint(plan: TownPlan) -> list[Mesh]:
    """Paint lane lines and zebra crossings on the streets near the site.

    Args:
        plan: The town.

    Returns:
        Thin raised strips, square by square of the town; none where there is no street.
    """
    marks = [np.zeros((0, 4))]
    for street in plan.streets:
        crossed = [other for other in plan.streets if other.axis != street.axis]
        marks += [_lane_lines(plan, street, crossed), _zebras(street, crossed)]
    rows = np.concatenate(marks)
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float64)
    corners = plan.to_world(rows[:, None, :2] + signs * rows[:, None, 2:])
    flat = corners.reshape(-1, 2)
    land = plan.land
    good = (land.room(flat) > 0.3) & (land.look(land.away, flat, 1e4) < _MARKED)
    height = land.ground(flat).reshape(-1, 4)
    good = good.reshape(-1, 4).all(axis=1) & (np.ptp(height, axis=1) < 0.15)
    strips = np.concatenate([corners, height[..., None] + PAINT], axis=-1)
    _, square = np.unique(np.floor(rows[good, :2] / _SQUARE), axis=0, return_inverse=True)
    square = square.reshape(-1)
    return [quad_mesh(strips[good][square == number]) for number in range(int(square.max(initial=-1)) + 1)]


def _lane_lines(plan: TownPlan, street: Street, crossed: list[Street]) -> F64:
    """List dashes between lanes: middle and half sizes in grid coordinates [m], shape (N, 4), float64."""
    along = np.arange(-plan.reach, plan.reach, 8.0)
    clear = np.ones(len(along), bool)
    for other in crossed:
        clear &= np.abs(along - other.middle) > other.width / 2 + 9.0
    lines = (-0.28 * street.width, 0.0, 0.28 * street.width) if street.width > 16.0 else (0.0,)
    along = along[clear]
    rows = [np.column_stack([along, np.full(len(along), street.middle + line)]) for line in lines]
    places = np.concatenate(rows)
    half = np.tile([1.5, 0.07], (len(places), 1))
    return _oriented(street, places, half)


def _zebras(street: Street, crossed: list[Street]) -> F64:
    """List the bars of the zebra crossings over a street, one on each side of every crossing street."""
    rows = []
    across = np.arange(-street.width / 2 + 0.7, street.width / 2 - 0.5, 1.1)
    for other in crossed:
        for side in (-1.0, 1.0):
            at = other.middle + side * (other.width / 2 + 3.4)
            rows.append(np.column_stack([np.full(len(across), at), street.middle + across]))
    places = np.concatenate(rows)
    return _oriented(street, places, np.tile([1.4, 0.27], (len(places), 1)))


def _oriented(street: Street, places: F64, half: F64) -> F64:
    return np.hstack([places, half]) if street.axis == 0 else np.hstack([places[:, ::-1], half[:, ::-1]])


def _skirted(points: F64, faces: I64) -> Mesh:
    """Add a curb along the border of a surface."""
    used, corners = np.unique(faces, return_inverse=True)
    points, faces = points[used], corners.reshape(-1, 3)
    count = len(faces)
    top = Mesh(
        points=points,
        face_counts=np.full(count, 3, np.int32),
        corners=faces.reshape(-1).astype(np.int32),
        normals=np.tile(np.array([0.0, 0.0, 1.0], np.float32), (3 * count, 1)),
        st=points[faces.reshape(-1), :2].astype(np.float32),
    )
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    coded = edges[:, 0] * len(points) + edges[:, 1]
    border = edges[~np.isin(coded, edges[:, 1] * len(points) + edges[:, 0])]
    start, end = points[border[:, 0]], points[border[:, 1]]
    long = np.linalg.norm(end - start, axis=1) > 1e-3
    start, end = start[long], end[long]
    down = np.array([0.0, 0.0, KERB + _BURIED])
    return merged([top, quad_mesh(np.stack([start - down, end - down, end, start], axis=1))])
