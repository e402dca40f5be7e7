"""Read PLY files: text or binary, points in one element or in several of the same length.

Source: G. Turk, The PLY Polygon File Format (1994).
"""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from recon.formats.scan_points import Scan, as_ids, check_coordinates, check_count, column_named, label_names

MAGIC = b"ply"
_HEADER = 1 << 16  # [bytes] the longest header that is read
_MOST_PROPERTIES = 1000
_MOST_TEXT = 500_000_000  # [bytes] of a text file
_BLOCK = 1 << 25  # [bytes] of text that are read at once
_TYPES = {
    "char": "i1",
    "int8": "i1",
    "uchar": "u1",
    "uint8": "u1",
    "short": "i2",
    "int16": "i2",
    "ushort": "u2",
    "uint16": "u2",
    "int": "i4",
    "int32": "i4",
    "uint": "u4",
    "uint32": "u4",
    "float": "f4",
    "float32": "f4",
    "double": "f8",
    "float64": "f8",
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_COLORS = (("red", "green", "blue"), ("r", "g", "b"), ("diffuse_red", "diffuse_green", "diffuse_blue"))
_LABELS = ("segment", "label", "class", "classification")
_INSTANCES = ("instance", "instance_id")
_INTENSITIES = ("intensity", "reflectance")


@dataclass(frozen=True)
class Element:
    """One element of a PLY file.

    Attributes:
        name: Its name.
        count: Number of rows.
        properties: Name and numpy type of each property; None for the type of a list.
    """

    name: str
    count: int
    properties: tuple[tuple[str, str | None], ...]


def read_ply(path: Path, most_points: int, labels: bool | str = True) -> Scan:
    """Read the points of a PLY file.

    Args:
        path: The file.
        most_points: Points above which it is refused.
        labels: Read the columns of labels, and refuse those that hold none; or the name of the column of class ids.

    Raises:
        InputError: Damaged, cut off, with a wrong header, without points, or too large.
    """
    order, elements, start = read_ply_header(path)
    vertex = next((element for element in elements if element.name == "vertex"), elements[0] if elements else None)
    if vertex is None:
        raise InputError("has no element vertex", where=path)
    check_count(path, vertex.count, most_points)
    wanted: list[Element] = []
    for element in elements:  # behind a list offsets are unknown; other elements are not needed
        if any(kind is None for _, kind in element.properties):
            break
        wanted.append(element)
    if vertex not in wanted:
        raise InputError("its points have lists, or follow an element with lists", where=path, field=vertex.name)
    while wanted[-1].count != vertex.count:
        wanted.pop()
    tables = (_read_text if order == "" else _read_binary)(path, order, wanted, start)
    columns: dict[str, NDArray[Any]] = {}
    for element, table in zip(wanted, tables, strict=True):
        if element.count == vertex.count:
            columns = {**table, **columns}
    return _scan(path, columns, labels)


def read_ply_header(path: Path) -> tuple[str, list[Element], int]:
    """Read and check the header.

    Args:
        path: The file.

    Returns:
        Byte order as numpy writes it, empty for text; the elements; and the first byte behind the header.

    Raises:
        InputError: Not the header of a PLY file.
    """
    with path.open("rb") as file:
        head = file.read(_HEADER)
    ending = re.search(rb"[\r\n]end_header[ \t\r]*\n", head)
    if not head.startswith(MAGIC) or ending is None:
        raise InputError("not a PLY file, or cut off in its header", where=path)
    order, elements = None, []
    for line in head[: ending.start()].decode("ascii", "replace").splitlines()[1:]:
        words = line.split()
        if not words or words[0] in ("comment", "obj_info"):
            continue
        if words[0] == "format" and len(words) == 3 and words[1] in _ORDERS:
            order = _ORDERS[words[1]]
        elif words[0] == "element" and len(words) == 3 and words[2].isascii() and words[2].isdigit():
            elements.append(Element(words[1], int(words[2][:19]), ()))
        elif words[0] == "property" and elements and len(words) in (3, 5):
            kind = None if words[1] == "list" else _TYPES.get(words[1])
            if words[1] != "list" and (kind is None or len(words) != 3):
                raise InputError("an unknown type", where=path, field=words[-1], value=words[1])
            last = elements.pop()
            elements.append(Element(last.name, last.count, (*last.properties, (words[-1], kind))))
        else:
            raise InputError("an unknown line in the header", where=path, value=line[:80])
        if (elements and len(elements[-1].properties) > _MOST_PROPERTIES) or len(elements) > _MOST_PROPERTIES:
            raise InputError("too many columns", where=path, allowed=f"at most {_MOST_PROPERTIES}")
    if order is None:
        raise InputError("does not state its format", where=path, allowed=", ".join(_ORDERS))
    for element in elements:
        names = [name for name, _ in element.properties]
        if len(set(names)) < len(names):
            raise InputError("a duplicate property", where=path, field=element.name)
    return order, elements, ending.end()


def _read_binary(path: Path, order: str, elements: list[Element], start: int) -> list[dict[str, NDArray[Any]]]:
    tables, length = [], path.stat().st_size
    for element in elements:
        row = np.dtype([(name, f"{order}{kind}") for name, kind in element.properties])
        if start + element.count * row.itemsize > length:
            room = (length - start) // max(row.itemsize, 1)
            raise InputError(
                f"cut off: the file has room for {room} rows only",
                where=path,
                field=element.name,
                value=element.count,
                hint="Copy it again",
            )
        if row.itemsize and element.count:
            rows = np.memmap(path, row, "r", start, (element.count,))
            tables.append({name: np.array(rows[name]) for name, _ in element.properties})
        else:
            tables.append({})
        start += element.count * row.itemsize
    return tables


def _read_text(path: Path, _: str, elements: list[Element], start: int) -> list[dict[str, NDArray[Any]]]:
    """Read numbers as text; a number and the blank behind it take at least two bytes."""
    need = sum(element.count * len(element.properties) for element in elements)
    length = path.stat().st_size - start
    if 2 * need > length + 1:
        raise InputError(
            "cut off, or its header states a wrong number of points",
            where=path,
            value=need,
            allowed=f"up to {length // 2} numbers in a text of this length",
        )
    if length > _MOST_TEXT:
        raise InputError(
            "too large a text file",
            where=path,
            value=length,
            allowed=f"up to {_MOST_TEXT} bytes",
            hint="Write it as binary PLY",
        )
    parts: list[NDArray[np.float64]] = []
    got, rest = 0, b""
    with path.open("rb") as file:
        file.seek(start)
        while got < need and (block := file.read(_BLOCK)):
            words = (rest + block).split()
            rest = words.pop() if not block[-1:].isspace() and words else b""
            parts.append(_numbers(path, words[: need - got]))
            got += len(parts[-1])
    if got < need and rest:
        parts.append(_numbers(path, [rest]))
    numbers = np.concatenate([*parts, np.zeros(0)])
    if len(numbers) < need:
        raise InputError(f"cut off: it has {len(numbers)} numbers only", where=path, value=need, hint="Copy it again")
    tables, at = [], 0
    for element in elements:
        width = len(element.properties)
        table = numbers[at : at + element.count * width].reshape(element.count, width)
        tables.append({name: table[:, i] for i, (name, _) in enumerate(element.properties)})
        at += element.count * width
    return tables


def _numbers(path: Path, words: list[bytes]) -> NDArray[np.float64]:
    try:
        return np.array(words, np.bytes_).astype(np.float64) if words else np.zeros(0)
    except ValueError as error:
        raise InputError(f"not a number: {str(error)[-60:]}", where=path) from None


def _scan(path: Path, columns: dict[str, NDArray[Any]], labels: bool | str) -> Scan:
    missing = [name for name in "xyz" if name not in columns]
    if missing:
        raise InputError("a point without a position", where=path, field=missing[0], allowed="x, y and z")
    coord = np.column_stack([columns[name] for name in "xyz"]).astype(np.float64)
    check_coordinates(path, coord)
    normal = None
    if all(name in columns for name in ("nx", "ny", "nz")):
        normal = np.column_stack([columns[name] for name in ("nx", "ny", "nz")]).astype(np.float32)
    trio = next((names for names in _COLORS if all(name in columns for name in names)), None)
    color = _color(path, np.column_stack([columns[name] for name in trio])) if trio else None
    found: dict[str, Any] = {}
    segments = label_names(labels, _LABELS)
    for field, names, kind in (("segment", segments, np.uint8), ("instance", _INSTANCES, np.uint32)):
        known = column_named(names, columns)
        if labels and known is not None:
            found[field] = as_ids(path, known, columns[known], kind)
    known = column_named(_INTENSITIES, columns)
    if known is not None:
        found["intensity"] = columns[known].astype(np.float32)
    return Scan(coord, color, normal, **found)


def _color(path: Path, values: NDArray[Any]) -> NDArray[np.uint8]:
    """Convert colors of 8 or 16 bits, or from 0 to 1."""
    if not np.isfinite(values).all() or values.min() < 0:
        raise InputError("not a color", where=path, field="red, green, blue")
    top = values.max()
    if np.issubdtype(values.dtype, np.floating) and top <= 1.0:
        return np.rint(values * 255).astype(np.uint8)
    if top <= 255:
        return values.astype(np.uint8)
    if top <= 65535:
        return (values / 257).astype(np.uint8)
    raise InputError("not a color", where=path, field="red, green, blue", value=float(top), allowed="0 to 65535")
