"""Recipes of finished walls: washed aggregate, coatings, rubble, brickwork."""

import numpy as np

from authoring.looks.mineral import brick, concrete_skin, cracked, stained
from authoring.looks.noise import Tile, cells, fractal, per_cell, ramp
from authoring.looks.sheet import Color, Sheet, cover, paint


def washed_concrete(tile: Tile, age: float, color: Color = (0.300, 0.280, 0.240)) -> Sheet:
    """Concrete whose skin was washed off: pebbles of several kinds in a gray matrix.

    Args:
        tile: Where it repeats.
        age: 0 for new, 1 for decades of weather [1].
        color: Mean linear color of the pebbles [1].
    """
    tone, _ = concrete_skin(tile, 0.5 * age)
    albedo, relief = paint((0.345, 0.335, 0.310), tone), np.zeros_like(tone)
    for pitch, share in ((0.019, 0.9), (0.013, 0.75), (0.008, 0.6)):
        layer = cells(tile, pitch, stretch=1.1, jitter=0.9)
        own, kind, chance = (per_cell(tile, layer) for _ in range(3))
        body = ramp(np.minimum(0.52 - layer.near, layer.second - layer.near), 0.02, 0.12) * (chance < np.float32(share))
        pebble = cover(
            paint(color, 0.80 + 0.35 * own), ramp(kind, 0.7, 0.9), paint((0.235, 0.195, 0.155), 0.8 + 0.4 * own)
        )
        albedo = cover(albedo, body, pebble)
        relief = np.maximum(relief, 0.2 * pitch * body)
    return Sheet(stained(tile, albedo, 0.8 * age), (0.90 - 0.1 * relief).astype(np.float32), relief)


def coated_concrete(tile: Tile, age: float, color: Color = (0.520, 0.505, 0.455)) -> Sheet:
    """Concrete under a pale elastic coating; with age it chalks, cracks, and flakes where water stands behind it.

    Args:
        tile: Where it repeats.
        age: 0 for new, 1 for overdue [1].
        color: Linear color of the coating [1].
    """
    roll, clouds = fractal(tile, 0.05, slope=0.2), fractal(tile, 1.2, 0.12)
    tone, pores = concrete_skin(tile, age)
    albedo = paint(color, 1 + (0.015 + 0.04 * age) * roll + (0.02 + 0.07 * age) * clouds)
    flakes = fractal(tile, 0.5, 0.012)
    bare = ramp(flakes, 2.7 - 1.0 * age, 2.8 - 1.0 * age) if age > 0.2 else np.zeros_like(flakes)
    albedo = cover(albedo, 0.9 * bare, paint((0.34, 0.325, 0.295), tone))
    albedo = stained(tile, cracked(tile, albedo, 0.5 * age), 0.8 * age)
    return Sheet(albedo, (0.55 + 0.2 * min(age, 1) + 0.15 * bare).astype(np.float32), -0.002 * bare - 0.001 * pores)


def rubble(tile: Tile, age: float, color: Color = (0.285, 0.260, 0.215)) -> Sheet:
    """Walls of unsquared stone in wide mortar.

    Args:
        tile: Where it repeats.
        age: 0 for newly built, 1 for centuries of weather [1].
        color: Mean linear color of the stones [1].
    """
    blocks = cells(tile, 0.26, stretch=1.7, jitter=0.75)
    own, hue = per_cell(tile, blocks), per_cell(tile, blocks)
    grain, clouds = fractal(tile, 0.05, 0.008, slope=0.3), fractal(tile, 0.5, 0.03)
    border = blocks.second - blocks.near + 0.02 * fractal(tile, 0.3, 0.03)
    face = ramp(border, 0.07, 0.14)
    tone = 0.70 + 0.60 * own + (0.07 + 0.05 * age) * clouds + 0.09 * grain
    stone = cover(paint(color, tone), ramp(hue, 0.55, 1.0), paint((0.235, 0.235, 0.240), tone))
    stone = cover(stone, ramp(hue, 0.22, 0.0), paint((0.300, 0.225, 0.155), tone))
    albedo = cover(paint((0.345, 0.325, 0.285), 1 + 0.10 * grain), face, stone)
    return Sheet(stained(tile, albedo, age), 0.90 + 0.02 * grain, 0.030 * ramp(border, 0.05, 0.45) + 0.004 * clouds)


def brickwork(tile: Tile, age: float) -> Sheet:
    """Engineering brick of viaducts, sooted with age.

    Args:
        tile: Where it repeats.
        age: 0 for newly laid, 1 for a century of smoke [1].
    """
    new = brick(tile)
    return Sheet(stained(tile, new.albedo, age), new.roughness, new.height)
