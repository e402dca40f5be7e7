"""Output folders that are replaced as a whole: claimed first, made in a work folder inside, then moved into place.

Nothing outside the folder is changed, and nothing in it that we did not write. `docs/formats.md` describes the files.
"""

from collections.abc import Callable, Iterable
from pathlib import Path

from groundwork.canonical import digest
from groundwork.errors import InputError, RejectedSceneError, show_place
from groundwork.files import space_errors, sweep, sync, write_bytes
from groundwork.marks import MARK, NEXT, Listing, is_mark, list_folder, read_listing
from groundwork.output.lock import sole_writer
from groundwork.output.place import RUN, output_place
from groundwork.output.swap import FILES, discard, is_ready, make_ready, roll_forward

_NOBODYS = {"lost+found"}  # at the top of a file system
_RESUMES = " resumes"  # kinds of unfinished work that another command must not discard
_ELSEWHERE = "Choose another folder with -o"


def fresh_output(
    folder: Path,
    kind: str,
    write: Callable[[Path], None],
    *,
    inputs: Iterable[Path] = (),
    asked: object = None,
    resume: bool = False,
    is_marked: bool = True,
) -> None:
    """Write an output folder as a whole, replacing an earlier one of Falsework; other files in it are kept.

    Args:
        folder: The folder that the user named.
        kind: Its kind, e.g. `capture`; an output of another kind is not replaced.
        write: Called with an empty folder to fill.
        inputs: Files and folders that it is made from.
        asked: JSON value that describes the request. Unfinished work of an interrupted run is resumed only for the same
            request.
        resume: Call `write` with the unfinished folder of an interrupted run instead; it must check which files are
            valid.
        is_marked: Whether the output belongs to Falsework; else it belongs to the user from its completion on, and the
            folder must be empty before.

    Raises:
        InputError: The folder holds something that Falsework did not write, is not writable, is being written, or is in
            a place that is not allowed.
    """
    place, code = output_place(folder, inputs), digest(asked) + (_RESUMES if resume else "")
    with space_errors(place):
        _refuse_filled(place, kind, is_marked)  # so that not even a lock is put into a foreign folder
        with sole_writer(place) as work:
            if is_ready(place):
                is_same = _said(work) == (kind, code)
                roll_forward(place)
                discard(work)
                if is_same and not is_marked:
                    return
            _refuse_filled(place, kind, is_marked)
            former = _former(place)
            files = _enter(work, kind, code, resume)
            try:
                write(files)
                sweep(files)
                make_ready(place, former, kind, is_marked)
            except BaseException as error:
                show_place(error, files, folder)
                keeps = resume and not isinstance(error, RejectedSceneError) and bool(list_folder(files, kind).files)
                if not keeps and not is_ready(place):
                    discard(work)
                raise
            roll_forward(place)
            discard(work)


def check_run(folder: Path, inputs: Iterable[Path] = ()) -> Path:
    """Refuse a folder that a run may not write into; nothing is written.

    Args:
        folder: The folder that the user named; absent, empty, or of a run.
        inputs: Files and folders that the run is made from.

    Returns:
        The same folder, absolute.

    Raises:
        InputError: It holds anything else, or is in a place that is not allowed.
    """
    place = output_place(folder, inputs)
    with space_errors(place):
        _refuse_filled(place, RUN, True)
    return place


def claim_run(folder: Path, inputs: Iterable[Path] = ()) -> None:
    """Claim the folder of a run, so that the processes that share it may write into it.

    Args:
        folder: The folder that the user named; absent, empty, or of a run.
        inputs: Files and folders that the run is made from.

    Raises:
        InputError: It holds anything else, is not writable, or is in a place that is not allowed.
    """
    place = check_run(folder, inputs)
    with space_errors(place):
        try:
            place.mkdir(parents=True, exist_ok=True)
        except FileNotFoundError:  # such as /proc: not writable despite its permissions
            raise InputError("not writable", where=place.parent, hint=_ELSEWHERE) from None
        if not (place / MARK).is_file():
            write_bytes(place / MARK, Listing(RUN, is_complete=False).as_text().encode())
            sync(place)


def _refuse_filled(place: Path, kind: str, is_marked: bool) -> None:
    """Refuse a folder that is not empty and not an earlier output of the same kind."""
    if not place.exists() or is_ready(place):
        return
    if not place.is_dir():
        raise InputError("is a file, not a folder", where=place, hint=_ELSEWHERE)
    mark = place / MARK
    found = read_listing(mark).kind if mark.is_file() else ""
    if not found:
        if any(path.name not in _NOBODYS | {NEXT} and not is_mark(path.name) for path in place.iterdir()):
            found = "files that Falsework did not write"
        elif _has_other_work(place / NEXT, kind):
            found = f"an unfinished {read_listing(place / NEXT / MARK).kind}"
    if found and not is_marked:
        raise InputError("is not empty", where=place, value=found, hint="Name a new folder with -o")
    if found not in ("", kind):
        raise InputError(
            f"the output folder holds {found}",
            where=place,
            allowed=f"an empty folder, or an earlier {kind}",
            hint=_ELSEWHERE,
        )


def _has_other_work(work: Path, kind: str) -> bool:
    """Tell whether the folder holds unfinished work of another command that can be resumed."""
    said = _said(work)
    return (
        said is not None
        and said[0] != kind
        and said[1].endswith(_RESUMES)
        and bool(list_folder(work / FILES, kind).files)
    )


def _former(place: Path) -> Listing:
    """List the files of Falsework in a folder; all files if its mark is of a version without a list."""
    mark = place / MARK
    if not mark.is_file():
        return Listing("")
    listing = read_listing(mark)
    return listing if listing.is_complete else list_folder(place, listing.kind, but={MARK, NEXT, *_NOBODYS})


def _said(work: Path) -> tuple[str, str] | None:
    """Read the request of unfinished work: the kind of the output, and the hash of the request."""
    mark = work / MARK
    if not mark.is_file():
        return None
    kind, _, code = mark.read_text(encoding="utf-8", errors="replace").partition("\n")
    return kind, code.rstrip("\n")


def _enter(work: Path, kind: str, code: str, resume: bool) -> Path:
    """Open the folder to fill, which is empty unless the same request was interrupted."""
    files = work / FILES
    if not resume or _said(work) != (kind, code) or files.is_symlink():
        discard(work)
        write_bytes(work / MARK, f"{kind}\n{code}\n".encode())
        sync(work)
    files.mkdir(exist_ok=True)
    return files
