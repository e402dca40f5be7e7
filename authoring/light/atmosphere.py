"""The clear sky: sunlight scattered once by air and haze, and an estimate of multiple scattering.

The earth is a sphere, so that the evening sky, the glow above a sun that has just set and the shadow of the earth
result from the model. Light scattered along a line of sight is computed separately from the phase functions, which
depend only on the angle to the sun: it varies slowly, so that a coarse grid of directions is enough.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

_EARTH, _TOP = 6.36e6, 6.0e4  # radius, and height above which the air is ignored [m]
_EYE = 30.0  # [m] height of the observer above the ground
_RAYLEIGH = np.array([5.802e-6, 13.558e-6, 33.1e-6])  # scattering by air at the ground [1/m]
_OZONE = np.array([1.9e-6, 1.881e-6, 0.15e-6])  # absorption at its densest height, in the bands of `sun` [1/m]
_AIR_HEIGHT, _HAZE_HEIGHT = 8.0e3, 1.25e3  # [m] over which air and haze decrease to 1/e
_OZONE_MIDDLE, _OZONE_REACH = 2.5e4, 1.5e4  # [m]
_WAVES = np.array([0.610, 0.550, 0.465])  # [um] that represent red, green and blue, as in `sun`
_BRIGHT_HAZE = 0.93  # share of the haze's extinction that is scattering [1]
_FORWARD = 0.76  # mean cosine of scattering by haze [1]
_SUN = 128.0  # [klx] above the air
_GROUND = 0.2  # albedo of the ground that lights the air from below [1]
_LOWEST_SUN = np.sin(np.radians(-4.0))  # with a lower sun, the colors of the sky do not change
_STEPS = 36  # along a line of sight
_TABLE = (40, 96)  # heights and cosines of the tables
_ELEVATIONS, _AZIMUTHS = 56, 37  # directions of the grid, denser towards the horizon


@dataclass(frozen=True)
class _Air:
    """Haze of the air for a turbidity."""

    haze: F64  # extinction by haze at the ground [1/m]

    def scattering(self, height: F64) -> tuple[F64, F64]:
        """Compute scattering by air and by haze at heights [m]: [1/m], each of shape (..., 3)."""
        air = np.exp(-np.maximum(height, 0) / _AIR_HEIGHT)[..., None] * _RAYLEIGH
        return air, _BRIGHT_HAZE * np.exp(-np.maximum(height, 0) / _HAZE_HEIGHT)[..., None] * self.haze

    def extinction(self, height: F64) -> F64:
        """Compute extinction at heights [m]: [1/m], shape (..., 3)."""
        air, haze = self.scattering(height)
        ozone = np.maximum(1 - np.abs(height - _OZONE_MIDDLE) / _OZONE_REACH, 0)[..., None] * _OZONE
        return air + haze / _BRIGHT_HAZE + ozone


def scattered_sky(directions: F64, sun: F64, turbidity: float) -> F64:
    """Find the radiance of a cloudless sky.

    Source: Nishita, Sirai, Tadamura and Nakamae, Display of the earth taking into account atmospheric scattering,
    SIGGRAPH 1993 (single scattering); Hillaire, A scalable and production ready sky and atmosphere rendering technique,
    Computer Graphics Forum 39, 2020 (light that is scattered again; coefficients of air and ozone); Henyey and
    Greenstein 1941 (haze); haze by turbidity as in `sun_illuminance`.

    Args:
        directions: Unit vectors, world axes [1], shape (..., 3), float64; below the horizon counts as on it.
        sun: Unit vector towards the sun [1], shape (3,), float64.
        turbidity: Linke's turbidity [1].

    Returns:
        Linear sRGB [kcd/m2], shape (..., 3), float64.
    """
    depth = np.maximum(0.04608 * turbidity - 0.04586, 0.0)
    air = _Air(depth * _WAVES**-1.3 / _HAZE_HEIGHT)
    height = max(float(sun[2]), float(_LOWEST_SUN))
    elevation = (np.arange(_ELEVATIONS) / (_ELEVATIONS - 1)) ** 2 * np.pi / 2
    azimuth = np.arange(_AZIMUTHS) / (_AZIMUTHS - 1) * np.pi
    parts = _sight(air, np.maximum(np.sin(elevation), 1e-3)[:, None], np.cos(azimuth)[None], height)
    up = np.clip(directions[..., 2], 0, 1)
    level = np.maximum(np.hypot(directions[..., 0], directions[..., 1]), 1e-9)
    along = np.hypot(sun[0], sun[1])
    turn = (directions[..., 0] * sun[0] + directions[..., 1] * sun[1]) / (level * along) if along > 1e-9 else 0 * up
    row = np.sqrt(np.arcsin(up) / (np.pi / 2)) * (_ELEVATIONS - 1)
    column = np.arccos(np.clip(turn, -1, 1)) / np.pi * (_AZIMUTHS - 1)
    by_air, by_haze, again = (_between(part, row, column) for part in parts)
    cosine = np.clip(directions @ sun, -1, 1)[..., None]
    rayleigh = 3 / (16 * np.pi) * (1 + cosine**2)
    forward = (1 - _FORWARD**2) / (4 * np.pi * (1 + _FORWARD**2 - 2 * _FORWARD * cosine) ** 1.5)
    return np.maximum(_SUN * (rayleigh * by_air + forward * by_haze + again), 1e-4)


def _sight(air: _Air, up: F64, turn: F64, sun_height: float) -> tuple[F64, F64, F64]:
    """Compute the light at the eye: scattered once by air and by haze, without phase functions; and multiply scattered.

    Args:
        air: The air.
        up: Sines of elevations [1], shape (E, 1).
        turn: Cosines of azimuths from the sun's [1], shape (1, A).
        sun_height: Sine of the sun's elevation [1].

    Returns:
        Three shares of the sun's light [1/sr], each of shape (E, A, 3).
    """
    towards = up * sun_height + np.sqrt(1 - up**2) * np.sqrt(1 - sun_height**2) * turn
    through, again = _tables(air)
    start = _EARTH + _EYE
    reach = -start * up + np.sqrt((start * up) ** 2 + (_EARTH + _TOP) ** 2 - start**2)
    sums = [np.zeros((*towards.shape, 3)) for _ in range(3)]
    left, before = np.ones((*towards.shape, 3)), 0.0
    for step in range(_STEPS):
        after = ((step + 1) / _STEPS) ** 2
        middle, length = reach * (before + after) / 2, reach * (after - before)
        radius = np.sqrt(start**2 + middle**2 + 2 * start * middle * up)
        height = np.broadcast_to(radius - _EARTH, towards.shape)
        cosine = (start * sun_height + middle * towards) / radius
        loss = np.exp(-air.extinction(height) * length[..., None])
        passed = left * (1 - loss) / np.maximum(air.extinction(height), 1e-12)
        seen, more = _table_at(through, height, cosine), _table_at(again, height, cosine)
        by_air, by_haze = air.scattering(height)
        for total, part in zip(sums, (by_air * seen, by_haze * seen, (by_air + by_haze) * more), strict=True):
            total += part * passed
        left, before = left * loss, after
    return sums[0], sums[1], sums[2]


def _tables(air: _Air) -> tuple[F64, F64]:
    """Tabulate transmittance and multiple scattering by height and the cosine of the sun's zenith angle.

    Returns:
        Transmittance [1] and, isotropic, the light scattered twice or more [1/sr], both of shape (*_TABLE, 3).
    """
    height = ((np.arange(_TABLE[0]) / (_TABLE[0] - 1)) ** 2 * _TOP)[:, None]
    cosine = np.linspace(-1, 1, _TABLE[1])[None, :]
    cosine = np.sign(cosine) * cosine**2  # denser near the horizon
    through = _passed(air, height, cosine)
    rays = 8
    ups = np.polynomial.legendre.leggauss(rays)
    second, share = np.zeros(through.shape), np.zeros((_TABLE[0], 1, 3))
    for up, weight in zip(*ups, strict=True):  # the sun's azimuth is averaged by two rays at right angles to it
        radius = _EARTH + height
        down = radius * up
        ground = down**2 - radius**2 + _EARTH**2
        hits = (up < 0) & (ground > 0)
        reach = -down + np.sqrt(down**2 + (_EARTH + _TOP) ** 2 - radius**2)
        reach = np.where(hits, -down - np.sqrt(np.maximum(ground, 0)), reach)
        left, before = np.ones((_TABLE[0], 1, 3)), 0.0
        for step in range(12):
            after = ((step + 1) / 12) ** 2
            middle, length = reach * (before + after) / 2, reach * (after - before)
            there = np.sqrt(radius**2 + middle**2 + 2 * radius * middle * up)
            loss = np.exp(-air.extinction(there - _EARTH) * length[..., None])
            passed = left * (1 - loss) / np.maximum(air.extinction(there - _EARTH), 1e-12)
            scattered = sum(air.scattering(there - _EARTH))
            turned = np.clip((radius * cosine + middle * up * cosine) / there, -1, 1)
            heights = np.broadcast_to(there - _EARTH, turned.shape)
            second += 0.5 * weight * scattered * passed * _table_at(through, heights, turned) / (4 * np.pi)
            share += 0.5 * weight * scattered * passed
            left, before = left * loss, after
        flat = np.maximum(cosine, 0)[..., None] * _table_at(through, np.zeros(cosine.shape), cosine)
        second += np.where(hits[..., None], 0.5 * weight * left * _GROUND / np.pi * flat, 0.0)
    return through, second / np.maximum(1 - share, 0.1)


def _passed(air: _Air, height: F64, cosine: F64) -> F64:
    """Compute the share of the sun's light that arrives at heights [m] from cosines of zenith angles [1]."""
    radius = _EARTH + height
    reach = -radius * cosine + np.sqrt((radius * cosine) ** 2 + (_EARTH + _TOP) ** 2 - radius**2)
    depth, before = np.zeros((*np.broadcast_shapes(height.shape, cosine.shape), 3)), 0.0
    for step in range(60):
        after = ((step + 1) / 60) ** 2
        middle, length = reach * (before + after) / 2, reach * (after - before)
        there = np.sqrt(radius**2 + middle**2 + 2 * radius * middle * cosine) - _EARTH
        depth += air.extinction(there) * length[..., None]
        before = after
    nearest = np.where(cosine < 0, radius * np.sqrt(1 - cosine**2), radius) - _EARTH
    rim = np.clip((nearest + 3e4 * 0.0046) / (2 * 3e4 * 0.0046) + 0.5, 0, 1)  # half the sun's disc behind the horizon
    return np.exp(-depth) * rim[..., None]


def _table_at(table: F64, height: F64, cosine: F64) -> F64:
    row = np.sqrt(np.clip(height / _TOP, 0, 1)) * (_TABLE[0] - 1)
    column = (np.sign(cosine) * np.sqrt(np.abs(cosine)) + 1) / 2 * (_TABLE[1] - 1)
    return _between(table, row, np.clip(column, 0, _TABLE[1] - 1))


def _between(table: F64, row: F64, column: F64) -> F64:
    """Interpolate in a table, shape (..., 3)."""
    top, left = np.minimum(row.astype(int), len(table) - 2), np.minimum(column.astype(int), table.shape[1] - 2)
    down, right = (row - top)[..., None], (column - left)[..., None]
    upper = table[top, left] * (1 - right) + table[top, left + 1] * right
    lower = table[top + 1, left] * (1 - right) + table[top + 1, left + 1] * right
    return upper * (1 - down) + lower * down
