"""The fine grain that multiplies every surface of a bridge: one tileable grey picture at three sizes."""

import numpy as np

from authoring.looks.encode import U8, encode_raw
from authoring.looks.noise import Tile, fractal, standard

_PIXELS = 2048
_SEED = 20_533  # one grain for all bridges, so that its file is the same wherever it lies
_SPREAD = 0.15  # standard deviation of the grey values [1]
_WAVES = ((0.0055, 0.0022, 1.0), (0.014, 0.005, 0.8))  # longest and shortest of a tile of side 1, and how much of them


def grain_texture() -> U8:
    """Draw aggregate, sand and pores of 4 to 29 texels; mean 0.5, so that 2 g - 1 has mean 0.

    Each of the three tiles shows its own sizes: 3 to 22 cm, 7 to 47 mm, 2 to 10 mm. A feature
    detector holds on to few high peaks: noise to the third power gives ten times the keypoints of noise with the same
    contrast, and most of the surface stays quiet.

    Returns:
        Grey values, shape (2048, 2048), uint8.
    """
    tile = Tile(_PIXELS, 1.0, np.random.default_rng(_SEED))
    field = np.zeros((_PIXELS, _PIXELS), np.float32)
    for longest, shortest, share in _WAVES:
        waves = fractal(tile, longest, shortest, slope=0.6)
        field += np.float32(share) * standard(waves * waves * waves)
    field = standard(np.clip(standard(field), -4.5, 4.5))
    return encode_raw(np.float32(0.5) + np.clip(field * np.float32(_SPREAD), -0.5, 0.5))
