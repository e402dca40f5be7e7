"""Pylons and towers: legs, heads and cross beams of concrete, and the pile cap under them."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.footings import Ground, footing_surface, footing_top
from authoring.parts.part import SUBSTRUCTURE, Part
from authoring.parts.spans import level_at
from authoring.shapes.component import F64
from authoring.shapes.sections import cut_corners, mirrored, rectangle
from authoring.solids.extrusion import Prism
from authoring.solids.sweep import Surface, sweep, turned

PylonShape = Literal["a", "h", "portal", "diamond", "mast"]

EMBEDDED = 0.010  # [m] embedment of members in each other
_HEAD_TAPER = 0.25  # [1] share of its width by which a head tapers on each side towards its top
_FLUSH = 0.015  # [m] distance of cross beams behind the legs' faces
_TAPER = 0.010  # growth of a leg along the bridge towards its foot, each side [1]
_DEEP_WATER = -2.5  # [m] world height: lower ground is under water
_CAP_DRY = 0.6  # [m] world height of a pile cap's top in deep water: visible to boats; piles are driven from above
_CAP_SHOWN = 0.35  # [m] visible height of a cap on land


@dataclass(frozen=True)
class Pylon:
    """Elevation of a pylon across the bridge; heights count from the finished deck surface.

    Attributes:
        shape: `a`, `h`, `portal`, `diamond` or `mast`.
        top: Height of its top [m].
        seat: Top of the lower cross beam, or of a mast's pier [m].
        knee: Height above which the legs are inclined inward [m].
        merge: Height at which the legs meet in a head, or are vertical again [m].
        knee_line: Middle of a leg at the knee, distance to the left of the axis [m]; of a mast, its pier's width.
        merge_line: Middle of a leg where they merge, and above it [m]; of a mast, half its pier's crosshead.
        foot_lean: Inclination of a leg outward below the knee [1].
        width: Leg across the bridge [m].
        length: Leg along the bridge, at its top [m].
        beam_depth: Depth of the cross beams [m].
        upper_beams: Middles of the cross beams above the deck, rising [m].
        foot_line: Least distance of a leg's middle from the axis below the knee [m].
        prefix: `Pylon` or `Tower`, begins the names.
        role: Material role.
        chamfer: Leg of chamfers [m].
    """

    shape: str
    top: float
    seat: float
    knee: float
    merge: float
    knee_line: float
    merge_line: float
    foot_lean: float
    width: float
    length: float
    beam_depth: float
    upper_beams: tuple[float, ...]
    foot_line: float = 0.0
    prefix: str = "Pylon"
    role: str = "Role_PierConcrete"
    chamfer: float = 0.03

    @property
    def headed(self) -> bool:
        """Whether the legs meet in a head."""
        return self.shape in ("a", "diamond")

    @property
    def lean(self) -> float:
        """Inclination of a leg inward above the knee [1]."""
        return (self.knee_line - self.merge_line) / (self.merge - self.knee)

    def line(self, above: float) -> float:
        """Find the middle of the left leg [m].

        Args:
            above: Height [m].
        """
        if above <= self.knee:
            return max(self.knee_line + self.foot_lean * (self.knee - above), self.foot_line)
        share = min((above - self.knee) / (self.merge - self.knee), 1.0)
        return self.knee_line + share * (self.merge_line - self.knee_line)

    @property
    def bends(self) -> tuple[float, ...]:
        """Heights at which a leg changes its direction, rising [m]."""
        if self.foot_lean < 0.0:
            drawn_in = self.knee + (self.knee_line - self.foot_line) / self.foot_lean
            return drawn_in, self.knee, self.merge
        return self.knee, self.merge

    def face(self, above: float) -> float:
        """Find half a leg's length along the bridge [m].

        Args:
            above: Height [m].
        """
        return 0.5 * self.length + _TAPER * (self.top - above)

    def head_half(self, above: float) -> float:
        """Find half the width of the head across the bridge [m].

        Args:
            above: Height, from where the legs merge to the top [m].
        """
        share = (above - self.merge) / (self.top - self.merge)
        return self.merge_line + 0.5 * self.width + _FLUSH - share * _HEAD_TAPER * self.width


@dataclass(frozen=True)
class PylonSite:
    """Position of a pylon.

    Attributes:
        support: Number of the support.
        station: Its axis [m].
        deck: Height of the structural deck under a mast [m].
        rise: Of the piers' footings over the ground; if negative, the pile cap is also below ground on land [m].
    """

    support: int
    station: float
    deck: float
    rise: float


def pylon_parts(pylon: Pylon, site: PylonSite, place: Alignment, ground: Ground) -> list[Part]:
    """Build one pylon.

    Args:
        pylon: Its elevation.
        site: Its position.
        place: Axis of the bridge.
        ground: Height of the ground [m], shape (N,), at plan positions [m], shape (N, 2).
    """
    support, station = site.support, site.station
    level = level_at(place, station)
    low, foot = _cap_heights(pylon, station, level, ground, site.rise if site.rise < 0.0 else _CAP_SHOWN)
    name = f"{pylon.prefix}_{support:03d}"
    parts = []
    for label, kind, surface in (
        *_shafts(pylon, station, foot - EMBEDDED, site.deck, level),
        *_beams(pylon, station, level),
    ):
        size: dict[str, object] = {"shape": pylon.shape, "support": support, "width": pylon.width, "top": pylon.top}
        if kind == "beam":
            surface, size["depth"] = turned(surface), pylon.beam_depth
        full = f"{pylon.prefix.lower()}_{kind}"
        parts.append(Part(f"{name}_{label}", full, pylon.role, SUBSTRUCTURE, surface, size))
    half = _cap_half(pylon, foot)
    surface = footing_surface(half, station, low, foot, level, pylon.chamfer)
    size = {"length": 2.0 * half[1], "width": 2.0 * half[0], "height": foot - low, "support": support}
    parts.append(Part(f"{name}_Cap", "pier_footing", "Role_PierConcrete", SUBSTRUCTURE, surface, size))
    return parts


def _shafts(pylon: Pylon, station: float, foot: float, deck: float, level: Alignment) -> list[tuple[str, str, Surface]]:
    if pylon.shape == "mast":
        seat = pylon.seat - pylon.beam_depth
        half = 0.5 * pylon.knee_line
        pier = _shaft(pylon, station, [(foot, 0.0, half), (seat + EMBEDDED, 0.0, half)], level)
        rows = [(deck - EMBEDDED, 0.0, 0.5 * pylon.width), (pylon.top, 0.0, 0.36 * pylon.width)]
        mast = _shaft(pylon, station, rows, level)
        return [("Pier", "leg", pier), ("Mast", "leg", mast)]
    end = pylon.merge + EMBEDDED if pylon.headed else pylon.top
    heights = [foot, *(h for h in pylon.bends if foot + 0.05 < h < end - 0.05), end]
    shafts = []
    for side, sign in (("L", 1.0), ("R", -1.0)):
        rows = [(height, sign * pylon.line(height), 0.5 * pylon.width) for height in heights]
        shafts.append((f"Leg_{side}", "leg", _shaft(pylon, station, rows, level)))
    if pylon.headed:
        rows = [(height, 0.0, pylon.head_half(height)) for height in (pylon.merge, pylon.top)]
        shafts.append(("Head", "leg", _shaft(pylon, station, rows, level, _FLUSH)))
    return shafts


def _shaft(
    pylon: Pylon,
    station: float,
    rows: list[tuple[float, float, float]],
    level: Alignment,
    grown: float = 0.0,
) -> Surface:
    """Build a shaft: each row is a height, the shaft's middle to the left of the axis, and half its width [m]."""
    sections = []
    for height, line, half in rows:
        along = pylon.face(height) + grown
        outline = rectangle((station - along, line - half), (station + along, line + half))
        sections.append(cut_corners(outline, 2.0 * pylon.chamfer) if pylon.chamfer else outline)
    return sweep(np.stack(sections), np.array([height for height, _, _ in rows]), "above", level)


def _beams(pylon: Pylon, station: float, level: Alignment) -> list[tuple[str, str, Surface]]:
    low = pylon.seat - pylon.beam_depth
    if pylon.shape == "mast":
        half = [0.5 * pylon.knee_line, pylon.merge_line, pylon.merge_line]
        heights = [low, low + 0.6 * pylon.beam_depth, pylon.seat]
        return [("Beam_0", "beam", _beam(pylon, station, heights, half, level, 0.0))]
    spans = [(low, pylon.seat)]
    spans += [(middle - 0.4 * pylon.beam_depth, middle + 0.4 * pylon.beam_depth) for middle in pylon.upper_beams]
    beams = []
    for number, (bottom, top) in enumerate(spans):
        heights = [bottom, *(h for h in (pylon.knee, pylon.merge) if bottom + 0.01 < h < top - 0.01), top]
        halves = [pylon.line(h) - 0.5 * pylon.width + EMBEDDED for h in heights]
        beams.append((f"Beam_{number}", "beam", _beam(pylon, station, heights, halves, level, _FLUSH)))
    return beams


def _beam(
    pylon: Pylon, station: float, heights: list[float], halves: list[float], level: Alignment, behind: float
) -> Surface:
    along = pylon.face(heights[-1]) - behind
    right = [corner for k, corner in enumerate(zip(halves, heights, strict=True)) if not _on_line(halves, heights, k)]
    return Prism(mirrored(right), station - along, station + along, "station", level).surface


def _on_line(halves: list[float], heights: list[float], k: int) -> bool:
    """Check whether an inner corner lies on the line between its neighbors, where no face ends."""
    if k in (0, len(halves) - 1):
        return False
    (a, b, c), (x, y, z) = halves[k - 1 : k + 2], heights[k - 1 : k + 2]
    return abs((b - a) * (z - x) - (c - a) * (y - x)) < 1e-6


def _cap_half(pylon: Pylon, foot: float) -> F64:
    """Find half the pile cap along and across the bridge [m], shape (2,), float64."""
    margin = 0.4 + 0.25 * pylon.width
    across = 0.5 * pylon.knee_line if pylon.shape == "mast" else pylon.line(foot) + 0.5 * pylon.width
    return np.array([pylon.face(foot) + margin, across + margin])


def covered_by_pylon(pylon: Pylon, station: float, datum: float) -> tuple[float, float, float, float]:
    """Find the rectangle on the ground that a pylon and its pile cap cover.

    Args:
        pylon: Its elevation.
        station: Its axis [m].
        datum: Height of the finished surface there over z = 0 [m].

    Returns:
        Lowest and highest station, lowest and highest distance to the left of the axis [m].
    """
    along, across = (float(value) for value in _cap_half(pylon, -datum))
    return station - along, station + along, -across, across


def _cap_heights(pylon: Pylon, station: float, level: Alignment, ground: Ground, rise: float) -> tuple[float, float]:
    """Find bottom and top of the pile cap [m]: in the ground on land, out of the water in a harbour."""
    datum = float(level.point(*(np.array([v]) for v in (station, 0.0, 0.0)))[0, 2])
    half = _cap_half(pylon, -datum)
    s, left = (g.ravel() for g in np.meshgrid(np.linspace(-1.0, 1.0, 9), np.linspace(-1.0, 1.0, 17), indexing="ij"))
    corners = level.point(station + s * half[0], left * half[1], np.zeros(len(s)))
    heights = ground(corners[:, :2])
    wet = float(heights.min()) < _DEEP_WATER
    top = _CAP_DRY if wet else footing_top(float(heights.min()), float(heights.max()), rise)
    top = min(top - datum, pylon.seat - pylon.beam_depth - 0.6)
    return min(float(heights.min()) - datum, top) - (1.5 + 0.2 * pylon.width), top


def anchor_faces(pylon: Pylon, above: float, plane: float, room: float) -> tuple[float, float]:
    """Find where a stay meets a pylon: half its length there and the distance to the left of the axis [m].

    Args:
        pylon: Its elevation.
        above: Height of the stay's anchorage [m].
        plane: Side of the stay: 1 left, -1 right, 0 for a single plane [1].
        room: Least distance from the anchorage's middle to the face's edge [m].
    """
    if pylon.headed and above > pylon.merge - room:
        head = pylon.head_half(max(above, pylon.merge))
        return pylon.face(above) + _FLUSH, plane * min(pylon.line(above), head - room)
    return pylon.face(above), plane * (0.0 if pylon.shape == "mast" else pylon.line(above))
