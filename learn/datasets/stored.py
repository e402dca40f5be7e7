"""One split of a data set on disk as a source of samples."""

from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np

from groundwork.errors import InputError
from learn.datasets.augment import draw_change
from learn.datasets.draws import exhaustive_draw, random_draw, stratified_draw
from learn.datasets.layout import PieceRow, read_facts, read_piece
from learn.datasets.patch import CHANNELS, Patch, check_channels, make_sample
from learn.datasets.sensors import other_sensor
from learn.datasets.settings import SensorSettings
from learn.datasets.split import SPLITS, TRAIN
from learn.sample import Sample, Truth

XYZ = ("x", "y", "z")


class StoredSplit:
    """The samples of one split.

    Training samples are drawn and augmented at random from the seed. Validation and test samples are always the same:
    they visit every point of every piece, without augmentation, and do not depend on labels or uncertainty.
    """

    def __init__(
        self,
        folder: Path,
        split: str,
        channels: tuple[str, ...] = XYZ,
        *,
        augment: bool = True,
        sensors: SensorSettings | None = None,
    ) -> None:
        """Open a split.

        Args:
            folder: Root of a data set.
            split: train, val or test.
            channels: Inputs of the network per point.
            augment: Whether training samples are augmented.
            sensors: Augmentation that imitates other sensors; None for none.

        Raises:
            InputError: Not a data set, an unknown split, or channels that the data set lacks.
        """
        if split not in SPLITS:
            raise InputError("an unknown split", where=folder, field="split", value=split, allowed=", ".join(SPLITS))
        self.folder, self.split, self.channels = folder, split, channels
        self.facts = read_facts(folder)
        check_channels(channels, self.facts.inputs, folder)
        self._changes = augment and split == TRAIN
        self._sensors, self._still = sensors, False

    @cached_property
    def _items(self) -> list[tuple[PieceRow, int]]:
        rows = (row for row in self.facts.pieces if row.split == self.split)
        return [(row, number) for row in rows for number in range(row.draws)]

    @property
    def _drawn(self) -> bool:
        """Whether samples are drawn at random from the seed."""
        return self.split == TRAIN and not self._still

    @property
    def classes(self) -> tuple[str, ...]:
        """Name of each class, in the order of the labels."""
        return self.facts.classes

    def __len__(self) -> int:
        """Count the samples of one pass."""
        return len(self._items)

    def unchanged(self) -> "StoredSplit":
        """Return the same split with samples like those of validation, for bridges that are held out of a training."""
        still = StoredSplit(self.folder, self.split, self.channels, augment=False)
        still._still = True
        return still

    def bridge(self, index: int) -> str:
        """Name the bridge of a sample.

        Args:
            index: Number of the sample.
        """
        return self._items[index][0].bridge

    def piece(self, index: int) -> tuple[Patch, np.ndarray]:
        """Return the piece of a validation or test sample, and the rows of the sample's points in it.

        Args:
            index: Number of the sample.

        Returns:
            The piece, and rows in it in the order of the sample, shape (points,), int64.
        """
        row, number = self._items[index]
        needed = {CHANNELS[name] for name in self.channels} - {"coord"}
        inputs = [name for name in self.facts.inputs if name in needed]
        patch = read_piece(self.folder, row, inputs, classes=len(self.classes))
        return patch, exhaustive_draw(len(patch), self.facts.settings.points, number, patch.seed)

    def truth(self, index: int) -> Truth:
        """Return the truth of a validation or test sample and the rows of its points in their cloud, for scores.

        Args:
            index: Number of the sample.

        Raises:
            InputError: The samples are drawn at random, or the data set is of version 1, which has no rows.
        """
        if self._drawn:
            raise InputError(
                "training samples are drawn at random and have no fixed points to score",
                where=self.folder,
                field="split",
                value=self.split,
                hint="Score unchanged() of this split",
            )
        if not self.facts.identified:
            raise InputError(
                "was made by an older version, whose pieces do not state their points",
                where=self.folder,
                hint="Make the data set again",
            )
        row, number = self._items[index]
        patch = read_piece(self.folder, row, (), identified=True)
        drawn = exhaustive_draw(len(patch), self.facts.settings.points, number, patch.seed)
        assert patch.row is not None
        assert patch.instance is not None
        return Truth(
            row.source,
            patch.row[drawn],
            patch.coord[drawn] + patch.origin,
            patch.uncertainty[drawn],
            patch.instance[drawn],
        )

    def sample(self, index: int, seed: int) -> Sample:
        """Draw one sample.

        Args:
            index: Number of the sample, 0 to `len` - 1.
            seed: Seed of a training sample; the others are always the same.
        """
        patch, rows = self.piece(index)
        settings = self.facts.settings
        if not self._drawn:
            return make_sample(patch, rows, self.channels, self.facts.scaling)
        lean = np.eye(3)
        if self._changes and self._sensors is not None:
            patch, lean = other_sensor(patch, self._sensors, np.random.default_rng([seed, index, 1]))
        rng = np.random.default_rng([seed, index])
        if settings.stratified:
            rows = stratified_draw(patch.labels, settings.points, settings.stratified, rng)
        else:
            rows = random_draw(len(patch), settings.points, rng)
        change = draw_change(settings.augment, rng) @ lean if self._changes else None
        sample = make_sample(patch, rows, self.channels, self.facts.scaling, change)
        return replace(sample, uncertainty=patch.uncertainty[rows])
