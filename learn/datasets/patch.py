"""A piece of a cloud in a data set, and the samples made from it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from learn.datasets.augment import apply_change
from learn.sample import Sample

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
U8 = NDArray[np.uint8]

# Each channel that a network may have, and the column that it needs. The list is closed, so that truth is never an
# input.
CHANNELS: Mapping[str, str] = {
    "x": "coord",
    "y": "coord",
    "z": "coord",
    "red": "color",
    "green": "color",
    "blue": "color",
    "nx": "normal",
    "ny": "normal",
    "nz": "normal",
    "n_views": "n_views",
    "height": "height",
}
_AXES = {"x": 0, "y": 1, "z": 2, "red": 0, "green": 1, "blue": 2, "nx": 0, "ny": 1, "nz": 2}
_VIEWS = np.float32(np.log(100.0))  # number of views that is scaled to 1


@dataclass(frozen=True, eq=False)
class Patch:
    """A piece of a cloud.

    Attributes:
        coord: Positions relative to `origin` [m], shape (N, 3), float32.
        inputs: Columns that channels are computed from: color uint8 and normal float32, shape (N, 3),
            n_views uint16 and height above the ground [m] float32, shape (N,).
        labels: Label of each point, 255 where unknown, shape (N,), uint8.
        uncertainty: For scores by threshold and the weights in the loss, never an input [m], shape (N,), float32.
        origin: Origin of `coord` in the source [m], shape (3,), float64.
        seed: Seed of the draws that visit every point.
        row: Row of each point in the cloud that was cut, thinned or not, which identifies common points of overlapping
            pieces, shape (N,), int64; None if not read.
        instance: Instance of each point in its cloud, 0 for none, never an input, shape (N,), int64; None if not read.
    """

    coord: F32
    inputs: Mapping[str, NDArray[Any]]
    labels: U8
    uncertainty: F32
    origin: F64
    seed: int
    row: I64 | None = None
    instance: I64 | None = None

    def __len__(self) -> int:
        """Count the points."""
        return len(self.coord)


@dataclass(frozen=True)
class Scaling:
    """How positions are scaled for a network.

    Attributes:
        kind: `constant`: divided by one length; or `extent`: each sample scaled by its largest side to the unit cube,
            as in the paper.
        length: Length that is scaled to 1 [m].
    """

    kind: Literal["constant", "extent"]
    length: float = 1.0

    def apply(self, coord: F32) -> F32:
        """Scale positions.

        Args:
            coord: Positions [m], shape (N, 3), float32.

        Returns:
            Positions [1], shape (N, 3), float32.
        """
        if self.kind == "constant":
            return coord * np.float32(1.0 / self.length)
        low = coord.min(axis=0)
        return (coord - low) / np.maximum((coord - low).max(), np.float32(1e-6))


def check_channels(channels: tuple[str, ...], present: Mapping[str, Any] | tuple[str, ...], where: object) -> None:
    """Refuse unknown channels, and channels that a source lacks.

    Args:
        channels: Names.
        present: Columns of the source.
        where: Source, for the error.

    Raises:
        InputError: Not a channel, or the source lacks its column.
    """
    for name in channels:
        if name not in CHANNELS:
            raise InputError("not a channel", where=where, field="channels", value=name, allowed=", ".join(CHANNELS))
        if CHANNELS[name] != "coord" and CHANNELS[name] not in present:
            raise InputError(
                f"has no column {CHANNELS[name]}, which a channel needs",
                where=where,
                field="channels",
                value=name,
                hint="Choose channels that every source has, such as x, y, z",
            )


def make_sample(
    patch: Patch, rows: I64, channels: tuple[str, ...], scaling: Scaling, change: F64 | None = None
) -> Sample:
    """Make a sample of some points of a patch.

    Args:
        patch: The patch.
        rows: Points, in the order of the sample, shape (N,), int64.
        channels: Names of `CHANNELS`.
        scaling: How positions are scaled.
        change: Augmentation [1], shape (3, 3), float64, or None.
    """
    coord, normal = patch.coord[rows], patch.inputs["normal"][rows] if "normal" in patch.inputs else None
    factor = 1.0 if change is None else abs(np.linalg.det(change)) ** (1 / 3)
    if change is not None:
        coord, normal = apply_change(change, coord, normal)
    coord = scaling.apply(coord)
    features = np.empty((len(rows), len(channels)), np.float32)
    for place, name in enumerate(channels):
        column = CHANNELS[name]
        if column == "coord":
            features[:, place] = coord[:, _AXES[name]]
        elif column == "color":
            features[:, place] = patch.inputs["color"][rows, _AXES[name]] / np.float32(255.0)
        elif column == "normal":
            assert normal is not None
            features[:, place] = normal[:, _AXES[name]]
        elif column == "height":
            features[:, place] = patch.inputs["height"][rows] * np.float32(factor / scaling.length)
        else:
            features[:, place] = np.log1p(patch.inputs["n_views"][rows].astype(np.float32)) / _VIEWS
    return Sample(coord, features, patch.labels[rows].astype(np.int64), channels)
