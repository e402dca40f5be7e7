"""What drones write into XMP: angles of the gimbal become up, accuracies become weights; the rest is left alone."""

import struct
from pathlib import Path

import numpy as np
import pytest

from recon.photos.photo_xmp import camera_up_of, read_xmp
from recon.photos.photos import open_photographs
from recon.placing.place import Registered, place
from recon.settings import AlignmentSettings
from render.images.exif import geodetic
from tests.recon.test_photos import jpeg, tagged, with_exif
from usd_schemas.pinhole import look_at

SPACE = b"http:xap/1.0/\x00"
PACKET = (
    '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:Description drone-dji:GimbalRollDegree="{roll}"\n'
    ' drone-dji:GimbalPitchDegree="{pitch}" drone-dji:RtkFlag="50" drone-dji:RtkStdLon="0.011"\n'
    ' drone-dji:RtkStdLat="0.012" drone-dji:RtkStdHgt="0.025"/></x:xmpmeta>'
)


def with_xmp(data: bytes, packet: str) -> bytes:
    """Put an XMP packet into a JPEG behind its first segment."""
    end = 4 + struct.unpack(">H", data[4:6])[0]
    segment = SPACE + packet.encode()
    return data[:end] + b"\xff\xe1" + struct.pack(">H", len(segment) + 2) + segment + data[end:]


@pytest.mark.parametrize(
    ("look", "pitch"), [((0, 1, 0), 0.0), ((0, 1, -1), -45.0), ((3, 4, -5), -45.0), ((0, 5, 1), 11.31)]
)
def test_up_of_a_gimbal_is_up(look: tuple[float, ...], pitch: float) -> None:
    """Carried into the world by the camera's own rotation, up of a gimbal at its pitch is up; rolled, it still is."""
    rotation = look_at(np.zeros(3), np.array(look, np.float64))[:3, :3]
    np.testing.assert_allclose(rotation @ camera_up_of(pitch, 0.0), [0.0, 0.0, 1.0], atol=1e-4)
    roll = np.radians(7.0)  # its right side down: the camera's own axes turn clockwise about the line of sight
    right, down = rotation[:, 0], rotation[:, 1]
    rolled = np.column_stack(
        [np.cos(roll) * right + np.sin(roll) * down, np.cos(roll) * down - np.sin(roll) * right, rotation[:, 2]]
    )
    np.testing.assert_allclose(rolled @ camera_up_of(pitch, 7.0), [0.0, 0.0, 1.0], atol=1e-4)
    np.testing.assert_allclose(camera_up_of(-90.0, 0.0), [0.0, 0.0, -1.0], atol=1e-12)


def test_packets_as_drones_write_them() -> None:
    """Attributes, elements, signs and fractions; what is absent, empty or nonsense is not said."""
    told = read_xmp(PACKET.format(roll="+0.00", pitch="-45.00").encode())
    assert told.sigmas == (0.011, 0.012, 0.025)
    assert told.up == pytest.approx(camera_up_of(-45.0, 0.0))
    other = read_xmp(b"<Camera:GPSXYAccuracy>3/2</Camera:GPSXYAccuracy><Camera:GPSZAccuracy>4.5</Camera:GPSZAccuracy>")
    assert (other.sigmas, other.up) == ((1.5, 1.5, 4.5), None)
    for packet in (
        b"",
        b"\xff\x00",
        b'drone-dji:GimbalPitchDegree=""',
        b'drone-dji:GimbalPitchDegree="up"',
        b'drone-dji:RtkStdLon="0.0" drone-dji:RtkStdLat="0.0" drone-dji:RtkStdHgt="0.0"',
        b"<Camera:GPSXYAccuracy>1/0</Camera:GPSXYAccuracy>",
        b'drone-dji:GimbalPitchDegree="inf" drone-dji:GimbalRollDegree="NaN"',
        b'drone-dji:GimbalPitchDegree="' + b"9" * 400 + b'"',  # infinite as a float
        b"<Camera:GPSXYAccuracy>" + b"9" * 400 + b"/" + b"9" * 400 + b"</Camera:GPSXYAccuracy>",
        b"<Camera:GPSXYAccuracy>" + b"9" * 200 + b"</Camera:GPSXYAccuracy>",
    ):
        assert read_xmp(packet).sigmas is None
        assert read_xmp(packet).up is None


def exif_of(place: tuple[float, float, float], error: float) -> bytes:
    """Write EXIF of a place in degrees north and east and meters, with the receiver's error along the ground [m]."""
    entries: list[tuple[int, int, bytes, int]] = [(1, 2, b"N\x00", 2), (3, 2, b"E\x00", 2)]
    for tag, angle in ((2, place[0]), (4, place[1])):
        entries.append((tag, 5, struct.pack(">6I", int(angle), 1, 0, 1, round((angle % 1.0) * 3.6e9), 1_000_000), 3))
    entries += [(6, 5, struct.pack(">2I", round(place[2] * 1e4), 10_000), 1)]
    entries += [(0x1F, 5, struct.pack(">2I", round(error * 1e4), 10_000), 1)]
    rows, tail, at = b"", b"", 26 + 2 + 12 * len(entries) + 4
    for tag, kind, value, count in sorted(entries):
        rows += struct.pack(">HHI", tag, kind, count)
        rows += value.ljust(4, b"\x00") if len(value) <= 4 else struct.pack(">I", at + len(tail))
        tail += value if len(value) > 4 else b""
    root = struct.pack(">HHHIII", 1, 0x8825, 4, 1, 26, 0)
    return b"MM\x00*" + struct.pack(">I", 8) + root + struct.pack(">H", len(entries)) + rows + bytes(4) + tail


def test_errors_in_exif_weigh_as_they_are(tmp_path: Path) -> None:
    """Without XMP, EXIF's own error of the place counts: centimeters place to centimeters, meters only to meters."""
    rng = np.random.default_rng(0)
    eyes = np.column_stack([rng.uniform(0, 60, 12), rng.uniform(0, 40, 12), rng.uniform(30, 45, 12)])
    poses = np.stack([look_at(eye, eye + np.array([0.0, 1.0, -1.0])) for eye in eyes])
    model = poses.copy()
    model[:, :3, 3] /= 7.0
    places = []
    for error in (0.02, 2.0):
        folder = tmp_path / f"{error}"
        folder.mkdir()
        for row, eye in enumerate(eyes):
            east, north, up = eye + np.random.default_rng(row).normal(0, [error, error, 1.5 * error])
            fix = geodetic((east, north, up), (46.2, 7.5, 400.0))
            (folder / f"{row:02d}.jpg").write_bytes(with_exif(jpeg(), exif_of(fix, error)))
        capture = open_photographs(folder)
        assert capture.gps_sigma == pytest.approx((error, error, 1.5 * error))
        found, _ = place(Registered(model, np.arange(12)), capture, None, AlignmentSettings(), rng)
        assert found.errors is not None
        assert abs(found.similarity.scale / 7.0 - 1.0) * 100 < found.errors.scale
        places.append(found.errors.place)
    assert places[0] < 0.15
    assert 3.0 < places[1] < 15.0
    told = read_header_with_both(tmp_path)
    assert told == (0.011, 0.012, 0.025)


def read_header_with_both(folder: Path) -> tuple[float, float, float]:
    """Photograph with both: what XMP says by direction goes before EXIF's one number."""
    file = folder / "both" / "a.jpg"
    file.parent.mkdir()
    data = with_xmp(jpeg(), PACKET.format(roll="0.00", pitch="-45.00"))
    file.write_bytes(with_exif(data, exif_of((46.2, 7.5, 400.0), 0.5)))
    return open_photographs(file.parent).gps_sigma


def test_corrected_places_weigh_as_they_are(tmp_path: Path) -> None:
    """Photographs whose XMP has RTK accuracies and gimbal angles are placed to centimeters, and say so."""
    rng = np.random.default_rng(0)
    eyes = np.column_stack([rng.uniform(0, 60, 12), rng.uniform(0, 40, 12), rng.uniform(30, 45, 12)])
    poses = np.stack([look_at(eye, eye + np.array([0.0, 1.0, -1.0])) for eye in eyes])
    for row, eye in enumerate(eyes):
        east, north, up = eye - eyes[0] + rng.normal(0, [0.011, 0.012, 0.025])
        data = tagged((east, north, up))
        (tmp_path / f"{row:02d}.jpg").write_bytes(with_xmp(data, PACKET.format(roll="0.00", pitch="-45.00")))
    capture = open_photographs(tmp_path)
    assert capture.gps_sigma == pytest.approx((0.011, 0.012, 0.025))
    model = poses.copy()
    model[:, :3, 3] /= 7.0
    found, target = place(Registered(model, np.arange(12)), capture, None, AlignmentSettings(), rng)
    assert target.kind == "gps"
    assert found.errors is not None
    assert abs(found.similarity.scale / 7.0 - 1.0) * 100 < found.errors.scale < 0.5
    assert found.errors.place < 0.1
    np.testing.assert_allclose(found.similarity.rotation, np.eye(3), atol=np.radians(0.3))
    assert target.gimbal is not None
    np.testing.assert_allclose(target.gimbal, np.tile(camera_up_of(-45.0, 0.0), (12, 1)))
