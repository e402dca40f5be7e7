"""Which point of which surface each texel of an atlas shows."""

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]

_GUTTER = 8  # [px] so far colours grow over the edge of a chart, for filtered look-ups
_TINY = 1e-12


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
        """Tell how much of the first UV set one texel shows, on average [m].

        Args:
            number: Owner.
        """
        on_surface, on_atlas = self._areas.get(number, (0.0, 1.0))
        return float(np.sqrt(on_surface / on_atlas))

    @property
    def shared(self) -> float:
        """Share of the drawn texels that more than one mesh claims [1]."""
        return self._twice / max(int((self.owner >= 0).sum()), 1)

    def draw(self, charts: F32, st: F32, number: int) -> None:
        """Draw the triangles of one mesh.

        Args:
            charts: Corners on the atlas [1], shape (T, 3, 2), float32, v upwards.
            st: First UV set of the corners [m], shape (T, 3, 2), float32.
            number: Owner.
        """
        texels = len(self.owner)
        pixels = np.stack([charts[..., 0] * texels, (1 - charts[..., 1]) * texels], axis=-1).astype(np.float64)
        former = self._areas.get(number, (0.0, 1e-12))
        self._areas[number] = (former[0] + _area(st.astype(np.float64)), former[1] + _area(pixels))
        for corners, values in zip(pixels, st.astype(np.float64), strict=True):
            self._triangle(corners, values, number)
        self._meshes += 1

    def fill_gutters(self, image: F32) -> F32:
        """Let colours grow over the edges of their charts; what is far from all of them gets their mean.

        Args:
            image: Colours of the drawn texels [1], shape (H, H, 3), float32.

        Returns:
            Colours everywhere [1], shape (H, H, 3), float32.
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

    def _triangle(self, corners: NDArray[np.float64], values: NDArray[np.float64], number: int) -> None:
        texels = len(self.owner)
        low = np.clip(np.floor(corners.min(axis=0) - 0.5), 0, texels - 1).astype(int)
        high = np.clip(np.ceil(corners.max(axis=0) + 0.5), 1, texels).astype(int)
        one, two = corners[1] - corners[0], corners[2] - corners[0]
        area = one[0] * two[1] - one[1] * two[0]
        if abs(area) < _TINY or (high <= low).any():
            return
        x = np.arange(low[0], high[0]) + 0.5 - corners[0, 0]
        y = (np.arange(low[1], high[1]) + 0.5 - corners[0, 1])[:, None]
        second = (x * two[1] - y * two[0]) / area
        third = (one[0] * y - one[1] * x) / area
        inside = (second >= 0) & (third >= 0) & (second + third <= 1)
        rows, columns = np.nonzero(inside)
        weights = np.stack([1 - second[inside] - third[inside], second[inside], third[inside]], axis=-1)
        rows, columns = rows + low[1], columns + low[0]
        if not len(rows):  # thinner than a texel: it has the one that it lies in, where nobody else is
            middle = np.clip(corners.mean(axis=0).astype(int), 0, texels - 1)
            if self.owner[middle[1], middle[0]] >= 0:
                return
            rows, columns, weights = middle[1:], middle[:1], np.full((1, 3), 1 / 3)
        former = self._mesh[rows, columns]
        self._twice += int(((former >= 0) & (former != self._meshes)).sum())
        self._mesh[rows, columns] = self._meshes
        self.owner[rows, columns] = number
        self.st[rows, columns] = weights @ values


def _area(triangles: NDArray[np.float64]) -> float:
    one, two = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return float(np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]).sum() / 2)
