"""Read LAS and LAZ files: the header is read and checked here, field by field; a library is used only to unpack LAZ.

Source: ASPRS, LAS Specification 1.4 R15.
"""

import shutil
import struct
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.child import reason_of, run_child
from groundwork.errors import ChildError, InputError
from groundwork.progress import SILENT, Progress
from recon.formats.scan_points import Scan, as_ids, check_coordinates, check_count, column_named, label_names

F64 = NDArray[np.float64]

MAGIC = b"LASF"
_SIZES = {0: 20, 1: 28, 2: 26, 3: 34, 4: 57, 5: 63, 6: 30, 7: 36, 8: 38, 9: 59, 10: 67}  # [bytes] of a point
_COLORS = {2: 20, 3: 28, 5: 28, 7: 30, 8: 30, 10: 30}  # offset of red
_HEADERS = {0: 227, 1: 227, 2: 227, 3: 235, 4: 375}  # [bytes] by minor version
_NEW_FORMATS = 6  # first point format with a separate byte for the class
_VLR_HEAD = struct.Struct("<H16sHH32s")
_EXTRA_TYPES = {1: "u1", 2: "i1", 3: "<u2", 4: "<i2", 5: "<u4", 6: "<i4", 7: "<u8", 8: "<i8", 9: "<f4", 10: "<f8"}
_EXTRA_SIZE = 192  # [bytes] of the description of one extra dimension
_NORMALS = (("normalx", "nx"), ("normaly", "ny"), ("normalz", "nz"))  # as CloudCompare and PDAL write them
_LABELS, _INSTANCES = ("segment", "label", "class_id", "semantic"), ("instance", "instance_id")
_BEYOND = (1.0, 0.01)  # [m] and share of the box that points may lie outside the bounds that the header states
_BLOCK = 2_000_000  # points decoded at once
_TIME_LIMIT, _TIME_PER_MILLION = 30.0, 10.0  # [s]
_MEMORY_LIMIT = 1.0  # [GB]
_MOST_BYTES = 20_000_000_000  # unpacked: a small file of equal points could exceed any disk


@dataclass(frozen=True)
class LasHeader:
    """The fields of a header that are used.

    Attributes:
        offset: First byte of the points.
        format: Point format, 0 to 10.
        size: Bytes of a point.
        count: Number of points.
        compressed: Whether it is LAZ.
        scale: Resolution of the integer coordinates [m], shape (3,), float64.
        shift: Offset added to them [m], shape (3,), float64.
        bounds: Lower and upper corner as stated [m], shape (2, 3), float64.
        extra: Name, offset and numpy type of each extra dimension that is a single number.
        class_names: Class lookup table.
        laszip: Record of the compressor.
        records: Every variable-length record, by user and number.
    """

    offset: int
    format: int
    size: int
    count: int
    compressed: bool
    scale: F64
    shift: F64
    bounds: F64
    extra: dict[str, tuple[int, str]]
    class_names: dict[int, str]
    laszip: bytes
    records: dict[tuple[str, int], bytes]


def read_las(path: Path, most_points: int, progress: Progress = SILENT, labels: bool | str = True) -> Scan:
    """Read LAS or LAZ.

    Args:
        path: The file.
        most_points: Points above which it is refused.
        progress: Listener.
        labels: Read the columns of labels; or the name of the column of class ids.

    Raises:
        InputError: Damaged, cut off, with a wrong header, or too large.
    """
    with open_las(path, most_points, progress) as rows:
        return rows.decode(0, rows.header.count, labels)


@contextmanager
def open_las(path: Path, most_points: int, progress: Progress = SILENT) -> Iterator["LasRows"]:
    """Open LAS, or unpack LAZ to a temporary file, so that the points can be read in chunks.

    Args:
        path: The file.
        most_points: Points above which it is refused.
        progress: Listener.

    Yields:
        The points, until the context ends.

    Raises:
        InputError: Damaged, cut off, with a wrong header, or too large.
    """
    header = read_header(path)
    check_count(path, header.count, most_points)
    if not header.compressed:
        room = (path.stat().st_size - header.offset) // header.size
        if room < header.count:
            raise InputError(
                f"cut off: the file has room for {room} points only",
                where=path,
                value=header.count,
                hint="Copy it again",
            )
        yield LasRows(path, header, np.memmap(path, np.uint8, "r", header.offset, (header.count, header.size)))
        return
    with tempfile.TemporaryDirectory() as folder:
        raw, need = Path(folder) / "points", header.count * header.size
        if need > min(_MOST_BYTES, shutil.disk_usage(folder).free):
            raise InputError(
                f"needs {need / 1e9:.1f} GB when unpacked, more than is free",
                where=path,
                value=header.count,
                hint="Cut it into tiles, or thin it out",
            )
        request = {
            "path": str(path),
            "out": str(raw),
            "offset": header.offset,
            "size": header.size,
            "count": header.count,
            "laszip": header.laszip.hex(),
        }
        try:
            run_child(
                "recon.formats.unpack_laz",
                request,
                memory_limit=_MEMORY_LIMIT,
                progress=progress,
                time_limit=_TIME_LIMIT + _TIME_PER_MILLION * header.count / 1e6,
            )
        except ChildError as error:
            raise InputError(f"not decodable as LAZ: {reason_of(error)}", where=path, hint="Copy it again") from None
        yield LasRows(path, header, np.memmap(raw, np.uint8, "r", 0, (header.count, header.size)))


def read_header(path: Path) -> LasHeader:
    """Read and check the header and the records between it and the points.

    Args:
        path: The file.

    Raises:
        InputError: A field is invalid.
    """
    length = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(_HEADERS[4])
        if len(head) < _HEADERS[0] or head[:4] != MAGIC:
            raise InputError("not a LAS file, or cut off in its header", where=path)
        major, minor, size, offset, records, kind, width, legacy = struct.unpack_from("<BB68xHIIBHI", head, 24)
        if major != 1 or minor not in _HEADERS:
            raise InputError(
                "an unknown version", where=path, field="version", value=f"{major}.{minor}", allowed="1.0 to 1.4"
            )
        if not _HEADERS[minor] <= size <= offset <= length or len(head) < _HEADERS[minor]:
            raise InputError("header and points overlap, or lie beyond the end", where=path, value=(size, offset))
        number, compressed = kind & 0x3F, bool(kind & 0x80)
        if number not in _SIZES or width < _SIZES[number]:
            raise InputError(
                "an invalid point format",
                where=path,
                field="point format",
                value=(number, width),
                allowed="0 to 10, with records of at least its length",
            )
        count = (struct.unpack_from("<Q", head, 247)[0] if minor == 4 else 0) or legacy
        numbers = np.frombuffer(head, "<f8", 12, 131)
        scale, shift = numbers[:3], numbers[3:6]
        if not (np.isfinite(numbers).all() and (np.abs(scale) >= 1e-9).all() and (np.abs(scale) <= 1e4).all()):
            raise InputError("an invalid scale, offset or bound", where=path, value=numbers.tolist())
        file.seek(size)
        found = _records(path, file.read(offset - size) if offset - size <= _most_records(records) else b"", records)
    extra = _extra_dimensions(path, found.get(("LASF_Spec", 4), b""), _SIZES[number], width)
    laszip = found.get(("laszip encoded", 22204), b"")
    if compressed and not laszip:
        raise InputError("compressed, but without the laszip record", where=path, field="laszip record")
    names = found.get(("LASF_Spec", 0), b"")
    table = {
        names[at]: names[at + 1 : at + 16].split(b"\0")[0].decode("ascii", "replace")
        for at in range(0, len(names) - 15, 16)
    }
    bounds = numbers[6:].reshape(3, 2).T[::-1]
    return LasHeader(offset, number, width, count, compressed, scale, shift, bounds, extra, table, laszip, found)


def _most_records(count: int) -> int:
    """Compute the largest number of bytes of the records; the rest is not read."""
    return min(count, 10_000) * (_VLR_HEAD.size + 0xFFFF) + (1 << 20)


def _records(path: Path, data: bytes, count: int) -> dict[tuple[str, int], bytes]:
    """Read the variable-length records by user and number."""
    found, at = {}, 0
    for row in range(count):
        if at + _VLR_HEAD.size > len(data):
            raise InputError(f"record {row} of {count} lies beyond the points", where=path, field="records")
        _, user, number, length, _ = _VLR_HEAD.unpack_from(data, at)
        at += _VLR_HEAD.size
        if at + length > len(data):
            raise InputError(f"record {row} reaches beyond the points", where=path, field="records", value=length)
        found.setdefault((user.split(b"\0")[0].decode("ascii", "replace"), number), data[at : at + length])
        at += length
    return found


def _extra_dimensions(path: Path, data: bytes, base: int, width: int) -> dict[str, tuple[int, str]]:
    """Find the offsets of the extra dimensions; they follow the fields of the point format."""
    found, at = {}, base
    for start in range(0, len(data) - _EXTRA_SIZE + 1, _EXTRA_SIZE):
        kind, options = data[start + 2], data[start + 3]
        name = data[start + 4 : start + 36].split(b"\0")[0].decode("ascii", "replace")
        if kind in _EXTRA_TYPES:
            found.setdefault(name, (at, _EXTRA_TYPES[kind]))
            at += np.dtype(_EXTRA_TYPES[kind]).itemsize
        elif kind == 0:
            at += options  # undescribed bytes
        elif kind <= 30:
            at += np.dtype(_EXTRA_TYPES[(kind - 1) % 10 + 1]).itemsize * ((kind - 1) // 10 + 1)
        else:
            raise InputError("an extra dimension of an unknown type", where=path, field=name, value=kind)
        if at > width:
            raise InputError(
                "extra dimensions longer than a point", where=path, field=name, value=at, allowed=str(width)
            )
    return found


class LasRows:
    """The points of a LAS file as bytes on the disk, decoded in chunks.

    Attributes:
        header: Header of the file.
        rows: Bytes of each point, shape (N, size), uint8.
    """

    def __init__(self, path: Path, header: LasHeader, rows: NDArray[np.uint8]) -> None:
        """Store the undecoded bytes.

        Args:
            path: File, for errors.
            header: Header of the file.
            rows: Bytes of each point, shape (N, size), uint8.
        """
        self.path, self.header, self.rows = path, header, rows

    @cached_property
    def _brightest(self) -> int:
        """Find the largest color, or one above 255; some programs write 8 bits into 16, and 0 if nothing is known."""
        at, brightest = _COLORS[self.header.format], 0
        for first in range(0, self.header.count, _BLOCK):
            last = min(first + _BLOCK, self.header.count)
            for band in range(3):
                brightest = max(brightest, int(self._column(at + 2 * band, "<u2", first, last).max()))
                if brightest > 255:
                    return brightest
        return brightest

    def _column(self, at: int, kind: str, first: int, last: int) -> NDArray[Any]:
        width = np.dtype(kind).itemsize
        parts = [
            np.ascontiguousarray(self.rows[start : min(start + _BLOCK, last), at : at + width]).view(kind)[:, 0]
            for start in range(first, last, _BLOCK)
        ]
        return np.concatenate(parts)

    def _normal(self, first: int, last: int) -> NDArray[np.float32] | None:
        """Read the normals from extra dimensions; None if there are none."""
        extra = self.header.extra
        names = [column_named(pair, extra) for pair in _NORMALS]
        found = [self._column(*extra[name], first, last) for name in names if name is not None]
        if len(found) < 3:
            return None
        normal = np.column_stack(found).astype(np.float64)  # whole numbers have a scale
        return (normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)).astype(np.float32)

    def decode(self, first: int, last: int, labels: bool | str = True) -> Scan:
        """Decode a range of points into columns.

        Args:
            first: First point.
            last: Point behind the last one.
            labels: Read the columns of labels, and refuse those that hold none; or the name of the column of class ids.

        Raises:
            InputError: A position is invalid, or outside the bounds that the header states.
        """
        header = self.header
        coord = np.empty((last - first, 3))
        for axis in range(3):
            coord[:, axis] = self._column(4 * axis, "<i4", first, last) * header.scale[axis] + header.shift[axis]
        check_coordinates(self.path, coord)
        _check_bounds(self.path, coord, header.bounds)
        color = None
        if header.format in _COLORS and self._brightest:
            at = _COLORS[header.format]
            bands = np.column_stack([self._column(at + 2 * band, "<u2", first, last) for band in range(3)])
            color = (bands >> 8 if self._brightest > 255 else bands).astype(np.uint8)
        new = header.format >= _NEW_FORMATS
        codes = (
            self._column(16, "u1", first, last) if new else np.bitwise_and(self._column(15, "u1", first, last), 0x1F)
        )
        found: dict[str, NDArray[Any]] = {}
        columns = {"user_data": (17, "u1"), "point_source_id": (20 if new else 18, "<u2"), **header.extra}
        segments = label_names(labels, _LABELS)
        for field, names, kind in (("segment", segments, np.uint8), ("instance", _INSTANCES, np.uint32)):
            known = column_named(names, columns)
            if labels and known is not None:
                found[field] = as_ids(self.path, known, self._column(*columns[known], first, last), kind)
        return Scan(
            coord,
            color,
            self._normal(first, last),
            intensity=self._column(12, "<u2", first, last).astype(np.float32),
            classification=codes,
            class_names=header.class_names,
            **found,
        )


def _check_bounds(path: Path, coord: F64, bounds: F64) -> None:
    """Compare positions with the header's bounds: LAZ has no checksum, and damage shows as points far outside."""
    if not bounds.any():  # some programs do not fill them in
        return
    slack = _BEYOND[0] + _BEYOND[1] * np.abs(bounds[1] - bounds[0])
    if (coord.min(axis=0) < bounds[0] - slack).any() or (coord.max(axis=0) > bounds[1] + slack).any():
        raise InputError(
            "points lie outside the bounds in the header",
            where=path,
            value=[coord.min(axis=0).tolist(), coord.max(axis=0).tolist()],
            allowed=str(bounds.tolist()),
            hint="Copy the file again, or correct its header",
        )
