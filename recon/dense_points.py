"""Fused points and the views that they are made of, in memory and as the dense step's child hands them over."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.files import write_bytes

FOLDER = "points"


@dataclass(frozen=True)
class DensePoints:
    """N points with M observations.

    Attributes:
        points: Positions [model units], shape (N, 3), float64.
        normals: Unit normals towards the cameras, shape (N, 3), float32.
        colors: Mean sRGB colours, shape (N, 3), uint8.
        counts: Views of each point, shape (N,), int64.
        image: Row in the model of each observation, sorted by point, then ascending, shape (M,), uint32.
        uv: Where each view shows the point [px], shape (M, 2), float32, pixel centres at +0.5.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float32]
    colors: NDArray[np.uint8]
    counts: NDArray[np.int64]
    image: NDArray[np.uint32]
    uv: NDArray[np.float32]


def join(parts: Sequence[DensePoints]) -> DensePoints:
    """Put sets of points after each other.

    Args:
        parts: Any number of sets.
    """
    empty = DensePoints(
        np.zeros((0, 3)), np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint8), np.zeros(0, np.int64),
        np.zeros(0, np.uint32), np.zeros((0, 2), np.float32),
    )  # fmt: skip
    names = [field.name for field in fields(DensePoints)]
    return DensePoints(**{name: np.concatenate([getattr(part, name) for part in (empty, *parts)]) for name in names})


def write_points(folder: Path, points: DensePoints) -> None:
    """Keep points in a folder.

    Args:
        folder: Existing folder; gains a folder `points`.
        points: What to keep.
    """
    (folder / FOLDER).mkdir(exist_ok=True)
    for field in fields(DensePoints):
        save_array(folder / FOLDER / f"{field.name}.npy", getattr(points, field.name))


def read_points(folder: Path) -> DensePoints:
    """Read what `write_points` wrote.

    Args:
        folder: The same folder.
    """
    return DensePoints(*(
        np.load(folder / FOLDER / f"{field.name}.npy", allow_pickle=False) for field in fields(DensePoints)
    ))  # fmt: skip


def save_array(path: Path, array: NDArray[Any]) -> None:
    """Write an array as a whole or not at all.

    Args:
        path: File to write.
        array: Array of any shape.
    """
    data = BytesIO()
    np.lib.format.write_array(data, array, allow_pickle=False)
    write_bytes(path, data.getvalue(), durable=False)
