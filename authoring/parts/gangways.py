"""Inspection gangways below the box of a cable-supported deck: walkways on hangers from its soffit.

Source: clear width, rails and toe boards after ISO 14122-2 and -3; the other dimensions are common practice.
"""

from functools import lru_cache
from itertools import pairwise

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.box_decks import CableDeck
from authoring.parts.drawing import Draws, chosen, draw_option
from authoring.parts.footings import Ground
from authoring.parts.part import FURNITURE, Part, surfaces_of
from authoring.parts.spans import Levels
from authoring.shapes.component import F64
from authoring.shapes.sections import circle, rectangle
from authoring.solids.copies import LOCAL, copied_together, frames_along
from authoring.solids.extrusion import Prism, extruded
from authoring.solids.sweep import Surface, joined, sweep
from groundwork.settings import Settings

WIDTH, HEADROOM = 0.75, 2.05  # [m] of the floor; from the floor up to the soffit
GAP, OVER_GROUND = 0.60, 4.5  # [m] along the bridge to piers, towers and abutments; least height over ground and water
DEEPEST = -0.226  # [m] lower ends of the hangers, above the floor
_LONG = 80.0  # [m] least main span of the bridges that have gangways
BOXES = ("concrete_box", "steel_box")
_SHARES, _NONE = {True: 60.0, False: 40.0}, {False: 1.0}
_WATER = -1.0  # [m] world height: the water of a site is at most so high
_FROM_END = 4.2  # [m] from the deck's ends: a gangway begins beside the hatch in the soffit
_BESIDE, _BELOW = 0.80, 0.30  # [m] half the room that a gangway needs across, and the room below its hangers
_STEP = 0.10  # [m] between the stations at which the room below the soffit is checked
_SHORTEST = 10.0  # [m] shorter stretches are left out
_PITCH, _END = 3.6, 0.25  # [m] largest distance between hangers, and of the outermost hangers from the ends
_OFF_JOINT, _LEAST_FIELD = 1.5, 1.0  # [m] from hangers to a joint between two pieces of the deck; least field beside
_AT_JOINT = 0.5  # [m] joints so close to the outermost hanger have no field of their own
_BRACED, _LEAST_BRACED = 8, 2.4  # wide fields from one that has diagonals to the next; least width of these [m]
_HELD = 0.002  # [m] embedment of members in each other
_FLOOR, _JOINT = 0.030, 0.004  # [m] thickness of the floor's panels, and half the gap between them
_FACE = 0.389  # [m] inner faces of hangers and posts, from the axis
_HANGER, _POST = (0.070, 0.008), (0.050, 0.006)  # [m] legs and thickness of the angles
_BEARER = (0.055, 0.120, 0.008)  # [m] channels: width, depth, thickness
_TRANSOM = (0.060, 0.070)  # [m] cross beams along and upwards
_TOE = (0.008, -0.012, 0.120)  # [m] toe boards: thickness, lower and upper edge
_RAILS = ((0.045, 1.079), (0.034, 0.560))  # [m] hand rail and knee rail: diameter, and height of the middle
_ACROSS = 0.005  # [m] the rails across the ends are thinner
_POST_TOP = 1.10  # [m]
_PLATE, _INTO = (0.090, 0.092, 0.012), 0.006  # [m] head plates: half the length, width, thickness; embedment in the box
_DIAGONAL = (0.008, 0.070)  # [m] thickness and depth


def gangways_chosen() -> bool | None:
    """Declare the setting `gangways` of a family with box decks; the pydantic field, default None."""
    return chosen(
        _SHARES,
        f"Inspection gangways below the soffit of a box, where there are {_SHORTEST:g} m without a support and "
        f"{OVER_GROUND:g} m of air above ground and water; other decks have none",
        among=f" of those with a box and a main span of at least {_LONG:g} m",
        paper=_NONE,
    )


def draw_gangways(settings: Settings, deck: CableDeck, main: float, draws: Draws) -> bool:
    """Draw whether gangways hang below the deck.

    Args:
        settings: Settings of the family, with the key `gangways`.
        deck: Cross-section.
        main: Main span [m].
        draws: Random stream and profile of the bridge.
    """
    likely = deck.kind in BOXES and main >= _LONG
    return draw_option(settings, "gangways", draws, None if likely else _NONE) and deck.kind in BOXES


def gangway_parts(
    pieces: list[tuple[float, float]], levels: Levels, place: Alignment, ground: Ground, supports: list[Part]
) -> list[Part]:
    """Build the gangways below a box, each one uninterrupted.

    Args:
        pieces: Stations of both ends of each piece of the deck [m]; no hanger is below a joint.
        levels: Levels of the deck.
        place: Axis of the bridge.
        ground: Height of the ground [m], shape (N,), at plan positions [m], shape (N, 2).
        supports: Bearings, towers, piers and abutments, which interrupt them.
    """
    floor = levels.girder_soffit - HEADROOM
    stretches = _stretches((pieces[0][0], pieces[-1][1]), floor, place, ground, supports)
    joints = np.array([low for low, _ in pieces[1:]])
    return [_gangway_part(f"Gangway_{n}", _spaced(*ends, joints), floor, place) for n, ends in enumerate(stretches)]


def _stretches(
    ends: tuple[float, float], floor: float, place: Alignment, ground: Ground, supports: list[Part]
) -> list[tuple[float, float]]:
    """Find where a gangway has room: stations from and to [m]."""
    station = np.arange(ends[0] + _FROM_END, ends[1] - _FROM_END, _STEP)
    free = np.ones(len(station), bool)
    for left in (-_FACE, 0.0, _FACE):
        points = place.point(station, np.full(len(station), left), np.full(len(station), floor + DEEPEST))
        free &= points[:, 2] - np.maximum(ground(points[:, :2]), _WATER) >= OVER_GROUND
    for surface in surfaces_of(supports):
        along, left = place.locate(surface.points)
        above = surface.points[:, 2] - place.height(along)
        within = left.min() < _BESIDE and left.max() > -_BESIDE
        if within and above.max() > floor + DEEPEST - _BELOW and above.min() < floor + HEADROOM:
            free &= (station < along.min() - GAP) | (station > along.max() + GAP)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], free, [False]]).astype(np.int8)))
    runs = [(float(station[a]), float(station[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return [(low, high) for low, high in runs if high - low >= _SHORTEST]


def _spaced(low: float, high: float, joints: F64) -> F64:
    """Place hangers evenly below each piece of the deck, none close to its joints: stations [m], shape (N,)."""
    begin, last, rows = low + _END, high - _END, []
    for joint in joints[(joints > begin + _AT_JOINT) & (joints < last - _AT_JOINT)]:
        rows.append(_even(begin, max(float(joint) - _OFF_JOINT, begin)))
        begin = min(float(joint) + _OFF_JOINT, last)
    rows.append(begin + last - _even(begin, last)[::-1])  # so that one is at the end in any case
    return np.concatenate(rows)


def _even(first: float, other: float) -> F64:
    """Place hangers from one station to another [m]; only the first if these are close: shape (N,)."""
    apart = other - first
    return np.linspace(first, other, int(np.ceil(apart / _PITCH)) + 1) if apart > _LEAST_FIELD else np.array([first])


def _gangway_part(name: str, hangers: F64, floor: float, place: Alignment) -> Part:
    low, high, fields = float(hangers[0]) - _END, float(hangers[-1]) + _END, len(hangers) - 1
    posts = 0.5 * (hangers[:-1] + hangers[1:])
    joints = np.sort(np.concatenate([[low - _JOINT], hangers[1:-1], posts, [high + _JOINT]]))
    panel = rectangle((-0.5 * WIDTH, floor - _FLOOR), (0.5 * WIDTH, floor))
    solids = [Prism(panel, float(a) + _JOINT, float(b) - _JOINT, "station", place) for a, b in pairwise(joints)]
    solids += [Prism(np.add(outline, (0.0, floor)), low, high, "station", place) for outline in _long_sections()]
    for diameter, height in _RAILS:
        reach = _rail_line(diameter) - 0.25 * diameter
        for station in (low + 0.5 * _END, high - 0.5 * _END):
            section = np.add(circle(diameter - _ACROSS, 8), (station, floor + height))
            solids.append(Prism(section, -reach, reach, "left", place))
    surfaces = extruded(solids)
    for template, stations in ((_hanger_frame(), hangers), (_post_pair(), posts)):
        surfaces.append(copied_together(template, frames_along(place, stations, 0.0, floor, upright=True)))
    wide = np.flatnonzero(np.diff(hangers) > _LEAST_BRACED)
    for k in sorted({*wide[::_BRACED].tolist(), *wide[-1:].tolist()}):  # they rise towards the middle
        surfaces += _diagonals(float(hangers[k]), float(hangers[k + 1]), floor, place, rising=2 * k < fields)
    size: dict[str, object] = {"length": high - low, "width": WIDTH, "headroom": HEADROOM, "hangers": len(hangers)}
    return Part(name, "inspection_gangway", "Role_RailingSteel", FURNITURE, joined(surfaces), size)


def _both_sides(left: F64, axis: int) -> list[F64]:
    """Mirror an outline of the left side; the coordinate `axis` of its corners is the distance to the left."""
    sign = np.where(np.arange(2) == axis, -1.0, 1.0)
    return [left, (left * sign)[::-1]]


def _rail_line(diameter: float) -> float:
    """Find the middle of a rail on the inner faces of the posts, from the axis [m]."""
    return _FACE + _HELD - 0.5 * diameter * float(np.cos(np.pi / 8))


def _long_sections() -> list[F64]:
    """Draw bearers, toe boards and rails: (left, above the floor) [m], shape (P, 2) each."""
    width, depth, thick = _BEARER
    high, outer = _HELD - _FLOOR, _FACE + _HELD
    low, inner, web = high - depth, outer - width, outer - thick
    bearer = [(inner, low), (outer, low), (outer, high), (inner, high)]
    bearer += [(inner, high - thick), (web, high - thick), (web, low + thick), (inner, low + thick)]
    board = rectangle((outer - _TOE[0], _TOE[1]), (outer, _TOE[2]))
    rails = [np.add(circle(diameter, 8), (_rail_line(diameter), height)) for diameter, height in _RAILS]
    return [side for section in (np.array(bearer), board, *rails) for side in _both_sides(section, 0)]


def _angle(leg: float, thick: float) -> F64:
    """Draw the angle of a hanger or post on the left: (station, left) [m], shape (6, 2), float64."""
    half, inner = 0.5 * leg, _FACE
    corners = [(-half, inner), (half, inner), (half, inner + thick), (thick - half, inner + thick)]
    return np.array([*corners, (thick - half, inner + leg), (-half, inner + leg)])


@lru_cache(maxsize=1)
def _hanger_frame() -> Surface:
    """Build two hangers with head plates, and the cross beam between them, round the floor's middle."""
    plate = rectangle((-_PLATE[0], _FACE - 0.004), (_PLATE[0], _FACE - 0.004 + _PLATE[1]))
    low = HEADROOM - _PLATE[2]
    top = 2.0 * _HELD - _FLOOR - _BEARER[1]
    beam = rectangle((-0.5 * _TRANSOM[0], top - _TRANSOM[1]), (0.5 * _TRANSOM[0], top))
    reach = _FACE + 2.0 * _HELD
    solids = [Prism(beam, -reach, reach, "left", LOCAL)]
    for angle, head in zip(_both_sides(_angle(*_HANGER), 1), _both_sides(plate, 1), strict=True):
        solids.append(Prism(angle, DEEPEST, low + _HELD, "above", LOCAL))
        solids.append(Prism(head, low, HEADROOM + _INTO, "above", LOCAL))
    return joined(extruded(solids))


@lru_cache(maxsize=1)
def _post_pair() -> Surface:
    """Build a post on either side, round the floor's middle."""
    low = -_FLOOR - _BEARER[1] + 0.010
    return joined(extruded([Prism(a, low, _POST_TOP, "above", LOCAL) for a in _both_sides(_angle(*_POST), 1)]))


def _diagonals(low: float, high: float, floor: float, place: Alignment, *, rising: bool) -> list[Surface]:
    """Build a flat bar from the foot of one hanger to the head of the next, on either side."""
    outer = _FACE + _HANGER[0] - _HELD
    bar = rectangle((outer, -0.5 * _DIAGONAL[1]), (outer + _DIAGONAL[0], 0.5 * _DIAGONAL[1]))
    ends = np.array([[0.0, floor - 0.10], [0.0, floor + HEADROOM - 0.10]])
    ends = ends if rising else ends[::-1]
    return [sweep(side + ends[:, None], np.array([low, high]), "station", place) for side in _both_sides(bar, 0)]
