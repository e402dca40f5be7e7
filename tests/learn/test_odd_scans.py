"""Scans whose colors, labels, classes or units are not the usual ones are read right, and predicted or refused."""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest
from numpy.typing import NDArray

from groundwork.errors import InputError
from learn.datasets.settings import TileSettings
from learn.predict.predict import predict_scan
from learn.predict.settings import PredictSettings
from learn.sample import Sample
from recon.cloud import write_cloud
from recon.formats.copy_las import copy_las
from recon.formats.copy_table import copy_text
from recon.formats.labels import Labels
from recon.formats.laz import write_laz
from recon.formats.ply import write_ply
from recon.formats.read_las import open_las
from recon.formats.scan import read_scan
from tests.learn.oracle_model import ColorModel
from tests.learn.test_predict import lattice, write_las
from tests.learn.toy_bridge import toy_cloud
from usd_schemas.taxonomies import taxonomy


def test_e57(tmp_path: Path) -> None:
    """Scans of an E57 file are read each at its place, in meters as its standard has it, and labeled as a new LAZ."""
    pye57 = pytest.importorskip("pye57")
    coord, color = lattice(400)
    file = pye57.E57(str(tmp_path / "a.e57"), mode="w")
    for part in (slice(0, 150), slice(150, 400)):
        shift = coord[part].mean(axis=0)
        data = {f"cartesian{axis}": coord[part, i] - shift[i] for i, axis in enumerate("XYZ")}
        data |= {name: color[part, i] for i, name in enumerate(("colorRed", "colorGreen", "colorBlue"))}
        data["intensity"] = np.ones(len(coord[part]))
        file.write_scan_raw(data, translation=shift)
    file.close()
    scan = read_scan(tmp_path / "a.e57")
    np.testing.assert_allclose(scan.coord, coord, atol=1e-6)
    np.testing.assert_array_equal(scan.color, color)
    predict_scan(tmp_path / "a.e57", tmp_path / "packed.laz", ColorModel(), PredictSettings(unit="m"))
    np.testing.assert_array_equal(laspy.read(tmp_path / "packed.laz")["predicted_class"], color[:, 0] // 64)
    predict_scan(tmp_path / "a.e57", tmp_path / "metric.laz", ColorModel(), PredictSettings())
    assert (tmp_path / "metric.laz").read_bytes() == (tmp_path / "packed.laz").read_bytes()
    whole = (tmp_path / "a.e57").read_bytes()
    (tmp_path / "torn.e57").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="not readable as E57"):
        read_scan(tmp_path / "torn.e57")


@pytest.mark.parametrize(("most", "kind"), [(65535, "u2"), (1, "f4")])
def test_e57_with_colors_of_other_ranges(most: int, kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Colors of 16 bits and from 0 to 1 are brought to 8 bits; the package alone reads them wrong."""
    pye57 = pytest.importorskip("pye57")
    library = pye57.libe57
    coord, color = lattice(300)
    values = (color.astype(np.float64) / 255 * most).astype(kind)
    integer, real = library.IntegerNode, library.FloatNode

    def node(file: Any, *numbers: int) -> Any:
        if numbers == (0, 0, 255):  # what the package writes for a color
            return integer(file, 0, 0, most) if kind == "u2" else real(file, 0.0, library.E57_SINGLE, 0.0, 1.0)
        return integer(file, *numbers)

    monkeypatch.setattr(library, "IntegerNode", node)
    names = ("colorRed", "colorGreen", "colorBlue")
    monkeypatch.setattr(
        pye57.e57,
        "SUPPORTED_POINT_FIELDS",
        {**pye57.e57.SUPPORTED_POINT_FIELDS, **dict.fromkeys(names, {"u2": "H", "f4": "f"}[kind])},
    )
    file = pye57.E57(str(tmp_path / "a.e57"), mode="w")
    data = {f"cartesian{axis}": coord[:, i] for i, axis in enumerate("XYZ")}
    file.write_scan_raw(data | {name: values[:, i] for i, name in enumerate(names)})
    file.close()
    scan = read_scan(tmp_path / "a.e57")
    np.testing.assert_allclose(scan.coord, coord, atol=1e-9)
    np.testing.assert_allclose(np.asarray(scan.color, int), color, atol=1)


def test_labels_that_are_none_hinder_no_prediction(tmp_path: Path) -> None:
    """A scan whose own labels are -1, 300 or 12.5 is labeled all the same, and keeps them; a data set refuses it."""
    coord, color = lattice(300)
    odd = np.resize([-1.0, 300.0, 12.5], 300)
    head = "ply\nformat binary_little_endian 1.0\nelement vertex 300\n"
    head += "".join(f"property double {name}\n" for name in ("x", "y", "z", "red", "green", "blue", "label"))
    table = np.column_stack([coord, color, odd])
    (tmp_path / "a.ply").write_bytes(head.encode() + b"end_header\n" + table.astype("<f8").tobytes())
    np.savetxt(tmp_path / "a.txt", table, "%.4f %.4f %.4f %d %d %d %.1f")
    np.save(tmp_path / "a.npy", table)
    write_las(tmp_path / "a.las", coord, color)
    las = laspy.read(tmp_path / "a.las")
    las.add_extra_dim(laspy.ExtraBytesParams("label", np.dtype("f4")))
    las["label"] = odd
    las.write(str(tmp_path / "a.las"))
    for suffix in ("ply", "txt", "npy", "las"):
        path, out = tmp_path / f"a.{suffix}", tmp_path / f"out.{suffix}"
        with pytest.raises(InputError, match="not a label"):
            read_scan(path)
        predict_scan(path, out, ColorModel(), PredictSettings(unit="m"))
        (tmp_path / "out.instances.json").unlink()
    np.testing.assert_array_equal(np.load(tmp_path / "out.npy")[:, 6:8], np.column_stack([odd, color[:, 0] // 64]))
    np.testing.assert_array_equal(laspy.read(tmp_path / "out.las")["label"], odd)


@pytest.mark.parametrize("kind", [3, 7])
def test_a_class_that_a_point_format_cannot_hold_is_refused(kind: int, tmp_path: Path) -> None:
    """Formats 0 to 5 have five bits: 31 is written beside the flags, 32 leaves no file; later ones hold it.

    The only table that is written into `classification` needs no more.
    """
    header = laspy.LasHeader(point_format=kind, version="1.4")
    record = laspy.LasData(header)
    record.x = record.y = record.z = np.arange(5.0)
    record.withheld = np.array([1, 0, 1, 0, 1])
    record.write(str(tmp_path / "a.las"))
    for largest in (31, 32):
        classes, out = np.array([0, 255, 2, largest, 16], np.uint8), tmp_path / f"{largest}.las"
        labels = Labels(classes, np.ones(5, np.float32), np.zeros(5, np.uint32))
        with open_las(tmp_path / "a.las", 10) as rows:
            if kind < 6 and largest > 31:
                with pytest.raises(InputError, match=r"point format 3 has five bits.*32.*0 to 31.*point format 6"):
                    copy_las(tmp_path / "a.las", rows, out, [labels], classify=True)
                assert sorted(path.name for path in tmp_path.iterdir()) == ["31.las", "a.las"]
                continue
            copy_las(tmp_path / "a.las", rows, out, [labels], classify=True)
        back = laspy.read(out)
        assert np.asarray(back.classification).tolist() == [0, 1, 2, largest, 7]  # 16 is a wire's in LAS
        assert np.asarray(back.withheld).tolist() == [1, 0, 1, 0, 1]
        assert np.asarray(back["predicted_class"]).tolist() == classes.tolist()
    assert max(row.id for row in taxonomy("asprs").rows if row.id != 255) <= 31


def test_normals_and_missing_colors_of_las(tmp_path: Path) -> None:
    """Normals are read from extra dimensions; colors that are all black are none, so that no model relies on them."""
    coord, color = lattice(300)
    scan = laspy.read(write_las(tmp_path / "a.las", coord, color * 0))
    normal = np.random.default_rng(0).normal(size=(300, 3)).astype(np.float32)
    for axis, name in enumerate(("NormalX", "NormalY", "NormalZ")):
        scan.add_extra_dim(laspy.ExtraBytesParams(name, np.dtype("f4")))
        scan[name] = normal[:, axis]
    scan.write(str(tmp_path / "b.laz"))
    unit = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    read = read_scan(tmp_path / "b.laz")
    assert read.normal is not None
    np.testing.assert_allclose(read.normal, unit, atol=1e-6)
    assert read.color is None
    scan = laspy.read(str(tmp_path / "a.las"))
    for axis, name in enumerate(("nx", "ny", "nz")):
        scan.add_extra_dim(laspy.ExtraBytesParams(name, np.dtype("i2"), scales=[1e-4], offsets=[0.0]))
        scan[name] = unit[:, axis]
    scan.write(str(tmp_path / "c.las"))
    scaled = read_scan(tmp_path / "c.las").normal
    assert scaled is not None
    np.testing.assert_allclose(scaled, unit, atol=2e-4)
    with pytest.raises(InputError, match=r"color"):
        predict_scan(tmp_path / "b.laz", tmp_path / "out.laz", ColorModel(), PredictSettings())


class Viewer(ColorModel):
    """A model that sees one more channel, and no colors."""

    def probabilities(self, samples: Sequence[Sample]) -> list[NDArray[np.float32]]:
        """Know nothing."""
        self.seen += samples
        return [np.full((len(sample.coord), len(self.classes)), 0.25, np.float32) for sample in samples]


def test_a_cloud_of_ours_has_all_inputs_of_a_model(tmp_path: Path) -> None:
    """Also those that its LAZ file lacks, each with its own point whatever the chunks; without them it is refused."""
    heights, zeros = np.linspace(-1.0, 1.0, 900, dtype=np.float32), np.zeros((900, 3), np.float32)
    coord = toy_cloud(1, 900).columns["coord"]
    coord[:, 2] = 30.0 + heights  # so that each normal tells the height of its point
    known = {"normal": np.column_stack([zeros[:, :2], heights]), "n_views": np.full(900, 99, np.uint16)}
    for name, columns in (("known", known), ("unknown", {"normal": zeros, "n_views": np.zeros(900, np.uint16)})):
        cloud = toy_cloud(1, 900, coord=coord, **columns)
        (tmp_path / name).mkdir()
        write_cloud(tmp_path / name, cloud)
        write_laz(tmp_path / name / "cloud.laz", cloud)
    model = Viewer(channels=("z", "nz", "n_views"), tile=TileSettings(voxel=0.05))
    predict_scan(tmp_path / "known", tmp_path / "out.laz", model, PredictSettings(chunk=70))
    features = np.concatenate([sample.features for sample in model.seen])
    np.testing.assert_allclose(features[:, 2], 1.0, atol=1e-6)
    slope = np.polyfit(features[:, 1], features[:, 0], 1)
    np.testing.assert_allclose(features[:, 0], np.polyval(slope, features[:, 1]), atol=3e-3)
    assert np.ptp(features[:, 1]) > 1.9
    with pytest.raises(InputError, match="normal"):
        predict_scan(tmp_path / "unknown", tmp_path / "out.laz", model, PredictSettings())


def test_text_with_a_mark_of_utf8_is_read(tmp_path: Path) -> None:
    """As spreadsheets write it, with names, a comment or nothing in the first line; labels lie at their points."""
    for text in ("x,y,z\n1,2,3\n4,5,6\n", "1 2 3\n4 5 6\n", "# scan\n1 2 3\n4 5 6\n", "\n1 2 3\n4 5 6\n"):
        source, copy = tmp_path / "a.csv", tmp_path / "b.csv"
        source.write_bytes(b"\xef\xbb\xbf" + text.encode())
        np.testing.assert_array_equal(read_scan(source).coord, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
        labels = Labels(np.array([7, 9], np.uint8), np.ones(2, np.float32), np.zeros(2, np.uint32))
        copy.unlink(missing_ok=True)
        copy_text(source, copy, [labels])
        rows = [re.split("[ ,]", line) for line in copy.read_text("utf-8-sig").splitlines() if line[:1] in ("1", "4")]
        assert [row[:4] for row in rows] == [["1", "2", "3", "7"], ["4", "5", "6", "9"]]


def test_a_cloud_without_a_scale_is_asked_for_its_unit(tmp_path: Path) -> None:
    """Nothing brought it to meters: its folder is refused until a scale is given, and that one is used."""
    coord, color = lattice(400)
    cloud = toy_cloud(1, 400, coord=coord, color=color)
    free = dataclasses.replace(cloud, alignment={"target": "none"})
    (tmp_path / "cloud").mkdir()
    write_cloud(tmp_path / "cloud", free)
    write_ply(tmp_path / "cloud" / "cloud.ply", free)
    source, out = tmp_path / "cloud", tmp_path / "out.ply"
    with pytest.raises(InputError, match=r"does not state the unit of its coordinates.*--scale"):
        predict_scan(source, out, ColorModel(), PredictSettings())
    predict_scan(source, out, ColorModel(), PredictSettings(scale=2.0))
    assert json.loads((tmp_path / "out.instances.json").read_text())["meters_per_unit"] == 2.0
