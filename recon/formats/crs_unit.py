"""The unit of a LAS file's coordinates, from its coordinate reference system.

Source: ASPRS LAS 1.4 R15 (records 2112 and 34735); GeoTIFF 1.0 (keys 3076 and 4099).
"""

import re
import struct
from collections.abc import Mapping

from groundwork.length_units import METERS
from recon.placing.wkt_unit import unit_of_wkt

_GEOKEY_UNITS = {9001: METERS["m"], 9002: METERS["ft"], 9003: METERS["us-ft"]}
_MODEL_KEY, _UNIT_KEY, _HEIGHT_KEY, _GEOGRAPHIC = 1024, 3076, 4099, 2
_WKT, _GEOKEYS = ("LASF_Projection", 2112), ("LASF_Projection", 34735)
_VERTICAL = re.compile(r"\bVERT(_?CS|CRS|ICALCRS)\s*[\[(]", re.IGNORECASE)


def meters_per_unit(records: Mapping[tuple[str, int], bytes]) -> float | None:
    """Find the length of one unit of the horizontal coordinates.

    Args:
        records: Variable-length records by user and number.

    Returns:
        Length [m]; None if the file does not state it; 0 where its coordinates are angles.
    """
    text = records.get(_WKT, b"").split(b"\0")[0].decode("utf-8", "replace")
    if text.strip():
        return unit_of_wkt(text)
    keys = _geokeys(records.get(_GEOKEYS, b""))
    return 0.0 if keys.get(_MODEL_KEY) == _GEOGRAPHIC else _GEOKEY_UNITS.get(keys.get(_UNIT_KEY, 0))


def meters_per_height_unit(records: Mapping[tuple[str, int], bytes]) -> float | None:
    """Find the length of one unit of the heights.

    Args:
        records: Variable-length records by user and number.

    Returns:
        Length [m]; None if the file does not state one for heights alone.
    """
    text = records.get(_WKT, b"").split(b"\0")[0].decode("utf-8", "replace")
    if text.strip():
        found = _VERTICAL.search(text)
        return None if found is None else unit_of_wkt("LOCAL_CS" + text[found.end() - 1 :])
    return _GEOKEY_UNITS.get(_geokeys(records.get(_GEOKEYS, b"")).get(_HEIGHT_KEY, 0))


def _geokeys(data: bytes) -> dict[int, int]:
    """Read the keys whose values are whole numbers."""
    if len(data) < 8:
        return {}
    count = struct.unpack_from("<4H", data)[3]
    rows = (struct.unpack_from("<4H", data, 8 + 8 * row) for row in range(min(count, len(data) // 8 - 1)))
    return {key: value for key, place, _, value in rows if place == 0}
