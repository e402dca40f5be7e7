"""Terrain beyond the site: the strip's own grid lines go on outwards, so that both share every vertex of the joint."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.component import Mesh
from authoring.site import Site
from authoring.site_covers import Cover, Soup, covered, drape, soup_of
from authoring.site_grid import HeightField, growing_steps, surface_normals
from authoring.site_land import FIRST_STEP
from authoring.site_relief import Relief, smoothstep
from authoring.site_shape import Hills, Land, Shape

F64 = NDArray[np.float64]
WIDEST_STEP = 30.0  # largest spacing of grid lines [m]
INVERSIONS = 8  # rounds that find grid coordinates of a place; each shrinks the error at least threefold


@dataclass(frozen=True, eq=False)
class Terrain:
    """Ground all round a site, on a tensor grid whose outer lines bend with the river and the roads.

    Attributes:
        land: The land.
        field: Heights over grid coordinates; in its middle lies the site.
        inner: Lowest and highest station and left of the site [m].
    """

    land: Land
    field: HeightField
    inner: tuple[float, float, float, float]

    def height(self, station: F64, left: F64) -> F64:
        """Find ground heights, exact along the site, the river and the roads, within a few centimetres elsewhere.

        Args:
            station: Distance along the axis [m], shape (N,), float64.
            left: Distance to the left of the axis [m], shape (N,), float64.

        Returns:
            World heights [m], shape (N,), float64.
        """
        column, row = station.copy(), left.copy()
        for _ in range(INVERSIONS):
            shift, aside = _bend(self.land, self.inner, column, row)
            column, row = station - shift, left - aside
        return self.field(column, row)


def grow_terrain(site: Site, hills: Hills, reach: float) -> tuple[Terrain, F64, NDArray[np.int64]]:
    """Extend the site's grid outwards.

    Args:
        site: The site.
        hills: Height of the land at large; 0 within `FIRST_STEP` of the site.
        reach: Distance of the terrain's border from the site's [m].

    Returns:
        The terrain; its nodes in bridge coordinates [m], shape (V, 3), float64; and the triangles outside the
        site, shape (T, 3), int64.
    """
    lines = [_outward(line, reach) for line in (site.field.stations, site.field.lefts)]
    inner = (*site.field.stations[[0, -1]].tolist(), *site.field.lefts[[0, -1]].tolist())
    column, row = np.meshgrid(*lines, indexing="ij")
    shift, aside = _bend(site.land, inner, column, row)
    station, left = column + shift, row + aside
    height = np.round(site.land.shape(station, left, hills).height, 4)
    rows, columns = ((len(line) - len(own)) // 2 for line, own in zip(lines, site.field_lines, strict=True))
    height[rows:-rows, columns:-columns] = site.field.heights
    field = HeightField(lines[0], lines[1], height)
    outside = np.ones((len(lines[0]) - 1, len(lines[1]) - 1), bool)
    outside[rows:-rows, columns:-columns] = False
    nodes = np.stack([station, left, height], axis=-1).reshape(-1, 3)
    return Terrain(site.land, field, inner), nodes, field.triangles()[np.repeat(outside.reshape(-1), 2)]
