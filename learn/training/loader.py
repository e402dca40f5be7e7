"""Loading of training samples: their order, their geometry, and batches."""

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.utils.data import DataLoader, Dataset, Sampler

from groundwork.errors import InputError
from learn.losses import uncertainty_weights
from learn.models.backbone import COORD, Backbone, batched, geometry_of
from learn.neighborhoods.batches import MANY
from learn.sample import UNLABELED, SampleSource
from learn.trained import check_channels

I64 = NDArray[np.int64]

Place = tuple[int, int, int]
"""Epoch and number of a sample, and how often it occurred in this epoch before: each time it is drawn differently."""

_FILE_BYTES = 100  # of a pyramid for each point: 61 to 92 were measured
_CACHE_BYTES = 4e9


class EpochOrder(Sampler[Place]):
    """Order of the samples in each epoch; it depends only on the seed and the epoch.

    A share of an epoch's samples may be chosen by class: first a class, all equally likely, then a sample with a
    probability proportional to its points of that class.
    """

    def __init__(self, rows: Sequence[int], seed: int, counts: I64 | None = None, share: float = 0.0) -> None:
        """Set the samples.

        Args:
            rows: Numbers of the samples.
            seed: Seed of every order.
            counts: Points of each class in each of them, shape (rows, C), int64; needed for a share above 0.
            share: Share of an epoch that is chosen by class [1].
        """
        self._rows, self._seed, self._epoch, self._share = list(rows), seed, 0, share
        self._sums = np.zeros((0, len(self._rows))) if counts is None else _sums_by_class(counts)

    def set_epoch(self, epoch: int) -> None:
        """Set the epoch; called by Lightning, also after a resumption.

        Args:
            epoch: Number of the epoch.
        """
        self._epoch = epoch

    def __len__(self) -> int:
        """Count the samples of an epoch; each of several training processes has its share."""
        return -(-len(self._rows) // _processes()[1])

    def __iter__(self) -> Iterator[Place]:
        """Iterate over the epoch."""
        rng = np.random.default_rng([self._seed, self._epoch])
        order = rng.permutation(len(self._rows))
        for place in range(round(self._share * len(order)) if len(self._sums) else 0):
            sums = self._sums[rng.integers(len(self._sums))]
            order[place] = np.searchsorted(sums, rng.random(), side="right")
        order = rng.permutation(order) if self._share else order
        here, processes = _processes()
        order = np.resize(order, processes * len(self))  # the first ones again, so that all processes have equally many
        times, before = Counter[int](), []
        for row in order.tolist():
            before.append(times[row])
            times[row] += 1
        for place in range(here, len(order), processes):
            yield self._epoch, self._rows[order[place]], before[place]


def _processes() -> tuple[int, int]:
    """Return the rank of this process and the number of training processes."""
    there = torch.distributed.is_available() and torch.distributed.is_initialized()
    return (torch.distributed.get_rank(), torch.distributed.get_world_size()) if there else (0, 1)


@dataclass(frozen=True)
class Loaded(Dataset[dict[str, Any]]):
    """Samples with their geometry.

    Attributes:
        source: Source of the samples.
        network: Network that their geometry is for.
        channels: Inputs of the network.
        seed: Seed of the draws.
        cache: Cache folder of pyramids, for samples that never change; None for random samples.
        doubt: Uncertainty at which a point counts for 1/e [m]; 0: every point counts alike.
        searched: Whether neighborhoods are searched here; a GPU searches those of a batch of small clouds itself.
    """

    source: SampleSource
    network: Backbone
    channels: tuple[str, ...]
    seed: int
    cache: Path | None = None
    doubt: float = 0.0
    searched: bool = True

    def __getitem__(self, place: Place) -> dict[str, Any]:
        """Draw a sample and search its neighborhoods."""
        epoch, row, before = place
        draw = np.random.SeedSequence([self.seed, epoch, row] + ([before] if before else []))
        sample = self.source.sample(row, int(draw.generate_state(1)[0]))
        check_channels(sample, self.channels)
        item = {
            "features": torch.from_numpy(np.ascontiguousarray(sample.features)),
            "labels": torch.from_numpy(np.ascontiguousarray(sample.labels)),
            "geometry": geometry_of(self.network, sample.coord, self.cache)
            if self.searched or len(sample.coord) > MANY
            else {COORD: torch.from_numpy(np.ascontiguousarray(sample.coord, dtype=np.float32))},
        }
        if self.doubt and sample.uncertainty is not None:
            known = torch.from_numpy(sample.uncertainty).nan_to_num(nan=0.0, posinf=torch.inf)  # unknown
            item["weights"] = uncertainty_weights(known, self.doubt)
        return item


def collate(items: list[dict[str, Any]]) -> dict[str, Any]:
    """Stack samples of one size.

    Args:
        items: Samples with their geometry.

    Returns:
        The same with a batch axis in front.
    """
    plain = [name for name in ("features", "labels", "weights") if name in items[0]]
    return {name: torch.stack([item[name] for item in items]) for name in plain} | {
        "geometry": batched([item["geometry"] for item in items])
    }


@dataclass(frozen=True)
class _Counted(Dataset[I64]):
    """The points of each class in one draw of every sample."""

    source: SampleSource
    rows: Sequence[int]
    seed: int

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, place: int) -> I64:
        labels = self.source.sample(self.rows[place], self.seed).labels
        return np.bincount(labels[labels != UNLABELED], minlength=len(self.source.classes)).astype(np.int64)


def count_labels(source: SampleSource, rows: Sequence[int], seed: int, workers: int = 0) -> I64:
    """Count the training points of each class over one draw of every sample.

    Args:
        source: Training samples.
        rows: Those that are used.
        seed: Seed of the draws.
        workers: Processes that draw them; 0: this one.

    Returns:
        Counts of each sample, shape (rows, C), int64.
    """
    drawn = DataLoader(_Counted(source, rows, seed), batch_size=None, num_workers=workers)
    counts = [np.asarray(row) for row in drawn]
    return np.stack(counts) if counts else np.zeros((0, len(source.classes)), np.int64)


@contextmanager
def errors_of_loaders() -> Iterator[None]:
    """Give errors of the processes that load samples their own words; torch adds the traceback to them."""
    try:
        yield
    except InputError as error:
        told = str(error)
        if not told.startswith("Caught InputError"):
            raise
        raise InputError(told.rpartition("InputError: ")[2].strip()) from None


def cache_of_pyramids(folder: Path, source: SampleSource, rows: Sequence[int]) -> Path | None:
    """Name the folder that keeps the pyramids of samples that never change, unless they would need too much space.

    Args:
        folder: Folder of the training.
        source: Source of the samples.
        rows: Those that are used.
    """
    points = len(source.sample(rows[0], 0).coord) if rows else 0
    return folder / "pyramids" if 0 < points * len(rows) * _FILE_BYTES <= _CACHE_BYTES else None


def expected_counts(counts: I64, share: float) -> Tensor:
    """Compute the expected number of points of each class in an epoch.

    Args:
        counts: Of `count_labels`, shape (rows, C), int64.
        share: Share of an epoch that is chosen by class [1].

    Returns:
        Counts, shape (C,), float64.
    """
    chosen = round(share * len(counts))
    times = np.full(len(counts), 1.0 - chosen / len(counts))
    if chosen:
        times += chosen * _by_class(counts).mean(axis=0)
    return torch.from_numpy(times @ counts)


def _by_class(counts: I64) -> NDArray[np.float64]:
    """Compute the probability of each sample given the chosen class: one row for each class that occurs."""
    present = counts[:, counts.any(axis=0)].T.astype(np.float64)
    return present / present.sum(axis=1, keepdims=True)


def _sums_by_class(counts: I64) -> NDArray[np.float64]:
    """Sum up the probabilities of the samples, so that a draw needs no more than a binary search."""
    sums = np.cumsum(_by_class(counts), axis=1)
    return sums / sums[:, -1:]


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
