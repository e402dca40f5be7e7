"""Recipes of towns: glazing, cladding, pavement, roofing, a palette of paints, and whole facades seen from afar."""

import numpy as np

from authoring.looks.mineral import brick
from authoring.looks.noise import Floats, Tile, draw, fractal, joints, ramp
from authoring.looks.sheet import Color, Sheet, cover, paint

PALETTE: tuple[Color, ...] = (
    (0.70, 0.70, 0.68),
    (0.38, 0.39, 0.40),
    (0.085, 0.09, 0.095),
    (0.018, 0.018, 0.020),
    (0.36, 0.028, 0.024),
    (0.030, 0.085, 0.26),
    (0.68, 0.43, 0.035),
    (0.035, 0.150, 0.085),
)


def facade_glass(tile: Tile, color: Color) -> Sheet:
    """Tinted glazing of offices: panes that lean a little each its own way, blinds behind some of them.

    Args:
        tile: Where it repeats.
        color: Linear color of the panes [1].
    """
    own = _per_pane(tile, 1.5, 1.8)
    veil = fractal(tile, 2.0, 0.08)
    albedo = paint(color, 0.72 + 0.55 * own + 0.06 * veil)
    albedo = cover(albedo, 0.45 * ramp(_per_pane(tile, 1.5, 1.8), 0.88, 0.92), (0.115, 0.12, 0.12))
    return Sheet(albedo, (0.09 + 0.02 * np.clip(veil, -2, 2)).astype(np.float32))


def cladding(tile: Tile, color: Color) -> Sheet:
    """Metal panels with open joints, each of a tone of its own.

    Args:
        tile: Where it repeats.
        color: Linear color of the metal [1].
    """
    seam = np.maximum(joints(tile, 1.5, 0.02, "u"), joints(tile, 1.0, 0.02, "v"))
    dust = fractal(tile, 0.6, 0.01)
    streaks = ramp(fractal(tile, 0.6, 0.02, stretch=(1.0, 7.0)), 0.4, 2.4)
    albedo = paint(color, 0.92 + 0.16 * _per_pane(tile, 1.5, 1.0) + 0.05 * dust)
    albedo = cover(albedo, 0.18 * streaks, (0.13, 0.12, 0.11))
    return Sheet(cover(albedo, 0.75 * seam, (0.02, 0.02, 0.02)), (0.42 + 0.04 * dust).astype(np.float32))


def pavement(tile: Tile) -> Sheet:
    """Concrete flags of a pavement: joints, chewing gum, damp patches.

    Args:
        tile: Where it repeats.
    """
    seam = np.maximum(joints(tile, 0.75, 0.012, "u"), joints(tile, 0.75, 0.012, "v"))
    grain, clouds = fractal(tile, 0.05, slope=0.3), fractal(tile, 1.6, 0.06)
    tone = 0.90 + 0.20 * _per_pane(tile, 0.75, 0.75) + 0.07 * grain + 0.09 * clouds
    albedo = paint((0.205, 0.197, 0.182), tone)
    albedo = cover(albedo, 0.4 * ramp(fractal(tile, 0.5, 0.03), 1.2, 2.4), (0.11, 0.105, 0.095))
    albedo = cover(albedo, 0.7 * ramp(fractal(tile, 0.07, 0.03, slope=0.2), 2.6, 3.0), (0.07, 0.068, 0.065))
    return Sheet(cover(albedo, 0.7 * seam, (0.09, 0.085, 0.075)), (0.88 + 0.02 * grain).astype(np.float32))


def roofing(tile: Tile) -> Sheet:
    """Bitumen felt under grit, in lapped sheets, with puddle stains.

    Args:
        tile: Where it repeats.
    """
    lap = joints(tile, 1.0, 0.03, "v")
    grit, clouds = fractal(tile, 0.04, slope=0.2), fractal(tile, 2.4, 0.08)
    albedo = paint((0.155, 0.150, 0.142), 1 + 0.16 * grit + 0.16 * clouds)
    albedo = cover(albedo, 0.5 * ramp(fractal(tile, 1.4, 0.05), 0.8, 1.8), (0.245, 0.235, 0.215))
    return Sheet(cover(albedo, 0.5 * lap, (0.05, 0.05, 0.05)), (0.93 + 0.01 * grit).astype(np.float32))


def paint_colors(tile: Tile) -> Sheet:
    """Stripes of glossy paint, one meter each: a mesh picks its color by a constant `st`.

    Args:
        tile: Where it repeats; as many meters as colors.
    """
    stripe = (np.arange(tile.pixels) * len(PALETTE)) // tile.pixels
    row = np.asarray(PALETTE, np.float32)[stripe]
    albedo = np.broadcast_to(row[None], (tile.pixels, tile.pixels, 3)).copy()
    return Sheet(albedo, np.full((tile.pixels, tile.pixels), 0.30, np.float32))


def buff_brick(tile: Tile) -> Sheet:
    """Bricks of yellow clay.

    Args:
        tile: Where it repeats.
    """
    red = brick(tile)
    gray = red.albedo.mean(axis=-1, dtype=np.float32)
    clay = paint((0.335, 0.262, 0.168), np.minimum(gray / np.float32(0.135), 2.4))
    return Sheet(cover(red.albedo, np.full_like(gray, 0.85), clay), red.roughness, red.height)


def far_facade(tile: Tile, wall: Color, pane: tuple[float, float], opening: tuple[float, float]) -> Sheet:
    """A whole facade seen from afar: windows in rows, their blinds and their reveals.

    Args:
        tile: Where it repeats.
        wall: Linear color of the wall [1].
        pane: Distance between windows along and up the wall [m].
        opening: Share of it that is glass, along and up [1].
    """
    steps = (np.arange(tile.pixels, dtype=np.float32) + np.float32(0.5)) / np.float32(tile.pixels)
    inside = []
    for size, share in zip(pane, opening, strict=True):
        at = np.abs((steps * np.float32(max(1, round(tile.meters / size)))) % 1 - np.float32(0.5))
        inside.append(ramp(at, share / 2 + 0.02, share / 2 - 0.02))
    # Rows of the sheet run against `v`, which does not matter to a pattern that is even about its middle.
    glass = inside[1][:, None] * inside[0][None, :]
    grain, clouds = fractal(tile, 0.2, slope=0.4), fractal(tile, 3.0, 0.1)
    streaks = ramp(fractal(tile, 0.8, 0.04, stretch=(1.0, 6.0)), 0.4, 2.4)
    face = cover(paint(wall, 1 + 0.06 * grain + 0.07 * clouds), 0.22 * streaks, (0.12, 0.11, 0.10))
    own = _per_pane(tile, *pane)
    room = paint((0.050, 0.062, 0.075), 0.6 + 0.9 * own)
    pale = tuple(0.05 + 0.35 * value for value in wall)
    room = cover(room, 0.55 * ramp(_per_pane(tile, *pane), 0.80, 0.84), (pale[0], pale[1], pale[2]))
    return Sheet(cover(face, glass, room), (0.85 - 0.72 * glass).astype(np.float32))


def _per_pane(tile: Tile, wide: float, high: float) -> Floats:
    """Draw a value for each pane of a grid, shape (H, W), float32."""
    rows, columns = max(1, round(tile.meters / high)), max(1, round(tile.meters / wide))
    steps = (np.arange(tile.pixels, dtype=np.float32) + 0.5) / tile.pixels
    drawn = draw(tile.rng, (rows, columns))
    return drawn[(steps * rows).astype(np.int32)[:, None], (steps * columns).astype(np.int32)[None, :]]
