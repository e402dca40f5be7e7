"""Lanes along a slope, one above the other, each on a terrace with a retaining wall on its lower side."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.terrain import Terrain
from authoring.shapes.component import Mesh
from authoring.site.relief import draw_relief
from authoring.site.roads import spread
from authoring.site.ways import Line, merged, ribbon

F64 = NDArray[np.float64]
GroundPiece = tuple[str, str, str, str, Mesh]

STEP = 8.0  # distance between cross-sections [m]
_CALM = 5  # cross-sections on either side over which a lane's height is smoothed
_WALL = 0.35  # thickness of a retaining wall [m]
GATE = 2.0  # half the width of a gap in a wall where a drive leaves the lane [m]
_PARAPET = 0.45  # height of a retaining wall above the lane [m]


@dataclass(frozen=True, eq=False)
class Lane:
    """A lane.

    Attributes:
        line: Its middle line.
        crown: Height of its surface [m], shape (N,), float64.
        foot: Lowest ground beside it [m], shape (N,), float64.
        half: Half its width [m].
        uphill: 1 where the slope rises to the left of the axis, -1 to the right [1].
    """

    line: Line
    crown: F64
    foot: F64
    half: float
    uphill: float


def draw_lanes(
    terrain: Terrain,
    uphill: float,
    ups: tuple[float, ...],
    reach: float,
    half: float,
    rng: np.random.Generator,
    *,
    gap: float = 24.0,
) -> tuple[Lane, ...]:
    """Place lanes along a slope; the crossing's valley divides them.

    Args:
        terrain: The terrain.
        uphill: 1 where the slope rises to the left of the axis, -1 to the right [1].
        ups: Distance of each lane from the axis [m].
        reach: Their extent on each side of the site's middle [m].
        half: Half their width [m].
        rng: Random stream.
        gap: Distance to the crossing's edge [m].

    Returns:
        The lanes, from the foot of the slope upwards.
    """
    middle, crossing = (terrain.inner[0] + terrain.inner[1]) / 2, terrain.land.crossing
    lanes = []
    for up in ups:
        wind = draw_relief(((190.0, 8.0), (70.0, 2.0)), rng)
        at = float(crossing.center(np.array(uphill * up)))
        room = crossing.half_width + gap
        for start, stop in ((middle - reach * rng.uniform(0.75, 1.0), at - room), (at + room, middle + reach)):
            if stop - start > 60.0:
                lanes.append(_lane(terrain, uphill, up, spread(start, stop, STEP), half, wind(*_row(start, stop))))
    return tuple(lanes)


def street_gap(terrain: Terrain) -> float:
    """Choose the distance of level streets to the crossing's edge, where they join a road [m]."""
    return {"road": 0.4, "rail": 9.0}.get(terrain.land.crossing.kind, 24.0)


def _row(start: float, stop: float) -> tuple[F64, F64]:
    at = spread(start, stop, STEP)
    return at, np.zeros(len(at))


def _lane(terrain: Terrain, uphill: float, up: float, at: F64, half: float, wind: F64) -> Lane:
    if uphill < 0:  # so that the line's left is always uphill
        at, wind = at[::-1], wind[::-1]
    left = uphill * (up + wind)
    slope = np.gradient(left, at)
    across = np.column_stack([-slope * uphill, np.full(len(at), uphill)])
    line = Line(at, left, across / np.hypot(*across.T)[:, None])
    sides = (-half - 0.6, -half / 2, 0.0, half / 2, half + 0.4)
    ground = np.array([terrain.height(*line.offset(side).T) for side in sides])
    wide = np.pad(ground.max(axis=0), _CALM, mode="edge")
    calm = np.mean([wide[k : k + len(at)] for k in range(2 * _CALM + 1)], axis=0)
    crown = np.round(np.maximum(calm, ground[1:].max(axis=0)) + 0.12, 4)
    return Lane(line, crown, ground.min(axis=0), half, uphill)


def lane_pieces(
    terrain: Terrain,
    lanes: tuple[Lane, ...],
    surface: tuple[str, str, str] = ("Lane", "road", "asphalt"),
    wall_role: str | None = "masonry",
    gates: F64 | None = None,
) -> list[GroundPiece]:
    """Build lanes, or terraces, and their retaining walls.

    Args:
        terrain: The terrain.
        lanes: The lanes.
        surface: Name, component kind and material recipe of their surface.
        wall_role: Material recipe of the walls, None on level land.
        gates: Station and left of places on lower edges where a drive leaves [m], shape (G, 2), float64; the
            parapet has gaps there.

    Returns:
        Name, component kind, material recipe, group and mesh of each piece.
    """
    axis = terrain.land.layout.alignment
    pieces: list[GroundPiece] = []
    for number, whole in enumerate(lanes):
        lane, coping = _opened(whole, np.zeros((0, 2)) if gates is None else gates)
        along, low = lane.line.length(), np.minimum(lane.foot, lane.crown) - 0.8
        top = [(lane.half, low), (lane.half, lane.crown), (-lane.half, lane.crown)]
        rows = [np.column_stack([lane.line.offset(side), level]) for side, level in top]
        road = ribbon(axis, rows, along, (lane.half + 1.0, lane.half, -lane.half))
        name, kind, role = surface
        pieces.append((f"{name}_{number:02d}", kind, role, "Shore", road))
        if wall_role is None:
            rows = [np.column_stack([lane.line.offset(-lane.half), level]) for level in (lane.crown, low)]
            pieces[-1] = (
                f"{name}_{number:02d}",
                kind,
                role,
                "Shore",
                merged([road, ribbon(axis, rows, along, (0.0, -1.0))]),
            )
            continue
        edge = -lane.half
        wall = [(edge, lane.crown - 0.2), (edge, coping), (edge - _WALL, coping), (edge - _WALL, low)]
        rows = [np.column_stack([lane.line.offset(side), level]) for side, level in wall]
        mesh = ribbon(axis, rows, along, (0.0, -0.65, -1.0, -3.0))
        pieces.append((f"{name}Wall_{number:02d}", "wall_retaining", wall_role, "Shore", mesh))
    return pieces


def _opened(lane: Lane, gates: F64) -> tuple[Lane, F64]:
    """Add cross-sections at gates; return the lane, and the height of its wall at its cross-sections [m]."""
    line = lane.line
    order = np.argsort(line.station)
    edge = line.offset(-lane.half)[order]
    inside = (gates[:, 0] > edge[0, 0] + 4.0) & (gates[:, 0] < edge[-1, 0] - 4.0)
    inside &= np.abs(np.interp(gates[:, 0], edge[:, 0], edge[:, 1]) - gates[:, 1]) < 0.6
    middles = gates[inside, 0]
    if not len(middles):
        return lane, lane.crown + _PARAPET
    steps = np.array([-GATE - 0.25, -GATE, GATE, GATE + 0.25])
    at = np.unique(np.concatenate([line.station, (middles[:, None] + steps).ravel()]))
    at = at if line.station[0] < line.station[-1] else at[::-1]

    def between(values: F64) -> F64:
        return np.interp(at, line.station[order], values[order])

    across = np.column_stack([between(line.across[:, 0]), between(line.across[:, 1])])
    opened = Lane(Line(at, between(line.left), across), between(lane.crown), between(lane.foot), lane.half, lane.uphill)
    gap = (np.abs(at[:, None] - middles) < GATE + 0.01).any(axis=1)
    return opened, opened.crown + np.where(gap, -0.06, _PARAPET)


def lane_room(lanes: tuple[Lane, ...], station: F64, left: F64) -> F64:
    """Measure the distance of places to the edges of lanes.

    Args:
        lanes: The lanes.
        station: Distance along the axis [m], shape (N,), float64.
        left: Distance to the left of the axis [m], shape (N,), float64.

    Returns:
        Distances minus a margin of 0.6, at most 60, negative on a lane [m], shape (N,), float64.
    """
    free = np.full(len(station), 60.0)
    for lane in lanes:
        order = np.argsort(lane.line.station)
        at, middle = lane.line.station[order], lane.line.left[order]
        aside = np.abs(left - np.interp(station, at, middle))
        beyond = np.maximum(np.maximum(at[0] - station, station - at[-1]), 0.0)
        free = np.minimum(free, np.hypot(aside, beyond) - lane.half - 0.6)
    return free


def along_lanes(lanes: tuple[Lane, ...], aside: F64, step: float, rng: np.random.Generator) -> F64:
    """List places beside lanes.

    Args:
        lanes: The lanes.
        aside: Distances uphill from the middle line to place things at, negative downhill [m], shape (K,), float64.
        step: Distance between places [m].
        rng: Random stream.

    Returns:
        Station, left and height of the lane there [m], shape (N, 3), float64.
    """
    rows = [np.zeros((0, 3))]
    for lane in lanes:
        order = np.argsort(lane.line.station)
        at = np.arange(lane.line.station.min() + 4.0, lane.line.station.max() - 4.0, step)
        at = at + rng.uniform(-0.3, 0.3, len(at)) * step
        middle = np.interp(at, lane.line.station[order], lane.line.left[order])
        height = np.interp(at, lane.line.station[order], lane.crown[order])
        rows += [np.column_stack([at, middle + lane.uphill * shift, height]) for shift in aside]
    return np.concatenate(rows)
