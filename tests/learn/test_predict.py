"""Prediction: every point gets the label of its cube, in whatever pieces and units the scan comes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest
from laspy.vlrs.vlrlist import VLRList
from numpy.typing import NDArray

from falsework.cli import main
from groundwork.errors import InputError
from learn.datasets.build import Source, build_dataset
from learn.datasets.frame import Frame, choose_frame, contradiction
from learn.datasets.settings import TileSettings, dataset_settings
from learn.datasets.stored import StoredSplit
from learn.datasets.voxels import add_points, empty_cloud, lay_grid
from learn.instances import connected_parts
from learn.predict.class_sum import sum_classes
from learn.predict.predict import predict_scan, vote
from learn.predict.settings import PredictSettings
from recon.formats.laz import write_laz
from recon.formats.ply import write_ply
from recon.formats.scan import read_scan
from tests.learn.oracle_model import ColorModel
from tests.learn.toy_bridge import toy_cloud, write_toy


def lattice(count: int = 3000, seed: int = 0) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """Give points no two of which share a cube of 0.05 m, shuffled, and a color each; classes are slabs in height."""
    rng = np.random.default_rng(seed)
    cell = rng.choice(40 * 40 * 20, count, replace=False)
    coord = (
        np.column_stack([cell // 800, cell // 20 % 40, cell % 20]) * 0.5 + 0.25 + rng.uniform(-0.01, 0.01, (count, 3))
    )
    color = rng.integers(0, 256, (count, 3)).astype(np.uint8)
    color[:, 0] = np.array([10, 100, 150, 200])[np.minimum((coord[:, 2] / 2.5).astype(int), 3)]
    return coord + np.array([4e5, 5e6, 30.0]), color


def write_las(path: Path, coord: NDArray[np.float64], color: NDArray[np.uint8], **columns: Any) -> Path:
    """Write LAS with a reference system, an extra dimension, odd flags and an appended record."""
    header = laspy.LasHeader(point_format=7, version="1.4")
    header.scales, header.offsets = np.full(3, 0.001), np.array([4e5, 5e6, 0.0])
    header.generating_software, header.system_identifier = "somebody", "a scanner"
    header.add_extra_dim(laspy.ExtraBytesParams("reflectance", np.dtype("f4"), "dB"))
    wkt = 'PROJCS["x",GEOGCS["g",UNIT["degree",0.0174532925199433]],UNIT["metre",1]]'
    header.global_encoding.wkt = True
    header.vlrs.append(laspy.VLR("LASF_Projection", 2112, "wkt", wkt.encode() + b"\0"))
    header.vlrs.append(laspy.VLR("mine", 7, "private", b"\x01\x02\x03"))
    record = laspy.LasData(header)
    record.x, record.y, record.z = coord.T
    record.red, record.green, record.blue = (color.astype(np.uint16) * 257).T
    rng = np.random.default_rng(1)
    record.intensity = rng.integers(0, 65536, len(coord)).astype(np.uint16)
    record.gps_time, record["reflectance"] = rng.random(len(coord)), rng.random(len(coord)).astype(np.float32)
    record.classification = rng.integers(0, 256, len(coord)).astype(np.uint8)
    record.user_data, record.scan_angle = rng.integers(0, 256, len(coord)), rng.integers(-999, 999, len(coord))
    record.synthetic, record.withheld = rng.integers(0, 2, len(coord)), rng.integers(0, 2, len(coord))
    for name, values in columns.items():
        record[name] = values
    if path.suffix == ".las":
        record.evlrs = VLRList([laspy.VLR("mine", 9, "at the end", b"tail")])
    record.write(str(path))
    return path


@pytest.mark.parametrize("kinds", [("las", "las"), ("laz", "laz"), ("laz", "las"), ("las", "laz")])
def test_a_copy_of_las_changes_nothing_but_three_columns(kinds: tuple[str, str], tmp_path: Path) -> None:
    """Every point has the class of its color; every other column, record and header field is as it was, in order."""
    coord, color = lattice()
    source, out = write_las(tmp_path / f"a.{kinds[0]}", coord, color), tmp_path / f"b.{kinds[1]}"
    made = predict_scan(source, out, ColorModel(), PredictSettings())
    before, after = laspy.read(source), laspy.read(out)
    np.testing.assert_array_equal(after["predicted_class"], color[:, 0] // 64)
    np.testing.assert_allclose(after["predicted_confidence"], 0.7, atol=1e-6)
    size = before.point_format.size
    raw = [las.points.array.view(np.uint8).reshape(len(coord), -1)[:, :size] for las in (before, after)]
    np.testing.assert_array_equal(raw[0], raw[1])
    names = set(after.point_format.dimension_names) - set(before.point_format.dimension_names)
    assert names == {"predicted_class", "predicted_confidence", "predicted_instance"}
    for name in (
        "scales",
        "offsets",
        "mins",
        "maxs",
        "system_identifier",
        "generating_software",
        "creation_date",
        "uuid",
        "point_count",
        "number_of_points_by_return",
        "version",
    ):
        assert np.all(getattr(after.header, name) == getattr(before.header, name)), name
    described = [las.header.vlrs.get("ExtraBytesVlr")[0].record_data_bytes() for las in (before, after)]
    assert described[1][: len(described[0])] == described[0]
    own = {"LASF_Spec", "laszip encoded"}
    kept = [
        [
            (v.user_id, v.record_id, v.description, v.record_data_bytes())
            for v in las.header.vlrs
            if v.user_id not in own
        ]
        for las in (before, after)
    ]
    assert kept[0] == kept[1]
    assert len(kept[0]) == 2
    if kinds[0] == "las":
        assert [(v.user_id, v.record_data) for v in after.evlrs or ()] == [("mine", b"tail")]
    assert (made.points, made.thinned, made.unlabelled) == (len(coord), len(coord), 0)
    assert sum(made.counts.values()) == len(coord)


def test_pieces_do_not_matter(tmp_path: Path) -> None:
    """A scan read 97 points at a time gives the same bytes as one read at once, boxes and thinned cubes included."""
    rng = np.random.default_rng(2)
    coord = rng.normal((4e5, 5e6, 30.0), (12.0, 6.0, 3.0), (5000, 3))
    coord[2500:] = coord[:2500] + rng.normal(0, 0.01, (2500, 3))  # cubes with several points
    source = write_las(tmp_path / "a.laz", coord, rng.integers(0, 256, (5000, 3)).astype(np.uint8))
    found = []
    for name, chunk, batch in (("b", 97, 3), ("c", 10**7, 8)):
        settings = PredictSettings(chunk=chunk, batch=batch, fewest=2)
        made = predict_scan(source, tmp_path / f"{name}.las", ColorModel(), settings)
        assert made.thinned < 4000
        assert made.instances > 5
        found.append([(tmp_path / f"{name}{end}").read_bytes() for end in (".las", ".instances.json")])
    assert found[0] == found[1]


def test_prediction_cuts_as_training_does(tmp_path: Path) -> None:
    """The samples that a model is asked about are, bit for bit, those of the test split of the same points."""
    names = [write_toy(tmp_path / f"{i}", i, 4000, f"b{i}") for i in range(3)]
    values = {"points": 256, "fewest": 1, "tile": {"voxel": 0.2}, "test": ["b1"]}
    settings = dataset_settings("local", values, "test")
    (tmp_path / "set").mkdir()
    build_dataset([Source(path) for path in names], tmp_path / "set", settings)
    model = ColorModel(tile=settings.tile, channels=("x", "y", "z", "red", "height"))
    split = StoredSplit(tmp_path / "set", "test", model.channels)
    write_ply(names[1] / "cloud.ply", toy_cloud(1, 4000, "b1"))
    predict_scan(names[1], tmp_path / "out.ply", model, PredictSettings())
    assert len(model.seen) == len(split) > 20
    for index, sample in enumerate(model.seen):
        expected = split.sample(index, 0)
        np.testing.assert_array_equal(sample.coord, expected.coord, strict=True)
        np.testing.assert_array_equal(sample.features, expected.features, strict=True)
        assert (sample.labels == 255).all()


def test_units_and_axes_do_not_matter(tmp_path: Path) -> None:
    """Feet, millimeters, an offset and y up: the model is asked about the same tiles, up to rounding."""
    coord, color = lattice(800)
    coord -= np.array([4e5, 5e6, 30.0])
    asked = []
    turned = np.column_stack([coord[:, 0], coord[:, 2], -coord[:, 1]])  # y up
    for number, (points, given) in enumerate(
        (
            (coord, {"unit": "m"}),
            (coord / 0.3048, {"unit": "ft"}),
            (coord * 1000.0, {"unit": "mm"}),
            (coord / 7.5, {"scale": 7.5}),
            (turned + np.array([0.0, 0.0, 20.0]), {"unit": "m", "up": "y"}),
            (coord + np.array([1e6, 0.0, 500.0]), {"unit": "m"}),
        )
    ):
        model = ColorModel()
        np.save(tmp_path / "a.npy", np.column_stack([points, color]))
        predict_scan(tmp_path / "a.npy", tmp_path / f"b{number}.npy", model, PredictSettings.model_validate(given))
        back = np.load(tmp_path / f"b{number}.npy")
        np.testing.assert_array_equal(back[:, 6], color[:, 0] // 64)
        np.testing.assert_array_equal(back[:, :3], points)
        low = min(float(sample.coord[:, 2].min()) for sample in model.seen)
        high = max(float(sample.coord[:, 2].max()) for sample in model.seen)
        asked.append((low, high))
    np.testing.assert_allclose(asked, [asked[0]] * len(asked), atol=2e-3)


def test_heights_of_another_unit_are_refused(tmp_path: Path) -> None:
    """Meters on the map and feet upwards: refused where a bridge would be stretched; the user's unit holds for all."""
    coord, color = lattice(200)
    path = write_las(tmp_path / "a.las", coord, color)
    scan = laspy.read(path)
    (record,) = [row for row in scan.header.vlrs if row.record_id == 2112]
    feet = 'VERT_CS["v",VERT_DATUM["d",2005],UNIT["US survey foot",0.304800609601219]]'
    record.string = f'COMPD_CS["c",{record.string},{feet}]'
    scan.write(str(path))
    with pytest.raises(InputError, match=r"heights have another unit.*0\.304801 m and 1 m.*--unit"):
        predict_scan(path, tmp_path / "out.las", ColorModel(), PredictSettings())
    found = predict_scan(path, tmp_path / "out.las", ColorModel(), PredictSettings(unit="m"))
    assert found.points == 200


def test_other_formats_are_copied(tmp_path: Path) -> None:
    """PLY of two elements, text with comments, records, or into LAZ: what they held stays, three columns are new."""
    coord, color = lattice(500)
    expected = color[:, 0] // 64
    meters = PredictSettings(unit="m")
    # PLY, positions and colors in elements of their own, and bytes of a third element behind them
    head = (
        b"ply\nformat binary_little_endian 1.0\ncomment kept\nelement vertex 500\nproperty double x\n"
        b"property double y\nproperty double z\nelement color 500\nproperty uchar red\nproperty uchar green\n"
        b"property uchar blue\nend_header\n"
    )
    (tmp_path / "a.ply").write_bytes(head + coord.tobytes() + color.tobytes())
    predict_scan(tmp_path / "a.ply", tmp_path / "b.ply", ColorModel(), meters)
    found = (tmp_path / "b.ply").read_bytes()
    assert found.endswith(color.tobytes())
    assert b"comment kept\n" in found
    rows = np.frombuffer(
        found[found.index(b"end_header\n") + 11 :], [("xyz", "<f8", 3), ("c", "u1"), ("p", "<f4"), ("i", "<u4")], 500
    )
    np.testing.assert_array_equal(rows["xyz"], coord)
    np.testing.assert_array_equal(rows["c"], expected)
    np.testing.assert_array_equal(read_scan(tmp_path / "b.ply").color, color)
    with pytest.raises(InputError, match="already has predictions"):
        predict_scan(tmp_path / "b.ply", tmp_path / "c.ply", ColorModel(), meters)
    # text
    lines = [f"{x:.4f} {y:.4f} {z:.4f} {r} {g} {b}\r\n" for (x, y, z), (r, g, b) in zip(coord, color, strict=True)]
    (tmp_path / "a.xyz").write_text("# a comment\n" + "".join(lines), newline="")
    predict_scan(tmp_path / "a.xyz", tmp_path / "text.xyz", ColorModel(), meters)
    back = (tmp_path / "text.xyz").read_bytes().decode().split("\n")
    assert back[0] == "# x y z red green blue predicted_class predicted_confidence predicted_instance"
    assert back[1] == "# a comment"
    for old, new, label in zip(lines, back[2:], expected, strict=False):
        assert new.startswith(old.strip() + f" {label} 0.7 ")
        assert new.endswith("\r")
    # records
    table = np.zeros(
        500,
        [("x", "f8"), ("y", "f8"), ("z", "f8"), ("red", "u1"), ("green", "u1"), ("blue", "u1"), ("extra", "f4", (2,))],
    )
    for place, name in enumerate("xyz"):
        table[name] = coord[:, place]
    for place, name in enumerate(("red", "green", "blue")):
        table[name] = color[:, place]
    table["extra"] = 3.5
    np.save(tmp_path / "r.npy", table)
    predict_scan(tmp_path / "r.npy", tmp_path / "s.npy", ColorModel(), meters)
    records = np.load(tmp_path / "s.npy")
    for name in table.dtype.names or ():
        np.testing.assert_array_equal(records[name], table[name])
    np.testing.assert_array_equal(records["predicted_class"], expected)
    # whatever it is, into a new LAZ
    predict_scan(tmp_path / "a.ply", tmp_path / "packed.laz", ColorModel(), meters)
    las = laspy.read(tmp_path / "packed.laz")
    np.testing.assert_allclose(np.asarray(las.xyz), coord, atol=0.51e-4)
    np.testing.assert_array_equal(las["predicted_class"], expected)


def test_classes_are_summed_kept_and_doubted(tmp_path: Path) -> None:
    """Components sum into any table, ASPRS codes go into LAS' own field, and what is unsure or unwanted is 255."""
    model = ColorModel(("ground", "column", "pier_cap", "deck_slab"), "falsework")
    table = np.array([[0.1, 0.3, 0.3, 0.3]], np.float32)
    total = sum_classes(model.classes, "falsework", "asprs", ())
    ids, sure = total.decide(table @ total.matrix, 0.0)
    assert (int(ids[0]), float(sure[0])) == (26, pytest.approx(0.6))
    assert int(total.decide(table @ total.matrix, 0.7)[0][0]) == 255
    names = dict(zip(total.names, total.ids.tolist(), strict=True))
    assert set(total.background) == {names["ground"], names["unclassified"], names["noisy_point"]}
    coarse = sum_classes(("background", "column", "noisy_point"), "falsework", "asprs", ())
    assert set(coarse.background) == {names["unclassified"], names["noisy_point"]}
    assert sum_classes(("background", "column", "deck"), "kim2023", "", ()).background == (0, 16)
    coord, color = lattice(600)
    source = write_las(tmp_path / "a.las", coord, color)
    predict_scan(source, tmp_path / "b.las", model, PredictSettings(table="asprs", classes=("bridge_deck",)))
    las = laspy.read(tmp_path / "b.las")
    deck = color[:, 0] // 64 == 3
    np.testing.assert_array_equal(las["predicted_class"], np.where(deck, 17, 255))
    np.testing.assert_array_equal(las.classification, np.where(deck, 17, 1))
    for least, kept in ((0.69, True), (0.71, False)):  # the model is as sure as 0.7 of every point
        made = predict_scan(source, tmp_path / "c.las", model, PredictSettings(min_confidence=least, fewest=1))
        classes = np.asarray(laspy.read(tmp_path / "c.las")["predicted_class"])
        assert ((classes != 255) == kept).all()
        assert (made.unlabelled, made.instances > 0) == (0 if kept else len(classes), kept)
    with pytest.raises(InputError, match="do not determine"):
        sum_classes(("deck",), "kim2023", "falsework", ())
    with pytest.raises(InputError, match=r"unknown table .*'kim'"):
        sum_classes(("deck",), "kim2023", "kim", ())
    with pytest.raises(InputError, match=r"no such class .*'girder'"):
        sum_classes(("deck",), "kim2023", "", ("girder",))


def test_votes_are_held_in_the_classes_of_the_file() -> None:
    """Summed when they are given, they have the columns of the table and the sums of the model's classes."""
    coord, color = lattice(400)
    model = ColorModel(("ground", "column", "pier_cap", "deck_slab"), "falsework", tile=TileSettings(voxel=0.3))
    grid = lay_grid(coord.min(axis=0), coord.max(axis=0), model.tile.voxel)
    cloud = add_points(empty_cloud(grid), coord, {"color": color})
    matrix = sum_classes(model.classes, "falsework", "kim2020", ()).matrix
    found = vote(cloud, model, 8, matrix=matrix)
    assert found.shape == (len(cloud), matrix.shape[1])
    assert np.allclose(found, vote(cloud, model, 8) @ matrix, atol=1e-6)


def test_connected_parts_are_those_of_a_brute_force() -> None:
    """Two points are in one part exactly if a chain of touching cubes of their class leads from one to the other."""
    rng = np.random.default_rng(0)
    coord = rng.uniform(0, 4, (400, 3)) * [1.0, 1.0, 0.3]
    classes = rng.choice([0, 3, 5, 255], 400).astype(np.uint8)
    found = connected_parts(coord, classes, 0.3, 1, (0,))
    cell = np.floor((coord - coord.min(axis=0)) / 0.3).astype(int)
    near = (np.abs(cell[:, None] - cell[None]).max(axis=2) <= 1) & (classes[:, None] == classes[None])
    reach = near.copy()
    for _ in range(9):
        reach = (reach.astype(np.float32) @ reach.astype(np.float32)) > 0
    some = np.isin(classes, (3, 5))
    np.testing.assert_array_equal((found[:, None] == found[None])[some][:, some], reach[some][:, some])
    assert (found[~some] == 0).all()
    assert sorted(set(found[some])) == list(range(1, found.max() + 1))
    count = np.bincount(found)
    large = connected_parts(coord, classes, 0.3, 10, (0,))
    np.testing.assert_array_equal(large > 0, (count[found] >= 10) & some)


def test_boxes_hold_their_instances(tmp_path: Path) -> None:
    """Each box is the smallest one round the points of its instance, in the scan's own coordinates."""
    coord, color = lattice(3000)
    predict_scan(
        write_las(tmp_path / "a.las", coord, color), tmp_path / "b.las", ColorModel(), PredictSettings(link=1.0)
    )
    las = laspy.read(tmp_path / "b.las")
    stored = json.loads((tmp_path / "b.instances.json").read_text())
    ids = np.asarray(las["predicted_instance"])
    assert {row["id"] for row in stored["instances"]} == set(ids) - {0}
    xyz = np.asarray(las.xyz)
    for row in stored["instances"]:
        mine = ids == row["id"]
        np.testing.assert_array_equal(row["low"], xyz[mine].min(axis=0))
        np.testing.assert_array_equal(row["high"], xyz[mine].max(axis=0))
        assert row["points"] == mine.sum()
        assert set(np.asarray(las["predicted_class"])[mine]) == {row["class_id"]}
        assert row["class"] == ("background", "column", "pier_cap", "deck")[row["class_id"]]
    assert {row["class"] for row in stored["instances"]} == {"column", "pier_cap", "deck"}
    coarse = ColorModel(tile=TileSettings(voxel=0.5))  # more than the usual 0.3 m: twice that by default
    chosen = [PredictSettings(), PredictSettings(link=1.0)]
    made = [predict_scan(tmp_path / "a.las", tmp_path / "c.las", coarse, one).instances for one in chosen]
    assert made[0] == made[1] > 0


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`falsework predict` labels a cloud's folder, asks for a unit where none is known, and names what is wrong."""
    folder = write_toy(tmp_path / "cloud", 1, 3000)
    write_laz(folder / "cloud.laz", toy_cloud(1, 3000))
    model = ("--model", "tests.learn.oracle_model:color_model")

    def run(*words: object) -> int:
        with pytest.raises(SystemExit) as caught:
            main(["predict", *(str(word) for word in words)])
        assert isinstance(caught.value.code, int)
        return caught.value.code

    assert run(folder, "-o", tmp_path / "out.laz", *model) == 0
    assert "points" in capsys.readouterr().out
    assert "predicted_class" in laspy.read(tmp_path / "out.laz").point_format.dimension_names
    np.savetxt(tmp_path / "a.xyz", np.random.default_rng(0).uniform(0, 9, (50, 3)))
    np.save(tmp_path / "b.npy", np.zeros((9, 6)))
    cases: list[tuple[tuple[object, ...], str]] = [
        ((tmp_path / "b.npy", "-o", tmp_path / "c.npy", *model), "does not state the unit"),
        ((tmp_path / "a.xyz", "-o", tmp_path / "c.xyz", "--unit", "m", *model), "no column color"),
        ((folder, "-o", tmp_path / "c.txt", *model), "can be copied as"),
        ((tmp_path / "a.xyz", "-o", tmp_path / "c.ply", *model), "not the format of the scan"),
        ((tmp_path / "a.xyz", "-o", tmp_path / "a.xyz", *model), "the scan itself"),
        ((tmp_path / "nothing.laz", "-o", tmp_path / "c.laz", *model), "no such file"),
        ((folder, "-o", tmp_path / "c.laz", "--model", "nowhere:x"), "no such model"),
        ((folder, "-o", tmp_path / "c.laz", "--model", "json:dumps"), "model"),
        ((folder, "-o", tmp_path / "c.laz", *model, "--table", "falsework"), "do not determine"),
        ((folder, "-o", tmp_path / "c.laz", *model, "--link", "0.01"), "smaller than the model's voxel"),
        ((folder, "-o", tmp_path / "c.laz", *model, "--unit", "m", "--scale", "2.0"), "both a unit and a scale"),
        ((folder, "-o", tmp_path / "c.laz", *model, "--min-confidence", "1.5"), "falsework: --min-confidence: "),
        ((folder, "-o", tmp_path / "c.laz", "--model", "builtins:dict"), "an object that is not a model"),
    ]
    for words, said in cases:
        assert run(*words) == 2, words
        error = capsys.readouterr().err
        assert said in error, error
        assert len([line for line in error.strip().split("\n") if line.startswith("falsework:")]) == 1
    assert not (tmp_path / "c.npy").exists()


def test_another_unit_than_the_scans_is_doubted() -> None:
    """Two ways to say a foot are one; a meter that is called a foot is named; a scan that says nothing is believed."""
    turn = np.eye(3)
    assert contradiction(None, Frame(0.3048, turn)) == ""
    assert contradiction(1200 / 3937, Frame(0.3048, turn)) == ""
    assert "the scan states a unit of 1 m, and you gave 0.3048 m" in contradiction(1.0, Frame(0.3048, turn))
    with pytest.raises(InputError, match="longitudes and latitudes"):
        choose_frame(0.0, PredictSettings(), "scan.laz")
