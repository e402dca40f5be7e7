"""The relief of an imported world, as a height at any place: its triangles on a grid, level beyond its border."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import LinearNDInterpolator
from scipy.ndimage import distance_transform_edt, map_coordinates, minimum_filter

from authoring.imported.mesh_ground import lowest
from authoring.imported.model import CityModel
from authoring.site.relief import smoothstep

F64 = NDArray[np.float64]

CELL = 3.0  # [m]
AROUND = 30.0  # [m] radius of the ground that `CityGround.floor` uses
MOST_POINTS = 20_000  # of a relief that is triangulated point by point
COARSE = 12.0  # [m] spacing of the points that bridge the gaps of a denser one
FADE = 150.0  # [m] over which the relief fades out beyond the world's border


@dataclass(frozen=True, eq=False)
class CityGround:
    """Heights of the ground on a grid.

    Attributes:
        corner: Plan position of the first node [m], shape (2,), float64.
        heights: Height of each node, rows along y [m], shape (H, W), float64.
        beyond: Distance of each node to the world, negative inside [m], shape (H, W), float64.
        lowest: Lowest height around each node [m], shape (H, W), float64.
    """

    corner: F64
    heights: F64
    beyond: F64
    lowest: F64

    def height(self, xy: F64) -> F64:
        """Find the height of the ground.

        Args:
            xy: Plan positions in the world's own coordinates [m], shape (..., 2), float64.

        Returns:
            Heights [m], shape (...), float64; that of the nearest border beyond the world.
        """
        return self._between(self.heights, xy)

    def floor(self, xy: F64) -> F64:
        """Find a height below all ground nearby, for surfaces that must stay below it.

        Args:
            xy: Plan positions in the world's own coordinates [m], shape (..., 2), float64.

        Returns:
            Heights [m], shape (...), float64.
        """
        return self._between(self.lowest, xy)

    def beyond_at(self, xy: F64) -> F64:
        """Measure the distance to the world.

        Args:
            xy: Plan positions in the world's own coordinates [m], shape (..., 2), float64.

        Returns:
            Distances, negative inside [m], shape (...), float64.
        """
        far = np.maximum(self.corner - xy, xy - self._end).max(axis=-1)
        return self._between(self.beyond, xy) + np.maximum(far, 0.0)

    def share(self, xy: F64) -> F64:
        """Compute the weight of the relief: 1 in the world, falling to 0 beyond it.

        Args:
            xy: Plan positions in the world's own coordinates [m], shape (..., 2), float64.

        Returns:
            Shares [1], shape (...), float64.
        """
        return 1.0 - smoothstep(0.0, FADE, self.beyond_at(xy))

    @property
    def _end(self) -> F64:
        return self.corner + CELL * (np.array(self.heights.shape[::-1]) - 1)

    def _between(self, values: F64, xy: F64) -> F64:
        column, row = np.moveaxis((xy - self.corner) / CELL, -1, 0)
        return map_coordinates(values, [row, column], order=1, mode="nearest")


def city_ground(model: CityModel) -> CityGround:
    """Sample the terrain of a world on a grid.

    Args:
        model: The world; without terrain of its own, the bases of its buildings define the ground.
    """
    points = _ground_points(model)
    low, high = model.extent
    x, y = (np.arange(low[k], high[k] + CELL, CELL) for k in (0, 1))
    dense = len(points) > MOST_POINTS
    if dense:  # triangles smaller than the cells: the lowest is used, and only gaps such as houses are bridged
        points = _thinned(points)
    known = LinearNDInterpolator(points[:, :2], points[:, 2])(*np.meshgrid(x, y))
    if dense:
        seen = lowest(model.ground, low - 0.5 * CELL, CELL, (len(x), len(y)))
        known = np.where(np.isfinite(seen), seen, known)
    outside = np.isnan(known)
    # Ready-made nearest neighbors on the grid, and how far they are.
    distance, nearest = distance_transform_edt(outside, sampling=CELL, return_indices=True)  # pyright: ignore
    # The world ends within the grid: the grid's border counts as its end too.
    inside = np.asarray(distance_transform_edt(np.pad(~outside, 1), sampling=CELL), np.float64)[1:-1, 1:-1]
    heights = known[tuple(nearest)]
    around = 2 * int(AROUND / CELL) + 1
    return CityGround(
        low, heights, np.asarray(distance, np.float64) - inside, minimum_filter(heights, size=around, mode="nearest")
    )


def _ground_points(model: CityModel) -> F64:
    if len(model.ground):
        points = model.ground.reshape(-1, 3)
    else:
        feet = [b.corners for b in model.buildings] + [piece.triangles.reshape(-1, 3) for piece in model.textured]
        points = np.array([[*corners[:, :2].mean(axis=0), corners[:, 2].min()] for corners in feet])
    if len(points) < 4:
        low, high = model.extent + np.array([[-CELL], [CELL]])
        level = float(points[:, 2].mean())
        return np.array([[x, y, level] for x in (low[0], high[0]) for y in (low[1], high[1])])
    return np.unique(np.round(points, 3), axis=0)


def _thinned(points: F64) -> F64:
    _, chosen = np.unique(np.floor(points[:, :2] / COARSE).astype(np.int64), axis=0, return_index=True)
    return points[chosen]
