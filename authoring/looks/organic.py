"""Recipes of what grows, of earth, wood and water."""

import numpy as np

from authoring.looks.noise import Floats, Tile, cells, fractal, per_cell, ramp, snap, spots
from authoring.looks.sheet import Color, Sheet, cover, paint, palette


def grass(tile: Tile, dry: float) -> Sheet:
    """Turf seen from some meters: tufts, blades, dry stalks, soil showing through.

    Args:
        tile: Where it repeats.
        dry: Share of straw [1].
    """
    tufts, blades = fractal(tile, 0.9, 0.06), _filaments(tile, 0.09)
    fine = fractal(tile, 0.05, slope=0.2)
    tone = 0.42 + 0.09 * tufts + 0.18 * blades + 0.07 * fine
    albedo = palette(tone, _BLADES)
    straw = ramp(fractal(tile, 1.4, 0.02) + 0.8 * blades, 2.0 - 2.2 * dry, 3.4 - 2.2 * dry)
    albedo = cover(albedo, 0.5 * straw, paint((0.180, 0.152, 0.078), 0.8 + 0.25 * blades))
    bare = ramp(fractal(tile, 1.1, 0.03), 1.5, 2.3)
    albedo = cover(albedo, 0.5 * bare, paint((0.092, 0.067, 0.043), 1 + 0.25 * fine))
    return Sheet(albedo, 0.92 + 0.02 * fine, 0.03 * tufts + 0.012 * blades)


def meadow(tile: Tile) -> Sheet:
    """Uncut grass with flowers.

    Args:
        tile: Where it repeats.
    """
    turf = grass(tile, 0.27)
    albedo = cover(turf.albedo, spots(tile, 0.10, 0.014, 0.045), (0.44, 0.42, 0.36))
    albedo = cover(albedo, spots(tile, 0.13, 0.014, 0.045), (0.40, 0.31, 0.06))
    return Sheet(albedo, turf.roughness, turf.height)


def hay(tile: Tile) -> Sheet:
    """Tall grass gone to seed, lodged here and there, before it is cut.

    Args:
        tile: Where it repeats.
    """
    stalks, blades = fractal(tile, 0.16, 0.008, slope=0.6, stretch=(1.0, 1.8)), _filaments(tile, 0.13)
    swathes = fractal(tile, 2.2, 0.12)
    tone = 0.47 + 0.13 * stalks + 0.14 * blades + 0.10 * swathes
    albedo = palette(tone, _HAY)
    albedo = cover(albedo, 0.7 * spots(tile, 0.15, 0.02, 0.08), (0.34, 0.30, 0.20))
    return Sheet(albedo, 0.93 + 0.01 * stalks, 0.05 * swathes + 0.02 * blades)


def soil(tile: Tile) -> Sheet:
    """Bare earth with clods, pebbles, and what lies about: dry leaves, twigs, seedlings.

    Args:
        tile: Where it repeats.
    """
    clods, grain, damp = fractal(tile, 0.35, 0.02), fractal(tile, 0.05, slope=0.3), fractal(tile, 2.2, 0.15)
    albedo = paint((0.114, 0.086, 0.058), 1 + 0.10 * clods + 0.13 * grain + 0.06 * damp)
    chips = fractal(tile, 0.09, 0.02, slope=0.8)  # no stone is round
    relief = 0.012 * clods
    for pitch, share in _PEBBLES:
        layer = cells(tile, pitch, stretch=1.3)
        own, chance, size = (per_cell(tile, layer) for _ in range(3))
        lies = chance < np.float32(share)
        border = 0.20 + 0.16 * size - layer.near + 0.05 * chips
        albedo = albedo * (1 - 0.35 * ramp(border, -0.08, 0.02) * lies)[..., None]  # its own shade beside it
        body = ramp(border, 0.0, 0.06) * lies
        albedo = cover(albedo, 0.9 * body, paint((0.200, 0.178, 0.148), 0.68 + 0.56 * own + 0.06 * grain))
        relief = relief + 0.2 * pitch * body
    litter = ramp(_filaments(tile, 0.12) + 0.6 * damp, 1.9, 2.6)
    albedo = cover(albedo, 0.45 * litter, (0.180, 0.145, 0.084))
    for pitch, stretch, share, color in _LITTER:
        layer = cells(tile, pitch, stretch=stretch, jitter=1.0)
        own, chance = per_cell(tile, layer), per_cell(tile, layer)
        body = ramp(layer.near, 0.34, 0.28) * (chance < np.float32(share))
        albedo = cover(albedo, 0.9 * body, paint(color, 0.7 + 0.6 * own))
    return Sheet(albedo, 0.95 + 0.01 * grain, relief)


def furrows(tile: Tile) -> Sheet:
    """Ploughed land: crumbling ridges along u, 56 cm apart.

    Args:
        tile: Where it repeats.
    """
    earth = soil(tile)
    ridge = _rows(tile, 8) + 0.45 * fractal(tile, 0.5, 0.04) + 0.25 * fractal(tile, 0.12)
    tone = 1 + 0.20 * np.clip(ridge, -1.6, 1.6)
    return Sheet(earth.albedo * (0.86 * tone)[..., None], earth.roughness, 0.045 * np.clip(ridge, -1.5, 1.5))


def crop(tile: Tile, ripe: bool) -> Sheet:
    """A field of cereals in rows along u, green or ripe; earth shows between them, and where it lodged.

    Args:
        tile: Where it repeats.
        ripe: Whether it is ready for harvest.
    """
    stalks, blades = fractal(tile, 0.09, 0.008, slope=0.5, stretch=(2.4, 1.0)), _filaments(tile, 0.07)
    stand = 0.9 * _rows(tile, 28) + 0.55 * stalks + 0.35 * fractal(tile, 1.2, 0.06)
    colors = _RIPE if ripe else _GREEN
    tone = 0.46 + 0.10 * stalks + 0.12 * blades + 0.05 * fractal(tile, 1.8, 0.2)
    earth = paint((0.105, 0.080, 0.055), 1 + 0.15 * stalks)
    thick = ramp(stand, -1.5, -0.1) if ripe else ramp(stand, -1.0, 0.5)
    return Sheet(cover(earth, thick, palette(tone, colors)), 0.93 + 0.01 * stalks, 0.05 * thick)


def water(tile: Tile) -> Sheet:
    """A slow river seen from the bank: the bed's murk, ripples, drifting foam.

    Args:
        tile: Where it repeats.
    """
    murk = fractal(tile, 4.0, 0.4)
    ripples = fractal(tile, 0.7, 0.05, slope=0.8, stretch=(2.2, 1.0))
    albedo = palette(
        0.45 + 0.10 * murk + 0.11 * ripples, ((0.018, 0.028, 0.024), (0.045, 0.062, 0.050), (0.085, 0.105, 0.088))
    )
    foam = ramp(_filaments(tile, 0.5) + 0.5 * murk, 2.7, 3.6)
    albedo = cover(albedo, 0.5 * foam, (0.42, 0.43, 0.40))
    return Sheet(albedo, np.clip(0.16 + 0.03 * ripples, 0.05, 1).astype(np.float32), 0.012 * ripples)


def open_water(tile: Tile) -> Sheet:
    """A lake or a sea: cat's paws and streaks of the wind on deep water.

    Args:
        tile: Where it repeats.
    """
    wind = fractal(tile, 60.0, 6.0)
    streaks = fractal(tile, 22.0, 2.0, slope=0.7, stretch=(3.0, 1.0))
    ripples = fractal(tile, 3.5, slope=0.5, stretch=(2.0, 1.0))
    tone = 0.45 + 0.10 * wind + 0.09 * streaks + 0.13 * ripples
    albedo = palette(tone, ((0.012, 0.026, 0.030), (0.030, 0.055, 0.060), (0.062, 0.095, 0.098)))
    rough = np.clip(0.13 + 0.035 * wind + 0.03 * ripples, 0.05, 1).astype(np.float32)
    return Sheet(albedo, rough, 0.02 * ripples)


def woodland(tile: Tile, broad: tuple[Color, Color] | None = None, turf: Color | None = None) -> Sheet:
    """A mixed wood seen from far off: crowns small and large, stands of conifers, gaps, thinned places.

    Args:
        tile: Where it repeats.
        broad: Factors of broad leaves, from the crowns that turn least to those that turn most [1]; None in summer.
        turf: Factors of the grass that shows in thinned places [1]; None in summer.
    """
    large, small = cells(tile, 8.2, jitter=0.95), cells(tile, 4.6, jitter=0.95)
    stand, leaves = fractal(tile, 120.0, 9.0), fractal(tile, 3.0, slope=0.4)
    dark = ramp(stand + 0.25 * fractal(tile, 26.0, 3.0), 0.25, 0.75)
    own = (1 - dark) * per_cell(tile, large) + dark * per_cell(tile, small)
    hue = per_cell(tile, large)
    near = (1 - dark) * large.near + dark * small.near
    dome = ramp(near, 0.66, 0.10)
    tone = (0.22 + 0.40 * dome * (0.45 + 0.8 * own)) * (1 + 0.08 * stand) + 0.05 * leaves
    albedo = palette(tone, _LEAVES)
    albedo = cover(albedo, 0.5 * dome * ramp(hue, 0.66, 1.0), paint((0.088, 0.092, 0.034), 1 + 0.15 * leaves))
    if broad is not None:
        least, most = np.asarray(broad, np.float32)
        albedo = albedo * (least + ramp(hue, 0.05, 0.95)[..., None] * (most - least))
    needles = paint((0.026, 0.044, 0.020), (0.35 + 0.95 * dome * (0.5 + own)) * (1 + 0.10 * leaves))
    albedo = cover(albedo, dark, needles)
    thin = ramp(fractal(tile, 70.0, 6.0) - 0.5 * dome, 1.15, 1.9)
    ground = np.asarray((0.085, 0.100, 0.042), np.float32) * np.asarray(turf or (1.0, 1.0, 1.0), np.float32)
    albedo = cover(albedo, 0.8 * thin, paint(tuple(ground.tolist()), 1 + 0.20 * leaves))
    return Sheet(albedo, 0.93 + 0.01 * leaves, 1.2 * dome)


def timber(tile: Tile, age: float, color: Color = (0.155, 0.120, 0.088)) -> Sheet:
    """Weathered oak with the grain along u: checks, knots, tar.

    Args:
        tile: Where it repeats.
        age: 0 for newly sawn, 1 for decades of weather [1].
        color: Linear color of the wood [1].
    """
    rings = fractal(tile, 0.10, 0.006, slope=0.6, stretch=(20.0, 1.0))
    check = ramp(fractal(tile, 0.12, 0.006, stretch=(16.7, 1.0)), 2.3 - age, 3.0 - age)
    albedo = paint(color, 1 + 0.14 * rings + 0.10 * fractal(tile, 0.8, 0.02))
    albedo = cover(albedo, 0.6 * check, (0.050, 0.040, 0.031))
    return Sheet(albedo, 0.9 + 0.02 * rings, 0.002 * rings - 0.006 * check)


def bark(tile: Tile) -> Sheet:
    """Furrowed bark with the stem along v.

    Args:
        tile: Where it repeats.
    """
    ridges = np.abs(fractal(tile, 0.16, 0.012, slope=1.0, stretch=(1.0, 5.0)))
    cross = np.abs(fractal(tile, 0.16, 0.02, slope=0.8, stretch=(1.0, 1.2)))
    furrow = np.maximum(ramp(ridges, 0.55, 0.05), 0.7 * ramp(cross, 0.18, 0.02))
    grain = fractal(tile, 0.06, 0.005, slope=0.5, stretch=(1.0, 3.0))
    tone = (1.05 + 0.14 * grain + 0.10 * fractal(tile, 0.5, 0.05)) * (1 - 0.62 * furrow)
    albedo = paint((0.165, 0.132, 0.098), tone)
    albedo = cover(albedo, 0.5 * ramp(fractal(tile, 0.6, 0.02), 0.8, 2.0), (0.12, 0.135, 0.07))
    return Sheet(albedo, 0.94 + 0.01 * grain, 0.014 * (1 - furrow))


def foliage(tile: Tile) -> Sheet:
    """A crown of broad leaves, opaque: leaves on leaves, dark gaps between twigs.

    Args:
        tile: Where it repeats.
    """
    albedo = paint((0.020, 0.032, 0.010), 1 + 0.2 * fractal(tile, 0.3, 0.01))
    relief = np.zeros(albedo.shape[:2], np.float32)
    for depth, (pitch, stretch, share) in enumerate(((0.060, 0.60, 0.8), (0.055, 1.6, 0.7), (0.075, 0.75, 0.55))):
        leaves = cells(tile, pitch, stretch=stretch, jitter=1.0)
        own, chance = per_cell(tile, leaves), per_cell(tile, leaves)
        body = ramp(leaves.near, 0.48, 0.38) * (chance < np.float32(share))
        lit = (0.42, 0.68, 0.95)[depth] * (0.55 + 0.8 * own) - 0.3 * leaves.near
        albedo = cover(albedo, body, palette(0.8 * lit, _LEAVES))
        relief = np.maximum(relief, body * np.float32(0.01 * (depth + 1)))
    gaps = ramp(fractal(tile, 0.6, 0.05), 0.5, 1.9)
    return Sheet(albedo * (1 - 0.65 * gaps)[..., None], (0.72 - 0.1 * relief).astype(np.float32), relief - 0.03 * gaps)


# Mean distance of pebbles [m], and the share of the places that hold one.
_PEBBLES = ((0.26, 0.13), (0.12, 0.32), (0.06, 0.42), (0.032, 0.36))
# Mean distance of dry leaves, fresh ones and seedlings [m], their shape, the share of the places, and their color.
_LITTER: tuple[tuple[float, float, float, Color], ...] = (
    (0.11, 0.50, 0.10, (0.192, 0.134, 0.069)),
    (0.09, 1.90, 0.08, (0.154, 0.100, 0.054)),
    (0.20, 0.80, 0.06, (0.065, 0.092, 0.035)),
)
# Turf of low sun to full; with straw and soil its mean is that of measured turf, 6 % red, 8 % green, 3 % blue.
_BLADES: tuple[Color, ...] = (
    (0.016, 0.024, 0.010),
    (0.037, 0.058, 0.021),
    (0.068, 0.095, 0.035),
    (0.116, 0.136, 0.058),
)
_HAY: tuple[Color, ...] = ((0.045, 0.055, 0.025), (0.115, 0.122, 0.052), (0.205, 0.185, 0.092), (0.300, 0.255, 0.150))
_GREEN: tuple[Color, ...] = ((0.016, 0.030, 0.013), (0.042, 0.074, 0.027), (0.080, 0.118, 0.042))
_RIPE: tuple[Color, ...] = ((0.105, 0.078, 0.036), (0.255, 0.200, 0.092), (0.400, 0.330, 0.175))
_LEAVES: tuple[Color, ...] = (
    (0.014, 0.026, 0.008),
    (0.038, 0.070, 0.017),
    (0.075, 0.120, 0.030),
    (0.135, 0.180, 0.055),
)


def _rows(tile: Tile, count: int) -> Floats:
    """Even rows along u, so many on a tile: -1 to 1, shape (pixels, pixels), float32."""
    place = (np.arange(tile.pixels) + 0.5) / tile.pixels
    return snap(np.sin(2 * np.pi * count * place))[:, None] * np.ones((1, tile.pixels), np.float32)


def _filaments(tile: Tile, length: float) -> Floats:
    """Thin crossing strands: the crests of two ridged fields."""
    one = np.abs(fractal(tile, length, length / 8, slope=0.6, stretch=(1.0, 2.0)))
    two = np.abs(fractal(tile, length, length / 8, slope=0.6, stretch=(2.0, 1.0)))
    return (1.6 - 2.6 * np.minimum(one, two)).astype(np.float32)
