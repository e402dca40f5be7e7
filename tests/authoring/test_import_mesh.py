"""Worlds of meshes: every format gives the same town, and textures stay where they were."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from trimesh.exchange.gltf import export_glb, export_gltf
from trimesh.exchange.obj import export_obj
from trimesh.visual.color import ColorVisuals

from authoring.imported.asset import read_city, write_city
from authoring.imported.mesh import read_mesh
from authoring.imported.mesh_city import LOOSE
from authoring.imported.model import CityModel
from authoring.imported.triangle_cuts import cut_free, split_long
from tests.authoring.mesh_files import (
    PIXELS,
    SIDE,
    UTM,
    decoded,
    gltf,
    height,
    obj,
    plan_areas,
    ply,
    quiet,
    read,
    town,
    usd,
    usdz,
    zipped,
)

F64 = NDArray[np.float64]


def area(triangles: F64) -> float:
    """Total area [m2]."""
    edges = triangles[:, 1:] - triangles[:, :1]
    return float(0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum())


def check_town(model: CityModel, volume: float, count: int) -> None:
    """Every house, its walls and roof, the ground, and the houses' volume by the divergence theorem."""
    meshes, _, _ = town()
    assert len(model.buildings) == count
    assert not model.textured
    assert area(model.terrain) == pytest.approx(meshes[0].area, rel=1e-5)
    undersides = sum(float(np.prod(mesh.extents[:2])) for mesh in meshes[1:])
    assert area(model.built) == pytest.approx(sum(mesh.area for mesh in meshes[1:]) - undersides, rel=1e-5)
    low = np.array([house.corners[:, 2].min() for house in model.buildings])
    found = sum(
        float(np.sum((house.roofs[..., 2].mean(axis=1) - bottom) * plan_areas(house.roofs)))
        for house, bottom in zip(model.buildings, low, strict=True)
    )
    assert found == pytest.approx(volume, rel=1e-5)
    np.testing.assert_allclose(np.ptp(model.extent, axis=0), [SIDE, SIDE], rtol=1e-6)
    np.testing.assert_allclose(model.extent.mean(axis=0), 0.0, atol=0.51)
    assert min(model.built[..., 2].min(), model.terrain[..., 2].min()) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("kind", ["glb", "gltf", "obj", "ply"])
@pytest.mark.parametrize("turned", [False, True])
def test_town_comes_back_in_every_format(tmp_path: Path, kind: str, turned: bool) -> None:
    """As trimesh exports it, z up; and y up in centimeters: the same houses, areas and volume in meters."""
    meshes, volume, count = town()
    for mesh in meshes:
        if turned:  # x, y, z become x, z, -y
            mesh.apply_transform(100.0 * np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 0.01]]))
    file = tmp_path / f"town.{kind}"
    if kind == "gltf":
        for name, data in export_gltf(trimesh.Scene(meshes)).items():
            (tmp_path / (file.name if name == "model.gltf" else name)).write_bytes(data)
    elif kind == "glb":
        file.write_bytes(export_glb(trimesh.Scene(meshes)))
    else:
        trimesh.util.concatenate(meshes).export(file)
    check_town(read_mesh(file, quiet, "y" if turned else "z", 0.01 if turned else 1.0), volume, count)


def test_projected_coordinates_keep_millimeters(tmp_path: Path) -> None:
    """Text with UTM coordinates: what counts is subtracted in float64, and remembered."""
    meshes, volume, count = town(UTM)
    file = tmp_path / "town.obj"
    file.write_text(export_obj(trimesh.util.concatenate(meshes), digits=6))
    model = read_mesh(file, quiet)
    check_town(model, volume, count)
    origin = np.array(model.attribution["origin"].split(), np.float64)
    corner = model.terrain.reshape(-1, 3).min(axis=0) + origin
    np.testing.assert_allclose(corner[:2], UTM[:2], atol=1e-3)


def test_geocentric_coordinates_are_turned_upright(tmp_path: Path) -> None:
    """A town on the ellipsoid at 47 N, 8 E: the same houses, upright, up to the turn of the float32 file's node."""
    meshes, _, count = town()
    lat, lon = np.radians([47.0, 8.0])
    a, b = 6378137.0, 6356752.314245
    normal = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    place = np.eye(4)
    place[:3, 2] = normal
    place[:3, 0] = [-np.sin(lon), np.cos(lon), 0.0]
    place[:3, 1] = np.cross(normal, place[:3, 0])
    radius = a * a / np.hypot(a * np.cos(lat), b * np.sin(lat))
    place[:3, 3] = normal * radius * np.array([1.0, 1.0, b * b / (a * a)])
    whole = trimesh.util.concatenate(meshes)
    whole.apply_transform(place)
    file = tmp_path / "town.obj"
    file.write_text(export_obj(whole, digits=6))
    model = read_mesh(file, quiet)
    assert len(model.buildings) == count
    assert area(model.terrain) == pytest.approx(meshes[0].area, rel=1e-4)
    center = np.argmax([house.corners[:, 2].max() for house in model.buildings])
    house = model.buildings[center]
    walls = np.cross(house.walls[:, 1] - house.walls[:, 0], house.walls[:, 2] - house.walls[:, 0])
    assert np.abs(walls[:, 2] / np.linalg.norm(walls, axis=1)).max() < 1e-3


def check_photographed(model: CityModel) -> None:
    """One image, whose pixels lie where they lay; the block is built, the rest is ground."""
    (skin,) = model.skins
    picture = decoded(skin.image)
    np.testing.assert_array_equal(picture, PIXELS)
    ground = next(piece for piece in model.textured if piece.is_ground)
    (block,) = (piece for piece in model.textured if not piece.is_ground)
    assert area(ground.triangles) == pytest.approx(SIDE**2 - 41.0**2, rel=1e-4)
    assert plan_areas(block.triangles).sum() == pytest.approx(41.0**2, rel=1e-3)
    assert block.triangles[..., 2].max() == pytest.approx(12.0, abs=1e-3)
    for piece in model.textured:
        middle, st = piece.triangles.mean(axis=1), piece.st.mean(axis=1)
        east, north = middle[:, 0] > 0.0, middle[:, 1] > 0.0  # the middle of the tile is a border of colors
        clear = np.abs(middle[:, :2]).min(axis=1) > 1.0
        texel = np.clip((64 * np.stack([st[:, 0], 1.0 - st[:, 1]], axis=1)).astype(int), 0, 63)
        expected = PIXELS[np.where(north, 0, 63), np.where(east, 63, 0)]
        np.testing.assert_array_equal(picture[texel[:, 1], texel[:, 0]][clear], expected[clear])


@pytest.mark.parametrize("write", [gltf, obj, ply, usd, usdz, zipped])
def test_textures_stay_where_they_were(tmp_path: Path, write: Callable[[Path], Path]) -> None:
    """In every format that carries textures; and again after the world was written and read."""
    model = read(write(tmp_path))
    check_photographed(model)
    folder = tmp_path / "world"
    folder.mkdir()
    write_city(model, folder, "world")
    again = read_city(folder)
    check_photographed(again)
    assert again.attribution == model.attribution
    assert [piece.owner for piece in again.textured] == [piece.owner for piece in model.textured]


def test_attribution_is_kept(tmp_path: Path) -> None:
    """What a glTF file or a stage says about itself."""
    said = read(gltf(tmp_path)).attribution
    assert (said["author"], said["license"], said["source"]) == ("City of Nowhere", "CC0", "tile.gltf")
    assert read(usd(tmp_path)).attribution["license"] == "CC0"


def test_vertex_colors_become_a_palette(tmp_path: Path) -> None:
    """Each triangle keeps its color, looked up in the middle of one texel."""
    meshes, _, count = town()
    rng = np.random.default_rng(1)
    colors = [rng.integers(0, 256, 3) for _ in meshes]
    for mesh, color in zip(meshes, colors, strict=True):
        mesh.visual = ColorVisuals(mesh, vertex_colors=np.tile([*color, 255], (len(mesh.vertices), 1)))
    file = tmp_path / "town.ply"
    trimesh.util.concatenate(meshes).export(file)
    model = read(file)
    (skin,) = model.skins
    picture = decoded(skin.image)
    side = len(picture)
    found = set()
    for piece in model.textured:
        texel = (piece.st[:, 0] * [side, -side] + [0, side]).astype(int)
        (color,) = np.unique(picture[texel[:, 1], texel[:, 0]], axis=0)
        found.add(tuple(color.tolist()))
    assert len(model.textured) == count + 1
    assert found == {tuple(color.tolist()) for color in colors}


def test_cut_keeps_areas_and_values() -> None:
    """Triangles cut along a line: area by clipping in closed form, values still linear, no long edge near the line."""
    rng = np.random.default_rng(2)
    corners = rng.uniform(-20.0, 20.0, (200, 3, 2))
    corners = np.concatenate([corners, corners @ rng.normal(size=(2, 3))], axis=2)

    def free(xy: F64) -> F64:
        return xy[:, 0] + 3.0

    split = split_long(corners, free)
    assert plan_areas(split).sum() == pytest.approx(plan_areas(corners).sum(), rel=1e-9)
    kept = cut_free(split, free(split[..., :2].reshape(-1, 2)).reshape(-1, 3))
    lost = cut_free(split, -free(split[..., :2].reshape(-1, 2)).reshape(-1, 3))
    assert kept[..., 0].min() > -3.0 - 1e-9
    assert plan_areas(kept).sum() + plan_areas(lost).sum() == pytest.approx(plan_areas(corners).sum(), rel=1e-9)
    slope = np.linalg.lstsq(corners[..., :2].reshape(-1, 2), corners[..., 2:].reshape(-1, 3), rcond=None)[0]
    np.testing.assert_allclose(kept[..., 2:], kept[..., :2] @ slope, atol=1e-9)


def test_small_things_are_one(tmp_path: Path) -> None:
    """A thousand pebbles are one object; they use up no instance ids."""
    meshes, _, count = town()
    rng = np.random.default_rng(9)
    for _ in range(1000):
        pebble = trimesh.creation.box((0.4, 0.4, 1.3))
        spot = np.array([*rng.uniform(5.0, 295.0, 2), 0.0])
        pebble.apply_translation(spot + np.array([0.0, 0.0, height(spot) + 0.4]))
        meshes.append(pebble)
    file = tmp_path / "town.ply"
    trimesh.util.concatenate(meshes).export(file)
    model = read(file)
    assert len(model.buildings) == count + 1
    (loose,) = (building for building in model.buildings if building.name == LOOSE)
    assert area(loose.roofs) == pytest.approx(1000 * 0.16, rel=0.02)
