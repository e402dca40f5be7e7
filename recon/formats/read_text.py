"""Read points as lines of numbers: XYZ files, and the text form of S3DIS (x y z r g b and an optional label)."""

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from recon.formats.scan_points import Scan, as_colors, as_ids, check_coordinates, check_count, column_named, label_names

SUFFIXES = (".xyz", ".txt", ".csv", ".asc", ".pts")
BYTE_ORDER_MARK = b"\xef\xbb\xbf"
"""In front of UTF-8, as spreadsheets write it."""
_MOST_TEXT = 2_000_000_000  # [bytes]
_LONGEST_LINE = 4096  # [bytes]
_SHORTEST_LINE = 6  # [bytes] three digits, two blanks and a line end
NAMES = {
    "r": "red",
    "g": "green",
    "b": "blue",
    "label": "segment",
    "class": "segment",
    "scalar_label": "segment",
    "classification": "segment",
    "scalar_classification": "segment",
    "i": "intensity",
    "reflectance": "intensity",
}
# Meaning of unnamed columns, by their number.
LAYOUTS: dict[int, tuple[str, ...]] = {
    3: ("x", "y", "z"),
    4: ("x", "y", "z", "intensity"),
    6: ("x", "y", "z", "red", "green", "blue"),
    7: ("x", "y", "z", "red", "green", "blue", "segment"),
    8: ("x", "y", "z", "red", "green", "blue", "segment", "instance"),
}
_PTS = {7: ("x", "y", "z", "intensity", "red", "green", "blue")}  # as programs of laser scanners write .pts


def read_text(path: Path, most_points: int, labels: bool | str = True) -> Scan:
    """Read lines of numbers, separated by blanks, tabs, commas or semicolons.

    A first line of names names the columns; without one their number decides: three are x y z, four have
    intensity, six a color, seven a color and a label (in .pts files intensity and a color), eight an instance too.

    Args:
        path: The file.
        most_points: Points above which it is refused.
        labels: Read the columns of labels, and refuse those that hold none; or the name of the column of class ids.

    Raises:
        InputError: Not lines of numbers, or too many.
    """
    length = path.stat().st_size
    if length > _MOST_TEXT or length // _SHORTEST_LINE > most_points * 100:
        raise InputError(
            "too large a text file",
            where=path,
            value=length,
            allowed=f"up to {_MOST_TEXT} bytes",
            hint="Convert it to LAZ",
        )
    if not length:
        raise InputError("holds no points", where=path)
    with path.open("rb") as file:
        head = [file.readline(_LONGEST_LINE) for _ in range(2)]
    skipped, names, mark = first_line(path, head)
    try:
        with path.open(encoding="utf-8-sig") as text:
            table = np.loadtxt(text, np.float64, comments="#", delimiter=mark, skiprows=skipped, ndmin=2)
    except (ValueError, UnicodeDecodeError) as error:
        reason = re.sub(r"\s+", " ", str(error))[:80]
        raise InputError(f"not lines of numbers: {reason}", where=path, hint="Write x y z on each line") from None
    check_count(path, len(table), most_points)
    width = table.shape[1]
    columns = names or layout_of(path, width)
    if columns is None or len(columns) != width:
        raise InputError(
            "an unknown number of columns without names",
            where=path,
            value=width,
            allowed=f"{', '.join(map(str, LAYOUTS))} columns, or a first line with names",
        )
    return scan_of_columns(path, {name: table[:, place] for place, name in enumerate(columns)}, labels)


def layout_of(path: Path, width: int) -> tuple[str, ...] | None:
    """Name the columns of a text that does not.

    Args:
        path: The file, whose suffix counts.
        width: Number of columns.

    Returns:
        Their names; None where the number is not known.
    """
    return (_PTS if path.suffix.lower() == ".pts" else LAYOUTS).get(width, LAYOUTS.get(width))


def first_line(path: Path, head: list[bytes]) -> tuple[int, tuple[str, ...], str | None]:
    """Detect the header and the separator of a text file.

    Args:
        path: File, for the error.
        head: Its first two lines.

    Returns:
        Lines to skip; names of the columns, none if the text does not state them; the separator, None for blanks.

    Raises:
        InputError: No text, or a name twice.
    """
    if b"\0" in head[0] or len(head[0]) >= _LONGEST_LINE:
        raise InputError("neither text nor another known format", where=path)
    first = head[0].removeprefix(BYTE_ORDER_MARK).decode("ascii", "replace").strip()
    words = re.split(r"[,;\s]+", first.lstrip("/# "))
    second = head[1].decode("ascii", "replace")
    mark = next((sign for sign in ",;" if sign in (second or first)), None)
    if all(re.fullmatch(r"[A-Za-z_]\w*", word) for word in words):
        names = tuple(NAMES.get(word.lower(), word.lower()) for word in words)
        if len(set(names)) < len(names) and not first.startswith("#"):
            raise InputError("a duplicate column", where=path, value=first[:80])
        if {"x", "y", "z"} <= set(names):
            return 1, names, mark
    return int(len(words) == 1 and words[0].isdigit() and len(second.split()) > 1), (), mark  # .pts: a count


def scan_of_columns(path: Path, columns: dict[str, NDArray[Any]], labels: bool | str) -> Scan:
    """Make a scan of named columns.

    Args:
        path: File, for the error.
        columns: Columns by name, shape (N,) each: x, y, z, and optionally red, green, blue, nx, ny, nz, segment,
            instance and intensity; others are ignored.
        labels: Read segment and instance, and refuse values that are none; or the name of the column of class ids.

    Raises:
        InputError: No position, or a column whose values are invalid for its name.
    """
    missing = [name for name in "xyz" if name not in columns]
    if missing:
        raise InputError("a point without a position", where=path, field=missing[0], allowed="x, y and z")
    coord = np.column_stack([columns[name] for name in "xyz"]).astype(np.float64)
    check_coordinates(path, coord)
    found: dict[str, Any] = {}
    if all(name in columns for name in ("red", "green", "blue")):
        found["color"] = as_colors(path, np.column_stack([columns[name] for name in ("red", "green", "blue")]))
    if all(name in columns for name in ("nx", "ny", "nz")):
        found["normal"] = np.column_stack([columns[name] for name in ("nx", "ny", "nz")]).astype(np.float32)
    (asked,) = label_names(labels, ("segment",))
    segments = (asked, NAMES.get(asked, asked))
    for field, names, kind in (("segment", segments, np.uint8), ("instance", ("instance",), np.uint32)):
        known = column_named(names, columns)
        if labels and known is not None:
            found[field] = as_ids(path, known, columns[known], kind)
    if "intensity" in columns:
        found["intensity"] = columns["intensity"].astype(np.float32)
    return Scan(coord, **found)
