"""Positions recorded by a drone's receiver: true position, white noise, a slowly drifting bias, an altitude error."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

CORRELATION_TIME = 60.0  # [s] correlation time of the bias: after it, the correlation is 1/e


@dataclass(frozen=True)
class GpsNoise:
    """Size of a receiver's errors.

    Attributes:
        sigma: Standard deviation of the white noise along x, y, z [m].
        drift: Standard deviation of the slow bias along each axis [m].
        altitude: Standard deviation of the error that all altitudes of a flight share [m].
    """

    sigma: tuple[float, float, float]
    drift: float
    altitude: float = 0.0


def measured_positions(positions: F64, times: F64, noise: GpsNoise, rng: np.random.Generator) -> F64:
    """Add the errors of a GPS receiver.

    The bias is a first-order Gauss-Markov process, the usual model of slow GNSS errors; its standard deviation does
    not depend on how many images are taken.

    Args:
        positions: True camera centers [m], shape (N, 3), float64.
        times: Seconds since the first image [s], shape (N,), float64.
        noise: Size of the errors.
        rng: Stream `gps/<id>`.

    Returns:
        Measured positions [m], shape (N, 3), float64.
    """
    count = len(positions)
    white = rng.normal(size=(count, 3)) * np.asarray(noise.sigma)
    steps = rng.normal(size=(count, 3))
    bias = np.zeros((count, 3))
    bias[0] = noise.drift * steps[0]
    memory = np.exp(-np.diff(times) / CORRELATION_TIME)
    for row in range(1, count):
        kept = memory[row - 1]
        bias[row] = kept * bias[row - 1] + noise.drift * np.sqrt(1.0 - kept**2) * steps[row]
    bias[:, 2] += noise.altitude * rng.normal()
    return positions + white + bias
