"""What lies in a folder only to say whose it is and what is being made of it: never content of the folder."""

import json
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

MARK = ".falsework"  # in a finished output: what it is, and which files of it we wrote
TEMPORARY = f"{MARK}-"  # how the name of every file begins that a killed writer may leave
NEXT = ".next"  # in an output: the one that is being made; it has a mark of its own


def is_work(folder: Path) -> bool:
    """Tell whether a folder is one in which an output is being made, and not a folder of the user's of that name.

    Args:
        folder: Any path.
    """
    return folder.name == NEXT and (folder / MARK).is_file()


def content_files(folder: Path) -> list[Path]:
    """List the files below a folder, in sorted order, without marks, temporary files and outputs in the making.

    Args:
        folder: Folder to read.
    """
    files = [path for path in folder.rglob("*") if path.is_file()]
    works = {path.parent for path in files if path.name == MARK and path.parent.name == NEXT}
    return sorted(path for path in files if not is_mark(path.name) and works.isdisjoint(path.parents))


def outputs_below(folder: Path, kind: str) -> set[Path]:
    """Find the outputs of one kind that lie below a folder.

    Args:
        folder: Folder to look through; it is not counted itself.
        kind: What such an output's mark says, e.g. `run`.
    """
    marks = (path for path in folder.rglob(MARK) if path.is_file() and path.parent not in (folder, folder / NEXT))
    return {path.parent for path in marks if read_listing(path).kind == kind}


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
        kind: What the output is, e.g. `capture`.
        files: Every file and link.
        folders: Every folder, those above others first.
        is_marked: Whether the output stays ours; else it is the user's from the moment that it is there.
        is_complete: Whether it names the files at all; marks of earlier versions do not.
    """

    kind: str
    files: tuple[str, ...] = ()
    folders: tuple[str, ...] = ()
    is_marked: bool = True
    is_complete: bool = True

    def as_text(self) -> str:
        """Write it as a mark: the kind on a line of its own, then the names as JSON."""
        names = {"files": self.files, "folders": self.folders, "marked": self.is_marked}
        return f"{self.kind}\n{json.dumps(names, sort_keys=True)}\n" if self.is_complete else f"{self.kind}\n"


def read_listing(mark: Path) -> Listing:
    """Read a mark of this version or an earlier one.

    Args:
        mark: The mark's file.

    Returns:
        What it says. Names that lead out of the folder, and whatever else we would not have written, are left out.
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
    """List what lies in a folder; links are listed, not followed.

    Args:
        folder: Folder to read.
        kind: What it is.
        is_marked: As in `Listing`.
        but: Names at its top that are left out.
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
    """Keep the names that stay in the folder: a mark may come from elsewhere."""
    if not isinstance(names, list):
        return ()
    paths = [Path(name) for name in names if isinstance(name, str) and name and "\0" not in name]
    inside = [path for path in paths if not path.is_absolute() and ".." not in path.parts and path.parts]
    return tuple(sorted(path.as_posix() for path in inside if path.parts[0] not in (MARK, NEXT)))
