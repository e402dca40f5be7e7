"""Scans from elsewhere: one reader for LAS, LAZ, PLY and our own clouds, which trusts no file."""

from pathlib import Path

from groundwork.errors import InputError, MissingError
from groundwork.progress import SILENT, Progress
from recon.cloud import read_cloud
from recon.formats import read_las, read_ply
from recon.formats.scan_points import MOST_POINTS, Scan, check_coordinates


def read_scan(path: Path, most_points: int = MOST_POINTS, progress: Progress = SILENT) -> Scan:
    """Read a scan; what kind it is its first bytes say, not its name.

    Counts, sizes, finiteness and bounds are checked before anything is allocated; LAZ is unpacked in a child process
    with limits of memory and time.

    Args:
        path: LAS, LAZ or PLY file, or the folder of a cloud.
        most_points: Points above which a file is refused.
        progress: Listener.

    Raises:
        MissingError: There is no such file.
        InputError: Not a scan, damaged, cut off, lying about its contents, or too large; names file and reason.
    """
    if path.is_dir():
        cloud = read_cloud(path)
        check_coordinates(path, cloud.columns["coord"])
        coord, color, normal, segment, instance = (
            cloud.columns[name] for name in ("coord", "color", "normal", "segment", "instance")
        )
        return Scan(coord, color, normal, segment, instance, cloud.columns.get("intensity"))
    if not path.is_file():
        raise MissingError("no such file", where=path, mend="Name a .las, .laz or .ply file, or the folder of a cloud")
    try:
        with path.open("rb") as file:
            magic = file.read(4)
        if magic == read_las.MAGIC:
            return read_las.read_las(path, most_points, progress)
        if magic[:3] == read_ply.MAGIC:
            return read_ply.read_ply(path, most_points)
    except OSError as error:
        raise InputError(f"not readable: {error.strerror}", where=path) from None
    raise InputError("neither LAS, LAZ nor PLY", where=path, value=magic, allowed="a file that begins with LASF or ply",
                     mend="Convert it to LAZ")  # fmt: skip
