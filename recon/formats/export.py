"""Export of clouds for other programs: the formats and their writers."""

from collections.abc import Callable
from pathlib import Path

from groundwork.errors import InputError
from recon.cloud import Cloud, read_cloud
from recon.formats.cameras import write_colmap, write_nerfstudio
from recon.formats.hdf5 import write_hdf5
from recon.formats.laz import write_laz
from recon.formats.ply import write_ply
from recon.formats.pointcept import write_pointcept, write_s3dis

Export = Callable[[Path, Cloud, Path, Path | None], list[str]]


def export_cloud(source: Path, to: str, out: Path, photographs: Path | None = None) -> list[str]:
    """Write a cloud for another program.

    Args:
        source: A cloud.
        to: Row of `EXPORTS`.
        out: Empty folder to fill.
        photographs: Capture whose photographs are exported too (colmap and nerfstudio), or None.

    Returns:
        Files for people to open, relative to `out`.

    Raises:
        InputError: Not a cloud, an unknown format, or a format for which the cloud lacks something.
    """
    if to not in EXPORTS:
        raise InputError("not a cloud format", where=source, field="--to", value=to, allowed=", ".join(EXPORTS))
    return EXPORTS[to](source, read_cloud(source), out, photographs)


def _file(name: str, write: Callable[[Path, Cloud], None]) -> Export:
    def export(_: Path, cloud: Cloud, out: Path, __: Path | None) -> list[str]:
        write(out / name, cloud)
        return [name]

    return export


def _folder(write: Callable[[Path, Cloud], list[str]]) -> Export:
    return lambda _, cloud, out, __: write(out, cloud)


def _write_las(path: Path, cloud: Cloud) -> None:
    write_laz(path, cloud, compress=False)


EXPORTS: dict[str, Export] = {
    "laz": _file("cloud.laz", write_laz),
    "las": _file("cloud.las", _write_las),
    "ply": _file("cloud.ply", write_ply),
    "hdf5": _file("cloud.h5", write_hdf5),
    "pointcept": _folder(write_pointcept),
    "s3dis": _folder(write_s3dis),
    "colmap": write_colmap,
    "nerfstudio": write_nerfstudio,
}
