"""Images that GPS contradicts: found wherever the fixes can tell, and none besides."""

import numpy as np
import pycolmap
import pytest
from numpy.typing import NDArray

from recon.sfm.misplaced import Fixes, misplaced_images, predicted_covariance
from tests.conftest import Count, RecordProof

F64 = NDArray[np.float64]
SIGMA = 0.8  # [m] of a fix along each axis


def _model(centers: F64) -> pycolmap.Reconstruction:
    """Place the cameras of a model, in units and axes of its own."""
    pycolmap.set_random_seed(1)
    frames = pycolmap.SyntheticDatasetOptions(
        num_rigs=1, num_cameras_per_rig=1, num_frames_per_rig=len(centers), num_points3D=20
    )
    model = pycolmap.synthesize_dataset(frames)
    turn = np.array([[0.0, -1.0, 0.0], [0.6, 0.0, -0.8], [0.8, 0.0, 0.6]])
    for number, place in enumerate(centers, 1):
        pose = model.image(number).cam_from_world()
        own = 0.2 * turn @ place + [3.0, -1.0, 2.0]
        model.frame(model.image(number).frame_id).rig_from_world = pycolmap.Rigid3d(
            pose.rotation, -(pose.rotation.matrix() @ own)
        )
    return model


def _fixes(model: pycolmap.Reconstruction, measured: F64) -> Fixes:
    return {model.image(number).name: tuple(fix) for number, fix in enumerate(measured.tolist(), 1)}


def test_the_second_tower_is_told_from_the_first(proof_count: Count, record_proof: RecordProof) -> None:
    """Of a hundred flights none loses a camera that is right, and none keeps one that stands at the other tower."""
    rng, rounds = np.random.default_rng(4), proof_count(20, 400)
    lost = kept = 0
    for _ in range(rounds):
        tower = rng.uniform((-8, -6, 2), (8, 6, 30), (30, 3))
        right, other = rng.uniform((8, -6, 2), (30, 6, 30), (12, 3)), rng.uniform((42, -6, 2), (58, 6, 30), (12, 3))
        true = np.concatenate([tower, right, other])
        model = _model(np.concatenate([tower, right, other - [50.0, 0.0, 0.0]]))
        fixes = _fixes(model, true + rng.normal(0, SIGMA, true.shape) + rng.normal(0, 2.0, 3))
        found = set(misplaced_images(model, range(1, 31), fixes))
        lost += len(found & set(range(31, 43)))
        kept += len(set(range(43, 55)) - found)
    assert (lost, kept) == (0, 0)
    figures = {"right_lost": lost, "wrong_kept": kept, "sigma_m": SIGMA}
    record_proof("recon: look-alike towers distinguished by GPS", rounds, 4, figures)


def test_what_nothing_tells_is_not_confirmed() -> None:
    """Cameras in a row leave the rotation about it open, and confirm two directions; a cluster confirms nothing far."""
    wind = np.random.default_rng(1).normal(0, 0.03, (2, 12))
    row = np.column_stack([np.linspace(0, 20, 12), wind[0], 5.0 + wind[1]])
    true = np.concatenate([row, [[24.0, 0.0, 5.0], [10.0, 12.0, 5.0], [10.0, 12.0, 5.0]]])
    model = _model(true)
    turned, along = [10.0, 12 * np.cos(0.4), 5 + 12 * np.sin(0.4)], [18.0, 12.0, 5.0]
    fixes = _fixes(model, np.concatenate([true[:13], [turned, along]]))
    assert misplaced_images(model, range(1, 13), fixes) == [15]
    few = {name: fix for name, fix in fixes.items() if name != model.image(13).name}
    assert misplaced_images(model, range(1, 13), few) == [13, 15]
    assert misplaced_images(model, [1, 2, 3], fixes) == list(range(4, 16))
    assert misplaced_images(model, range(1, 16), {}) == []
    cluster = _model(np.concatenate([0.1 * row, [[60.0, 0.0, 5.0]]]))
    assert misplaced_images(cluster, range(1, 13), _fixes(cluster, np.concatenate([0.1 * row, [[60.0, 0, 5]]]))) == [13]


@pytest.mark.parametrize("long", [1.0, 6.0])
def test_variance_is_that_of_repeated_fits(long: float) -> None:
    """A thousand fits to noisy places scatter at other places as predicted."""
    rng = np.random.default_rng(2)
    known, asked = rng.normal(0, (5 * long, 5, 3), (15, 3)), rng.uniform(-40, 40, (6, 3))
    seen = []
    for _ in range(1000):
        fit = pycolmap.estimate_sim3d(known, known + rng.normal(0, 0.01, known.shape))
        assert fit is not None
        seen.append(fit.scale * asked @ fit.rotation.matrix().T + fit.translation)
    expected = predicted_covariance(known, asked)
    for k, wanted in enumerate(expected):
        scatter = np.cov(np.array(seen)[:, k].T) / 0.01**2
        assert np.linalg.norm(scatter - wanted) < 0.15 * np.linalg.norm(wanted)
