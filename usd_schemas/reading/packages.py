"""Files inside usdz packages, unpacked for image readers, which need files."""

import hashlib
import zlib
from pathlib import Path
from zipfile import ZIP_STORED, BadZipFile, ZipFile

from groundwork.canonical import file_digest
from groundwork.errors import FalseworkError
from groundwork.files import write_bytes
from groundwork.user_cache import cache_folder

_LARGEST = 1_000_000_000  # bytes of one file


def unpacked_folder() -> Path:
    """Return the folder of unpacked files, each named by the hash of its content."""
    return cache_folder("packages")


def unpacked(resolved: str) -> str:
    """Unpack a file of a package.

    Args:
        resolved: Resolved path as USD writes it: `package.usdz[folder/file]`.

    Returns:
        Absolute path of a file with its content; empty if there is none, or if none can be written.
    """
    package, _, inner = resolved.partition("[")
    try:
        with ZipFile(package) as archive:
            facts = archive.getinfo(inner.removesuffix("]"))
            if facts.compress_type != ZIP_STORED or facts.file_size > _LARGEST:  # files in a usdz are not compressed
                return ""
            data = archive.read(facts)
    except (OSError, KeyError, ValueError, EOFError, NotImplementedError, RuntimeError, BadZipFile, zlib.error):
        return ""
    content = hashlib.sha256(data).hexdigest()
    place = unpacked_folder().resolve() / f"{content}{Path(facts.filename).suffix.lower()}"
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        if not place.is_file() or file_digest(place) != content:
            write_bytes(place, data, durable=False)
    except (OSError, FalseworkError):
        return ""
    return str(place)
