"""What the drone's receiver writes down: the true position, white noise, and a bias that walks slowly."""

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

CORRELATION_TIME = 60.0  # [s] after which the bias has forgotten about two thirds of itself


def measured_positions(
    positions: F64, times: F64, sigma: tuple[float, float, float], drift: float, rng: np.random.Generator
) -> F64:
    """Add the errors of a GPS receiver.

    The bias is a first-order Gauss-Markov process, the usual model of slow GNSS errors; its standard deviation does
    not depend on how many images are taken.

    Args:
        positions: True camera centres [m], shape (N, 3), float64.
        times: Seconds since the first image [s], shape (N,), float64.
        sigma: Standard deviation of the white noise along x, y, z [m].
        drift: Standard deviation of the bias along each axis [m].
        rng: Stream `gps/<id>`.

    Returns:
        Measured positions [m], shape (N, 3), float64.
    """
    count = len(positions)
    white = rng.normal(size=(count, 3)) * np.asarray(sigma)
    steps = rng.normal(size=(count, 3))
    bias = np.zeros((count, 3))
    bias[0] = drift * steps[0]
    memory = np.exp(-np.diff(times) / CORRELATION_TIME)
    for row in range(1, count):
        kept = memory[row - 1]
        bias[row] = kept * bias[row - 1] + drift * np.sqrt(1.0 - kept**2) * steps[row]
    return positions + white + bias
