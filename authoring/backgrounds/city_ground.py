"""The relief of an imported world, as a height at any place: its triangles on a grid, level beyond its border."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import LinearNDInterpolator
from scipy.ndimage import distance_transform_edt, map_coordinates

from authoring.backgrounds.city_model import CityModel
from authoring.site_relief import smoothstep

F64 = NDArray[np.float64]

CELL = 3.0  # [m]
FADE = 150.0  # [m] over which the relief runs out beyond the world's border


@dataclass(frozen=True, eq=False)
class CityGround:
    """Heights of the ground on a grid.

    Attributes:
        corner: Plan position of the first node [m], shape (2,), float64.
        heights: Height of each node, rows along y [m], shape (H, W), float64.
        beyond: Distance of each node to the world [m], shape (H, W), float64.
    """

    corner: F64
    heights: F64
    beyond: F64

    def height(self, xy: F64) -> F64:
        """Find the height of the ground.

        Args:
            xy: Plan positions in the world's own coordinates [m], shape (..., 2), float64.

        Returns:
            Heights [m], shape (...), float64; that of the nearest border beyond the world.
        """
        return self._between(self.heights, xy)

    def share(self, xy: F64) -> F64:
        """Tell how much of the relief counts: 1 in the world, falling to 0 beyond it.

        Args:
            xy: Plan positions in the world's own coordinates [m], shape (..., 2), float64.

        Returns:
            Shares [1], shape (...), float64.
        """
        far = np.maximum(self.corner - xy, xy - self._end).max(axis=-1)
        return 1.0 - smoothstep(0.0, FADE, self._between(self.beyond, xy) + np.maximum(far, 0.0))

    @property
    def _end(self) -> F64:
        return self.corner + CELL * (np.array(self.heights.shape[::-1]) - 1)

    def _between(self, values: F64, xy: F64) -> F64:
        column, row = np.moveaxis((xy - self.corner) / CELL, -1, 0)
        return map_coordinates(values, [row, column], order=1, mode="nearest")


def city_ground(model: CityModel) -> CityGround:
    """Lay the relief of a world on a grid.

    Args:
        model: The world; without terrain of its own, the feet of its buildings tell where the ground is.
    """
    points = _ground_points(model)
    low, high = model.extent
    x, y = (np.arange(low[k], high[k] + CELL, CELL) for k in (0, 1))
    known = LinearNDInterpolator(points[:, :2], points[:, 2])(*np.meshgrid(x, y))
    outside = np.isnan(known)
    # Ready-made nearest neighbours on the grid, and how far they are.
    distance, nearest = distance_transform_edt(outside, sampling=CELL, return_indices=True)  # pyright: ignore
    return CityGround(low, known[tuple(nearest)], np.asarray(distance, np.float64))


def _ground_points(model: CityModel) -> F64:
    if len(model.terrain):
        points = model.terrain.reshape(-1, 3)
    else:
        points = np.array([[*b.corners[:, :2].mean(axis=0), b.corners[:, 2].min()] for b in model.buildings])
    if len(points) < 4:
        low, high = model.extent + np.array([[-CELL], [CELL]])
        level = float(points[:, 2].mean())
        return np.array([[x, y, level] for x in (low[0], high[0]) for y in (low[1], high[1])])
    return np.unique(np.round(points, 3), axis=0)
