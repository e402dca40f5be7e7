"""Use of the land beside a bridge by plots: fields with rows, hay, pasture, yards of a town."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from authoring.axis.alignment import Layout
from authoring.site.relief import Relief, draw_relief
from authoring.streams import weighted_choice

F64 = NDArray[np.float64]

LandUse = Literal["fields", "common", "town"]
DRAWN_LAND = {"fields": 0.7, "common": 0.3}
# Covers to draw from, an empty one being grass.
USES: dict[str, tuple[str, ...]] = {
    "fields": ("ploughed", "crop", "ripe", "ripe", "crop", "hay", ""),
    "common": ("hay", "hay", "hay", ""),
    "town": ("lot_asphalt", "lot_paved", "lot_gravel", "lot_gravel", "", ""),
}
BORDER = 4.0  # from the site's border to a field [m]
BALK = 1.1  # half the width of grass between two fields [m]
VERGE = 6.0  # from the top of a fill, or from the deck's edge, to a field [m]
BEHIND_FENCE = 0.5  # from a fence to what is tilled [m]
CLEAR = 8.0  # from the deck's edge to a field beside the bridge [m]
TOE = 2.5  # from the toe of a fill to a field [m]
ASIDE = 37.0  # second coordinate of the bend of the border on the positive side; any length far from 0 [m]
_BEND = ((40.0, 1.2), (13.0, 0.4))  # wavelengths and amplitudes of borders [m]
_FAR = -9.0


@dataclass(frozen=True)
class Plots:
    """Eight plots: before and behind the crossing, right and left of the bridge, near to it and farther away.

    Attributes:
        land: How the land is used.
        covers: Name of the cover of each plot, empty for grass.
        splits: Distance from the axis of the border between a near plot and a far one, right and left [m].
        bounds: Lowest and highest station, largest distance from the axis [m].
        aside: From the edge of the crossing to a plot [m].
        bends: How far borders swing to either side [m].
    """

    land: str
    covers: tuple[str, ...]
    splits: tuple[float, float]
    bounds: tuple[float, float, float]
    aside: float
    bends: Relief

    def bend(self, along: F64, side: F64) -> F64:
        """Compute how far a border lies from its straight line, never towards what it keeps clear of.

        Args:
            along: Distance along the border [m], shape (...), float64.
            side: `ASIDE` or its negative [m], the same shape (...), float64.

        Returns:
            Distances, not negative [m], the same shape (...), float64.
        """
        return sum(height for _, height in _BEND) + self.bends(along, side)

    def shift(self, station: F64, left: F64) -> F64:
        """Compute how far the border between a near plot and a far one lies beyond `splits`.

        Args:
            station: Distance along the axis [m], shape (...), float64.
            left: Distance to the left of the axis, whose sign counts [m], the same shape (...), float64.

        Returns:
            Distances, not negative [m], the same shape (...), float64.
        """
        return self.bend(station, np.where(left > 0.0, ASIDE, -ASIDE))

    def _split(self, station: F64, left: F64) -> F64:
        return np.where(left > 0.0, self.splits[1], self.splits[0]) + self.shift(station, left)

    def within(self, station: F64, left: F64) -> F64:
        """Compute the distance of positions to the outer border of the plots, positive inside.

        Args:
            station: Distance along the axis [m], shape (...), float64.
            left: Distance to the left of the axis [m], the same shape (...), float64.

        Returns:
            Distances, negative outside [m], the same shape (...), float64.
        """
        low, high, wide = self.bounds
        return np.minimum(np.minimum(station - low, high - station), wide - np.abs(left)) - BORDER

    def split_room(self, station: F64, left: F64) -> F64:
        """Compute the distance of positions to the balk between a near plot and a far one, negative on it.

        Args:
            station: Distance along the axis [m], shape (...), float64.
            left: Distance to the left of the axis [m], the same shape (...), float64.

        Returns:
            Distances [m], the same shape (...), float64.
        """
        return np.abs(np.abs(left) - self._split(station, left)) - BALK

    def number(self, behind: NDArray[np.bool_], station: F64, left: F64) -> NDArray[np.int64]:
        """Number the plots.

        Args:
            behind: Whether places lie behind the crossing, shape (N,), bool.
            station: Distance along the axis [m], shape (N,), float64.
            left: Distance to the left of the axis [m], shape (N,), float64.

        Returns:
            Rows of `covers`, shape (N,), int64.
        """
        return 4 * behind + 2 * (left > 0.0) + (np.abs(left) > self._split(station, left))

    def fields(self, behind: NDArray[np.bool_], station: F64, left: F64, room: F64) -> dict[str, F64]:
        """Evaluate the cover of each use.

        Args:
            behind: Whether places lie behind the crossing, shape (...), bool.
            station: Distance along the axis [m], the same shape (...), float64.
            left: Distance to the left of the axis [m], the same shape (...), float64.
            room: Distance to the plot's border, positive inside [m], the same shape (...), float64.

        Returns:
            Signed fields [m], the same shape (...), float64.
        """
        number = self.number(behind, station, left)
        found = {}
        for name in sorted({name for name in self.covers if name}):
            mine = np.isin(number, [row for row, other in enumerate(self.covers) if other == name])
            found[name] = np.where(mine, np.clip(room, _FAR, 6.0), np.minimum(np.clip(-room, _FAR, 0.0), -0.3))
        return found


def draw_plots(
    land: LandUse | None, kind: str, layout: Layout, reach: tuple[float, float], rng: np.random.Generator
) -> Plots:
    """Draw the plots of a site.

    Args:
        land: How the land is used; None: drawn, a town beside a harbour.
        kind: Kind of the crossing.
        layout: The bridge.
        reach: Extent of the site beyond the abutments, and to either side of the axis [m].
        rng: Random stream.

    Returns:
        The plots.
    """
    drawn = "town" if kind == "harbour" else weighted_choice(DRAWN_LAND, rng.random())
    use = land or drawn
    names = tuple(str(name) for name in rng.choice(USES[use], 8))
    half = layout.width / 2
    near = half + 0.42 * (reach[1] - half)
    splits = (near + float(rng.uniform(-6.0, 6.0)), near + float(rng.uniform(-6.0, 6.0)))
    ends = (layout.supports[0] - reach[0], layout.supports[-1] + reach[0])
    aside = 9.0 if kind in ("river", "harbour", "valley") else 7.0
    return Plots(use, names, splits, (*ends, reach[1]), aside, draw_relief(_BEND, rng))
