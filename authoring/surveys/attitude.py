"""Angles recorded by a drone's gimbal: yaw, pitch and roll of the camera, with noise."""

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

UPRIGHT = 1e-9  # sine of the angle to the vertical below which a camera's own right gives its yaw


def attitude_of(rotations: F64) -> F64:
    """Compute yaw, pitch and roll in the convention of drones.

    Args:
        rotations: Camera to world, axes right, down, forward [1], shape (N, 3, 3), float64.

    Returns:
        Yaw clockwise from +y within ±180, pitch above the horizon, roll clockwise [deg], shape (N, 3), float64.
    """
    right, forward = rotations[:, :, 0], rotations[:, :, 2]
    level = np.cross(forward, [0.0, 0.0, 1.0])
    length = np.linalg.norm(level, axis=1, keepdims=True)
    level = np.where(length < UPRIGHT, right, level / np.maximum(length, UPRIGHT))
    down = np.cross(forward, level)
    yaw = np.arctan2(-level[:, 1], level[:, 0])
    pitch = np.arcsin(np.clip(forward[:, 2], -1.0, 1.0))
    roll = np.arctan2(np.sum(right * down, axis=1), np.sum(right * level, axis=1))
    return np.degrees(np.column_stack([yaw, pitch, roll]))


def measured_attitude(rotations: F64, sigma: tuple[float, float, float], rng: np.random.Generator) -> F64:
    """Add the errors of a gimbal's angles: white noise, yaw and roll kept within ±180.

    Args:
        rotations: Camera to world, axes right, down, forward [1], shape (N, 3, 3), float64.
        sigma: Standard deviation of yaw, pitch and roll [deg].
        rng: Stream `attitude/<id>`.

    Returns:
        Measured yaw, pitch and roll [deg], shape (N, 3), float64.
    """
    measured = attitude_of(rotations) + rng.normal(size=(len(rotations), 3)) * np.asarray(sigma)
    measured[:, [0, 2]] = (measured[:, [0, 2]] + 180.0) % 360.0 - 180.0
    return measured
