"""Windows of ten meters along a bridge, determined from its true surface: the same for every cloud of it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usd_schemas.components import UNLABELED

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]

LENGTH = 10.0  # [m] the length of the method's training pieces
BACKGROUND = 0
_PRESENT = 0.1  # [m2] of true surface from which on a class is expected in a window


@dataclass(frozen=True, eq=False)
class Windows:
    """Cuts across a bridge.

    Attributes:
        origin: Horizontal position where they begin [m], shape (2,), float64.
        direction: Horizontal unit vector along the bridge [1], shape (2,), float64.
        count: Number of windows; all have the length `LENGTH` except the last, which has half of that to one and a
            half.
        area: True surface of each class in each [m2], shape (256, count), float64.
    """

    origin: F64
    direction: F64
    count: int
    area: F64

    @property
    def present(self) -> NDArray[np.bool_]:
        """Whether a class has surface in a window, shape (256, count), bool."""
        return self.area >= _PRESENT

    def of(self, points: F64) -> I64:
        """Find the windows of points; points beyond an end belong to the window there.

        Args:
            points: World positions [m], shape (N, 3), float64.

        Returns:
            Window of each, shape (N,), int64.
        """
        along = (points[:, :2] - self.origin) @ self.direction
        return np.clip(np.floor(along / LENGTH), 0, self.count - 1).astype(np.int64)


def lay_windows(corners: F64, classes: U8) -> Windows | None:
    """Cut a bridge along its longer horizontal direction.

    Args:
        corners: Corners of the true triangles [m], shape (T, 3, 3), float64.
        classes: Class id of each, shape (T,), uint8.

    Returns:
        The windows; None without any bridge.
    """
    bridge = (classes != BACKGROUND) & (classes != UNLABELED)
    if not bridge.any():
        return None
    corners, classes = corners[bridge], classes[bridge]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2.0
    if not area.sum() > 0.0:
        return None
    direction = _long_direction(corners[:, :, :2], area)
    along = corners[:, :, :2] @ direction
    first, last = float(along.min()), float(along.max())
    count = max(1, round((last - first) / LENGTH))
    low, high = along.min(axis=1) - first, along.max(axis=1) - first
    found = np.zeros((256, count))
    for window in range(count):
        begin, end = window * LENGTH, np.inf if window == count - 1 else (window + 1) * LENGTH
        inside = np.clip(np.minimum(high, end) - np.maximum(low, begin), 0.0, None)
        share = np.where(high > low, inside / np.maximum(high - low, 1e-12), (low >= begin) & (low < end))
        found[:, window] = np.bincount(classes, area * share, minlength=256)
    return Windows(first * direction, direction, count, found)


def _long_direction(flat: F64, area: F64) -> F64:
    """Find the longer principal axis of triangles (T, 3, 2) by their areas (T,), towards +x, or +y: shape (2,).

    The second moment of a triangle about its centroid is a twelfth of its area times the sum over its corners.
    """
    middle = flat.mean(axis=1)
    away = middle - np.average(middle, axis=0, weights=area)
    inner = flat - middle[:, None]
    moment = np.einsum("t,ti,tj->ij", area, away, away) + np.einsum("t,tci,tcj->ij", area / 12.0, inner, inner)
    axis = np.linalg.eigh(moment)[1][:, 1]
    return axis if tuple(axis) > (0.0, 0.0) else -axis
