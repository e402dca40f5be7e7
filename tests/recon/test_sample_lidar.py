"""Laser scans against closed forms: ranges, noise, losses, mixed pixels at edges and nowhere else."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from scipy import stats

from groundwork.canonical import folder_digest
from groundwork.errors import InputError
from recon.cloud import read_cloud
from tests.conftest import Count, RecordProof
from tests.recon.scanned_scenes import EXACT, POSE, SQUARE, deck_on_walls, ground, named, scanned
from tests.render.scenes import SceneBuilder, placed
from usd_schemas.flat_scene import FlatScene, Material, Texture


def test_ranges_to_a_plane(tmp_path: Path) -> None:
    """Height over the sine of the depression, to a millionth of a millimeter, for every ray that must come back."""
    cloud = scanned(
        ground(),
        tmp_path / "c",
        positions=[[3.0, -4.0, 2.5]],
        angular_step=2.0,
        lowest=-89.5,
        max_range=60.0,
        range_at_10_percent=1000.0,
        max_incidence=88.0,
        **EXACT,
    )
    columns = cloud.columns
    assert cloud.source == "lidar-terrestrial"
    heights = np.deg2rad(np.arange(-89.5, 90.0, 2.0))
    expected = [
        -2.5 / np.sin(angle)
        for angle in heights
        if angle < 0 and -2.5 / np.sin(angle) <= 60.0 and np.pi / 2 + angle <= np.deg2rad(88.0)
    ]
    assert len(cloud) == 180 * len(expected)
    ways = columns["coord"] - [3.0, -4.0, 2.5]
    found = np.linalg.norm(ways, axis=1)
    np.testing.assert_allclose(np.sort(found), np.sort(np.tile(expected, 180)), atol=1e-9)
    assert np.abs(columns["coord"][:, 2]).max() < 1e-9
    np.testing.assert_allclose(columns["range"], found, rtol=1e-6)
    np.testing.assert_allclose(columns["intensity"], 0.5 * 2.5 / found, rtol=1e-5)
    assert (columns["normal"] == [0.0, 0.0, 1.0]).all()
    assert not columns["uncertainty"].any()
    assert (columns["station"] == 0).all()
    assert read_cloud(tmp_path / "c").statistics["stations"] == [[3.0, -4.0, 2.5]]


def test_ranges_to_a_sphere(tmp_path: Path) -> None:
    """From outside, the nearer cut of ray and sphere; from within, the radius; off by the facets' height at most."""
    ball = trimesh.creation.icosphere(subdivisions=5, radius=5.0)
    edges = np.linalg.norm(np.diff(ball.vertices[ball.edges_unique], axis=1), axis=2).max()
    sagitta = 5.0 - np.sqrt(25.0 - edges**2 / 3.0)
    builder = SceneBuilder()
    builder.add_mesh(np.asarray(ball.triangles), placed((1e5, 2e5, 7.0)), 1)
    scene, middle = builder.build(POSE), np.array([1e5, 2e5, 7.0])
    settings = {**EXACT, "angular_step": 3.0, "lowest": -90.0, "max_incidence": 60.0, "range_at_10_percent": 1000.0}
    inner = scanned(scene, tmp_path / "in", positions=[middle.tolist()], **settings).columns
    np.testing.assert_allclose(inner["range"], 5.0, atol=1.5 * sagitta)
    eye = middle + np.array([-20.0, 3.0, 1.0])
    outer = scanned(scene, tmp_path / "out", positions=[eye.tolist()], **settings).columns
    ray = outer["coord"] - eye
    length = np.linalg.norm(ray, axis=1)
    along = ray / length[:, None] @ (middle - eye)
    near = along - np.sqrt(along**2 - ((middle - eye) ** 2).sum() + 25.0)
    np.testing.assert_allclose(length, near, atol=4 * sagitta)
    facing = np.einsum("ni,ni->n", outer["coord"] - middle, outer["normal"]) / 5.0
    assert (facing > 0.99).all()
    assert len(length) > 30


def test_noise_grows_with_the_range(tmp_path: Path, proof_count: Count, record_proof: RecordProof) -> None:
    """Errors over their standard deviation at that range are normal; uncertainty is their size."""
    step = 0.8 / proof_count(1, 4)
    spread = {**EXACT, "range_noise": 0.004, "range_noise_ppm": 300.0, "max_range": 110.0}
    place = {"positions": [[0.0, 0.0, 20.0]], "angular_step": step, "lowest": -89.0}
    columns = scanned(ground(), tmp_path / "c", **place, **spread).columns
    sine = -(columns["coord"][:, 2] - 20.0) / np.linalg.norm(columns["coord"] - [0, 0, 20.0], axis=1)
    true_range = 20.0 / sine
    error = np.linalg.norm(columns["coord"] - [0, 0, 20.0], axis=1) - true_range
    sigma = 0.004 + 300e-6 * true_range
    p_value = float(stats.kstest(error / sigma, "norm").pvalue)
    assert p_value > 1e-3
    assert sigma.max() > 2.5 * sigma.min()
    np.testing.assert_allclose(columns["uncertainty"], np.abs(error), atol=1e-6)
    np.testing.assert_allclose(columns["uncertainty_relative"], np.abs(error) / true_range, rtol=1e-3, atol=1e-8)
    np.testing.assert_allclose(columns["surface_distance"], np.abs(columns["coord"][:, 2]), atol=2e-4)
    record_proof(
        "recon: lidar range noise is normal with the stated spread (Kolmogorov-Smirnov)",
        len(error),
        0,
        {"p_value": p_value, "sigma_ratio": float((error / sigma).std())},
    )


def test_losses(tmp_path: Path) -> None:
    """Random loss, grazing incidence, weak echoes, water and too near a surface, each by its own rule."""
    place: dict[str, object] = {
        **EXACT,
        "positions": [[0.0, 0.0, 3.0]],
        "angular_step": 1.0,
        "lowest": -85.0,
        "range_at_10_percent": 1000.0,
        "max_incidence": 80.0,
    }
    every = len(scanned(ground(), tmp_path / "all", **place))
    some = len(scanned(ground(), tmp_path / "some", **{**place, "drop_out": 0.3}))
    assert stats.binomtest(some, every, 0.7).pvalue > 1e-3
    lake = named(ground(), water=(1, "background"))
    wet = len(scanned(lake, tmp_path / "wet", **{**place, "water_echo": 0.05}))
    assert stats.binomtest(wet, every, 0.05).pvalue > 1e-3
    reach = scanned(ground(), tmp_path / "far", **{**place, "max_incidence": 89.0, "range_at_10_percent": 12.0}).columns
    # 0.5 (3 / r) / r² >= 0.1 / 12²: the echo of a plane falls with the third power of the range
    limit = (0.5 * 3.0 * 144.0 / 0.1) ** (1 / 3)
    assert limit * 0.93 < reach["range"].max() <= limit
    angles = np.rad2deg(np.arccos(3.0 / scanned(ground(), tmp_path / "grazing", **place).columns["range"]))
    assert 78.9 < angles.max() <= 80.0
    near = scanned(ground(), tmp_path / "near", **{**place, "min_range": 5.0}).columns["range"]
    assert near.min() >= 5.0
    assert 0 < len(near) < every


def plate_before_wall() -> FlatScene:
    """Build an upright plate of 2 m (instance 2) at y = 10, a wall (instance 1) 0.3 m behind it."""
    builder = SceneBuilder()
    upright = placed((0.0, 10.3, 0.0))
    upright[:3, :3] = np.array([[3.0, 0, 0], [0, 0, -1], [0, 3.0, 0]])
    builder.add_mesh(SQUARE, upright, 1, 1)
    plate = placed((0.0, 10.0, 0.0))
    plate[:3, :3] = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1.0, 0]])
    builder.add_mesh(SQUARE, plate, 2, 11)
    return builder.build(POSE)


def test_mixed_pixels_lie_at_edges_only(tmp_path: Path) -> None:
    """What lies between plate and wall is on a beam that the plate's edge cuts; its label is that of the middle."""
    settings = {
        **EXACT,
        "positions": [[0.0, 0.0, 0.0]],
        "angular_step": 0.1,
        "lowest": -12.0,
        "highest": 12.0,
        "reach": 1.0,
        "range_at_10_percent": 1000.0,
    }
    clean = scanned(plate_before_wall(), tmp_path / "clean", **settings)
    assert clean.statistics["mixed_share"] == 0.0
    assert np.allclose(clean.columns["coord"][:, 1], np.where(clean.columns["instance"] == 2, 10.0, 10.3))
    wide = 0.004
    cloud = scanned(plate_before_wall(), tmp_path / "mixed", **{**settings, "beam_divergence": wide})
    columns = cloud.columns
    mixed = columns["uncertainty"] > 1e-6
    assert cloud.statistics["mixed_share"] == pytest.approx(mixed.mean(), abs=1e-4)
    between = (columns["coord"][:, 1] > 10.0 - 0.004) & (columns["coord"][:, 1] < 10.3 + 0.01)
    assert between[mixed].all()
    ray = columns["coord"] / columns["coord"][:, 1:2]  # where the beam's middle cuts the plane y = 1
    edge = np.abs(np.maximum(np.abs(ray[:, 0]), np.abs(ray[:, 2])) - 0.1)  # the plate spans ±0.1 there
    corner_or_edge = edge < 0.5 * wide * 1.05
    assert corner_or_edge[mixed].all()
    share = mixed[corner_or_edge].mean()
    assert 0.15 < share < 0.6  # a half would be mixed if every beam were cut through its middle
    inside = np.maximum(np.abs(ray[:, 0]), np.abs(ray[:, 2])) < 0.1
    np.testing.assert_array_equal(columns["instance"] == 2, inside)
    far = scanned(plate_before_wall(), tmp_path / "gap", **{**settings, "beam_divergence": wide, "mixing_gap": 0.2})
    assert far.statistics["mixed_share"] == 0.0
    slope = scanned(
        ground(),
        tmp_path / "slope",
        **{
            **settings,
            "positions": [[0.0, 0.0, 1.0]],
            "beam_divergence": wide,
            "max_incidence": 89.5,
            "angular_step": 0.5,
            "reach": 100.0,
        },
    )
    assert slope.statistics["mixed_share"] == 0.0  # a long footprint on one plane is no edge


def test_rays_pass_through_cut_out_leaves(tmp_path: Path) -> None:
    """A ray through the transparent half of a texture meets what is behind it."""
    texels = np.zeros((2, 2, 4), np.uint8)
    texels[:, 0] = 255  # solid where s < 0.5
    cv2.imwrite(str(tmp_path / "leaf.png"), texels)
    builder = SceneBuilder(
        materials=[
            Material("fallback"),
            Material("leaf", base_texture=Texture(str(tmp_path / "leaf.png"), True), opacity_threshold=0.5),
        ]
    )
    builder.add_mesh(SQUARE, placed((0.0, 0.0, 0.0), (50.0, 50.0, 1.0)), 1)
    builder.add_mesh(SQUARE, placed((0.0, 0.0, 1.0)), 2, material=1, st=(SQUARE[..., :2] + 1) / 2)
    cloud = scanned(
        builder.build(POSE),
        tmp_path / "c",
        positions=[[0.0, 0.0, 2.0]],
        angular_step=1.0,
        lowest=-89.9,
        **{**EXACT, "beam_divergence": 0.001},
    )
    x, y, z = cloud.columns["coord"].T
    over = (np.abs(z - 1.0) < 0.2) & (cloud.columns["instance"] == 2)
    assert over.sum() > 1000
    assert (x[over] < 1e-3).all()
    below = cloud.columns["instance"] == 1
    shadow = below & (np.abs(x) < 1.9) & (np.abs(y) < 1.9)  # the leaf's shadow on the ground is twice as wide
    assert (x[shadow] > -1e-3).all()
    assert shadow.sum() > 1000


def test_the_seed_is_all_that_moves_a_point(tmp_path: Path) -> None:
    """Same seed, same bytes; another seed, other points."""
    digests = []
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        scanned(deck_on_walls(), tmp_path / name, angular_step=2.0, stations=2, seed=seed)
        digests.append(folder_digest(tmp_path / name))
    assert digests[0] == digests[1] != digests[2]


def test_too_much_is_refused(tmp_path: Path) -> None:
    """A scan of more rays than anyone waits for, and one that meets nothing, are one line."""
    with pytest.raises(InputError, match="rays"):
        scanned(ground(), tmp_path / "a", positions=[[0.0, 0.0, 2.0]] * 100, angular_step=0.005)
    with pytest.raises(InputError, match="the scanner gets no point"):
        scanned(ground(), tmp_path / "b", positions=[[0.0, 0.0, 2.0]], lowest=10.0)
