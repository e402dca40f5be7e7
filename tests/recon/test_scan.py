"""Scans from elsewhere come in right, and whatever is wrong with a file is one line that names it."""

import struct
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import laspy
import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from groundwork.errors import InputError, MissingError
from recon.cloud import COLUMNS, Cloud, without_observations, write_cloud
from recon.formats.laz import write_laz
from recon.formats.ply import write_ply
from recon.formats.scan import read_scan
from tests.conftest import Count, RecordProof
from usd_schemas.components import class_rows
from usd_schemas.raycast import load_open3d

Damage = Callable[[bytes], bytes]
COUNT = 300
LEAST_MEMORY = 64_000_000  # [bytes] for a file of some kilobytes


def small_cloud() -> Cloud:
    """Make a labeled cloud on a map far from the origin."""
    rng = np.random.default_rng(3)
    columns = {
        name: np.zeros((COUNT, kind.width) if kind.width > 1 else COUNT, kind.dtype) for name, kind in COLUMNS.items()
    }
    columns["coord"] = rng.normal((4e5, 5e6, 30.0), 20.0, (COUNT, 3))
    columns["color"] = rng.integers(0, 256, (COUNT, 3)).astype(np.uint8)
    columns["normal"][:, 2] = 1.0
    columns["segment"] = rng.choice([0, 9, 12], COUNT).astype(np.uint8)
    columns["instance"] = rng.choice([0, 3, 70_000], COUNT).astype(np.uint32)
    return Cloud(columns, without_observations(COUNT), ("",), class_rows(), {}, (), {}, "mesh")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Give the cloud as las, laz, ply and folder."""
    folder = tmp_path_factory.mktemp("scans")
    cloud = small_cloud()
    write_laz(folder / "a.las", cloud, compress=False)
    write_laz(folder / "a.laz", cloud)
    write_ply(folder / "a.ply", cloud)
    (folder / "cloud").mkdir()
    write_cloud(folder / "cloud", cloud)
    return {"las": folder / "a.las", "laz": folder / "a.laz", "ply": folder / "a.ply", "cloud": folder / "cloud"}


@pytest.mark.parametrize("kind", ["las", "laz", "ply", "cloud"])
def test_our_own_files_come_back(files: dict[str, Path], kind: str) -> None:
    """Positions within the rounding of the format, colors, labels and instances exactly."""
    scan, columns = read_scan(files[kind]), small_cloud().columns
    np.testing.assert_allclose(scan.coord, columns["coord"], rtol=0, atol=0.51e-4 if "la" in kind else 0)
    for name in ("color", "segment", "instance"):
        np.testing.assert_array_equal(getattr(scan, name), columns[name], strict=True)
    if kind in ("las", "laz"):
        assert scan.classification is not None
        np.testing.assert_array_equal(scan.classification, columns["segment"] + 64)
        assert (scan.class_names[73], scan.class_names[76]) == ("deck", "pier_cap")
    assert len(scan) == COUNT


@pytest.mark.parametrize("kind", range(11))
def test_every_point_format_of_las(kind: int, tmp_path: Path) -> None:
    """Files that laspy writes, of every format, with extra dimensions round the labels; LAZ where it can."""
    rng = np.random.default_rng(kind)
    header = laspy.LasHeader(point_format=kind, version="1.4" if kind > 5 else "1.3" if kind > 3 else "1.2")
    header.scales, header.offsets = np.array([0.001, 0.001, 0.01]), np.array([4e5, 5e6, 0.0])
    for name, dtype in (("other", "f8"), ("label", "i4"), ("instance", "u2"), ("last", "u1")):
        header.add_extra_dim(laspy.ExtraBytesParams(name, np.dtype(dtype)))
    record = laspy.LasData(header)
    coord = np.round(rng.normal((4e5, 5e6, 0.0), 9.0, (50, 3)), 2)
    record.x, record.y, record.z = coord.T
    record.intensity = rng.integers(0, 65536, 50).astype(np.uint16)
    record.classification = rng.integers(0, 32, 50).astype(np.uint8)
    record["label"], record["instance"] = rng.integers(0, 17, 50), rng.integers(0, 900, 50)
    colored = "red" in header.point_format.dimension_names
    if colored:
        record.red = record.green = record.blue = rng.integers(0, 65536, 50).astype(np.uint16)
    for name in ("f.las", "f.laz"):
        if name == "f.laz" and kind in (4, 5, 9, 10):  # wave packets are beyond the library
            continue
        record.write(str(tmp_path / name))
        scan = read_scan(tmp_path / name)
        np.testing.assert_allclose(scan.coord, coord, rtol=0, atol=1e-6)
        np.testing.assert_array_equal(scan.intensity, np.asarray(record.intensity))
        np.testing.assert_array_equal(scan.classification, np.asarray(record.classification))
        np.testing.assert_array_equal(scan.segment, np.asarray(record["label"]))
        np.testing.assert_array_equal(scan.instance, np.asarray(record["instance"]))
        if colored:
            assert scan.color is not None
            np.testing.assert_array_equal(scan.color[:, 0], np.asarray(record.red) >> 8)
        else:
            assert scan.color is None


def test_ply_of_other_programs(tmp_path: Path) -> None:
    """What trimesh and Open3D write: float and double, text and binary, with and without colors, a mesh's vertices."""
    rng = np.random.default_rng(1)
    points, colors = rng.normal(0, 50, (80, 3)), rng.integers(0, 256, (80, 4)).astype(np.uint8)
    for encoding in ("ascii", "binary"):
        trimesh.PointCloud(points, colors=colors).export(tmp_path / "t.ply", encoding=encoding)
        scan = read_scan(tmp_path / "t.ply")
        np.testing.assert_allclose(scan.coord, points, atol=1e-5)
        np.testing.assert_array_equal(scan.color, colors[:, :3])
        trimesh.creation.box().export(tmp_path / "box.ply", encoding=encoding)
        assert len(read_scan(tmp_path / "box.ply")) == 8
    o3d = load_open3d()
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.normals = o3d.utility.Vector3dVector(np.tile([0.0, 0.0, 1.0], (80, 1)))
    o3d.io.write_point_cloud(str(tmp_path / "o.ply"), cloud)
    scan = read_scan(tmp_path / "o.ply")
    np.testing.assert_array_equal(scan.coord, points)
    assert scan.normal is not None
    assert (scan.normal == [0.0, 0.0, 1.0]).all()
    assert scan.color is None


def test_ply_whose_columns_are_spread_over_elements(tmp_path: Path) -> None:
    """Positions, colors as shares of one, and labels as floats, each in an element of its own, big-endian."""
    rng = np.random.default_rng(1)
    xyz, rgb = rng.normal(size=(40, 3)).astype(">f4"), rng.random((40, 3)).astype(">f4")
    label = rng.integers(0, 9, 40).astype(">f4")
    head = b"ply\r\nformat binary_big_endian 1.0\r\ncomment x\r\nelement vertex 40\r\n"
    head += b"".join(b"property float %s\r\n" % name for name in (b"x", b"y", b"z")) + b"element color 40\r\n"
    head += b"".join(b"property float %s\r\n" % name for name in (b"r", b"g", b"b"))
    head += b"element label 40\r\nproperty float label\r\nelement face 2\r\nproperty list uchar int vertex_indices\r\n"
    path = tmp_path / "s.ply"
    path.write_bytes(head + b"end_header\r\n" + xyz.tobytes() + rgb.tobytes() + label.tobytes())
    scan = read_scan(path)
    np.testing.assert_array_equal(scan.coord, xyz.astype(float))
    np.testing.assert_array_equal(scan.color, np.rint(rgb * np.float32(255)))
    np.testing.assert_array_equal(scan.segment, label)


@pytest.mark.parametrize("name", ["scalar_Label", "Classification", "scalar_class", "Label", "segment"])
def test_labels_are_found_under_the_names_of_other_programs(name: str, tmp_path: Path) -> None:
    """In capitals or not, behind CloudCompare's `scalar_` or not; a name of our own counts before the others."""
    rng = np.random.default_rng(1)
    labels = rng.integers(0, 9, 30)
    head = "ply\nformat ascii 1.0\nelement vertex 30\nproperty double x\nproperty double y\nproperty double z\n"
    head += f"property float scalar_Intensity\nproperty float {name}\nend_header\n"
    rows = "".join(f"{row} 2 3 0.5 {label}.0\n" for row, label in enumerate(labels))
    (tmp_path / "a.ply").write_text(head + rows)
    scan = read_scan(tmp_path / "a.ply")
    np.testing.assert_array_equal(scan.segment, labels)
    np.testing.assert_array_equal(scan.intensity, np.full(30, 0.5))
    header = laspy.LasHeader(point_format=6, version="1.4")
    for extra in dict.fromkeys((name, "segment") if name != "Classification" else ("Segment",)):
        header.add_extra_dim(laspy.ExtraBytesParams(extra, np.dtype("u1")))
    record = laspy.LasData(header)
    record.x, record.y, record.z = rng.uniform(0, 9, (3, 30))
    record["Segment" if name == "Classification" else "segment"] = labels
    record.write(str(tmp_path / "a.las"))
    np.testing.assert_array_equal(read_scan(tmp_path / "a.las").segment, labels)


def test_pts_has_the_intensity_before_the_color(tmp_path: Path) -> None:
    """A count, then x y z intensity r g b, as scanners write it; the same numbers in .txt are color and label."""
    (tmp_path / "a.pts").write_text("2\n1.5 2 3 -1240 10 20 30\n4 5 6 2047 40 50 60\n")
    scan = read_scan(tmp_path / "a.pts")
    np.testing.assert_array_equal(scan.coord, [[1.5, 2, 3], [4, 5, 6]])
    np.testing.assert_array_equal(scan.color, [[10, 20, 30], [40, 50, 60]])
    np.testing.assert_array_equal(scan.intensity, [-1240, 2047])
    assert scan.segment is None
    (tmp_path / "a.txt").write_text("1.5 2 3 10 20 30 7\n4 5 6 40 50 60 8\n")
    scan = read_scan(tmp_path / "a.txt")
    np.testing.assert_array_equal(scan.color, [[10, 20, 30], [40, 50, 60]])
    np.testing.assert_array_equal(scan.segment, [7, 8])


def test_text_that_is_no_scan_says_why(tmp_path: Path) -> None:
    """Nothing in it, five columns without names, colors that are none: one line each."""
    for text, reason in (
        ("", "holds no points"),
        ("1 2 3 4 5\n", "columns without names"),
        ("1 2 3 -4 0 0\n", "not a color"),
        ("1 2 3 70000 0 0\n", "not a color"),
        ("x y y z\n1 2 3 4\n", "a duplicate column"),
    ):
        (tmp_path / "a.xyz").write_text(text)
        with pytest.raises(InputError, match=reason) as error:
            read_scan(tmp_path / "a.xyz")
        assert "\n" not in str(error.value)
    head = "ply\nformat ascii 1.0\nelement vertex 1\n"
    head += "".join(f"property float {name}\n" for name in ("x", "y", "z", "red", "green", "blue")) + "end_header\n"
    for color in ("-1 0 0", "nan 0 0", "70000 0 0"):
        (tmp_path / "a.ply").write_text(f"{head}1 2 3 {color}\n")
        with pytest.raises(InputError, match="not a color"):
            read_scan(tmp_path / "a.ply")


def put(at: int, form: str, *values: float) -> Damage:
    """Overwrite numbers in a file."""
    return lambda data: data[:at] + struct.pack(form, *values) + data[at + struct.calcsize(form) :]


def swap(old: bytes, new: bytes) -> Damage:
    """Replace some bytes once."""
    return lambda data: data.replace(old, new, 1)


def first_point_of(data: bytes, values: tuple[float, float, float]) -> bytes:
    """Overwrite the first position of a binary PLY file."""
    at = data.index(b"end_header\n") + 11
    return data[:at] + struct.pack("<3d", *values) + data[at + 24 :]


DAMAGES: list[tuple[str, Damage, str]] = [
    ("las", lambda data: data[:100], "header"),
    ("las", lambda data: data[:-40], "cut off"),
    ("las", lambda data: data[:420], "beyond the end"),
    ("las", swap(b"LASF", b"LASX"), "neither"),
    ("las", put(24, "<BB", 2, 0), "version"),
    ("las", put(247, "<Q", 10**12), "too many points"),
    ("las", put(247, "<Q", 0), "no points"),
    ("las", put(247, "<Q", 90_000_000), "cut off"),
    ("las", put(94, "<H", 60_000), "header and points"),
    ("las", put(96, "<I", 2**32 - 1), "header and points"),
    ("las", put(100, "<I", 2**32 - 1), "beyond the points"),
    ("las", put(375 + 20, "<H", 65_535), "reaches beyond the points"),
    ("las", put(104, "<B", 11), "point format"),
    ("las", put(105, "<H", 4), "point format"),
    ("las", put(105, "<H", 40), "extra dimensions"),
    ("las", put(131, "<d", np.nan), "an invalid scale"),
    ("las", put(131, "<d", 0.0), "an invalid scale"),
    ("las", put(155, "<d", 1e300), "not finite"),
    ("las", put(155, "<d", 4.5e5), "outside the bounds"),
    ("laz", put(247, "<Q", 10**12), "too many points"),
    ("laz", put(247, "<Q", 90_000_000), "LAZ"),
    ("laz", lambda data: put(105, "<H", 60_000)(put(247, "<Q", 90_000_000)(data)), "5400.0 GB"),
    ("laz", lambda data: data[:-1500], "LAZ"),
    ("laz", swap(b"laszip encoded", b"laszip_encoded"), "without the laszip record"),
    ("laz", put(105, "<H", 90), "does not fit the point format|extra"),
    ("ply", lambda data: data[:60], "header"),
    ("ply", lambda data: data[:-1], "cut off"),
    ("ply", swap(b"vertex 300", b"vertex 1000000000000"), "too many points"),
    ("ply", swap(b"vertex 300", b"vertex 99000000"), "cut off"),
    ("ply", swap(b"vertex 300", b"vertex 0"), "no points"),
    ("ply", swap(b"vertex 300", b"vertex -3"), "unknown line in the header"),
    ("ply", swap(b"vertex 300", b"vertex 3" + b"0" * 4000), "too many points"),
    ("ply", swap(b"binary_little_endian", b"ascii"), "not a number|cut off"),
    ("ply", swap(b"format binary_little_endian 1.0\n", b""), "format"),
    ("ply", swap(b"property double x", b"property double q"), "position"),
    ("ply", swap(b"property double y", b"property double x"), "duplicate"),
    ("ply", swap(b"property double x", b"property strange x"), "unknown type"),
    ("ply", swap(b"property double x", b"property list uchar double x"), "lists"),
    ("ply", lambda data: first_point_of(data, (1.0, np.nan, 2.0)), "point 0 is not finite"),
    ("ply", lambda data: first_point_of(data, (1.0, 1e30, 2.0)), "point 0 is not finite"),
    ("ply", swap(b"element vertex", b"element nothing 0\n" * 2000 + b"element vertex"), "too many columns"),
]


@pytest.mark.parametrize(("kind", "damage", "reason"), DAMAGES)
def test_damage_is_one_line(files: dict[str, Path], tmp_path: Path, kind: str, damage: Damage, reason: str) -> None:
    """Every lie is found before anything large is allocated; file and reason are named."""
    path = tmp_path / f"bad.{kind}"
    path.write_bytes(damage(files[kind].read_bytes()))
    assert path.read_bytes() != files[kind].read_bytes()
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=reason) as error:
            read_scan(path)
        assert tracemalloc.get_traced_memory()[1] < LEAST_MEMORY
    finally:
        tracemalloc.stop()
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_text_that_ends_early_or_is_none(tmp_path: Path) -> None:
    """ASCII PLY: too few numbers, a word among them, not a number at all; and a good one without a last line end."""
    head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    path = tmp_path / "t.ply"
    for body, reason in (
        ("1 2 3\n4 5 6\n", "cut off"),
        ("1 2 3\n4 5 6\n7 8 nine\n", "not a number"),
        ("1 2 3\n4 nan 6\n7 8 9\n", "point 1"),
        ("1 2 3\n4 5 6\n7 8     \n", "cut off"),
    ):
        path.write_text(head + body)
        with pytest.raises(InputError, match=reason):
            read_scan(path)
    path.write_text(head + "1 2 3\n4 5 6\n7 8 9.25")
    np.testing.assert_array_equal(read_scan(path).coord, [[1, 2, 3], [4, 5, 6], [7, 8, 9.25]])


def test_labels_must_be_labels(tmp_path: Path) -> None:
    """A class of 12.5, of -2 or of 300 is an error, -1 and NaN mean none; what is no scan at all is an error, too."""
    head = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
    for value in ("-1", "nan", "255"):
        (tmp_path / "l.ply").write_text(f"{head}property float label\nend_header\n1 2 3 {value}\n")
        segment = read_scan(tmp_path / "l.ply").segment
        assert segment is not None
        assert (segment.dtype, segment.tolist()) == (np.uint8, [255])
    (tmp_path / "l.txt").write_text("1 2 3 10 20 30 -1 -1\n1 2 4 10 20 30 4 nan\n1 2 5 10 20 30 4 7\n")
    scan = read_scan(tmp_path / "l.txt")
    assert scan.segment is not None
    assert scan.instance is not None
    assert (scan.segment.tolist(), scan.instance.tolist()) == ([255, 4, 4], [0, 0, 7])
    for value in ("12.5", "-2", "300", "inf"):
        (tmp_path / "l.ply").write_text(f"{head}property float label\nend_header\n1 2 3 {value}\n")
        with pytest.raises(InputError, match="not a label"):
            read_scan(tmp_path / "l.ply")
    (tmp_path / "n").write_text("hello")
    with pytest.raises(InputError, match="neither"):
        read_scan(tmp_path / "n")
    (tmp_path / "n.txt").write_text("hello")
    with pytest.raises(InputError, match="not lines of numbers"):
        read_scan(tmp_path / "n.txt")
    (tmp_path / "empty").write_text("")
    with pytest.raises(InputError, match="neither"):
        read_scan(tmp_path / "empty")
    with pytest.raises(MissingError):
        read_scan(tmp_path / "absent.laz")
    (tmp_path / "folder").mkdir()
    with pytest.raises(MissingError, match="not a cloud"):
        read_scan(tmp_path / "folder")


@pytest.mark.parametrize(("kind", "quick", "full"), [("las", 200, 2000), ("ply", 200, 2000), ("laz", 4, 200)])
def test_no_flipped_byte_does_harm(
    files: dict[str, Path],
    tmp_path: Path,
    proof_count: Count,
    record_proof: RecordProof,
    kind: str,
    quick: int,
    full: int,
) -> None:
    """Headers with a few wrong bytes: a scan or an `InputError`, nothing else, and little memory."""
    data = files[kind].read_bytes()
    end = data.index(b"end_header") if kind == "ply" else struct.unpack_from("<I", data, 96)[0]
    said: list[str] = []
    count = proof_count(quick, full)
    path = tmp_path / "bad"
    tracemalloc.start()
    try:
        for seed in range(count):
            rng = np.random.default_rng(seed)
            bad: NDArray[np.uint8] = np.frombuffer(data, np.uint8).copy()
            at = rng.integers(0, end if seed % 4 else len(data), rng.integers(1, 4))
            bad[at] ^= rng.integers(1, 256, len(at)).astype(np.uint8)
            path.write_bytes(bad.tobytes())
            try:
                read_scan(path)
            except InputError as error:
                said.append(str(error))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < LEAST_MEMORY
    assert all("\n" not in line and str(path) in line for line in said)
    assert count < 100 or len(said) > 0.05 * count  # most bytes of a LAS header are names and descriptions
    record_proof(
        f"recon: {kind} scans with flipped bytes are read or refused",
        count,
        0,
        {"refused": len(said), "peak_memory_mb": round(peak / 1e6, 1)},
    )
