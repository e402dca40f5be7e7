"""Fused points and the views that they are made from, in memory and as files of the dense step's child."""

from collections.abc import Iterable
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
        normals: Unit normals towards the cameras [1], shape (N, 3), float32.
        colors: Mean sRGB colors, shape (N, 3), uint8.
        counts: Views of each point, shape (N,), int64.
        image: Row in the model of each observation, sorted by point, then ascending, shape (M,), uint32.
        uv: Where each view shows the point [px], shape (M, 2), float32, pixel centers at +0.5.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float32]
    colors: NDArray[np.uint8]
    counts: NDArray[np.int64]
    image: NDArray[np.uint32]
    uv: NDArray[np.float32]


def write_points(folder: Path, parts: Iterable[DensePoints]) -> int:
    """Write points to a folder, part by part, so that only one part is in memory.

    Args:
        folder: Existing folder; gains a folder `points`.
        parts: The parts to write, in order.

    Returns:
        Number of points.

    Raises:
        OutOfSpaceError: The disk is full.
    """
    (folder / FOLDER).mkdir(exist_ok=True)
    count = 0
    for number, part in enumerate(parts):
        place = folder / FOLDER / f"{number:06d}"
        place.mkdir(exist_ok=True)
        for field in fields(DensePoints):
            save_array(place / f"{field.name}.npy", getattr(part, field.name))
        count += len(part.points)
    return count


def read_points(folder: Path) -> DensePoints:
    """Read what `write_points` wrote; there must be at least one part.

    Args:
        folder: The same folder.
    """
    places = sorted((folder / FOLDER).iterdir())
    return DensePoints(
        *(
            np.concatenate([np.load(place / f"{field.name}.npy", allow_pickle=False) for place in places])
            for field in fields(DensePoints)
        )
    )


def save_array(path: Path, array: NDArray[Any]) -> None:
    """Write an array atomically.

    Args:
        path: File to write.
        array: Array, shape (...), any type.
    """
    data = BytesIO()
    np.lib.format.write_array(data, array, allow_pickle=False)
    write_bytes(path, data.getvalue(), durable=False)
