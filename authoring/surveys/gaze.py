"""Where the cameras of a flight look."""

import numpy as np
from numpy.typing import NDArray

from usd_schemas.pinhole import look_at

F64 = NDArray[np.float64]

END_PULL = 10.0  # [m] by which a camera at the end of a long bridge looks inwards
ACROSS, UPWARDS = 0.4, 0.3  # sizes of the box that cameras beside a long bridge look at [1]


def inner_box(offsets: F64) -> F64:
    """Aim each camera at its counterpart on a box of half the size, as the paper does.

    Source: Shi, Kim, Narazaki: Development of large-scale synthetic 3D point cloud datasets for vision-based bridge
    structural condition assessment, global scenario.

    Args:
        offsets: Camera centres in the axes of the box, from its centre [m], shape (N, 3), float64.

    Returns:
        Points of interest in the same frame [m], shape (N, 3), float64.
    """
    return offsets * 0.5


def along_axis(offsets: F64) -> F64:
    """Aim cameras across a long bridge: at the stretch of the axis beside them, drawn inwards towards the ends.

    With the inner box alone, most views of a long bridge run along it. The pull grows with the square of the distance
    from the middle, so that views are square to the bridge for most of its length and turn evenly round its ends.

    Args:
        offsets: Camera centres in the axes of the box, from its centre [m], shape (N, 3), float64.

    Returns:
        Points of interest in the same frame [m], shape (N, 3), float64.
    """
    share = offsets[:, 0] / np.abs(offsets[:, 0]).max()
    along = offsets[:, 0] - END_PULL * share * np.abs(share)
    return np.column_stack([along, offsets[:, 1] * ACROSS, offsets[:, 2] * UPWARDS])


def aim(positions: F64, targets: F64) -> F64:
    """Aim every camera at its point of interest, without roll and without a pitch limit.

    Args:
        positions: Camera centres [m], shape (N, 3), float64.
        targets: Points of interest [m], shape (N, 3), float64.

    Returns:
        camera_to_world, shape (N, 4, 4), float64.
    """
    return np.stack([look_at(position, target) for position, target in zip(positions, targets, strict=True)])
