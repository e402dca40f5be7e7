"""Data sets for other training code hold the same points and labels, and scans from elsewhere become data sets."""

from __future__ import annotations

import struct
from pathlib import Path

import h5py
import laspy
import numpy as np
import pyarrow.parquet as pq
import pytest

from groundwork.errors import InputError, MissingError
from groundwork.progress import Silent
from learn.datasets import export
from learn.datasets.build import Source, build_dataset
from learn.datasets.class_map import map_names, read_class_map
from learn.datasets.class_tables import class_table
from learn.datasets.export import export_dataset
from learn.datasets.labeled_cloud import identify, read_labeled
from learn.datasets.layout import read_facts, read_piece
from learn.datasets.scan_units import ScanUnits
from learn.datasets.settings import dataset_settings
from learn.datasets.stored import StoredSplit
from recon.formats.scan import read_scan
from tests.learn.toy_bridge import write_toy

SMALL = {"points": 256, "fewest": 64, "tile": {"voxel": 0.3}}
ALL_READ = ("x", "y", "z", "red", "green", "blue")


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build a small data set of three bridges."""
    folder = tmp_path_factory.mktemp("exports")
    clouds = [write_toy(folder / f"{i}", i, 3000, f"b{i}") for i in range(3)]
    (folder / "set").mkdir()
    build_dataset([Source(path) for path in clouds], folder / "set", dataset_settings("local", SMALL, "test"))
    return folder / "set"


def test_hdf5_and_parquet_hold_the_draws(dataset: Path, tmp_path: Path) -> None:
    """Row by row the samples of the splits, bit for bit: coordinates, colors, labels and bridges."""
    for kind in ("hdf5", "parquet"):
        (tmp_path / kind).mkdir()
        export_dataset(dataset, kind, tmp_path / kind)
    for split, name in (("val", "validation"), ("test", "test")):
        source = StoredSplit(dataset, split, ALL_READ)
        with h5py.File(tmp_path / "hdf5" / f"{split}.h5") as file:
            data, label, bridge = (np.asarray(file[key]) for key in ("data", "label", "bridge"))
        (shard,) = (tmp_path / "parquet/data").glob(f"{name}-*.parquet")
        table = pq.read_table(shard).to_pydict()
        assert len(source) == len(data) == len(table["coord"]) > 5
        for index in range(len(source)):
            sample = source.sample(index, 0)
            np.testing.assert_array_equal(data[index], sample.features)
            np.testing.assert_array_equal(label[index], sample.labels)
            assert bridge[index].decode() == table["bridge"][index] == source.bridge(index)
            scaled = np.array(table["coord"][index], np.float32) * np.float32(0.1)
            np.testing.assert_array_equal(scaled, sample.coord)
            np.testing.assert_array_equal(table["label"][index], sample.labels)
            np.testing.assert_allclose(np.array(table["color"][index]) / 255.0, sample.features[:, 3:], atol=1e-6)
    card = (tmp_path / "parquet/README.md").read_text()
    assert card.startswith("---\nconfigs:\n- config_name: default\n  data_files:\n  - split: train\n")


def test_hugging_face_loads_the_shards(dataset: Path, tmp_path: Path) -> None:
    """Their library finds the splits by the card alone, where it is installed; it is not one of ours."""
    datasets = pytest.importorskip("datasets")
    export_dataset(dataset, "parquet", tmp_path)
    found = datasets.load_dataset(str(tmp_path), cache_dir=str(tmp_path / "cache"))
    source = StoredSplit(dataset, "test", ALL_READ)
    assert len(found["test"]) == len(source)
    np.testing.assert_array_equal(found["test"][0]["label"], source.sample(0, 0).labels)


def test_s3dis_holds_the_pieces(dataset: Path, tmp_path: Path) -> None:
    """A room has the points of its piece, and its annotations are these points, sorted by class."""
    export_dataset(dataset, "s3dis", tmp_path)
    row = next(row for row in read_facts(dataset).pieces if row.split == "test")
    patch = read_piece(dataset, row, ("color",))
    room = tmp_path / "Area_3" / row.name
    whole = np.loadtxt(room / f"{row.name}.txt")
    np.testing.assert_allclose(whole[:, :3], patch.coord, atol=0.51e-4)
    np.testing.assert_array_equal(whole[:, 3:], patch.inputs["color"])
    for label, name in enumerate(("background", "column", "piercap", "deck")):
        path, mine = room / "Annotations" / f"{name}_1.txt", patch.labels == label
        assert path.is_file() == mine.any()
        if mine.any():
            np.testing.assert_array_equal(np.loadtxt(path, ndmin=2), whole[mine])


def test_names_from_elsewhere_can_be_exported(tmp_path: Path) -> None:
    """A bridge with an umlaut, a class whose name is no file name, and two that only an underscore tells apart."""
    (tmp_path / "m.toml").write_text(
        'title = "x"\n[[code]]\nid = 1\nname = "deck/slab"\nparts = ["deck_slab"]\n'
        '[[code]]\nid = 2\nname = "pier_cap"\nparts = ["column"]\n'
        '[[code]]\nid = 3\nname = "piercap"\nparts = ["pier_cap"]\n'
    )
    rng = np.random.default_rng(3)
    rows = np.column_stack([rng.uniform(0, 9, (300, 3)), np.zeros((300, 3)), rng.integers(1, 4, 300)])
    np.savetxt(tmp_path / "a.txt", rows, "%.3f %.3f %.3f %d %d %d %d")
    source = Source(tmp_path / "a.txt", read_class_map(str(tmp_path / "m.toml")), "Mühlbrücke")
    chosen = {**SMALL, "fewest": 1, "table": "own", "split": "random", "shares": (1.0, 0.0, 0.0)}
    for name in ("set", "s3dis", "hdf5"):
        (tmp_path / name).mkdir()
    build_dataset([source], tmp_path / "set", dataset_settings("local", chosen, "test"))
    export_dataset(tmp_path / "set", "s3dis", tmp_path / "s3dis")
    files = {path.name for path in tmp_path.glob("s3dis/*/*/Annotations/*.txt")}
    assert {name.split("-")[0] for name in files} == {"deck", "piercap"}
    assert len(files) == 3
    export_dataset(tmp_path / "set", "hdf5", tmp_path / "hdf5")
    with h5py.File(tmp_path / "hdf5/train.h5") as file:
        assert {name.decode() for name in file["bridge"][:]} == {"Mühlbrücke"}  # type: ignore[index]


def semantic_ply(path: Path, points: np.ndarray, colors: np.ndarray, labels: np.ndarray) -> Path:
    """Write PLY as SemanticBridge does: positions, colors and labels in an element each."""
    count = len(points)
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n"
    head += "".join(f"property double {name}\n" for name in "xyz") + f"element color {count}\n"
    head += "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
    head += f"element label {count}\nproperty int label\nend_header\n"
    path.write_bytes(head.encode() + points.tobytes() + colors.tobytes() + labels.astype("<i4").tobytes())
    return path


def test_semanticbridge(tmp_path: Path) -> None:
    """Its PLY and its LAS are read alike, its test bridges are known, it is never trained on, far places stay exact."""
    rng = np.random.default_rng(0)
    points = rng.uniform(0, 20, (2000, 3)) + np.array([5e5, 5.2e6, 400.0])
    points = np.round(points, 3)
    colors, labels = rng.integers(0, 256, (2000, 3)).astype(np.uint8), rng.integers(0, 9, 2000)
    ply = semantic_ply(tmp_path / "bridge_07.ply", points, colors, labels)
    header = laspy.LasHeader(point_format=7, version="1.4")
    header.scales, header.offsets = np.full(3, 0.001), np.array([5e5, 5.2e6, 0.0])
    header.add_extra_dim(laspy.ExtraBytesParams("label", np.dtype("u1")))
    record = laspy.LasData(header)
    record.x, record.y, record.z = points.T
    record.red, record.green, record.blue = (colors.astype(np.uint16) * 256).T
    record["label"] = labels
    record.write(str(tmp_path / "bridge_08.las"))
    known = read_class_map("semanticbridge")
    facts = [identify(path, known) for path in (ply, tmp_path / "bridge_08.las")]
    assert [(row.test, row.evaluate_only, row.licence) for row in facts] == [
        (True, True, "CC BY-NC 4.0"),
        (False, True, "CC BY-NC 4.0"),
    ]
    table = class_table("semanticbridge")
    clouds = [read_labeled(path, known, table) for path in (ply, tmp_path / "bridge_08.las")]
    for cloud in clouds:
        np.testing.assert_allclose(cloud.coord, points, atol=1e-6)
        np.testing.assert_array_equal(cloud.inputs["color"], colors)
        np.testing.assert_array_equal(cloud.labels, np.where(labels == 0, 255, labels))
    few = read_labeled(ply, known, class_table("kim2023"))
    names = {int(code): set(few.labels[labels == code].tolist()) for code in range(9)}
    assert (names[4], names[8], names[1], names[3], names[0]) == ({3}, {1}, {0}, {0}, {255})
    ours = [Source(write_toy(tmp_path / f"{i}", i, 3000, f"b{i}")) for i in range(2)]
    (tmp_path / "set").mkdir()
    settings = dataset_settings("local", {**SMALL, "split": "random"}, "test")
    made = build_dataset([*ours, Source(ply, known)], tmp_path / "set", settings)
    assert {row.split for row in made.pieces if row.source == 2} == {"test"}
    assert "evaluate only" in (tmp_path / "set/README.md").read_text()


def test_text_and_asprs(tmp_path: Path) -> None:
    """Seven numbers a line are a labeled scan, named columns too; LAS codes 17 and 26 are the bridge."""
    rng = np.random.default_rng(1)
    places = np.round(rng.uniform(0, 9, (60, 3)) + np.array([4e5, 5e6, 3.0]), 3)
    rows = np.column_stack([places, rng.integers(0, 256, (60, 3)), rng.integers(0, 4, 60)])
    np.savetxt(tmp_path / "korea_1.txt", rows, "%.3f %.3f %.3f %d %d %d %d")
    np.savetxt(tmp_path / "named.csv", rows[:, [6, 0, 1, 2]], "%.3f", ",", header="Label,X,Y,Z", comments="")
    for name in ("korea_1.txt", "named.csv"):
        cloud = read_labeled(tmp_path / name, read_class_map("kim2023"), class_table("kim2023"))
        np.testing.assert_array_equal(cloud.coord, rows[:, :3])
        np.testing.assert_array_equal(cloud.labels, rows[:, 6])
    record = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
    codes = rng.choice([0, 1, 2, 3, 5, 9, 17, 26, 99], 300).astype(np.uint8)
    record.x, record.y, record.z = rng.uniform(0, 9, (3, 300))
    record.classification = codes
    record.write(str(tmp_path / "ahn.laz"))
    for table, deck, ground in (("kim2023", "deck", "background"), ("falsework", "deck", "background")):
        cloud = read_labeled(tmp_path / "ahn.laz", read_class_map("asprs"), class_table(table))
        names = class_table(table).names
        found = {int(code): {names[k] if k < 255 else "" for k in cloud.labels[codes == code]} for code in set(codes)}
        assert found[17] == found[26] == {deck}
        assert found[2] == found[5] == found[9] == found[3] == {ground}
        assert found[0] == found[1] == found[99] == {""}


class Notes(Silent):
    """Remembers the notes."""

    def __init__(self) -> None:
        self.notes: list[str] = []

    def note(self, message: str) -> None:
        """Remember one."""
        self.notes.append(message)


def test_a_scan_is_read_in_the_unit_that_it_states_or_that_is_given(tmp_path: Path) -> None:
    """Feet of a reference system, millimeters and y up become meters, z up; angles are refused, and a guess is told."""
    places = np.random.default_rng(2).uniform(0.0, 9.0, (40, 3))
    record = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
    record.header.scales = np.full(3, 0.001)
    record.x, record.y, record.z = (places / 0.3048).T
    record.classification = np.full(40, 17, np.uint8)
    keys = struct.pack("<12H", 1, 1, 0, 2, 1024, 0, 1, 1, 3076, 0, 1, 9002)  # projected, linear unit: foot
    angles = struct.pack("<8H", 1, 1, 0, 1, 1024, 0, 1, 2)
    for name, packed in (("feet.las", keys), ("angles.las", angles)):
        record.header.vlrs.clear()
        record.header.vlrs.append(laspy.VLR("LASF_Projection", 34735, "", packed))
        record.write(str(tmp_path / name))
    np.savetxt(
        tmp_path / "a.txt", np.column_stack([places[:, [0, 2, 1]] * [1e3, 1e3, -1e3], np.zeros((40, 4))]), "%.4f"
    )
    table, known, told = class_table("kim2023"), read_class_map("asprs"), Notes()
    cloud = read_labeled(tmp_path / "feet.las", known, table, told)
    np.testing.assert_allclose(cloud.coord, places, atol=1e-3)
    plain = read_class_map("kim2023")
    units = ScanUnits(unit="mm", up="y")
    np.testing.assert_allclose(
        read_labeled(tmp_path / "a.txt", plain, table, told, units=units).coord, places, atol=1e-6
    )
    assert not told.notes
    assert read_labeled(tmp_path / "a.txt", plain, table, told).coord.max() > 1000.0
    read_labeled(tmp_path / "feet.las", known, table, told, units=ScanUnits(unit="m"))
    assert ["meters are assumed" in told.notes[0], "yours is used" in told.notes[1]] == [True, True]
    with pytest.raises(InputError, match="longitudes and latitudes"):
        read_labeled(tmp_path / "angles.las", known, table)
    assert identify(tmp_path / "a.txt", plain).digest != identify(tmp_path / "a.txt", plain, units=units).digest


def test_scans_without_the_name_of_their_bridge_are_told(tmp_path: Path) -> None:
    """Two scans of one bridge could be in two splits: said unless the bridges are named, or all is split at random."""
    known, rng = read_class_map("kim2023"), np.random.default_rng(3)
    rows = np.column_stack([rng.uniform(0, 9, (200, 3)), np.zeros((200, 3)), rng.integers(0, 4, 200)])
    for name in ("a", "b"):
        np.savetxt(tmp_path / f"{name}.txt", rows + (name == "b"), "%d")
    for names, split, said in (("", ""), "bridge", True), (("x", "y"), "bridge", False), (("", ""), "random", False):
        folder, told = tmp_path / f"{split}{names[0]}", Notes()
        folder.mkdir()
        sources = [Source(tmp_path / f"{file}.txt", known, name) for file, name in zip("ab", names, strict=True)]
        settings = dataset_settings("local", {**SMALL, "fewest": 1, "split": split, "shares": (1.0, 0.0, 0.0)}, "test")
        build_dataset(sources, folder, settings, told)
        assert any("2 scans count as different bridges" in note for note in told.notes) == said


def test_a_class_map_names_any_column(tmp_path: Path) -> None:
    """A property of PLY, a dimension or a standard field of LAS, a field of an array, a named column of text."""
    rng = np.random.default_rng(4)
    places, codes = np.round(rng.uniform(0, 9, (50, 3)), 3), rng.integers(0, 4, 50)
    table = np.column_stack([places, codes, np.full(50, 9)])
    names = ("x", "y", "z", "Strata", "label")
    head = "ply\nformat binary_little_endian 1.0\nelement vertex 50\n"
    head += "".join(f"property double {name}\n" for name in names)
    (tmp_path / "a.ply").write_bytes((head + "end_header\n").encode() + table.tobytes())
    np.savetxt(tmp_path / "a.csv", table, "%.3f", ",", header=",".join(names), comments="")
    records = np.zeros(50, [(name, "f8") for name in names])
    for name, values in zip(names, table.T, strict=True):
        records[name] = values
    np.save(tmp_path / "a.npy", records)
    for number in (3, 7):
        header = laspy.LasHeader(point_format=number, version="1.4")
        header.scales = np.full(3, 0.001)
        header.add_extra_dim(laspy.ExtraBytesParams("Strata", np.dtype("u2")))
        record = laspy.LasData(header)
        record.x, record.y, record.z = places.T
        record["Strata"], record.user_data, record.point_source_id = codes, codes, codes + 1
        record.write(str(tmp_path / f"{number}.las"))
    (tmp_path / "m.toml").write_text('column = "strata"\ntable = "kim2023"\n')
    known, wanted = read_class_map(str(tmp_path / "m.toml")), class_table("kim2023")
    for name in ("a.ply", "a.csv", "a.npy", "3.las", "7.las"):
        np.testing.assert_array_equal(read_labeled(tmp_path / name, known, wanted).labels, codes)
    for number in (3, 7):
        for column, added in (("user_data", 0), ("point_source_id", 1)):
            found = read_scan(tmp_path / f"{number}.las", labels=column).segment
            np.testing.assert_array_equal(found, codes + added)
    (tmp_path / "m.toml").write_text('column = "layer"\ntable = "kim2023"\n')
    with pytest.raises(InputError, match="layer: has no column of labels"):
        read_labeled(tmp_path / "a.ply", read_class_map(str(tmp_path / "m.toml")), wanted)


def test_maps_of_the_package_and_of_users(tmp_path: Path) -> None:
    """Every map of the package is whole; what a user's map gets wrong is one line."""
    assert set(map_names()) == {"asprs", "kim2023", "parts5", "semanticbridge"}
    for name in map_names():
        assert read_class_map(name).codes
    good = '{"title": "x", "code": [{"id": 3, "name": "pillar", "parts": ["column"]}]}'
    (tmp_path / "m.json").write_text(good)
    assert read_class_map(str(tmp_path / "m.json")).label(3, class_table("kim2023")) == 1
    for text, words in (
        (good.replace("column", "colum"), "unknown part"),
        (good.replace('"id": 3', '"id": 300'), "less than or equal"),
        (good.replace('"parts"', '"part"'), "Did you mean"),
        ("[]", "not a class map"),
        ("{", "not readable as JSON"),
        ('{"title": "x"}', "has no class number"),
        ('{"table": "kim"}', "unknown table"),
        (good.replace('"parts": ["column"]', '"to": {"kim2023": "colum"}'), "unknown class"),
        (good.replace("[{", '[{"id": 3, "name": "pier"}, {'), "occurs twice"),
    ):
        (tmp_path / "m.json").write_text(text)
        with pytest.raises(InputError, match=words):
            read_class_map(str(tmp_path / "m.json"))
    with pytest.raises(MissingError, match=r"no such class map .*semanticbridge"):
        read_class_map("sematicbridge")


def test_hostile_tables_are_one_line(tmp_path: Path) -> None:
    """Arrays that would have to be unpickled, lie about their length, or are no points; text that is none."""
    np.save(tmp_path / "p.npy", np.array([{"a": 1}], object), allow_pickle=True)
    np.save(tmp_path / "w.npy", np.zeros((5, 2)))
    np.save(tmp_path / "n.npy", np.full((5, 3), np.nan))
    np.save(tmp_path / "t.npy", np.zeros((500, 3)))
    whole = (tmp_path / "t.npy").read_bytes()
    (tmp_path / "t.npy").write_bytes(whole.replace(b"(500, 3)", b"(9999999999, 3)").replace(b" " * 9 + b"\n", b" \n"))
    (tmp_path / "l.npy").write_bytes(whole[:-9])
    (tmp_path / "a.xyz").write_text("1 2 3\n1 2\n")
    (tmp_path / "b.xyz").write_bytes(b"\0\1\2\n")
    (tmp_path / "c.xyz").write_text("1 2 3 4 5\n")
    (tmp_path / "d.xyz").write_text("x y q\n1 2 3\n")
    (tmp_path / "e.xyz").write_text("")
    for path in sorted([*tmp_path.glob("*.npy"), *tmp_path.glob("*.xyz")]):
        with pytest.raises(InputError) as caught:
            read_scan(path)
        assert path.name in str(caught.value)
        assert "\n" not in str(caught.value)


def test_an_export_visits_all_points_of_pieces_that_are_drawn_by_class(tmp_path: Path) -> None:
    """A global piece has one draw in an epoch; what is exported of the training holds every point all the same."""
    toy = write_toy(tmp_path / "a", 0, 700, "b0")
    values = {"mode": "paper", "points": 64, "fewest": 1, "stratified": 8, "shares": [1.0, 0.0, 0.0], "noisy": 100.0}
    facts = build_dataset([Source(toy)], tmp_path / "set", dataset_settings("global", values, "test"))
    seen = [
        (row.name, int(one)) for row, _, rows in export._draws(tmp_path / "set", facts, "train", ()) for one in rows
    ]
    assert len(set(seen)) == sum(row.points for row in facts.pieces if row.split == "train") == 700
