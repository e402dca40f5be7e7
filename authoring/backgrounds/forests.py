"""Forests on far hills: a closed canopy as part of the terrain, with edges that rise above the fields."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.backgrounds.terrain import Cell, Terrain, distance_beyond
from authoring.site.covers import Cover
from authoring.site.relief import Relief, draw_relief, smoothstep
from authoring.site.shape import Hills, Land

F64 = NDArray[np.float64]

WOOD = Cover("woodland", "Woodland", "vegetation", "woodland")
CANOPY = 10.0  # height of the canopy above the ground, in the terrain's mesh [m]
EDGE = 26.0  # width on which the canopy rises at its border [m]
ASIDE = 24.0  # distance of forests from rivers and roads [m]
_SCALE = 70.0  # factor from the relief of the stands to an approximate distance from their border [m]


@dataclass(frozen=True, eq=False)
class Forests:
    """Distribution of forests.

    Attributes:
        land: The land.
        inner: Lowest and highest station, lowest and highest left of the site [m].
        stands: Relief of their density [1].
        first: Distance from the site below which there is none [m].
    """

    land: Land
    inner: Cell
    stands: Relief
    first: float

    def field(self, station: F64, left: F64) -> F64:
        """Compute the approximate distance of positions from the border of a forest, inside.

        Args:
            station: Distance along the axis [m], shape (...), float64.
            left: Distance to the left of the axis [m], the same shape (...), float64.

        Returns:
            Depths within, negative outside [m], the same shape (...), float64.
        """
        away = distance_beyond(self.inner, station, left)
        dense = 0.75 * smoothstep(self.first + 200.0, self.first + 1300.0, away) - 0.40
        inside = np.minimum(_SCALE * (self.stands(station, left) + dense), away - self.first)
        crossing = self.land.crossing
        inside = np.minimum(inside, crossing.distance(station, left) - crossing.half_width - ASIDE)
        for approach in self.land.approaches:
            aside = np.abs(left - approach.center(station)) - approach.half_width - ASIDE
            inside = np.minimum(inside, np.where(approach.along(station) > -ASIDE, aside, 1e3))
        return inside

    def over(self, hills: Hills) -> Hills:
        """Add the canopy to hills.

        Args:
            hills: Large-scale height of the land [m].

        Returns:
            The same with the canopy where a forest stands [m].
        """

        def canopy(station: F64, left: F64) -> F64:
            return hills(station, left) + CANOPY * smoothstep(0.0, EDGE, self.field(station, left))

        return canopy

    def cover(self, terrain: Terrain) -> tuple[Cover, F64]:
        """Return the cover of the forests with its signed field at a terrain's nodes [m], shape (S, L)."""
        return WOOD, np.clip(self.field(*terrain.nodes()), -30.0, 30.0)


def draw_forests(land: Land, inner: Cell, first: float, rng: np.random.Generator) -> Forests:
    """Draw the distribution of forests.

    Args:
        land: The land.
        inner: Lowest and highest station, lowest and highest left of the site [m].
        first: Distance from the site below which there is none [m].
        rng: Random stream.

    Returns:
        The forests.
    """
    return Forests(land, inner, draw_relief(((520.0, 1.0), (190.0, 0.45), (75.0, 0.18)), rng), first)
