"""Conversion of surveyed coordinates to meters east, north and up of an origin."""

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from groundwork.length_units import METERS
from recon.photos.photos import local_position
from recon.placing.wkt_unit import is_wkt, unit_of_wkt

F64 = NDArray[np.float64]

_A, _F, _K0 = 6_378_137.0, 1.0 / 298.257223563, 0.9996  # WGS 84; scale of UTM on its central meridian
_GEOGRAPHIC = frozenset(  # EPSG codes of longitude and latitude, all within two meters of WGS 84
    (4326, 4979, 4258, 4937, 4269, 4152, 6318, 6319, 4617, 4674, 4283, 7844, 7843, 4167, 4619, 4612, 6668, 4490, 4171)
)
_ANGLES = re.compile(r"\+proj=(longlat|latlong)\b")
_EAST, _SOUTH = 500_000.0, 10_000_000.0  # [m] false easting, and false northing south of the equator


@dataclass(frozen=True)
class MapSystem:
    """A coordinate system.

    Attributes:
        name: As in the file.
        zone: UTM zone on WGS 84, negative south of the equator; 0 for longitude and latitude [deg]; None for any other
            plane system, whose own axes are then east, north and up.
        unit: Length of one unit of the horizontal coordinates [m]; of no use for longitude and latitude.
        up_unit: Length of one unit of the heights [m].
        assumed: Whether the text states no unit, so that meters are assumed.
    """

    name: str
    zone: int | None
    unit: float = 1.0
    up_unit: float = 1.0
    assumed: bool = False

    def geographic(self, points: F64) -> F64:
        """Convert coordinates to latitude, longitude and height; not defined for a plane system.

        Args:
            points: Coordinates as in the file, [deg] or [m], shape (N, 3), float64.

        Returns:
            Latitude [deg], longitude [deg] and height [m], array of shape (N, 3), float64.
        """
        up = points[:, 2] * self.up_unit
        if not self.zone:
            return np.column_stack([points[:, 1], points[:, 0], up])
        return np.column_stack([*_from_utm(points[:, 0] * self.unit, points[:, 1] * self.unit, self.zone), up])

    def local(self, points: F64, origin: tuple[float, float, float]) -> F64:
        """Convert coordinates to meters east, north and up of an origin.

        Args:
            points: Coordinates as in the file, [deg] or [m], shape (N, 3), float64.
            origin: Latitude [deg], longitude [deg], height [m]; of a plane system, a point in its own coordinates.

        Returns:
            Positions [m], shape (N, 3), float64.
        """
        if self.zone is None:
            return (points - np.array(origin)) * np.array([self.unit, self.unit, self.up_unit])
        places = self.geographic(points)
        return np.array([local_position((lat, lon, up), origin) for lat, lon, up in places.tolist()]).reshape(-1, 3)


def read_system(text: str) -> MapSystem | None:
    """Read the name of a system: an EPSG code, a PROJ string, `WGS84 UTM 32N`, well-known text.

    Args:
        text: The name.

    Returns:
        The system; None where the text names none.
    """
    plain = " ".join(text.replace('"', " ").replace("_", " ").split())
    code = None if is_wkt(text) else re.search(r"\bEPSG[\s:,]*(\d{4,6})\b", plain, re.IGNORECASE)
    number = int(code.group(1)) if code else 0
    if 32601 <= number <= 32660 or 32701 <= number <= 32760:
        return MapSystem(text, number % 100 if number < 32700 else -(number % 100))
    stated = _stated_unit(text)
    unit, up_unit = stated or (1.0, 1.0)
    unknown = ("+units=" in text or "+to_meter=" in text) and stated is None
    utm = re.search(r"\bUTM(?: zone)?\s*=?\s*(\d{1,2})\s*([NS])?\b", plain, re.IGNORECASE)
    wgs = re.search(r"WGS ?(19)?84", plain, re.IGNORECASE) is not None
    if "+proj=utm" in plain and (zone := re.search(r"\+zone=(\d{1,2})", plain)):
        number = -int(zone.group(1)) if "+south" in plain else int(zone.group(1))
        return MapSystem(text, number if wgs else None, unit, up_unit, assumed=unknown)
    if utm and wgs and 1 <= int(utm.group(1)) <= 60:
        number = -int(utm.group(1)) if (utm.group(2) or "N").upper() == "S" else int(utm.group(1))
        return MapSystem(text, number, unit, up_unit)
    if unit == 0.0 or number in _GEOGRAPHIC:
        return MapSystem(text, 0, up_unit=up_unit)
    if code or "+proj=" in plain or re.match(r"(PROJ(CS|CRS)|COMPD ?CS|COMPOUNDCRS)\b", plain, re.IGNORECASE):
        silent = "+proj=" in plain and not unknown  # PROJ's own default is meters
        return MapSystem(text, None, unit, up_unit, assumed=stated is None and not silent)
    if re.match(r"(LOCAL ?CS|LOCAL|NONE)\b", plain, re.IGNORECASE):
        return MapSystem(text, None, unit, up_unit)
    return MapSystem(text, 0) if plain.upper() in ("WGS84", "WGS 84") else None


def _stated_unit(text: str) -> tuple[float, float] | None:
    """Find the units of horizontal coordinates and of heights [m] in a PROJ string or in well-known text.

    Heights of which nothing is said have the unit of the others, and of longitude and latitude meters.
    """
    if is_wkt(text):
        unit = unit_of_wkt(text)
        form = r"\bVERT(?:_CS|CRS)\s*\[.*?\b(?:LENGTH)?UNIT\s*\[\s*\"[^\"]*\"\s*,\s*([^],\s]+)"
        vertical = re.search(form, text[:100_000], re.S)
        up = _length(vertical.group(1)) if vertical else None
        return None if unit is None or not 0.0 <= unit < np.inf else (unit, up or unit or 1.0)
    lengths = []
    for factor, name in (("to_meter", "units"), ("vto_meter", "vunits")):
        number, unit = re.search(rf"\+{factor}=(\S+)", text), re.search(rf"\+{name}=(\S+)", text)
        lengths.append(_length(number.group(1)) if number else METERS.get(unit.group(1)) if unit else None)
    horizontal, up = lengths
    if _ANGLES.search(text):
        return 0.0, up or 1.0
    return None if horizontal is None else (horizontal, up or horizontal)


def _length(text: str) -> float | None:
    """Read the length of a unit [m], maybe a fraction as PROJ allows; None if it is none."""
    top, _, bottom = text.partition("/")
    try:
        value = float(top) / float(bottom or "1")
    except (ValueError, ZeroDivisionError):
        return None
    return value if 0.0 < value < np.inf else None


def _from_utm(easting: F64, northing: F64, zone: int) -> tuple[F64, F64]:
    """Convert UTM coordinates to latitude and longitude [deg], to well below a millimeter.

    Source: the series of Krüger (1912) in the third flattening, as in Karney, Transverse Mercator with an accuracy of a
    few nanometers (2011), to the third order.
    """
    n = _F / (2.0 - _F)
    radius = _A / (1.0 + n) * (1.0 + n**2 / 4.0 + n**4 / 64.0)
    up = (northing - (_SOUTH if zone < 0 else 0.0)) / (_K0 * radius)
    aside = (easting - _EAST) / (_K0 * radius)
    xi, eta = up.copy(), aside.copy()
    betas = (n / 2 - 2 * n**2 / 3 + 37 * n**3 / 96, n**2 / 48 + n**3 / 15, 17 * n**3 / 480)
    for order, beta in enumerate(betas, 1):
        xi -= beta * np.sin(2 * order * up) * np.cosh(2 * order * aside)
        eta -= beta * np.cos(2 * order * up) * np.sinh(2 * order * aside)
    conformal = np.arcsin(np.sin(xi) / np.cosh(eta))
    latitude = conformal.copy()
    deltas = (2 * n - 2 * n**2 / 3 - 2 * n**3, 7 * n**2 / 3 - 8 * n**3 / 5, 56 * n**3 / 15)
    for order, delta in enumerate(deltas, 1):
        latitude += delta * np.sin(2 * order * conformal)
    longitude = np.arctan2(np.sinh(eta), np.cos(xi))
    return np.degrees(latitude), np.degrees(longitude) + 6.0 * abs(zone) - 183.0
