"""The fine grain that multiplies every surface of a bridge: one tileable gray picture at three sizes."""

import numpy as np

from authoring.looks.encode import U8, encode_raw
from authoring.looks.noise import Tile, mottle

_PIXELS = 2048
_SEED = 20_533  # one grain for all bridges, so that its file is the same wherever it lies
_SPREAD = 0.15  # standard deviation of the gray values [1]
_WAVES = 0.030, 0.0022  # longest and shortest of a tile of side 1
_PATCHES = 0.16, 0.02


def grain_texture() -> U8:
    """Draw a mottle of 5 to 60 texels; mean 0.5, so that 2 g - 1 has mean 0.

    Each of the three tiles shows its own sizes, and they meet: 7 cm to 1 m, 15 mm to 20 cm, 3 mm to 4 cm.

    Returns:
        Gray values, shape (2048, 2048), uint8.
    """
    field = mottle(Tile(_PIXELS, 1.0, np.random.default_rng(_SEED)), _WAVES, _PATCHES)
    return encode_raw(np.float32(0.5) + np.clip(field * np.float32(_SPREAD), -0.5, 0.5))
