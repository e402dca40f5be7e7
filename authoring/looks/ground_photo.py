"""The ground near a bridge as it is worn: one picture for each square, at 4 cm a texel, which nothing on it repeats.

It multiplies the tiled surfaces: a footpath, the ruts of a service vehicle, wet earth and a line of silt by the water,
dust under the deck and the drip line at its edges, leaves, and mottle without a period.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from authoring.looks.noise import Bank, Floats, Tile, fractal, ramp
from authoring.site.land import no_hills
from authoring.site.photo import PhotoSquare
from authoring.site.site import Site

F64 = NDArray[np.float64]
B = NDArray[np.bool_]

LEAST, MOST = 0.2, 1.99  # factors; two is what a texel can hold [1]
COARSE = 4  # texels of the picture to one of what is computed exactly
# covers of gravel and soil; the others are green
_BARE = ("verge", "shoulder", "shore", "bank", "worn", "ploughed", "ripe", "lot_asphalt", "lot_paved", "lot_gravel")
_FADE = 5.0  # [m] at the outer borders, on which the picture fades into the ground beyond
_SEAM = 4.0  # [m] beside the next square, on which both show the same mottle
_FAR = 50.0  # distance that stands for none [m]
_PATH = 0.42  # half the width of a footpath [m]
_RUTS = 0.80, 0.19  # from the middle to each rut, and half its width [m]


@dataclass(frozen=True)
class _Lie:
    """What the texels of a picture lie on, each of shape (H, W), float32: distances [m], heights over water [m]."""

    fade: Floats
    green: Floats
    path: Floats
    rut: Floats
    above: Floats
    deck: Floats
    side: Floats
    patches: Floats


def ground_photo(
    site: Site, square: PhotoSquare, squares: int, patches: Floats, pixels: int, seed: int, bank: Bank
) -> Floats:
    """Draw the factors of one square.

    Args:
        site: The site.
        square: The square.
        squares: How many there are.
        patches: Factors over the whole strip [1], shape (P, P, 3), float32, which the picture begins and ends with.
        pixels: Texels along its side.
        seed: Of the pictures of this site.
        bank: Fields shared between pictures.

    Returns:
        Factors [1], the first row at the highest left, shape (pixels, pixels, 3), float32.
    """
    lie = _survey(site, square, squares, patches, pixels, seed)
    mid = _mottle(square, pixels, (14.0, 0.9), (seed, 1), bank)
    fine = _mottle(square, pixels, (1.5, 0.0), (seed, 2), bank)
    speck = _mottle(square, pixels, (0.22, 0.0), (seed, 3), bank)
    ragged = np.float32(0.16) * mid + np.float32(0.10) * fine
    factors = (1 + 0.06 * mid + 0.21 * np.clip(fine, -2.6, 2.6) + 0.09 * speck)[..., None] * np.ones(3, np.float32)
    leaves = ramp(speck, 1.3, 2.0) * ramp(mid + 0.4 * fine, 0.3, 1.5)
    factors = _tint(factors, leaves, lie.green, (1.75, 1.20, 0.80), (0.78, 0.62, 0.45))
    under = ramp(lie.deck + ragged, 0.2, -0.9)
    factors = _tint(factors, 0.8 * under, lie.green, (1.25, 1.10, 1.15), (1.12, 1.09, 1.04))
    drip = ramp(np.abs(lie.side + 0.4 * ragged), 0.34, 0.05) * ramp(fine, -1.6, 0.2)
    factors = _tint(factors, drip, lie.green, (0.74, 0.72, 0.80), (0.70, 0.69, 0.68))
    worn = ramp(lie.path + ragged, _PATH + 0.18, _PATH - 0.16)
    factors = _tint(factors, worn, lie.green, (1.80, 1.28, 1.60), (1.14, 1.11, 1.06))
    rut = ramp(lie.rut + 0.7 * ragged, _RUTS[1] + 0.13, _RUTS[1] - 0.06) * ramp(mid, -1.9, -0.7)
    factors = _tint(factors, 0.85 * rut, lie.green, (1.42, 1.02, 1.25), (0.80, 0.79, 0.78))
    silt = ramp(np.abs(lie.above + 0.5 * ragged - 0.62), 0.20, 0.02) * ramp(fine, -1.0, 0.8)
    factors = _tint(factors, 0.7 * silt, lie.green, (1.45, 1.25, 1.50), (1.18, 1.15, 1.08))
    wet = ramp(lie.above + 0.7 * ragged, 0.48, 0.04)
    factors = _tint(factors, wet, lie.green, (0.62, 0.64, 0.66), (0.50, 0.50, 0.51))
    dry = (lie.fade * (lie.above > 0.0))[..., None]
    area = float(dry.sum())
    mean = np.float32(
        np.sum(factors.mean(axis=-1, keepdims=True) * dry, dtype=np.float64) / area if area > 1.0 else 1.0
    )
    shown = lie.patches * (1 + lie.fade[..., None] * (factors / mean - 1))
    return np.clip(shown, LEAST, MOST).astype(np.float32)


def _tint(factors: Floats, share: Floats, green: Floats, grass: tuple[float, ...], bare: tuple[float, ...]) -> Floats:
    """Multiply by a colour of grass where it is green, of bare ground elsewhere, as far as a share says."""
    on_grass, on_bare = np.array(grass, np.float32), np.array(bare, np.float32)
    color = on_bare + green[..., None] * (on_grass - on_bare)
    return factors * (1 + share[..., None] * (color - 1))


def _mottle(square: PhotoSquare, pixels: int, waves: tuple[float, float], seed: tuple[int, int], bank: Bank) -> Floats:
    """Draw noise that is another one in each square, and the same where two meet, shape (pixels, pixels), float32."""
    longest = max(waves[0], 4.0 * square.side / pixels)  # a coarse picture has no finer ones
    streams = (np.random.default_rng(seed), np.random.default_rng((*seed, 7 + square.number)))
    shared, own = (fractal(Tile(pixels, square.side, stream, bank), longest, waves[1], slope=0.7) for stream in streams)
    shared = np.roll(shared, -round(square.corner[0] / square.side * pixels), axis=1)
    station = square.corner[0] + (np.arange(pixels) + 0.5) * square.side / pixels
    inside = np.minimum(station - square.stations[0], square.stations[1] - station).astype(np.float32)
    share = ramp(inside, 0.3, _SEAM)[None, :]
    return (np.sqrt(1 - share * share) * shared + share * own).astype(np.float32)


def _survey(site: Site, square: PhotoSquare, squares: int, patches: Floats, pixels: int, seed: int) -> _Lie:
    land, crossing, layout = site.land, site.land.crossing, site.land.layout
    count = max(pixels // COARSE, 8)
    steps = (np.arange(count) + 0.5) * square.side / count
    station, left = np.meshgrid(square.corner[0] + steps, square.corner[1] + steps[::-1])
    inside = np.minimum(left - square.lefts[0], square.lefts[1] - left)
    if square.number == 0:
        inside = np.minimum(inside, station - square.stations[0])
    if square.number == squares - 1:
        inside = np.minimum(inside, square.stations[1] - station)
    covers = land.shape(station, left, no_hills).covers
    bare = np.max([covers[name] for name in _BARE if name in covers], axis=0)
    beside = crossing.distance(station, left) - crossing.half_width
    side = np.sign(station - crossing.centre(left))
    draw = np.random.default_rng((seed, 9))
    bank, phase, gap = float(draw.choice((-1.0, 1.0))), draw.uniform(0.0, 6.0, 3), draw.uniform(4.0, 9.0)
    along = np.abs(left - bank * (0.5 * layout.width + gap + 1.6 * np.sin(station / 11.0 + phase[0])))
    across = np.abs(beside - 2.6 - 0.5 * np.sin(left / 7.0 + phase[1])) + np.where(side == bank, 0.0, _FAR)
    path = np.where(beside > 1.2, np.minimum(along, across), _FAR)
    track = beside - 6.0 - 0.7 * np.sin(left / 16.0 + phase[2])
    rut = np.where(side == -bank, np.abs(np.abs(track) - _RUTS[0]), _FAR)
    ground = site.field(station.ravel(), left.ravel()).reshape(station.shape)
    above = ground - crossing.level if crossing.depth > 0.0 else np.full(station.shape, _FAR)
    ends = np.maximum(layout.supports[0] - station, station - layout.supports[-1])
    edge = np.abs(left) - 0.5 * layout.width
    at = [
        (value - line[0]) / (line[-1] - line[0])
        for value, line in ((station, site.field.stations), (left, site.field.lefts))
    ]

    def full(values: F64 | Floats) -> Floats:
        return enlarged(np.asarray(values, np.float32), pixels)

    return _Lie(
        ramp(full(inside), 0.0, _FADE),
        ramp(full(np.clip(bare, -2.0, 2.0)), 0.15, -0.25),
        full(path),
        full(rut),
        full(above),
        full(np.maximum(edge, ends)),
        full(np.where(ends < 0.0, edge, _FAR)),
        np.stack([full(_look_up(patches[..., band], *at)) for band in range(3)], axis=-1),
    )


def enlarged(field: Floats, pixels: int) -> Floats:
    """Enlarge a field by linear interpolation.

    Args:
        field: Values, shape (N, N), float32.
        pixels: Texels along a side of the result.

    Returns:
        Values, shape (pixels, pixels), float32.
    """
    place = np.clip((np.arange(pixels) + 0.5) * len(field) / pixels - 0.5, 0, len(field) - 1)
    low = np.minimum(place.astype(np.int64), len(field) - 2)
    share = (place - low).astype(np.float32)
    rows = field[low] + share[:, None] * (field[low + 1] - field[low])
    return rows[:, low] + share * (rows[:, low + 1] - rows[:, low])


def _look_up(image: Floats, across: F64, up: F64) -> Floats:
    """Interpolate a picture at places from 0 to 1 across and up, same shape, float32."""
    count = len(image)
    column, row = (np.clip(value * count - 0.5, 0, count - 1) for value in (across, 1.0 - up))
    j, i = (np.minimum(value.astype(np.int64), count - 2) for value in (column, row))
    s, t = (column - j).astype(np.float32), (row - i).astype(np.float32)
    upper = image[i, j] + s * (image[i, j + 1] - image[i, j])
    lower = image[i + 1, j] + s * (image[i + 1, j + 1] - image[i + 1, j])
    return upper + t * (lower - upper)
