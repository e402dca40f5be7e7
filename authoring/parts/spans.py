"""Where spans begin and end along the axis, and the levels of a deck on girders."""

from dataclasses import dataclass

from authoring.alignment import Alignment

ABUTMENT_BACK = 1.2  # [m] from the bearing line to the abutment's back face: where the approach begins


@dataclass(frozen=True)
class Spans:
    """Simply supported spans: stations of what happens at their ends.

    Attributes:
        supports: Stations of the abutments' bearing lines and the piers' axes [m].
        overhang: From a bearing line to the end of girder and slab [m].
        gap: Expansion gap between two decks, and between deck and backwall [m].
    """

    supports: tuple[float, ...]
    overhang: float
    gap: float

    @property
    def count(self) -> int:
        """Number of spans."""
        return len(self.supports) - 1

    def ends(self, span: int) -> tuple[float, float]:
        """Find where the concrete of a span begins and ends [m].

        Args:
            span: Number of the span.
        """
        low, high = self.bearing_lines(span)
        return low - self.overhang, high + self.overhang

    def bearing_lines(self, span: int) -> tuple[float, float]:
        """Find the stations of a span's two rows of bearings [m].

        Args:
            span: Number of the span.
        """
        setback = self.row_setback
        low = self.supports[span] + (setback if span > 0 else 0.0)
        high = self.supports[span + 1] - (setback if span + 1 < self.count else 0.0)
        return low, high

    @property
    def row_setback(self) -> float:
        """From a pier's axis to either of its two rows of bearings [m]."""
        return self.overhang + 0.5 * self.gap

    def joint(self, support: int) -> float:
        """Find the middle of the expansion gap at a support [m].

        Args:
            support: Number of the support.
        """
        if support == 0:
            return self.supports[0] - self.row_setback
        if support == self.count:
            return self.supports[-1] + self.row_setback
        return self.supports[support]

    @property
    def backwall(self) -> float:
        """From an abutment's bearing line back to the front of its backwall [m]."""
        return self.overhang + self.gap


@dataclass(frozen=True)
class Levels:
    """Thicknesses from the finished deck surface down to the seats; heights count from the finished surface.

    Attributes:
        surfacing: Asphalt [m].
        slab: Deck slab [m].
        girder: Depth of a girder below the slab [m].
        pad: Bearing pad [m].
        plinth: Plinth above cap or seat [m].
    """

    surfacing: float
    slab: float
    girder: float
    pad: float
    plinth: float

    @property
    def soffit(self) -> float:
        """Underside of the deck slab [m]."""
        return -self.surfacing - self.slab

    @property
    def girder_soffit(self) -> float:
        """Underside of the girders [m]."""
        return self.soffit - self.girder

    @property
    def plinth_top(self) -> float:
        """Where pads stand [m]."""
        return self.girder_soffit - self.pad

    @property
    def seat(self) -> float:
        """Top of pier caps and abutment seats [m]."""
        return self.plinth_top - self.plinth


def level_at(alignment: Alignment, station: float) -> Alignment:
    """Take the grade out of an alignment around one support: caps and walls are built level.

    Args:
        alignment: Axis of the bridge.
        station: Station whose height is kept [m].
    """
    return Alignment(alignment.level + alignment.grade * station, 0.0, alignment.heading)
