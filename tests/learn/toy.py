"""A toy data set: little bridges of boxes, of which every seed draws other points."""

from __future__ import annotations

import numpy as np

from learn.sample import Sample, Truth

CLASSES = ("background", "column", "deck")


class ToyBridges:
    """Samples of toy bridges: ground below, a deck above, columns between; the class can be read off the place."""

    def __init__(
        self,
        bridges: int,
        *,
        points: int = 256,
        first: int = 0,
        classes: tuple[str, ...] = CLASSES,
        shuffled: bool = False,
    ) -> None:
        """Choose the number of bridges and the points of a sample."""
        self._bridges, self._points, self._first, self._classes, self._shuffled = (
            bridges,
            points,
            first,
            classes,
            shuffled,
        )

    @property
    def classes(self) -> tuple[str, ...]:
        """Name of each class."""
        return self._classes

    def __len__(self) -> int:
        """Two samples a bridge."""
        return 2 * self._bridges

    def bridge(self, index: int) -> str:
        """Name the bridge."""
        return f"toy-{self._first + index // 2}"

    def sample(self, index: int, seed: int) -> Sample:
        """Draw the points of a sample."""
        rng = np.random.default_rng([seed, index, self._first])
        height = 0.5 + 0.1 * ((self._first + index // 2) % 3)
        labels = rng.integers(0, 3, self._points)
        coord = rng.uniform(-1, 1, (self._points, 3))
        between = rng.uniform(0.1, height - 0.1, self._points)
        coord[:, 2] = np.where(labels == 1, between, np.where(labels == 2, height, 0.0))
        coord[labels == 1, 0] = rng.choice([-0.5, 0.5], (labels == 1).sum()) + rng.normal(0, 0.02, (labels == 1).sum())
        coord = coord.astype(np.float32)
        if len(self._classes) == 4:
            labels[rng.random(self._points) < 0.1] = 3
        if self._shuffled:
            labels = rng.permutation(labels)
        labels[:4] = 255
        return Sample(coord, coord.copy(), labels.astype(np.int64), ("x", "y", "z"))

    def truth(self, index: int) -> Truth:
        """Each sample is a cloud of its own; its points lie meters apart, so that instances are single points."""
        labels = self.sample(index, 0).labels
        rows = np.arange(len(labels))
        coord = np.zeros((len(rows), 3))
        coord[:, 0] = 5.0 * rows
        return Truth(index, rows, coord, np.full(len(rows), 0.05, np.float32), labels % 255)
