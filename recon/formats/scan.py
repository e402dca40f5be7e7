"""One reader for scans: LAS, LAZ, PLY, E57, text, arrays and our own clouds; every file is checked."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from groundwork.errors import InputError, MissingError
from groundwork.progress import SILENT, Progress
from recon.cloud import cloud_unit, read_cloud
from recon.formats import read_e57, read_las, read_numpy, read_ply, read_text
from recon.formats.crs_unit import meters_per_height_unit, meters_per_unit
from recon.formats.labeled_copy import check_copy, write_labeled_copy
from recon.formats.labels import Labels
from recon.formats.scan_points import MOST_POINTS, Scan, check_coordinates
from recon.formats.scan_stream import ScanStream, magic_of

__all__ = [
    "MOST_POINTS",
    "Labels",
    "Scan",
    "ScanStream",
    "check_copy",
    "height_unit",
    "open_scan",
    "read_scan",
    "stated_unit",
    "write_labeled_copy",
]


def read_scan(
    path: Path, most_points: int = MOST_POINTS, progress: Progress = SILENT, *, labels: bool | str = True
) -> Scan:
    """Read a scan; its format is detected by its first bytes, not by its name, except for text.

    Counts and sizes are checked before arrays are allocated (of text only its length), finiteness and the bounds of
    LAS afterwards; LAZ and E57 are unpacked in a child process with limits of memory and time.

    Args:
        path: LAS, LAZ, PLY, E57, NPY or text file, or the folder of a cloud.
        most_points: Points above which a file is refused.
        progress: Listener.
        labels: Read the columns of labels, and refuse those that hold none, such as -1; those of our clouds are always
            read. Or the name of the column of class ids: a property, field, named column, or dimension of LAS.

    Raises:
        MissingError: There is no such file.
        InputError: Not a scan, damaged, cut off, with a wrong header, or too large; names file and reason.
    """
    if path.is_dir():
        cloud = read_cloud(path)
        check_coordinates(path, cloud.columns["coord"])
        coord, color, normal, segment, instance = (
            cloud.columns[name] for name in ("coord", "color", "normal", "segment", "instance")
        )
        return Scan(coord, color, normal, segment, instance, cloud.columns.get("intensity"))
    if not path.is_file():
        raise MissingError("no such file", where=path, hint="Name a .las, .laz or .ply file, or the folder of a cloud")
    try:
        magic = magic_of(path)
        if magic == read_las.MAGIC:
            return read_las.read_las(path, most_points, progress, labels)
        if magic[:3] == read_ply.MAGIC:
            return read_ply.read_ply(path, most_points, labels)
        if magic == read_e57.MAGIC:
            return read_e57.read_e57(path, most_points, progress)
        if magic == read_numpy.MAGIC:
            return read_numpy.read_numpy(path, most_points, labels)
        if path.suffix.lower() in read_text.SUFFIXES:
            return read_text.read_text(path, most_points, labels)
    except OSError as error:
        raise InputError(f"not readable: {error.strerror}", where=path) from None
    raise InputError(
        "neither LAS, LAZ, PLY, E57, NPY nor text",
        where=path,
        value=magic,
        allowed=f"a file of one of these kinds; text by its suffix: {' '.join(read_text.SUFFIXES)}",
        hint="Convert it to LAZ",
    )


@contextmanager
def open_scan(path: Path, most_points: int = MOST_POINTS, progress: Progress = SILENT) -> Iterator[ScanStream]:
    """Open a scan so that its points can be read in chunks, and more than once; only clouds of ours keep their labels.

    Args:
        path: As for `read_scan`.
        most_points: Points above which a file is refused.
        progress: Listener.

    Yields:
        The points; those of LAS and LAZ stay on the disk.

    Raises:
        MissingError: There is no such file.
        InputError: As for `read_scan`.
    """
    if path.is_file() and magic_of(path) == read_las.MAGIC:
        with read_las.open_las(path, most_points, progress) as rows:
            yield ScanStream(rows, meters_per_unit(rows.header.records))
    else:
        yield ScanStream(read_scan(path, most_points, progress, labels=False), stated_unit(path))


def stated_unit(path: Path) -> float | None:
    """Find the length of one unit of a scan's coordinates, as the file states it.

    Args:
        path: As for `read_scan`.

    Returns:
        The length [m]; None if the file does not state it, or nothing brought the cloud to scale; 0 where the
        coordinates are angles.

    Raises:
        MissingError: A folder without a cloud.
        InputError: A damaged header or description.
    """
    if path.is_dir():
        return cloud_unit(path)
    magic = magic_of(path)
    if magic == read_las.MAGIC:
        return meters_per_unit(read_las.read_header(path).records)
    return 1.0 if magic == read_e57.MAGIC else None  # E57 is in meters by its standard


def height_unit(path: Path) -> float | None:
    """Find the length of one unit of a scan's heights, where the file states one for them alone.

    Args:
        path: As for `read_scan`.

    Returns:
        The length [m]; None if the file does not state it.

    Raises:
        InputError: A damaged header.
    """
    if not path.is_file() or magic_of(path) != read_las.MAGIC:
        return None
    return meters_per_height_unit(read_las.read_header(path).records)
