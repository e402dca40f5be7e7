"""Positions of spans along the axis, and the levels of a deck on girders."""

from dataclasses import dataclass

from authoring.axis.alignment import Alignment


@dataclass(frozen=True)
class Spans:
    """Spans in a row: stations of supports, ends and joints.

    Attributes:
        supports: Stations of the abutments' bearing lines and the piers' axes [m].
        overhang: From a bearing line to the end of girder and slab [m].
        gap: Expansion gap between two decks, and between deck and backwall [m].
        continuous: Whether the deck is continuous over the piers, with expansion joints only at the abutments.
        one_row: Whether each pier has one row of bearings, on its axis, because the members are continuous as well.
    """

    supports: tuple[float, ...]
    overhang: float
    gap: float
    continuous: bool = False
    one_row: bool = False

    @property
    def count(self) -> int:
        """Number of spans."""
        return len(self.supports) - 1

    def ends(self, span: int) -> tuple[float, float]:
        """Find where the members of a span begin and end [m]; on the pier's axis if they are continuous.

        Args:
            span: Number of the span.
        """
        low, high = self.bearing_lines(span)
        through = (self.one_row and span > 0, self.one_row and span + 1 < self.count)
        return low - (0.0 if through[0] else self.overhang), high + (0.0 if through[1] else self.overhang)

    @property
    def pieces(self) -> list[tuple[float, float]]:
        """Stations from and to [m] of every piece of deck: one for each span, or a single continuous one."""
        if self.continuous:
            return [(self.ends(0)[0], self.ends(self.count - 1)[1])]
        return [self.ends(span) for span in range(self.count)]

    @property
    def rows(self) -> list[tuple[int, int, float]]:
        """Rows of bearings: the span, which of its ends (0 or 1), and the station [m]."""
        every = [(span, end, self.bearing_lines(span)[end]) for span in range(self.count) for end in (0, 1)]
        return [row for row in every if not self.one_row or row[0] == 0 or row[1] == 1]

    def bearing_lines(self, span: int) -> tuple[float, float]:
        """Find the stations of a span's two rows of bearings [m].

        Args:
            span: Number of the span.
        """
        setback = self.pier_setback
        low = self.supports[span] + (setback if span > 0 else 0.0)
        high = self.supports[span + 1] - (setback if span + 1 < self.count else 0.0)
        return low, high

    @property
    def row_setback(self) -> float:
        """From a joint to the row of bearings beside it [m]."""
        return self.overhang + 0.5 * self.gap

    @property
    def pier_setback(self) -> float:
        """From a pier's axis to either of its two rows of bearings [m]; 0 if it has only one."""
        return 0.0 if self.one_row else self.row_setback

    @property
    def joints(self) -> list[tuple[int, float]]:
        """Expansion joints: the support and the middle of the gap [m]."""
        return [(k, self.joint(k)) for k in range(self.count + 1) if not self.continuous or k in (0, self.count)]

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
        """Level of the pads' underside [m]."""
        return self.girder_soffit - self.pad

    @property
    def seat(self) -> float:
        """Top of pier caps and abutment seats [m]."""
        return self.plinth_top - self.plinth


def level_at(alignment: Alignment, station: float) -> Alignment:
    """Remove curve and grade from an alignment around one support: caps and walls are built straight.

    `left` runs along the support line, skewed like the supports, and lines of girders meet it at the same points as on
    the bridge; a crossfall is kept, so that caps slope under a superelevated road. Members with right angles there
    (columns, pads, posts) are built in `alignment.frame_at(station, left, turn=-alignment.skew)`.

    Args:
        alignment: Axis of the bridge.
        station: Station whose height is kept [m].
    """
    return alignment.straight_at(station)
