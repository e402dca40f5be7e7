"""Cable-supported decks: a slab on edge beams, on a box or on plate girders, with floor beams and brackets."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.decks import DeckEdge, deck_outline
from authoring.parts.part import SUPERSTRUCTURE, Part
from authoring.parts.spans import Levels
from authoring.shapes.component import F64
from authoring.shapes.sections import cut_corners, mirrored, rectangle
from authoring.solids.extrusion import Prism
from authoring.solids.sweep import turned

DeckKind = Literal["edge_beam", "concrete_box", "steel_box", "plate_girder"]

EMBEDDED = 0.010  # [m] embedment of members in each other
_LONGEST = 36.0  # [m] of a piece of deck between two construction joints
_JOINT = 0.004  # [m] open between two pieces
_SHORTER = 0.012  # [m] shorter than the slab at the deck's ends, so that end faces are not coplanar
_CHAMFER = 0.025  # [m] of concrete edges
_GROOVE, _LEAST_FREE = 0.12, 0.30  # [m] drip groove from the slab's edge, and least free slab with one
_FLANGE, _WEB = 0.04, 0.02  # [m] of plate girders and steel floor beams
_EDGE_HEIGHT = 0.40  # [m] upright edge of a steel box
_FLOOR_PITCH = 4.6  # [m] largest distance between floor beams
_CROWDED = 0.7  # [m] no two floor beams are closer
_ROOF = 0.005  # [m] gap between slab and floor beams, which end below the girders' flanges


@dataclass(frozen=True)
class CableDeck:
    """One cross-section from end to end.

    Attributes:
        kind: `edge_beam`, `concrete_box`, `steel_box` or `plate_girder`.
        width: Overall [m].
        slab: Thickness of the slab [m].
        depth: Of beam, girder or box below the slab [m].
        edge: Distance of beams or girders to the left of the axis [m]; of a box, half its soffit.
        beam_width: Of an edge beam, or of a plate girder's flanges [m].
        chamfered: Concrete edges have chamfers.
    """

    kind: DeckKind
    width: float
    slab: float
    depth: float
    edge: float
    beam_width: float
    chamfered: bool

    @property
    def bearing_lines(self) -> tuple[float, float]:
        """Positions of bearings, distance to the left of the axis [m]."""
        line = self.edge if self.kind in ("edge_beam", "plate_girder") else round(self.edge - 0.6, 3)
        return -line, line

    @property
    def cantilever(self) -> float:
        """Cantilever of the slab outside its supporting members [m]."""
        outer = {
            "steel_box": 0.5 * self.width,
            "concrete_box": min(self.edge + 0.35 * self.depth, 0.5 * self.width - 0.5) + 0.35,
        }.get(self.kind, self.edge + 0.5 * self.beam_width)
        return 0.5 * self.width - outer

    @property
    def concrete(self) -> bool:
        """Whether beams and box are of concrete."""
        return self.kind in ("edge_beam", "concrete_box")


def deck_pieces(low: float, high: float, floor: tuple[float, ...]) -> list[tuple[float, float]]:
    """Cut a deck into pieces of about equal length, with open construction joints between two floor beams.

    Args:
        low: Station of its first end [m].
        high: Station of its last end [m].
        floor: Stations of the floor beams, rising, the first and the last near the ends [m].

    Returns:
        Stations of both ends of each piece [m].
    """
    cuts = np.linspace(low, high, int(np.ceil((high - low) / _LONGEST)) + 1)
    beams = np.array(floor)
    bays = np.clip(np.searchsorted(beams, cuts[1:-1]), 1, len(beams) - 1)
    cuts[1:-1] = 0.5 * (beams[bays - 1] + beams[bays])
    half = 0.5 * _JOINT
    last = len(cuts) - 2
    return [
        (float(a) + (half if k else 0.0), float(b) - (half if k < last else 0.0))
        for k, (a, b) in enumerate(pairwise(cuts))
    ]


def cable_deck_parts(
    deck: CableDeck, low: float, high: float, floor: tuple[float, ...], levels: Levels, place: Alignment
) -> list[Part]:
    """Build slab, longitudinal members and floor beams.

    Args:
        deck: Cross-section.
        low: Station of its first end [m].
        high: Station of its last end [m].
        floor: Stations of the floor beams [m]; a box has diaphragms there, which are hidden.
        levels: Levels of the deck.
        place: Axis of the bridge.
    """
    parts = []
    outline = _slab_outline(deck, levels)
    pieces = deck_pieces(low, high, floor)
    for number, (begin, end) in enumerate(pieces):
        size: dict[str, object] = {"length": end - begin, "width": deck.width, "thickness": deck.slab}
        surface = Prism(outline, begin, end, "station", place)
        parts.append(Part(f"Deck_{number:03d}", "deck_slab", "Role_DeckConcrete", SUPERSTRUCTURE, surface, size))
    for number, (begin, end) in enumerate(pieces):
        begin += _SHORTER if number == 0 else _JOINT
        end -= _SHORTER if number == len(pieces) - 1 else _JOINT
        parts += _member_parts(deck, number, begin, end, levels, place)
    if deck.kind in ("edge_beam", "plate_girder"):
        parts += [_floor_beam(deck, number, station, levels, place) for number, station in enumerate(floor)]
    return parts


def _slab_outline(deck: CableDeck, levels: Levels) -> F64:
    """Draw the section of the slab, with drip grooves where its edges are free; (left, above) [m], shape (P, 2)."""
    if deck.chamfered and deck.cantilever > _LEAST_FREE:
        return deck_outline(deck.width, -levels.surfacing, levels.soffit, DeckEdge(_GROOVE, _CHAMFER))
    outline = rectangle((-0.5 * deck.width, levels.soffit), (0.5 * deck.width, -levels.surfacing))
    return cut_corners(outline, np.array([_CHAMFER, _CHAMFER, 0.0, 0.0])) if deck.chamfered else outline


def floor_stations(feet: tuple[float, ...], supports: tuple[float, ...]) -> tuple[float, ...]:
    """Place floor beams at cables, at supports, and evenly between.

    Args:
        feet: Stations of the cables' lower ends [m].
        supports: Stations of the bearing lines [m].

    Returns:
        Stations of the floor beams, rising [m].
    """
    fixed = sorted({round(s, 6) for s in supports} | {round(s, 6) for s in feet})
    kept = [s for s in fixed if s in supports or min(abs(s - support) for support in supports) > _CROWDED]
    stations = [kept[0]]
    for station in kept[1:]:
        if station - stations[-1] < _CROWDED:
            continue
        bays = int(np.ceil((station - stations[-1]) / _FLOOR_PITCH))
        stations += [float(s) for s in np.linspace(stations[-1], station, bays + 1)[1:]]
    return tuple(stations)


def _member_parts(
    deck: CableDeck, number: int, low: float, high: float, levels: Levels, place: Alignment
) -> list[Part]:
    role = "Role_GirderConcrete" if deck.concrete else "Role_GirderSteel"
    size: dict[str, object] = {"length": high - low, "depth": deck.depth}
    if deck.kind in ("concrete_box", "steel_box"):
        surface = Prism(box_outline(deck, levels), low, high, "station", place)
        return [Part(f"Box_{number:03d}", "box_girder", role, SUPERSTRUCTURE, surface, size)]
    kind, word = ("edge_beam", "Edge") if deck.kind == "edge_beam" else ("plate_girder", "Girder")
    parts = []
    for side, sign in (("L", 1.0), ("R", -1.0)):
        shift = np.array([sign * deck.edge, levels.girder_soffit])
        surface = Prism(_beam_outline(deck) + shift, low, high, "station", place)
        sized = {**size, "width": deck.beam_width}
        parts.append(Part(f"{word}_{number:03d}_{side}", kind, role, SUPERSTRUCTURE, surface, sized))
    return parts


def box_outline(deck: CableDeck, levels: Levels) -> F64:
    """Draw the section of a box: of concrete under cantilevers of the slab, of steel as wide as the deck.

    Args:
        deck: Cross-section.
        levels: Levels of the deck.

    Returns:
        Outline (left, above) [m], shape (P, 2), float64.
    """
    low, high = levels.girder_soffit, levels.soffit + EMBEDDED
    if deck.kind == "concrete_box":
        top = min(deck.edge + 0.35 * deck.depth, 0.5 * deck.width - 0.5)
        outline = mirrored([(deck.edge, low), (top, levels.soffit - 0.15), (top + 0.35, high)])
        legs = _CHAMFER * np.array([1.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        return cut_corners(outline, legs) if deck.chamfered else outline
    half = 0.5 * deck.width - 0.03
    return mirrored([(deck.edge, low), (half, levels.soffit - _EDGE_HEIGHT), (half, high)])


def _beam_outline(deck: CableDeck) -> F64:
    half, high = 0.5 * deck.beam_width, deck.depth + EMBEDDED
    if deck.kind == "edge_beam":
        outline = rectangle((-half, 0.0), (half, high))
        return cut_corners(outline, np.array([_CHAMFER, _CHAMFER, 0.0, 0.0])) if deck.chamfered else outline
    web = 0.5 * _WEB
    return mirrored(
        [
            (half, 0.0),
            (half, _FLANGE),
            (web, _FLANGE),
            (web, deck.depth - _FLANGE),
            (half, deck.depth - _FLANGE),
            (half, high),
        ]
    )


def floor_heights(deck: CableDeck, levels: Levels) -> tuple[float, float]:
    """Find bottom and top of a floor beam [m].

    Args:
        deck: Cross-section.
        levels: Levels of the deck.
    """
    if deck.kind == "edge_beam":
        return levels.soffit - 0.75 * deck.depth, levels.soffit + EMBEDDED
    return levels.soffit - max(0.72 * deck.depth, 0.40), levels.soffit - _FLANGE - _ROOF


def _floor_beam(deck: CableDeck, number: int, station: float, levels: Levels, place: Alignment) -> Part:
    low, high = floor_heights(deck, levels)
    if deck.kind == "edge_beam":
        inner, half = deck.edge - 0.5 * deck.beam_width, 0.16
        outline = rectangle((station - half, low), (station + half, high))
        if deck.chamfered:
            outline = cut_corners(outline, np.array([_CHAMFER, _CHAMFER, 0.0, 0.0]))
        role = "Role_GirderConcrete"
    else:
        inner, half, web = deck.edge - 0.5 * _WEB, 0.14, 0.5 * _WEB
        outline = mirrored(
            [
                (half, low),
                (half, low + _FLANGE),
                (web, low + _FLANGE),
                (web, high - _FLANGE),
                (half, high - _FLANGE),
                (half, high),
            ]
        ) + np.array([station, 0.0])
        role = "Role_GirderSteel"
    reach = inner + EMBEDDED * (1.0 if deck.kind == "edge_beam" else 0.5)
    surface = Prism(outline, -reach, reach, "left", place)
    size: dict[str, object] = {"length": 2.0 * reach, "depth": high - low}
    return Part(f"FloorBeam_{number:03d}", "floor_beam", role, SUPERSTRUCTURE, surface, size)


def bracket_parts(
    deck: CableDeck, tip: float, stations: tuple[float, ...], levels: Levels, place: Alignment
) -> list[Part]:
    """Build the brackets between the deck and the hangers beside it.

    Args:
        deck: Cross-section, any but `concrete_box`.
        tip: End of the brackets, distance to the left of the axis [m].
        stations: Of the hangers [m].
        levels: Levels of the deck.
        place: Axis of the bridge.
    """
    top, low = bracket_top(levels), levels.soffit - _EDGE_HEIGHT + 0.03
    root = 0.5 * deck.width - 0.03 - 0.5 * EMBEDDED
    if deck.kind == "edge_beam":
        root, low = deck.edge + 0.5 * deck.beam_width - EMBEDDED, levels.soffit - 0.65 * deck.depth
    elif deck.kind == "plate_girder":
        root, low = deck.edge + 0.5 * _WEB - 0.5 * EMBEDDED, floor_heights(deck, levels)[0]
    right = np.array([(root, low), (tip, top - 0.22), (tip, top), (root, top)])
    parts = []
    for number, station in enumerate(stations):
        for side, sign in (("L", 1.0), ("R", -1.0)):
            outline = right if sign > 0.0 else (right * (-1.0, 1.0))[::-1]
            surface = turned(Prism(outline, station - 0.12, station + 0.12, "station", place).surface)
            size: dict[str, object] = {"length": tip - root, "depth": top - low, "thickness": 0.24}
            name = f"Bracket_{number:03d}_{side}"
            role = "Role_GirderConcrete" if deck.concrete else "Role_GirderSteel"
            parts.append(Part(name, "floor_beam", role, SUPERSTRUCTURE, surface, size))
    return parts


def bracket_top(levels: Levels) -> float:
    """Find the height of the face under the hangers' sockets [m].

    Args:
        levels: Levels of the deck.
    """
    return levels.soffit - _FLANGE - _ROOF
