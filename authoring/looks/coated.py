"""Recipes of metal, paint, rubber and glass."""

import numpy as np

from authoring.looks.noise import Floats, Tile, cells, fractal, per_cell, ramp, spots
from authoring.looks.sheet import Color, Sheet, cover, paint, palette

_RUST: tuple[Color, ...] = ((0.045, 0.022, 0.014), (0.110, 0.048, 0.022), (0.200, 0.090, 0.038))


def painted_steel(tile: Tile, color: Color, age: float) -> Sheet:
    """Steel under paint: brush marks and dust; with age chalking, chips and rust.

    Args:
        tile: Where it repeats.
        color: Linear color of the paint [1].
        age: 0 for newly painted, 1 for overdue [1].
    """
    clouds, dust = fractal(tile, 1.8, 0.05), fractal(tile, 0.05, slope=0.2)
    albedo = paint(color, 1 + (0.01 + 0.015 * age) * clouds + (0.015 + 0.055 * age) * dust)
    chalk = ramp(fractal(tile, 0.8, 0.03, stretch=(1.0, 3.3)), 0.3, 2.4)
    pale = (0.6 * color[0] + 0.14, 0.6 * color[1] + 0.14, 0.6 * color[2] + 0.135)
    albedo = cover(albedo, 0.22 * np.float32(age) * chalk, pale)
    # Blisters break where rust creeps below the paint; what the rain washes out of them runs down.
    # They come in patches, where the coat was thin.
    bloom = fractal(tile, 0.16, 0.012, slope=0.8) + np.float32(1.1) * fractal(tile, 2.4, 0.2)
    start = 4.7 - 1.1 * age  # few blisters after decades, many on paint that is overdue
    rust = ramp(bloom, start, start + 0.25) if age > 0 else np.zeros_like(bloom)
    halo = ramp(bloom, start - 0.5, start + 0.1) if age > 0 else np.zeros_like(bloom)
    albedo = cover(albedo, 0.30 * halo, (0.17, 0.095, 0.055))
    albedo = cover(albedo, rust, rusted(tile))
    return Sheet(
        albedo, np.clip(0.42 + 0.25 * age + 0.25 * rust + 0.03 * clouds, 0, 1).astype(np.float32), 0.0006 * rust
    )


def rusted(tile: Tile) -> Floats:
    """Draw the colors of rust.

    Args:
        tile: Where it repeats.

    Returns:
        Linear color [1], shape (H, W, 3), float32.
    """
    return palette(0.5 + 0.12 * fractal(tile, 0.5, 0.02) + 0.10 * fractal(tile, 0.04, slope=0.3), _RUST)


def weathering_steel(tile: Tile, age: float) -> Sheet:
    """Unpainted weathering steel: a dense brown patina, orange while it is young, streaked and flaky when old.

    Args:
        tile: Where it repeats.
        age: 0 for the first years, 1 for decades [1].
    """
    clouds, grain = fractal(tile, 1.2, 0.05), fractal(tile, 0.04, slope=0.25)
    streaks = fractal(tile, 0.5, 0.015, stretch=(1.0, 6.0))
    tone = 0.52 - 0.16 * (age - 0.5) + 0.04 * clouds + 0.09 * grain + 0.05 * streaks
    albedo = palette(tone, ((0.034, 0.019, 0.015), (0.090, 0.043, 0.026), (0.175, 0.078, 0.036), (0.270, 0.125, 0.050)))
    flakes = ramp(fractal(tile, 0.14, 0.02), 2.6 - 0.9 * age, 3.0 - 0.9 * age)
    albedo = cover(albedo, 0.6 * flakes, (0.030, 0.020, 0.017))
    return Sheet(albedo, (0.88 + 0.02 * clouds).astype(np.float32), 0.0004 * grain + 0.0008 * flakes)


def rail_steel(tile: Tile, age: float) -> Sheet:
    """Bare rolled steel under a coat of rust dust.

    Args:
        tile: Where it repeats.
        age: 0 for newly laid, 1 for old [1].
    """
    albedo = cover(
        paint((0.16, 0.15, 0.145), 1 + 0.1 * fractal(tile, 0.3, 0.02, stretch=(10.0, 1.0))),
        np.full((tile.pixels, tile.pixels), min(0.4 + 0.5 * age, 1), np.float32),
        rusted(tile),
    )
    return Sheet(albedo, np.full((tile.pixels, tile.pixels), 0.75, np.float32))


def galvanised(tile: Tile, age: float, color: Color = (0.36, 0.365, 0.37)) -> Sheet:
    """Hot-dip galvanised steel: spangle, white rust, dirt.

    Args:
        tile: Where it repeats.
        age: 0 for new, 1 for dull [1].
        color: Linear color of the zinc [1].
    """
    spangle = per_cell(tile, cells(tile, 0.022)) - 0.5
    clouds, dust = fractal(tile, 0.8, 0.03), fractal(tile, 0.04, slope=0.2)
    tone = 1 + (0.16 - 0.06 * age) * spangle + (0.02 + 0.015 * age) * clouds + (0.02 + 0.05 * age) * dust
    albedo = paint(color, tone)
    albedo = cover(albedo, 0.3 * np.float32(age) * ramp(fractal(tile, 0.07, 0.01), 1.0, 2.2), (0.50, 0.50, 0.49))
    albedo = cover(albedo, 0.25 * np.float32(age) * ramp(fractal(tile, 0.08, 0.01), 1.2, 2.4), (0.12, 0.10, 0.08))
    return Sheet(albedo, (0.48 + 0.15 * age + 0.08 * spangle).astype(np.float32))


def rubber(tile: Tile, age: float) -> Sheet:
    """Chloroprene rubber of bearings, dusty and blooming with age.

    Args:
        tile: Where it repeats.
        age: 0 for new, 1 for old [1].
    """
    dust = ramp(fractal(tile, 0.4, 0.02), -1.2, 2.2)
    albedo = paint((0.034, 0.034, 0.036), 1 + 0.14 * fractal(tile, 0.06, slope=0.3))
    albedo = cover(albedo, (0.10 + 0.22 * age) * dust, (0.125, 0.118, 0.105))
    return Sheet(albedo, (0.72 + 0.15 * dust).astype(np.float32))


def marking(tile: Tile, age: float, road: Floats, color: Color = (0.60, 0.595, 0.57)) -> Sheet:
    """Road paint that wears off the stones below it.

    Args:
        tile: Where it repeats.
        age: 0 for new, 1 for worn [1].
        road: Linear color of the road under it [1], shape (H, W, 3), float32.
        color: Linear color of the paint [1].
    """
    worn = ramp(fractal(tile, 0.8, 0.03) + 0.9 * fractal(tile, 0.04, slope=0.2), 2.6 - 2.0 * age, 3.4 - 2.0 * age)
    film = paint(color, 1 + 0.05 * fractal(tile, 1.0, 0.05) + 0.05 * fractal(tile, 0.04, slope=0.2))
    film = cover(film, (0.08 + 0.20 * age) * ramp(fractal(tile, 0.9, 0.04), -0.5, 2.2), (0.16, 0.15, 0.14))
    return Sheet(cover(film, (0.85 - 0.35 * age) * worn, road), (0.62 + 0.25 * worn).astype(np.float32))


def glass(tile: Tile) -> Sheet:
    """Window panes by day: dark rooms, blinds here and there, a veil of dust.

    Args:
        tile: Where it repeats.
    """
    veil = fractal(tile, 1.5, 0.05, stretch=(1.0, 2.0))
    albedo = paint((0.048, 0.056, 0.064), 1 + 0.12 * veil + 0.05 * fractal(tile, 0.05, slope=0.3))
    albedo = cover(albedo, 0.3 * spots(tile, 0.05, 0.008, 0.10), (0.14, 0.14, 0.13))
    return Sheet(albedo, (0.10 + 0.02 * np.clip(veil, -2, 2)).astype(np.float32))
