"""Arrays in an .npz archive from another program: its headers are checked before memory is allocated."""

import math
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from tokenize import TokenError
from typing import Any, BinaryIO, cast

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from groundwork.foreign_file import check_regular

MOST_BYTES = 16_000_000_000  # of all arrays of an archive, unpacked
_TIGHTEST = 1032  # largest compression ratio of Deflate
_SLACK = 4096  # [bytes] an .npy header
_UNSOUND = (  # errors of reading a damaged archive
    ValueError,
    TypeError,
    OSError,
    EOFError,
    RuntimeError,
    NotImplementedError,
    SyntaxError,
    TokenError,
    MemoryError,
    zipfile.BadZipFile,
    zlib.error,
)
_PACKED = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)


def read_arrays(path: Path, wanted: Mapping[str, tuple[str, tuple[int, ...]]]) -> dict[str, NDArray[Any]]:
    """Read arrays whose types are known from an .npz archive.

    Args:
        path: The archive.
        wanted: Name of each array to its numpy dtype and the shape of one row.

    Returns:
        The arrays, each of shape (rows, *shape of a row); others in the archive are ignored.

    Raises:
        MissingError: There is no such file.
        InputError: No archive, an array is missing, damaged or of another type or shape, or states more data than the
            file has.
    """
    size = check_regular(path)
    try:
        with zipfile.ZipFile(path) as archive:
            entries = {name: archive.getinfo(f"{name}.npy") for name in wanted}
            claimed = sum(entry.file_size for entry in entries.values())
            if claimed > min(MOST_BYTES, _TIGHTEST * size + _SLACK * len(wanted)):
                raise ValueError(f"its header states {claimed / 1e9:.1f} GB")
            found = {}
            for name, (kind, row) in wanted.items():
                if entries[name].compress_type not in _PACKED:
                    raise ValueError(f"{name} has an unknown compression")
                with archive.open(entries[name]) as member:
                    found[name] = _read_array(cast(BinaryIO, member), name, entries[name].file_size, kind, row)
            return found
    except KeyError as error:
        reason = str(error.args[0])
    except _UNSOUND as error:
        reason = str(error)
    raise InputError(f"incomplete or damaged: {reason}", where=path, hint="Make it again, or copy it again")


def _read_array(member: BinaryIO, name: str, size: int, kind: str, row: tuple[int, ...]) -> NDArray[Any]:
    """Read one .npy file, whose size is known."""
    version = np.lib.format.read_magic(member)
    read = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}.get(version)
    if read is None:
        raise ValueError(f"{name} is of version {version}")
    shape, by_columns, dtype = read(member)
    if dtype != np.dtype(kind) or by_columns or len(shape) != 1 + len(row) or shape[1:] != row:
        raise ValueError(f"{name} is {dtype} {shape}, not {kind} {('rows', *row)}")
    need = math.prod(shape) * dtype.itemsize
    if need < 0 or member.tell() + need != size:
        raise ValueError(f"{name} states the shape {shape}, but has {size} bytes")
    data = member.read(need)
    if len(data) != need or member.read(1):  # the last read verifies the checksum
        raise ValueError(f"{name} is cut off")
    return np.frombuffer(data, dtype).reshape(shape).copy()
