"""Fused points and the views that they are made of, in memory and as the dense step's child hands them over."""

import shutil
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass, fields
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.files import space_errors, write_bytes

FOLDER = "points"
KINDS = {
    "points": np.dtype(np.float64), "normals": np.dtype(np.float32), "colors": np.dtype(np.uint8),
    "counts": np.dtype(np.int64), "image": np.dtype(np.uint32), "uv": np.dtype(np.float32),
}  # fmt: skip


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


def write_points(folder: Path, parts: Iterable[DensePoints]) -> int:
    """Keep points in a folder, part after part: no more than one part is ever in memory.

    Args:
        folder: Existing folder; gains a folder `points`.
        parts: What to keep, in order; at least one.

    Returns:
        Number of points.

    Raises:
        OutOfSpaceError: The disk is full.
    """
    (folder / FOLDER).mkdir(exist_ok=True)
    count, shapes = 0, dict[str, tuple[int, ...]]()
    with ExitStack() as open_files, space_errors(folder):
        files = {
            field.name: open_files.enter_context((folder / FOLDER / f"{field.name}.raw").open("wb"))
            for field in fields(DensePoints)
        }
        for part in parts:
            count += len(part.points)
            for name, file in files.items():
                array = np.asarray(getattr(part, name), KINDS[name])
                file.write(np.ascontiguousarray(array).data)
                shapes[name] = (shapes.get(name, (0,))[0] + len(array), *array.shape[1:])
    for name, shape in shapes.items():
        _finish(folder / FOLDER / f"{name}.raw", KINDS[name], shape)
    return count


def _finish(raw: Path, kind: np.dtype[Any], shape: tuple[int, ...]) -> None:
    """Put a header before an array's bytes."""
    header = {"descr": np.lib.format.dtype_to_descr(kind), "fortran_order": False, "shape": shape}
    with space_errors(raw), raw.open("rb") as body, raw.with_suffix(".npy").open("wb") as file:
        np.lib.format.write_array_header_1_0(file, header)
        shutil.copyfileobj(body, file)
    raw.unlink()


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
