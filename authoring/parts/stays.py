"""Stays: the positions of their ends in fan, harp and semi-fan, and the stays with their sleeves."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.anchors import sleeves
from authoring.parts.cable_forces import stay_diameter
from authoring.parts.cables import STAY_SIDES, tubes
from authoring.parts.part import SUPERSTRUCTURE, Part
from authoring.parts.pylons import Pylon, anchor_faces
from authoring.parts.spans import level_at
from authoring.shapes.component import F64
from authoring.shapes.topology import cross

Run = tuple[float, float]
Arrangement = Literal["fan", "semi_fan", "harp"]

_BETWEEN = 0.06  # [m] least gap between two collars on a pylon
_SOCKET, _HEAD = 0.9, 0.5  # [m] lengths of sleeves at the deck and at the pylon, for a stay 0.1 m thick
STEEPEST = 3.0  # tangent of the innermost stay's slope


@dataclass(frozen=True)
class Stays:
    """The stays of one pylon towards its main span; towards the other span they are the same with shorter distances.

    Attributes:
        arrangement: `fan`, `semi_fan` or `harp`.
        planes: 1 or 2.
        plane: Foot of the stays, distance to the left of the axis [m]; 0 for a single plane.
        foot: Height of the surface under their sockets [m].
        offsets: From the pylon's axis to every foot in the main span, rising [m].
        heights: Height of every head above the finished surface, rising [m].
        shrink: Side span's distances over the main span's, from the pylon's face [1].
        diameter: Of a stay in its sheath [m].
    """

    arrangement: str
    planes: int
    plane: float
    foot: float
    offsets: tuple[float, ...]
    heights: tuple[float, ...]
    shrink: float
    diameter: float

    @property
    def collar(self) -> float:
        """Radius of the sleeves' collars [m]."""
        return collar_of(self.diameter)

    def side_offsets(self, pylon: Pylon) -> tuple[float, ...]:
        """Find the distance from the pylon's axis to every foot in the side span [m].

        Args:
            pylon: The pylon of the stays.
        """
        faces = [pylon.face(height) for height in self.heights]
        return tuple(f + self.shrink * (x - f) for f, x in zip(faces, self.offsets, strict=True))


def collar_of(diameter: float) -> float:
    """Find the radius of a stay's collars [m].

    Args:
        diameter: Of the stay [m].
    """
    return round(0.85 * diameter + 0.03, 3)


@dataclass(frozen=True)
class HeadZone:
    """Zone of a pylon for the heads of its stays.

    Attributes:
        foot: Height of the stays' feet [m].
        top: Height of the highest head [m].
        lowest: Lowest head of a semi-fan [m].
        collar: Radius of the collars [m].
        growth: Of half the pylon's length along the bridge per meter below the highest head [1].
    """

    foot: float
    top: float
    lowest: float
    collar: float
    growth: float


def head_heights(arrangement: str, runs: Sequence[Run], zone: HeadZone) -> tuple[float, ...]:
    """Place the heads of the stays on a pylon.

    Args:
        arrangement: `fan`: as close as their collars allow; `semi_fan`: spread over a zone; `harp`: all stays parallel.
        runs: Length of every stay along the bridge from the pylon's face, ascending [m]: in the main span, and the
            smaller one of both spans.
        zone: Zone of the heads.

    Returns:
        Heights, rising [m].
    """
    foot, top, growth = zone.foot, zone.top, zone.growth
    if arrangement == "harp":
        slope = (top - foot) / runs[-1][0]
        # head = foot + slope * (offset - half length there), and the half length grows downward
        return tuple((foot + slope * (run - growth * top)) / (1.0 - slope * growth) for run, _ in runs)
    even = (top - zone.lowest) / (len(runs) - 1) if arrangement == "semi_fan" else 0.0
    heads, least = [top], [run for _, run in runs[::-1]]
    for upper, lower in pairwise(least):
        # The lower one uses the upper one's height, so it is slightly steeper here than as built.
        spread = [zone.collar * float(np.hypot(1.0, (heads[-1] - foot) / run)) for run in (upper, lower)]
        heads.append(heads[-1] - max(even, sum(spread) + _BETWEEN))
    return tuple(heads[::-1])


def thickest_stay(load: float, stays: Stays, pylon: Pylon) -> float:
    """Find the diameter that the stay with the largest force in the main span needs [m].

    Args:
        load: Weight and traffic that each plane of stays carries [kN/m].
        stays: End points of the stays.
        pylon: Their pylon.
    """
    offsets, rises = np.array(stays.offsets), np.array(stays.heights) - stays.foot
    runs = offsets - np.array([pylon.face(height) for height in stays.heights])
    pitches = np.gradient(offsets).tolist()
    return max(stay_diameter(load, each, s) for each, s in zip(pitches, (rises / runs).tolist(), strict=True))


def stay_parts(stays: Stays, pylon: Pylon, pylons: tuple[tuple[int, float, int], ...], place: Alignment) -> list[Part]:
    """Build every stay with its socket and its upper anchorage.

    Args:
        stays: End points of the stays.
        pylon: Their pylon.
        pylons: Number of the support, station [m] and direction of the main span (1 or -1) of every pylon.
        place: Axis of the bridge.
    """
    parts = []
    side = stays.side_offsets(pylon)
    planes = (("C", 0),) if stays.planes == 1 else (("L", 1), ("R", -1))
    for support, station, main in pylons:
        names, rows = [], []
        for way, word in ((-1, "B"), (1, "F")):
            offsets = stays.offsets if way == main else side
            for number, (offset, height) in enumerate(zip(offsets, stays.heights, strict=True)):
                for label, plane in planes:
                    half, line = anchor_faces(pylon, height, plane, stays.collar + 0.05)
                    names.append((f"{support:03d}_{word}{label}_{number:02d}", number))
                    rows.append((way, station + way * offset, plane * stays.plane, station + way * half, line, height))
        ends = _stay_ends(np.array(rows), station, stays.foot, place)
        parts += _stays_between(stays, support, names, ends)
    return parts


def _stay_ends(rows: F64, station: float, foot: float, place: Alignment) -> tuple[F64, F64, F64, F64]:
    """Find feet and heads of one pylon's stays [m], and the outward normals of the faces there [1], shapes (N, 3).

    Args:
        rows: For each stay its direction along the bridge, station and left of its foot, station, left and height of
            its head [m], shape (N, 6), float64.
        station: Of the pylon [m].
        foot: Height of the feet [m].
        place: Axis of the bridge.
    """
    level = level_at(place, station)
    way, at, left = rows[:, 0], rows[:, 1], rows[:, 2]
    above, none = np.full(len(rows), foot), np.zeros(2)
    feet = place.point(at, left, above)
    along, across = place.point(at + 1.0, left, above) - feet, place.point(at, left + 1.0, above) - feet
    up = cross(along, across)
    ahead = np.diff(level.point(np.array([station, station + 1.0]), none, none), axis=0)
    heads = level.point(rows[:, 3], rows[:, 4], rows[:, 5])
    return feet, up / _norms(up), heads, way[:, None] * (ahead / _norms(ahead))


def _stays_between(
    stays: Stays, support: int, names: list[tuple[str, int]], ends: tuple[F64, F64, F64, F64]
) -> list[Part]:
    feet, up, heads, ahead = ends
    along = heads - feet
    lengths = _norms(along)
    along /= lengths
    scale, collar = max(0.6, min(stays.diameter / 0.10, 2.0)), stays.collar
    sockets = sleeves(feet, up, along, collar, np.minimum(_SOCKET * scale, 0.12 * lengths[:, 0]))
    anchorages = sleeves(heads, ahead, -along, collar, np.minimum(_HEAD * scale, 0.08 * lengths[:, 0]))
    lines = np.stack([[sleeve.held for sleeve in row] for row in (sockets, anchorages)], axis=1)
    bars = tubes(lines, 0.5 * stays.diameter, STAY_SIDES)
    spans = _norms(lines[:, 1] - lines[:, 0])[:, 0].tolist()
    parts = []
    for (name, number), socket, anchorage, stay, span in zip(names, sockets, anchorages, bars, spans, strict=True):
        facts: dict[str, object] = {"support": support, "stay": number, "diameter": stays.diameter}
        holds = {**facts, "embedded_in": "stay"}
        parts += [
            Part(f"Stay_{name}", "stay", "Role_CableSteel", SUPERSTRUCTURE, stay, {**facts, "length": span}),
            Part(f"Socket_{name}", "cable_socket", "Role_CableSteel", SUPERSTRUCTURE, socket.surface, holds),
            Part(f"Anchorage_{name}", "upper_anchorage", "Role_GirderSteel", SUPERSTRUCTURE, anchorage.surface, holds),
        ]
    return parts


def _norms(vectors: F64) -> F64:
    return np.sqrt(np.sum(vectors * vectors, axis=1, keepdims=True))
