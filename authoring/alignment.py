"""The axis of a bridge: where a station lies in space, and which way left and up are there."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]


@dataclass(frozen=True)
class Alignment:
    """A straight axis with a constant grade; stations count from the first abutment's bearing line.

    Attributes:
        level: Height of the finished deck surface on the axis at station 0 [m].
        grade: Rise per metre of station [1].
        heading: Direction of the axis in plan, counter-clockwise from +x [rad].
    """

    level: float
    grade: float = 0.0
    heading: float = 0.0

    def point(self, station: F64, left: F64, above: F64) -> F64:
        """Find world positions from bridge coordinates.

        Args:
            station: Distance along the axis in plan [m], shape (N,), float64.
            left: Distance to the left of the axis [m], shape (N,), float64.
            above: Height above the finished deck surface on the axis [m], shape (N,), float64.

        Returns:
            World positions [m], shape (N, 3), float64.
        """
        cosine, sine = np.cos(self.heading), np.sin(self.heading)
        return np.stack(
            [station * cosine - left * sine, station * sine + left * cosine, self.level + self.grade * station + above],
            axis=-1,
        )

    def locate(self, points: F64) -> tuple[F64, F64]:
        """Find the station and the distance to the left of world positions.

        Args:
            points: World positions [m], shape (N, 2) or (N, 3), float64.

        Returns:
            Stations [m], shape (N,), and distances to the left [m], shape (N,), float64.
        """
        cosine, sine = np.cos(self.heading), np.sin(self.heading)
        x, y = points[..., 0], points[..., 1]
        return x * cosine + y * sine, y * cosine - x * sine


@dataclass(frozen=True)
class Layout:
    """What the site has to know of a bridge before it exists.

    Attributes:
        alignment: Axis of the bridge and its approaches.
        supports: Stations of the bearing lines, abutments first and last [m].
        width: Overall deck width [m].
        depth: From the finished deck surface down to the bearing seats [m].
        service: `road` or `rail`.
        carriageway: Width of the asphalt from kerb to kerb [m]; 0 when not known.
        edge_line: From the axis to the middle of the road's edge lines [m]; 0 when not known.
    """

    alignment: Alignment
    supports: tuple[float, ...]
    width: float
    depth: float
    service: str = "road"
    carriageway: float = 0.0
    edge_line: float = 0.0
