"""Copy text files and arrays with labels as three additional columns."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from groundwork.errors import InputError
from groundwork.files import whole_file
from recon.formats.labels import DTYPES, NAMES, Labels, refuse_labeled
from recon.formats.read_numpy import open_array
from recon.formats.read_text import BYTE_ORDER_MARK, first_line

_LONGEST_LINE = 4096  # [bytes]


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
        for _ in range(skipped):
            line = file.readline()
            body = line.rstrip(b"\r\n")
            added = between + between.join(name.encode() for name in NAMES) if names else b""
            copy.write(body + added + line[len(body) :])
        known = BYTE_ORDER_MARK if not skipped else b""
        for part in labels:
            for label, sure, instance in zip(part.classes, part.confidence, part.instance, strict=True):
                line = file.readline()
                while line and not line.removeprefix(known).split(b"#")[0].strip():
                    copy.write(line)
                    known, line = b"", file.readline()
                known = b""
                body = line.rstrip(b"\r\n")
                values = (f"{label}".encode(), f"{sure:.6g}".encode(), f"{instance}".encode())
                copy.write(body.rstrip() + between + between.join(values) + (line[len(body) :] or b"\n"))
        copy.write(file.read())


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
        header = {"descr": np.lib.format.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
        np.lib.format.write_array_header_2_0(copy, header)
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
