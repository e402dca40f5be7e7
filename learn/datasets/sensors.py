"""Augmentation that imitates another sensor or another flight."""

import numpy as np
from numpy.typing import NDArray

from learn.datasets.patch import Patch
from learn.datasets.settings import SensorSettings

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
Bools = NDArray[np.bool_]

_LEAST = 0.2  # least share of the points that a change keeps; one that would keep fewer is skipped
_EYE = 1.5  # [m] height of a tripod above the ground
_FULL = (0.1, 0.6)  # share of the points that are near enough to the scanner to be all kept
_HOLES = 3  # largest number of holes in a sample
_HOLE = (0.03, 0.15)  # radius of a hole over the width of the piece [1]


def other_sensor(patch: Patch, settings: SensorSettings, rng: np.random.Generator) -> tuple[Patch, F64]:
    """Remove points and color from a piece, and tilt its vertical, at random.

    Args:
        patch: A piece, at least one point.
        settings: Probability and size of the changes.
        rng: Source of randomness.

    Returns:
        The piece with the remaining points; rotation for column vectors that tilts its vertical [1], shape
        (3, 3), float64.
    """
    kept = np.ones(len(patch), bool)
    for share, change in ((settings.range, _in_range), (settings.gaps, _no_hole), (settings.half, _one_side)):
        wanted = rng.random() < share
        left = kept & change(patch.coord, rng)
        if wanted and left.sum() >= max(1.0, _LEAST * len(patch)):
            kept = left
    inputs = {name: values[kept] for name, values in patch.inputs.items()}
    if rng.random() < settings.colorless and "color" in inputs:
        inputs["color"] = np.zeros_like(inputs["color"])
    changed = Patch(patch.coord[kept], inputs, patch.labels[kept], patch.uncertainty[kept], patch.origin, patch.seed)
    return changed, _lean(np.deg2rad(rng.normal(0.0, 1.0) * settings.tilt), rng.uniform(0.0, 2.0 * np.pi))


def _in_range(coord: F32, rng: np.random.Generator) -> Bools:
    """Keep the points that a scanner at a random place sees: all near ones, then fewer by the squared distance."""
    low, high = coord.min(axis=0), coord.max(axis=0)
    place = np.array([*rng.uniform(low[:2], high[:2]), _EYE])
    apart = np.linalg.norm(coord - place, axis=1)
    near = np.quantile(apart, rng.uniform(*_FULL))
    return rng.random(len(coord)) < np.square(near / np.maximum(apart, 1e-6))


def _no_hole(coord: F32, rng: np.random.Generator) -> Bools:
    """Remove vertical cylinders about a few random points."""
    kept = np.ones(len(coord), bool)
    width = float(np.ptp(coord[:, :2], axis=0).max())
    for _ in range(rng.integers(1, _HOLES + 1)):
        middle, radius = coord[rng.integers(len(coord)), :2], width * rng.uniform(*_HOLE)
        kept &= np.linalg.norm(coord[:, :2] - middle, axis=1) > radius
    return kept


def _one_side(coord: F32, rng: np.random.Generator) -> Bools:
    """Keep one side of a vertical plane through a random point: half a bridge, or the end of a scan."""
    angle, middle = rng.uniform(0.0, 2.0 * np.pi), coord[rng.integers(len(coord)), :2]
    return (coord[:, :2] - middle) @ np.array([np.cos(angle), np.sin(angle)]) >= 0.0


def _lean(angle: float, direction: float) -> F64:
    """Rotate about a horizontal axis in `direction` [rad]."""
    axis = np.array([np.cos(direction), np.sin(direction), 0.0])
    cross = np.array([[0.0, 0.0, axis[1]], [0.0, 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
