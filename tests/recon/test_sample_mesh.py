"""Mesh sampling: even by area, on the surface that it names, seen or hidden as a brute-force caster says."""

import dataclasses
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats
from trimesh.intersections import slice_faces_plane
from trimesh.triangles import area

from groundwork.canonical import folder_digest
from groundwork.errors import InputError
from groundwork.progress import SILENT
from recon.cloud import Cloud, read_cloud
from recon.sampling.camera_views import TOUCH, count_views
from recon.sampling.sample_lidar import sample_lidar
from recon.sampling.sample_mesh import draw_uniform, sample_mesh
from recon.sampling.sampler_settings import MeshSettings, TerrestrialSettings
from recon.sampling.scene_surface import clip, lay_out, whole
from recon.sampling.surface_look import SurfaceLook
from tests.conftest import Count, RecordProof
from tests.render.scenes import SceneBuilder, placed, random_scene, with_materials
from tests.usd_schemas.stages import read_body
from usd_schemas.components import ClassRow
from usd_schemas.flat_scene import FlatScene, InstanceRow, Material, Texture
from usd_schemas.pinhole import look_at, project
from usd_schemas.raycast import RayScene

F64 = NDArray[np.float64]
POSE = look_at(np.array([0.0, 0.0, 10.0]), np.zeros(3))[None]


def sampled(scene: FlatScene, folder: Path, **settings: object) -> Cloud:
    """Sample a scene into a new folder."""
    folder.mkdir()
    return sample_mesh(scene, folder, MeshSettings.model_validate(settings), SILENT)


def two_triangles() -> FlatScene:
    """Build two triangles of 3 m² (instance 1) and 1 m² (instance 2), the second one upright and moved."""
    builder = SceneBuilder()
    builder.add_mesh(np.array([[[0, 0, 0], [3, 0, 0], [0, 2, 0]]], float), np.eye(4), 1, 9)
    builder.add_mesh(np.array([[[0, 0, 0], [2, 0, 0], [0, 0, 1]]], float), placed((20.0, 5.0, 1.0), turn=0.7), 2, 8)
    return builder.build(POSE)


def test_points_are_even_by_area(proof_count: Count, record_proof: RecordProof) -> None:
    """Counts of two triangles, and of 64 congruent parts of each, pass a chi-squared test at the 0.1 % level."""
    count = proof_count(40_000, 2_000_000)
    surface = lay_out(two_triangles())
    rows, places = draw_uniform(count, surface, whole(np.ones(2, bool)), np.random.default_rng(3))
    np.testing.assert_allclose(places.sum(axis=1), 1.0, atol=1e-12)
    assert places.min() >= 0.0
    share = stats.chisquare(np.bincount(rows), count * np.array([0.75, 0.25])).pvalue
    worst = 1.0
    for row in range(2):
        a, b = (np.minimum((places[rows == row, axis] * 8).astype(int), 7) for axis in (1, 2))
        upper = ((places[rows == row, 1:] * 8) % 1.0).sum(axis=1) > 1.0  # each square of the grid is two triangles
        cells = np.bincount((a * 8 + b) * 2 + upper, minlength=128)
        assert (cells > 0).sum() == 64
        worst = min(worst, stats.chisquare(cells[cells > 0]).pvalue)
    assert min(share, worst) > 1e-3, (share, worst)
    record_proof(
        "recon: mesh samples are uniform by area (chi-squared)",
        count,
        3,
        {"p_two_areas": float(share), "p_64_cells_worst": float(worst)},
    )


def test_a_class_that_las_cannot_hold_is_refused_before_the_work(tmp_path: Path) -> None:
    """The file cloud.laz has codes for class ids up to 191: a larger one of the stage is named, by both samplers."""
    scene = two_triangles()
    scene = dataclasses.replace(scene, classes=(*scene.classes, ClassRow(200, "lamp", (0, 0, 0))))
    for sample in (
        lambda: sample_mesh(scene, tmp_path, MeshSettings(points=10), SILENT),
        lambda: sample_lidar(scene, tmp_path, TerrestrialSettings(), SILENT),
    ):
        with pytest.raises(InputError, match=r"class id.*200.*0 to 191"):
            sample()
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_clipping_keeps_the_area_in_the_box(seed: int) -> None:
    """The cut surface has the area that trimesh finds, lies in the box, and in the planes of its triangles."""
    surface = lay_out(random_scene(seed, np.array([100.0, -50.0, 3.0])))
    box = np.array([[98.0, -53.5, 1.0], [103.3, -47.0, 5.5]])
    pieces = clip(surface, box)
    corners = np.einsum("fck,fki->fci", pieces.barycentric, surface.corners[pieces.rows])
    assert (corners >= box[0] - 1e-9).all()
    assert (corners <= box[1] + 1e-9).all()
    off = np.einsum("fci,fi->fc", corners - surface.corners[pieces.rows, :1], surface.normals[pieces.rows])
    assert np.abs(off).max() < 1e-10
    vertices, faces = surface.corners.reshape(-1, 3), np.arange(3 * len(surface.areas)).reshape(-1, 3)
    for normal in np.concatenate([np.eye(3), -np.eye(3)]):
        origin = box[0] if normal.sum() > 0 else box[1]
        vertices, faces, _ = slice_faces_plane(vertices, faces, normal, origin)
    assert pieces.areas(surface).sum() == pytest.approx(area(vertices[faces]).sum(), rel=1e-9)
    assert 0 < pieces.areas(surface).sum() < surface.areas.sum()


def test_every_point_lies_on_its_own_instance(tmp_path: Path) -> None:
    """Taken back into the box that it is said to be of, each point lies on that box, mirrored boxes too."""
    scene = random_scene(5, np.array([4e5, 5e6, 30.0]))
    cloud = sampled(scene, tmp_path / "cloud", points=5000)
    assert cloud.source == "mesh"
    own = cloud.columns["instance"].astype(int) - 1
    linear = scene.draws.transform[own, :3, :3]
    offset = cloud.columns["coord"] - scene.draws.transform[own, :3, 3]
    local = np.linalg.solve(linear, offset[..., None])[..., 0]
    assert np.abs(np.abs(local).max(axis=1) - 0.5).max() < 1e-6
    out = np.linalg.solve(linear, (offset + 0.001 * cloud.columns["normal"])[..., None])[..., 0]
    assert (np.abs(out).max(axis=1) > 0.5).all()  # normals point outward
    np.testing.assert_array_equal(cloud.columns["segment"], scene.draws.label[own])
    assert len(np.unique(own)) == 40
    assert not cloud.columns["displacement"].any()
    assert not cloud.columns["surface_distance"].any()
    read_cloud(tmp_path / "cloud")


def test_instances_of_an_instancer_keep_their_names(tmp_path: Path) -> None:
    """Repeated cubes are sampled where each stands, under its own id."""
    scene = read_body(
        tmp_path,
        """def PointInstancer "Trees" {
        rel prototypes = [</Trees/Protos/Small>]
        int[] protoIndices = [0, 0, 0]
        point3f[] positions = [(0, 0, 0), (10, 0, 0), (0, 10, 5)]
        float3[] scales = [(1, 1, 1), (2, 2, 2), (1, 1, 3)]
        uniform int[] falsework:component:instanceIds = [21, 22, 23]
        def Scope "Protos" {
            def Cube "Small" {
                double size = 1
            }
        }
    }""",
    )
    cloud = sampled(scene, tmp_path / "cloud", points=3000)
    points, ids = cloud.columns["coord"], cloud.columns["instance"]
    for number, middle, size in ((21, (0, 0, 0), (1, 1, 1)), (22, (10, 0, 0), (2, 2, 2)), (23, (0, 10, 5), (1, 1, 3))):
        local = (points[ids == number] - middle) / size
        assert np.abs(np.abs(local).max(axis=1) - 0.5).max() < 1e-6
    areas = np.array([6.0, 24.0, 14.0])
    assert stats.chisquare(np.bincount(ids - 21), 3000 * areas / areas.sum()).pvalue > 1e-3


def brute_views(points: F64, scene: FlatScene, corners: F64) -> NDArray[np.int64]:
    """Count views with every triangle tested against every ray, in double precision."""
    track = scene.cameras[0]
    camera = track.calibration
    assert camera is not None
    views = np.zeros(len(points), int)
    a, u, v = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    for pose in track.poses:
        pixels, depth = project(points, camera, pose)
        framed = (depth > 0) & ((pixels >= 0) & (pixels < [camera.width, camera.height])).all(axis=1)
        for row in np.flatnonzero(framed):
            ray = points[row] - pose[:3, 3]
            p = np.cross(ray, v)
            with np.errstate(divide="ignore", invalid="ignore"):
                scale = 1.0 / np.einsum("ti,ti->t", u, p)
                way = pose[:3, 3] - a
                s = np.einsum("ti,ti->t", way, p) * scale
                q = np.cross(way, u)
                t, w = np.einsum("i,ti->t", ray, q) * scale, np.einsum("ti,ti->t", v, q) * scale
            hit = (s >= 0) & (t >= 0) & (s + t <= 1) & (w > 0)
            views[row] += not (w[hit] * np.linalg.norm(ray) < np.linalg.norm(ray) - 0.001).any()
    return views


def test_views_equal_brute_force(proof_count: Count, record_proof: RecordProof) -> None:
    """Which of three cameras see a point, against every triangle tested one by one."""
    count = proof_count(400, 6000)
    scene = random_scene(8, np.array([300.0, 40.0, 0.0]))
    surface = lay_out(scene)
    rows, places = draw_uniform(count, surface, whole(surface.areas > 0), np.random.default_rng(1))
    points = np.einsum("nk,nki->ni", places, surface.corners[rows])
    found = count_views(points, scene, "", RayScene(surface.corners, surface.instances), SILENT)
    expected = brute_views(points, scene, surface.corners)
    assert set(expected.tolist()) >= {0, 1}
    wrong = int((found != expected).sum())
    assert wrong <= 0.003 * count  # rays along the edge of another box, in single precision
    record_proof("recon: views of mesh samples equal brute force", count, 8, {"different": wrong})


def test_only_seen_points_are_kept(tmp_path: Path) -> None:
    """Of a box under a lid, a camera above sees the lid alone; as many points as asked for come back."""
    builder = SceneBuilder()
    builder.add_box(placed((0.0, 0.0, 0.0)), 1)
    builder.add_box(placed((0.0, 0.0, 2.0), (6.0, 6.0, 0.1)), 2)
    scene = builder.build(POSE)
    cloud = sampled(scene, tmp_path / "seen", points=700, min_views=1)
    assert len(cloud) == 700
    assert (cloud.columns["instance"] == 2).all()
    assert (cloud.columns["coord"][:, 2] > 2.05 - 2 * TOUCH).all()  # of its sides no more than the tolerance
    assert (cloud.columns["n_views"] == 1).all()
    assert (np.bincount(sampled(scene, tmp_path / "all", points=7000).columns["instance"])[1:] > 0).all()
    with pytest.raises(InputError, match=r"test|survey"):
        sampled(scene, tmp_path / "other", points=10, min_views=1, survey="nobody")
    with pytest.raises(InputError, match="only 0 of"):
        sampled(scene, tmp_path / "never", points=10, min_views=2)
    blind = dataclasses.replace(scene, cameras=(dataclasses.replace(scene.cameras[0], path=""),))
    with pytest.raises(InputError, match="no camera"):
        sampled(blind, tmp_path / "blind", points=10, min_views=1)


def test_noise_has_the_spread_that_was_asked_for(tmp_path: Path) -> None:
    """Along the normal only, or alike in all directions; what is written down is what was done."""
    builder = SceneBuilder()
    builder.add_mesh(np.array([[[0, 0, 0], [30, 0, 0], [0, 30, 0]]], float), np.eye(4), 1)
    scene = builder.build(POSE)
    columns = sampled(scene, tmp_path / "normal", points=20_000, normal_noise=0.02).columns
    height = columns["coord"][:, 2]
    assert height.std() == pytest.approx(0.02, rel=0.03)
    assert stats.kstest(height / 0.02, "norm").pvalue > 1e-3
    np.testing.assert_allclose(columns["uncertainty"], np.abs(height), atol=1e-6)
    inner = (columns["coord"][:, :2].min(axis=1) > 0.1) & (columns["coord"][:, :2].sum(axis=1) < 29.8)
    np.testing.assert_allclose(columns["surface_distance"][inner], np.abs(height[inner]), atol=2e-5)
    columns = sampled(scene, tmp_path / "every", points=20_000, noise=0.02).columns
    assert columns["displacement"].mean() == pytest.approx(0.02 * np.sqrt(8 / np.pi), rel=0.02)  # Maxwell
    assert (columns["surface_distance"] <= columns["displacement"] + 2e-5).all()


def test_scope_and_density(tmp_path: Path) -> None:
    """The bridge alone; or what lies within reach of its box, at the same density."""
    builder = SceneBuilder()
    builder.add_box(placed((0.0, 0.0, 0.5), (4.0, 2.0, 1.0)), 1, 9)
    builder.add_mesh(np.array([[[-500, -500, 0], [500, -500, 0], [0, 900, 0]]], float), placed((0.0, 0.0, -0.5)), 2, 0)
    scene = builder.build(POSE)
    rows = (InstanceRow(1, "/Deck", "deck_slab", "deck", {}, "deck"), InstanceRow(2, "/G", "", "", {}, "background"))
    scene = dataclasses.replace(scene, instances=rows)
    alone = sampled(scene, tmp_path / "bridge", density=50.0, scope="bridge").columns
    assert len(alone["coord"]) == 50 * 28
    assert (alone["instance"] == 1).all()
    near = sampled(scene, tmp_path / "near", density=50.0, reach=3.0).columns
    assert len(near["coord"]) == 50 * (28 + 10 * 8)
    assert (np.abs(near["coord"]) <= [5.0, 4.0, 4.0]).all()
    assert (near["instance"] == 2).mean() == pytest.approx(80 / 108, abs=0.02)
    assert {"", "deck_slab"} == set(read_cloud(tmp_path / "near").components)
    with pytest.raises(InputError, match="density"):
        sampled(scene, tmp_path / "much", density=1e6, reach=300.0)


def test_colors_are_those_of_the_texels(tmp_path: Path) -> None:
    """Four texels on a square of one meter, v upwards; the transparent one is a hole in the surface."""
    texels = np.array([[[10, 20, 30, 255], [40, 50, 60, 255]], [[70, 80, 90, 255], [200, 210, 220, 0]]], np.uint8)
    cv2.imwrite(str(tmp_path / "t.png"), texels[..., [2, 1, 0, 3]])
    builder = SceneBuilder()
    square = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], float)
    builder.add_mesh(square, np.eye(4), 1)
    scene = builder.build(POSE)
    material = Material("m", base_texture=Texture(str(tmp_path / "t.png"), True), opacity_threshold=0.5)
    columns = sampled(with_materials(scene, (material,)), tmp_path / "cloud", points=900).columns
    x, y = columns["coord"][:, 0], columns["coord"][:, 1]
    expected = np.where(
        (y > 0.5)[:, None], np.where((x < 0.5)[:, None], texels[0, 0, :3], texels[0, 1, :3]), texels[1, 0, :3]
    )
    np.testing.assert_array_equal(columns["color"], expected)
    assert not ((x > 0.5) & (y < 0.5)).any()
    mask = np.array([[[0, 255, 0], [0, 255, 0]], [[0, 255, 0], [0, 0, 0]]], np.uint8)
    cv2.imwrite(str(tmp_path / "mask.png"), mask)
    inverted = {"alpha_gain": -1.0, "alpha_bias": 1.0}
    for hole, opacity in (
        (True, {"alpha": str(tmp_path / "mask.png"), "alpha_channel": 1}),
        (False, {"alpha": str(tmp_path / "mask.png"), "alpha_channel": 1, **inverted}),
        (False, {"alpha": str(tmp_path / "t.png"), **inverted}),
    ):
        other = dataclasses.replace(material, base_texture=Texture(str(tmp_path / "t.png"), True, **opacity))
        cut = with_materials(scene, (other,))
        weights = np.array([[0.2, 0.6, 0.2], [0.1, 0.2, 0.7]])  # x 0.8, y 0.2: the fourth texel; and x 0.9, y 0.7
        solid = SurfaceLook(cut, lay_out(cut)).at(np.zeros(2, np.int64), weights)[1]
        assert solid.tolist() == [not hole, hole]
    missing = with_materials(scene, (Material("m", (0.2, 0.2, 0.2), base_texture=Texture("/nowhere.png", True)),))
    look = SurfaceLook(missing, lay_out(missing))
    color, solid = look.at(np.array([0]), np.full((1, 3), 1 / 3))
    assert (color == np.float32(0.2)).all()
    assert solid.all()
    assert look.unread == ("nowhere.png",)


def test_the_seed_is_all_that_moves_a_point(tmp_path: Path) -> None:
    """Same seed, same bytes; another seed, other points."""
    scene = random_scene(2, np.zeros(3))
    digests = []
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        sampled(scene, tmp_path / name, points=500, noise=0.01, min_views=1, seed=seed)
        digests.append(folder_digest(tmp_path / name))
    assert digests[0] == digests[1] != digests[2]
