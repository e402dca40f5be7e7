"""Everything on a deck of any family: road or railway, and the parapets beside it."""

from dataclasses import dataclass, replace
from typing import Literal

from authoring.axis.alignment import Alignment
from authoring.axis.road_section import UNDERLAY, RoadSection
from authoring.parts.abutments import Abutments, approach_range
from authoring.parts.drawing import Draws, chosen, draw_option
from authoring.parts.fittings import FittedDeck, Fittings, FittingSettings, draw_fittings
from authoring.parts.medians import median_parts
from authoring.parts.parapets import EMBEDDED, LEDGE, DeckEdge, Parapets, ParapetSettings, draw_parapets, parapet_parts
from authoring.parts.part import Part
from authoring.parts.roadway import (
    DIVIDED_LANES,
    Roadway,
    RoadwaySettings,
    draw_roadway,
    kerb_parts,
    lane_lines,
    surfacing_parts,
)
from authoring.parts.spans import Spans
from authoring.parts.terminals import LENGTH as TERMINAL
from authoring.parts.terminals import terminal_parts
from authoring.parts.tracks import Tracks, TrackSettings, draw_tracks, side_parts, track_parts
from groundwork.settings import Settings

_KERB_SHORTER, _PARAPET_SHORTER = 0.008, 0.004  # [m] shorter than the slab, so that no two end faces are coplanar
APPROACH = "Approach_"  # begins the names of runs on the wing walls
_EDGE = 0.008  # [m] distance of a walkway behind the deck's edge
_RAIL_UNDERLAY = 0.01  # [m] ground on an approach above the underside of the ballast

Runs = list[tuple[str, tuple[float, float]]]


class DeckTopSettings(Settings):
    """What lies on a deck; omitted values are drawn at random."""

    service: Literal["road", "rail_single", "rail_double"] | None = chosen(
        {"road": 60, "rail_single": 15, "rail_double": 25},
        "Road, or railway of one or two tracks",
        among="; on suspension and cable-stayed bridges one track below 160 and 120 m of main span",
        paper={"rail_single": 50, "rail_double": 50},
    )
    roadway: RoadwaySettings = RoadwaySettings()
    track: TrackSettings = TrackSettings()
    parapet: ParapetSettings = ParapetSettings()
    fittings: FittingSettings = FittingSettings()


@dataclass(frozen=True)
class DeckTop:
    """Everything on a deck: heights count from the asphalt on a road, from the rails' top on a railway.

    Attributes:
        service: `road` or `rail`.
        roadway: Cross-section of the road, None on a railway.
        tracks: Cross-section of the railway, None on a road.
        parapets: Section of the parapets.
        fittings: Lamp posts, drainage, conduits.
    """

    service: str
    roadway: Roadway | None
    tracks: Tracks | None
    parapets: Parapets
    fittings: Fittings

    @property
    def _way(self) -> Roadway | Tracks:
        way = self.roadway if self.tracks is None else self.tracks
        assert way is not None
        return way

    @property
    def width(self) -> float:
        """Overall deck width [m]."""
        return 2.0 * (self.half_width + self.parapets.thickness + LEDGE)

    @property
    def fitted(self) -> FittedDeck:
        """The deck with its fittings."""
        return FittedDeck(self.fittings, self.roadway, self.width)

    @property
    def half_width(self) -> float:
        """From the axis to the foot of the parapets [m]."""
        return self._way.half_width

    @property
    def kerb_face(self) -> float:
        """From the axis to the face of the kerbs, or of the upstands beside the tracks [m]."""
        return self._way.kerb_face

    @property
    def surfacing(self) -> float:
        """From the finished surface, or from the rails' top, down to the structural deck [m]."""
        return self._way.surfacing

    @property
    def walk_level(self) -> float:
        """Height that parapets count from: the footway, the road where there is none, walkway, or bare deck [m]."""
        if self.roadway is not None:
            return self.roadway.kerb_height if self.roadway.footway_width else 0.0
        assert self.tracks is not None
        return self.tracks.walk_level

    @property
    def parapet_foot(self) -> float:
        """Height of the surface under the parapets: the structural deck of a road, the walkway of a railway [m]."""
        return -self.surfacing if self.tracks is None else self.tracks.walk_level

    @property
    def carriageway(self) -> float:
        """Width of the asphalt from kerb to kerb, or of the track bed between its upstands [m]."""
        return 2.0 * self.kerb_face

    @property
    def edge_line(self) -> float:
        """From the axis to the middle of a road's edge lines [m]; 0 on a railway."""
        return 0.0 if self.roadway is None else self.roadway.edge_line

    @property
    def takes_skew(self) -> bool:
        """Whether its joints may be skewed: track slabs end perpendicular to their track."""
        return self.tracks is None or self.tracks.section.bed == "ballast"

    @property
    def underlay(self) -> float:
        """From the finished surface, or from the rails' top, down to the ground under the approaches [m]."""
        return UNDERLAY if self.tracks is None else self.surfacing - _RAIL_UNDERLAY


def road_section(top: DeckTop, walls: float) -> RoadSection | None:
    """Return the parts of a road that the approaches continue; None for a railway.

    Args:
        top: Surfacing, parapets and fittings of the deck.
        walls: Length of the wing walls behind the abutments' back faces [m].
    """
    way = top.roadway
    if way is None:
        return None
    lines = tuple((round(left, 6), dashed) for left, dashed in lane_lines(way))
    return RoadSection(
        lines, (way.dash, way.dash_gap), way.marking_width, way.half_width, way.footway_width > 0.0, walls
    )


@dataclass(frozen=True)
class SuitedTop:
    """What suits the values that the user set elsewhere; the services and lanes that are left out are drawn among it.

    Attributes:
        services: Options of `service`; None for all.
        lanes: Numbers of lanes; None for all.
    """

    services: tuple[str, ...] | None = None
    lanes: tuple[int, ...] | None = None


def draw_deck_top(settings: DeckTopSettings, draws: Draws, suited: SuitedTop = SuitedTop()) -> DeckTop:
    """Draw the cross-section on a deck.

    Args:
        settings: Values set by the user.
        draws: Random stream and profile of the bridge.
        suited: What suits the values that the user set elsewhere.
    """
    service = draw_option(settings, "service", draws, suited=suited.services)
    kind = "road" if service == "road" else "rail"
    roadway = draw_roadway(settings.roadway, draws, suited.lanes)
    parapets = draw_parapets(settings.parapet, kind, draws)
    tracks = draw_tracks(settings.track, 2 if service == "rail_double" else 1, parapets.thickness + LEDGE, draws)
    fittings = draw_fittings(settings.fittings, draws)
    if kind == "road":
        return DeckTop(kind, roadway, None, parapets, fittings)
    return DeckTop(kind, None, tracks, parapets, fittings)


def fitted_to_span(top: DeckTop, settings: DeckTopSettings, main: float, each: float, draws: Draws) -> DeckTop:
    """Remove lanes and tracks from a drawn deck that is too wide for its cables; what the user set stays.

    Args:
        top: The deck as drawn.
        settings: Values set by the user.
        main: Main span [m].
        each: Length of main span for each lane [m]; a second track counts as four lanes.
        draws: Random stream and profile of the bridge; it does not advance, and the profile `paper` has no limit.
    """
    most = max(2, 2 * int(main / each / 2.0))
    if draws.profile == "paper":
        return top
    road, way = top.roadway, settings.roadway
    if road is not None and road.lanes > most and way.lanes is None and not way.divided:
        road = replace(road, lanes=most, median=road.median if most >= DIVIDED_LANES else 0.0)
        return replace(top, roadway=replace(road, divided=road.divided and most >= DIVIDED_LANES))
    tracks = top.tracks
    if tracks is not None and most < DIVIDED_LANES and settings.service is None and len(tracks.section.lines) > 1:
        return replace(top, tracks=replace(tracks, section=replace(tracks.section, lines=(0.0,))))
    return top


def deck_runs(spans: Spans, abutments: Abutments) -> Runs:
    """List the runs of deck that kerbs and parapets follow: each piece of deck, and the approach at either end.

    Args:
        spans: Stations of the decks' ends.
        abutments: Abutments, whose wing walls support the approaches' edges.

    Returns:
        Ending of the names, and stations from and to [m], of every run.
    """
    runs: Runs = [(f"{number:03d}", piece) for number, piece in enumerate(spans.pieces)]
    ends = enumerate((0, spans.count))
    return runs + [(f"{APPROACH}{number}", approach_range(abutments, spans, support)) for number, support in ends]


def deck_top_parts(top: DeckTop, spans: Spans, runs: Runs, place: Alignment) -> list[Part]:
    """Build everything on a deck.

    Args:
        top: Surfacing, parapets and fittings of the deck.
        spans: Stations; the joints lie at their supports.
        runs: Result of `deck_runs`.
        place: Axis of the bridge.
    """
    parts = [] if top.roadway is None else surfacing_parts(top.roadway, spans, place)
    parts += [] if top.tracks is None else track_parts(top.tracks, spans, place)
    if top.roadway is not None and top.roadway.divided:
        for number, (low, high) in enumerate(spans.pieces):
            noses = number == 0, number == len(spans.pieces) - 1
            parts += median_parts(top.roadway, low, high, (), place, name=f"{number:03d}_", noses=noses)
    edge = DeckEdge(top.half_width, top.parapet_foot, top.walk_level)
    for name, (low, high) in runs:
        kerb = (name, low + _KERB_SHORTER, high - _KERB_SHORTER, place)
        parts += [] if top.roadway is None else kerb_parts(top.roadway, *kerb)
        parts += [] if top.tracks is None else side_parts(top.tracks, 0.5 * top.width - _EDGE, *kerb)
        begin, end = low + _PARAPET_SHORTER, high - _PARAPET_SHORTER
        if top.parapets.terminals and name.startswith(APPROACH):
            parts += _ended_parapets(top, name, begin, end, place, first=high < spans.supports[-1])
            continue
        parts += parapet_parts(top.parapets, edge, name, begin, end, place)
    return parts


def _ended_parapets(top: DeckTop, name: str, begin: float, end: float, place: Alignment, *, first: bool) -> list[Part]:
    """Build the parapets of an approach, which end in blocks away from the bridge."""
    block = (begin, begin + TERMINAL) if first else (end - TERMINAL, end)
    run = (block[1] - EMBEDDED, end) if first else (begin, block[0] + EMBEDDED)
    foot = top.half_width, top.parapet_foot, name
    parts = parapet_parts(top.parapets, DeckEdge(*foot[:2], top.walk_level), name, *run, place)
    return parts + terminal_parts(top.parapets, *foot[:2], (name, *block), place, way=top.walk_level)
