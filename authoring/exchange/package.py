"""A scene in one file: a usdz archive whose bytes depend on its content only."""

import io
import zipfile
from pathlib import Path

from authoring.scenes.own_files import used_files
from groundwork.files import write_bytes
from groundwork.output.file import SIGNATURE

ALIGNMENT = 64  # [byte] where the content of each entry starts, so that it can be mapped into memory
_PADDING_ID = 0x1986  # header of the extra field used as padding
_EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest time in a zip archive
_ZIP_HEADER = 30  # [byte] of a local file header before name and extra field


def package_scene(scene: Path, out: Path) -> list[str]:
    """Put a scene with all its variants into a usdz archive.

    Source: USDZ file format specification, version 1.3: stored entries, the root layer first, contents at multiples
    of 64 bytes.

    Args:
        scene: Root layer.
        out: File to write.

    Returns:
        Names of the entries.

    Raises:
        InputError: The scene uses files outside its folder.
    """
    home, names = scene.resolve().parent, list(used_files(scene))
    names.remove(scene.name)
    names.insert(0, scene.name)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        archive.comment = SIGNATURE.encode()
        for name in names:
            entry = zipfile.ZipInfo(name, _EPOCH)
            entry.create_system = 3  # otherwise it depends on the operating system
            entry.external_attr = 0o644 << 16
            entry.extra = _padding(buffer.tell() + _ZIP_HEADER + len(name.encode()))
            archive.writestr(entry, (home / name).read_bytes())
    out.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(out, buffer.getvalue())
    return names


def _padding(offset: int) -> bytes:
    """Make an extra field that moves content from an offset to the next multiple of 64."""
    length = -(offset + 4) % ALIGNMENT
    return _PADDING_ID.to_bytes(2, "little") + length.to_bytes(2, "little") + bytes(length)
