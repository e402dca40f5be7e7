"""Labeled copies of scans keep what the source held, in every format, and are read as what they are."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import laspy
import numpy as np
import pytest
from laspy.vlrs.vlrlist import VLRList

from groundwork.errors import InputError
from recon.formats.labels import Labels
from recon.formats.scan import open_scan, read_scan, write_labeled_copy
from tests.learn.test_predict import lattice, write_las

DENSITY = "\u5bc6\u5ea6"


def labeled(source: Path, out: Path, classes: list[int], *, classify: bool = False, chunk: int = 2) -> Path:
    """Write a labeled copy in pieces."""

    def labels() -> Iterator[Labels]:
        for first in range(0, len(classes), chunk):
            part = np.array(classes[first : first + chunk], np.uint8)
            yield Labels(part, np.full(len(part), 0.5, np.float32), np.arange(len(part), dtype=np.uint32))

    with open_scan(source) as stream:
        assert stream.count == len(classes)
        write_labeled_copy(source, stream, out, labels, chunk, classify)
    return out


def test_a_copy_of_copc_is_plain(tmp_path: Path) -> None:
    """The records of its tree are left out, as the copy keeps the order of the points; others stay."""
    coord, color = lattice(5)
    write_las(tmp_path / "a.las", coord, color)
    scan = laspy.read(str(tmp_path / "a.las"))
    scan.header.vlrs.insert(0, laspy.VLR("copc", 1, "info", bytes(160)))
    scan.evlrs = VLRList([laspy.VLR("copc", 1000, "tree", bytes(32)), laspy.VLR("mine", 9, "at the end", b"tail")])
    scan.write(str(tmp_path / "b.las"))
    labeled(tmp_path / "b.las", tmp_path / "c.laz", [1, 2, 3, 4, 5])
    copy = laspy.read(str(tmp_path / "c.laz"))
    assert np.asarray(copy["predicted_class"]).tolist() == [1, 2, 3, 4, 5]
    assert [row.user_id for row in copy.evlrs or ()] == ["mine"]
    assert "copc" not in {row.user_id for row in copy.header.vlrs}
    assert "mine" in {row.user_id for row in copy.header.vlrs}


@pytest.mark.parametrize(
    ("given", "kept"),
    [([10, 20, 65535], [10, 20, 65535]), ([0.0, 0.5, 1.0], [0, 32768, 65535]), ([-1240, 0, 2047], [0, 24723, 65535])],
)
def test_a_new_las_has_intensity_class_and_returns(given: list[float], kept: list[int], tmp_path: Path) -> None:
    """Of a source that is no LAS: whole numbers of 16 bits as they are, others scaled."""
    rows = [f"{i} {i + 1} {i + 2} {value}" for i, value in enumerate(given)]
    (tmp_path / "a.xyz").write_text("\n".join(rows) + "\n")
    copy = laspy.read(str(labeled(tmp_path / "a.xyz", tmp_path / "b.laz", [2, 16, 255], classify=True)))
    assert np.asarray(copy.intensity).tolist() == kept
    assert np.asarray(copy.classification).tolist() == [2, 7, 1]
    assert np.asarray(copy.return_number).tolist() == np.asarray(copy.number_of_returns).tolist() == [1, 1, 1]
    plain = laspy.read(str(labeled(tmp_path / "a.xyz", tmp_path / "c.las", [2, 16, 255])))
    assert np.asarray(plain.classification).tolist() == [0, 0, 0]


@pytest.mark.parametrize(
    "text", ["1 2 3\n4 5 6\n", "1,2,3,9\n4,5,6,8\n", "1 2 3 # a\n\n4 5 6 # b\n", "1 2 3 9 9 9\n4 5 6 7 7 7"]
)
def test_a_copy_of_text_without_names_has_names(text: str, tmp_path: Path) -> None:
    """Otherwise labels would be read as colors; comments stay behind the numbers, and a second labeling is refused."""
    source = tmp_path / "a.txt"
    source.write_text(text)
    copy = labeled(source, tmp_path / "b.txt", [7, 9])
    lines = copy.read_text().splitlines()
    assert lines[0].startswith("# x")
    before, after = read_scan(source), read_scan(copy)
    np.testing.assert_array_equal(before.coord, after.coord)
    assert (before.color is None) == (after.color is None)
    assert read_scan(copy, labels="predicted_class").segment is not None
    assert np.asarray(read_scan(copy, labels="predicted_class").segment).tolist() == [7, 9]
    assert text.count("#") == sum(line.count("#") for line in lines[1:])
    with pytest.raises(InputError, match="already has predictions"):
        labeled(copy, tmp_path / "c.txt", [7, 9])


@pytest.mark.filterwarnings("ignore:Stored array in format 3.0")
def test_records_of_an_array_have_the_usual_names(tmp_path: Path) -> None:
    """Short names and capitals mean what they do in text, and a copy keeps names in any alphabet."""
    kinds = [
        ("X", "f8"),
        ("y", "f8"),
        ("Z", "f8"),
        ("r", "u1"),
        ("G", "u1"),
        ("b", "u1"),
        ("Label", "i4"),
        ("\u5bc6\u5ea6", "f4"),
    ]
    rows = np.zeros(3, [*kinds, ("scalar_Intensity", "f4")])
    rows["Label"], rows["r"], rows["scalar_Intensity"], rows["X"] = [4, -1, 6], 200, [1, 2, 3], [1.5, 2.5, 3.5]
    np.save(tmp_path / "a.npy", rows)
    scan = read_scan(tmp_path / "a.npy")
    assert np.asarray(scan.segment).tolist() == [4, 255, 6]
    assert np.asarray(scan.color)[:, 0].tolist() == [200, 200, 200]
    assert np.asarray(scan.intensity).tolist() == [1, 2, 3]
    copy = np.load(labeled(tmp_path / "a.npy", tmp_path / "b.npy", [1, 2, 3]))
    assert copy.dtype.descr[: len(rows.dtype.descr)] == rows.dtype.descr
    assert copy[DENSITY].dtype == np.float32
    assert copy["predicted_class"].tolist() == [1, 2, 3]
    np.save(tmp_path / "c.npy", np.arange(9.0).reshape(3, 3))
    assert np.load(labeled(tmp_path / "c.npy", tmp_path / "d.npy", [1, 2, 3]))[:, 3].tolist() == [1, 2, 3]


def test_a_comment_of_ply_may_hold_the_last_word_of_the_header(tmp_path: Path) -> None:
    """The header ends with a line of its own."""
    head = "ply\nformat ascii 1.0\ncomment end_header soon\nelement vertex 1\n"
    (tmp_path / "a.ply").write_text(head + "property float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n")
    assert read_scan(tmp_path / "a.ply").coord.tolist() == [[1, 2, 3]]
