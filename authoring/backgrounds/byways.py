"""Roads that buildings may be reached from, and lanes and drives that lie on the ground and join them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.axis.alignment import Alignment
from authoring.backgrounds.lanes import Lane
from authoring.backgrounds.terrain import Terrain
from authoring.shapes.component import Mesh
from authoring.site.covers import to_world
from authoring.site.roads import Piece
from authoring.site.ways import ribbon

F64 = NDArray[np.float64]

PLAN = Alignment(0.0)  # its coordinates are world positions
STEP = 1.5  # distance between cross-sections of lanes and drives [m]
RAISED = 0.10  # height of a lane above the ground [m]
YARD, SKIRT = 0.07, 0.35  # height of a yard above the ground, and width of the skirt round it [m]
BURIED = 0.45  # depth of its flanks below the ground [m]
RAMP = 9.0  # length on which it rises to the road that it joins [m]
VERGE = 2.5  # distance from the edge of a lane to the gardens beside it [m]
LONGEST = 500.0  # distance from the site up to which roads are used [m]
HIGHEST = 1.3  # largest height of a road above the ground beside it where something joins it [m]
FLANK = 0.3  # fall from the edge of a road to its outermost line where that is a flank in the ground [m]
_PIECES = 32  # of a road's line, measured to at once
_SPARE = 1.0  # beyond the reach of distances, so that rounding does not matter [m]
UNDER = 0.5  # length of its end that lies hidden under that road [m]
_ROWS = (1.0, 0.5, 0.0, -0.5, -1.0)  # lines along a lane, as shares of half its width


@dataclass(frozen=True, eq=False)
class Byway:
    """A stretch of road beside which buildings may stand.

    Attributes:
        left: Its left edge in world space [m], shape (N, 3), float64.
        right: Its right edge at the same cross-sections [m], shape (N, 3), float64.
        verge: Distance from its edge to the gardens beside it [m].
        walled: A wall stands along its right edge: nothing joins it there.
    """

    left: F64
    right: F64
    verge: float
    walled: bool = False

    @property
    def middle(self) -> F64:
        """Middle line in plan [m], shape (N, 2), float64."""
        return 0.5 * (self.left + self.right)[:, :2]


def road_byways(terrain: Terrain, pieces: list[Piece], verge: float) -> list[Byway]:
    """Find the edges of roads among ways, as far as buildings stand beside them.

    Args:
        terrain: The terrain.
        pieces: Ways of a world: name, component kind, material recipe and mesh.
        verge: Distance from their edges to gardens [m].

    Returns:
        One for each road that was built as lines along it, as those of `carriageway` and `laid`.
    """
    roads = []
    for _, kind, role, mesh in pieces:
        edges = _edges(mesh) if (kind, role) == ("road", "asphalt") else None
        if edges is None:
            continue
        left, right = edges
        wide = np.hypot(*(left - right)[:, :2].T)
        if np.ptp(wide) > 1.0:  # cut obliquely at open water
            continue
        near = terrain.beyond(*terrain.land.layout.alignment.locate(0.5 * (left + right))) < LONGEST
        if near.sum() >= 2:
            roads.append(Byway(left[near], right[near], verge))
    return roads


def _edges(mesh: Mesh) -> tuple[F64, F64] | None:
    """Find the edges of a road that was built as lines along it, with or without flanks that reach into the ground.

    `st` holds the distance along the road and across it: a line is a run of vertices with one distance across.

    Args:
        mesh: Any mesh.

    Returns:
        Left and right edge [m], each of shape (N, 3), float64; None where the mesh is no such road.
    """
    across = np.zeros(len(mesh.points))
    across[mesh.corners] = mesh.st[:, 1]
    starts = np.flatnonzero(np.diff(across, prepend=np.inf) != 0.0)
    count = len(mesh.points) // max(len(starts), 1)
    if len(starts) < 2 or count < 2 or (np.diff(starts, append=len(across)) != count).any():
        return None
    lines = mesh.points.reshape(len(starts), count, 3)
    drop = np.median(lines[:, :, 2], axis=1)
    first = int(drop[1] - drop[0] > FLANK)
    last = len(lines) - 1 - int(drop[-2] - drop[-1] > FLANK)
    return (lines[first], lines[last]) if last > first else None


def lane_byways(terrain: Terrain, lanes: tuple[Lane, ...], walled: bool) -> list[Byway]:
    """Take lanes on a slope, or level streets, as roads.

    Args:
        terrain: The terrain.
        lanes: The lanes.
        walled: A wall stands along their lower edge.

    Returns:
        One for each lane.
    """
    axis, found = terrain.land.layout.alignment, []
    for lane in lanes:
        edges = [np.column_stack([lane.line.offset(side), lane.crown]) for side in (lane.half, -lane.half)]
        found.append(Byway(to_world(axis, edges[0]), to_world(axis, edges[1]), VERGE, walled))
    return found


def frontages(byway: Byway, step: float) -> F64:
    """List places along both edges of a road, or the one without a wall.

    Args:
        byway: The road.
        step: Distance between places [m].

    Returns:
        World position of the edge [m] and unit vector away from the road [1], shape (N, 5), float64.
    """
    middle = byway.middle
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(middle, axis=0).T))])
    at = np.arange(0.5 * step, along[-1], step)
    sides = []
    for edge, other in ((byway.left, byway.right), (byway.right, byway.left))[: 1 if byway.walled else 2]:
        near, far = (np.column_stack([np.interp(at, along, line[:, k]) for k in range(3)]) for line in (edge, other))
        out = near[:, :2] - far[:, :2]
        sides.append(np.column_stack([near, out / np.hypot(*out.T)[:, None]]))
    return np.concatenate(sides)


def nearest_edge(byways: list[Byway], places: F64) -> tuple[F64, F64]:
    """Find the nearest point on the edge of a road.

    Args:
        byways: Roads, at least one.
        places: World positions in plan [m], shape (N, 2), float64.

    Returns:
        Position of the point [m] and unit vector away from the road [1], shape (N, 5), float64; distances in plan to
        it [m], shape (N,), float64.
    """
    edges = np.concatenate([frontages(byway, 2.0) for byway in byways])
    apart = np.linalg.norm(places[:, None] - edges[None, :, :2], axis=2)
    return edges[apart.argmin(axis=1)], apart.min(axis=1)


def road_distance(byways: list[Byway], places: F64, reach: float = np.inf) -> F64:
    """Measure the distance to the middle lines of roads.

    Args:
        byways: Roads.
        places: World positions in plan [m], shape (N, 2), float64.
        reach: Larger distances may be inexact, but stay larger than this, which saves time [m].

    Returns:
        Distances minus half the width, inf without roads [m], shape (N,), float64.
    """
    apart = np.full(len(places), np.inf)
    x, y = (np.ascontiguousarray(places[:, k]) for k in (0, 1))
    for byway in byways:
        middle = byway.middle
        half = 0.5 * np.hypot(*(byway.left - byway.right)[:, :2].T)
        for start in range(0, len(middle) - 1, _PIECES):
            line, wide = middle[start : start + _PIECES + 1], half[start : start + _PIECES + 1]
            if np.isfinite(reach):
                (west, south), (east, north) = line.min(axis=0), line.max(axis=0)
                room = reach + float(wide.max()) + _SPARE
                near = np.flatnonzero((x > west - room) & (x < east + room) & (y > south - room) & (y < north + room))
                apart[near] = np.minimum(apart[near], _line_distance(line, wide, x[near], y[near]))
            else:
                apart = np.minimum(apart, _line_distance(line, wide, x, y))
    return apart


def _line_distance(line: F64, wide: F64, x: F64, y: F64) -> F64:
    """Measure the distance of N places to a line of M points, minus half a width at each of its points [m]."""
    (a, b), (along, aside) = line[:-1].T, np.diff(line, axis=0).T
    right, up = x[:, None] - a, y[:, None] - b
    share = np.clip((right * along + up * aside) / np.maximum(along * along + aside * aside, 1e-9), 0.0, 1.0)
    right -= share * along
    up -= share * aside
    away = np.sqrt(right * right + up * up)
    away -= wide[:-1] + share * np.diff(wide)
    return away.min(axis=1)


def ground(terrain: Terrain, places: F64) -> F64:
    """Find ground heights at world positions.

    Args:
        terrain: The terrain.
        places: World positions in plan [m], shape (N, 2), float64.

    Returns:
        World heights [m], shape (N,), float64.
    """
    station, left = located(terrain, places)
    return terrain.height(station, left)


def located(terrain: Terrain, places: F64) -> tuple[F64, F64]:
    """Convert world positions to bridge coordinates.

    Args:
        terrain: The terrain.
        places: World positions in plan [m], shape (N, 2), float64.

    Returns:
        Stations and lefts [m], each of shape (N,), float64.
    """
    return terrain.land.layout.alignment.locate(places)


def resampled(path: F64, step: float = STEP) -> F64:
    """Divide a path into equal steps.

    Args:
        path: Its corners [m], shape (N, 2), float64.
        step: Largest step [m].

    Returns:
        Points on it [m], shape (M, 2), float64.
    """
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    at = np.linspace(0.0, along[-1], int(np.ceil(along[-1] / step)) + 1)
    return np.column_stack([np.interp(at, along, path[:, k]) for k in range(2)])


def laid(terrain: Terrain, path: F64, half: float, start: float | None, flare: float = 0.0) -> tuple[Mesh, Byway]:
    """Lay a lane or drive on the ground.

    Args:
        terrain: The terrain.
        path: Its middle line in plan, in equal steps [m], shape (N, 2), float64.
        half: Half its width [m].
        start: Height of the road that its first point joins [m], or None.
        flare: Added to half its width where it joins that road [m].

    Returns:
        Its surface with flanks that reach into the ground; its edges, as of a road.
    """
    ahead: F64 = np.asarray(np.gradient(path, axis=0))
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    left = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    wide = half + flare * np.clip(1.0 - along / 5.0, 0.0, 1.0) ** 2
    lines = [path + share * wide[:, None] * left for share in _ROWS]
    base = np.array([ground(terrain, line) for line in lines])
    level = base + RAISED
    if start is not None:
        share = np.clip((along - UNDER) / RAMP, 0.0, 1.0)
        share = share * share * (3.0 - 2.0 * share)
        level = np.maximum((1.0 - share) * start + share * level, base + np.where(along < 2.0, 0.0, 0.06))
        level[:, along <= UNDER] = start
    level[:, -1] = base[:, -1] - BURIED  # its end slopes into the ground
    tops = [np.column_stack([line, row]) for line, row in zip(lines, level, strict=True)]
    feet = [np.column_stack([lines[k], np.minimum(base[k], level[k]) - BURIED]) for k in (0, -1)]
    across = tuple(float(share) * half for share in _ROWS)
    mesh = ribbon(PLAN, [feet[0], *tops, feet[1]], along, (half + BURIED, *across, -half - BURIED))
    return mesh, Byway(tops[0], tops[-1], VERGE)


def paved(terrain: Terrain, frame: tuple[float, float, float], box: tuple[float, float, float, float]) -> Mesh:
    """Lay a rectangular yard on the ground.

    Args:
        terrain: The terrain.
        frame: World position [m] and direction [rad] of a local frame.
        box: Lowest and highest x, lowest and highest y in that frame [m].

    Returns:
        Its surface, with a skirt all round that slopes into the ground.
    """
    x, y, turn = frame
    first, last, low, high = box
    at, sink = _skirted(first, last)
    aside, drop = _skirted(low, high)
    ahead, left = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    rows = []
    for across, deep in zip(aside[::-1], drop[::-1], strict=True):
        place = np.array([x, y]) + at[:, None] * ahead + across * left
        rows.append(np.column_stack([place, ground(terrain, place) + YARD - np.maximum(sink, deep)]))
    return ribbon(PLAN, rows, at, tuple(aside[::-1].tolist()))


def _skirted(low: float, high: float) -> tuple[F64, F64]:
    """Divide a range, with a skirt at both ends: places, and their depths below the surface [m], shapes (N,)."""
    at = np.linspace(low, high, max(int(np.ceil((high - low) / STEP)), 1) + 1)
    sink = np.zeros(len(at) + 2)
    sink[[0, -1]] = BURIED
    return np.concatenate([[low - SKIRT], at, [high + SKIRT]]), sink
