"""Copy a LAS or LAZ file with labels added and everything else unchanged; write new LAZ files for other sources."""

import copy
import ctypes
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from groundwork.files import whole_file
from recon.formats.labels import DTYPES, NAMES, Labels, refuse_labeled
from recon.formats.read_las import LasRows
from recon.formats.scan_points import Scan
from usd_schemas.components import NOISY_POINT, UNLABELED

F64 = NDArray[np.float64]

_DESCRIPTIONS = ("class id, 255 for none", "confidence of the class", "connected part of a class")
_NEW_FORMATS = 6  # first point format with a separate byte for the class
_LARGEST_OLD_CODE = 31  # of the five bits in the formats before
_UNCLASSIFIED, _NOISE = 1, 7  # LAS codes; its 16 is a part of a power line
_STEP = 0.0001  # [m] of a new file
_CREATED = date(2000, 1, 1)
_COPC = "copc"  # user of the records of a tree over the points of a compressed file
_COUNTS, _MOST_16 = 2**31 - 1, 65535


def copy_las(source: Path, rows: LasRows, out: Path, labels: Iterable[Labels], classify: bool) -> None:
    """Copy a file point by point and append three extra dimensions; only `classify` changes other bytes of the points.

    Args:
        source: LAS or LAZ file.
        rows: Its points.
        out: .las or .laz file to write.
        labels: Labels of the points, in their order, in pieces of any size.
        classify: Write the class into `classification` too; 255 becomes 1, unclassified, and 16, a
            noisy point in every table, becomes 7, noise.

    Raises:
        InputError: The header cannot be copied, it holds predictions already, or `classify` meets a class above 31 in
            point formats 0 to 5, which have five bits for it; then no file is left.
    """
    import laspy
    from laspy.vlrs.vlrlist import VLRList

    refuse_labeled(source, tuple(rows.header.extra))
    try:
        with laspy.open(source) as reader:
            header, appended = copy.deepcopy(reader.header), list(reader.evlrs or ())
    except Exception as error:  # laspy may raise any exception of its parser
        raise InputError(f"its header cannot be copied: {str(error)[:80]}", where=source) from None
    for row in [row for row in header.vlrs if row.user_id == _COPC]:  # the copy is in the order of the points
        header.vlrs.remove(row)
    appended = [row for row in appended if row.user_id != _COPC]
    known: Any = header.vlrs.get("ExtraBytesVlr")
    said = [bytes(row) for record in known for row in record.extra_bytes_structs]
    header.add_extra_dims(
        [laspy.ExtraBytesParams(name, DTYPES[name], text) for name, text in zip(NAMES, _DESCRIPTIONS, strict=True)]
    )
    dtype = header.point_format.dtype()
    if dtype.itemsize != rows.header.size + sum(kind.itemsize for kind in DTYPES.values()):
        raise InputError(
            "has bytes in its points that cannot be copied",
            where=source,
            value=rows.header.size,
            hint="Write the file again with another program",
        )
    with whole_file(out) as partial, _writer(partial, header, out, said) as writer:
        for first, part in _pieces(labels):
            last = first + len(part.classes)
            table = np.zeros(last - first, dtype)
            table.view(np.uint8).reshape(last - first, -1)[:, : rows.header.size] = rows.rows[first:last]
            for name, values in part.columns.items():
                table[name] = values
            if classify:
                _set_classification(source, table, part.classes, rows.header.format)
            writer.write_points(_record(table, writer.header))
        if appended:
            writer.write_evlrs(VLRList(appended))


@dataclass(frozen=True)
class Extent:
    """The extent of all points of a scan.

    Attributes:
        low: Lower corner [m], shape (3,), float64.
        high: Upper corner [m], shape (3,), float64.
        weakest: Least intensity [any unit].
        strongest: Greatest intensity [any unit].
    """

    low: F64
    high: F64
    weakest: float
    strongest: float


def extent_of(scans: Iterable[Scan]) -> Extent:
    """Measure a scan.

    Args:
        scans: The points, in pieces of any size, at least one.
    """
    rows = [
        (
            scan.coord.min(axis=0),
            scan.coord.max(axis=0),
            np.nan if scan.intensity is None else np.nanmin(scan.intensity),
            np.nan if scan.intensity is None else np.nanmax(scan.intensity),
        )
        for scan in scans
    ]
    low, high, weakest, strongest = zip(*rows, strict=True)
    return Extent(np.min(low, axis=0), np.max(high, axis=0), float(np.min(weakest)), float(np.max(strongest)))


def new_las(out: Path, scans: Iterable[Scan], labels: Iterable[Labels], extent: Extent, classify: bool) -> None:
    """Write a new LAS or LAZ file, point format 7, of a source that is neither: positions, colors and intensity.

    Args:
        out: .las or .laz file to write.
        scans: The points, in pieces of any size.
        labels: Labels of these points, in the same pieces.
        extent: Extent of all points. Intensities beyond 16 bits, or between 0 and 1, are scaled to 16 bits.
        classify: As for `copy_las`.
    """
    import laspy

    header = laspy.LasHeader(point_format=7, version="1.4")
    header.creation_date = _CREATED
    header.system_identifier = header.generating_software = "Falsework"
    header.global_encoding.wkt = True
    coarsest = float((extent.high - extent.low).max() + 1.0) / _COUNTS
    header.scales, header.offsets = np.full(3, max(_STEP, 10.0 ** np.ceil(np.log10(coarsest)))), np.floor(extent.low)
    header.add_extra_dims(
        [laspy.ExtraBytesParams(name, DTYPES[name], text) for name, text in zip(NAMES, _DESCRIPTIONS, strict=True)]
    )
    with whole_file(out) as partial, _writer(partial, header, out, []) as writer:
        for scan, part in zip(scans, labels, strict=True):
            record = laspy.ScaleAwarePointRecord.zeros(len(scan), header=writer.header)
            record["x"], record["y"], record["z"] = scan.coord.T
            if scan.color is not None:
                for name, values in zip(("red", "green", "blue"), scan.color.T, strict=True):
                    record[name] = values.astype(np.uint16) * 257
            if scan.intensity is not None:
                record["intensity"] = _in_16_bits(scan.intensity, extent)
            record["return_number"] = record["number_of_returns"] = np.ones(len(scan), np.uint8)
            for name, values in part.columns.items():
                record[name] = values
            if classify:
                _set_classification(out, record.array, part.classes, 7)
            writer.write_points(record)


def _in_16_bits(intensity: NDArray[np.float32], extent: Extent) -> NDArray[np.uint16]:
    """Convert intensities to whole numbers: unchanged where they are such numbers, else scaled."""
    values, low, high = np.nan_to_num(intensity.astype(np.float64)), extent.weakest, extent.strongest
    if low < 0.0 or high > _MOST_16:
        values = (values - low) / max(high - low, 1e-12) * _MOST_16
    elif high <= 1.0:
        values = values * _MOST_16
    return np.rint(np.clip(values, 0.0, _MOST_16)).astype(np.uint16)


def _writer(partial: Path, header: Any, out: Path, said: list[bytes]) -> Any:
    import laspy

    packed = out.suffix.lower() == ".laz"
    backend = laspy.LazBackend.Lazrs if packed else None
    # not atomic: the caller renames it when it is whole
    writer = laspy.open(partial, mode="w", header=header, do_compress=packed, laz_backend=backend)
    # The library would write the bounds of the last piece of points over those that the source states.
    known: Any = writer.header.vlrs.get("ExtraBytesVlr")
    for record in known:
        record.grow = _leave_alone
        for row, before in zip(record.extra_bytes_structs, said, strict=False):
            ctypes.memmove(ctypes.addressof(row), before, len(before))
    return writer


def _leave_alone(points: object) -> None:
    del points


def _record(table: np.ndarray, header: Any) -> Any:
    import laspy

    return laspy.ScaleAwarePointRecord(table, header.point_format, scales=header.scales, offsets=header.offsets)


def _pieces(labels: Iterable[Labels]) -> Iterator[tuple[int, Labels]]:
    first = 0
    for part in labels:
        yield first, part
        first += len(part.classes)


def _set_classification(source: Path, table: np.ndarray, classes: np.ndarray, number: int) -> None:
    """Set the class; old point formats keep it in the lower five bits of a byte that also holds three flags."""
    codes = np.where(classes == UNLABELED, _UNCLASSIFIED, classes).astype(np.uint8)
    codes[classes == NOISY_POINT] = _NOISE
    if number >= _NEW_FORMATS:
        table["classification"] = codes
        return
    if codes.max(initial=0) > _LARGEST_OLD_CODE:
        raise InputError(
            f"point format {number} has five bits for the class",
            where=source,
            field="classification",
            value=int(codes.max()),
            allowed=f"0 to {_LARGEST_OLD_CODE}",
            hint="Convert the file to point format 6 or a later one first, or choose a table with smaller numbers",
        )
    table["raw_classification"] = (table["raw_classification"] & 0xE0) | codes
