"""Steel guardrails between approaches and parapets: a W-beam on posts, with its far end in the ground.

Source: the usual W-beam, 312 mm high and 81 mm deep, its top 0.75 m over the road, posts every 2 m.
"""

import numpy as np
from numpy.typing import NDArray

from authoring.axis.road_section import RoadSection
from authoring.shapes.component import Mesh
from authoring.site.covers import to_world
from authoring.site.land import no_hills
from authoring.site.shape import Approach, Land, crossfall
from authoring.site.ways import Line, boxes, merged, tube

F64 = NDArray[np.float64]
Piece = tuple[str, str, str, Mesh]

LENGTH = 24.0  # [m] behind the wing walls
TOP = 0.75  # [m] of the beam above the edge of the road
LAP = 0.9  # [m] of the beam along a parapet's end, to which it is bolted
BESIDE = 0.5  # [m] from the kerb's line to the beam if there is a footway between it and the parapets
_ENDS = 4.0  # [m] over which a free end is lowered into the ground
_BURIED = 0.4  # [m] below the road's edge
_STEP, _PITCH = 1.0, 2.0  # [m] between cross-sections of the beam, and between posts
_DEPTH, _SHEET = 0.081, 0.004  # [m] of the beam across the road, of its steel
_POST = (0.06, 0.12, 1.3)  # [m] along, across, down: long enough for any slope of the verge
_LEAST = 0.45  # [m] least height of the beam's top above the road at a post
_HEADS = 0.03  # [m] distance of the posts' tops below the beam's top
_FOLDS = ((1.0, 0.0), (0.0, 0.045), (0.0, 0.085), (1.0, 0.130), (1.0, 0.182), (0.0, 0.227), (0.0, 0.267), (1.0, 0.312))


def guardrail_pieces(land: Land) -> list[Piece]:
    """Build the guardrails on both sides of both approaches of a road bridge.

    Args:
        land: The land.

    Returns:
        Leaf prim name, component kind, material recipe and mesh of each piece; none on a railway.
    """
    road = land.layout.road
    if road is None:
        return []
    return [
        (f"Guardrail_{number}_{side}", "guardrail", "galvanised_steel", _guardrail(land, road, approach, sign))
        for number, approach in enumerate(land.approaches)
        for side, sign in (("L", 1.0), ("R", -1.0))
    ]


def beam_tops(along: F64, road: RoadSection) -> F64:
    """Find the top of the beam above the edge of the road [m], shape (N,), float64.

    Args:
        along: Distances behind the abutment's back face [m], shape (N,), float64.
        road: Section with the ends of the parapets; behind a footway the near end is free, too.
    """
    far = (road.walls + LENGTH - along) / _ENDS
    near = (along - road.walls) / _ENDS if road.footway else np.ones(len(along))
    share = np.clip(np.minimum(far, near), 0.0, 1.0)
    return TOP - (TOP + _BURIED) * (1.0 - share)


def beam_face(road: RoadSection, half_road: float) -> float:
    """Find the traffic's side of the beam, from the middle of the road [m].

    Args:
        road: Where the parapets stand.
        half_road: Half the asphalt [m].
    """
    return half_road + BESIDE if road.footway else road.parapet - _DEPTH - _SHEET


def _guardrail(land: Land, road: RoadSection, approach: Approach, side: float) -> Mesh:
    axis = land.layout.alignment
    begin = road.walls if road.footway else road.walls - LAP
    along = np.linspace(begin, road.walls + LENGTH, int(np.ceil((road.walls + LENGTH - begin) / _STEP)) + 1)
    stations = approach.back + approach.sign * along
    line = Line(
        stations, approach.center(stations), np.column_stack([0.0 * along, approach.sign * approach.stretch(stations)])
    )
    half = approach.half_width
    edge = approach.level(land.layout, no_hills, stations) - crossfall(along, np.full(len(along), half))
    edge = edge + side * half * axis.crossfall(stations) * approach.sign
    face, tops = beam_face(road, half), beam_tops(along, road)

    def row(left: float, below: float) -> F64:
        return np.column_stack([line.offset(side * left), edge + tops - below])

    front = [(face + _DEPTH * back, down) for back, down in _FOLDS]
    ring = [*front, *((left + _SHEET, down) for left, down in front[::-1])]
    ring = ring if side > 0.0 else ring[::-1]  # counter-clockwise seen along the line, so that it faces outward
    sides = np.diff([*ring, ring[0]], axis=0)
    girth = np.concatenate([[0.0], np.cumsum(np.linalg.norm(sides, axis=1))])
    beam = tube(axis, [row(*corner) for corner in ring], line.length(), tuple(girth.tolist()))
    middle = face + _DEPTH + _SHEET + 0.5 * _POST[1]
    places = np.arange(begin + 0.5 * _PITCH + (0.0 if road.footway else LAP), road.walls + LENGTH, _PITCH)
    places = places[beam_tops(places, road) > _LEAST]
    spots = to_world(axis, row(middle, _HEADS))
    ahead = np.gradient(spots, along, axis=0)
    spots, ahead = (np.column_stack([np.interp(places, along, v[:, k]) for k in range(3)]) for v in (spots, ahead))
    ahead[:, 2] = 0.0
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    up = np.tile([0.0, 0.0, 1.0], (len(spots), 1))
    return merged([beam, boxes(spots, ahead, np.cross(up, ahead), up, _POST)])
