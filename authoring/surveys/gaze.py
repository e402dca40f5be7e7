"""Viewing directions of the cameras of a flight."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from usd_schemas.pinhole import look_at

F64 = NDArray[np.float64]

END_PULL = 10.0  # [m] shift inwards of the view of a camera at the end of a long bridge
STEADINESS = 1.5  # [images] over which the gaze is smoothed
RISE = 4.0  # [m] above the bearings below which cameras turn to them
PULL = 0.6  # share of the turn towards a bearing line [1]
ACROSS, UPWARDS = 0.4, 0.3  # sizes of the box that cameras beside a long bridge look at [1]


def inner_box(offsets: F64) -> F64:
    """Aim each camera at its counterpart on a box of half the size, as the paper does.

    Source: Shi, Kim, Narazaki: Development of large-scale synthetic 3D point cloud datasets for vision-based bridge
    structural condition assessment, global scenario.

    Args:
        offsets: Camera centers in the axes of the box, from its center [m], shape (N, 3), float64.

    Returns:
        Points of interest in the same frame [m], shape (N, 3), float64.
    """
    return offsets * 0.5


def along_axis(offsets: F64) -> F64:
    """Aim cameras across a long bridge: at the stretch of the axis beside them, drawn inwards towards the ends.

    With the inner box alone, most views of a long bridge are along it. The shift inwards grows with the square of the
    distance from the middle, so that views are perpendicular to the bridge for most of its length and rotate evenly
    around its ends.

    Args:
        offsets: Camera centers in the axes of the box, from its center [m], shape (N, 3), float64.

    Returns:
        Points of interest in the same frame [m], shape (N, 3), float64.
    """
    share = offsets[:, 0] / np.abs(offsets[:, 0]).max()
    along = offsets[:, 0] - END_PULL * share * np.abs(share)
    return np.column_stack([along, offsets[:, 1] * ACROSS, offsets[:, 2] * UPWARDS])


def drawn_to_lines(offsets: F64, targets: F64, lines: F64, steadiness: float = STEADINESS) -> F64:
    """Turn low cameras back to the bearing line that they passed last, which a perpendicular view does not show.

    On the other side of the bridge the flight passes the lines the other way, so that each is seen from both of its
    sides, and no camera has to swing from the line behind to the line ahead.

    Args:
        offsets: Camera centers of a closed flight in the axes of the box [m], shape (N, 3), float64.
        targets: Points of interest without the turn [m], shape (N, 3), float64.
        lines: Distance along the box and height of each line, in order [m], shape (L, 2), float64.
        steadiness: Standard deviation of the smoothing of the gaze, in images [1].

    Returns:
        Points of interest [m], shape (N, 3), float64.
    """
    if len(lines) < 2:
        return targets
    along = offsets[:, 0]
    forwards = np.roll(along, -1) - np.roll(along, 1) > 0
    bay = np.searchsorted(lines[:, 0], along, side="right")  # the number of lines that lie before the camera
    passed = lines[np.clip(np.where(forwards, bay - 1, bay), 0, len(lines) - 1)]
    inside = (bay > 0) & (bay < len(lines))
    low = np.clip((passed[:, 1] + RISE - offsets[:, 2]) / RISE, 0.0, 1.0) * inside
    aimed = np.column_stack([passed[:, 0], targets[:, 1], passed[:, 1]])
    turned = targets + PULL * low[:, None] * (aimed - targets)
    return gaussian_filter1d(turned, steadiness, axis=0, mode="wrap")


def aim(positions: F64, targets: F64) -> F64:
    """Aim every camera at its point of interest, without roll and without a pitch limit.

    Args:
        positions: Camera centers [m], shape (N, 3), float64.
        targets: Points of interest [m], shape (N, 3), float64.

    Returns:
        camera_to_world [m], shape (N, 4, 4), float64.
    """
    return np.stack([look_at(position, target) for position, target in zip(positions, targets, strict=True)])
