"""Views in the order of a flight: legs along which a drone photographs, and transfers between them."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from authoring.surveys.subject import Subject
from authoring.surveys.turning import angle_between, lowered, turn_between
from authoring.surveys.way import is_safe

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]

DECIMALS = 4  # positions are rounded to it [m], so that every CPU places the same cameras
HOP = 6.0  # [m] between two views of a leg; a larger distance begins another leg
SLOW_TURN = 2.0  # [m] length that counts as much as a rotation by one radian
STEADY = np.radians(20.0)  # largest rotation between neighboring images of a leg


def order_views(poses: F64, subject: Subject, safety: float, axis: F64) -> list[I64]:
    """Order views into legs: from each to the nearest one ahead on a straight and safe line.

    Args:
        poses: camera_to_world [m], shape (V, 4, 4), float64.
        subject: Bridge and site.
        safety: Least distance to both [m].
        axis: Direction of the bridge in plan; the flight begins where it does [1], shape (3,), float64.

    Returns:
        Rows of the views of each leg, in order, each of shape (L,), int64.
    """
    places, looks = np.round(poses[:, :3, 3], DECIMALS), poses[:, :3, 2]
    left = np.ones(len(poses), bool)
    at = int(np.argmin(np.round(places @ axis, DECIMALS)))
    legs, leg = [], [at]
    left[at] = False
    while left.any():
        away = np.linalg.norm(places - places[at], axis=1)
        turn = np.arccos(np.clip(np.round(looks @ looks[at], 9), -1.0, 1.0))
        cost = np.where(left, np.round(away + SLOW_TURN * turn, 6), np.inf)
        near = np.flatnonzero(left & (away <= HOP))
        near = near[np.argsort(cost[near], kind="stable")]
        ahead = next((int(row) for row in near if _is_open(places[at], places[row], subject, safety)), None)
        if ahead is None:
            legs.append(np.array(leg, np.int64))
            leg, ahead = [], int(np.argmin(cost))
        leg.append(ahead)
        left[ahead], at = False, ahead
    return [*legs, np.array(leg, np.int64)]


def fly_legs(poses: F64, legs: list[I64], spacing: float, highest: float) -> F64:
    """Photograph along legs: at every view, and in between if two are farther apart than the spacing.

    Args:
        poses: camera_to_world of the views [m], shape (V, 4, 4), float64.
        legs: Rows of the views of each leg, in order, each of shape (L,), int64.
        spacing: Greatest distance between neighboring images of a leg [m].
        highest: Highest pitch of the gimbal [rad].

    Returns:
        camera_to_world of each image [m], shape (N, 4, 4), float64.
    """
    flown = [_fly_leg(poses[leg], spacing) for leg in legs]
    every = np.concatenate(flown)
    every[:, :3, :3] = lowered(every[:, :3, :3], highest)
    every[:, :3, 3] = np.round(every[:, :3, 3], DECIMALS)
    return every


def _is_open(start: F64, end: F64, subject: Subject, safety: float) -> bool:
    return bool(np.allclose(start, end)) or is_safe(np.stack([start, end]), subject, safety)


def _fly_leg(poses: F64, spacing: float) -> F64:
    if len(poses) == 1:
        return poses
    stations = [0.0]
    for first, last in pairwise(poses):
        away = float(np.linalg.norm(last[:3, 3] - first[:3, 3]))
        turn = angle_between(first[:3, :3], last[:3, :3])
        steps = max(1, int(np.ceil(away / spacing - 1e-6)), int(np.ceil(turn / STEADY - 1e-6)))
        stations += (np.floor(stations[-1] + 0.5) + np.arange(1, steps + 1) / steps).tolist()
    at = np.array(stations)
    knots = np.arange(len(poses), dtype=np.float64)
    flown = np.tile(np.eye(4), (len(at), 1, 1))
    flown[:, :3, :3] = turn_between(poses[:, :3, :3], knots, at)
    flown[:, :3, 3] = np.column_stack([np.interp(at, knots, poses[:, row, 3]) for row in range(3)])
    return flown
