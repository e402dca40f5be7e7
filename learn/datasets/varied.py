"""Strong augmentation of sensor, density and surroundings, for a model that generalizes to other people's scans."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from groundwork.settings import Settings
from learn.datasets import clutter
from learn.datasets.augment import draw_change
from learn.datasets.class_tables import is_background
from learn.datasets.draws import random_draw
from learn.datasets.ground import estimate_ground
from learn.datasets.layout import PieceRow, read_piece
from learn.datasets.patch import Patch, make_sample
from learn.datasets.stored import StoredSplit
from learn.sample import UNLABELED, Sample, SampleSource
from usd_schemas.components import component_classes

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
_FEWEST = 256  # least number of points in a half of a piece
_PLANTS = ("tree", "shrub")  # component kinds whose leaves scatter more in real scans than in a stage


class Variation(Settings):
    """Settings of the augmentation, beside rotation, mirroring and scaling."""

    samples: int = Field(default=1000, ge=1, le=1_000_000, description="Number of samples of an epoch [1]")
    by_class: float = Field(
        default=0.5, ge=0.0, le=1.0, description="Share of the pieces that are chosen by a random class [1]"
    )
    thinned: float = Field(default=0.5, ge=0.0, le=1.0, description="Share of the samples that are thinned [1]")
    least: float = Field(
        default=0.1, gt=0.0, le=1.0, description="Smallest share of the points that thinning leaves [1]"
    )
    halved: float = Field(default=0.15, ge=0.0, le=1.0, description="Share of the samples cut by a vertical plane [1]")
    empty: float = Field(
        default=0.0,
        ge=0.0,
        le=1.0,
        description="Share of the pieces without any part of a bridge, chosen by their content [1]",
    )
    clutter: float = Field(
        default=0.0,
        ge=0.0,
        le=1.0,
        description="Share of the samples that are a synthetic square of land instead of a piece [1]",
    )
    bare: float = Field(default=0.05, ge=0.0, le=1.0, description="Share of the samples whose bridge is removed [1]")
    alone: float = Field(default=0.0, ge=0.0, le=1.0, description="Share of the samples with only a bridge [1]")
    tilt: float = Field(default=4.0, ge=0.0, le=45.0, description="Largest tilt of the vertical [deg]")
    jitter: float = Field(
        default=0.05, ge=0.0, le=1.0, description="Largest standard deviation of the points' noise [m]"
    )
    rustle: float = Field(
        default=0.0,
        ge=0.0,
        le=2.0,
        description="Largest standard deviation of additional noise of the points of plants [m]",
    )
    lift: float = Field(default=0.5, ge=0.0, le=10.0, description="Largest error of the height of the ground [m]")


@dataclass(frozen=True)
class VariedSplit:
    """Samples of some bridges of a data set, equally many from every cloud; a `learn.sample.SampleSource`.

    A sample is a piece of its cloud: a random one, or one that holds a class drawn from those of the cloud, so that
    rare classes occur. Only positions are augmented, so it does not suit models with colors or normals.

    Attributes:
        split: The split for training.
        settings: How samples vary.
        bridges: First digits of the bridges to take; none for all.
    """

    split: StoredSplit
    settings: Variation
    bridges: tuple[str, ...] = ()

    @cached_property
    def _clouds(self) -> list[list[PieceRow]]:
        found: dict[int, list[PieceRow]] = {}
        for row in self.split.facts.pieces:
            if row.split == self.split.split and (not self.bridges or row.bridge.startswith(self.bridges)):
                found.setdefault(row.source, []).append(row)
        return [found[source] for source in sorted(found)]

    @cached_property
    def _counts(self) -> list[I64]:
        """Count for each cloud the points of each class in its pieces, shape (pieces, classes)."""
        return [np.stack([self._count(row) for row in rows]) for rows in self._clouds]

    @cached_property
    def _surroundings(self) -> I64:
        """List the labels of classes that are not part of a bridge, and of unlabeled points."""
        return np.array([*np.flatnonzero(is_background(self.classes)), UNLABELED])

    @cached_property
    def _plants(self) -> I64:
        """List the labels of trees and shrubs."""
        return np.array([i for i, name in enumerate(self.classes) if name in _PLANTS], np.int64)

    def _clutter(self, rng: np.random.Generator) -> Patch:
        """Draw a square of random land, as large as the tiles."""
        tile, kinds = self.split.facts.settings.tile, component_classes()
        code = {kind: self.classes.index(kind if kind in self.classes else kinds[kind]) for kind in clutter.KINDS}
        coord, labels = clutter.draw_clutter(tile.size, tile.voxel, code, rng)
        return Patch(coord, {}, labels, np.full(len(coord), np.nan, np.float32), np.zeros(3), 0)

    def _draw(self, number: int, rng: np.random.Generator) -> int:
        """Choose a piece of a cloud, sometimes one without a bridge."""
        counts = self._counts[number]
        if self.settings.empty and rng.random() < self.settings.empty:
            own = np.delete(counts, self._surroundings[self._surroundings < counts.shape[1]], axis=1)
            free = np.flatnonzero(~own.any(axis=1))
            if len(free):
                return int(free[draw_piece(counts[free], 1.0, rng)])
        return draw_piece(counts, self.settings.by_class, rng)

    def _count(self, row: PieceRow) -> I64:
        labels = read_piece(self.split.folder, row, ()).labels
        return np.bincount(labels[labels != UNLABELED], minlength=len(self.classes)).astype(np.int64)

    @property
    def classes(self) -> tuple[str, ...]:
        """Name of each class, in the order of the labels."""
        return self.split.classes

    def __len__(self) -> int:
        """Count the samples of an epoch."""
        return self.settings.samples if self._clouds else 0

    def bridge(self, index: int) -> str:
        """Name the bridge of a sample.

        Args:
            index: Number of the sample.
        """
        return self._clouds[index % len(self._clouds)][0].bridge

    def sample(self, index: int, seed: int) -> Sample:
        """Draw a piece of a cloud and change it.

        Args:
            index: Number of the sample; it determines the cloud.
            seed: Seed of all random choices.
        """
        rng, number = np.random.default_rng([seed, index]), index % len(self._clouds)
        if self.settings.clutter and rng.random() < self.settings.clutter:
            piece = self._clutter(rng)
        else:
            piece = read_piece(self.split.folder, self._clouds[number][self._draw(number, rng)], ())
        patch = vary(piece, self._surroundings, self.settings, rng, self._plants)
        facts = self.split.facts
        rows = random_draw(len(patch), facts.settings.points, rng)
        change = draw_change(facts.settings.augment, rng) @ draw_tilt(self.settings.tilt, rng)
        return make_sample(patch, rows, self.split.channels, facts.scaling, change)


@dataclass(frozen=True)
class SomeSamples:
    """A subset of the samples of a source; a `learn.sample.SampleSource` too.

    Attributes:
        source: All samples.
        rows: Numbers of the selected samples.
    """

    source: SampleSource
    rows: Sequence[int]

    @property
    def classes(self) -> tuple[str, ...]:
        """Name of each class, in the order of the labels."""
        return self.source.classes

    def __len__(self) -> int:
        """Count the selected samples."""
        return len(self.rows)

    def bridge(self, index: int) -> str:
        """Name the bridge of a sample.

        Args:
            index: Number of the sample.
        """
        return self.source.bridge(self.rows[index])

    def sample(self, index: int, seed: int) -> Sample:
        """Draw one sample.

        Args:
            index: Number of the sample.
            seed: Seed of whatever is random in the draw.
        """
        return self.source.sample(self.rows[index], seed)


def draw_piece(counts: I64, by_class: float, rng: np.random.Generator) -> int:
    """Choose a piece of a cloud: a random one, or one with a random class of the cloud.

    Args:
        counts: Points of each class in each piece, shape (P, C), int64.
        by_class: Share of the choices by class [1].
        rng: Source of randomness.

    Returns:
        Number of the piece.
    """
    present = np.flatnonzero(counts.sum(axis=0))
    if rng.random() >= by_class or not len(present):
        return int(rng.integers(len(counts)))
    column = counts[:, rng.choice(present)]
    return int(rng.choice(len(counts), p=column / column.sum()))


def vary(
    patch: Patch, surroundings: I64, settings: Variation, rng: np.random.Generator, plants: I64 | None = None
) -> Patch:
    """Augment a piece: cut it, remove surroundings, thin it, shift it and add noise.

    Args:
        patch: Piece with positions only.
        surroundings: Labels of classes that are not part of a bridge, shape (S,), int64.
        settings: Size of the changes.
        rng: Source of randomness.
        plants: Labels of trees and shrubs, shape (P,), int64; None for none.

    Returns:
        A piece with at least one point.
    """
    kept = np.arange(len(patch))
    if rng.random() < settings.halved:
        angle = rng.uniform(0.0, 2.0 * np.pi)
        along = patch.coord[:, :2] @ np.array([np.cos(angle), np.sin(angle)])
        half = np.flatnonzero(along > rng.choice(along))
        kept = half if len(half) >= _FEWEST else kept
    if rng.random() < settings.bare:
        rest = kept[np.isin(patch.labels[kept], surroundings)]
        kept = rest if len(rest) >= _FEWEST else kept
    drop = 0.0
    if settings.alone and rng.random() < settings.alone:
        own = kept[~np.isin(patch.labels[kept], surroundings)]
        if len(own) >= _FEWEST:  # a scan cropped to the bridge: its lowest points are then taken for the ground
            kept, seen = own, patch.coord[own].astype(np.float64)
            drop = float(estimate_ground(seen).below(seen[:, :2].mean(axis=0, keepdims=True), np.inf)[0])
    if rng.random() < settings.thinned:
        share = np.exp(rng.uniform(np.log(settings.least), 0.0))
        kept = np.sort(rng.permutation(kept)[: max(1, round(share * len(kept)))])
    noise = rng.normal(size=(len(kept), 3)) * rng.uniform(0.0, settings.jitter)
    noise[:, 2] += rng.uniform(-settings.lift, settings.lift) - drop
    if settings.rustle and plants is not None:
        leaves = np.flatnonzero(np.isin(patch.labels[kept], plants))
        noise[leaves] += rng.normal(size=(len(leaves), 3)) * rng.uniform(0.0, settings.rustle)
    coord = (patch.coord[kept] + noise).astype(np.float32)
    return Patch(coord, {}, patch.labels[kept], patch.uncertainty[kept], patch.origin, patch.seed)


def draw_tilt(largest: float, rng: np.random.Generator) -> F64:
    """Draw a rotation about a horizontal axis.

    Args:
        largest: Largest angle [deg].
        rng: Source of randomness.

    Returns:
        Rotation for column vectors [1], shape (3, 3), float64.
    """
    return tilt_about(rng.uniform(0.0, 2.0 * np.pi), np.radians(rng.uniform(0.0, largest)))


def tilt_about(heading: float, angle: float) -> F64:
    """Make a rotation about a horizontal axis.

    Args:
        heading: Angle of the axis from +x [rad].
        angle: Angle of the rotation [rad].

    Returns:
        Rotation for column vectors [1], shape (3, 3), float64.

    Source: Rodrigues' formula.
    """
    x, y = np.cos(heading), np.sin(heading)
    cross = np.array([[0.0, 0.0, y], [0.0, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
