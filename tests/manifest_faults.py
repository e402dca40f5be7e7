"""What `groundwork.files.write_manifest` promises, checked by other means than the store's."""

import hashlib
import json
from pathlib import Path

from groundwork.files import MANIFEST


def manifest_faults(folder: Path, name: str = MANIFEST) -> list[str]:
    """Compare a folder with its manifest.

    Args:
        folder: Folder that should hold a manifest.
        name: File name of the manifest.

    Returns:
        One line per missing, changed or extra file; empty when all is well.
    """
    table = json.loads((folder / name).read_text())["files"]
    found = {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    found = {file: data for file, data in found.items() if file != name and not Path(file).name.startswith(".")}
    wrong = [f"{file}: missing" for file in sorted(table.keys() - found)]
    wrong += [f"{file}: not in the manifest" for file in sorted(found.keys() - table)]
    return wrong + [
        f"{file}: changed"
        for file in sorted(found.keys() & table)
        if (len(found[file]), hashlib.sha256(found[file]).hexdigest()) != (table[file]["bytes"], table[file]["sha256"])
    ]
