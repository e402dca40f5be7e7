"""The cloud on disk comes back as it was written, damage is found, and other programs' files hold the same points."""

import dataclasses
import json
import shutil
import struct
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest

from groundwork.canonical import folder_digest
from groundwork.errors import InputError, MissingError
from recon.cloud import (
    COLUMNS,
    OBSERVATION_COLUMNS,
    RECONSTRUCTED,
    Cloud,
    read_cloud,
    segment_with_noise,
    without_observations,
    write_cloud,
)
from recon.formats.laz import LAZ_SCALE, write_laz
from recon.formats.ply import write_ply
from usd_schemas.components import ClassRow, class_rows


@pytest.fixture
def cloud() -> Cloud:
    """Make a cloud of 500 points with random content, some of it infinite or unknown."""
    rng = np.random.default_rng(1)
    counts = rng.integers(2, 6, 500)
    total = int(counts.sum())
    columns = {
        name: (rng.random((500, kind.width)) * 100).astype(kind.dtype).reshape(500, *(kind.width,)[: kind.width - 1])
        for name, kind in COLUMNS.items()
    }
    columns["coord"] = rng.normal((4e5, 5e6, 0), 300, (500, 3))
    columns["component"] = rng.integers(0, 3, 500).astype(np.uint16)
    columns["instance"] = rng.integers(0, 2**32, 500).astype(np.uint32)
    columns["segment"] = rng.choice([0, 4, 9, 15, 255], 500).astype(np.uint8)
    columns["uncertainty"][:3] = np.inf, np.nan, 0.1
    observations = {
        name: (rng.random((total, kind.width)) * 7).astype(kind.dtype).reshape(total, *(kind.width,)[: kind.width - 1])
        for name, kind in OBSERVATION_COLUMNS.items()
    }
    observations["start"] = np.concatenate([[0], np.cumsum(counts)])
    cameras = tuple(
        {"name": f"{i:06d}", "status": "ok", "center_error": 0.01, "rotation_error": None} for i in range(7)
    )
    return Cloud(columns, observations, ("", "girder", "kerb"), class_rows(), {"scale": 2.0}, cameras, {"points": 500})


def test_round_trip(cloud: Cloud, tmp_path: Path) -> None:
    """Every array comes back bit for bit, every table equal; and the same cloud makes the same bytes."""
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        write_cloud(tmp_path / name, cloud)
        write_laz(tmp_path / name / "cloud.laz", cloud)
        write_ply(tmp_path / name / "cloud.ply", cloud)
    back = read_cloud(tmp_path / "a")
    for field in ("columns", "observations"):
        for name, values in getattr(cloud, field).items():
            np.testing.assert_array_equal(getattr(back, field)[name], values, strict=True)
    for field in ("components", "classes", "alignment", "cameras", "statistics"):
        assert getattr(back, field) == getattr(cloud, field)
    assert folder_digest(tmp_path / "a") == folder_digest(tmp_path / "b")
    described = json.loads((tmp_path / "a" / "cloud.json").read_text())["columns"]
    assert described["uncertainty"]["unit"] == "m"
    assert all(row["meaning"].endswith(".") for row in described.values())


def _cut(folder: Path) -> None:
    path = folder / "coord.npy"
    path.write_bytes(path.read_bytes()[:-9])


def _replace(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Path], None]:
    return lambda folder: np.save(folder / name, change(np.load(folder / name)))


def _to_nan(values: np.ndarray) -> np.ndarray:
    values[3, 1] = np.nan
    return values


def _promise(folder: Path) -> None:
    """Say that there are 218 TB of coordinates."""
    head = BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": (10**13, 3)})
    (folder / "coord.npy").write_bytes(head.getvalue() + bytes(64))


def _archive(folder: Path) -> None:
    np.savez(folder / "a.npz", np.zeros(3))
    (folder / "a.npz").rename(folder / "segment.npy")


def _no_views(values: np.ndarray) -> np.ndarray:
    values[9] = values[8]
    return values


@pytest.mark.parametrize(
    ("damage", "named"),
    [
        (_cut, "coord.npy"),
        (_promise, "coord.npy"),
        (_archive, "segment.npy"),
        (lambda folder: (folder / "normal.npy").unlink(), "normal.npy"),
        (lambda folder: (folder / "cloud.json").unlink(), "cloud.json"),
        (_replace("coord.npy", _to_nan), "coord.npy"),
        (_replace("segment.npy", lambda values: values[1:]), "segment.npy"),
        (_replace("uncertainty.npy", lambda values: values.astype(np.float64)), "uncertainty.npy"),
        (_replace("component.npy", lambda values: values + np.uint16(3)), "component.npy"),
        (_replace("observations/start.npy", lambda values: values[::-1].copy()), "start.npy"),
        (_replace("observations/start.npy", lambda values: _no_views(values)), "start.npy"),
        (_replace("observations/image.npy", lambda values: values + np.uint32(7)), "image.npy"),
    ],
)
def test_damage_is_named(cloud: Cloud, tmp_path: Path, damage: Callable[[Path], None], named: str) -> None:
    """A cut, missing, retyped, shortened or impossible column is one line that names the file."""
    write_cloud(tmp_path, cloud)
    damage(tmp_path)
    with pytest.raises(InputError, match=named) as error:
        read_cloud(tmp_path)
    assert "\n" not in str(error.value)


def places_in(value: object, above: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
    """List the path of every value in JSON."""
    rows = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [place for key, below in rows for place in [(*above, key), *places_in(below, (*above, key))]]


def test_no_lie_in_the_description_does_harm(cloud: Cloud, tmp_path: Path) -> None:
    """Whatever stands in the place of one value: a cloud whose parts are what they should be, or one line."""
    write_cloud(tmp_path, cloud)
    path = tmp_path / "cloud.json"
    good = json.loads(path.read_text())
    lean = {**good, "columns": dict.fromkeys(good["columns"], 0), "cameras": good["cameras"][:7]}
    lean["classes"] = good["classes"][:2]
    said, places = list[str](), places_in(lean)
    for number, place in enumerate(places):
        bad = json.loads(json.dumps(lean))
        holder = bad
        for key in place[:-1]:
            holder = holder[key]
        holder[place[-1]] = [None, -1, "x", [], {}, 1e300, True, [[]], {"id": 300}][number % 9]
        path.write_text(json.dumps(bad))
        try:
            back = read_cloud(tmp_path)
        except InputError as error:
            said.append(str(error))
            continue
        assert all(isinstance(name, str) for name in back.components)
        assert all(0 <= row.id < 256 and isinstance(row.name, str) for row in back.classes)
        assert all(isinstance(row["name"], str) for row in back.cameras)
        assert isinstance(back.statistics, dict)
        assert isinstance(back.alignment, dict)
    assert len(said) > 0.3 * len(places)
    assert not [line for line in said if "\n" in line]


def test_other_folders_are_not_clouds(tmp_path: Path) -> None:
    """An empty folder, or a cloud of another version."""
    with pytest.raises(MissingError):
        read_cloud(tmp_path)
    (tmp_path / "cloud.json").write_text('{"format": "falsework.cloud", "format_version": 99}')
    with pytest.raises(InputError, match="99"):
        read_cloud(tmp_path)


def test_only_samplers_make_points_that_nobody_observed(cloud: Cloud, tmp_path: Path) -> None:
    """Optional columns and a source come back; a reconstructed point without an observation is refused."""
    unseen = dataclasses.replace(cloud, observations=without_observations(500), source="lidar-terrestrial")
    columns = {**cloud.columns, "intensity": np.linspace(0, 1, 500, dtype=np.float32)}
    columns["station"] = np.arange(500, dtype=np.uint16)
    (tmp_path / "a").mkdir()
    write_cloud(tmp_path / "a", dataclasses.replace(unseen, columns=columns))
    back = read_cloud(tmp_path / "a")
    assert back.source == "lidar-terrestrial"
    assert set(back.columns) == {*COLUMNS, "intensity", "station"}
    np.testing.assert_array_equal(back.columns["intensity"], columns["intensity"], strict=True)
    assert not len(back.observations["image"])
    assert set(json.loads((tmp_path / "a" / "cloud.json").read_text())["columns"]) == set(back.columns)
    for source in RECONSTRUCTED:
        with pytest.raises(InputError, match="start"):
            write_cloud(tmp_path, dataclasses.replace(unseen, source=source))
    with pytest.raises(InputError, match=r"source.*satellite.*sfm-dense"):
        write_cloud(tmp_path, dataclasses.replace(unseen, source="satellite"))
    (tmp_path / "a" / "station.npy").unlink()
    with pytest.raises(InputError, match="station"):
        read_cloud(tmp_path / "a")


def test_clouds_of_the_first_version_are_read(cloud: Cloud, tmp_path: Path) -> None:
    """They say no source, as all were sparse reconstructions; those of the second version say no bridge."""
    write_cloud(tmp_path, dataclasses.replace(cloud, source="sfm-dense", bridge="ab"))
    stored = json.loads((tmp_path / "cloud.json").read_text())
    assert (stored.pop("bridge"), stored["format_version"]) == ("ab", 3)
    (tmp_path / "cloud.json").write_text(json.dumps({**stored, "format_version": 2}))
    assert (read_cloud(tmp_path).source, read_cloud(tmp_path).bridge) == ("sfm-dense", "")
    assert stored.pop("source") == "sfm-dense"
    (tmp_path / "cloud.json").write_text(json.dumps({**stored, "format_version": 1}))
    assert read_cloud(tmp_path).source == "sfm-sparse"


def test_noise_is_made_on_read(cloud: Cloud) -> None:
    """Above the threshold and infinite are noisy, at the threshold and unknown are not; the cloud itself stays."""
    before = cloud.columns["segment"].copy()
    noisy = segment_with_noise(cloud, float(np.float32(0.1)))
    assert (noisy[:3] == 16).tolist() == [True, False, False]
    np.testing.assert_array_equal(noisy == 16, cloud.columns["uncertainty"] > np.float32(0.1))
    np.testing.assert_array_equal(cloud.columns["segment"], before)


def test_laz_holds_the_points(cloud: Cloud, tmp_path: Path) -> None:
    """Positions to the tenth of a millimeter, classes, colors and extra dimensions, the class table, a forced date."""
    write_laz(tmp_path / "cloud.laz", cloud)
    back = laspy.read(tmp_path / "cloud.laz")
    assert (str(back.header.version), back.header.point_format.id) == ("1.4", 7)
    assert str(back.header.creation_date) == "2000-01-01"
    assert np.abs(back.xyz - cloud.columns["coord"]).max() <= LAZ_SCALE / 2 + 1e-9
    for name in ("segment", "instance", "component", "uncertainty", "confidence", "n_views"):
        np.testing.assert_array_equal(np.asarray(back[name]), cloud.columns[name], strict=True)
    colors = np.column_stack([np.asarray(back[name]) for name in ("red", "green", "blue")])
    np.testing.assert_array_equal(colors // 257, cloud.columns["color"])
    codes = {0: 64, 4: 68, 9: 73, 15: 79, 255: 1}
    assert np.asarray(back.classification).tolist() == [codes[value] for value in cloud.columns["segment"].tolist()]
    table = next(vlr for vlr in back.header.vlrs if type(vlr).__name__ == "ClassificationLookupVlr")
    assert (table[73], table[68]) == ("deck", "bearing")


def test_ply_holds_the_points(cloud: Cloud, tmp_path: Path) -> None:
    """A reader that knows only the header finds the same numbers."""
    write_ply(tmp_path / "cloud.ply", cloud)
    data = (tmp_path / "cloud.ply").read_bytes()
    head, body = data.split(b"end_header\n", 1)
    lines = head.decode().splitlines()
    assert lines[:3] == ["ply", "format binary_little_endian 1.0", "element vertex 500"]
    codes = {"double": "d", "float": "f", "uchar": "B", "int": "i", "uint": "I"}
    names = [line.split()[2] for line in lines[3:]]
    layout = struct.Struct("<" + "".join(codes[line.split()[1]] for line in lines[3:]))
    rows = np.array(list(layout.iter_unpack(body)))
    assert rows.shape == (500, len(names))
    np.testing.assert_array_equal(rows[:, :3], cloud.columns["coord"])
    for name in ("segment", "instance", "uncertainty", "n_views", "displacement"):
        np.testing.assert_array_equal(rows[:, names.index(name)], cloud.columns[name].astype(float))
    assert names[3:9] == ["nx", "ny", "nz", "red", "green", "blue"]


ODD_ROW: Any = (1, "deck", None)  # its color is no list


@pytest.mark.parametrize("part", ["columns", "observations"])
def test_a_cloud_without_a_column_is_not_written(cloud: Cloud, tmp_path: Path, part: str) -> None:
    """Whichever column or observation is left out, the error names its file, and nothing reaches the disk."""
    kinds = {"columns": COLUMNS, "observations": OBSERVATION_COLUMNS}[part]
    for name in kinds:
        left = {other: values for other, values in getattr(cloud, part).items() if other != name}
        changed: dict[str, Any] = {part: left}
        with pytest.raises(InputError, match=rf"{name}\.npy.*a column is missing"):
            write_cloud(tmp_path, dataclasses.replace(cloud, **changed))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("part", "name", "value", "named"),
    [
        ("columns", "segment", np.zeros(499, np.uint8), r"segment\.npy: segment: .*found 'uint8 \(499,\)'"),
        ("columns", "segment", [0] * 500, r"segment\.npy: segment: a column is not an array \(found 'list'\)"),
        ("columns", "coord", 7.0, r"coord\.npy: coord: a column is not an array \(found 'float'\)"),
        ("columns", "intensity", [0.0] * 500, r"intensity\.npy: intensity: a column is not an array"),
        ("observations", "image", np.float32(7.0), r"image\.npy: image: a column is not an array"),
        ("statistics", "noise", {"median": float("nan")}, r"cloud\.json: statistics\.noise: has no form in JSON: "),
        ("alignment", "scale", np.ones(3), r"cloud\.json: alignment\.scale: has no form in JSON"),
        ("cameras", 0, {"name": "a", "center_error": float("inf")}, r"cloud\.json: cameras\.0: has no form in JSON"),
        ("cameras", 0, {"name": 7}, r"cloud\.json: cameras: of a wrong kind"),
        ("classes", 1, ClassRow(300, "deck", (0, 0, 0)), r"cloud\.json: classes: of a wrong kind, or out of range"),
        ("components", 1, 7, r"cloud\.json: components: of a wrong kind"),
    ],
)
def test_an_odd_cloud_is_not_written(
    cloud: Cloud, tmp_path: Path, part: str, name: str | int, value: object, named: str
) -> None:
    """Neither columns nor figures that no reader would accept reach the disk: one line names the column or key."""
    known = getattr(cloud, part)
    odd: dict[str, Any] = {
        part: (*known[:name], value, *known[name + 1 :]) if isinstance(name, int) else {**known, name: value}
    }
    with pytest.raises(InputError, match=rf"^{tmp_path}/.*{named}"):
        write_cloud(tmp_path, dataclasses.replace(cloud, **odd))
    assert not list(tmp_path.iterdir())
    shutil.rmtree(tmp_path)


@pytest.mark.parametrize(
    ("field", "value", "named"),
    [
        ("cameras", [{"x": 1}], r"cameras: of a wrong kind \(found \[{'x': 1}\]\); allowed: a tuple of dicts"),
        ("cameras", ["a"], "cameras: of a wrong kind"),
        ("cameras", [None], "cameras: of a wrong kind"),
        ("cameras", None, "cameras: of a wrong kind"),
        ("classes", None, "classes: of a wrong kind"),
        ("classes", [{"id": 1}], "classes: of a wrong kind .*; allowed: a tuple of ClassRow"),
        ("classes", [ClassRow(*ODD_ROW)], "classes: of a wrong kind, or out of range"),
        ("columns", None, r"columns: of a wrong kind; allowed: a dict from name to array"),
        ("columns", {1: None, "x": None}, "columns: not a column of the format"),
        ("observations", [1], "observations: of a wrong kind"),
        ("components", "abc", "components: of a wrong kind"),
        ("alignment", None, "alignment: of a wrong kind"),
        ("statistics", 5, "statistics: of a wrong kind"),
        ("source", None, "source: of a wrong kind"),
        ("bridge", 5, "bridge: of a wrong kind"),
        ("statistics", {"mean": np.float32(0.5)}, r"statistics\.mean: has no form in JSON: .*with float\(\)"),
    ],
)
def test_a_field_of_another_type_is_one_line(
    cloud: Cloud, tmp_path: Path, field: str, value: object, named: str
) -> None:
    """It names the field, and what it should be."""
    given: dict[str, Any] = {field: value}
    with pytest.raises(InputError, match=named) as caught:
        write_cloud(tmp_path, dataclasses.replace(cloud, **given))
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_a_column_of_another_type_says_how_to_convert_it(cloud: Cloud, tmp_path: Path) -> None:
    """To a script, nothing about a reconstruction."""
    for column, hint in (
        (np.zeros(500, np.int64), r'uint8 \(500,\)\. Convert it with astype\("uint8"\)$'),
        (np.zeros(3, np.uint8), "Give one row for each point$"),
    ):
        with pytest.raises(InputError, match=hint):
            write_cloud(tmp_path, dataclasses.replace(cloud, columns={**cloud.columns, "segment": column}))
