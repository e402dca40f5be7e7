"""Which point of which surface each texel of a baked atlas shows: against triangles that are drawn one by one."""

import numpy as np
import pytest
from numpy.typing import NDArray

from authoring.exchange import texel_cover
from authoring.exchange.atlas_raster import AtlasRaster

TEXELS = 32


class _OneByOne:
    """The same rules, a texel at a time."""

    def __init__(self) -> None:
        self.owner = np.full((TEXELS, TEXELS), -1)
        self.mesh = np.full((TEXELS, TEXELS), -1)
        self.st = np.zeros((TEXELS, TEXELS, 2), np.float32)
        self.twice = 0

    def draw(self, charts: NDArray[np.float32], st: NDArray[np.float32], number: int, mesh: int) -> None:
        for chart, values in zip(charts.astype(np.float64), st.astype(np.float64), strict=True):
            corners = np.stack([chart[:, 0], 1 - chart[:, 1]], axis=-1) * TEXELS
            system = np.vstack([corners.T, np.ones(3)])
            whole, weigh = False, np.linalg.inv(system) if abs(np.linalg.det(system)) > 1e-12 else np.full((3, 3), -1.0)
            for row in range(TEXELS):
                for column in range(TEXELS):
                    weights = weigh @ [column + 0.5, row + 0.5, 1.0]
                    if (weights >= 0).all():
                        whole = True
                        self.twice += bool(self.mesh[row, column] not in (-1, mesh))
                        self._set(row, column, weights @ values, number, mesh)
            column, row = np.clip(corners.mean(axis=0).astype(int), 0, TEXELS - 1)
            if not whole and self.owner[row, column] < 0:
                self._set(row, column, values.mean(axis=0), number, mesh)

    def _set(self, row: int, column: int, st: NDArray[np.float64], number: int, mesh: int) -> None:
        self.owner[row, column], self.mesh[row, column], self.st[row, column] = number, mesh, st


@pytest.mark.parametrize("at_once", [1, 700, 2_000_000])
def test_texels_are_those_of_triangles_drawn_one_by_one(monkeypatch: pytest.MonkeyPatch, at_once: int) -> None:
    """Large, small, thin and overlapping triangles of three meshes, however many are looked at together."""
    monkeypatch.setattr(texel_cover, "_AT_ONCE", at_once)
    chance = np.random.default_rng(5)
    raster, plain = AtlasRaster(TEXELS), _OneByOne()
    for mesh, number in enumerate((4, 2, 4)):
        middle = chance.uniform(0.1, 0.9, (14, 1, 2))
        size = 10 ** chance.uniform(-2.3, -0.4, (14, 1, 1))
        charts = (middle + size * chance.normal(0, 1, (14, 3, 2))).astype(np.float32)
        charts[7] = charts[6] + np.float32(1e-4)  # two thin ones in one texel
        st = chance.uniform(-5, 5, (14, 3, 2)).astype(np.float32)
        raster.draw(charts, st, number)
        plain.draw(charts, st, number, mesh)
    assert (raster.owner == plain.owner).all()
    assert np.allclose(raster.st, plain.st, atol=1e-4)
    assert plain.twice > 20
    assert raster.shared == plain.twice / (plain.owner >= 0).sum()
