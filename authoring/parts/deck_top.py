"""Everything that lies and stands on a deck, whatever carries the deck: the road, and the parapets along its edges."""

from dataclasses import dataclass

from authoring.alignment import Alignment
from authoring.parts.abutments import Abutments, approach_range
from authoring.parts.drawing import Draws
from authoring.parts.parapets import LEDGE, Parapets, ParapetSettings, draw_parapets, parapet_parts
from authoring.parts.part import Part
from authoring.parts.roadway import Roadway, RoadwaySettings, draw_roadway, kerb_parts, surfacing_parts
from authoring.parts.spans import Spans
from groundwork.settings import Settings

_KERB_SHORTER, _PARAPET_SHORTER = 0.008, 0.004  # [m] than the slab, so that no two end faces lie in one plane

Runs = list[tuple[str, tuple[float, float]]]


class DeckTopSettings(Settings):
    """What lies on a deck; what is left out is drawn."""

    roadway: RoadwaySettings = RoadwaySettings()
    parapet: ParapetSettings = ParapetSettings()


@dataclass(frozen=True)
class DeckTop:
    """What lies on a deck.

    Attributes:
        service: `road`.
        roadway: Cross-section of the road.
        parapets: Section of the parapets.
    """

    service: str
    roadway: Roadway
    parapets: Parapets

    @property
    def width(self) -> float:
        """Overall deck width [m]."""
        return 2.0 * (self.roadway.half_width + self.parapets.thickness + LEDGE)

    @property
    def surfacing(self) -> float:
        """From the finished surface down to the structural deck [m]."""
        return self.roadway.surfacing

    @property
    def carriageway(self) -> float:
        """Width of the asphalt from kerb to kerb [m]."""
        return 2.0 * self.roadway.kerb_face

    @property
    def edge_line(self) -> float:
        """From the axis to the middle of the edge lines [m]."""
        return 0.5 * self.roadway.lanes * self.roadway.lane_width


def draw_deck_top(settings: DeckTopSettings, draws: Draws) -> DeckTop:
    """Draw what lies on a deck.

    Args:
        settings: What the user fixed.
        draws: Random stream and profile of the bridge.
    """
    return DeckTop("road", draw_roadway(settings.roadway, draws), draw_parapets(settings.parapet, draws))


def deck_runs(spans: Spans, abutments: Abutments) -> Runs:
    """List the runs of deck that kerbs and parapets follow: each span, and the approach at either end.

    Args:
        spans: Stations of the decks' ends.
        abutments: Their wing walls carry the approaches' edges.

    Returns:
        Ending of the names, and stations from and to [m], of every run.
    """
    runs: Runs = [(f"{span:03d}", spans.ends(span)) for span in range(spans.count)]
    ends = enumerate((0, spans.count))
    return runs + [(f"Approach_{number}", approach_range(abutments, spans, support)) for number, support in ends]


def deck_top_parts(top: DeckTop, spans: Spans, runs: Runs, place: Alignment) -> list[Part]:
    """Build what lies and stands on a deck.

    Args:
        top: What lies on it.
        spans: Stations; the joints lie at their supports.
        runs: What `deck_runs` lists.
        place: Axis of the bridge.
    """
    parts = surfacing_parts(top.roadway, spans, place)
    for name, (low, high) in runs:
        parts += kerb_parts(top.roadway, name, low + _KERB_SHORTER, high - _KERB_SHORTER, place)
        begin, end = low + _PARAPET_SHORTER, high - _PARAPET_SHORTER
        parts += parapet_parts(top.parapets, top.roadway.half_width, -top.surfacing, name, begin, end, place)
    return parts
