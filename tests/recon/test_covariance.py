"""Expected errors of lens and cameras: against COLMAP's covariances, and against the scatter of many adjustments."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pycolmap
import pytest

from recon.sfm.colmap_model import SparseModel, read_model
from recon.sfm.covariance import precision_of
from tests.conftest import RecordProof

NOISE, TRIES = 0.3, 60


def synthetic(kind: str, noise: float, images: int, points: int) -> pycolmap.Reconstruction:
    """Make a model whose keypoints are off by some noise [px]."""
    pycolmap.set_random_seed(5)
    options = pycolmap.SyntheticDatasetOptions(
        num_points3D=points, num_rigs=1, num_cameras_per_rig=1, num_frames_per_rig=images
    )
    options.camera_model_id = getattr(pycolmap.CameraModelId, kind)
    params = {"SIMPLE_RADIAL": [640.0, 480.0, 360.0, -0.02], "OPENCV": [640.0, 642.0, 480, 360, -0.02, 0.01, 1e-3, 0]}
    options.camera_params = params[kind]
    model = pycolmap.synthesize_dataset(options)
    pycolmap.synthesize_noise(pycolmap.SyntheticNoiseOptions(point2D_stddev=noise), model)
    return model


def adjusted(model: pycolmap.Reconstruction) -> pycolmap.Reconstruction:
    """Adjust a model in place, as `map_images` does but for the loss."""
    options = pycolmap.BundleAdjustmentOptions(print_summary=False)
    options.ceres.use_gpu = False
    pycolmap.bundle_adjustment(model, options)
    return model


def read_again(model: pycolmap.Reconstruction, folder: Path) -> SparseModel:
    """Write a model and read it."""
    folder.mkdir(exist_ok=True)
    model.write_binary(folder)
    return read_model(folder)


def covariances_of_colmap(model: pycolmap.Reconstruction) -> tuple[np.ndarray, np.ndarray]:
    """Compute covariances of centers and lens by COLMAP, for keypoints of unit noise; the centers move least."""
    numbers = sorted(model.reg_image_ids(), key=lambda number: model.image(number).name)
    config = pycolmap.BundleAdjustmentConfig()
    for number in numbers:
        config.add_image(number)
    config.fix_gauge(pycolmap.BundleAdjustmentGauge.THREE_POINTS)
    options = pycolmap.BundleAdjustmentOptions(print_summary=False)
    options.ceres.use_gpu = False
    adjuster = pycolmap.create_default_ceres_bundle_adjuster(options, config, model)
    found = pycolmap.estimate_ba_covariance(pycolmap.BACovarianceOptions(), model, adjuster)
    assert found is not None
    count = len(numbers)
    pairs = np.zeros((count, 6, count, 6))
    by_pose = np.zeros((count, 3, 6))
    for a, one in enumerate(numbers):
        pairs[a, :, a] = found.get_cam_cov_from_world(one)
        for b, other in enumerate(numbers[:a]):
            pairs[a, :, b] = found.get_cam_cross_cov_from_world(one, other)
            pairs[b, :, a] = pairs[a, :, b].T
        pose = model.image(one).cam_from_world()
        turn, (x, y, z) = pose.rotation.matrix(), pose.translation
        by_pose[a, :, 3:] = -turn.T
        by_pose[a, :, :3] = -2.0 * turn.T @ np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])  # COLMAP: half angles
    centers = np.einsum("aij,ajbk,blk->aibl", by_pose, pairs, by_pose).reshape(3 * count, -1)
    places = np.array([model.image(number).projection_center() for number in numbers])
    places -= places.mean(axis=0)
    free = np.zeros((count, 3, 7))
    free[:, :, :3] = np.eye(3)
    for axis in range(3):
        free[:, :, 3 + axis] = np.cross(np.eye(3)[axis], places)
    free[:, :, 6] = places
    flat = free.reshape(-1, 7)
    least = np.eye(3 * count) - flat @ np.linalg.solve(flat.T @ flat, flat.T)
    moved = (least @ centers @ least.T).reshape(count, 3, count, 3)
    camera = next(iter(model.cameras.values()))
    lens = found.get_other_params_cov(camera.params)
    assert lens is not None
    return moved[np.arange(count), :, np.arange(count)], lens


@pytest.mark.parametrize("kind", ["SIMPLE_RADIAL", "OPENCV"])
def test_expected_errors_are_those_of_colmap(tmp_path: Path, kind: str) -> None:
    """Center by center, and for the lens with its correlations; COLMAP fixes three points, which is a little much."""
    model = adjusted(synthetic(kind, NOISE, 7, 400))
    found = precision_of(read_again(model, tmp_path / "model"))
    assert found is not None
    centers, lens = covariances_of_colmap(model)
    variance = found.residual**2
    np.testing.assert_allclose(found.centers, variance * centers, rtol=0.01, atol=1e-3 * variance * centers.max())
    sigma = np.sqrt(np.diag(lens))
    np.testing.assert_allclose(found.lens_sigma, found.residual * sigma, rtol=0.01)
    np.testing.assert_allclose(found.correlation, lens / np.outer(sigma, sigma), atol=0.01)
    assert found.residual == pytest.approx(NOISE, rel=0.1)


def test_many_adjustments_scatter_as_expected(tmp_path: Path, record_proof: RecordProof) -> None:
    """Of one scene with other noise each time: focal length and centers scatter by what is said of the first."""
    focal, centers = [], []
    said = None
    for seed in range(TRIES):
        model = synthetic("SIMPLE_RADIAL", 0.0, 7, 80)
        noise = np.random.default_rng(seed)
        for image in model.images.values():
            for point in image.points2D:
                point.xy = point.xy + NOISE * noise.standard_normal(2)
        found = read_again(adjusted(model), tmp_path / "model")
        said = precision_of(found) if said is None else said
        focal.append(found.camera_params[0])
        places = found.poses[:, :3, 3]
        if centers:
            fit = pycolmap.estimate_sim3d(places, centers[0])
            assert fit is not None
            places = fit.scale * places @ fit.rotation.matrix().T + fit.translation
        centers.append(places)
    assert said is not None
    ratio = np.sqrt((np.var(centers, axis=0)).sum(axis=1) / np.einsum("ijj->i", said.centers))
    figures = {"focal_scatter_over_expected": float(np.std(focal) / said.lens_sigma[0])}
    figures |= {"center_scatter_over_expected_median": float(np.median(ratio))}
    figures |= {"center_scatter_over_expected_worst": float(ratio[np.argmax(np.abs(np.log(ratio)))])}
    record_proof("report: cameras and lens scatter as expected", TRIES, 5, figures)
    assert np.std(focal) == pytest.approx(said.lens_sigma[0], rel=0.25)
    scatter = np.sqrt((np.var(centers, axis=0)).sum(axis=1))
    expected = np.sqrt(np.einsum("ijj->i", said.centers))
    np.testing.assert_allclose(scatter, expected, rtol=0.35)


def test_what_has_no_errors_to_expect(tmp_path: Path) -> None:
    """Two images with too few keypoints; and an image that shares no point with the others."""
    model = read_again(synthetic("SIMPLE_RADIAL", NOISE, 3, 80), tmp_path / "model")
    few = model.obs_point < 3

    def with_seen(kept: np.ndarray) -> SparseModel:
        seen = {name: getattr(model, name)[kept] for name in ("obs_point", "obs_image", "obs_uv")}
        return SparseModel(**{**{name: getattr(model, name) for name in model.__dataclass_fields__}, **seen})

    whole = precision_of(model)
    assert whole is not None
    alone = replace(
        model,
        points=np.concatenate([model.points, [model.poses[0, :3, 3] + model.poses[0, :3, 0], model.points[0]]]),
        obs_point=np.concatenate([model.obs_point, len(model.points) + np.array([0, 0, 1])]),
        obs_image=np.concatenate([model.obs_image, [0, 0, 1]]),
        obs_uv=np.concatenate([model.obs_uv, np.full((3, 2), 9.0)]),
    )  # a point beside the camera, and one that one image sees
    same = precision_of(alone)
    assert same is not None
    np.testing.assert_allclose(same.centers, whole.centers, rtol=1e-6)
    assert precision_of(with_seen(few)) is None
    assert precision_of(with_seen(model.obs_image < 2)) is None
