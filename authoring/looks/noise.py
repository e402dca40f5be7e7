"""Periodic random fields for textures: filtered noise, cells and lines, the same bytes on every machine.

Sums, products, quotients and square roots are exact by IEEE 754; what is not (powers, trigonometry) is computed on
small tables and rounded to `_GRID`, so that a last-digit difference between two processors does not reach a texel.
"""

import threading
from collections import OrderedDict
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import fft

Floats = NDArray[np.floating]  # float32; the stubs of numpy widen a product with a Python number
I32 = NDArray[np.int32]

_GRID = 2.0**20
_BLOCK = 64  # lines of texels worked on at once, so that they stay in the cache
_KEPT = 16  # fields that a bank remembers: at 2048 texels 16 MB each

FieldKey = tuple[int, float, float, float, float, float, float]


class Bank:
    """Noise fields that several sheets share: transforming one costs a second, moving a known one a hundredth of it.

    A tile that draws from a bank gets each field moved, mirrored and turned over as its own random stream says. A
    surface sums ten or more fields, each moved on its own, so that two sheets have no place in common. A field depends
    on nothing but its parameters: it does not matter who asked first.
    """

    def __init__(self) -> None:
        """Start with nothing drawn."""
        self._fields: OrderedDict[FieldKey, Floats] = OrderedDict()
        self._lock = threading.Lock()

    def field(self, key: FieldKey) -> Floats:
        """Give the field of some parameters, not to be changed.

        Args:
            key: Texels along a side, its length, then the arguments of `fractal`.

        Returns:
            Values with mean 0 and standard deviation 1 [1], shape (pixels, pixels), float32.
        """
        with self._lock:
            known = self._fields.get(key)
            if known is not None:
                self._fields.move_to_end(key)
                return known
        seed = [int(abs(value) * 4096) for value in key]
        made = _filtered(key, np.random.default_rng(seed))
        with self._lock:
            self._fields[key] = made
            while len(self._fields) > _KEPT:
                self._fields.popitem(last=False)
        return made


@dataclass(frozen=True)
class Tile:
    """A square of surface that repeats seamlessly.

    Attributes:
        pixels: Texels along a side.
        meters: Length of a side [m].
        rng: Random stream of this tile.
        bank: Fields shared with other tiles; None draws every field afresh.
    """

    pixels: int
    meters: float
    rng: np.random.Generator
    bank: Bank | None = None


def snap(values: Floats | np.floating) -> Floats:
    """Round to a fixed grid, so that the last digits of a transcendental function do not matter.

    Args:
        values: Numbers [any unit], shape (...), float.

    Returns:
        The nearest of the grid [any unit], the same shape (...), float32.
    """
    return (np.round(values.astype(np.float64) * _GRID) / _GRID).astype(np.float32)


def fractal(
    tile: Tile, longest: float, shortest: float = 0.0, slope: float = 1.0, stretch: tuple[float, float] = (1.0, 1.0)
) -> Floats:
    """Draw band-limited noise with a power-law spectrum.

    Args:
        tile: Where it repeats.
        longest: Longest wavelength [m].
        shortest: Shortest wavelength [m]; 0 for two texels.
        slope: Amplitude falls with frequency to this power [1]; at 1 every octave has the same contrast.
        stretch: Factors that draw the pattern out along columns (u) and rows (v) [1].

    Returns:
        Values with mean 0 and standard deviation 1 [1], shape (pixels, pixels), float32.
    """
    key = (tile.pixels, tile.meters, longest, shortest, slope, *stretch)
    if tile.bank is None:
        return _filtered(key, tile.rng)
    return _moved(tile.bank.field(key), tile.rng)


def mottle(tile: Tile, waves: tuple[float, float], patches: tuple[float, float], most: float = 5.5) -> Floats:
    """Draw noise of many sizes, none of which stands out, with some places coarse and others quiet.

    What is high or deep is drawn out a little: a feature detector finds as much on it as on noise to the third power,
    in which people see dots.

    Args:
        tile: Where it repeats.
        waves: Longest and shortest wavelength [m].
        patches: Those of what makes places coarse or quiet [m].
        most: Where peaks are cut off [1].

    Returns:
        Values with mean 0 and standard deviation 1 [1], shape (pixels, pixels), float32.
    """
    noise = fractal(tile, *waves, slope=0.9)
    rough = np.clip(fractal(tile, *patches, slope=1.2), -2.2, 2.2)
    drawn = noise * (1 + np.float32(0.4) * np.abs(noise)) * (1 + np.float32(0.3) * rough)
    return standard(np.clip(standard(drawn), -most, most))


def standard(field: Floats) -> Floats:
    """Shift and scale a field to mean 0 and standard deviation 1.

    Args:
        field: Any field [1], shape (H, W), float32.

    Returns:
        The field so changed [1], shape (H, W), float32.
    """
    centered = field - snap(np.mean(field, dtype=np.float64))
    spread = float(np.round(np.std(centered, dtype=np.float64) * 2**40) / 2**40)
    return centered * np.float32(1 / max(spread, 1e-12))


def white(tile: Tile) -> Floats:
    """Draw independent values between 0 and 1.

    Args:
        tile: Where it repeats.

    Returns:
        Values [1], shape (pixels, pixels), float32.
    """
    return draw(tile.rng, (tile.pixels, tile.pixels))


def draw(rng: np.random.Generator, shape: tuple[int, ...]) -> Floats:
    """Draw independent values from 0 up to 1.

    Args:
        rng: Random stream.
        shape: Shape of the result.

    Returns:
        Values [1], shape (...) as wanted, float32.
    """
    return rng.integers(0, 1 << 16, shape, np.uint16).astype(np.float32) * np.float32(2**-16)


@dataclass(frozen=True)
class Cells:
    """A plane cut into irregular cells (Worley noise).

    Attributes:
        near: Distance to the nearest seed in units of the pitch [1], shape (pixels, pixels), float32.
        second: Distance to the second nearest seed [1], shape (pixels, pixels), float32.
        seed: Number of the nearest seed, shape (pixels, pixels), int32.
        count: Number of seeds.
    """

    near: Floats
    second: Floats
    seed: I32
    count: int


def cells(tile: Tile, pitch: float, stretch: float = 1.0, jitter: float = 0.8) -> Cells:
    """Cut the tile into irregular cells, one seed in each square of a jittered grid.

    Source: Worley, A cellular texture basis function, SIGGRAPH 1996.

    Args:
        tile: Where it repeats.
        pitch: Mean distance of the seeds along v [m].
        stretch: Seeds stand this much further apart along u [1].
        jitter: How far a seed leaves the middle of its square [1].
    """
    rows = max(1, round(tile.meters / pitch))
    columns = max(1, round(tile.meters / (pitch * stretch)))
    seed_v, seed_u = 0.5 + (draw(tile.rng, (2, rows, columns)) - 0.5) * np.float32(jitter)
    count = tile.pixels
    near, second = np.empty((2, count, count), np.float32)
    seed = np.empty((count, count), np.int32)
    for top in range(0, count, _BLOCK):
        part = slice(top, min(top + _BLOCK, count))
        near[part], second[part], seed[part] = _nearest(seed_v, seed_u, np.arange(part.start, part.stop), count)
    return Cells(np.sqrt(near), np.sqrt(second), seed, rows * columns)


def _nearest(seed_v: Floats, seed_u: Floats, lines: NDArray[np.intp], count: int) -> tuple[Floats, Floats, I32]:
    """Squared distances to the two nearest seeds, and the number of the nearest, for some lines of texels."""
    rows, columns = seed_v.shape
    v = (lines + np.float32(0.5)).astype(np.float32) * np.float32(rows / count)
    u = (np.arange(count, dtype=np.float32) + np.float32(0.5)) * np.float32(columns / count)
    row, column = v.astype(np.int32), u.astype(np.int32)
    near = np.full((len(lines), count), 9, np.float32)
    second, seed = near.copy(), np.zeros(near.shape, np.int32)
    for down in (-1, 0, 1):
        other_row = (row + down) % rows
        line_v, line_u = seed_v[other_row], seed_u[other_row]
        for across in (-1, 0, 1):
            other_column = (column + across) % columns
            squared = (v - row - down)[:, None] - np.take(line_v, other_column, axis=1)
            squared *= squared
            aside = (u - column - across)[None, :] - np.take(line_u, other_column, axis=1)
            aside *= aside
            squared += aside
            closer = squared < near
            np.minimum(second, np.maximum(near, squared), out=second)
            np.minimum(near, squared, out=near)
            np.copyto(seed, (other_row * columns)[:, None] + other_column[None, :], where=closer)
    return near, second, seed


def per_cell(tile: Tile, parts: Cells) -> Floats:
    """Give every cell a value of its own between 0 and 1.

    Args:
        tile: Its random stream is used.
        parts: Cells of this tile.

    Returns:
        Values [1], shape (pixels, pixels), float32.
    """
    return np.take(draw(tile.rng, (parts.count,)), parts.seed)


def spots(tile: Tile, pitch: float, radius: float, share: float) -> Floats:
    """Scatter soft round spots.

    Args:
        tile: Where it repeats.
        pitch: Mean distance of possible places [m].
        radius: Largest radius [m]; each spot draws its own.
        share: Share of the places that carry a spot [1].

    Returns:
        1 inside a spot, 0 outside [1], shape (pixels, pixels), float32.
    """
    places = max(1, round(tile.meters / pitch))
    offset_v, offset_u, size, chance = draw(tile.rng, (4, places, places))
    row, column = np.nonzero(chance < np.float32(share))
    texels = np.float32(tile.pixels / tile.meters)
    step = np.float32(tile.pixels / places)
    center_v, center_u = (row + offset_v[row, column]) * step, (column + offset_u[row, column]) * step
    own = np.float32(radius) * texels * (np.float32(0.4) + np.float32(0.6) * size[row, column])
    reach = np.arange(-int(radius * texels + 2), int(radius * texels + 2) + 1)
    v = (np.floor(center_v)[:, None] + reach)[:, :, None]
    u = (np.floor(center_u)[:, None] + reach)[:, None, :]
    aside = np.sqrt((v + 0.5 - center_v[:, None, None]) ** 2 + (u + 0.5 - center_u[:, None, None]) ** 2)
    inside = np.clip(own[:, None, None] - aside.astype(np.float32) + np.float32(0.5), 0, 1)
    flat = (v.astype(np.int64) % tile.pixels) * tile.pixels + u.astype(np.int64) % tile.pixels
    spotted = np.zeros(tile.pixels * tile.pixels, np.float32)
    np.maximum.at(spotted, flat.ravel(), inside.ravel())
    return spotted.reshape(tile.pixels, tile.pixels)


def ramp(field: Floats, low: Floats | float, high: Floats | float) -> Floats:
    """Rise smoothly from 0 at `low` to 1 at `high` (a fall when `high` is lower).

    Args:
        field: Values [any unit], shape (...), float32.
        low: Where the result is 0 [any unit]; a number, or one for each value, the same shape (...), float32.
        high: Where the result is 1 [any unit]; a number, or one for each value, the same shape (...), float32.

    Returns:
        Values between 0 and 1 [1], the same shape (...), float32.
    """
    low, high = np.asarray(low, np.float32), np.asarray(high, np.float32)
    step = np.clip((field - low) / (high - low), 0, 1)
    return (step * step * (3 - 2 * step)).astype(np.float32)


def joints(tile: Tile, pitch: float, width: float, along: Literal["u", "v"]) -> Floats:
    """Draw straight lines at an even pitch that divides the tile.

    Args:
        tile: Where it repeats.
        pitch: Distance of the lines [m], adjusted to a whole number of them.
        width: Width of a line [m].
        along: Lines run along columns (`u`: horizontal) or along rows (`v`: upright).

    Returns:
        1 on a line, 0 beside it [1], shape (pixels, 1) or (1, pixels), float32.
    """
    count = max(1, round(tile.meters / pitch))
    place = (np.arange(tile.pixels, dtype=np.float32) + np.float32(0.5)) * np.float32(count / tile.pixels)
    aside = np.abs(place - np.round(place)) * np.float32(tile.meters / count)
    texel = tile.meters / tile.pixels
    line = ramp(aside, width / 2 + texel / 2, max(width / 2 - texel / 2, 0.0))
    return line[:, None] if along == "u" else line[None, :]


def _white_spectrum(rng: np.random.Generator, shape: tuple[int, int]) -> NDArray[np.complex64]:
    drawn = rng.integers(-(1 << 15), 1 << 15, (*shape, 2), np.int16).astype(np.float32)
    return drawn.view(np.complex64)[..., 0]


def _filtered(key: FieldKey, rng: np.random.Generator) -> Floats:
    count, meters, longest, shortest, slope, *stretch = key
    across = np.arange(count // 2 + 1, dtype=np.float32) * np.float32(stretch[0])
    down = np.fft.fftfreq(count, 1 / count).astype(np.float32) * np.float32(stretch[1])
    cycles = np.sqrt(across[None, :] ** 2 + down[:, None] ** 2)
    lowest = meters / longest
    highest = min(meters / shortest if shortest else count / 2, count / 2)
    table = np.arange(int(cycles.max()) + 2, dtype=np.float64)
    gain = snap(np.maximum(table, 0.5) ** -slope / (1 + (0.7 * lowest / np.maximum(table, 0.5)) ** 6))
    gain *= snap(1 / (1 + (table / (1.1 * highest)) ** 8))
    whole = cycles.astype(np.int32)
    part = cycles - whole
    spectrum = _white_spectrum(rng, whole.shape)
    spectrum *= gain[whole] * (1 - part) + gain[whole + 1] * part
    spectrum[0, 0] = 0
    return standard(np.asarray(fft.irfft2(spectrum, s=(count, count), overwrite_x=True)))


def _moved(field: Floats, rng: np.random.Generator) -> Floats:
    """A copy of a field, moved and mirrored, with its hills for valleys in half of the cases."""
    count = len(field)
    down, across, kind = (int(value) for value in rng.integers(0, (count, count, 8)))
    turned = field[:: 1 - 2 * (kind & 1), :: 1 - (kind & 2)]
    moved = np.empty_like(field)
    for to, of in ((slice(down, None), slice(None, count - down)), (slice(None, down), slice(count - down, None))):
        moved[to, across:], moved[to, :across] = turned[of, : count - across], turned[of, count - across :]
    return -moved if kind & 4 else moved
