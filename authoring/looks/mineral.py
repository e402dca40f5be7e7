"""Recipes of concrete, asphalt, stone and brick."""

import numpy as np

from authoring.looks.noise import Floats, Tile, cells, draw, fractal, joints, per_cell, ramp, spots
from authoring.looks.sheet import Color, Sheet, cover, paint

_CEMENT: Color = (0.350, 0.338, 0.312)
_SOOT: Color = (0.10, 0.095, 0.085)
_LIME: Color = (0.62, 0.61, 0.58)


def concrete_skin(tile: Tile, age: float) -> tuple[Floats, Floats]:
    """Draw what all formed concrete shares: clouds of tone, sandy grain, aggregate showing through and pores.

    Args:
        tile: Where it repeats.
        age: 0 for newly struck, 1 for decades of weather [1].

    Returns:
        Tone [1] around 1, and pores (1 inside), each of shape (H, W), float32.
    """
    clouds = fractal(tile, 1.2, 0.12)
    grain = fractal(tile, 0.16, 0.012, slope=0.55)
    sand = fractal(tile, 0.03, slope=0.0)
    tone = 1 + (0.015 + 0.015 * age) * clouds + (0.025 + 0.015 * age) * grain + (0.03 + 0.02 * age) * sand
    pores = np.maximum(spots(tile, 0.08, 0.0085, 0.25), 0.8 * spots(tile, 0.025, 0.0045, 0.12))
    return (tone * (1 - 0.45 * pores)).astype(np.float32), pores


def board_concrete(tile: Tile, age: float, color: Color = _CEMENT) -> Sheet:
    """Concrete cast against sawn boards that lie along u.

    Args:
        tile: Where it repeats.
        age: 0 for newly struck, 1 for decades of weather [1].
        color: Linear color of the cement skin [1].
    """
    tone, pores = concrete_skin(tile, age)
    wood = fractal(tile, 0.10, 0.006, slope=0.7, stretch=(16.0, 1.0))
    board, seam = _boards(tile, 0.125, 2.5)
    seam = seam * ramp(fractal(tile, 0.8, 0.1, stretch=(3.0, 1.0)), -1.6, 0.4)
    tone = tone * (1 + 0.16 * (board - 0.5) + (0.035 + 0.025 * age) * wood) * (1 - 0.38 * seam)
    albedo = stained(tile, hairlines(tile, paint(color, tone), age), age)
    relief = 0.0012 * wood + 0.004 * board - 0.003 * seam - 0.004 * pores
    return Sheet(albedo, 0.86 + 0.03 * wood, relief.astype(np.float32))


def panel_concrete(tile: Tile, age: float, color: Color = _CEMENT, ties: bool = True) -> Sheet:
    """Concrete cast against plywood panels: joints with their grout, tie holes, a tone of its own for each panel.

    Args:
        tile: Where it repeats.
        age: 0 for newly struck, 1 for decades of weather [1].
        color: Linear color of the cement skin [1].
        ties: Whether the two sides of the form were tied through the concrete.
    """
    tone, pores = concrete_skin(tile, age)
    broken = ramp(fractal(tile, 1.0, 0.1), -2.0, -0.2)
    seam = np.maximum(joints(tile, 1.25, 0.010, "u"), joints(tile, 2.5, 0.010, "v")) * broken
    grout = np.maximum(joints(tile, 1.25, 0.07, "u"), joints(tile, 2.5, 0.07, "v")) * (1.2 - broken)
    rows, columns = max(1, round(tile.meters / 1.25)), max(1, round(tile.meters / 2.5))
    panel = draw(tile.rng, (rows, columns))
    row = np.arange(tile.pixels) * rows // tile.pixels
    column = np.arange(tile.pixels) * columns // tile.pixels
    tone = tone * (1 + 0.06 * (panel[row][:, column] - 0.5)) * (1 + 0.08 * grout) * (1 - 0.42 * seam)
    holes, rims = _tie_holes(tile, rows, columns)
    if ties:
        tone = tone * (1 + 0.10 * rims) * (1 - 0.75 * holes)
    holes = holes * np.float32(ties)
    albedo = stained(tile, hairlines(tile, paint(color, tone), age), age)
    return Sheet(albedo, 0.80 + 0.04 * fractal(tile, 0.6, 0.05), (-0.003 * seam - 0.015 * holes - 0.004 * pores))


def smooth_concrete(tile: Tile, age: float, color: Color = (0.385, 0.375, 0.350)) -> Sheet:
    """Precast concrete from a steel mold: fewer marks, lighter, pores in the vertical faces.

    Args:
        tile: Where it repeats.
        age: 0 for newly struck, 1 for decades of weather [1].
        color: Linear color of the cement skin [1].
    """
    tone, pores = concrete_skin(tile, age)
    drift = fractal(tile, 1.5, 0.06, stretch=(1.0, 3.3))
    albedo = stained(tile, hairlines(tile, paint(color, tone * (1 + 0.04 * drift)), 0.7 * age), 0.7 * age)
    return Sheet(albedo, 0.78 + 0.03 * drift, -0.004 * pores)


def deck_concrete(tile: Tile, age: float, color: Color = (0.315, 0.300, 0.275)) -> Sheet:
    """Concrete with a broomed, worn top: grooves along v, aggregate laid bare.

    Args:
        tile: Where it repeats.
        age: 0 for newly struck, 1 for decades of weather [1].
        color: Linear color of the cement skin [1].
    """
    tone, pores = concrete_skin(tile, age)
    grooves = fractal(tile, 0.05, 0.008, slope=0.3, stretch=(1.0, 12.5))
    stones = cells(tile, 0.022)
    bare = (
        ramp(stones.near, 0.42, 0.30)
        * ramp(fractal(tile, 0.6, 0.02, slope=0.5, stretch=(3.0, 1.0)), 0.0, 1.6)
        * np.float32(age)
    )
    albedo = paint(color, tone * (1 + 0.05 * grooves))
    albedo = cover(albedo, 0.8 * bare, paint((0.27, 0.25, 0.22), 0.5 + per_cell(tile, stones)))
    albedo = stained(tile, cracked(tile, albedo, 0.5 * age), age)
    return Sheet(albedo, 0.88 + 0.03 * grooves, 0.001 * grooves - 0.003 * pores)


def asphalt(
    tile: Tile, age: float, bitumen: Color = (0.066, 0.065, 0.063), stone: Color = (0.150, 0.146, 0.138)
) -> Sheet:
    """Dense asphalt concrete: stones in bitumen, worn paths, oil, cracks and their sealing.

    Args:
        tile: Where it repeats.
        age: 0 for newly laid, 1 for decades of traffic [1].
        bitumen: Linear color of the binder [1].
        stone: Mean linear color of the stones, which bitumen coats until traffic has worn it off [1].
    """
    stones = cells(tile, 0.017)
    own = per_cell(tile, stones)
    bare = ramp(stones.near, 0.50, 0.30) * ramp(fractal(tile, 0.16, 0.02), -2.6, 1.2) * (0.35 + 0.65 * age)
    tone = 1 + 0.025 * fractal(tile, 1.2, 0.15) + (0.07 + 0.03 * age) * fractal(tile, 0.08, 0.012, slope=0.4)
    albedo = paint(bitumen, tone)
    albedo = cover(albedo, bare * 0.62, paint(stone, 0.55 + 0.75 * own * own))
    worn = ramp(fractal(tile, 0.10, 0.02, stretch=(5.0, 1.0)), 0.6, 2.2)  # along u, the way that wheels run
    albedo = cover(albedo, (0.06 + 0.10 * age) * worn, paint((0.175, 0.170, 0.158), tone))
    oil = spots(tile, 0.9, 0.022, 0.10)
    albedo = cover(albedo, (0.25 + 0.20 * min(age, 1)) * oil, (0.026, 0.025, 0.024))
    albedo = cracked(tile, albedo, age)
    relief = 0.004 * ramp(stones.near, 0.5, 0.1) * own
    return Sheet(albedo, np.clip(0.90 - 0.25 * oil, 0.3, 1).astype(np.float32), relief)


def plaster(tile: Tile, color: Color) -> Sheet:
    """Rendered wall: rough cast, washed-out paint, damp patches, hairlines.

    Args:
        tile: Where it repeats.
        color: Linear color of the paint [1].
    """
    rough = fractal(tile, 0.06, 0.010, slope=0.3)
    clouds, damp = fractal(tile, 2.5, 0.1), fractal(tile, 1.4, 0.05)
    albedo = paint(color, 1 + 0.075 * rough + 0.06 * clouds)
    albedo = cover(albedo, 0.35 * ramp(damp, 0.7, 2.4), (0.20, 0.185, 0.16))
    albedo = cover(albedo, 0.8 * ramp(fractal(tile, 0.5, 0.02), 2.3, 2.6), (0.30, 0.285, 0.26))
    return Sheet(cracked(tile, albedo, 0.35), 0.9 + 0.02 * rough, 0.001 * rough)


def brick(tile: Tile) -> Sheet:
    """Fired brick in running bond with lime mortar.

    Args:
        tile: Where it repeats.
    """
    edge, own, hue = _courses(tile, 0.25, 0.077, 0.010)
    grit = fractal(tile, 0.08, 0.008, slope=0.4)
    fired = paint((0.235, 0.092, 0.060), 0.72 + 0.55 * own + 0.10 * grit)
    fired = cover(fired, ramp(hue, 0.55, 1.0), paint((0.265, 0.140, 0.085), 0.75 + 0.4 * own + 0.08 * grit))
    fired = cover(fired, 0.75 * ramp(hue, 0.14, 0.06), paint((0.085, 0.062, 0.058), 0.8 + 0.1 * grit))
    mortar = paint((0.36, 0.34, 0.30), 1 + 0.10 * grit + 0.10 * fractal(tile, 0.8, 0.08))
    bloom = 0.20 * ramp(fractal(tile, 1.1, 0.04), 0.9, 2.6)
    albedo = cover(cover(mortar, edge, fired), bloom, (0.46, 0.44, 0.42))
    return Sheet(albedo, (0.92 - 0.08 * edge).astype(np.float32), 0.008 * edge + 0.001 * grit)


def masonry(tile: Tile, age: float, color: Color = (0.33, 0.30, 0.25), other: Color = (0.30, 0.29, 0.27)) -> Sheet:
    """Squared stone in courses with thin joints.

    Args:
        tile: Where it repeats.
        age: 0 for newly dressed, 1 for centuries of weather [1].
        color: Linear color of most stones [1].
        other: Linear color of the others [1].
    """
    edge, own, hue = _courses(tile, 0.80, 0.40, 0.014)
    clouds, grain = fractal(tile, 0.5, 0.03), fractal(tile, 0.05, 0.008, slope=0.3)
    tone = 0.82 + 0.36 * own + (0.06 + 0.06 * age) * clouds + 0.09 * grain
    block = cover(paint(color, tone), ramp(hue, 0.5, 1.0), paint(other, tone))
    albedo = cover(paint((0.24, 0.225, 0.20), 1 + 0.1 * grain), edge, block)
    return Sheet(stained(tile, albedo, age), 0.88 + 0.03 * grain, 0.014 * edge + 0.004 * clouds)


def rock(tile: Tile) -> Sheet:
    """Bedded, fissured rock.

    Args:
        tile: Where it repeats.
    """
    beds = fractal(tile, 1.0, 0.05, stretch=(1.8, 1.0))
    facets, chips = cells(tile, 0.38, stretch=1.5, jitter=1.0), cells(tile, 0.11, stretch=1.3, jitter=1.0)
    grain = fractal(tile, 0.06, slope=0.4)
    ridges = np.abs(fractal(tile, 0.5, 0.012, slope=1.0)) - np.float32(0.8)
    fissure = ramp(np.abs(fractal(tile, 1.2, 0.012, slope=1.3, stretch=(1.5, 1.0))), 0.07, 0.015)
    fissure = fissure * ramp(fractal(tile, 1.0, 0.1), -0.6, 0.5)
    shades = 0.30 * (per_cell(tile, facets) - 0.5) + 0.30 * (per_cell(tile, chips) - 0.5)
    tone = (1 + shades + 0.05 * beds + 0.22 * ridges + 0.09 * grain) * (1 - 0.6 * fissure)
    albedo = cover(paint((0.235, 0.218, 0.190), tone), 0.45 * ramp(beds, 0.8, 2.4), (0.25, 0.20, 0.15))
    albedo = cover(albedo, 0.55 * ramp(fractal(tile, 0.4, 0.02), 1.1, 1.9), (0.30, 0.30, 0.225))
    return Sheet(albedo, 0.93 + 0.02 * grain, 0.02 * ridges - 0.03 * fissure + 0.05 * shades)


def cliff(tile: Tile) -> Sheet:
    """Steep rock seen from far off: beds, clefts with shrubs, ledges with grass, dark streaks of water, scree.

    Args:
        tile: Where it repeats.
    """
    beds, blocks = fractal(tile, 22.0, 1.2, stretch=(2.5, 1.0)), cells(tile, 9.0, stretch=1.6, jitter=1.0)
    grain, broad = fractal(tile, 2.0, slope=0.4), fractal(tile, 60.0, 6.0)
    cleft = ramp(np.abs(fractal(tile, 30.0, 0.8, slope=1.1)), 0.22, 0.05)
    tone = 1 + 0.16 * beds + 0.30 * (per_cell(tile, blocks) - 0.5) + 0.10 * grain + 0.10 * broad
    albedo = paint((0.150, 0.143, 0.128), tone * (1 - 0.45 * cleft))
    albedo = cover(albedo, 0.5 * ramp(beds + broad, 0.9, 2.4), (0.185, 0.160, 0.125))
    albedo = cover(
        albedo, 0.85 * ramp(broad + 0.7 * beds + 0.3 * grain, -0.2, 0.9), paint((0.070, 0.086, 0.036), 1 + 0.2 * grain)
    )
    albedo = cover(albedo, 0.9 * cleft * ramp(grain, -0.6, 0.6), (0.034, 0.050, 0.020))
    return Sheet(albedo, 0.93 + 0.01 * grain, 0.4 * beds)


def stones(tile: Tile, pitch: float, color: Color, bed: Color) -> Sheet:
    """Loose stones: gravel, ballast, river cobbles.

    Args:
        tile: Where it repeats.
        pitch: Mean size of the stones [m].
        color: Mean linear color of the stones [1].
        bed: Linear color between them [1].
    """
    grain, clouds = fractal(tile, 3 * pitch, slope=0.4), fractal(tile, 2.0, 0.2)
    albedo, relief = paint(bed, 1 + 0.2 * grain), np.zeros_like(grain)
    for share, size, stretch in ((0.9, 0.45, 1.3), (0.75, 0.7, 0.8), (0.6, 1.15, 1.25)):
        layer = cells(tile, size * pitch, stretch=stretch)
        own, chance, radius = (per_cell(tile, layer) for _ in range(3))
        border = np.minimum(0.36 + 0.22 * radius - layer.near, 0.8 * (layer.second - layer.near))
        body = ramp(border, 0.0, 0.10) * (chance < np.float32(share))
        rim = 0.83 + 0.17 * ramp(border, 0.0, 0.30)
        albedo = cover(
            albedo * (1 - 0.2 * body)[..., None], body, paint(color, (0.89 + 0.22 * own) * rim + 0.04 * grain)
        )
        relief = np.maximum(relief, body * ramp(border, -0.1, 0.5) * np.float32(0.5 * size * pitch))
    return Sheet(albedo * (1 + 0.06 * clouds)[..., None], 0.93 + 0.02 * grain, relief)


def roof_tile(tile: Tile, color: Color = (0.275, 0.120, 0.072)) -> Sheet:
    """Pantiles in rows; v runs up the slope.

    Args:
        tile: Where it repeats.
        color: Linear color of the tiles, of clay when not given [1].
    """
    rows, columns = max(1, round(tile.meters / 0.32)), max(1, round(tile.meters / 0.20))
    steps = (np.arange(tile.pixels, dtype=np.float32) + 0.5) / tile.pixels
    down, across = (steps * rows)[:, None], (steps * columns)[None, :]
    drawn = draw(tile.rng, (rows, columns))
    own = drawn[down.astype(np.int32), across.astype(np.int32)]
    lap, side = down - np.floor(down), np.abs(across - np.floor(across) - np.float32(0.5)) * 2
    roll = (1 - side * side).astype(np.float32)
    shade = (0.62 + 0.38 * roll) * (1 - 0.55 * ramp(lap, 0.10, 0.0)) * (1 - 0.4 * ramp(side, 0.86, 1.0))
    grain = fractal(tile, 0.12, 0.008, slope=0.5)
    albedo = paint(color, shade * (0.75 + 0.5 * own + 0.09 * grain))
    moss = ramp(fractal(tile, 0.9, 0.03), 0.8, 1.9)
    albedo = cover(albedo, 0.6 * moss, (0.095, 0.088, 0.058))
    return Sheet(albedo, 0.88 + 0.02 * grain, 0.03 * roll + 0.02 * lap)


def stained(tile: Tile, albedo: Floats, age: float) -> Floats:
    """Lay a film of soot over a mineral surface, and specks of algae and lichen in colonies.

    What water and gravity do is not known here: `authoring.looks.marks` draws it on the whole bridge.

    Args:
        tile: Where it repeats.
        albedo: Linear color [1], shape (H, W, 3), float32.
        age: 0 for none, 1 for decades of weather [1].

    Returns:
        Linear color [1], shape (H, W, 3), float32.
    """
    if age <= 0:
        return albedo
    years = np.float32(min(age, 1.25))
    film = ramp(fractal(tile, 0.12, 0.012, slope=0.6), -1.0, 2.6)
    colony = ramp(fractal(tile, 0.9, 0.05), float(0.7 - 0.5 * years), 2.2)
    specks = ramp(fractal(tile, 0.06, 0.006, slope=0.9), 0.5, 2.6)
    stained = cover(albedo, years * np.minimum(0.17 * film + 0.40 * colony * specks, 0.6), _SOOT)
    return cover(stained, 0.25 * years * colony * ramp(fractal(tile, 0.06, 0.006, slope=0.9), 1.2, 2.8), _LIME)


def cracked(tile: Tile, albedo: Floats, amount: float) -> Floats:
    """Draw thin dark lines where a field passes through zero, broken off by another.

    Args:
        tile: Where it repeats.
        albedo: Linear color [1], shape (H, W, 3), float32.
        amount: 0 for few, 1 for a net of them [1].

    Returns:
        Linear color [1], shape (H, W, 3), float32.
    """
    where = ramp(fractal(tile, 1.6, 0.3), 1.1 - 0.9 * amount, 1.9 - 0.9 * amount)
    path = np.abs(fractal(tile, 1.1, 0.015, slope=1.6))
    line = ramp(path, 0.030, 0.008) * where
    return albedo * (1 - 0.65 * line)[..., None]


def hairlines(tile: Tile, albedo: Floats, age: float) -> Floats:
    """Draw hairline cracks, thinner and fewer than `cracked`, with the lime that some of them bleed.

    Args:
        tile: Where it repeats.
        albedo: Linear color [1], shape (H, W, 3), float32.
        age: 0 for none, 1 for decades of weather [1].

    Returns:
        Linear color [1], shape (H, W, 3), float32.
    """
    if age < 0.3:
        return albedo
    path = np.abs(fractal(tile, 1.3, 0.02, slope=1.6))
    where = ramp(fractal(tile, 1.6, 0.3), 1.5 - 0.5 * age, 2.2 - 0.5 * age)
    bled = cover(albedo, 0.30 * where * ramp(path, 0.11, 0.02), _LIME)
    return bled * (1 - 0.55 * ramp(path, 0.018, 0.006) * where)[..., None]


def _boards(tile: Tile, height: float, length: float) -> tuple[Floats, Floats]:
    """Boards along u with butt joints at random: a value of its own for each board, and 1 on the seams."""
    rows, columns = max(1, round(tile.meters / height)), max(1, round(tile.meters / length))
    shift = draw(tile.rng, (rows,))
    steps = (np.arange(tile.pixels, dtype=np.float32) + np.float32(0.5)) / tile.pixels
    row = (steps * rows).astype(np.int32)
    across = steps[None, :] * columns + shift[row][:, None]
    column = across.astype(np.int32) % columns
    aside = np.abs(across - np.round(across)) * np.float32(tile.meters / columns)
    butt = ramp(aside, 0.006, 0.002)
    return draw(tile.rng, (rows, columns))[row[:, None], column], np.maximum(joints(tile, height, 0.009, "u"), butt)


def _tie_holes(tile: Tile, rows: int, columns: int) -> tuple[Floats, Floats]:
    """Two pairs of holes in each panel, and the lighter rims that their plugs leave."""
    steps = (np.arange(tile.pixels, dtype=np.float32) + 0.5) / tile.pixels
    down = np.abs((steps * 2 * rows) % 1 - 0.5)[:, None] * np.float32(tile.meters / (2 * rows))
    across = np.abs((steps * 2 * columns) % 1 - 0.5)[None, :] * np.float32(tile.meters / (2 * columns))
    far = np.sqrt(down * down + across * across).astype(np.float32)
    holes = ramp(far, 0.016, 0.009)
    return holes, ramp(far, 0.040, 0.030) - holes


def _courses(tile: Tile, length: float, height: float, joint: float) -> tuple[Floats, Floats, Floats]:
    """Running bond: 1 on the faces of the units and 0 in the joints; a tone and a hue of its own for each unit."""
    rows, columns = 2 * max(1, round(tile.meters / height / 2)), max(1, round(tile.meters / length))
    wobble = fractal(tile, 0.3, 0.03)
    texel = tile.meters / tile.pixels
    steps = (np.arange(tile.pixels, dtype=np.float32) + np.float32(0.5)) / tile.pixels
    down = (steps * rows)[:, None]
    row = down.astype(np.int32)
    across = (steps * columns)[None, :] + np.float32(0.5) * (row % 2)
    column = np.floor(across).astype(np.int32) % columns
    aside = (0.5 - np.abs(across - np.floor(across) - 0.5)) * np.float32(tile.meters / columns)
    above = (0.5 - np.abs(down - np.floor(down) - 0.5)) * np.float32(tile.meters / rows)
    inside = np.minimum(aside, above) + np.float32(0.0012) * wobble
    drawn = draw(tile.rng, (2, rows, columns))
    face = ramp(inside, joint / 2 - texel / 2, joint / 2 + texel / 2)
    return face, drawn[0][row, column], drawn[1][row, column]
