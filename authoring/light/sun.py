"""The sun: its position at a date and place, and its light after extinction by the air."""

from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of linear sRGB

_ABOVE_THE_AIR = 128.0  # [klx] on a surface that faces the sun
_WAVES = np.array([0.610, 0.550, 0.465])  # [um] that represent red, green and blue
_OZONE = np.array([0.120, 0.085, 0.010])  # absorption at these wavelengths [1/cm]
_OZONE_DEPTH = 0.35  # [cm]


def sun_position(date: datetime, latitude: float, longitude: float) -> tuple[float, float]:
    """Compute the position of the sun to a few hundredths of a degree, without refraction.

    Source: Meeus, Astronomical algorithms, 2nd edition, chapters 12, 13 and 25 (low accuracy), which the solar
    calculator of NOAA's Global Monitoring Laboratory follows too.

    Args:
        date: Date and hour; without an offset it is Universal Time.
        latitude: Latitude, north positive [deg].
        longitude: Longitude, east positive [deg].

    Returns:
        Height above the horizon [deg] and azimuth clockwise from north [deg].
    """
    moment = date.replace(tzinfo=UTC) if date.tzinfo is None else date.astimezone(UTC)
    days = (moment - datetime(2000, 1, 1, 12, tzinfo=UTC)).total_seconds() / 86_400
    centuries = days / 36_525
    mean_longitude = 280.46646 + 36_000.76983 * centuries
    anomaly = np.radians(357.52911 + 35_999.05029 * centuries)
    center = (1.914602 - 0.004817 * centuries) * np.sin(anomaly)
    center += (0.019993 - 0.000101 * centuries) * np.sin(2 * anomaly) + 0.000289 * np.sin(3 * anomaly)
    ecliptic = np.radians(mean_longitude + center - 0.00569)
    obliquity = np.radians(23.439291 - 0.0130042 * centuries)
    ascension = np.arctan2(np.cos(obliquity) * np.sin(ecliptic), np.cos(ecliptic))
    declination = np.arcsin(np.sin(obliquity) * np.sin(ecliptic))
    hour = np.radians(280.46061837 + 360.98564736629 * days + longitude) - ascension
    north = np.radians(latitude)
    height = np.arcsin(np.sin(north) * np.sin(declination) + np.cos(north) * np.cos(declination) * np.cos(hour))
    across = -np.cos(declination) * np.sin(hour)
    along = np.sin(declination) * np.cos(north) - np.cos(declination) * np.sin(north) * np.cos(hour)
    return float(np.degrees(height)), float(np.degrees(np.arctan2(across, along)) % 360)


def direction(height: float, azimuth: float) -> F64:
    """Convert a height and an azimuth to a direction.

    Args:
        height: Height above the horizon [deg].
        azimuth: Azimuth, clockwise from north [deg].

    Returns:
        Unit vector towards it, x east, y north, z up [1], shape (3,), float64.
    """
    level = np.cos(np.radians(height))
    return np.array(
        [level * np.sin(np.radians(azimuth)), level * np.cos(np.radians(azimuth)), np.sin(np.radians(height))]
    )


def air_mass(height: float) -> float:
    """Compute the relative air mass of the sun's light.

    Source: Kasten and Young, Revised optical air mass tables and approximation formula, Applied Optics 28, 1989.

    Args:
        height: Height above the horizon [deg]; below it counts as on it.

    Returns:
        Length of the path through the air, as a multiple of that from overhead [1].
    """
    over = max(height, 0.0)
    return float(1 / (np.sin(np.radians(over)) + 0.50572 * (over + 6.07995) ** -1.6364))


def sun_illuminance(height: float, turbidity: float) -> F64:
    """Find the sun's light on a surface that faces it, after air, haze and ozone.

    Source: Preetham, Shirley and Smits, A practical analytic model for daylight, SIGGRAPH 1999, appendix A.1 (Rayleigh,
    Angstrom haze with exponent 1.3, ozone; water vapor and mixed gases hardly affect visible light).

    Args:
        height: Height above the horizon [deg].
        turbidity: Linke's turbidity [1].

    Returns:
        Linear sRGB [klx], shape (3,), float64.
    """
    mass = air_mass(height)
    haze = 0.04608 * turbidity - 0.04586
    depth = 0.008735 * _WAVES**-4.08 + haze * _WAVES**-1.3 + _OZONE * _OZONE_DEPTH
    return _ABOVE_THE_AIR * np.exp(-depth * mass)
