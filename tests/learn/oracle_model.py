"""A model that knows the truth: the class of a point is written in its color."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from learn.datasets.settings import TileSettings
from learn.sample import Sample


@dataclass
class ColorModel:
    """Red in steps of 64 is the class; its confidence is 0.7, the rest is shared by the others.

    Attributes:
        seen: Every sample that it was asked about.
    """

    classes: tuple[str, ...] = ("background", "column", "pier_cap", "deck")
    table: str = "kim2023"
    channels: tuple[str, ...] = ("x", "y", "z", "red")
    tile: TileSettings = field(default_factory=lambda: TileSettings(voxel=0.05))
    points: int = 256
    seen: list[Sample] = field(default_factory=list)

    def probabilities(self, samples: Sequence[Sample]) -> list[NDArray[np.float32]]:
        """Read the classes off the colors.

        Args:
            samples: Clouds.
        """
        self.seen += samples
        told = []
        for sample in samples:
            red = np.rint(sample.features[:, sample.channels.index("red")] * 255).astype(int)
            table = np.full((len(red), len(self.classes)), 0.3 / (len(self.classes) - 1), np.float32)
            table[np.arange(len(red)), red // 64] = 0.7
            told.append(table)
        return told


def color_model() -> ColorModel:
    """Make one."""
    return ColorModel()
