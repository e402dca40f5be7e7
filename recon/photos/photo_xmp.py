"""Facts that drones write into the XMP packet of a photograph: gimbal angles and the accuracy of the position.

Source: Adobe XMP, part 1 (a property is an attribute or an element); DJI's name space `drone-dji`; the tags
`Camera:GPSXYAccuracy` and `Camera:GPSZAccuracy` that senseFly and Parrot write.
"""

import re
from dataclasses import dataclass

import numpy as np

SIGNATURE = b"http:"
"""Beginning of the JPEG segment of a packet: a name space, ended by a zero byte."""

_NUMBER = rb"[-+]?\d+(?:\.\d+)?(?:/\d+)?"
_FLAT, _WIDE = 1e-3, 1e5  # [m] a smaller or larger stated error is not credible


@dataclass(frozen=True)
class DroneFacts:
    """Facts from an XMP packet.

    Attributes:
        sigmas: Standard deviation of the position east, north and up as stated by the receiver [m], or None.
        up: Up direction in the camera's axes right, down, forward [1], from its gimbal, or None.
    """

    sigmas: tuple[float, float, float] | None = None
    up: tuple[float, float, float] | None = None


def read_xmp(packet: bytes) -> DroneFacts:
    """Read a packet; invalid values are treated as absent.

    Args:
        packet: The XMP packet; may be empty.
    """
    pitch, roll = (_number(packet, f"drone-dji:Gimbal{name}Degree") for name in ("Pitch", "Roll"))
    up = None if pitch is None else camera_up_of(pitch, roll or 0.0)
    return DroneFacts(_sigmas(packet), up)


def camera_up_of(pitch: float, roll: float) -> tuple[float, float, float]:
    """Convert the angles of a gimbal to the up direction.

    Args:
        pitch: Angle of the line of sight above the horizon; straight down is -90 [deg].
        roll: Angle of the picture about the line of sight, positive with its right side down [deg].

    Returns:
        Up in the camera's axes right, down, forward [1].
    """
    sin_pitch, cos_pitch = np.sin(np.radians(pitch)), np.cos(np.radians(pitch))
    sin_roll, cos_roll = np.sin(np.radians(roll)), np.cos(np.radians(roll))
    return float(-cos_pitch * sin_roll), float(-cos_pitch * cos_roll), float(sin_pitch)


def _sigmas(packet: bytes) -> tuple[float, float, float] | None:
    east, north, up = (_number(packet, f"drone-dji:RtkStd{name}") for name in ("Lon", "Lat", "Hgt"))
    if east is None or north is None or up is None:
        along, up = (_number(packet, f"Camera:GPS{name}Accuracy") for name in ("XY", "Z"))
        if along is None:
            return None
        east, north, up = along, along, 1.5 * along if up is None else up
    return (east, north, up) if min(east, north, up) > _FLAT and max(east, north, up) < _WIDE else None


def _number(packet: bytes, name: str) -> float | None:
    found = re.search(rb"\b" + name.encode() + rb"\s*(?:=\s*[\"']|>)\s*(" + _NUMBER + rb")\s*[\"'<]", packet)
    if found is None:
        return None
    top, _, bottom = found.group(1).partition(b"/")
    if bottom and not float(bottom):
        return None
    value = float(top) / float(bottom or 1)
    return value if np.isfinite(value) else None  # hundreds of digits
