"""Clouds: cumulus with flat bases at one level and lit tops, thin cirrus far above them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.light.sky import sky_directions
from authoring.light.sun import LUMINANCE

F64 = NDArray[np.float64]
F32 = NDArray[np.float32]

_SIDE, _TILE = 1024, 24_000.0  # texels and meters after which the field of clouds repeats
_BASE = 1250.0  # [m] above the ground
_HIGHEST = 1100.0  # [m] largest height of a cumulus above its base
_ICE, _ICE_TILE = 8500.0, 60_000.0  # height of the cirrus, and meters after which they repeat [m]
_EARTH = 6.36e6  # [m]
_STEPS = 16  # through a cumulus
_EXTINCTION = 0.009  # of a cumulus [1/m]
_FAR = 4.0e4  # [m] over which cumulus fade into the haze
_LOW = 0.24  # share of the rows above the horizon that are sampled twice as finely [1]
_STRETCH = 3.2  # ratio of length to width of the cirrus [1]


def clouded(sky: F64, directions: F64, sun: F64, cover: float, rng: np.random.Generator) -> F64:
    """Draw clouds over a sky; they fade into the haze towards the horizon.

    Args:
        sky: Clear sky, linear sRGB [kcd/m2], shape (H, W, 3), float64.
        directions: Unit vectors of its texels, world axes [1], shape (H, W, 3), float64.
        sun: Unit vector towards the sun [1], shape (3,), float64.
        cover: Share of the sky behind clouds [1].
        rng: Random stream of the clouds.

    Returns:
        Linear sRGB [kcd/m2], shape (H, W, 3), float64.
    """
    heaps, wisps, drift = _heaps(rng), _wisps(rng), rng.random(4)
    rows = np.flatnonzero(directions[:, 0, 2] > 0)
    result, above, behind = sky.copy(), directions[rows], sky[rows]
    shine = _shine(sky, sun)
    angle = np.arccos(np.clip(above @ sun, -1, 1))
    seen, glow = _ice(wisps, above, angle, drift[:2], cover)
    behind = behind * (1 - seen[..., None]) + seen[..., None] * (0.55 * behind + 0.45 * shine * glow[..., None])
    if cover > 0:
        opacity, lit, away = _march(heaps, above, sun, cover, drift[2:])
        low = len(rows) - int(len(rows) * _LOW)  # distant cumulus are finer than texels
        fine = sky_directions(2 * len(sky))[2 * (rows[0] + low) : 2 * (rows[-1] + 1)]
        for part, finer in zip((opacity, lit, away), _means(*_march(heaps, fine, sun, cover, drift[2:])), strict=True):
            part[low:] = finer
        ambient = 0.5 * np.median(sky[: len(sky) // 2].reshape(-1, 3), axis=0) + 0.5 * behind.mean(axis=(0, 1))
        edge = 0.35 + 0.65 * np.exp(-2.0 * angle) + 3.0 * np.exp(-9.0 * angle)  # bright rims in front of the sun
        light = lit * (0.75 + 0.5 * (1 - opacity) * edge)
        shade = 1 - 0.45 * np.clip((cover - 0.5) / 0.5, 0, 1)
        color = (0.55 + 0.25 * lit[..., None]) * ambient * shade * 1.5 + light[..., None] * shine
        veil = np.exp(-away / _FAR)[..., None]
        color = color * veil + behind * (1 - veil)
        behind = behind * (1 - opacity[..., None]) + color * opacity[..., None]
    result[rows] = behind
    return result


def _means(opacity: F64, lit: F64, away: F64) -> tuple[F64, F64, F64]:
    """Average 2x2 texels, weighted by opacity; three of shape (H, W)."""

    def mean(values: F64) -> F64:
        return (values[::2, ::2] + values[1::2, ::2] + values[::2, 1::2] + values[1::2, 1::2]) / 4

    covered = mean(opacity)
    known = np.maximum(covered, 1e-9)
    return covered, mean(opacity * lit) / known, mean(opacity * away) / known


def _shine(sky: F64, sun: F64) -> F64:
    """Compute the color of a sunlit cloud, with its brightness relative to that sky, shape (3,)."""
    height = max(float(sun[2]), 0.0)
    level = float(np.median((sky @ LUMINANCE)[: len(sky) // 2]))
    warm = np.exp(-np.array([0.06, 0.13, 0.30]) / (height + 0.06))
    warm /= max(float(warm @ LUMINANCE), 1e-9)
    fading = np.clip((float(sun[2]) + 0.06) / 0.12, 0, 1)
    return (1.0 + 2.4 * fading) * level * (warm * fading + (1 - fading) * np.array([0.93, 0.99, 1.06]))


def _march(heaps: tuple[F32, F32], directions: F64, sun: F64, cover: float, drift: F64) -> tuple[F64, F64, F64]:
    """March rays through the cumulus, whose bases are level and whose tops are higher where they are thick.

    Returns:
        Opacity [1], the share of sunlight at the visible part (0 none, 1 all), and its distance [m], each (H, W).
    """
    broad, fine = heaps
    ordered = np.sort(broad.ravel())
    edge = float(ordered[min(int((1 - cover) * len(ordered)), len(ordered) - 1)])
    spread = float(ordered[int(0.98 * len(ordered))] - edge) + 1e-9
    up = np.maximum(directions[..., 2], 1e-3)
    sideways = sun[:2] / max(float(np.hypot(sun[0], sun[1])), 1e-9) * min(1 / max(float(sun[2]), 0.15), 4.0)
    opacity, light, away, left = (np.zeros(up.shape) for _ in range(4))
    left += 1.0
    field = _Heaps(broad, fine, edge, spread, float(np.clip((cover - 0.75) / 0.25, 0, 1)))
    for step in range(_STEPS):
        height = _HIGHEST * (step + 0.5) / _STEPS
        reach = _distance(up, _BASE + height)
        length = np.minimum(_HIGHEST / _STEPS / up, 260.0)
        place = (directions[..., :2] * reach[..., None]) / _TILE + drift
        blur = np.clip(reach / 6.0e4, 0, 1)
        top = _tops(field, place, blur)
        inside = np.clip((top - height) / (170.0 + 0.014 * reach), 0, 1) * np.clip((height + 25.0) / 80.0, 0, 1)
        if not inside.any():
            continue
        shadow = np.zeros(up.shape)
        for lift in (90.0, 260.0, 560.0):
            ahead = place + lift * sideways / _TILE
            over = _tops(field, ahead, blur)
            shadow += np.clip((over - height - lift) / 160.0, 0, 1) * (0.5, 0.8, 1.1)[(90.0, 260.0, 560.0).index(lift)]
        lit = np.exp(-1.1 * shadow) * (0.55 + 0.45 * height / np.maximum(top, 1.0).clip(height, None))
        gone = left * (1 - np.exp(-_EXTINCTION * inside * length))
        opacity, light, away, left = opacity + gone, light + gone * lit, away + gone * reach, left - gone
    known = np.maximum(opacity, 1e-6)
    return opacity * np.clip(directions[..., 2] / 0.02, 0, 1), light / known, away / known


@dataclass(frozen=True, eq=False)
class _Heaps:
    """A field of cumulus: density and small-scale shape, each 0 to 1, (side, side).

    They begin at the value `edge` of `broad`, grow by `spread` of it, and a share `closed` of the gaps is filled.
    """

    broad: F32
    fine: F32
    edge: float
    spread: float
    closed: float


def _tops(heaps: _Heaps, place: F64, blur: F64) -> F64:
    """Compute the height of cumulus above their base [m], shape (H, W); 0 or less where there are none."""
    body = (_lookup(heaps.broad, place) - heaps.edge) / heaps.spread
    swell = np.clip(body, 0, 1) ** 0.6
    grain = _lookup(heaps.fine, 5.0 * place) * (1 - blur)
    return _HIGHEST * (swell * (0.62 + 0.25 * heaps.closed) + (0.34 * grain - 0.13) * np.clip(6 * body + 0.4, 0, 1))


def _ice(wisps: F32, directions: F64, angle: F64, drift: F64, cover: float) -> tuple[F64, F64]:
    """Compute the opacity of the cirrus [1], and its brightening near the sun [1], each (H, W)."""
    reach = _distance(np.maximum(directions[..., 2], 1e-3), _ICE)
    place = directions[..., :2] * reach[..., None] / _ICE_TILE + drift
    field = _lookup(wisps, place)
    thin = np.clip((field - 0.50) / 0.5, 0, 1) * min(1.0, 0.4 + cover)
    return 0.55 * thin * np.exp(-reach / 9.0e4), 0.8 + 1.5 * np.exp(-4.0 * angle)


def _distance(up: F64, height: float) -> F64:
    """Compute the length of a line of sight to a height above the round earth [m], by the sine of its elevation."""
    return np.sqrt((_EARTH * up) ** 2 + 2 * _EARTH * height + height**2) - _EARTH * up


def _heaps(rng: np.random.Generator) -> tuple[F32, F32]:
    """Draw the density of cumulus and their small-scale shape, each 0 to 1, (side, side)."""
    broad = _octaves(rng, (6, 11, 23, 47, 95), 0.62)
    fine = np.zeros((_SIDE, _SIDE), np.float32)
    for count, share in ((17, 0.5), (37, 0.3), (79, 0.2)):  # round upwards, with creases between
        fine += np.float32(share) * (1 - np.abs(2 * _lattice(rng, count) - 1) ** 0.8)
    return broad, fine


def _wisps(rng: np.random.Generator) -> F32:
    """Draw the fibers of cirrus, 0 to 1, (side, side): noise, stretched along the slopes of another one."""
    field = _octaves(rng, (9, 21, 44, 90), 0.6)
    bend = 0.06 * _octaves(rng, (3, 7), 0.5)
    grid = (np.arange(_SIDE) + 0.5) / _SIDE
    place = np.stack(np.broadcast_arrays(grid[None, :] / _STRETCH * 3.0, grid[:, None]), axis=-1)
    moved = (place + np.stack([0.0 * bend, bend], axis=-1)).astype(np.float64)
    drawn = _lookup(field, moved).astype(np.float32)
    patches = np.clip(2.2 * _octaves(rng, (4, 9), 0.5) - 0.6, 0, 1)
    return (drawn * patches).astype(np.float32)


def _octaves(rng: np.random.Generator, counts: tuple[int, ...], fall: float) -> F32:
    """Sum noise of finer and finer lattices, and stretch it to 0 to 1, (side, side)."""
    total = np.zeros((_SIDE, _SIDE), np.float32)
    for octave, count in enumerate(counts):
        total += np.float32(fall**octave) * _lattice(rng, count)
    low, high = float(total.min()), float(total.max())
    return (total - np.float32(low)) / np.float32(high - low)


def _lattice(rng: np.random.Generator, count: int) -> F32:
    """Draw smooth noise that repeats, with `count` knots along a side, (side, side)."""
    knots = (rng.integers(0, 1 << 16, (count, count)) / 65_536).astype(np.float32)
    at = np.arange(_SIDE) * (count / _SIDE)
    cell = at.astype(int)
    part = (at - cell).astype(np.float32)
    part = part * part * part * (part * (6 * part - 15) + 10)
    after = (cell + 1) % count
    rows = knots[cell] * (1 - part)[:, None] + knots[after] * part[:, None]
    return (rows[:, cell] * (1 - part) + rows[:, after] * part).astype(np.float32)


def _lookup(field: F32, place: F64) -> F64:
    """Interpolate in a field that repeats after 1, (H, W)."""
    at = place * _SIDE
    cell = np.floor(at).astype(np.int64)
    part = at - cell
    column, row = cell[..., 0] % _SIDE, cell[..., 1] % _SIDE
    right, down = (column + 1) % _SIDE, (row + 1) % _SIDE
    u, v = part[..., 0], part[..., 1]
    upper = field[row, column] * (1 - u) + field[row, right] * u
    lower = field[down, column] * (1 - u) + field[down, right] * u
    return upper * (1 - v) + lower * v
