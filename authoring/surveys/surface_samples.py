"""Points distributed evenly over the surface of every component of a bridge."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

FEWEST, MOST = 100, 400  # samples of one component
DENSITY = 4.0  # samples per square meter in between
_STEP = (0.7548776662466927, 0.5698402909980532)  # the plastic number's powers: an even (R2) sequence


@dataclass(frozen=True, eq=False)
class SurfaceSamples:
    """Samples of surfaces.

    Attributes:
        points: World positions [m], shape (N, 3), float64.
        normals: Outward unit normals [1], shape (N, 3), float64.
        areas: Area that each sample represents [m²], shape (N,), float64.
        component: Row in `ids` of each sample, shape (N,), int64.
        ids: Instance ids, ascending, shape (K,), int64.
    """

    points: F64
    normals: F64
    areas: F64
    component: I64
    ids: I64

    def of(self, row: int) -> "SurfaceSamples":
        """Keep the samples of one component.

        Args:
            row: Its row in `ids`.
        """
        own = self.component == row
        none = np.zeros(int(own.sum()), np.int64)
        return SurfaceSamples(self.points[own], self.normals[own], self.areas[own], none, self.ids[row : row + 1])


def sample_surfaces(
    triangles: F64,
    owners: NDArray[np.integer],
    density: float = DENSITY,
    limits: tuple[int, int] = (FEWEST, MOST),
) -> SurfaceSamples:
    """Spread samples over every component, evenly by area.

    Source: M. Roberts, The Unreasonable Effectiveness of Quasirandom Sequences, 2018 (the R2 sequence).

    Args:
        triangles: Corners, counter-clockwise from outside [m], shape (T, 3, 3), float64.
        owners: Instance id of each triangle, shape (T,), int.
        density: Samples per square meter [1/m²].
        limits: Fewest and most samples of one component.
    """
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = 0.5 * np.linalg.norm(cross, axis=1)
    ids = np.unique(owners).astype(np.int64)
    order = np.argsort(owners, kind="stable")
    borders = np.searchsorted(owners[order], [*ids, ids[-1] + 1])
    points, normals, areas, component = [], [], [], []
    for row in range(len(ids)):
        own = order[borders[row] : borders[row + 1]]
        total = np.cumsum(area[own])
        count = int(np.clip(density * total[-1], *limits))
        at = (np.arange(count) + 0.5) / count * total[-1]
        chosen = own[np.minimum(np.searchsorted(total, at), len(own) - 1)]
        u, v = ((0.5 + np.arange(1, count + 1) * step) % 1.0 for step in _STEP)
        fold = u + v > 1.0
        u, v = np.where(fold, 1.0 - u, u), np.where(fold, 1.0 - v, v)
        a, b, c = np.moveaxis(triangles[chosen], 1, 0)
        points.append(a + u[:, None] * (b - a) + v[:, None] * (c - a))
        normals.append(cross[chosen] / (2.0 * area[chosen])[:, None])
        areas.append(np.full(count, total[-1] / count))
        component.append(np.full(count, row))
    places, units = np.concatenate(points), np.concatenate(normals)
    return SurfaceSamples(places, units, np.concatenate(areas), np.concatenate(component), ids)
