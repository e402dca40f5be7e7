"""One random stream per layer, so that a change in one section of the scenario changes nothing that another draws."""

import hashlib

import numpy as np


def stream(seed: int, name: str) -> np.random.Generator:
    """Open the random stream of one layer.

    Args:
        seed: Seed of the scene.
        name: Layer, e.g. `site`, `bridge`, `look`, `background`, `light`, `survey/<id>`, `gps/<id>`, `sensor`.

    Returns:
        A generator that depends on these two values only.
    """
    word = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "little")
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, word])))
