"""Rotations of cameras: unit quaternions, the great arc between two of them, and the pitch limit of a gimbal."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

F64 = NDArray[np.float64]

UPRIGHT = 1e-3  # sine of the angle to the vertical below which a camera has no heading


def turn_between(keys: F64, stations: F64, wanted: F64) -> F64:
    """Interpolate rotations along the great arcs between key cameras.

    Args:
        keys: Rotations of the key cameras, camera to world [1], shape (K, 3, 3), float64.
        stations: Position of each key camera along the flight, rising [m], shape (K,), float64.
        wanted: Positions of the cameras along the flight [m], shape (N,), float64, within the first and the last key.

    Returns:
        Rotations [1], shape (N, 3, 3), float64.
    """
    if len(keys) == 1:
        return np.repeat(keys, len(wanted), axis=0)
    return Slerp(stations, Rotation.from_matrix(keys))(np.clip(wanted, stations[0], stations[-1])).as_matrix()


def angle_between(first: F64, second: F64) -> float:
    """Compute the angle between two rotations [rad].

    Args:
        first: A rotation [1], shape (3, 3), float64.
        second: Another [1], shape (3, 3), float64.
    """
    cosine = 0.5 * (float(np.trace(first.T @ second)) - 1.0)
    return float(np.arccos(np.clip(cosine, -1.0, 1.0)))


def pitch_of(rotations: F64) -> F64:
    """Measure the elevation of viewing directions, negative below the horizon.

    Args:
        rotations: Camera to world, axes right, down, forward [1], shape (N, 3, 3), float64.

    Returns:
        Pitch [rad], shape (N,), float64.
    """
    return np.arcsin(np.clip(rotations[:, 2, 2], -1.0, 1.0))


def look_along(directions: F64, right: F64 | None = None) -> F64:
    """Aim cameras without roll.

    Args:
        directions: Viewing directions, of any length [m], shape (N, 3), float64.
        right: Unit directions to the right for cameras that look straight up or down [1], shape (N, 3), float64;
            default: that of the camera before, +x for the first.

    Returns:
        Camera to world, axes right, down, forward [1], shape (N, 3, 3), float64.
    """
    forward = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    level = np.cross(forward, [0.0, 0.0, 1.0])
    length = np.linalg.norm(level, axis=1)
    for row in np.flatnonzero(length < UPRIGHT):
        level[row] = right[row] if right is not None else level[row - 1] if row else (1.0, 0.0, 0.0)
        level[row] -= forward[row] * (level[row] @ forward[row])
    level = level / np.linalg.norm(level, axis=1, keepdims=True)
    return np.stack([level, np.cross(forward, level), forward], axis=2)


def lowered(rotations: F64, highest: float) -> F64:
    """Rotate cameras above a gimbal's upper limit down to it, by the smallest rotation.

    Args:
        rotations: Camera to world, axes right, down, forward [1], shape (N, 3, 3), float64.
        highest: Largest pitch [rad].

    Returns:
        Camera to world [1], shape (N, 3, 3), float64.
    """
    forward = rotations[:, :, 2]
    wanted = limit_pitch(forward, highest)
    axis = np.cross(forward, wanted)
    sine = np.linalg.norm(axis, axis=1)
    angle = np.arctan2(sine, np.sum(forward * wanted, axis=1))
    unit = np.divide(axis, sine[:, None], out=np.zeros_like(axis), where=sine[:, None] > 1e-12)
    return Rotation.from_rotvec(unit * angle[:, None]).as_matrix() @ rotations


def limit_pitch(directions: F64, highest: float) -> F64:
    """Lower the directions above a gimbal's upper limit; the heading is kept.

    Args:
        directions: Viewing directions [m], shape (N, 3), float64.
        highest: Largest pitch [rad].

    Returns:
        Unit directions [1], shape (N, 3), float64.
    """
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    plan = np.linalg.norm(unit[:, :2], axis=1, keepdims=True)
    heading = np.divide(unit[:, :2], plan, out=np.tile([1.0, 0.0], (len(unit), 1)), where=plan > 1e-9)
    lowered = np.column_stack([heading * np.cos(highest), np.full(len(unit), np.sin(highest))])
    return np.where((unit[:, 2] > np.sin(highest))[:, None], lowered, unit)
