"""A cloud as one file for other programs: LAZ and PLY, without a clock in any header."""

from datetime import date
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from groundwork.files import write_bytes
from recon.cloud import Cloud
from usd_schemas.components import UNLABELLED

LAZ_SCALE = 0.0001  # [m] coordinates are rounded to this
_FIRST_USER_CLASS = 64  # LAS leaves the codes from here on to users
_UNCLASSIFIED = 1
_CREATED = date(2000, 1, 1)
_EXTRA = {
    "segment": "class id",
    "instance": "component id",
    "component": "component kind",
    "uncertainty": "median depth error [m]",
    "confidence": "share of agreeing views",
    "n_views": "views of the point",
}
_PLY_TYPES = {"f8": "double", "f4": "float", "u1": "uchar", "u2": "ushort", "u4": "uint"}


def write_laz(path: Path, cloud: Cloud) -> None:
    """Write LAZ: LAS 1.4, point format 7, with extra dimensions and the class table as a VLR.

    The field `classification` holds 64 + class id, in the range that LAS leaves to users, and 1 for no class.

    Args:
        path: File to write.
        cloud: What to write.
    """
    import laspy
    from laspy.vlrs.known import ClassificationLookupVlr

    columns = cloud.columns
    header = laspy.LasHeader(point_format=7, version="1.4")
    header.creation_date = _CREATED
    header.system_identifier = header.generating_software = "Falsework"
    header.scales = np.full(3, LAZ_SCALE)
    header.offsets = np.floor(columns["coord"].min(axis=0)) if len(cloud) else np.zeros(3)
    header.add_extra_dims([
        laspy.ExtraBytesParams(name, columns[name].dtype, description) for name, description in _EXTRA.items()
    ])  # fmt: skip
    table = ClassificationLookupVlr()
    for row in cloud.classes:
        if row.id != UNLABELLED:
            table[_FIRST_USER_CLASS + row.id] = row.name[:15]
    header.vlrs.append(table)
    record = laspy.LasData(header)
    record.x, record.y, record.z = columns["coord"].T
    record.red, record.green, record.blue = (columns["color"].astype(np.uint16) * 257).T
    segment = columns["segment"]
    record.classification = np.where(segment == UNLABELLED, _UNCLASSIFIED, _FIRST_USER_CLASS + segment % 128)
    for name in _EXTRA:
        record[name] = columns[name]
    data = BytesIO()
    record.write(data, do_compress=True, laz_backend=laspy.LazBackend.Lazrs)
    write_bytes(path, data.getvalue())


def write_ply(path: Path, cloud: Cloud) -> None:
    """Write PLY, binary and little endian.

    Args:
        path: File to write.
        cloud: What to write.
    """
    columns = cloud.columns
    fields: list[tuple[str, str, NDArray[np.generic]]] = [
        *((name, "f8", columns["coord"][:, i]) for i, name in enumerate("xyz")),
        *((f"n{name}", "f4", columns["normal"][:, i]) for i, name in enumerate("xyz")),
        *((name, "u1", columns["color"][:, i]) for i, name in enumerate(("red", "green", "blue"))),
        *((name, columns[name].dtype.str[1:], columns[name]) for name in (*_EXTRA, "label_margin_px", "displacement")),
    ]
    table = np.empty(len(cloud), [(name, f"<{code}") for name, code, _ in fields])
    for name, _, values in fields:
        table[name] = values
    properties = "".join(f"property {_PLY_TYPES[code]} {name}\n" for name, code, _ in fields)
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(cloud)}\n{properties}end_header\n"
    write_bytes(path, header.encode() + table.tobytes())
