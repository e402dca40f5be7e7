"""The cross-section of a railway: rails at gauge on sleepers, on ballast or on a track slab.

Heights count from the top of the rails. Source: rail 60E1 of EN 13674-1, gauge by EN 15273.
"""

from dataclasses import dataclass

import numpy as np

from authoring.shapes.component import F64
from authoring.shapes.sections import mirrored, rectangle

GAUGE = 1.435  # [m] between the rails' inner faces, 14 mm below their top
CLEARANCE = 2.20  # [m] from a track's axis to anything above rail level: half of the clear width of German main lines
APPROACH_TRACK = 6.0  # [m] behind an abutment's back face: there the bridge's track ends and the site's begins
CLOSEST_PITCH, WIDEST_PITCH = 0.60, 0.65  # [m] between sleepers
SEATED = 0.003  # [m] depth of the rail foot in the sleeper
BALLAST_BELOW = 0.045  # [m] ballast below the sleepers' top


@dataclass(frozen=True)
class TrackSection:
    """Cross-section of one or two tracks; all tracks are alike.

    Attributes:
        lines: From the deck's axis to each track's axis, to the left [m], rising.
        gauge: Between the rails' inner faces [m].
        rail_height: Foot to top [m].
        rail_foot: Width of the foot [m].
        rail_head: Width of the head [m].
        bed: `ballast` or `slab`.
        sleeper: `concrete` or `timber`.
        sleeper_length: Across the track [m].
        sleeper_width: Along the track [m].
        sleeper_height: [m].
        pitch: Distance between sleepers, before it is adjusted to a whole number of sleepers [m].
        bed_depth: Ballast under the sleepers, or thickness of the track slab [m].
        shoulder: Ballast or track slab beyond the sleepers' ends [m].
        embedded: Sleepers in the track slab [m].
        plain: Rectangular rails without fastenings.
    """

    lines: tuple[float, ...]
    gauge: float
    rail_height: float
    rail_foot: float
    rail_head: float
    bed: str
    sleeper: str
    sleeper_length: float
    sleeper_width: float
    sleeper_height: float
    pitch: float
    bed_depth: float
    shoulder: float
    embedded: float
    plain: bool = False

    @property
    def sleeper_top(self) -> float:
        """Top of the sleepers under the rails [m]."""
        return SEATED - self.rail_height

    @property
    def bed_top(self) -> float:
        """Top of the ballast or of the track slab [m]."""
        if self.bed == "ballast":
            return self.sleeper_top - BALLAST_BELOW
        return self.sleeper_top - self.sleeper_height + self.embedded

    @property
    def formation(self) -> float:
        """Level of the formation, below ballast or track slab [m]."""
        if self.bed == "ballast":
            return round(self.sleeper_top - self.sleeper_height - self.bed_depth, 3)
        return round(self.bed_top - self.bed_depth, 3)

    @property
    def crown(self) -> float:
        """From the deck's axis to the edge of the ballast's level top, or of the outer track slab [m]."""
        return self.lines[-1] + 0.5 * self.sleeper_length + self.shoulder

    @property
    def rails(self) -> tuple[float, ...]:
        """From the deck's axis to the middle of each rail, to the left [m], rising."""
        half = 0.5 * (self.gauge + self.rail_head)
        return tuple(line + side * half for line in self.lines for side in (-1.0, 1.0))

    def rail_outline(self, left: float) -> F64:
        """Draw a rail, its top at height 0.

        Args:
            left: Middle of the rail [m].

        Returns:
            Outline (left, above) [m], shape (P, 2), float64.
        """
        foot, head, height = 0.5 * self.rail_foot, 0.5 * self.rail_head, self.rail_height
        if self.plain:
            return rectangle((left - head, -height), (left + head, 0.0))
        web = 0.00825
        half = [
            (foot, 0.0),
            (foot, 0.0115),
            (web, 0.034),
            (web, height - 0.046),
            (head, height - 0.032),
            (head, height - 0.012),
            (head - 0.009, height - 0.0015),
            (0.010, height),
        ]
        return mirrored(half) + np.array([left, -height])

    def sleepers(self, low: float, high: float) -> F64:
        """Spread sleepers evenly over a stretch of track.

        Args:
            low: Where the stretch begins, half a pitch before the first sleeper [m].
            high: Where it ends, half a pitch behind the last [m].

        Returns:
            Stations of their middles [m], shape (N,), float64.
        """
        length = high - low
        count = max(round(length / self.pitch), 1)
        if not self.plain:  # a whole number that keeps the pitch in its range, if the stretch is long enough
            count = min(max(count, int(np.ceil(length / WIDEST_PITCH - 1e-9))), max(int(length / CLOSEST_PITCH), 1))
        return low + (np.arange(count) + 0.5) * length / count
