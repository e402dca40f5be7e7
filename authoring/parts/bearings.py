"""Elastomeric bearing pads on concrete plinths, one pair under each end of each girder."""

from dataclasses import dataclass

from authoring.alignment import Alignment
from authoring.parts.drawing import Draws, draw, drawn
from authoring.parts.part import SUBSTRUCTURE, Part
from authoring.parts.spans import Levels, Spans
from authoring.sections import rectangle
from authoring.sweep import Surface, prism
from groundwork.settings import Settings

PAD_EMBEDDED = 0.002  # [m] into plinth and girder: loaded rubber leaves no gap
PLINTH_EMBEDDED = 0.020  # [m] into the cap, more than the grade lifts a plinth's edge


class BearingSettings(Settings):
    """Pads and plinths; what is left out is drawn."""

    pad_width: float | None = drawn(0.36, 0.44, "Pad across the bridge [m]", ge=0.20, le=0.90)
    pad_length: float | None = drawn(0.28, 0.38, "Pad along the bridge [m]", ge=0.15, le=0.50)
    pad_height: float | None = drawn(0.06, 0.12, "Pad thickness [m]", ge=0.03, le=0.30)
    plinth_margin: float | None = drawn(0.05, 0.10, "From pad to plinth edge [m]", ge=0.02, le=0.15)
    plinth_height: float | None = drawn(0.10, 0.25, "Plinth above cap or seat [m]", ge=0.05, le=0.50)


@dataclass(frozen=True)
class Bearings:
    """One kind of pad and plinth for the whole bridge.

    Attributes:
        pad_width: Across the bridge [m].
        pad_length: Along the bridge [m].
        pad_height: Thickness [m].
        plinth_margin: From the pad to the plinth's edge [m].
        plinth_height: Above cap or seat [m].
    """

    pad_width: float
    pad_length: float
    pad_height: float
    plinth_margin: float
    plinth_height: float

    @property
    def plinth_width(self) -> float:
        """Plinth across the bridge [m]."""
        return self.pad_width + 2.0 * self.plinth_margin

    @property
    def plinth_length(self) -> float:
        """Plinth along the bridge [m]."""
        return self.pad_length + 2.0 * self.plinth_margin


def draw_bearings(settings: BearingSettings, draws: Draws) -> Bearings:
    """Draw pads and plinths.

    Args:
        settings: What the user fixed.
        draws: Random stream and profile of the bridge.
    """
    return Bearings(
        pad_width=draw(settings, "pad_width", draws),
        pad_length=draw(settings, "pad_length", draws),
        pad_height=draw(settings, "pad_height", draws),
        plinth_margin=draw(settings, "plinth_margin", draws),
        plinth_height=draw(settings, "plinth_height", draws),
    )


def bearing_parts(
    bearings: Bearings, lines: tuple[float, ...], spans: Spans, levels: Levels, place: Alignment
) -> list[Part]:
    """Build a pad and a plinth for each girder, span and end.

    Args:
        bearings: Their dimensions.
        lines: Girder lines, distance to the left of the axis [m].
        spans: Stations.
        levels: Levels of the deck.
        place: Axis of the bridge.
    """
    parts = []
    pad_low, pad_high = levels.plinth_top - PAD_EMBEDDED, levels.girder_soffit + PAD_EMBEDDED
    plinth_low, plinth_high = levels.seat - PLINTH_EMBEDDED, levels.plinth_top
    b = bearings
    for span in range(spans.count):
        for end, station in enumerate(spans.bearing_lines(span)):
            for number, line in enumerate(lines):
                where = f"{span:03d}_{end}_{number:02d}"
                facts: dict[str, object] = {"span": span, "support": span + end, "line": number}
                pad = _block(station, line, b.pad_length, b.pad_width, pad_low, pad_high, place, 0.006)
                size = {"width": b.pad_width, "length": b.pad_length, "height": b.pad_height, **facts}
                parts.append(Part(f"Bearing_{where}", "bearing_pad", "Role_BearingRubber", SUBSTRUCTURE, pad, size))
                plinth = _block(station, line, b.plinth_length, b.plinth_width, plinth_low, plinth_high, place, 0.015)
                size = {"width": b.plinth_width, "length": b.plinth_length, "height": b.plinth_height, **facts}
                parts.append(Part(f"Plinth_{where}", "bearing_plinth", "Role_CapConcrete", SUBSTRUCTURE, plinth, size))
    return parts


def _block(
    station: float, line: float, length: float, width: float, low: float, high: float, place: Alignment, chamfer: float
) -> Surface:
    outline = rectangle((station - 0.5 * length, line - 0.5 * width), (station + 0.5 * length, line + 0.5 * width))
    return prism(outline, low, high, "above", place, chamfer)
