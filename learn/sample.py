"""The interface between data sets and networks: samples, and the sources that draw them."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError

F32 = NDArray[np.float32]
I64 = NDArray[np.int64]

UNLABELED = 255


@dataclass(frozen=True)
class Sample:
    """One cloud as input of a network.

    Attributes:
        coord: Positions relative to the cloud's center, metric or scaled by one constant [m or 1], shape (N, 3),
            float32.
        features: The network's inputs [1], shape (N, C), float32; they include positions if the network uses them as
            features.
        labels: Class of each point, 255 where unknown, shape (N,), int64.
        channels: Name of each column of `features`, C of them.
        uncertainty: Of each point, NaN where unknown [m], shape (N,), float32; may weight points in the loss, never an
            input. None outside training.
    """

    coord: F32
    features: F32
    labels: I64
    channels: tuple[str, ...]
    uncertainty: F32 | None = None

    def __post_init__(self) -> None:
        count = len(self.coord)
        shapes = (self.coord.shape, self.features.shape, self.labels.shape)
        if shapes != ((count, 3), (count, len(self.channels)), (count,)):
            raise InputError(
                "the columns of a sample do not fit together",
                field="sample",
                value=shapes,
                allowed="coord (N, 3), features (N, C), labels (N,), C channels",
            )


@dataclass(frozen=True, eq=False)
class Truth:
    """The truth of a sample's points, for scores only; never an input of a network.

    Attributes:
        cloud: Number of their cloud.
        row: Row of each in that cloud; points of different samples are the same if cloud and row are equal, shape (N,),
            int64.
        coord: Position in the cloud [m], shape (N, 3), float64.
        uncertainty: Of each, NaN where unknown [m], shape (N,), float32.
        instance: Of each in that cloud, 0 for none, shape (N,), int64.
    """

    cloud: int
    row: I64
    coord: NDArray[np.float64]
    uncertainty: F32
    instance: I64


class SampleSource(Protocol):
    """A data set, or one split of it."""

    @property
    def classes(self) -> tuple[str, ...]:
        """Name of each class, in the order of the labels."""
        ...

    def __len__(self) -> int:
        """Count the samples."""
        ...

    def sample(self, index: int, seed: int) -> Sample:
        """Draw one sample.

        Args:
            index: Number of the sample, 0 to `len` - 1.
            seed: Seed of all random choices; the same seed gives the same sample.

        Returns:
            The sample.
        """
        ...

    def bridge(self, index: int) -> str:
        """Name the bridge of a sample.

        Args:
            index: Number of the sample.

        Returns:
            A name that all samples of one bridge share.
        """
        ...


class ScoredSource(SampleSource, Protocol):
    """A source that knows the rows of its samples' points in their clouds; samples of one cloud are consecutive."""

    def truth(self, index: int) -> Truth:
        """Return the truth of a sample's points.

        Args:
            index: Number of the sample.

        Returns:
            One row per point, in the order of the sample.
        """
        ...
