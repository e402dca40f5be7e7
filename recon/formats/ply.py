"""A cloud as PLY: binary, little endian, one element with every column that other programs can use."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.files import space_errors
from recon.cloud import OPTIONAL_COLUMNS, Cloud

_LABELS = (
    "segment",
    "instance",
    "component",
    "uncertainty",
    "confidence",
    "n_views",
    "label_margin_px",
    "displacement",
)
_TYPES = {"f8": "double", "f4": "float", "u1": "uchar", "i4": "int", "u4": "uint"}
_CHUNK = 1_000_000  # points converted at a time


def write_ply(path: Path, cloud: Cloud) -> None:
    """Write PLY: x, y, z in double precision, nx, ny, nz, red, green, blue, labels and errors.

    Args:
        path: File to write, in a folder that the caller writes atomically.
        cloud: What to write.
    """
    columns = cloud.columns
    fields: list[tuple[str, str, NDArray[np.generic]]] = [
        *((name, "f8", columns["coord"][:, i]) for i, name in enumerate("xyz")),
        *((f"n{name}", "f4", columns["normal"][:, i]) for i, name in enumerate("xyz")),
        *((name, "u1", columns["color"][:, i]) for i, name in enumerate(("red", "green", "blue"))),
        *((name, _code(columns[name]), columns[name]) for name in (*_LABELS, *OPTIONAL_COLUMNS) if name in columns),
    ]
    properties = "".join(f"property {_TYPES[code]} {name}\n" for name, code, _ in fields)
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(cloud)}\n{properties}end_header\n"
    with space_errors(path), path.open("wb") as file:  # inside an atomic folder
        file.write(header.encode())
        for first in range(0, len(cloud), _CHUNK):
            table = np.empty(min(_CHUNK, len(cloud) - first), [(name, f"<{code}") for name, code, _ in fields])
            for name, _, values in fields:
                table[name] = values[first : first + _CHUNK]
            file.write(table.tobytes())


def _code(values: NDArray[Any]) -> str:
    """Choose a type; integers are `int` where they fit, as readers such as Open3D's skip short and unsigned ones."""
    code = values.dtype.str[1:]
    if code not in ("u2", "u4"):
        return code
    return "i4" if values.max(initial=0) <= np.iinfo(np.int32).max else "u4"


def write_colored_points(path: Path, cloud: Cloud) -> None:
    """Write only positions in double precision, normals and colors, as photogrammetry and splatting programs read them.

    Args:
        path: File to write, in a folder that the caller writes atomically.
        cloud: What to write.
    """
    layout = [("xyz", "<3f8"), ("normal", "<3f4"), ("rgb", "3u1")]
    # In single precision a position at map coordinates would be half a meter off.
    names = [("double", name) for name in "xyz"] + [("float", name) for name in ("nx", "ny", "nz")]
    names += [("uchar", name) for name in ("red", "green", "blue")]
    properties = "".join(f"property {kind} {name}\n" for kind, name in names)
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(cloud)}\n{properties}end_header\n"
    table = np.empty(len(cloud), layout)
    table["xyz"], table["normal"], table["rgb"] = (cloud.columns[name] for name in ("coord", "normal", "color"))
    with space_errors(path), path.open("wb") as file:  # inside an atomic folder
        file.write(header.encode() + table.tobytes())
