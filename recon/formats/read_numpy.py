"""Read points from a NumPy array: a table of numbers, or records with named fields; pickled objects are refused."""

from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from recon.formats.read_text import LAYOUTS, NAMES, scan_of_columns
from recon.formats.scan_points import Scan, check_count

MAGIC = b"\x93NUM"


def open_array(path: Path) -> np.ndarray:
    """Memory-map an array; its header must agree with the length of the file.

    Args:
        path: The file.

    Returns:
        Numbers [any unit], shape (N, C), or records, shape (N,).

    Raises:
        InputError: Damaged, of another shape, or pickled.
    """
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError, OverflowError, EOFError, SyntaxError, TokenError) as error:
        raise InputError(f"not readable as an array: {str(error)[:80]}", where=path, hint="Write it again") from None
    if not isinstance(array, np.ndarray):
        raise InputError("an archive, not an array", where=path)
    plain = array.ndim == 2 and array.dtype.kind in "fiu" and array.shape[1] in LAYOUTS
    named = array.ndim == 1 and array.dtype.names is not None
    if not plain and not named:
        raise InputError(
            "not a table of points",
            where=path,
            value=f"{array.dtype} {array.shape}"[:80],
            allowed=f"shape (N, C) with C of {', '.join(map(str, LAYOUTS))}, or named fields",
        )
    return array


def read_numpy(path: Path, most_points: int, labels: bool | str = True) -> Scan:
    """Read the points of an array; columns are interpreted as those of a text file, fields by their names.

    Args:
        path: The file.
        most_points: Points above which it is refused.
        labels: Read the columns of labels, and refuse those that hold none; or the name of the column of class ids.

    Raises:
        InputError: Damaged, not a table of points, or too many.
    """
    array = open_array(path)
    check_count(path, len(array), most_points)
    if array.dtype.names is None:
        names = LAYOUTS[array.shape[1]]
        return scan_of_columns(path, {name: np.asarray(array[:, place]) for place, name in enumerate(names)}, labels)
    fields = {name: np.asarray(array[name]) for name in array.dtype.names if array.dtype[name].kind in "fiu"}
    flat: dict[str, NDArray[Any]] = {}
    for name, values in sorted(fields.items(), key=lambda row: row[0].lower() not in NAMES.values()):  # theirs first
        plain = name.lower()
        if values.ndim == 1:
            plain = plain.removeprefix("scalar_")
            flat.setdefault(NAMES.get(plain, plain), values)
    return scan_of_columns(path, flat, labels)
