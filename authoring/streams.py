"""One random stream per layer, so that a change in one section of the scenario changes no random values of others.

Also the choice among weighted options: the shares in a setting's description are made from the same table.
"""

import hashlib
from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np

Option = TypeVar("Option")


def stream(seed: int, name: str) -> np.random.Generator:
    """Open the random stream of one layer.

    Args:
        seed: Seed of the scene.
        name: Layer, e.g. `site`, `bridge`, `look`, `background`, `background/site`, `light`, `survey/<id>`, `gps/<id>`,
            `sensor`.

    Returns:
        A generator that depends on these two values only.
    """
    word = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "little")
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, word])))


def weighted_choice(weights: Mapping[Option, float], share: float) -> Option:
    """Find the option at a cumulative share of all weights.

    Args:
        weights: How often each option is drawn, any scale [1]; their order counts.
        share: From 0 up to 1 [1].
    """
    edges = np.cumsum(list(weights.values()))
    return list(weights)[int(np.searchsorted(edges[:-1], share * edges[-1], side="right"))]


def told_shares(weights: Mapping[Any, float]) -> str:
    """State how often each option is drawn: "ballast 65 %, slab 35 %", "true 40 %", "1: 20 %, 2: 80 %", "always pot".

    Args:
        weights: How often each option is drawn, any scale [1].
    """
    total = sum(weights.values())
    parts = {option: f"{100.0 * weight / total:.3g} %" for option, weight in weights.items() if weight}
    if all(isinstance(option, bool) for option in parts):
        true = parts.get(True)
        return "never" if true is None else "always" if len(parts) == 1 else f"true {true}"
    if len(parts) == 1:
        return f"always {next(iter(parts))}"
    if len(set(parts.values())) == 1:
        *most, last = map(str, parts)
        return f"{', '.join(most)} and {last} equally often"
    return ", ".join(f"{option}{':' * isinstance(option, int)} {share}" for option, share in parts.items())
