"""A scan read from a file: points and their other columns, checked before use."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from usd_schemas.components import UNLABELED

F64 = NDArray[np.float64]

MOST_POINTS = 100_000_000  # about 4 GB with colors and labels
FARTHEST = 1e8  # [m] from the origin; map coordinates stay below half of this, even eastings that begin with a zone


@dataclass(frozen=True, eq=False)
class Scan:
    """Points of a file; a column is None where the file has none.

    Attributes:
        coord: Positions, as a rule [m], shape (N, 3), float64.
        color: sRGB colors, shape (N, 3), uint8.
        normal: Normals [1], shape (N, 3), float32.
        segment: Class ids, shape (N,), uint8.
        instance: Instance ids, shape (N,), uint32.
        intensity: Intensity of the return, in the unit of the file [any unit], shape (N,), float32.
        classification: The field `classification` of LAS, unchanged, shape (N,), uint8.
        class_names: The file's names for numbers of `classification`.
    """

    coord: F64
    color: NDArray[np.uint8] | None = None
    normal: NDArray[np.float32] | None = None
    segment: NDArray[np.uint8] | None = None
    instance: NDArray[np.uint32] | None = None
    intensity: NDArray[np.float32] | None = None
    classification: NDArray[np.uint8] | None = None
    class_names: dict[int, str] = field(default_factory=dict)

    def __len__(self) -> int:
        """Count the points."""
        return len(self.coord)


def check_count(path: Path, count: int, most: int) -> None:
    """Refuse a file that states no points, or too many, before anything is allocated.

    Args:
        path: File, for the error.
        count: Points that it states.
        most: Points that are allowed.

    Raises:
        InputError: No points, or too many.
    """
    if count < 1:
        raise InputError("holds no points", where=path)
    if count > most:
        raise InputError(
            "has too many points",
            where=path,
            value=count,
            allowed=f"at most {most}",
            hint="Cut it into tiles, or thin it out",
        )


def check_coordinates(path: Path, coord: F64) -> None:
    """Refuse invalid positions.

    Args:
        path: File, for the error.
        coord: Positions [m], shape (N, 3), float64.

    Raises:
        InputError: One is not finite, or farther from the origin than any map coordinate.
    """
    bad = ~(np.abs(coord).max(axis=1) <= FARTHEST)  # comparisons with NaN are false
    if bad.any():
        row = int(np.argmax(bad))
        raise InputError(
            f"the position of point {row} is not finite or farther than {FARTHEST:.0e} m",
            where=path,
            value=tuple(float(value) for value in coord[row]),
            hint="Write the file again without such points",
        )


def as_ids(path: Path, name: str, values: NDArray[Any], dtype: type[np.uint8 | np.uint32]) -> NDArray[Any]:
    """Convert a column of labels of any number type.

    A -1, as in Pointcept's data sets, and NaN, as CloudCompare writes, mean no label or no instance.

    Args:
        path: File, for the error.
        name: Column, for the error.
        values: The column, shape (N,), any dtype.
        dtype: Unsigned integer type to turn it into.

    Returns:
        Ids, shape (N,); 255 for no label, 0 for no instance.

    Raises:
        InputError: A label is not a whole number of that type.
    """
    top = np.iinfo(dtype).max
    none = UNLABELED if dtype is np.uint8 else 0
    values = np.where((values == -1) | np.isnan(values), np.int16(none), values)
    good = (values >= 0) & (values <= top) & (values == np.floor(values))
    if not good.all():
        raise InputError(
            "not a label",
            where=path,
            field=name,
            value=values[np.argmin(good)].item(),
            allowed=f"whole numbers from 0 to {top}, or -1 for none",
        )
    return values.astype(dtype)


def as_colors(path: Path, values: NDArray[Any]) -> NDArray[np.uint8]:
    """Convert colors of 8 or 16 bits, or from 0 to 1, of a file that does not state which.

    Args:
        path: File, for the error.
        values: Red, green and blue, shape (N, 3), any dtype.

    Returns:
        sRGB colors, shape (N, 3), uint8.

    Raises:
        InputError: A value that is none of these.
    """
    if not np.isfinite(values).all() or values.min() < 0 or values.max() > 65535:
        raise InputError("not a color", where=path, field="red, green, blue", allowed="0 to 1, 0 to 255 or 0 to 65535")
    if values.max() <= 1.0 and (values != np.floor(values)).any():
        return np.rint(values * 255).astype(np.uint8)
    return (values if values.max() <= 255 else values / 257).astype(np.uint8)


def label_names(labels: bool | str, usual: Sequence[str]) -> Sequence[str]:
    """Choose the names that the column of class ids may have.

    Args:
        labels: Name of the column, or whether columns of labels are read.
        usual: Names in lower case where none is given.

    Returns:
        Names for `column_named`.
    """
    return (labels.lower().removeprefix("scalar_"),) if isinstance(labels, str) else usual


def column_named(names: Sequence[str], columns: Iterable[str]) -> str | None:
    """Find the column with one of some names, in capitals or not, also behind the `scalar_` that CloudCompare adds.

    Args:
        names: Names in lower case, in order of priority.
        columns: Names of the columns of a file.

    Returns:
        The column's own name; None where there is none.
    """
    known = {name.lower().removeprefix("scalar_"): name for name in columns}
    return next((known[name] for name in names if name in known), None)
