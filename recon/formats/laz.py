"""A cloud as LAS 1.4 or LAZ: point format 7 with extra dimensions, and the class table in the header."""

from collections.abc import Iterable
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from groundwork.errors import InputError
from groundwork.files import space_errors
from recon.cloud import Cloud, is_metric
from usd_schemas.components import UNLABELED

LAZ_SCALE = 0.0001  # [m] coordinates are rounded to this, unless the cloud is too large for it
FIRST_USER_CLASS = 64  # LAS reserves the codes from here on for users
LAST_CLASS = 255 - FIRST_USER_CLASS  # largest class id that has a code of its own in a byte
_UNCLASSIFIED = 1
_CREATED = date(2000, 1, 1)
_COUNTS = 2**31 - 1  # largest integer coordinate
_CHUNK = 1_000_000  # points converted at a time
# A scene has no place on Earth: a local system in meters, in WKT 1 as LAS 1.4 requires.
FRAME = (
    'LOCAL_CS["Falsework scene",LOCAL_DATUM["Falsework scene",0],UNIT["metre",1],'
    'AXIS["X",OTHER],AXIS["Y",OTHER],AXIS["Z",UP]]'
)
EXTRA = {
    "segment": "class id",
    "instance": "component id",
    "component": "component kind",
    "uncertainty": "median depth error [m]",
    "confidence": "share of agreeing views",
    "n_views": "views of the point",
}


def write_laz(path: Path, cloud: Cloud, compress: bool = True) -> None:
    """Write LAS 1.4, point format 7, compressed or not.

    The field `classification` holds 64 + class id, in the range that LAS reserves for users, and 1 for no class; the
    dimension `segment` holds the class id itself. A larger class id than 191 would share its code with another class.
    Intensity and the number of the station, from 1, go into the fields that LAS has for them.

    Args:
        path: File to write, in a folder that the caller writes atomically.
        cloud: What to write.
        compress: LAZ instead of LAS.

    Raises:
        InputError: A point or the class table has a class id above 191; then no file is written.
    """
    import laspy

    check_las_classes([row.id for row in cloud.classes])
    check_las_classes(np.unique(cloud.columns["segment"]).tolist())
    header = _header(cloud)
    backend = laspy.LazBackend.Lazrs if compress else None
    with (
        space_errors(path),
        laspy.open(
            path, mode="w", header=header, do_compress=compress, laz_backend=backend
        ) as writer,  # inside an atomic folder
    ):
        for first in range(0, len(cloud), _CHUNK):
            writer.write_points(_records(cloud, slice(first, first + _CHUNK), writer.header))


def check_las_classes(ids: Iterable[int]) -> None:
    """Refuse class ids that have no code of their own in LAS.

    Args:
        ids: Class ids of a table or of points; 255, for no class, has a code.

    Raises:
        InputError: One is above 191.
    """
    beyond = [number for number in ids if number > LAST_CLASS and number != UNLABELED]
    if beyond:
        raise InputError(
            "LAS has no code for a class",
            field="class id",
            value=min(beyond),
            allowed=f"0 to {LAST_CLASS}, and {UNLABELED} for no class",
            hint="Give the class a smaller id on the stage; a cloud that has it can be exported as ply or hdf5",
        )


def _header(cloud: Cloud) -> Any:
    import laspy
    from laspy.vlrs.known import ClassificationLookupVlr, WktCoordinateSystemVlr

    header = laspy.LasHeader(point_format=7, version="1.4")
    header.creation_date = _CREATED
    header.system_identifier = header.generating_software = "Falsework"
    header.global_encoding.wkt = True  # the standard requires it for this point format, even without a reference system
    coord = cloud.columns["coord"]
    low, high = (coord.min(axis=0), coord.max(axis=0)) if len(cloud) else (np.zeros(3), np.zeros(3))
    coarsest = float((high - low).max() + 1.0) / _COUNTS
    header.scales = np.full(3, max(LAZ_SCALE, 10.0 ** np.ceil(np.log10(coarsest))))
    header.offsets = np.floor(low)
    header.add_extra_dims(
        [laspy.ExtraBytesParams(name, cloud.columns[name].dtype, description) for name, description in EXTRA.items()]
    )
    table = ClassificationLookupVlr()
    for row in cloud.classes:
        if row.id != UNLABELED:
            # The standard has room for 15 ASCII characters; cloud.json has the whole name.
            table[FIRST_USER_CLASS + row.id] = row.name[:15].encode("ascii", "replace").decode("ascii")
    header.vlrs.append(table)
    if is_metric(cloud.alignment):
        header.vlrs.append(WktCoordinateSystemVlr(FRAME))
    return header


def _records(cloud: Cloud, part: slice, header: Any) -> Any:
    """Convert one part of the cloud to LAS records."""
    import laspy

    columns = {name: values[part] for name, values in cloud.columns.items()}
    record = laspy.ScaleAwarePointRecord.zeros(len(columns["coord"]), header=header)
    record["x"], record["y"], record["z"] = columns["coord"].T
    for name, values in zip(("red", "green", "blue"), columns["color"].T, strict=True):
        record[name] = values.astype(np.uint16) * 257
    segment = columns["segment"]
    record["classification"] = np.where(
        segment == UNLABELED, _UNCLASSIFIED, FIRST_USER_CLASS + segment.astype(np.uint16)
    )
    record["return_number"] = record["number_of_returns"] = np.ones(len(segment), np.uint8)
    if "intensity" in columns:
        record["intensity"] = np.rint(np.clip(columns["intensity"], 0.0, 1.0) * 65535).astype(np.uint16)
    if "station" in columns:
        record["point_source_id"] = columns["station"] + 1
    for name in EXTRA:
        record[name] = columns[name]
    return record
