"""Loose triangles, each with its own corners."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]


@dataclass(frozen=True)
class Soup:
    """Triangles with attributes at their corners.

    Attributes:
        corners: Positions [stage units], shape (T, 3, 3), float64.
        normals: Unit normals [1], shape (T, 3, 3), float64.
        carried: Texture coordinates and colors [1], shape (T, 3, K), float64; they stay with a corner when it moves.
        alike: Whether both sides are lit alike.
    """

    corners: F64
    normals: F64
    carried: F64
    alike: bool = False

    def __len__(self) -> int:
        """Count the triangles."""
        return len(self.corners)
