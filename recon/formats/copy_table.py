"""Copy text files and arrays with labels as three additional columns."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from groundwork.errors import InputError
from groundwork.files import whole_file
from recon.formats.labels import DTYPES, NAMES, Labels, refuse_labeled
from recon.formats.read_numpy import open_array
from recon.formats.read_text import BYTE_ORDER_MARK, first_line, layout_of

_LONGEST_LINE = 4096  # [bytes]
_MAGIC = 12  # [bytes] before the header of an array


def copy_text(source: Path, out: Path, labels: Iterable[Labels]) -> None:
    """Copy lines and append class, confidence and instance to each; comments and empty lines do not change.

    Args:
        source: Text file.
        out: Text file to write.
        labels: Labels of the points, in their order, in pieces of any size.

    Raises:
        InputError: It holds predictions already.
    """
    with source.open("rb") as file:
        skipped, names, mark = first_line(source, [file.readline(_LONGEST_LINE) for _ in range(2)])
    refuse_labeled(source, names)
    between = (mark or " ").encode()
    # not atomic: renamed when it is whole
    with source.open("rb") as file, whole_file(out) as partial, partial.open("wb") as copy:
        if not skipped and (unnamed := _layout(source, mark)):
            first = file.readline()
            start = BYTE_ORDER_MARK if first.startswith(BYTE_ORDER_MARK) else b""
            file.seek(len(start))
            head = between.join(name.encode() for name in (*unnamed, *NAMES))
            copy.write(start + b"# " + head + (b"\r\n" if first.endswith(b"\r\n") else b"\n"))
        for _ in range(skipped):
            line = file.readline()
            body = line.rstrip(b"\r\n")
            added = between + between.join(name.encode() for name in NAMES) if names else b""
            copy.write(body + added + line[len(body) :])
        for part in labels:
            for label, sure, instance in zip(part.classes, part.confidence, part.instance, strict=True):
                line = file.readline()
                while line and not line.split(b"#")[0].strip():
                    copy.write(line)
                    line = file.readline()
                body = line.rstrip(b"\r\n")
                numbers, sign, comment = body.partition(b"#")
                values = (f"{label}".encode(), f"{sure:.6g}".encode(), f"{instance}".encode())
                told = numbers.rstrip() + between + between.join(values) + (b" #" + comment if sign else b"")
                copy.write(told + (line[len(body) :] or b"\n"))
        copy.write(file.read())


def _layout(source: Path, mark: str | None) -> tuple[str, ...]:
    """Name the columns of a text without names, as `read_text` interprets them; their copy would be read otherwise."""
    with source.open("rb") as file:
        for line in file:
            if words := line.removeprefix(BYTE_ORDER_MARK).partition(b"#")[0].strip():
                width = len(words.split(mark.encode() if mark else None))
                return layout_of(source, width) or ()
    return ()


def copy_array(source: Path, out: Path, labels: Iterable[Labels]) -> None:
    """Copy an array: records gain three fields; a table gains three columns, and becomes float64 to hold all ids.

    Args:
        source: .npy file.
        out: .npy file to write.
        labels: Labels of the points, in their order, in pieces of any size.

    Raises:
        InputError: It holds predictions already, or there are labels for another number of points.
    """
    array = open_array(source)
    names = array.dtype.names
    refuse_labeled(source, names or ())
    if names is None:
        dtype, shape = np.dtype(np.float64), (len(array), array.shape[1] + len(NAMES))
    else:
        dtype = np.dtype([*((name, array.dtype[name]) for name in names), *DTYPES.items()])
        shape = (len(array),)
    with whole_file(out) as partial, partial.open("wb") as copy:  # not atomic: renamed when it is whole
        copy.write(_array_header(dtype, shape))
        first = 0
        for part in labels:
            rows = array[first : first + len(part.classes)]
            first += len(part.classes)
            if names is None:
                table = np.column_stack([rows.astype(np.float64), *part.columns.values()])
            else:
                table: Any = np.zeros(len(rows), dtype)
                for name in names:
                    table[name] = rows[name]
                for name, values in part.columns.items():
                    table[name] = values
            copy.write(table.tobytes())
    if first != len(array):
        raise InputError("labels for another number of points", where=source, value=first, allowed=str(len(array)))


def _array_header(dtype: np.dtype[Any], shape: tuple[int, ...]) -> bytes:
    """Describe an array; only version 3 of the format has names in other alphabets.

    Source: NumPy Enhancement Proposal 1, "A Simple File Format for NumPy Arrays".
    """
    text = f"{{'descr': {np.lib.format.dtype_to_descr(dtype)!r}, 'fortran_order': False, 'shape': {shape!r}, }}"
    version, body = (2, text.encode("latin-1")) if text.isascii() else (3, text.encode())
    body += b" " * (-(_MAGIC + len(body) + 1) % 64) + b"\n"
    return b"\x93NUMPY" + bytes([version, 0]) + len(body).to_bytes(4, "little") + body
