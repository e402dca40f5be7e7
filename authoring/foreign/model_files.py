"""The files of an imported model: only those beside it, none too large; archives are checked first."""

import re
import zipfile
import zlib
from pathlib import Path
from urllib.parse import unquote

from groundwork.errors import InputError, MissingError
from groundwork.files import write_bytes
from groundwork.foreign_file import is_regular, read_regular
from groundwork.slug import inside

MOST_BYTES = 1_000_000_000  # of any one file
MOST_UNPACKED = 4_000_000_000  # of an archive, in total
MOST_RATIO = 200.0  # text is compressed to a twentieth, a zip bomb to a thousandth
MOST_ENTRIES = 20_000
UNSOUND = (  # errors of unpacking a damaged archive
    zipfile.BadZipFile,
    zlib.error,
    EOFError,
    RuntimeError,
    NotImplementedError,
    ValueError,
    OSError,
)
_REMOTE = re.compile(r"^([A-Za-z][A-Za-z0-9+.-]+:|//)")  # a drive letter is one letter


def check_file(file: Path) -> None:
    """Check a file before it is opened.

    Args:
        file: Any path.

    Raises:
        MissingError: There is no such file.
        InputError: Too large, or empty.
    """
    if not is_regular(file):
        raise MissingError("no such file", where=file, hint="Check the path")
    size = file.stat().st_size
    if size > MOST_BYTES:
        raise InputError(
            f"too large to import: {size / 1e9:.1f} GB",
            where=file,
            allowed=f"up to {MOST_BYTES / 1e9:g} GB",
            hint="Cut out a smaller tile",
        )
    if not size:
        raise InputError("is empty", where=file)


def read_beside(model: Path, name: str, what: str) -> bytes:
    """Read a file that a model refers to.

    Args:
        model: The model's file; its references must lead to its folder or below.
        name: The reference as written; percent codes are decoded.
        what: Its purpose, e.g. `texture`.

    Raises:
        InputError: It is remote, absolute, leads out of the folder, or is missing.
    """
    if _REMOTE.match(name):
        raise InputError(
            f"{what} {name[:200]} is remote", where=model, allowed="files below its folder", hint="Copy the file there"
        )
    home = model.resolve().parent
    plain = unquote(name).replace("\\", "/")
    target = (home / plain.replace("\0", "")).resolve()
    if "\0" in plain or not target.is_relative_to(home) or plain.startswith("/"):
        raise InputError(
            f"{what} {name[:200]} leads out of the folder",
            where=model,
            allowed="files below its folder",
            hint="Copy the file there",
        )
    if not is_regular(target):
        raise MissingError(f"{what} {name[:200]} is not there", where=model, hint="Copy the file beside it")
    check_file(target)
    return read_regular(target, MOST_BYTES)


def unpack(archive: Path, folder: Path, suffixes: tuple[str, ...]) -> Path:
    """Unpack a model with its textures.

    Args:
        archive: `.zip` file.
        folder: Existing empty folder.
        suffixes: Suffixes of model files; exactly one such file must be inside.

    Returns:
        The model's file.

    Raises:
        InputError: Not an archive, a zip bomb, entries outside the folder, or not exactly one model.
    """
    entries = check_archive(archive)
    models = [e.filename for e in entries if Path(e.filename).suffix.lower() in suffixes]
    if len(models) != 1:
        raise InputError(
            f"holds {len(models)} models",
            where=archive,
            allowed=f"one of {', '.join(suffixes)}",
            hint="Unpack it and name one of them, or join them",
        )
    with zipfile.ZipFile(archive) as packed:
        for entry in entries:
            target = inside(folder, entry.filename, where=archive)
            try:
                target.parent.mkdir(parents=True, exist_ok=True)
                with packed.open(entry) as source:
                    data = source.read(entry.file_size + 1)
            except UNSOUND as error:
                raise InputError(f"cannot be unpacked: {error}", where=f"{archive}: {entry.filename}") from None
            if len(data) != entry.file_size:
                raise InputError("is larger than the archive states", where=f"{archive}: {entry.filename}")
            if target.is_dir():
                raise InputError("an entry that is both a file and a folder", where=f"{archive}: {entry.filename}")
            write_bytes(target, data)
    return folder / models[0]


def check_archive(archive: Path) -> list[zipfile.ZipInfo]:
    """Check an archive by its table of contents.

    Args:
        archive: `.zip` or `.usdz` file.

    Returns:
        Its files, folders left out, sorted by name.

    Raises:
        InputError: Not an archive, too many or too large files, too high a compression ratio, or names outside the
            folder.
    """
    check_file(archive)
    try:
        with zipfile.ZipFile(archive) as packed:
            entries = [entry for entry in packed.infolist() if not entry.filename.endswith("/")]
    except UNSOUND as error:
        raise InputError(
            f"not a valid archive: {error}", where=archive, hint="Check that the file is complete"
        ) from None
    whole = sum(entry.file_size for entry in entries)
    if len(entries) > MOST_ENTRIES or whole > MOST_UNPACKED:
        raise InputError(
            f"unpacks to {len(entries)} files, {whole / 1e9:.1f} GB",
            where=archive,
            allowed=f"up to {MOST_ENTRIES} files, {MOST_UNPACKED / 1e9:g} GB",
            hint="Cut out a smaller tile",
        )
    for entry in entries:
        ratio = entry.file_size / max(entry.compress_size, 1)
        if ratio > MOST_RATIO and entry.file_size > 1_000_000:
            raise InputError(
                f"unpacks to {ratio:.0f} times its size",
                where=f"{archive}: {entry.filename}",
                allowed=f"up to {MOST_RATIO:g} times",
            )
        path = Path(entry.filename.replace("\\", "/"))
        if (
            not path.parts
            or path.is_absolute()
            or ".." in path.parts
            or (entry.external_attr >> 16) & 0o170000 == 0o120000
        ):
            raise InputError("an entry leads out of the archive", where=f"{archive}: {entry.filename}")
    return sorted(entries, key=lambda entry: entry.filename)
