"""Where the cameras of a flight look."""

import numpy as np
from numpy.typing import NDArray

from usd_schemas.pinhole import look_at

F64 = NDArray[np.float64]


def points_of_interest(offsets: F64, shares: tuple[float, float, float]) -> F64:
    """Scale positions about the centre of a box: each camera's counterpart on a smaller box.

    Source: Shi, Kim, Narazaki: Development of large-scale synthetic 3D point cloud datasets for vision-based bridge
    structural condition assessment, global scenario: half the size along each side. For long bridges the share along
    the axis is greater, so that cameras look across the bridge and not along it.

    Args:
        offsets: Positions in the axes of the box, from its centre [m], shape (N, 3), float64.
        shares: Size of the inner box along each axis [1].

    Returns:
        Points of interest in the same frame [m], shape (N, 3), float64.
    """
    return offsets * np.asarray(shares)


def aim(positions: F64, targets: F64) -> F64:
    """Aim every camera at its point of interest, without roll and without a pitch limit.

    Args:
        positions: Camera centres [m], shape (N, 3), float64.
        targets: Points of interest [m], shape (N, 3), float64.

    Returns:
        camera_to_world, shape (N, 4, 4), float64.
    """
    return np.stack([look_at(position, target) for position, target in zip(positions, targets, strict=True)])
