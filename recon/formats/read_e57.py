"""Read points of E57 files, unpacked in a child process with limits."""

import tempfile
from pathlib import Path

import numpy as np

from groundwork.child import reason_of, run_child
from groundwork.errors import ChildError, InputError
from groundwork.progress import SILENT, Progress
from recon.formats.scan_points import Scan, check_coordinates, check_count

MAGIC = b"ASTM"
_TIME_LIMIT = 3600.0  # [s]
_MEMORY_LIMIT = 8.0  # [GB]


def read_e57(path: Path, most_points: int, progress: Progress = SILENT) -> Scan:
    """Read all scans of an E57 file, each moved to its pose.

    Args:
        path: The file.
        most_points: Points above which it is refused.
        progress: Listener.

    Raises:
        InputError: Damaged, too large, or the package pye57 is not installed.
    """
    with tempfile.TemporaryDirectory() as folder:
        request = {"path": str(path), "out": folder, "most": most_points}
        try:
            run_child(
                "recon.formats.unpack_e57",
                request,
                memory_limit=_MEMORY_LIMIT,
                time_limit=_TIME_LIMIT,
                progress=progress,
            )
        except ChildError as error:
            raise InputError(
                f"not readable as E57: {reason_of(error)[:80]}", where=path, hint="Copy it again"
            ) from None
        found = {
            name: np.load(Path(folder) / f"{name}.npy", allow_pickle=False)
            for name in ("coord", "color", "intensity")
            if (Path(folder) / f"{name}.npy").is_file()
        }
    check_count(path, len(found["coord"]), most_points)
    check_coordinates(path, found["coord"])
    return Scan(found["coord"], found.get("color"), intensity=found.get("intensity"))
