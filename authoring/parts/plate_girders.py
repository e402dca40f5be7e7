"""Welded steel girders: lines of plate girders, two girders of a ladder deck, or boxes; their sections and pieces."""

from dataclasses import dataclass

import numpy as np

from authoring.axis.alignment import Alignment
from authoring.parts.part import SUPERSTRUCTURE, Part
from authoring.parts.spans import Levels, Spans
from authoring.shapes.component import F64
from authoring.shapes.sections import mirrored
from authoring.solids.sweep import sweep

EMBEDDED = 0.010  # [m] embedment of girders in the concrete on them, and of that in the slab
_SHORTER = 0.012  # [m] shorter than the slab at either end, so that their end faces are not coplanar
SPLICE_GAP = 0.008  # [m] between the two pieces of a spliced girder
_WEB_LEAN = 0.22  # [1] of a box's webs: meters outward for each meter of height
_BOX_LIP = 0.05  # [m] projection of a box's bottom plate beyond its webs
_TWO_SPLICES = 30.0  # [m] longer inner spans have a splice beside each pier
_RING = 1.5  # [m] distance of sections along a haunch
_SEAT = 0.6  # [m] length on each side of a pier where the bottom of a haunched girder is level


@dataclass(frozen=True)
class PlateGirders:
    """The steel girders of a bridge; all lines are alike.

    Attributes:
        arrangement: `multi`, `ladder` or `box`.
        lines: Distance of every line to the left of the axis [m], rising.
        depth: Steel between the piers and at the abutments [m].
        pier_depth: Steel over the piers [m].
        haunch: `none`, `parabolic` or `straight`: how the depth grows towards the piers.
        haunch_reach: Share of a span over which it grows [1].
        top_width: Top flange [m]; of a box, over both top flanges.
        bottom_width: Bottom flange of a plate girder [m].
        flange: Thickness of the flanges [m].
        web: Thickness of the web [m].
        fillet: Concrete between top flange and slab [m].
        splice_share: From a pier to the splices beside it, over the span [1].
        spliced: Whether girders of more than one piece have field splices.
    """

    arrangement: str
    lines: tuple[float, ...]
    depth: float
    pier_depth: float
    haunch: str
    haunch_reach: float
    top_width: float
    bottom_width: float
    flange: float
    web: float
    fillet: float
    splice_share: float
    spliced: bool

    @property
    def box(self) -> bool:
        """Whether the lines are boxes."""
        return self.arrangement == "box"

    def depths(self, spans: Spans, stations: F64) -> F64:
        """Find the depth of the steel [m], shape (N,), float64.

        Args:
            spans: Stations of the piers.
            stations: Stations [m], shape (N,), float64.
        """
        growth = np.zeros(len(stations))
        for pier in range(1, spans.count if self.haunch != "none" else 0):
            for span, sign in ((pier - 1, -1.0), (pier, 1.0)):
                reach = self.haunch_reach * (spans.supports[span + 1] - spans.supports[span])
                away = sign * (stations - spans.supports[pier])
                share, near = np.clip((reach - away) / (reach - _SEAT), 0.0, 1.0), away >= -1e-9
                growth = np.maximum(growth, np.where(near, share**2 if self.haunch == "parabolic" else share, 0.0))
        return self.depth + growth * (self.pier_depth - self.depth)

    def half_webs(self, heights: F64) -> F64:
        """Find the distance from a line to the outer face of its web, the outer web of a box [m], shape (N,), float64.

        Args:
            heights: Below the top of the steel, positive [m], shape (N,), float64.
        """
        if self.box:
            return 0.5 * self.top_width - self.flange_out - _WEB_LEAN * np.asarray(heights)
        return np.full(np.shape(heights), 0.5 * self.web)

    @property
    def flange_out(self) -> float:
        """Top flange of a box beyond its web [m]."""
        return 0.20

    @property
    def bearing_lines(self) -> tuple[float, ...]:
        """Positions of bearings, to the left of the axis [m]: one under a girder, two under a box."""
        if not self.box:
            return self.lines
        foot = float(self.half_webs(np.array([self.pier_depth]))[0]) - 0.35
        return tuple(round(line + side * foot, 3) for line in self.lines for side in (-1.0, 1.0))

    def steel_top(self, levels: Levels) -> float:
        """Find the top of the top flange above the finished surface, negative [m]."""
        return levels.soffit - self.fillet


def section(girders: PlateGirders, depth: float) -> F64:
    """Draw a girder's section round its line, heights counted from the top of the steel.

    Args:
        girders: Dimensions.
        depth: Depth of the steel there [m].

    Returns:
        Outline, counter-clockwise [m], shape (P, 2), float64; the same P for every depth.
    """
    g, top = girders, 0.5 * girders.top_width
    if g.box:
        webs = g.half_webs(np.array([depth - g.flange, g.flange]))
        lip = float(webs[0]) + _BOX_LIP
        right = [(lip, -depth), (lip, g.flange - depth), (float(webs[0]), g.flange - depth)]
        return mirrored([*right, (float(webs[1]), -g.flange), (top, -g.flange), (top, EMBEDDED)])
    bottom, web = 0.5 * g.bottom_width, 0.5 * g.web
    right = [(bottom, -depth), (bottom, g.flange - depth), (web, g.flange - depth), (web, -g.flange)]
    return mirrored([*right, (top, -g.flange), (top, EMBEDDED)])


def splices(girders: PlateGirders, spans: Spans) -> tuple[float, ...]:
    """List the stations of the field splices, rising [m]: beside the piers of continuous girders.

    Args:
        girders: Dimensions.
        spans: Stations.
    """
    if not girders.spliced or not spans.one_row:
        return ()
    found = []
    for span, (low, high) in enumerate(zip(spans.supports[:-1], spans.supports[1:], strict=True)):
        length = high - low
        if span > 0:
            found.append(low + girders.splice_share * length)
        if span + 1 < spans.count and (length > _TWO_SPLICES or span == 0):
            found.append(high - girders.splice_share * length)
    return tuple(round(station, 3) for station in found)


def pieces(spans: Spans, cuts: tuple[float, ...]) -> list[tuple[float, float]]:
    """List where each piece of a girder line begins and ends [m].

    Args:
        spans: Stations.
        cuts: Field splices, rising [m].
    """
    if not spans.one_row:
        return [(low + _SHORTER, high - _SHORTER) for low, high in (spans.ends(k) for k in range(spans.count))]
    begin, end = spans.ends(0)[0] + _SHORTER, spans.ends(spans.count - 1)[1] - _SHORTER
    lows, highs = [begin, *(cut + 0.5 * SPLICE_GAP for cut in cuts)], [*(cut - 0.5 * SPLICE_GAP for cut in cuts), end]
    return list(zip(lows, highs, strict=True))


def girder_parts(
    girders: PlateGirders, spans: Spans, cuts: tuple[float, ...], levels: Levels, place: Alignment
) -> list[Part]:
    """Build every piece of every line.

    Args:
        girders: Dimensions.
        spans: Stations.
        cuts: Field splices [m].
        levels: Levels of the deck.
        place: Axis of the bridge.
    """
    parts = []
    for number, (low, high) in enumerate(pieces(spans, cuts)):
        along = _rings(girders, spans, low, high)
        outlines = np.stack([section(girders, float(depth)) for depth in girders.depths(spans, along)])
        for line, left in enumerate(girders.lines):
            surface = sweep(outlines + np.array([left, girders.steel_top(levels)]), along, "station", place)
            size: dict[str, object] = {
                "shape": "box" if girders.box else "i",
                "length": high - low,
                "depth": girders.depth,
                "pier_depth": girders.pier_depth,
                "web": girders.web,
                "flange": girders.flange,
                "top_width": girders.top_width,
                "bottom_width": girders.bottom_width,
                "piece": number,
                "line": line,
            }
            name = f"PlateGirder_{number:03d}_{line:02d}"
            parts.append(Part(name, "plate_girder", "Role_GirderSteel", SUPERSTRUCTURE, surface, size))
    return parts


def _rings(girders: PlateGirders, spans: Spans, low: float, high: float) -> F64:
    """List the stations of a piece's sections: its ends, and where a haunch begins, bends and ends [m]."""
    stations = [low, high]
    for pier in range(1, spans.count if girders.haunch != "none" else 0):
        station = spans.supports[pier]
        reaches = [girders.haunch_reach * (spans.supports[k + 1] - spans.supports[k]) for k in (pier - 1, pier)]
        count = [int(np.ceil(reach / _RING)) if girders.haunch == "parabolic" else 1 for reach in reaches]
        stations += np.linspace(station - reaches[0], station - _SEAT, count[0] + 1).tolist()
        stations += np.linspace(station + _SEAT, station + reaches[1], count[1] + 1).tolist()
    along = np.unique(np.round(stations, 6))
    # A ring closer to an end would make slivers.
    return np.array([low, *along[(along > low + 0.05) & (along < high - 0.05)], high])
