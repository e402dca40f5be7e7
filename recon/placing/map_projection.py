"""Conversion of surveyed coordinates to metres east, north and up of an origin."""

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recon.photos.photos import local_position

F64 = NDArray[np.float64]

_A, _F, _K0 = 6_378_137.0, 1.0 / 298.257223563, 0.9996  # WGS 84; scale of UTM on its central meridian
_EAST, _SOUTH = 500_000.0, 10_000_000.0  # [m] false easting, and false northing south of the equator


@dataclass(frozen=True)
class MapSystem:
    """A coordinate system.

    Attributes:
        name: As in the file.
        zone: UTM zone on WGS 84, negative south of the equator; 0 for longitude and latitude [deg]; None for any other
            plane system in metres, whose own axes are then east, north and up.
    """

    name: str
    zone: int | None

    def geographic(self, points: F64) -> F64:
        """Convert coordinates to latitude, longitude and height; not defined for a plane system.

        Args:
            points: Coordinates as in the file, [deg] or [m], shape (N, 3), float64.

        Returns:
            Latitude [deg], longitude [deg] and height [m], array of shape (N, 3), float64.
        """
        if not self.zone:
            return points[:, [1, 0, 2]]
        return np.column_stack([*_from_utm(points[:, 0], points[:, 1], self.zone), points[:, 2]])

    def local(self, points: F64, origin: tuple[float, float, float]) -> F64:
        """Convert coordinates to metres east, north and up of an origin.

        Args:
            points: Coordinates as in the file, [deg] or [m], shape (N, 3), float64.
            origin: Latitude [deg], longitude [deg], height [m]; of a plane system, a point in its own coordinates.

        Returns:
            Positions [m], shape (N, 3), float64.
        """
        if self.zone is None:
            return points - np.array(origin)
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
    code = re.search(r"\bEPSG:?\s*(?:[,:]\s*)?(\d{4,6})\b", plain, re.IGNORECASE)
    number = int(code.group(1)) if code else 0
    if 32601 <= number <= 32660 or 32701 <= number <= 32760:
        return MapSystem(text, number % 100 if number < 32700 else -(number % 100))
    utm = re.search(r"\bUTM(?: zone)?\s*=?\s*(\d{1,2})\s*([NS])?\b", plain, re.IGNORECASE)
    wgs = re.search(r"WGS ?(19)?84", plain, re.IGNORECASE) is not None
    if "+proj=utm" in plain and (zone := re.search(r"\+zone=(\d{1,2})", plain)):
        south = "+south" in plain
        return MapSystem(text, -int(zone.group(1)) if south else int(zone.group(1))) if wgs else MapSystem(text, None)
    if utm and wgs and 1 <= int(utm.group(1)) <= 60:
        return MapSystem(text, -int(utm.group(1)) if (utm.group(2) or "N").upper() == "S" else int(utm.group(1)))
    if number == 4326 or "+proj=longlat" in plain or "+proj=latlong" in plain or plain.upper().startswith("GEOGCS"):
        return MapSystem(text, 0)
    if code or "+proj=" in plain or re.match(r"(PROJCS|LOCAL ?CS|LOCAL|NONE)\b", plain, re.IGNORECASE):
        return MapSystem(text, None)
    return MapSystem(text, 0) if plain.upper() in ("WGS84", "WGS 84") else None


def _from_utm(easting: F64, northing: F64, zone: int) -> tuple[F64, F64]:
    """Convert UTM coordinates to latitude and longitude [deg], to well below a millimetre.

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
