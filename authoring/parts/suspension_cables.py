"""The cables of a suspension bridge: parabolas between saddles, straight or loaded backstays, hangers, anchorages."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.anchors import HELD, anchor_block, clamps, hanger_sockets, saddle, sleeves
from authoring.parts.cables import HANGER_SIDES, MAIN_SIDES, chords, tube, tubes
from authoring.parts.footings import Ground
from authoring.parts.part import SUBSTRUCTURE, SUPERSTRUCTURE, Part
from authoring.parts.spans import level_at
from authoring.shapes.component import F64

_LUG = 0.16  # [m] length of a clamp below the ring
_BLOCK_SIDE = 0.9  # [m] width of an anchor block outside the cable's plane
_CAST = 0.7  # [m] length of a sleeve on an anchor block
_FOUNDED = 2.0  # [m] depth of an anchor block below the lowest ground at it
_CONCRETE, _GRIPPED, _SAFETY = 24.0, 0.8, 1.3  # [kN/m3], share of weight resisted by friction and earth [1], safety [1]
_LONGEST, _WIDEST = 26.0, 9.0  # [m] of an anchor block, and beside the cable; deeper if too small
_BETWEEN = 0.15  # [m] least gap between a clamp and a saddle, and half of that between two clamps
_GRIP = 0.55  # embedment of a cable in a saddle, as a share of half the saddle's length


@dataclass(frozen=True)
class SuspensionCables:
    """Both main cables; heights count from the finished deck surface.

    Attributes:
        plane: Distance of either cable to the left of the axis [m].
        towers: Stations of the towers [m].
        anchors: Stations where the cables' axes enter the anchor blocks [m].
        crown: Height of the cables' axis in the saddles [m].
        low: Height of the main span's lowest point [m].
        entry: Height where the cables enter the anchor blocks [m].
        side_sag: Sag of the side spans under their chord [m]; 0 for straight backstays.
        diameter: Of a main cable [m].
        hanger_diameter: Of a hanger [m].
        foot: Height of the face under the hangers' sockets [m].
        main_hangers: Stations of the main span's hangers, rising [m].
        side_hangers: Stations of the side spans' hangers, rising [m].
        pull: Horizontal force in one cable, which the weight of its anchor block resists [kN]; 0 if unknown.
    """

    plane: float
    towers: tuple[float, float]
    anchors: tuple[float, float]
    crown: float
    low: float
    entry: float
    side_sag: float
    diameter: float
    hanger_diameter: float
    foot: float
    main_hangers: tuple[float, ...]
    side_hangers: tuple[float, ...]
    pull: float = 0.0

    @property
    def sag(self) -> float:
        """Sag of the main span [m]."""
        return self.crown - self.low

    @property
    def block_length(self) -> float:
        """Length of an anchor block along the bridge [m]."""
        least = max(2.6 + 4.0 * self.diameter, 0.5 * (self.crown - self.entry) * 0.6)
        return max(least, _growth(self)[0])

    @property
    def block_sides(self) -> tuple[float, float]:
        """Distances of an anchor block's inner and outer face from the axis [m]."""
        inner = max(0.5 * self.diameter + 0.35, _casting(self.diameter) + 0.10)
        return self.plane - inner, self.plane + _BLOCK_SIDE + self.diameter + _growth(self)[1]

    @property
    def blocks(self) -> tuple[tuple[float, float, float, float], ...]:
        """Lowest and highest station, lowest and highest distance left of the four anchor blocks [m]."""
        (first, last), (inner, outer), length = self.anchors, self.block_sides, self.block_length
        return tuple(
            (low, high, *lefts)
            for low, high in ((first - length, first), (last, last + length))
            for lefts in ((-outer, -inner), (inner, outer))
        )

    @property
    def saddle_size(self) -> tuple[float, float, float]:
        """Length along the bridge, width, and depth from the cables' axis to the tower's top [m]."""
        return saddle_length(self.diameter), round(0.35 + 1.6 * self.diameter, 3), self.saddle_depth

    @property
    def saddle_depth(self) -> float:
        """From the cables' axis to the tower's top [m]."""
        return saddle_depth(self.diameter)

    def height(self, station: F64) -> F64:
        """Find the height of the cables' axis above the finished deck surface.

        Args:
            station: Distance along the axis [m], shape (N,), float64.

        Returns:
            Heights [m], shape (N,), float64.
        """
        (first, last), (begin, end) = self.towers, self.anchors
        middle, half = 0.5 * (first + last), 0.5 * (last - first)
        main = self.low + self.sag * ((station - middle) / half) ** 2
        span = first - begin
        share = np.where(station < first, (first - station) / span, (station - last) / (end - last))
        side = self.crown + share * (self.entry - self.crown) - 4.0 * self.side_sag * share * (1.0 - share)
        return np.where((station < first) | (station > last), side, main)


def saddle_depth(diameter: float) -> float:
    """Find the height of a saddle under the cable's axis [m].

    Args:
        diameter: Of the main cable [m].
    """
    return round(0.35 + 1.2 * diameter, 3)


def saddle_length(diameter: float) -> float:
    """Find the length of a saddle along the bridge [m].

    Args:
        diameter: Of the main cable [m].
    """
    return round(0.9 + 3.0 * diameter, 3)


def clamp_length(diameter: float) -> float:
    """Find the length of a hanger's clamp along the cable [m].

    Args:
        diameter: Of the main cable [m].
    """
    return 0.16 + 1.2 * diameter


def clear_of_saddle(diameter: float) -> float:
    """Find the least distance of a hanger from a tower's axis at which its clamp is clear of the saddle [m].

    Args:
        diameter: Of the main cable [m].
    """
    return 0.5 * (saddle_length(diameter) + clamp_length(diameter)) + _BETWEEN


def least_pitch(diameter: float) -> float:
    """Find the least distance between hangers at which their clamps are clear of each other [m].

    Args:
        diameter: Of the main cable [m].
    """
    return clamp_length(diameter) + 2.0 * _BETWEEN


def _casting(diameter: float) -> float:
    """Find the radius of the casting where a cable enters its anchor block [m]."""
    return 0.9 * diameter + 0.06


def cable_parts(cables: SuspensionCables, place: Alignment, ground: Ground) -> list[Part]:
    """Build main cables, saddles, hangers with clamps and sockets, and anchorages.

    Args:
        cables: Geometry of the cables.
        place: Axis of the bridge.
        ground: Height of the ground [m], shape (N,), at plan positions [m], shape (N, 2).
    """
    parts = []
    for side, sign in (("L", 1.0), ("R", -1.0)):
        left = sign * cables.plane
        for end in (0, 1):
            parts += _anchorage_parts(cables, side, left, end, place, ground)
        grip = 0.5 * cables.saddle_size[0] * _GRIP
        first, last = cables.towers
        hung = np.array(cables.main_hangers)
        main = _cable_points(cables, _Run(first + grip, last - grip, hung, cables.sag), left, place)
        parts.append(_cable_part(cables, f"MainCable_1_{side}", main))
        parts += _saddle_parts(cables, side, left, place)
        parts += _hanger_parts(cables, side, left, place)
    return parts


@dataclass(frozen=True)
class _Run:
    """One span of a cable: stations of its ends and of hangers [m], shape (N,), and its sag under the chord [m]."""

    low: float
    high: float
    hung: F64
    sag: float


def _cable_points(cables: SuspensionCables, run: _Run, left: float, place: Alignment) -> F64:
    """Find points along a cable: at its ends, at its hangers, and enough between that the chords follow the curve."""
    low, high, hung = run.low, run.high, run.hung
    fixed = np.concatenate([[low], hung[(hung > low + 0.1) & (hung < high - 0.1)], [high]])
    stations = [fixed[:1]]
    for a, b in pairwise(fixed):
        stations.append(np.linspace(a, b, chords(run.sag, float((b - a) / (high - low))) + 1)[1:])
    station = np.concatenate(stations)
    return place.point(station, np.full(len(station), left), cables.height(station))


def _cable_part(cables: SuspensionCables, name: str, points: F64) -> Part:
    length = float(np.linalg.norm(points[-1] - points[0]))
    arc = float(np.sum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    surface = tube(points, 0.5 * cables.diameter, MAIN_SIDES)
    facts: dict[str, object] = {"diameter": cables.diameter, "length": length, "arc": arc, "sag": cables.sag}
    return Part(name, "main_cable", "Role_CableSteel", SUPERSTRUCTURE, surface, facts)


def _saddle_parts(cables: SuspensionCables, side: str, left: float, place: Alignment) -> list[Part]:
    parts = []
    length, width, depth = cables.saddle_size
    for number, station in enumerate(cables.towers):
        surface = saddle(station, left, cables.crown, (length, width, depth), level_at(place, station))
        size: dict[str, object] = {"length": length, "width": width, "embedded_in": "main_cable"}
        parts.append(Part(f"Saddle_{number}_{side}", "saddle", "Role_GirderSteel", SUPERSTRUCTURE, surface, size))
    return parts


def _hanger_parts(cables: SuspensionCables, side: str, left: float, place: Alignment) -> list[Part]:
    parts = []
    radius, step = 0.5 * cables.hanger_diameter, 0.05
    stations = np.array(sorted((*cables.side_hangers, *cables.main_hangers)))
    heights = cables.height(stations)
    line = np.full(len(stations), left)
    tops, feet = place.point(stations, line, heights), place.point(stations, line, np.full(len(stations), cables.foot))
    ahead = place.point(stations + step, line, cables.height(stations + step))
    back = place.point(stations - step, line, cables.height(stations - step))
    along = (ahead - back) / np.linalg.norm(ahead - back, axis=1, keepdims=True)
    wall, up = 0.02 + 0.175 * cables.diameter, np.array([0.0, 0.0, 1.0])
    socket, ring = 0.20 + 4.0 * radius, clamp_length(cables.diameter)
    high = tops - (0.5 * cables.diameter + wall + 0.5 * _LUG) * up
    low = feet + 0.6 * socket * up
    made = zip(
        tubes(np.stack([low, high], axis=1), radius, HANGER_SIDES),
        clamps(tops, along, 0.5 * cables.diameter, ring, _LUG, radius),
        hanger_sockets(feet, radius, socket),
        (high - low)[:, 2].tolist(),
        strict=True,
    )
    for number, (hanger, clamp, foot, length) in enumerate(made):
        name = f"{side}_{number:03d}"
        facts: dict[str, object] = {"hanger": number, "diameter": cables.hanger_diameter}
        holds = {**facts, "embedded_in": "hanger"}
        parts += [
            Part(f"Hanger_{name}", "hanger", "Role_CableSteel", SUPERSTRUCTURE, hanger, {**facts, "length": length}),
            Part(f"Clamp_{name}", "cable_clamp", "Role_GirderSteel", SUPERSTRUCTURE, clamp, holds),
            Part(f"HangerSocket_{name}", "cable_socket", "Role_CableSteel", SUPERSTRUCTURE, foot, holds),
        ]
    return parts


def _anchorage_parts(
    cables: SuspensionCables, side: str, left: float, end: int, place: Alignment, ground: Ground
) -> list[Part]:
    """Build an anchor block with its casting, and the cable from there to the saddle."""
    station, away = cables.anchors[end], (-1.0, 1.0)[end]
    level = level_at(place, station)
    tower = cables.towers[end]
    depth, (inner, outer) = cables.block_length, cables.block_sides
    lefts = (inner, outer) if left > 0.0 else (-outer, -inner)
    back, top = station + away * depth, cables.entry + 0.5 + cables.diameter
    low = _lowest(ground, level, sorted((station, back)), lefts) - _FOUNDED
    low = min(low, cables.entry - 2.5)
    if cables.pull:
        low = min(low, top - anchorage_volume(cables.pull) / (0.9 * depth * (outer - inner)))  # 0.9: its top falls
    block = anchor_block(station, back, lefts, (low, top), level)
    size: dict[str, object] = {"length": depth, "width": outer - inner, "height": top - low}
    name = f"{end}_{side}"
    reach = tower + away * 0.5 * cables.saddle_size[0] * _GRIP
    hung = np.array([s for s in cables.side_hangers if (s - tower) * away > 0.0])
    low_s, high_s = sorted((station, reach))
    points = _cable_points(cables, _Run(low_s, high_s, hung, cables.side_sag), left, place)
    points = points if end == 0 else points[::-1]
    along = points[1] - points[0]
    along /= np.linalg.norm(along)
    front = level.point(np.array([station - away]), np.array([left]), np.zeros(1))[0]
    facing = front - level.point(np.array([station]), np.array([left]), np.zeros(1))[0]
    facing /= np.linalg.norm(facing)
    (casting,) = sleeves(points[:1], facing[None], along[None], _casting(cables.diameter), np.array([_CAST]))
    points[0] = casting.mouth - HELD * along
    points = points[np.concatenate([[True], (points[1:] - points[0]) @ along > 0.2])]
    return [
        Part(f"AnchorBlock_{name}", "anchor_block", "Role_AbutmentConcrete", SUBSTRUCTURE, block, size),
        Part(
            f"CableSocket_{name}",
            "cable_socket",
            "Role_GirderSteel",
            SUPERSTRUCTURE,
            casting.surface,
            {"diameter": cables.diameter, "embedded_in": "main_cable"},
        ),
        _cable_part(cables, f"MainCable_{2 * end}_{side}", points),
    ]


def anchorage_volume(pull: float) -> float:
    """Compute the volume of concrete that anchors a cable by friction and by the earth in front of it [m3].

    Args:
        pull: Horizontal force in the cable [kN].
    """
    return _SAFETY * pull / (_GRIPPED * _CONCRETE)


def _growth(cables: SuspensionCables) -> tuple[float, float]:
    """Compute the length of an anchor block, and its required extra width over its casting [m]."""
    side = anchorage_volume(cables.pull) ** (1.0 / 3.0)
    return min(1.1 * side, _LONGEST), min(0.55 * side, _WIDEST)


def _lowest(ground: Ground, level: Alignment, stations: list[float], lefts: tuple[float, float]) -> float:
    s, left = (
        g.ravel() for g in np.meshgrid(np.linspace(stations[0], stations[1], 9), np.linspace(lefts[0], lefts[1], 7))
    )
    corners = level.point(s, left, np.zeros(len(s)))
    return float(np.min(ground(corners[:, :2]) - corners[:, 2]))
