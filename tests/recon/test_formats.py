"""Every export comes back, number for number, through somebody else's reader where one exists; same bytes each time."""

import dataclasses
import json
from pathlib import Path

import laspy
import numpy as np
import pycolmap
import pytest
import trimesh
from numpy.typing import NDArray

from groundwork.canonical import folder_digest
from groundwork.errors import InputError
from recon.cloud import COLUMNS, Cloud, read_cloud, without_observations, write_cloud
from recon.formats.export import EXPORTS, export_cloud
from recon.formats.hdf5 import write_hdf5
from recon.formats.laz import write_laz
from recon.formats.scan import open_scan, read_scan, stated_unit
from usd_schemas.components import ClassRow, class_rows
from usd_schemas.raycast import load_open3d

F64 = NDArray[np.float64]
COUNT = 800


def sampled_cloud(place: tuple[float, float, float] = (4e5, 5e6, 30.0)) -> Cloud:
    """Make a scanned cloud of random content without observations, far from the origin."""
    rng = np.random.default_rng(5)
    columns = {
        name: (rng.random((COUNT, kind.width)) * 9)
        .astype(kind.dtype)
        .reshape(COUNT, *((kind.width,) if kind.width > 1 else ()))
        for name, kind in COLUMNS.items()
    }
    columns["coord"] = rng.normal(place, 20.0, (COUNT, 3))
    normals = rng.normal(size=(COUNT, 3))
    columns["normal"] = (normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32)
    columns["component"] = rng.integers(0, 2, COUNT).astype(np.uint16)
    columns["segment"] = rng.choice([0, 9, 12, 255], COUNT).astype(np.uint8)
    columns["instance"] = rng.choice([0, 3, 70_000], COUNT).astype(np.uint32)
    columns["intensity"] = rng.random(COUNT).astype(np.float32)
    columns["station"] = rng.integers(0, 4, COUNT).astype(np.uint16)
    columns["uncertainty"][:2] = np.inf, np.nan
    return Cloud(columns, without_observations(COUNT), ("", "deck_slab"), class_rows(), {}, (), {}, "lidar-terrestrial")


@pytest.fixture
def source(tmp_path: Path) -> Path:
    """Give a scanned cloud on disk."""
    folder = tmp_path / "cloud"
    folder.mkdir()
    write_cloud(folder, sampled_cloud())
    return folder


@pytest.fixture
def reconstructed(tmp_path: Path) -> Path:
    """Give a cloud with the COLMAP model that it came from, made by COLMAP itself."""
    options = pycolmap.SyntheticDatasetOptions(num_points3D=60, num_rigs=1, num_cameras_per_rig=1, num_frames_per_rig=5)
    pycolmap.set_random_seed(3)
    model = pycolmap.synthesize_dataset(options)
    folder = tmp_path / "sfm"
    (folder / "sparse").mkdir(parents=True)
    (tmp_path / "capture" / "images").mkdir(parents=True)
    for number, image in enumerate(sorted(model.images.values(), key=lambda image: image.image_id)):
        image.name = f"images/{number:06d}.jpg"
        (tmp_path / "capture" / image.name).write_bytes(b"\xff\xd8\xff" + f"photo {number}".encode())
    model.write_binary(str(folder / "sparse"))
    cloud = sampled_cloud((0.0, 0.0, 0.0))
    write_cloud(folder, dataclasses.replace(cloud, source="mesh"))  # a source without observations is enough here
    return folder


def export(source: Path, to: str, photographs: Path | None = None) -> Path:
    """Export into a new folder beside the cloud."""
    out = source.parent / f"out-{to}"
    out.mkdir()
    for file in export_cloud(source, to, out, photographs):
        assert (out / file).exists()
    return out


@pytest.mark.parametrize("to", ["laz", "las"])
def test_las(source: Path, to: str) -> None:
    """Laspy finds LAS 1.4, format 7, the fields that LAS has for them, the class table, and a forced date."""
    cloud = read_cloud(source)
    path = export(source, to) / f"cloud.{to}"
    back = laspy.read(path)
    assert (str(back.header.version), back.header.point_format.id, back.header.point_count) == ("1.4", 7, COUNT)
    assert back.header.are_points_compressed == (to == "laz")
    assert back.header.global_encoding.wkt
    assert str(back.header.creation_date) == "2000-01-01"
    assert np.abs(back.xyz - cloud.columns["coord"]).max() <= 0.5e-4 + 1e-9
    for name in ("segment", "instance", "component", "uncertainty", "confidence", "n_views"):
        np.testing.assert_array_equal(np.asarray(back[name]), cloud.columns[name], strict=True)
    np.testing.assert_allclose(np.asarray(back.intensity) / 65535, cloud.columns["intensity"], atol=1e-5)
    np.testing.assert_array_equal(np.asarray(back.point_source_id), cloud.columns["station"] + 1)
    assert (np.asarray(back.number_of_returns) == 1).all()
    table = next(vlr for vlr in back.header.vlrs if type(vlr).__name__ == "ClassificationLookupVlr")
    assert (table[73], table[64]) == ("deck", "background")
    assert b"\x4cpier_cap\0" in path.read_bytes()  # laspy drops the underscore


def test_las_says_its_unit_where_there_is_one(source: Path) -> None:
    """Our reader takes the meter from the reference system; a cloud that nothing brought to scale says no unit.

    The record stands in the header beside the class table, and the file has the same bytes each time.
    """
    first = export(source, "laz") / "cloud.laz"
    with open_scan(first) as stream:
        assert stream.unit == 1.0
    header = laspy.read(first).header
    assert [vlr.record_id for vlr in header.vlrs if vlr.user_id == "LASF_Projection"] == [2112]
    cloud = dataclasses.replace(sampled_cloud(), alignment={"target": "none"})
    write_laz(source.parent / "free.laz", cloud)
    with open_scan(source.parent / "free.laz") as stream:
        assert stream.unit is None
    write_laz(source.parent / "again.laz", sampled_cloud())
    assert (source.parent / "again.laz").read_bytes() == first.read_bytes()


def test_every_class_id_has_its_own_code_in_las(tmp_path: Path) -> None:
    """Ids 0 to 191 come back from `segment` and, as 64 + id, from `classification` and the table; 255 is 1."""
    ids = np.array([*range(192), 255], np.uint8)
    cloud = sampled_cloud()
    columns = {**cloud.columns, "segment": np.resize(ids, COUNT)}
    rows = tuple(ClassRow(int(i), f"brücke_{i}", (0, 0, 0)) for i in ids)
    write_laz(tmp_path / "a.las", dataclasses.replace(cloud, columns=columns, classes=rows), compress=False)
    scan = read_scan(tmp_path / "a.las")
    np.testing.assert_array_equal(scan.segment, columns["segment"])
    expected = np.where(columns["segment"] == 255, 1, 64 + columns["segment"].astype(int))
    np.testing.assert_array_equal(scan.classification, expected)
    assert scan.class_names == {64 + i: f"br?cke_{i}" for i in range(192)}


@pytest.mark.parametrize("number", [192, 254])
def test_las_refuses_a_class_without_a_code(tmp_path: Path, number: int) -> None:
    """A larger id, of a point or of the table alone, would share its code: the error names it, and no file is left."""
    cloud = sampled_cloud()
    segment = cloud.columns["segment"].copy()
    segment[7] = number
    points = dataclasses.replace(cloud, columns={**cloud.columns, "segment": segment})
    table = dataclasses.replace(cloud, classes=(*class_rows(), ClassRow(number, "lamp", (0, 0, 0))))
    for odd in (points, table):
        with pytest.raises(InputError, match=f"class id.*{number}.*0 to 191.*ply or hdf5"):
            write_laz(tmp_path / "a.laz", odd)
    assert not list(tmp_path.iterdir())


def test_a_cloud_states_its_unit_only_where_it_has_one(source: Path, tmp_path: Path) -> None:
    """The folder of a cloud that nothing brought to scale states no unit, from its description alone."""
    assert stated_unit(source) == 1.0
    (tmp_path / "free").mkdir()
    write_cloud(tmp_path / "free", dataclasses.replace(sampled_cloud(), alignment={"target": "none"}))
    with open_scan(tmp_path / "free") as stream:
        assert stream.unit is None
    for file in (tmp_path / "free").glob("*.npy"):
        file.unlink()
    assert stated_unit(tmp_path / "free") is None
    (tmp_path / "free" / "cloud.json").write_text('{"format": "falsework.cloud", "format_version": 3, "alignment": 5}')
    with pytest.raises(InputError, match="alignment"):
        stated_unit(tmp_path / "free")
    with pytest.raises(InputError, match=r"no cloud\.json"):
        stated_unit(tmp_path)


def test_las_of_a_wide_cloud_takes_a_coarser_scale(source: Path, tmp_path: Path) -> None:
    """Where 32 bits do not reach over 2000 km in tenths of a millimeter, the scale grows instead of wrapping round."""
    cloud = sampled_cloud()
    wide = {**cloud.columns, "coord": cloud.columns["coord"] * [1.0, 1e5, 1.0]}
    (tmp_path / "wide").mkdir()
    write_cloud(tmp_path / "wide", dataclasses.replace(cloud, columns=wide))
    back = laspy.read(export(tmp_path / "wide", "laz") / "cloud.laz")
    step = back.header.scales[1]
    assert step > 1e-4
    assert np.abs(back.xyz - wide["coord"]).max() <= step


def test_ply(source: Path) -> None:
    """Two readers that know nothing of us find positions, normals, colors and every further column."""
    cloud = read_cloud(source)
    path = export(source, "ply") / "cloud.ply"
    mesh = trimesh.load(path, process=False)
    assert isinstance(mesh, trimesh.PointCloud)
    np.testing.assert_array_equal(mesh.vertices, cloud.columns["coord"])
    np.testing.assert_array_equal(np.asarray(mesh.colors)[:, :3], cloud.columns["color"])
    o3d = load_open3d()
    points = o3d.t.io.read_point_cloud(str(path)).point
    np.testing.assert_array_equal(points["positions"].numpy(), cloud.columns["coord"])
    np.testing.assert_array_equal(points["normals"].numpy(), cloud.columns["normal"])
    for name in ("segment", "instance", "uncertainty", "intensity", "station"):
        np.testing.assert_array_equal(points[name].numpy().ravel(), cloud.columns[name])


def test_hdf5(source: Path) -> None:
    """H5py finds every column with its unit, and the class table."""
    h5py = pytest.importorskip("h5py")
    cloud = read_cloud(source)
    with h5py.File(export(source, "hdf5") / "cloud.h5") as file:
        assert set(file) == {*cloud.columns, "observations"}
        for name, values in cloud.columns.items():
            np.testing.assert_array_equal(file[name][:], values, strict=True)
        for name, values in cloud.observations.items():
            np.testing.assert_array_equal(file["observations"][name][:], values, strict=True)
        assert file["uncertainty"].attrs["unit"] == "m"
        assert file.attrs["source"] == "lidar-terrestrial"
        assert {row["name"] for row in json.loads(file.attrs["classes"])} >= {"deck", "pier_cap"}
    write_hdf5(source.parent / "loose.h5", dataclasses.replace(cloud, alignment={"target": "none", "unit": "unknown"}))
    with h5py.File(source.parent / "loose.h5") as file:  # photographs that nothing placed
        units = {name: file[name].attrs["unit"] for name in ("coord", "displacement", "reprojection_error")}
        assert units == {"coord": "unknown", "displacement": "unknown", "reprojection_error": "px"}


def test_pointcept(source: Path) -> None:
    """The arrays that Pointcept's dataset looks for, in its types; nothing known is -1; the origin is kept."""
    cloud = read_cloud(source)
    scene = export(source, "pointcept") / "train" / "bridge_1"
    arrays = {path.stem: np.load(path) for path in sorted(scene.glob("*.npy"))}
    assert set(arrays) == {"coord", "color", "normal", "segment", "instance", "strength", "uncertainty"}
    kinds = {name: values.dtype.name for name, values in arrays.items()}
    assert (kinds["coord"], kinds["color"], kinds["segment"], kinds["instance"]) == (
        "float32",
        "uint8",
        "int32",
        "int32",
    )
    facts = json.loads((scene / "scene.json").read_text())
    np.testing.assert_allclose(arrays["coord"] + np.array(facts["origin"]), cloud.columns["coord"], atol=1e-5)
    segment = cloud.columns["segment"].astype(int)
    np.testing.assert_array_equal(arrays["segment"], np.where(segment == 255, -1, segment))
    instance = cloud.columns["instance"].astype(int)
    np.testing.assert_array_equal(arrays["instance"], np.where(instance == 0, -1, instance))
    assert facts["classes"]["12"] == "pier_cap"
    assert arrays["strength"].shape == (COUNT, 1)
    (source.parent / "out-pointcept").rename(source.parent / "former")
    np.save(source / "instance.npy", np.full(COUNT, 2**32 - 1, np.uint32))
    with pytest.raises(InputError, match="int32"):
        export(source, "pointcept")


def test_s3dis(source: Path) -> None:
    """The room's file holds all points; the annotations, read as S3DIS readers do, bring back class and instance."""
    cloud = read_cloud(source)
    out = export(source, "s3dis")
    room = out / "Area_1" / "bridge_1"
    origin = np.array(json.loads((out / "origin.json").read_text())["origin"])
    table = np.loadtxt(room / "bridge_1.txt")
    np.testing.assert_allclose(table[:, :3] + origin, cloud.columns["coord"], atol=0.51e-4)
    np.testing.assert_array_equal(table[:, 3:], cloud.columns["color"])
    ids = {line.split()[1]: int(line.split()[0]) for line in (out / "classes.txt").read_text().splitlines()}
    found = []
    for path in sorted((room / "Annotations").glob("*.txt")):
        name, number = path.stem.split("_")  # as every reader of S3DIS does
        points = np.loadtxt(path, ndmin=2)
        found.append(np.column_stack([points, np.tile([ids[name], int(number)], (len(points), 1))]))
    back = np.concatenate(found)
    expected = np.column_stack([table, cloud.columns["segment"], cloud.columns["instance"]])
    np.testing.assert_array_equal(back[np.lexsort(back.T)], expected[np.lexsort(expected.T)])
    assert len(found) == len(np.unique(expected[:, 6:], axis=0))


def test_colmap(reconstructed: Path) -> None:
    """COLMAP reads the model; poses, tracks and points are those of the cloud's, images are named as in `images`."""
    out = export(reconstructed, "colmap", reconstructed.parent / "capture")
    before = pycolmap.Reconstruction(str(reconstructed / "sparse"))
    after = pycolmap.Reconstruction(str(out / "sparse" / "0"))
    assert sorted(image.name for image in after.images.values()) == [f"{i:06d}.jpg" for i in range(5)]
    for number, image in before.images.items():
        np.testing.assert_array_equal(after.images[number].cam_from_world().matrix(), image.cam_from_world().matrix())
        assert f"images/{after.images[number].name}" == image.name
        assert (out / image.name).read_bytes() == (reconstructed.parent / "capture" / image.name).read_bytes()
        assert after.images[number].num_points3D == image.num_points3D
    for number, point in before.points3D.items():
        np.testing.assert_array_equal(after.points3D[number].xyz, point.xyz)
    (reconstructed.parent / "capture" / "images" / "000002.jpg").unlink()
    (reconstructed.parent / "out-colmap").rename(reconstructed.parent / "old")
    with pytest.raises(InputError, match=r"000002\.jpg"):
        export(reconstructed, "colmap", reconstructed.parent / "capture")


def test_a_dense_cloud_goes_with_its_cameras(reconstructed: Path) -> None:
    """Beside the model of a dense cloud lies `fused.ply`, the name by which COLMAP's own tools know it."""
    assert not (export(reconstructed, "colmap") / "fused.ply").exists()
    (reconstructed.parent / "out-colmap").rename(reconstructed.parent / "former")
    cloud = sampled_cloud()
    once = {name: np.zeros((COUNT, *values.shape[1:]), values.dtype) for name, values in cloud.observations.items()}
    once["start"] = np.arange(COUNT + 1)
    dense = dataclasses.replace(cloud, observations=once, cameras=({"name": "a"},), source="sfm-dense")
    (reconstructed / "observations").rename(reconstructed / "former")
    write_cloud(reconstructed, dense)
    points = trimesh.load(export(reconstructed, "colmap") / "fused.ply", process=False)
    assert isinstance(points, trimesh.PointCloud)
    np.testing.assert_array_equal(points.vertices, cloud.columns["coord"])
    np.testing.assert_array_equal(np.asarray(points.colors)[:, :3], cloud.columns["color"])
    path = reconstructed.parent / "out-colmap" / "fused.ply"
    for coord in (load_open3d().t.io.read_point_cloud(str(path)).point["positions"].numpy(), read_scan(path).coord):
        np.testing.assert_array_equal(coord, cloud.columns["coord"])  # to the last bit, at map coordinates


def test_nerfstudio(reconstructed: Path) -> None:
    """Points cast through transforms.json as nerfstudio defines it land on the pixels that COLMAP computes."""
    out = export(reconstructed, "nerfstudio")
    stored = json.loads((out / "transforms.json").read_text())
    model = pycolmap.Reconstruction(str(reconstructed / "sparse"))
    by_name = {Path(image.name).name: image for image in model.images.values()}
    points = np.array([point.xyz for _, point in sorted(model.points3D.items())])
    assert len(stored["frames"]) == 5
    for frame in stored["frames"]:
        image = by_name[Path(frame["file_path"]).name]
        to_world = np.array(frame["transform_matrix"])
        local = np.linalg.solve(to_world, np.column_stack([points, np.ones(len(points))]).T)[:3].T
        local *= [1.0, -1.0, -1.0]  # nerfstudio looks along -z, y upwards
        front = local[:, 2] > 0
        xy = local[front, :2] / local[front, 2:]
        square = (xy**2).sum(axis=1, keepdims=True)
        bent = xy * (1 + stored["k1"] * square + stored["k2"] * square**2)
        assert (stored["p1"], stored["p2"]) == (0.0, 0.0)
        pixels = bent * [stored["fl_x"], stored["fl_y"]] + [stored["cx"], stored["cy"]]
        expected = np.array([image.project_point(point) for point in points[front]], float)
        assert front.sum() > 10
        np.testing.assert_allclose(pixels, expected, atol=1e-6)
    camera = next(iter(model.cameras.values()))
    assert (stored["w"], stored["h"]) == (camera.width, camera.height)
    seeds = trimesh.load(out / stored["ply_file_path"], process=False)
    assert isinstance(seeds, trimesh.PointCloud)
    np.testing.assert_array_equal(seeds.vertices, read_cloud(reconstructed).columns["coord"])


def test_sampled_clouds_have_no_cameras(source: Path) -> None:
    """Formats of cameras need a reconstruction; an unknown format is named."""
    for to in ("colmap", "nerfstudio"):
        with pytest.raises(InputError, match="has no cameras"):
            export(source, to)
    with pytest.raises(InputError, match="video"):
        export(source, "video")


@pytest.mark.parametrize("to", sorted(EXPORTS))
def test_the_same_cloud_makes_the_same_bytes(to: str, source: Path, reconstructed: Path) -> None:
    """Nothing of a clock or of the folder's name reaches a file."""
    if to == "hdf5":
        pytest.importorskip("h5py")
    chosen = reconstructed if to in ("colmap", "nerfstudio") else source
    first = folder_digest(export(chosen, to))
    (chosen.parent / f"out-{to}").rename(chosen.parent / "former")
    moved = chosen.rename(chosen.parent / "elsewhere")
    assert folder_digest(export(moved, to)) == first
