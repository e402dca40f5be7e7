"""Write a copy of a scan with labels added: everything that it held is kept, and the points keep their order."""

from collections.abc import Callable, Iterator
from pathlib import Path

from groundwork.errors import InputError
from recon.formats import read_e57, read_las, read_numpy, read_ply
from recon.formats.copy_las import copy_las, extent_of, new_las
from recon.formats.copy_ply import copy_ply
from recon.formats.copy_table import copy_array, copy_text
from recon.formats.labels import Labels
from recon.formats.read_text import SUFFIXES
from recon.formats.scan_stream import ScanStream, magic_of

_LAS = (".las", ".laz")
_KINDS = {
    read_las.MAGIC: _LAS,
    read_ply.MAGIC + b"\n": (".ply",),
    read_ply.MAGIC + b"\r": (".ply",),
    read_numpy.MAGIC: (".npy",),
    read_e57.MAGIC: (),
}


def check_copy(source: Path, out: Path) -> None:
    """Refuse a copy that cannot be written, before any work is done.

    Args:
        source: Scan.
        out: File to write.

    Raises:
        InputError: A suffix that does not fit, the source itself, a missing folder, or a scan that cannot be read.
    """
    allowed = (*_KINDS.get(magic_of(source), SUFFIXES), *_LAS)
    if out.suffix.lower() not in allowed:
        raise InputError(
            "not the format of the scan",
            where=out,
            field="-o",
            value=out.suffix,
            allowed=", ".join(dict.fromkeys(allowed)),
        )
    if out.exists() and (out.is_dir() or out.samefile(source)):
        raise InputError("is a folder, or the scan itself", where=out, field="-o", hint="Choose another name")
    if not out.parent.is_dir():
        raise InputError("no such folder", where=out.parent, field="-o", hint="Make the folder first")


def write_labeled_copy(
    source: Path, stream: ScanStream, out: Path, labels: Callable[[], Iterator[Labels]], chunk: int, classify: bool
) -> None:
    """Write a copy of a scan with `predicted_class`, `predicted_confidence` and `predicted_instance` for each point.

    Order, coordinates, reference system, records and every other column do not change. If the copy is a LAS file and
    the source is not, a new file with positions, colors and intensity is written.

    Args:
        source: The scan.
        stream: The same, opened.
        out: File to write; its suffix determines the format.
        labels: Yields the labels of the points in their order, in the pieces of `stream.chunks(chunk)`.
        chunk: Points at a time.
        classify: Write the class into the `classification` of LAS too.

    Raises:
        InputError: The formats do not match, or the source holds predictions already.
    """
    check_copy(source, out)
    kind = out.suffix.lower()
    if kind in _LAS and stream.las is not None:
        copy_las(source, stream.las, out, labels(), classify)
    elif kind in _LAS:
        new_las(out, stream.chunks(chunk), labels(), extent_of(stream.chunks(chunk)), classify)
    elif kind == ".ply":
        copy_ply(source, out, labels())
    elif kind == ".npy":
        copy_array(source, out, labels())
    else:
        copy_text(source, out, labels())
