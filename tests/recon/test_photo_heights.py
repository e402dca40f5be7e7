"""Heights of positions in photographs: as stated, below the sea, or absent."""

import struct
from pathlib import Path

import numpy as np
import pycolmap
import pytest

from groundwork.progress import SILENT
from recon.photos.photo_header import read_header
from recon.photos.photos import fix_sigmas, open_photographs
from recon.settings import SparseSettings
from recon.sfm.database import DATABASE
from recon.sfm.extraction import extract
from recon.sfm.mapping import _fixes
from tests.recon.test_photos import jpeg, tiff, with_exif


def gps_of(*entries: tuple[int, int, bytes]) -> bytes:
    """Write EXIF of 46 degrees north, 7 degrees east and further entries: tag, type, value."""
    angles = [(tag, 5, struct.pack("<6I", angle, 1, 0, 1, 0, 1), 3) for tag, angle in ((2, 46), (4, 7))]
    return tiff(
        {tag: (kind, value, count) for tag, kind, value, count in (*angles, *((*e, 1) for e in entries))}, "<"
    ).replace(struct.pack("<HHII", 0x8769, 4, 1, 26), struct.pack("<HHII", 0x8825, 4, 1, 26))


@pytest.mark.parametrize(
    ("height", "entries"),
    [
        (None, []),
        (None, [(6, 5, struct.pack("<2I", 0, 1))]),
        (None, [(6, 5, struct.pack("<2I", 0, 0))]),
        (420.5, [(6, 5, struct.pack("<2I", 841, 2))]),
        (-420.0, [(5, 1, b"\x01"), (6, 5, struct.pack("<2I", 420, 1))]),
        (-420.0, [(6, 10, struct.pack("<2i", -420, 1))]),
        (-420.0, [(5, 1, b"\x01"), (6, 10, struct.pack("<2i", -420, 1))]),
    ],
)
def test_a_height_is_what_is_stated(
    tmp_path: Path, height: float | None, entries: list[tuple[int, int, bytes]]
) -> None:
    """Absent, or the 0 of a receiver without it: none; below the sea by its reference, by its sign, or by both."""
    (tmp_path / "a.jpg").write_bytes(with_exif(jpeg(), gps_of(*entries)))
    assert read_header(tmp_path / "a.jpg").place == (46.0, 7.0, height)


def test_a_place_without_height_is_no_place_at_sea_level(tmp_path: Path) -> None:
    """It gets the usual height without weight, and does not judge cameras; if no height is known, it is 0."""
    for name, height in (("a", 0), ("b", 500), ("c", 504)):
        entries = [(6, 5, struct.pack("<2I", height, 1))]
        (tmp_path / f"{name}.jpg").write_bytes(with_exif(jpeg(), gps_of(*entries)))
    capture = open_photographs(tmp_path)
    places = np.array([image.gps for image in capture.images])
    np.testing.assert_allclose(places, [[0, 0, 0], [0, 0, -2], [0, 0, 2]], atol=1e-6)
    assert capture.facts["origin"] == {"latitude": 46.0, "longitude": 7.0, "height": 502.0}
    np.testing.assert_array_equal(fix_sigmas(capture), [[2, 2, np.inf], [2, 2, 3], [2, 2, 3]])
    assert sorted(_fixes(capture)) == ["b.jpg", "c.jpg"]
    for name in "bc":
        (tmp_path / f"{name}.jpg").unlink()
    assert open_photographs(tmp_path).facts["origin"] == {"latitude": 46.0, "longitude": 7.0, "height": 0.0}


def test_every_position_has_its_own_error_in_the_mapper(tmp_path: Path) -> None:
    """The covariances of COLMAP's priors are the errors of each photograph; an unknown height has a large one."""
    tall = (6, 5, struct.pack("<2I", 500, 1))
    errors = [(0x1F, 5, struct.pack("<2I", *error)) for error in ((1, 50), (5, 1))]
    for name, entries in (("a", [tall, errors[0]]), ("b", [tall, errors[1]]), ("c", errors[1:])):
        (tmp_path / f"{name}.jpg").write_bytes(with_exif(jpeg(), gps_of(*entries)))
    extract(open_photographs(tmp_path), tmp_path, SparseSettings(threads=1), SILENT)
    with pycolmap.Database.open(tmp_path / DATABASE) as database:
        rows = sorted(database.read_all_pose_priors(), key=lambda prior: prior.corr_data_id.id)
        found = [np.sqrt(np.diag(prior.position_covariance)) for prior in rows]
    np.testing.assert_allclose(found, [[0.02, 0.02, 0.03], [5.0, 5.0, 7.5], [5.0, 5.0, 1e4]])
