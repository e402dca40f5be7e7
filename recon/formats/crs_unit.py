"""The unit of a LAS file's coordinates, from its coordinate reference system.

Source: ASPRS LAS 1.4 R15 (records 2112 and 34735); OGC 01-009 and 18-010 (WKT); GeoTIFF 1.0 (key 3076).
"""

import re
import struct
from collections.abc import Mapping

FOOT, US_FOOT = 0.3048, 1200.0 / 3937.0  # [m]
_GEOKEY_UNITS = {9001: 1.0, 9002: FOOT, 9003: US_FOOT}
_MODEL_KEY, _UNIT_KEY, _GEOGRAPHIC = 1024, 3076, 2
_TOKEN = re.compile(r'"[^"]*"|[A-Za-z_]\w*\s*[\[(]|[\])]|[-+\d.][-+\d.eE]*|,')
_LINEAR = ("UNIT", "LENGTHUNIT")
_PROJECTED = ("PROJCS", "PROJCRS", "PROJECTEDCRS", "LOCAL_CS", "ENGCRS")
_GEOGRAPHIC_ROOTS = ("GEOGCS", "GEOGCRS", "GEODCRS", "GEODETICCRS")


def meters_per_unit(records: Mapping[tuple[str, int], bytes]) -> float | None:
    """Find the length of one unit of the horizontal coordinates.

    Args:
        records: Variable-length records by user and number.

    Returns:
        Length [m]; None if the file does not state it; 0 where its coordinates are angles.
    """
    text = records.get(("LASF_Projection", 2112), b"").split(b"\0")[0].decode("utf-8", "replace")
    if text.strip():
        return _of_wkt(text)
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


def _of_wkt(text: str) -> float | None:
    """Find the unit stated directly in the projected system, or in its axes."""
    open_words: list[str] = []
    geographic = False
    wanted = False
    for token in _TOKEN.findall(text[:100_000]):
        if token[-1] in "[(" and token[0] != '"':
            word = token[:-1].strip().upper()
            above = [name for name in open_words if name != "AXIS"]
            wanted = word in _LINEAR and bool(above) and above[-1] in _PROJECTED
            geographic |= not open_words and word in _GEOGRAPHIC_ROOTS
            open_words.append(word)
        elif token in ("]", ")"):
            if open_words:
                open_words.pop()
            wanted = False
        elif wanted and token[0] not in '",':
            try:
                return float(token)
            except ValueError:
                return None
    return 0.0 if geographic else None
