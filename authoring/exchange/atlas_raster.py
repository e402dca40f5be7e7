"""The surface point of each texel of an atlas."""

import numpy as np
from numpy.typing import NDArray

from authoring.exchange.texel_cover import Cover, covers

F32 = NDArray[np.float32]

_GUTTER = 8  # [px] margin by which colors are extended beyond the edge of a chart, for filtered look-ups


class AtlasRaster:
    """Triangles drawn into an atlas: owner and first UV set of each texel.

    Attributes:
        owner: Number that was given with the triangle, -1 where there is none, shape (H, H), int16.
        st: First UV set [m], shape (H, H, 2), float32.
    """

    def __init__(self, texels: int) -> None:
        """Start empty.

        Args:
            texels: Texels along a side [px].
        """
        self.owner = np.full((texels, texels), -1, np.int16)
        self.st = np.zeros((texels, texels, 2), np.float32)
        self._mesh = np.full((texels, texels), -1, np.int32)
        self._meshes = 0
        self._twice = 0
        self._areas: dict[int, tuple[float, float]] = {}

    def footprint(self, number: int) -> float:
        """Compute the mean size of a texel in the first UV set [m].

        Args:
            number: Owner.
        """
        on_surface, on_atlas = self._areas.get(number, (0.0, 1.0))
        return float(np.sqrt(on_surface / on_atlas))

    @property
    def shared(self) -> float:
        """Share of the drawn texels that belong to more than one mesh [1]."""
        return self._twice / max(int((self.owner >= 0).sum()), 1)

    def draw(self, charts: F32, st: F32, number: int) -> None:
        """Draw the triangles of one mesh, later ones over earlier ones.

        A triangle thinner than a texel gets the texel that contains it, if that is empty.

        Args:
            charts: Corners on the atlas [1], shape (T, 3, 2), float32, v upwards.
            st: First UV set of the corners [m], shape (T, 3, 2), float32.
            number: Owner.
        """
        texels = len(self.owner)
        pixels = np.stack([charts[..., 0] * texels, (1 - charts[..., 1]) * texels], axis=-1).astype(np.float64)
        former = self._areas.get(number, (0.0, 1e-12))
        self._areas[number] = (former[0] + _area(st.astype(np.float64)), former[1] + _area(pixels))
        for cover in covers(pixels, texels):
            self._take(cover, st.astype(np.float64), number)
        self._meshes += 1

    def fill_gutters(self, image: F32) -> F32:
        """Extend colors over the edges of their charts; texels far from all charts get the mean.

        Args:
            image: Colors of the drawn texels [1], shape (H, H, 3), float32.

        Returns:
            Colors everywhere [1], shape (H, H, 3), float32.
        """
        import cv2

        known = self.owner >= 0
        filled = image.copy()
        if known.any():
            filled[~known] = image[known].mean(axis=0)
        kernel = np.ones((3, 3), np.float32)
        mask = known.astype(np.float32)
        colors = image * mask[..., None]
        for _ in range(_GUTTER):
            weight = cv2.filter2D(mask, -1, kernel)
            grown = (weight > 0) & (mask == 0)
            total = cv2.filter2D(colors, -1, kernel)
            colors[grown] = total[grown] / weight[grown][:, None]
            mask[grown] = 1
        filled[mask > 0] = colors[mask > 0]
        return filled

    def _take(self, cover: Cover, st: NDArray[np.float64], number: int) -> None:
        owner, mesh = self.owner.reshape(-1), self._mesh.reshape(-1)
        claimed = np.unique(cover.texel[~cover.thin])
        self._twice += int(((mesh[claimed] >= 0) & (mesh[claimed] != self._meshes)).sum())
        whole, thin = np.flatnonzero(~cover.thin), np.flatnonzero(cover.thin)
        whole = whole[_lasts(cover.texel[whole])]
        where = cover.texel[thin]
        thin = thin[(owner[where] < 0) & ~np.isin(where, claimed)]
        thin = thin[np.unique(cover.texel[thin], return_index=True)[1]]
        rows = np.concatenate([whole, thin])
        taken = cover.texel[rows]
        mesh[taken], owner[taken] = self._meshes, number
        self.st.reshape(-1, 2)[taken] = (cover.weights[rows][:, None, :] @ st[cover.triangle[rows]])[:, 0]


def _lasts(values: NDArray[np.int64]) -> NDArray[np.int64]:
    """Find the last position of each value."""
    return len(values) - 1 - np.unique(values[::-1], return_index=True)[1]


def _area(triangles: NDArray[np.float64]) -> float:
    one, two = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return float(np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]).sum() / 2)
