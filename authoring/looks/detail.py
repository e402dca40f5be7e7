"""The fine detail that multiplies the color of every surface: one tileable gray image, repeated at three scales."""

import numpy as np

from authoring.looks.encode import U8, encode_raw
from authoring.looks.noise import Tile, fractal, spots, standard

_PIXELS = 2048
_SEED = 20_531  # one detail for all surfaces, so that its file is the same wherever it lies
_SPREAD = 0.18  # standard deviation of the gray values [1]

# Specks of a tile of side 1: pitch, radius, share of the places taken, and how high they stand out of the noise.
_SPECKS = (
    (0.0055, 0.0025, 0.25, -3.5),
    (0.0055, 0.0025, 0.25, 3.0),
    (0.0125, 0.0055, 0.25, -2.5),
    (0.0125, 0.0055, 0.20, 2.0),
)


def detail_texture() -> U8:
    """Draw noise in every octave, pores and grains; mean 0.5, so that 2 g - 1 has mean 0.

    Single dark and bright specks are what a feature detector holds on to: of two details with the same contrast, this
    one gives three times the keypoints of noise alone.

    Returns:
        Gray values, shape (2048, 2048), uint8.
    """
    tile = Tile(_PIXELS, 1.0, np.random.default_rng(_SEED))
    field = np.float32(0.6) * fractal(tile, 0.25, slope=0.6)
    for pitch, radius, share, height in _SPECKS:
        field = field + np.float32(height) * spots(tile, pitch, radius, share)
    field = standard(np.clip(standard(field), -2.7, 2.7))
    return encode_raw(np.float32(0.5) + np.clip(field * np.float32(_SPREAD), -0.5, 0.5))
