"""Shapes of the connections between two steel girders; left from the right one, heights from the top of the steel."""

import numpy as np

from authoring.parts.plate_girders import EMBEDDED, PlateGirders
from authoring.shapes.component import F64
from authoring.shapes.sections import rectangle
from authoring.solids.setting_out import plates, prisms
from authoring.solids.sweep import Surface, joined

_INTO = 0.004  # [m] embedment of plates in webs and flanges
_LEG, _ANGLE = 0.10, 0.010  # [m] leg and thickness of an angle
_GUSSET, _LAP = 0.012, 0.002  # [m] thickness of gusset plates; embedment of bolted members
_GUSSET_SIZE = 0.32  # [m]
_CLEAR = 0.14  # [m] distance between flanges and chords
_BEAM_SHARE, _BEAM_FLANGE, _BEAM_WIDTH = 0.68, 0.018, 0.22  # rolled beam over the girder's depth [1], its flange [m]
_BORDER = 0.16  # of the smaller side of a pierced plate [1]
_FLOOR_SHARE, _FLOOR_WIDTH = 0.075, 0.28  # floor beam's depth over its span [1], its flange [m]
_LATERAL_ABOVE = 0.05  # [m] bracing in plan over the bottom flange
_NARROWER = 0.003  # [m] difference of widths of concrete on concrete, so that no two faces are coplanar

Ends = tuple[tuple[float, float], tuple[float, float]]


def angle_frame(kind: str, girders: PlateGirders, depth: float, width: float, arm: float, face: float) -> Surface:
    """Build a frame of angles on gusset plates: two chords, and crossed diagonals or a K.

    Args:
        kind: `x` or `k`.
        girders: The girders.
        depth: Of the steel there [m].
        width: Between the lines [m].
        arm: Projection of the connecting stiffeners from the webs [m].
        face: From the middle of these stiffeners to their face [m].
    """
    low, high = girders.flange + _CLEAR - depth, -girders.flange - _CLEAR - _LEG
    inner = 0.5 * girders.web + arm
    near, far = inner - 0.5 * arm, width - inner + 0.5 * arm
    size = min(_GUSSET_SIZE, 0.42 * (high + _LEG - low))
    corners = [(inner - arm * 0.7, low - 0.02), (width - inner + 0.7 * arm - size, low - 0.02)]
    corners += [(left, high + _LEG + 0.02 - size) for left, _ in corners]
    front, back = face + _GUSSET - _LAP, face - 2.0 * _LAP
    gussets = _gussets(corners, size, face)
    reach = inner + 0.35 * size  # where members from a corner begin
    chords = [((near, low), (far, low)), ((near, high), (far, high))]
    if kind == "x":
        rising = [((reach, low + 0.25 * size), (width - reach, high - 0.25 * size))]
        falling = [((reach, high - 0.25 * size), (width - reach, low + 0.25 * size))]
        return joined([gussets, _angles(chords + rising, front, 1.0), _angles(falling, back, -1.0)])
    foot = 0.5 * width
    gussets = joined([gussets, _gussets([(foot - 0.7 * size, low - 0.02)], size, face, 1.4)])
    legs = [
        ((reach, high - 0.25 * size), (foot - 0.12, low + 0.45 * size)),
        ((foot + 0.12, low + 0.45 * size), (width - reach, high - 0.25 * size)),
    ]
    return joined([gussets, _angles(chords + legs, front, 1.0)])


def beam_frame(girders: PlateGirders, depth: float, width: float, arm: float, face: float) -> Surface:
    """Build a rolled beam bolted to the connecting stiffeners.

    Args:
        girders: The girders.
        depth: Of the steel there [m].
        width: Between the lines [m].
        arm: Projection of these stiffeners from the webs [m].
        face: From their middle to their face [m].
    """
    tall = _BEAM_SHARE * min(depth, 1.6 * girders.depth)
    high = -girders.flange - 0.5 * max(girders.depth - tall - 2.0 * girders.flange, 0.16)
    low = high - tall
    near = 0.5 * girders.web + 0.35 * arm
    clear = 0.5 * girders.web + arm + 0.01
    web = face + 0.5 * _GUSSET - _LAP
    boxes = [
        ((web - 0.5 * _GUSSET, near, low + 0.5 * _BEAM_FLANGE), (web + 0.5 * _GUSSET, width - near, high - _LAP)),
        *(
            ((web - 0.5 * _BEAM_WIDTH, clear, z), (web + 0.5 * _BEAM_WIDTH, width - clear, z + _BEAM_FLANGE))
            for z in (low, high - _BEAM_FLANGE)
        ),
    ]
    return _boxes(boxes, "left")


def floor_beam(girders: PlateGirders, width: float, arm: float, thickness: float) -> Surface:
    """Build a floor beam between the stiffeners of two girders, its top flange under the girders' top flanges.

    Args:
        girders: The girders.
        width: Between the lines [m].
        arm: Projection of these stiffeners from the webs [m].
        thickness: Of its web [m].
    """
    tall = floor_beam_depth(girders, width)
    high, web = -girders.flange - 0.004, 0.5 * girders.web + arm - _INTO
    boxes = [
        ((-0.5 * thickness, web, high - tall + 0.5 * _BEAM_FLANGE), (0.5 * thickness, width - web, high - _LAP)),
        *(
            ((-0.5 * _FLOOR_WIDTH, web, z), (0.5 * _FLOOR_WIDTH, width - web, z + _BEAM_FLANGE))
            for z in (high - tall, high - _BEAM_FLANGE)
        ),
    ]
    return _boxes(boxes, "left")


def floor_beam_depth(girders: PlateGirders, width: float) -> float:
    """Find the depth of floor beams [m].

    Args:
        girders: The girders.
        width: Between the lines [m].
    """
    return round(min(max(_FLOOR_SHARE * width, 0.40), 0.75 * girders.depth), 3)


def floor_fillet(girders: PlateGirders, stations: F64) -> Surface:
    """Build the concrete between slab and floor beams, heights from the slab's soffit.

    Args:
        girders: The main girders.
        stations: Of the floor beams [m], shape (N,), float64.
    """
    edge = 0.5 * girders.top_width + 0.002
    half, low = 0.5 * _FLOOR_WIDTH + 0.01, -girders.fillet - girders.flange - 0.004 - _INTO
    ones = np.ones(len(stations))
    lows = np.stack([stations - half, (girders.lines[0] + edge) * ones, low * ones], axis=1)
    highs = np.stack([stations + half, (girders.lines[-1] - edge) * ones, (EMBEDDED - _NARROWER) * ones], axis=1)
    return plates(lows, highs, "left")


def box_diaphragm(girders: PlateGirders, depth: float, width: float) -> Surface:
    """Build a plate with a flange between the outer webs of two boxes.

    Args:
        girders: The boxes.
        depth: Of the steel there [m].
        width: Between the boxes' middles [m].
    """
    heights = np.array([0.72 * depth, girders.flange + 0.03])
    low, high = (float(value) - _INTO for value in girders.half_webs(heights))
    outline = np.array(
        [(low, -heights[0]), (width - low, -heights[0]), (width - high, -heights[1]), (high, -heights[1])]
    )
    half = np.array([0.5 * _GUSSET])
    plate = prisms(outline[None], -half, half, "station")
    flange = [((-0.12, low + 0.0, -heights[0] - _BEAM_FLANGE), (0.12, width - low, -heights[0] + _LAP))]
    return joined([plate, _boxes(flange, "left")])


def pierced_plate(girders: PlateGirders, depth: float, width: float, thickness: float) -> Surface:
    """Build a plate with four triangular holes that leave a border and two crossed bars.

    Source: Random Bridge Generator, `bridge.py`: its floor beams.

    Args:
        girders: The girders.
        depth: Of the steel there [m].
        width: Between the lines [m].
        thickness: Of the plate [m].
    """
    web = 0.5 * girders.web - _INTO
    corners = rectangle((web, girders.flange - _INTO - depth), (width - web, _INTO - girders.flange))
    size = corners[2] - corners[0]
    border = _BORDER * float(size.min())
    middle, inner = corners.mean(axis=0), rectangle(tuple(corners[0] + border), tuple(corners[2] - border))  # pyright: ignore[reportArgumentType]
    holes = []
    for k in range(4):  # a triangle at every side: two corners along it, and a tip towards the middle
        a, b = inner[k], inner[(k + 1) % 4]
        slit = border * (b - a) / np.linalg.norm(b - a)
        tip = middle + (0.5 * (a + b) - middle) * (1.4 * border / np.linalg.norm(0.5 * (a + b) - middle))
        holes.append(np.stack([a + slit, b - slit, tip]))
    return _pierced(corners, np.stack(holes), 0.5 * thickness)


def lateral_bar(girders: PlateGirders, size: tuple[float, float], depth: F64, *, falling: bool) -> Surface:
    """Build an angle in plan across a bay, over the bottom flanges, on two gusset plates at the webs.

    It is built from the point where the bay's right line meets the panel's first cross-frame.

    Args:
        girders: The girders.
        size: Length of the panel and width of the bay [m].
        depth: Of the steel at both ends [m], shape (2,), float64.
        falling: Whether it runs from the left line to the right one.
    """
    web = 0.5 * girders.web - _INTO
    sides = np.array([web, size[1] - web])
    where = np.array([0.06, size[0] - 0.06])
    sides, where, depth = (sides, where, depth) if not falling else (sides, where[::-1], depth[::-1])
    inward = np.sign(0.5 * size[0] - where)
    z = girders.flange + _LATERAL_ABOVE - depth
    reach = 0.5 * girders.bottom_width + 0.22
    plate = [
        (
            np.array([min(s, s + d * 0.5), min(y, y + side * reach), h]),
            np.array([max(s, s + d * 0.5), max(y, y + side * reach), h + _GUSSET]),
        )
        for s, d, y, side, h in zip(where, inward, sides, (1.0, -1.0), z, strict=True)
    ]
    start = np.array([where[0] + inward[0] * 0.24, z[0] + _GUSSET - _LAP])
    stop = np.array([where[1] + inward[1] * 0.24, z[1] + _GUSSET - _LAP])
    legs = [
        rectangle((-0.5 * _LEG, 0.0), (0.5 * _LEG, _ANGLE)),
        rectangle((-0.5 * _LEG, 0.0), (_ANGLE - 0.5 * _LEG, _LEG)),
    ]
    low = np.full(2, sides[0] + 0.45 * reach)
    high = np.full(2, sides[1] - 0.45 * reach)
    bar = prisms(np.stack([leg + start for leg in legs]), low, high, "left", np.stack([leg + stop for leg in legs]))
    return joined([_boxes([(tuple(a), tuple(b)) for a, b in plate], "left"), bar])


def _angles(members: list[Ends], face: float, sign: float) -> Surface:
    """Build angles between points (left, height): one leg lies on a gusset's face, the other stands off from it."""
    near, far, low, high = [], [], [], []
    for (left, bottom), (right, top) in members:
        slope = float(np.hypot(right - left, top - bottom)) / (right - left)
        flat = np.sort([face, face + sign * _ANGLE])
        off = np.sort([face, face + sign * _LEG])
        tall = slope * np.array([_LEG, _ANGLE])
        for (a, b), height in ((flat, tall[0]), (off, tall[1])):
            near.append(rectangle((a, bottom), (b, bottom + height)))
            far.append(rectangle((a, top), (b, top + height)))
            low.append(left)
            high.append(right)
    return prisms(np.array(near), np.array(low), np.array(high), "left", np.array(far))


def _gussets(corners: list[tuple[float, float]], size: float, face: float, wider: float = 1.0) -> Surface:
    boxes = [((face - _LAP, left, z), (face - _LAP + _GUSSET, left + wider * size, z + size)) for left, z in corners]
    return _boxes(boxes, "left")


def _boxes(boxes: list, axis: str) -> Surface:
    low, high = (np.array([box[k] for box in boxes], np.float64) for k in (0, 1))
    return plates(low, high, axis)  # pyright: ignore[reportArgumentType]


def _pierced(corners: F64, holes: F64, half: float) -> Surface:
    """Close a plate round four triangular holes: two faces of thirteen pieces each, and the sides of every edge."""
    ring, hole = np.arange(4), 4 + 3 * np.arange(4)  # numbers of corners and of each hole's first corner
    pieces = []
    for k in range(4):
        after, before = (k + 1) % 4, (k - 1) % 4
        a, b, tip = hole[k], hole[k] + 1, hole[k] + 2
        pieces.append([ring[k], ring[after], b, a])  # the border
        pieces.append([ring[k], a, hole[before] + 1])  # a corner of it
        pieces.append([hole[before] + 1, a, tip, hole[before] + 2])  # a bar
    pieces.append([hole[k] + 2 for k in range(4)])
    plan = np.concatenate([corners, holes.reshape(-1, 2)])
    front = np.array(
        [t for piece in pieces for t in ([piece[:3]] + ([[piece[0], *piece[2:]]] if len(piece) > 3 else []))]
    )
    edges = [(ring[k], ring[(k + 1) % 4]) for k in range(4)]
    for k in range(4):
        edges += [(hole[k] + 1, hole[k]), (hole[k] + 2, hole[k] + 1), (hole[k], hole[k] + 2)]
    count = len(plan)
    sides = np.array([t for a, b in edges for t in ((a, b, b + count), (a, b + count, a + count))])
    points = np.zeros((2 * count, 3))
    points[:count, 0], points[count:, 0] = -half, half
    points[:, 1:] = np.tile(plan, (2, 1))
    faces = np.concatenate([front[:, ::-1], front + count, sides])
    length = np.array([np.linalg.norm(plan[b] - plan[a]) for a, b in edges])
    starts = np.cumsum(length) - length
    u = np.array([t for s, n in zip(starts, length, strict=True) for t in ((s, s + n, s + n), (s, s + n, s))])
    v = np.tile(half * np.array([-1.0, -1.0, 1.0, -1.0, 1.0, 1.0]), len(edges)).reshape(-1, 3)
    st = np.concatenate([plan[front[:, ::-1]] * (-1.0, 1.0), plan[front], np.stack([u, v], axis=-1)]).reshape(-1, 2)
    chart = np.repeat(np.arange(3, dtype=np.int32), [len(front), len(front), len(sides)])
    return Surface(
        points, np.full(len(faces), 3, np.int32), faces.ravel().astype(np.int32), np.zeros((faces.size, 3)), st, chart
    )
