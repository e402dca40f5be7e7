"""Rays of laser scanners: a tripod's sphere, and a rotating fan carried along a path."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.sampling.sampler_settings import MobileSettings, TerrestrialSettings

F64 = NDArray[np.float64]

CHUNK = 250_000  # rays at a time: bounds the memory


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays of a scanner.

    Attributes:
        origins: Positions of the mirror [m], shape (N, 3), float64.
        directions: Unit vectors [1], shape (N, 3), float64.
        errors: Measured minus true position of the mirror [m], shape (N, 3), float64.
        station: Number of the station [1], shape (N,), uint16.
    """

    origins: F64
    directions: F64
    errors: F64
    station: NDArray[np.uint16]


def tripod_rays(positions: F64, settings: TerrestrialSettings, rng: np.random.Generator) -> Iterator[Rays]:
    """Scan from each station: column by column about the vertical, each column from the lowest ray to the highest.

    Args:
        positions: Positions of the mirror [m], shape (S, 3), float64.
        settings: Angles.
        rng: Source of each tripod's initial direction.

    Yields:
        At most `CHUNK` rays at a time.
    """
    step = settings.angular_step
    columns = max(1, round(360.0 / step))
    elevations = np.deg2rad(np.arange(settings.lowest, settings.highest + 0.5 * step, step))
    for number, position in enumerate(positions):
        facing = rng.random() * 2.0 * np.pi
        for first in range(0, columns * len(elevations), CHUNK):
            shot = np.arange(first, min(first + CHUNK, columns * len(elevations)))
            azimuth = facing + 2.0 * np.pi * (shot // len(elevations)) / columns
            elevation = elevations[shot % len(elevations)]
            directions = np.column_stack(
                [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
            )
            origins = np.broadcast_to(position, directions.shape)
            yield Rays(origins, directions, np.zeros_like(directions), np.full(len(shot), number, np.uint16))


def mobile_rays(path: F64, settings: MobileSettings, rng: np.random.Generator) -> Iterator[Rays]:
    """Scan while moving: every ray has its own position on the path.

    Args:
        path: Corners of the path [m], shape (P, 3), float64, no two in a row equal.
        settings: Speed, turns, beams and errors.
        rng: Source of the path's error.

    Yields:
        At most about `CHUNK` rays at a time.
    """
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    per_turn = max(1, round(360.0 / settings.angular_step))
    steps = int(along[-1] / settings.speed * settings.rate * per_turn) + 1
    elevations = np.deg2rad(np.linspace(settings.lowest, settings.highest, settings.beams))
    knots = settings.path_noise * rng.standard_normal((int(along[-1] / settings.path_noise_length) + 2, 3))
    for first in range(0, steps, max(1, CHUNK // settings.beams)):
        step = np.arange(first, min(first + max(1, CHUNK // settings.beams), steps))
        way = step / (per_turn * settings.rate) * settings.speed
        origins = np.column_stack([np.interp(way, along, path[:, axis]) for axis in range(3)])
        frames = _frames(way, along, path, np.deg2rad(settings.tilt))
        angle = 2.0 * np.pi * step / per_turn
        turned = np.cos(angle)[:, None] * frames[:, 0] + np.sin(angle)[:, None] * frames[:, 1]
        directions = (
            np.cos(elevations)[:, None] * turned[:, None] + np.sin(elevations)[:, None] * frames[:, None, 2]
        ).reshape(-1, 3)
        errors = smooth_noise(way / settings.path_noise_length, knots)
        yield Rays(
            np.repeat(origins, settings.beams, axis=0),
            directions,
            np.repeat(errors, settings.beams, axis=0),
            np.zeros(len(directions), np.uint16),
        )


def _frames(way: F64, along: F64, path: F64, tilt: float) -> F64:
    """Compute the scanner's axes: two in its plane of rotation and the axis, in rows, shape (N, 3, 3), float64."""
    piece = np.clip(np.searchsorted(along, way, side="right") - 1, 0, len(path) - 2)
    forward = (path[1:] - path[:-1])[piece] * [1.0, 1.0, 0.0]
    length = np.linalg.norm(forward, axis=1, keepdims=True)
    forward = np.where(length > 1e-9, forward / np.maximum(length, 1e-9), [1.0, 0.0, 0.0])  # vertical path: along x
    up = np.array([0.0, 0.0, 1.0])
    axis = np.cos(tilt) * up - np.sin(tilt) * forward
    ahead = np.cos(tilt) * forward + np.sin(tilt) * up
    return np.stack([ahead, np.cross(axis, ahead), axis], axis=1)


def smooth_noise(at: F64, knots: F64) -> F64:
    """Interpolate independent errors smoothly, with the same variance everywhere.

    Args:
        at: Position on the path, in units of the knot spacing [1], shape (N,), float64.
        knots: An error at each whole position [m], shape (K, 3), float64, K greater than the last position plus one.

    Returns:
        Errors [m], shape (N, 3), float64.
    """
    knot = np.minimum(at.astype(np.int64), len(knots) - 2)
    phase = (at - knot)[:, None] * np.pi / 2.0
    return np.cos(phase) * knots[knot] + np.sin(phase) * knots[knot + 1]
