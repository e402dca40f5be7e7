"""The river bed as seen through shallow water: one image for a site's stretch of river."""

import numpy as np

from authoring.looks.noise import Floats, Tile, fractal, ramp
from authoring.site.roads import water_half
from authoring.site.site import Site

BRIGHTEST = 1.99  # factor; a texel can store at most 2 [1]
_BED = (2.00, 1.42, 1.24)  # wet silt and gravel relative to the light that deep water scatters back [1]
_WEED = (1.05, 1.12, 0.80)
_CLEAR = (2.3, 1.9, 2.6)  # extinction over one meter of depth, down and up, red, green, blue [1/m]
EDGE_FADE = 8.0  # [m] before the site's edge, over which the image fades into the river beyond


def shallows(site: Site, pixels: int, rng: np.random.Generator) -> Floats:
    """Draw the factors that multiply the color of deep water.

    Args:
        site: A site with a river.
        pixels: Texels along a side: rows lie along the river's banks, the first at its left.
        rng: Random stream.

    Returns:
        Factors [1], shape (pixels, pixels, 3), float32.
    """
    crossing, (low, high) = site.land.crossing, site.field.lefts[[0, -1]]
    half = water_half(crossing)
    steps = (np.arange(pixels) + 0.5) / pixels
    left, side = np.meshgrid(low + steps * (high - low), half - 2 * half * steps)
    station = crossing.center(left) - side * crossing.stretch(left)
    depth = crossing.level - site.field(station.ravel(), left.ravel()).reshape(station.shape)
    across = float((high - low) / (2 * half))  # texels are longer along the river than across it
    tile = Tile(pixels, 2 * half, rng)
    broad = fractal(tile, 6.0, 0.5, slope=1.1, stretch=(1 / across, 1.0))
    stones = fractal(tile, 1.2, slope=0.7, stretch=(1 / across, 1.0))
    shown = np.maximum(depth.astype(np.float32) + np.float32(0.05) * broad, 0)
    weed = ramp(broad, 0.7, 1.6)[..., None]
    bed = np.array(_BED, np.float32) + weed * (np.array(_WEED, np.float32) - np.array(_BED, np.float32))
    bed = bed * (1 + np.float32(0.16) * stones + np.float32(0.08) * broad)[..., None]
    ends = np.minimum(left - low, high - left).astype(np.float32)
    share = ramp(ends, 0.0, EDGE_FADE)[..., None] * 1 / (1 + shown[..., None] * np.array(_CLEAR, np.float32)) ** 2
    return np.clip(1 + share * (bed - 1), 0.2, BRIGHTEST).astype(np.float32)
