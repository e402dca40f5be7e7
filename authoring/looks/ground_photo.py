"""The worn ground near a bridge: one image for each square, at 4 cm per texel, without repetition.

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

LEAST, MOST = 0.2, 1.99  # factors; a texel can store at most 2 [1]
COARSE = 4  # texels of the image per texel of the exact computation
# covers of gravel and soil; the others are green
_BARE = ("verge", "shoulder", "shore", "bank", "worn", "ploughed", "ripe", "lot_asphalt", "lot_paved", "lot_gravel")
_FADE = 5.0  # [m] at the outer borders, over which the image fades into the ground beyond
_SEAM = 4.0  # [m] beside the next square, where both have the same mottle
_FAR = 50.0  # distance used if there is none [m]
_PATH = 0.42  # half the width of a footpath [m]
_RUTS = 0.80, 0.19  # from the middle to each rut, and half its width [m]
_ROWS = 64  # of the image processed at once


@dataclass(frozen=True)
class Enlarged:
    """A coarse field that is enlarged by linear interpolation, some rows at a time, so that they stay in the cache.

    Attributes:
        coarse: Values [any unit], shape (N, N), float32.
        pixels: Texels along a side of the enlarged field.
        limits: Values at the two ends of a ramp [any unit]; None leaves the values unchanged.
    """

    coarse: Floats
    pixels: int
    limits: tuple[float, float] | None = None

    def rows(self, wanted: slice) -> Floats:
        """Interpolate some rows.

        Args:
            wanted: Rows of the enlarged field.

        Returns:
            Values; with limits, ramps from 0 to 1 [any unit], shape (rows, pixels), float32.
        """
        low, share = self._between(np.arange(wanted.start, wanted.stop))
        lines = self.coarse[low] + share[:, None] * (self.coarse[low + 1] - self.coarse[low])
        low, share = self._between(np.arange(self.pixels))
        start = np.take(lines, low, axis=1)
        start += share * (np.take(lines, low + 1, axis=1) - start)
        return start if self.limits is None else ramp(start, *self.limits)

    def _between(self, texels: NDArray[np.intp]) -> tuple[NDArray[np.int64], Floats]:
        count = len(self.coarse)
        place = np.clip((texels + 0.5) * count / self.pixels - 0.5, 0, count - 1)
        low = np.minimum(place.astype(np.int64), count - 2)
        return low, (place - low).astype(np.float32)


@dataclass(frozen=True)
class _Lie:
    """The ground at the texels of an image: shares [1], distances [m], heights over water [m], factors [1]."""

    fade: Enlarged
    green: Enlarged
    path: Enlarged
    rut: Enlarged
    above: Enlarged
    deck: Enlarged
    side: Enlarged
    patches: tuple[Enlarged, Enlarged, Enlarged]


def ground_photo(site: Site, square: PhotoSquare, patches: Floats, pixels: int, seed: int, bank: Bank) -> Floats:
    """Draw the factors of one square.

    Args:
        site: The site.
        square: One of its squares.
        patches: Factors over the whole strip [1], shape (P, P, 3), float32, to which the image fades at its borders.
        pixels: Texels along its side.
        seed: Seed of the images of this site.
        bank: Fields shared between images.

    Returns:
        Factors [1], the first row at the highest left, shape (pixels, pixels, 3), float32.
    """
    lie = _survey(site, square, patches, pixels, seed)
    mid = _mottle(square, pixels, (14.0, 0.9), (seed, 1), bank)
    fine = _mottle(square, pixels, (1.5, 0.0), (seed, 2), bank)
    speck = _mottle(square, pixels, (0.22, 0.0), (seed, 3), bank)
    factors = np.empty((pixels, pixels, 3), np.float32)
    total = area = 0.0
    strips = [slice(top, min(top + _ROWS, pixels)) for top in range(0, pixels, _ROWS)]
    for rows in strips:
        dry = lie.fade.rows(rows) * (lie.above.rows(rows) > 0.0)
        worn = _worn(lie, rows, mid[rows], fine[rows], speck[rows])
        total += float(np.sum(worn.mean(axis=0) * dry, dtype=np.float64))
        area += float(dry.sum(dtype=np.float64))
        factors[rows] = np.moveaxis(worn, 0, -1)
    scale = np.float32(area / total if area > 1.0 else 1.0)
    for rows in strips:
        fade = lie.fade.rows(rows)
        for band in range(3):
            shown = 1 + fade * (factors[rows, :, band] * scale - 1)
            factors[rows, :, band] = np.clip(lie.patches[band].rows(rows) * shown, LEAST, MOST)
    return factors


def _worn(lie: _Lie, rows: slice, mid: Floats, fine: Floats, speck: Floats) -> Floats:
    """Compute factors of some rows before normalization, shape (3, rows, pixels), float32."""
    green = lie.green.rows(rows)
    ragged = np.float32(0.16) * mid + np.float32(0.10) * fine
    ground = 1 + np.float32(0.06) * mid + np.float32(0.21) * np.clip(fine, -2.6, 2.6) + np.float32(0.09) * speck
    factors = np.repeat(ground[None], 3, axis=0)
    leaves = ramp(speck, 1.3, 2.0) * ramp(mid + np.float32(0.4) * fine, 0.3, 1.5)
    _tint(factors, leaves, green, (1.75, 1.20, 0.80), (0.78, 0.62, 0.45))
    under = np.float32(0.8) * ramp(lie.deck.rows(rows) + ragged, 0.2, -0.9)
    _tint(factors, under, green, (1.25, 1.10, 1.15), (1.12, 1.09, 1.04))
    drip = ramp(np.abs(lie.side.rows(rows) + np.float32(0.4) * ragged), 0.34, 0.05) * ramp(fine, -1.6, 0.2)
    _tint(factors, drip, green, (0.74, 0.72, 0.80), (0.70, 0.69, 0.68))
    path = ramp(lie.path.rows(rows) + ragged, _PATH + 0.18, _PATH - 0.16)
    _tint(factors, path, green, (1.80, 1.28, 1.60), (1.14, 1.11, 1.06))
    beside = lie.rut.rows(rows) + np.float32(0.7) * ragged
    rut = np.float32(0.85) * ramp(beside, _RUTS[1] + 0.13, _RUTS[1] - 0.06) * ramp(mid, -1.9, -0.7)
    _tint(factors, rut, green, (1.42, 1.02, 1.25), (0.80, 0.79, 0.78))
    above = lie.above.rows(rows)
    line = np.abs(above + np.float32(0.5) * ragged - np.float32(0.62))
    silt = np.float32(0.7) * ramp(line, 0.20, 0.02) * ramp(fine, -1.0, 0.8)
    _tint(factors, silt, green, (1.45, 1.25, 1.50), (1.18, 1.15, 1.08))
    wet = ramp(above + np.float32(0.7) * ragged, 0.48, 0.04)
    _tint(factors, wet, green, (0.62, 0.64, 0.66), (0.50, 0.50, 0.51))
    return factors


def _tint(factors: Floats, share: Floats, green: Floats, grass: tuple[float, ...], bare: tuple[float, ...]) -> None:
    """Multiply in place by a color of grass where it is green, and of bare ground elsewhere, weighted by a share."""
    reached = np.flatnonzero(share)
    if not len(reached):
        return
    amount, lush = share.ravel()[reached], green.ravel()[reached]
    for channel, on_grass, on_bare in zip(factors, grass, bare, strict=True):
        color = np.float32(on_bare - 1) + lush * np.float32(on_grass - on_bare)
        channel.reshape(-1)[reached] *= 1 + amount * color


def _mottle(square: PhotoSquare, pixels: int, waves: tuple[float, float], seed: tuple[int, int], bank: Bank) -> Floats:
    """Draw noise that differs between squares, and is equal at their common border, shape (pixels, pixels), float32."""
    longest = max(waves[0], 4.0 * square.side / pixels)  # a coarse image has no finer ones
    streams = (np.random.default_rng(seed), np.random.default_rng((*seed, 7 + square.number)))
    shared, own = (fractal(Tile(pixels, square.side, stream, bank), longest, waves[1], slope=0.7) for stream in streams)
    station = square.corner[0] + (np.arange(pixels) + 0.5) * square.side / pixels
    inside = np.minimum(station - square.stations[0], square.stations[1] - station).astype(np.float32)
    share = ramp(inside, 0.3, _SEAM)
    both = np.flatnonzero(share < 1)  # columns near the next square
    moved = (both + round(square.corner[0] / square.side * pixels)) % pixels
    own[:, both] = np.sqrt(1 - share[both] ** 2) * shared[:, moved] + share[both] * own[:, both]
    return own


def _survey(site: Site, square: PhotoSquare, patches: Floats, pixels: int, seed: int) -> _Lie:
    land, crossing, layout = site.land, site.land.crossing, site.land.layout
    count = max(pixels // COARSE, 8)
    steps = (np.arange(count) + 0.5) * square.side / count
    station, left = np.meshgrid(square.corner[0] + steps, square.corner[1] + steps[::-1])
    inside = np.minimum(left - square.lefts[0], square.lefts[1] - left)
    if square.number == 0:
        inside = np.minimum(inside, station - square.stations[0])
    if square.number == len(site.squares) - 1:
        inside = np.minimum(inside, square.stations[1] - station)
    covers = land.shape(station, left, no_hills).covers
    bare = np.max([covers[name] for name in _BARE if name in covers], axis=0)
    beside = crossing.distance(station, left) - crossing.half_width
    side = np.sign(station - crossing.center(left))
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

    def full(values: F64 | Floats, limits: tuple[float, float] | None = None) -> Enlarged:
        return Enlarged(np.asarray(values, np.float32), pixels, limits)

    red, green, blue = (full(_look_up(patches[..., band], *at)) for band in range(3))
    return _Lie(
        full(inside, (0.0, _FADE)),
        full(np.clip(bare, -2.0, 2.0), (0.15, -0.25)),
        full(path),
        full(rut),
        full(above),
        full(np.maximum(edge, ends)),
        full(np.where(ends < 0.0, edge, _FAR)),
        (red, green, blue),
    )


def _look_up(image: Floats, across: F64, up: F64) -> Floats:
    """Interpolate an image at positions from 0 to 1 across and up, same shape, float32."""
    count = len(image)
    column, row = (np.clip(value * count - 0.5, 0, count - 1) for value in (across, 1.0 - up))
    j, i = (np.minimum(value.astype(np.int64), count - 2) for value in (column, row))
    s, t = (column - j).astype(np.float32), (row - i).astype(np.float32)
    upper = image[i, j] + s * (image[i, j + 1] - image[i, j])
    lower = image[i + 1, j] + s * (image[i + 1, j + 1] - image[i + 1, j])
    return upper + t * (lower - upper)
