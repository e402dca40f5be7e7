"""Samples for a training: which ones in which order, their geometry, and batches of them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.utils.data import Dataset, Sampler

from learn.models.backbone import Backbone, batched, geometry_of
from learn.sample import UNLABELLED, SampleSource
from learn.trained import check_channels

I64 = NDArray[np.int64]

Place = tuple[int, int]
"""Epoch and number of a sample."""


class EpochOrder(Sampler[Place]):
    """Each epoch's order of the samples, decided by the seed and the epoch alone."""

    def __init__(self, rows: Sequence[int], seed: int) -> None:
        self._rows, self._seed, self._epoch = list(rows), seed, 0

    def set_epoch(self, epoch: int) -> None:
        """Say which epoch comes; Lightning does so, after a resumption too.

        Args:
            epoch: Number of the epoch.
        """
        self._epoch = epoch

    def __len__(self) -> int:
        """Count the samples of an epoch."""
        return len(self._rows)

    def __iter__(self) -> Iterator[Place]:
        """Go through the epoch."""
        order = np.random.default_rng([self._seed, self._epoch]).permutation(len(self._rows))
        for row in order:
            yield self._epoch, self._rows[row]


@dataclass(frozen=True)
class Loaded(Dataset[dict[str, Any]]):
    """Samples with their geometry.

    Attributes:
        source: Where samples come from.
        network: Whose geometry they get.
        channels: Inputs of the network.
        seed: Seed of the draws.
        cache: Folder of pyramids, for samples that are always the same; None for those that are drawn anew.
    """

    source: SampleSource
    network: Backbone
    channels: tuple[str, ...]
    seed: int
    cache: Path | None = None

    def __getitem__(self, place: Place) -> dict[str, Any]:
        """Draw a sample and search its neighbourhoods."""
        epoch, row = place
        sample = self.source.sample(row, int(np.random.SeedSequence([self.seed, epoch, row]).generate_state(1)[0]))
        check_channels(sample, self.channels)
        return {
            "features": torch.from_numpy(np.ascontiguousarray(sample.features)),
            "labels": torch.from_numpy(np.ascontiguousarray(sample.labels)),
            "geometry": geometry_of(self.network, sample.coord, self.cache),
        }


def collate(items: list[dict[str, Any]]) -> dict[str, Any]:
    """Stack samples of one size.

    Args:
        items: Samples with their geometry.

    Returns:
        The same with a batch axis in front.
    """
    return {
        "features": torch.stack([item["features"] for item in items]),
        "labels": torch.stack([item["labels"] for item in items]),
        "geometry": batched([item["geometry"] for item in items]),
    }


def count_labels(source: SampleSource, rows: Sequence[int], seed: int) -> Tensor:
    """Count the training points of each class over one draw of every sample.

    Args:
        source: Training samples.
        rows: Those that are used.
        seed: Seed of the draws.

    Returns:
        Counts, shape (C,), int64.
    """
    total = np.zeros(len(source.classes), np.int64)
    for row in rows:
        labels = source.sample(row, seed).labels
        total += np.bincount(labels[labels != UNLABELLED], minlength=len(total))
    return torch.from_numpy(total)


def hold_out(source: SampleSource, share: float, seed: int) -> tuple[list[int], list[int]]:
    """Hold whole bridges out of a training.

    Args:
        source: All samples.
        share: Share of the bridges to hold out, at least one [1].
        seed: Seed of the choice.

    Returns:
        Samples to train on, and samples of the bridges that are held out.
    """
    names = sorted({source.bridge(row) for row in range(len(source))})
    order = np.random.default_rng(seed).permutation(len(names))
    chosen = {names[number] for number in order[: max(1, round(share * len(names)))]}
    rows = range(len(source))
    return [r for r in rows if source.bridge(r) not in chosen], [r for r in rows if source.bridge(r) in chosen]
