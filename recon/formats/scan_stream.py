"""A scan read in chunks: LAS and LAZ stay on the disk, the other formats are held in memory."""

from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from groundwork.foreign_file import open_regular
from recon.formats.read_las import LasRows
from recon.formats.scan_points import Scan


class ScanStream:
    """The points of a scan in the order of its file, without labels unless it is a cloud of ours.

    Attributes:
        count: Number of points.
        unit: Length of one unit of the coordinates [m]; None if the file does not state it, 0 where they are angles.
        las: The bytes of the points, of LAS and LAZ only.
    """

    def __init__(self, source: LasRows | Scan, unit: float | None) -> None:
        """Store the opened points.

        Args:
            source: Points on the disk or in memory.
            unit: Length of one unit of the coordinates [m].
        """
        self.las = source if isinstance(source, LasRows) else None
        self._scan = source if isinstance(source, Scan) else None
        self.unit = unit
        self.count = source.header.count if isinstance(source, LasRows) else len(source)

    def chunks(self, size: int) -> Iterator[Scan]:
        """Iterate over the points; may be called more than once.

        Args:
            size: Most points at a time.

        Yields:
            The next points.
        """
        for first in range(0, self.count, size):
            last = min(first + size, self.count)
            if self.las is not None:
                yield self.las.decode(first, last, labels=False)
            elif self._scan is not None:
                yield _part(self._scan, slice(first, last))


def _part(scan: Scan, rows: slice) -> Scan:
    values: dict[str, Any] = {field.name: getattr(scan, field.name) for field in fields(scan)}
    cut: dict[str, Any] = {name: v[rows] if isinstance(v, np.ndarray) else v for name, v in values.items()}
    return Scan(**cut)


def magic_of(path: Path) -> bytes:
    """Read the first four bytes of a file.

    Args:
        path: The file.

    Raises:
        InputError: It cannot be read, or is not a regular file.
    """
    with open_regular(path) as file:
        return file.read(4)
