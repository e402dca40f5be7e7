"""Marks of output folders: files that state the kind and owner of a folder, and are not part of its content."""

import json
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

MARK = ".falsework"  # in a finished output: its kind, and the files that we wrote
TEMPORARY = f"{MARK}-"  # prefix of temporary files, which a killed writer may leave
NEXT = ".next"  # in an output: folder of the unfinished new output, with its own mark


def is_work(folder: Path) -> bool:
    """Tell whether a folder is a work folder of an unfinished output, and not a user's folder of that name.

    Args:
        folder: Any path.
    """
    return folder.name == NEXT and (folder / MARK).is_file()


def content_files(folder: Path) -> list[Path]:
    """List the files below a folder, in sorted order, without marks, temporary files and unfinished outputs.

    Args:
        folder: Folder to read.
    """
    files = [path for path in folder.rglob("*") if path.is_file()]
    works = {path.parent for path in files if path.name == MARK and path.parent.name == NEXT}
    return sorted(path for path in files if not is_mark(path.name) and works.isdisjoint(path.parents))


def linked_folders(folder: Path) -> list[Path]:
    """List the links to folders below a folder, in sorted order, without those of unfinished outputs; none is followed.

    Args:
        folder: Folder to read.
    """
    links = (path for path in folder.rglob("*") if path.is_symlink() and path.is_dir())
    return sorted(path for path in links if not any(is_work(up) for up in path.parents if up.is_relative_to(folder)))


def outputs_below(folder: Path, kind: str) -> set[Path]:
    """Find the outputs of one kind that lie below a folder.

    Args:
        folder: Folder to search; it is not included itself. Links are not followed, but may be outputs themselves.
        kind: Kind in the mark of such an output, e.g. `run`.
    """
    marks = [path for path in folder.rglob(MARK) if path.parent not in (folder, folder / NEXT)]
    marks += [path / MARK for path in linked_folders(folder)]
    return {path.parent for path in marks if path.is_file() and read_listing(path).kind == kind}


def is_mark(name: str) -> bool:
    """Tell whether a file is a mark or a temporary file by its name.

    Args:
        name: Name without folders.
    """
    return name == MARK or name.startswith(TEMPORARY)


@dataclass(frozen=True)
class Listing:
    """The files and folders of an output, as paths relative to it, in sorted order.

    Attributes:
        kind: Kind of the output, e.g. `capture`.
        files: Every file and link.
        folders: Every folder, parents first.
        is_marked: Whether the output belongs to Falsework; else to the user, from its completion on.
        is_complete: Whether it lists the files; marks of earlier versions do not.
    """

    kind: str
    files: tuple[str, ...] = ()
    folders: tuple[str, ...] = ()
    is_marked: bool = True
    is_complete: bool = True

    def as_text(self) -> str:
        """Format it as a mark: the kind on its own line, then the names as JSON."""
        names = {"files": self.files, "folders": self.folders, "marked": self.is_marked}
        return f"{self.kind}\n{json.dumps(names, sort_keys=True)}\n" if self.is_complete else f"{self.kind}\n"


def read_listing(mark: Path) -> Listing:
    """Read a mark of this version or an earlier one.

    Args:
        mark: The mark's file.

    Returns:
        Its content. Names that leave the folder, and anything else that we would not have written, are left out.
    """
    kind, _, names = mark.read_text(encoding="utf-8", errors="replace").partition("\n")
    try:
        table = json.loads(names) if names.strip() else None
    except (ValueError, RecursionError):
        table = None
    if not isinstance(table, dict):
        return Listing(kind.strip(), is_complete=False)
    files, folders = (_inner(table.get(key)) for key in ("files", "folders"))
    return Listing(kind.strip(), files, folders, table.get("marked") is not False)


def list_folder(folder: Path, kind: str, *, is_marked: bool = True, but: Iterable[str] = ()) -> Listing:
    """List the content of a folder; links are listed, not followed.

    Args:
        folder: Folder to read.
        kind: Its kind.
        is_marked: As in `Listing`.
        but: Names at its top level that are left out.
    """
    files: list[str] = []
    folders: list[str] = []
    left_out = set(but)
    for home, inner, names in os.walk(folder):
        if Path(home) == folder:
            inner[:] = [name for name in inner if name not in left_out]
            names[:] = [name for name in names if name not in left_out]
        links = [name for name in inner if (Path(home) / name).is_symlink()]
        here = Path(home).relative_to(folder)
        folders += [(here / name).as_posix() for name in inner if name not in links]
        files += [(here / name).as_posix() for name in [*names, *links]]
    return Listing(kind, tuple(sorted(files)), tuple(sorted(folders)), is_marked)


def _inner(names: object) -> tuple[str, ...]:
    """Keep the names that stay in the folder: a mark is untrusted."""
    if not isinstance(names, list):
        return ()
    paths = [Path(name) for name in names if isinstance(name, str) and name and "\0" not in name]
    inside = [path for path in paths if not path.is_absolute() and ".." not in path.parts and path.parts]
    return tuple(sorted(path.as_posix() for path in inside if path.parts[0] not in (MARK, NEXT)))
