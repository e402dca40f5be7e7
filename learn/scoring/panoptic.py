"""Panoptic quality: how well instances are found, and how well the found ones are segmented."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from learn.sample import UNLABELED

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


@dataclass(frozen=True)
class PanopticQuality:
    """Quality of instances by class; NaN for a class with neither true nor predicted instances.

    Attributes:
        quality: Segmentation quality times recognition quality [1], shape (C,), float64.
        segmentation: Mean IoU of the matched pairs [1], shape (C,), float64; NaN without one.
        recognition: F1 of the instances [1], shape (C,), float64.
        mean: Mean quality of the classes that occur [1].
    """

    quality: F64
    segmentation: F64
    recognition: F64
    mean: float


@dataclass(frozen=True)
class PanopticCounts:
    """Counts that the qualities are computed from; counts of several clouds can be added.

    Attributes:
        hits: Matched pairs of each class, shape (C,), int64.
        overlap: Sum of their IoU [1], shape (C,), float64.
        true: True instances, shape (C,), int64.
        found: Predicted instances, shape (C,), int64.
    """

    hits: I64
    overlap: F64
    true: I64
    found: I64

    def __add__(self, other: "PanopticCounts") -> "PanopticCounts":
        """Add the counts of another cloud."""
        return PanopticCounts(
            self.hits + other.hits, self.overlap + other.overlap, self.true + other.true, self.found + other.found
        )


def count_instances(
    true_class: I64, true_instance: I64, found_class: I64, found_instance: I64, classes: int, without: Sequence[int]
) -> PanopticCounts:
    """Match predicted with true instances of one cloud.

    A true and a predicted instance of one class match if they share more than half of their union, so that none matches
    twice. Points without a true class are left out of both. All points of a class without instances are one instance;
    those of another class that belong to none, such as parts that are too small, are no instance together.

    Args:
        true_class: True classes, 255 where unknown, shape (N,), int64.
        true_instance: True instances, numbered within the cloud, 0 for none, shape (N,), int64.
        found_class: Predicted classes, shape (N,), int64.
        found_instance: Predicted instances, 0 for none, shape (N,), int64.
        classes: Number of classes.
        without: Classes that have no instances.

    Returns:
        The counts.

    Source: Kirillov et al., Panoptic segmentation, 2019, section 4.
    """
    known = true_class != UNLABELED
    truth, true_of, true_size, true_one = _segments(true_class[known], true_instance[known], without)
    found, found_of, found_size, found_one = _segments(found_class[known], found_instance[known], without)
    pairs, shared = np.unique(np.stack([true_of, found_of]), axis=1, return_counts=True)
    union = true_size[pairs[0]] + found_size[pairs[1]] - shared
    matched = (2 * shared > union) & (truth[pairs[0]] == found[pairs[1]]) & true_one[pairs[0]] & found_one[pairs[1]]
    of_class = truth[pairs[0]][matched]
    return PanopticCounts(
        np.bincount(of_class, minlength=classes).astype(np.int64),
        np.bincount(of_class, shared[matched] / union[matched], minlength=classes).astype(np.float64),
        np.bincount(truth[true_one], minlength=classes).astype(np.int64),
        np.bincount(found[found_one], minlength=classes).astype(np.int64),
    )


def panoptic_quality(counts: PanopticCounts) -> PanopticQuality:
    """Compute qualities from counts.

    Args:
        counts: Of one cloud or of several.
    """
    hits, overlap, either = counts.hits, counts.overlap, counts.true + counts.found
    quality = np.where(either > 0, 2 * overlap / np.maximum(either, 1), np.nan)
    return PanopticQuality(
        quality=quality,
        segmentation=np.where(hits > 0, overlap / np.maximum(hits, 1), np.nan),
        recognition=np.where(either > 0, 2 * hits / np.maximum(either, 1), np.nan),
        mean=float(np.nanmean(quality)) if (either > 0).any() else float("nan"),
    )


def _segments(of_class: I64, instance: I64, without: Sequence[int]) -> tuple[I64, I64, I64, NDArray[np.bool_]]:
    """Return each segment's class, each point's segment, each segment's size, and whether each is an instance."""
    keys, segment, size = np.unique(np.stack([of_class, instance]), axis=1, return_inverse=True, return_counts=True)
    kinds = keys[0].astype(np.int64)
    is_instance = (keys[1] != 0) | np.isin(kinds, without)
    return kinds, segment.reshape(-1).astype(np.int64), size.astype(np.int64), is_instance
