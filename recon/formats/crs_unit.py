"""The unit of a LAS file's coordinates, from its coordinate reference system.

Source: ASPRS LAS 1.4 R15 (records 2112 and 34735); GeoTIFF 1.0 (key 3076).
"""

import struct
from collections.abc import Mapping

from groundwork.length_units import METERS
from recon.placing.wkt_unit import unit_of_wkt

_GEOKEY_UNITS = {9001: METERS["m"], 9002: METERS["ft"], 9003: METERS["us-ft"]}
_MODEL_KEY, _UNIT_KEY, _GEOGRAPHIC = 1024, 3076, 2


def meters_per_unit(records: Mapping[tuple[str, int], bytes]) -> float | None:
    """Find the length of one unit of the horizontal coordinates.

    Args:
        records: Variable-length records by user and number.

    Returns:
        Length [m]; None if the file does not state it; 0 where its coordinates are angles.
    """
    text = records.get(("LASF_Projection", 2112), b"").split(b"\0")[0].decode("utf-8", "replace")
    if text.strip():
        return unit_of_wkt(text)
    return _of_geokeys(records.get(("LASF_Projection", 34735), b""))


def _of_geokeys(data: bytes) -> float | None:
    if len(data) < 8:
        return None
    count = struct.unpack_from("<4H", data)[3]
    keys = {}
    for row in range(min(count, len(data) // 8 - 1)):
        key, place, _, value = struct.unpack_from("<4H", data, 8 + 8 * row)
        if place == 0:
            keys[key] = value
    if keys.get(_MODEL_KEY) == _GEOGRAPHIC:
        return 0.0
    return _GEOKEY_UNITS.get(keys.get(_UNIT_KEY, 0))
