"""Smooth random relief: octaves of lattice noise, from sums and products only, the same on every platform."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
LATTICE = 64  # a power of two


@dataclass(frozen=True)
class Octave:
    """One layer of noise.

    Attributes:
        wavelength: Distance between lattice nodes [m].
        amplitude: Largest deviation from zero [m].
        nodes: Values from -1 to 1, repeated beyond the lattice [1], shape (LATTICE, LATTICE), float64.
    """

    wavelength: float
    amplitude: float
    nodes: F64


@dataclass(frozen=True)
class Relief:
    """A sum of octaves.

    Attributes:
        octaves: The layers, in any order.
    """

    octaves: tuple[Octave, ...]

    def __call__(self, x: F64, y: F64) -> F64:
        """Evaluate the relief.

        Args:
            x: First plan coordinate [m], any shape, float64.
            y: Second plan coordinate [m], the same shape, float64.

        Returns:
            Heights [m], the same shape, float64.
        """
        total = np.zeros(np.broadcast(x, y).shape)
        for octave in self.octaves:
            total += octave.amplitude * _lattice_noise(octave.nodes, x / octave.wavelength, y / octave.wavelength)
        return total


def draw_relief(layers: tuple[tuple[float, float], ...], rng: np.random.Generator) -> Relief:
    """Draw a relief.

    Args:
        layers: Wavelength [m] and amplitude [m] of each octave.
        rng: Random stream.

    Returns:
        The relief.
    """
    return Relief(tuple(Octave(length, height, rng.uniform(-1, 1, (LATTICE, LATTICE))) for length, height in layers))


def smoothstep(low: float, high: float, value: F64) -> F64:
    """Rise from 0 at `low` to 1 at `high` without a kink.

    Args:
        low: Where the rise begins [any unit].
        high: Where it ends [any unit].
        value: Values [any unit], shape (...), float64.

    Returns:
        From 0 to 1 [1], the same shape (...), float64.
    """
    share = np.clip((value - low) / (high - low), 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)


def smooth_minimum(one: F64, other: F64, width: float) -> F64:
    """Take the lower of two surfaces, rounded where they meet.

    Args:
        one: Heights [m], shape (...), float64.
        other: Heights [m], the same shape (...), float64.
        width: Height difference within which the edge is rounded [m].

    Returns:
        Heights [m], nowhere above the lower of the two, the same shape (...), float64.
    """
    overlap = np.maximum(width - np.abs(one - other), 0.0) / width
    return np.minimum(one, other) - overlap * overlap * width / 4.0


def _lattice_noise(nodes: F64, x: F64, y: F64) -> F64:
    """Interpolate lattice values with a curve whose first two derivatives vanish at the nodes."""
    x, y = np.broadcast_arrays(x, y)
    column, row = np.floor(x), np.floor(y)
    across, along = x - column, y - row
    fade, fade_along = _fade(across), _fade(along)
    left, low = column.astype(np.int64), row.astype(np.int64)
    values, right = nodes.ravel(), ((left + 1) & (LATTICE - 1)) * LATTICE
    left &= LATTICE - 1
    left *= LATTICE
    high = (low + 1) & (LATTICE - 1)
    low &= LATTICE - 1
    below = values.take(left + low)
    below += fade * (values.take(right + low) - below)
    above = values.take(left + high)
    above += fade * (values.take(right + high) - above)
    above -= below
    above *= fade_along
    return below + above


def _fade(share: F64) -> F64:
    """Rise from 0 to 1 with two derivatives that vanish at both ends, same shape, float64."""
    curve = share * 6.0
    curve -= 15.0
    curve *= share
    curve += 10.0
    return share * share * share * curve
