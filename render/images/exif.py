"""EXIF for simulated photographs: the data that a reconstruction reads, without data about this computer.

Our own: what Pillow writes depends on its version, and photographs have the same bytes on every machine; and it is not
one of the core packages.

Source: CIPA DC-008 (Exif 2.32), TIFF 6.0 structure in an APP1 segment.
"""

import struct
from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np

MAKE = MODEL = "Falsework"
_EPOCH = datetime(2024, 6, 21, 12, 0, 0)  # every capture was taken at this moment, plus its capture times
_EARTH_A, _EARTH_E2 = 6_378_137.0, 6.694_379_990_14e-3  # WGS 84
_ASCII, _BYTE, _SHORT, _LONG, _RATIONAL = 2, 1, 3, 4, 5
_LARGEST_SHORT, _LARGEST_LONG = 0xFFFF, 0xFFFFFFFF
_MOST_LETTERS = 200  # of a text: all must fit into a segment of 64 kB
_LONGEST = 100 * 365 * 86_400.0  # [s] a survey of 100 years
_SIZES = {_BYTE: "B", _SHORT: "H", _LONG: "I", _RATIONAL: "II"}

Entry = tuple[int, int, bytes, int]


@dataclass(frozen=True)
class Shot:
    """Data that the camera records with a photograph.

    Attributes:
        focal_length: Focal length as the maker states it [m].
        sensor_width: Width of the sensor [m].
        exposure_time: Exposure time [s].
        seconds: Seconds since the first image [s].
        gps: Measured east, north, up from `origin` [m], or None.
        origin: Latitude [deg], longitude [deg] and height [m] of the local frame's zero.
        make: Maker of the camera; empty if unknown.
        model: Name of the camera; empty if unknown.
    """

    focal_length: float
    sensor_width: float
    exposure_time: float
    seconds: float
    gps: tuple[float, float, float] | None
    origin: tuple[float, float, float]
    make: str = ""
    model: str = ""


def insert_exif(jpeg: bytes, shot: Shot, width: int, height: int) -> bytes:
    """Put EXIF into a JPEG file, in the place of its JFIF header.

    Args:
        jpeg: A JPEG file.
        shot: Data to write.
        width: Image width [px].
        height: Image height [px].

    Returns:
        The JPEG file with EXIF.
    """
    start = 2
    if jpeg[2:4] == b"\xff\xe0":  # APP0 and APP1 both have to be first
        start += 2 + struct.unpack(">H", jpeg[4:6])[0]
    body = b"Exif\x00\x00" + _tiff(shot, width, height)
    return jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(body) + 2) + body + jpeg[start:]


def geodetic(gps: tuple[float, float, float], origin: tuple[float, float, float]) -> tuple[float, float, float]:
    """Convert a local east, north, up position to latitude, longitude and height, with the curvature at the origin.

    Args:
        gps: East, north, up [m].
        origin: Latitude [deg], longitude [deg] and height [m] of the local zero.

    Returns:
        Latitude [deg], longitude [deg], height [m].
    """
    latitude = np.deg2rad(origin[0])
    bend = 1 - _EARTH_E2 * np.sin(latitude) ** 2
    north = _EARTH_A * (1 - _EARTH_E2) / bend**1.5 + origin[2]
    east = (_EARTH_A / np.sqrt(bend) + origin[2]) * np.cos(latitude)
    longitude = float(origin[1] + np.rad2deg(gps[0] / east))
    if abs(longitude) > 180.0:  # beyond the date line
        longitude = (longitude + 180.0) % 360.0 - 180.0
    return float(origin[0] + np.rad2deg(gps[1] / north)), longitude, origin[2] + gps[2]


def _tiff(shot: Shot, width: int, height: int) -> bytes:
    moment = (_EPOCH + timedelta(seconds=round(_within(shot.seconds, _LONGEST)))).strftime("%Y:%m:%d %H:%M:%S")
    ratio = shot.focal_length / shot.sensor_width if shot.sensor_width > 0.0 else 0.0
    equivalent = round(_within(ratio * 36.0, _LARGEST_SHORT))
    root = [
        _text(0x010F, shot.make or MAKE),
        _text(0x0110, shot.model or MODEL),
        _numbers(0x0112, _SHORT, 1),
        _text(0x0131, "Falsework"),
        _text(0x0132, moment),
    ]
    photo = [
        _rational(0x829A, shot.exposure_time, 1_000_000),
        _rational(0x829D, 2.8, 10),
        _numbers(0x8827, _SHORT, 100),
        (0x9000, 7, b"0232", 4),
        _text(0x9003, moment),
        _rational(0x920A, shot.focal_length * 1e3, 1_000_000),
        _numbers(0xA001, _SHORT, 1),
        _numbers(0xA002, _LONG, width),
        _numbers(0xA003, _LONG, height),
        _numbers(0xA405, _SHORT, equivalent),
    ]
    place = _gps_entries(shot) if shot.gps is not None and np.isfinite([*shot.gps, *shot.origin]).all() else []
    links = [(0x8769, photo)] + ([(0x8825, place)] if place else [])
    offset = 8 + _directory_size([*root, *(_numbers(tag, _LONG, 0) for tag, _ in links)])
    pointers, tail = [], b""
    for tag, entries in links:
        pointers.append(_numbers(tag, _LONG, offset + len(tail)))
        tail += _directory(entries, offset + len(tail))
    return b"II*\x00" + struct.pack("<I", 8) + _directory([*root, *pointers], 8) + tail


def _gps_entries(shot: Shot) -> list[Entry]:
    assert shot.gps is not None
    latitude, longitude, height = geodetic(shot.gps, shot.origin)
    return [
        (0x0000, _BYTE, bytes([2, 3, 0, 0]), 4),
        _text(0x0001, "N" if latitude >= 0 else "S"),
        _degrees(0x0002, latitude, 90.0),
        _text(0x0003, "E" if longitude >= 0 else "W"),
        _degrees(0x0004, longitude, 180.0),
        (0x0005, _BYTE, bytes([int(height < 0)]), 1),
        _rational(0x0006, abs(height), 1000),
    ]


def _within(value: float, most: float) -> float:
    """Clip a number to the range of its EXIF field, so that no value prevents writing a photograph."""
    return min(max(value, 0.0), most) if np.isfinite(value) else 0.0


def _degrees(tag: int, value: float, most: float) -> Entry:
    ticks = round(_within(abs(value), most) * 3600 * 1_000_000)  # a millionth of a second is 0.03 mm
    degrees, rest = divmod(ticks, 3600 * 1_000_000)
    minutes, seconds = divmod(rest, 60 * 1_000_000)
    return tag, _RATIONAL, struct.pack("<6I", degrees, 1, minutes, 1, seconds, 1_000_000), 3


def _rational(tag: int, value: float, denominator: int) -> Entry:
    value = _within(value, _LARGEST_LONG)
    while denominator > 1 and round(value * denominator) > _LARGEST_LONG:
        denominator //= 10  # a focal length of meters has no room for micrometers
    return tag, _RATIONAL, struct.pack("<II", round(value * denominator), max(denominator, 1)), 1


def _numbers(tag: int, kind: int, value: int) -> Entry:
    return tag, kind, struct.pack(f"<{_SIZES[kind]}", value), 1


def _text(tag: int, value: str) -> Entry:
    data = value[:_MOST_LETTERS].encode("ascii", "replace") + b"\x00"
    return tag, _ASCII, data, len(data)


def _directory_size(entries: list[Entry]) -> int:
    return 6 + 12 * len(entries) + sum(_padded(len(data)) for _, _, data, _ in entries if len(data) > 4)


def _directory(entries: list[Entry], offset: int) -> bytes:
    values = offset + 6 + 12 * len(entries)
    head, tail = struct.pack("<H", len(entries)), b""
    for tag, kind, data, count in sorted(entries):
        head += struct.pack("<HHI", tag, kind, count)
        if len(data) <= 4:
            head += data.ljust(4, b"\x00")
        else:
            head += struct.pack("<I", values + len(tail))
            tail += data.ljust(_padded(len(data)), b"\x00")
    return head + struct.pack("<I", 0) + tail


def _padded(length: int) -> int:
    return length + length % 2
