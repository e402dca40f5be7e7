"""A child process that unpacks the scans of an E57 file into arrays: its parser is native code."""

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from groundwork.child import answer_parent
from groundwork.errors import InputError
from groundwork.progress import Progress
from recon.formats.scan_points import as_colors

_COLORS = ("colorRed", "colorGreen", "colorBlue")


def unpack(request: dict[str, Any], progress: Progress) -> int:
    """Read all scans, each moved to its pose in the world.

    Args:
        request: `{path, out, most}`: file, folder for arrays, and points above which it is refused.
        progress: Listener.

    Returns:
        Number of points.

    Raises:
        InputError: The package is not installed, or the file cannot be read.
    """
    path, out = Path(request["path"]), Path(request["out"])
    try:
        pye57: Any = import_module("pye57")
    except ModuleNotFoundError:
        raise InputError("the package pye57 is not installed", where=path, hint="pip install falsework[e57]") from None
    # The package reads colors as bytes, which are wrong where they have 16 bits or are shares of one.
    pye57.e57.SUPPORTED_POINT_FIELDS |= dict.fromkeys(_COLORS, "f")
    try:
        file = pye57.E57(str(path))
        count = sum(int(file.get_header(scan).point_count) for scan in range(file.scan_count))
        if not 1 <= count <= request["most"]:
            raise InputError(
                "holds no points, or too many", where=path, value=count, allowed=f"at most {request['most']}"
            )
        progress.stage("unpack", count)
        parts = []
        for scan in range(file.scan_count):
            parts.append(file.read_scan(scan, intensity=True, colors=True, ignore_missing_fields=True))
            progress.advance(sum(len(part["cartesianX"]) for part in parts))
    except InputError:
        raise
    except Exception as error:  # pye57 may raise any exception of its parser
        raise InputError(f"not readable as E57: {str(error)[:80]}", where=path, hint="Copy it again") from None
    coord = np.concatenate([np.column_stack([part[f"cartesian{axis}"] for axis in "XYZ"]) for part in parts])
    # inside an atomic folder
    np.save(out / "coord.npy", coord.astype(np.float64))
    if len(coord) and all(name in part for part in parts for name in _COLORS):
        colors = np.concatenate([np.column_stack([part[name] for name in _COLORS]) for part in parts])
        # inside an atomic folder
        np.save(out / "color.npy", as_colors(path, colors))
    if all("intensity" in part for part in parts):
        # inside an atomic folder
        np.save(out / "intensity.npy", np.concatenate([part["intensity"] for part in parts]).astype(np.float32))
    return len(coord)


if __name__ == "__main__":
    answer_parent(unpack)
