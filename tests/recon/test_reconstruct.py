"""Structure from motion for real on a small known world: accuracy, labels, truth kept apart, and hopeless input."""

import json
import shutil
import struct
from pathlib import Path

import numpy as np
import pycolmap
import pytest

from groundwork.canonical import folder_digest
from groundwork.errors import InputError
from groundwork.files import read_json
from groundwork.progress import SILENT
from recon.cloud import Cloud, read_cloud
from recon.placing.similarity import Similarity, fit_similarity
from recon.points.observations import Observations
from recon.reconstruct import reconstruct
from recon.settings import ReconSettings, SparseSettings
from recon.sfm.colmap_model import read_model
from recon.sfm.sparse import run_sparse
from render.capture import CalibrationPrior, Capture, CaptureImage, read_capture, read_truth
from tests.conftest import Count, RecordProof
from usd_schemas.pinhole import Pinhole, look_at, project


@pytest.fixture(scope="module")
def cloud(plane_cloud: Path) -> Cloud:
    """Read the cloud of the planes."""
    return read_cloud(plane_cloud)


def test_the_planes_come_back(cloud: Cloud) -> None:
    """Every camera within millimeters, every point on its plane with its plane's label; nothing left behind."""
    figures = cloud.statistics
    assert figures["registered_share"] == 1.0
    assert figures["center_error_median"] < 0.01
    # A model whose pixels were half a pixel off would turn every camera by 0.5 / 280 rad = 0.1 degrees.
    assert figures["rotation_error_median"] < 0.03
    assert figures["points"] > 1000
    assert figures["within_0.1m_share"] > 0.95
    assert figures["right_class_share"] > 0.98
    counts = figures["points_per_class"]
    assert min(counts["abutment"], counts["background"], counts["parapet"]) > 100
    assert sum(counts.values()) == len(cloud)
    histogram = figures["uncertainty_histogram"]
    assert sum(histogram["counts"]) + histogram["infinite"] == len(cloud)
    kinds = np.array(cloud.components)[cloud.columns["component"]]
    for instance, kind in ((11, "ground"), (12, "abutment_wall"), (13, "parapet")):
        assert set(kinds[cloud.columns["instance"] == instance]) == {kind}


def test_uncertainty_follows_the_true_distance(cloud: Cloud) -> None:
    """Where a point is, measured three ways: consistent with each other and with the closed-form planes."""
    columns = cloud.columns
    wall = (columns["instance"] == 12) & (columns["surface_class"] == 1) & (np.abs(columns["coord"][:, 0]) < 4.5)
    wall &= columns["coord"][:, 2] < 4.0  # above its top, the edge is nearer than the plane
    off_the_plane = np.abs(columns["coord"][wall, 1] - 5.0)
    np.testing.assert_allclose(columns["surface_distance"][wall], off_the_plane, atol=1e-4)
    finite = np.isfinite(columns["uncertainty"])
    assert (columns["uncertainty_min"] <= columns["uncertainty"]).all()
    assert (columns["uncertainty"] <= columns["uncertainty_max"]).all()
    assert np.median(columns["uncertainty"][finite]) < 0.05
    far = columns["surface_distance"] > 0.1
    assert (columns["uncertainty"][far] > 0.1).mean() > 0.9
    np.testing.assert_allclose(np.linalg.norm(columns["normal"], axis=1), 1.0, atol=1e-5)
    assert (columns["normal"][:, 1] < 0).all()  # all cameras stand at negative y


def test_half_a_pixel_would_show(plane_capture: Path, cloud: Cloud) -> None:
    """Seen by the true cameras, the points lie at their keypoints without a bias: half a pixel would be one."""
    truth = read_truth(read_capture(plane_capture))
    assert truth is not None
    stored = cloud.observations
    seen = Observations(stored["start"], stored["image"].astype(np.int64), stored["uv"])
    for image, pose in enumerate(truth.poses):
        mine = seen.image == image
        pixels, _ = project(cloud.columns["coord"][seen.point[mine]], truth.camera, pose)
        assert np.abs(np.median(pixels - seen.uv[mine], axis=0)).max() < 0.2


def test_the_model_in_meters_is_the_cloud(plane_cloud: Path, cloud: Cloud) -> None:
    """The COLMAP model beside the cloud holds the same points, poses and observations; our reader equals COLMAP's."""
    ours, theirs = read_model(plane_cloud / "sparse"), pycolmap.Reconstruction(plane_cloud / "sparse")
    rows = {tuple(row) for row in np.round(ours.points, 6)}
    assert {tuple(row) for row in np.round(cloud.columns["coord"], 6)} <= rows
    ids = sorted(theirs.points3D)
    np.testing.assert_array_equal(ours.points, [theirs.points3D[number].xyz for number in ids])
    np.testing.assert_array_equal(ours.colors, [theirs.points3D[number].color for number in ids])
    np.testing.assert_array_equal(
        np.bincount(ours.obs_point), [theirs.points3D[number].track.length() for number in ids]
    )
    poses = {
        row["name"]: np.array(row["camera_to_world"]) for row in read_json(plane_cloud / "cameras_sfm.json")["poses"]
    }
    for image in theirs.images.values():
        pose = ours.poses[ours.names.index(image.name)]
        np.testing.assert_allclose(pose[:3, 3], image.projection_center(), atol=1e-12)
        np.testing.assert_allclose(pose[:3, :3].T, image.cam_from_world().rotation.matrix(), atol=1e-12)
        np.testing.assert_allclose(poses[Path(image.name).stem], pose, atol=1e-9)
        elements = [p for p in image.points2D if p.has_point3D()]
        mine = ours.obs_image == ours.names.index(image.name)
        assert {tuple(p.xy) for p in elements} == {tuple(row) for row in ours.obs_uv[mine]}


@pytest.mark.usefixtures("no_children")
def test_without_truth_the_model_is_the_same(
    plane_capture: Path, plane_settings: ReconSettings, cloud: Cloud, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Without truth/, and on one thread, the model is the same byte for byte; the cloud is aligned to GPS instead."""
    bare, folder = tmp_path / "bare", tmp_path / "cloud"
    shutil.copytree(plane_capture, bare, ignore=shutil.ignore_patterns("truth"))
    folder.mkdir()
    alone = plane_settings.sparse.model_copy(update={"threads": 1})
    reconstruct(bare, folder, plane_settings.model_copy(update={"sparse": alone}), SILENT)
    found = read_cloud(folder)
    assert found.statistics["sparse"] == cloud.statistics["sparse"]  # holds the digest of the model's files
    assert found.alignment["target"] == "gps"
    assert "without labels" in found.alignment["note"]
    assert set(found.columns["segment"]) == {255}
    assert np.isnan(found.columns["uncertainty"]).all()
    assert found.statistics["right_class_share"] is None
    assert found.statistics["center_error_median"] < 1.0
    assert capfd.readouterr().out == ""
    assert sorted(p.name for p in folder.iterdir() if p.is_dir()) == ["model", "observations", "sparse"]


@pytest.mark.proof_only
def test_several_threads_map_alike(
    plane_capture: Path, plane_settings: ReconSettings, tmp_path: Path, record_proof: RecordProof
) -> None:
    """With `deterministic = false` two threads map; cameras agree with those of one thread, though bytes may not."""
    centers = []
    for exact in (True, False):
        sparse = plane_settings.sparse.model_copy(update={"deterministic": exact, "threads": 2})
        found = run_sparse(read_capture(plane_capture), tmp_path, ReconSettings(sparse=sparse), SILENT).model
        centers.append(found.poses[np.argsort(found.names), :3, 3])
    assert len(centers[0]) == len(centers[1])
    scale, rotation, shift = fit_similarity(centers[1], centers[0])  # each model has axes and a scale of its own
    laid = Similarity(float(scale), rotation, shift)
    apart = float(np.abs(laid.move(centers[1]) - centers[0]).max() / np.ptp(centers[0], axis=0).max())
    record_proof("reconstruction: mapped by two threads", len(centers[0]), 0, {"apart_of_path": apart})
    assert apart < 1e-6


@pytest.mark.usefixtures("no_children")
@pytest.mark.parametrize("left", [300, pytest.param(20_000, marks=pytest.mark.proof_only), -2])
def test_a_cut_image_is_named(left: int, plane_capture: Path, tmp_path: Path) -> None:
    """COLMAP would take the gray rest of a cut JPEG for a picture; we find it before anything else runs."""
    capture, folder = tmp_path / "capture", tmp_path / "cloud"
    shutil.copytree(plane_capture, capture)
    path = capture / "images" / "000004.jpg"
    path.write_bytes(path.read_bytes()[:left])
    folder.mkdir()
    with pytest.raises(InputError, match=r"000004\.jpg"):
        reconstruct(capture, folder, ReconSettings(mode="sparse"), SILENT)
    assert not [path for path in folder.rglob("*") if path.is_file()]  # no database, no cloud


@pytest.mark.usefixtures("no_children")
def test_a_class_that_las_cannot_hold_is_refused_before_the_work(plane_capture: Path, tmp_path: Path) -> None:
    """The file cloud.laz has codes for class ids up to 191: a larger one in the table of the truth is named first."""
    capture, folder = tmp_path / "capture", tmp_path / "cloud"
    shutil.copytree(plane_capture, capture)
    table = read_json(capture / "truth/instances.json")
    table["classes"].append({"id": 200, "name": "lamp", "color": [0, 0, 0]})
    (capture / "truth/instances.json").write_text(json.dumps(table))
    folder.mkdir()
    with pytest.raises(InputError, match=r"class id.*200.*0 to 191"):
        reconstruct(capture, folder, ReconSettings(mode="sparse"), SILENT)
    assert not list(folder.iterdir())


@pytest.mark.parametrize(
    ("gps", "step", "count", "pairing"),
    [
        (True, 1.0, 100, "spatial"),
        (False, 1.0, 40, "exhaustive"),
        (False, 1.0, 41, "sequential"),
        (True, 0.0, 20, "spatial"),
        (True, 0.001, 100, "sequential"),
        (True, 0.0, 21, "exhaustive"),
    ],
)
def test_pairing_is_chosen_by_what_is_known(gps: bool, step: float, count: int, pairing: str) -> None:
    """GPS for every image: spatial; else, and with one fix for all, exhaustive up to 40 images, sequential above."""
    from recon.sfm.matching import choose_pairing

    images = tuple(
        CaptureImage(name=str(i), file=f"{i}.jpg", gps=(i % 5 * step, 0.0, 0.0) if gps else None) for i in range(count)
    )
    capture = Capture(Path(), "s", (4, 3), CalibrationPrior(focal_px=4.0, cx=2.0, cy=1.5), (1.0, 1.0, 1.0), {}, images)
    assert choose_pairing(capture, SparseSettings()) == pairing
    assert choose_pairing(capture, SparseSettings(pairing="exhaustive")) == "exhaustive"


def test_our_pixels_are_colmaps_pixels() -> None:
    """A corner lands on the same pixel through our pinhole and through COLMAP's camera."""
    camera = Pinhole(960, 720, 640.0, 640.0, 480.0, 360.0)
    pose = look_at(np.array([3.0, -9.0, 2.0]), np.array([0.0, 0.0, 1.0]))
    corners = np.random.default_rng(1).normal(0, 1, (50, 3))
    pixels, _ = project(corners, camera, pose)
    theirs = pycolmap.Camera(model="SIMPLE_RADIAL", width=960, height=720, params=[640.0, 480.0, 360.0, 0.0])
    local = (corners - pose[:3, 3]) @ pose[:3, :3]
    np.testing.assert_allclose(np.array(theirs.img_from_cam(local)), pixels, atol=1e-9)


def test_a_cut_model_is_refused(plane_cloud: Path, tmp_path: Path) -> None:
    """A model that lost its end is not read as a smaller one."""
    for name in ("points3D.bin", "images.bin"):
        folder = tmp_path / name
        shutil.copytree(plane_cloud / "sparse", folder)
        (folder / name).write_bytes((folder / name).read_bytes()[:-5])
        with pytest.raises(InputError, match="not a complete COLMAP model"):
            read_model(folder)


def test_no_lie_in_a_model_does_harm(tmp_path: Path, proof_count: Count, record_proof: RecordProof) -> None:
    """Files of a model with a few wrong bytes: a model of finite numbers or one line, and little memory."""
    pycolmap.set_random_seed(3)
    options = pycolmap.SyntheticDatasetOptions(num_points3D=20, num_rigs=1, num_cameras_per_rig=1, num_frames_per_rig=4)
    pycolmap.synthesize_dataset(options).write_binary(tmp_path)
    whole = {name: (tmp_path / name).read_bytes() for name in ("cameras.bin", "images.bin", "points3D.bin")}
    said, count = list[str](), proof_count(300, 3000)
    for seed in range(count):
        rng = np.random.default_rng(seed)
        name = sorted(whole)[seed % 3]
        bad = np.frombuffer(whole[name], np.uint8).copy()
        at = rng.integers(0, len(bad) if seed % 2 else 16, rng.integers(1, 4))
        bad[at] ^= rng.integers(1, 256, len(at)).astype(np.uint8)
        (tmp_path / name).write_bytes(bad.tobytes())
        try:
            model = read_model(tmp_path)
        except InputError as error:
            said.append(str(error))
        else:
            assert np.isfinite(model.poses).all()
            assert np.isfinite(model.points).all()
            assert model.obs_point.max() < len(model.points)
        (tmp_path / name).write_bytes(whole[name])
    assert len(said) > 0.2 * count
    assert not [line for line in said if "\n" in line]
    record_proof("recon: COLMAP models with flipped bytes are read or refused", count, 0, {"refused": len(said)})


@pytest.mark.parametrize(
    ("name", "at", "value", "reason"),
    [
        ("points3D.bin", 0, struct.pack("<Q", 2**50), "rows in"),
        ("images.bin", 0, struct.pack("<Q", 2**60), "rows in"),
        ("points3D.bin", 8 + 8, struct.pack("<d", np.nan), "a point is not finite"),
        ("points3D.bin", 8, struct.pack("<Q", 10**6), "a point that does not exist"),
        ("images.bin", 8 + 4, struct.pack("<4d", 0, 0, 0, 0), "a pose is not finite"),
    ],
)
def test_what_a_model_cannot_hold(
    name: str, at: int, value: bytes, reason: str, plane_cloud: Path, tmp_path: Path
) -> None:
    """More rows than bytes, a point at nan, a keypoint of no point, a camera that looks nowhere: named and refused."""
    folder = tmp_path / "model"
    shutil.copytree(plane_cloud / "sparse", folder)
    data = (folder / name).read_bytes()
    (folder / name).write_bytes(data[:at] + value + data[at + len(value) :])
    with np.errstate(invalid="ignore"), pytest.raises(InputError, match=reason):
        read_model(folder)


def test_reading_changes_nothing(plane_cloud: Path) -> None:
    """A cloud that was read is byte for byte the cloud that was written."""
    before = folder_digest(plane_cloud)
    read_cloud(plane_cloud)
    assert folder_digest(plane_cloud) == before
