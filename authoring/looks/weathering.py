"""Weathering of a bridge as a whole: the macro texture on the `st1` atlas, and patches on open ground."""

from collections.abc import Callable, Iterable

import numpy as np

from authoring.looks.arrises import arris_distance
from authoring.looks.charts import draw_charts, spread
from authoring.looks.marks import on_concrete, on_road, on_steel
from authoring.looks.members import Members, Spots, draw_fields, read_members, read_spots
from authoring.looks.noise import I32, Floats, Tile, fractal, mottle, ramp
from authoring.looks.runoff import map_stains
from authoring.shapes.component import Component, Scatter

Marking = Callable[[Spots, Members, Floats, Floats, float], Floats]

_FLECKS = 20.0, 2.4  # longest and shortest wave [texels]
_COARSE = 512  # side of an atlas below which it has no other details for distant features
_FINE = 2048  # texels of which one is as wide as edges of stains are shifted by the renderer
_ROWS = 128  # rows of the atlas processed at once, so that they stay in the cache


def weather(
    pieces: Iterable[Component | Scatter],
    pixels: int,
    age: float,
    rng: np.random.Generator,
    waterline: float | None = None,
) -> Floats:
    """Draw the factors by which age multiplies the base color; their mean over the surface of each role is 1.

    Args:
        pieces: Parts of a bridge; those with charts on `st1` are weathered, all may drip.
        pixels: Texels along a side of the atlas.
        age: 0 for new, 1 for decades of weather, more for many [1].
        rng: Random stream.
        waterline: Height of the river around piers [m]; None where none stands in it.

    Returns:
        Factors [1], shape (pixels, pixels, 3), float32.
    """
    pieces = tuple(pieces)
    components = [piece for piece in pieces if isinstance(piece, Component) and len(piece.mesh.st1)]
    charts = draw_charts(components, pixels)
    edges = arris_distance(components, pixels)
    members, fields, stains = read_members(components, age, rng), draw_fields(rng), map_stains(pieces)
    roles = sorted({component.role for component in components})
    role = np.array([roles.index(component.role) for component in components], np.int32)
    factors = np.ones((pixels, pixels, 3), np.float32)
    total, count = np.zeros(len(roles)), np.zeros(len(roles))
    for top in range(0, pixels, _ROWS):
        block = charts.triangle[top : top + _ROWS]
        for row, column, mark in _sorted(block, charts.owner, members):
            texels = block[row, column], column, row + top
            spots = read_spots(charts, members, fields, texels, edges[row + top, column], waterline)
            wet, rusty = (stain.below(spots.place) for stain in stains)
            marked = mark(spots, members, wet, rusty, age)
            factors[row + top, column] = marked.T
            mine = role[spots.owner]
            total += np.bincount(mine, marked.sum(axis=0), len(roles))
            count += np.bincount(mine, minlength=len(roles))
    # One mean for the three channels: otherwise a mossy top would make the soffit of the same role violet.
    scale = np.append(3 * np.maximum(count, 1) / np.where(total > 0, total, 3), 1.0).astype(np.float32)
    of_triangle = np.append(role[charts.owner], len(roles))  # outside all charts: number -1, the last one
    flecks = _flecks(pixels, age, rng)
    for top in range(0, pixels, _ROWS):
        rows = slice(top, top + _ROWS)
        factors[rows] *= (scale[of_triangle[charts.triangle[rows]]] * flecks[rows])[..., None]
    factors = spread(factors, charts.triangle >= 0)
    corner = np.r_[: 1 + pixels // _FINE, pixels - 1 - pixels // _FINE : pixels]
    factors[np.ix_(corner, corner)] = 1  # parts without a chart read the corner (0, 0), and what lies close to it
    return factors


def _flecks(pixels: int, age: float, rng: np.random.Generator) -> Floats:
    """Draw a soft mottle without repetition, so that each place of a bridge is different.

    A coarse atlas has nothing finer, and distant features need it; in a fine one the grain has the small details.
    """
    tile, longest = Tile(pixels, 1.0, rng), _FLECKS[0] / pixels
    field = mottle(tile, (longest, _FLECKS[1] / pixels), (8 * longest, longest), 4.5)
    loud = 0.045 + 0.10 * min(1.0, (_COARSE / pixels) ** 2)
    return 1 + np.float32(0.02 + loud * min(age, 1.0)) * field


def _sorted(block: I32, owner: I32, members: Members) -> Iterable[tuple[np.ndarray, np.ndarray, Marking]]:
    """Group the texels of a block by concrete, steel and road: rows and columns, and the function that marks them."""
    kind = np.append(np.where(members.road > 0, 2, np.where(members.steel > 0, 1, 0))[owner], 3).astype(np.int8)[block]
    for number, mark in enumerate((on_concrete, on_steel, on_road)):
        row, column = np.nonzero(kind == number)
        if len(row):
            yield row, column, mark


def ground_patches(pixels: int, rng: np.random.Generator) -> Floats:
    """Draw lush, worn, moist, dry and trodden patches for open ground; the factors are 1 along the atlas's border.

    Args:
        pixels: Texels along a side.
        rng: Random stream.

    Returns:
        Factors with mean 1 [1], shape (pixels, pixels, 3), float32.
    """
    tile = Tile(pixels, 160.0, rng)
    broad, small = fractal(tile, 60.0, 3.0), fractal(tile, 9.0, 0.4, slope=0.8)
    moist, dry = ramp(broad, 0.2, 1.8), ramp(-broad + 0.4 * small, 0.5, 2.2)
    steps = (np.arange(pixels, dtype=np.float32) + np.float32(0.5)) / pixels
    inside = ramp(np.minimum(steps, 1 - steps), 0.004, 0.05)
    inside = (inside[:, None] * inside[None, :])[..., None]
    swathes = np.clip(fractal(tile, 80.0, 14.0), -2.5, 2.5)  # lush and worn parts of a field
    factors = 1 + 0.10 * small[..., None] * np.array([1, 1, 1], np.float32)
    factors = factors * (1 + swathes[..., None] * np.array([0.17, 0.11, 0.12], np.float32))
    factors = factors * (1 + moist[..., None] * np.array([-0.34, -0.20, -0.30], np.float32))
    factors = factors * (1 + dry[..., None] * np.array([0.42, 0.22, 0.10], np.float32))
    weight = np.mean(inside, dtype=np.float64)
    mean = np.mean(factors * inside, axis=(0, 1), dtype=np.float64) / weight
    return (1 + (factors / mean.astype(np.float32) - 1) * inside).astype(np.float32)
