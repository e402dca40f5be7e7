"""The working camera: a lens with distortion undone and found again, pixel for pixel."""

import cv2
import numpy as np
import pytest

from groundwork.errors import RejectedSceneError
from recon.dense.undistort import covered, undistort, working_camera
from recon.sfm.colmap_model import SparseModel

SIZE = (200, 150)


def model_with(params: tuple[float, ...], name: str = "SIMPLE_RADIAL") -> SparseModel:
    """Make a model that knows only its camera."""
    none = np.zeros((0, 3))
    return SparseModel(
        (),
        np.zeros((0, 4, 4)),
        name,
        params,
        none,
        none.astype(np.uint8),
        np.zeros(0),
        np.zeros(0, np.int64),
        np.zeros(0, np.int64),
        np.zeros((0, 2)),
    )


@pytest.mark.parametrize("k1", [-0.1, 0.0, 0.08])
@pytest.mark.parametrize("downscale", [1, 2, 4])
def test_points_come_back_to_their_pixels(k1: float, downscale: int) -> None:
    """What the working camera shows at a place, the photograph shows where COLMAP's model says."""
    camera = working_camera(model_with((150.0, 99.0, 76.0, k1)), SIZE, downscale)
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-0.5, 0.5, 300), rng.uniform(-0.4, 0.4, 300)])
    square = (points**2).sum(axis=1, keepdims=True)
    photograph = 150.0 * points * (1 + k1 * square) + [99.0, 76.0]
    pinhole = camera.pinhole
    working = points * [pinhole.fx, pinhole.fy] + [pinhole.cx, pinhole.cy]
    np.testing.assert_allclose(camera.to_photograph(working), photograph, atol=1e-9)


@pytest.mark.parametrize("k1", [-0.1, 0.0, 0.08])
def test_the_picture_moves_with_the_points(k1: float) -> None:
    """Gray values in closed form lie where the pixels say; half a pixel of shift would show."""
    camera = working_camera(model_with((150.0, 99.0, 76.0, k1)), SIZE, 1)

    def shade(places: np.ndarray) -> np.ndarray:
        return 128 + 55 * np.sin(places[..., 0] / 5) + 55 * np.sin(places[..., 1] / 6)

    column, row = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
    gray = np.round(shade(np.stack([column, row], axis=-1))).astype(np.uint8)
    straight = undistort(np.repeat(gray[..., None], 3, axis=2), camera)[..., 0].astype(float)
    pinhole = camera.pinhole
    column, row = np.meshgrid(np.arange(pinhole.width) + 0.5, np.arange(pinhole.height) + 0.5)
    inside = cv2.erode(covered(camera).astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    assert inside.mean() > 0.7
    errors = []
    for shift in (0.0, 0.5):
        expected = shade(camera.to_photograph(np.stack([column + shift, row], axis=-1).astype(np.float64)))
        errors.append(float(np.abs(straight - expected)[inside].mean()))
    assert errors[0] < 0.8
    assert errors[1] > 3.0


def test_a_barrel_keeps_its_corners() -> None:
    """A barrel-shaped photograph grows at its corners when it is straightened; beside its sides nothing was seen."""
    camera = working_camera(model_with((150.0, 100.0, 75.0, -0.1)), SIZE, 1)
    assert camera.pinhole.width > SIZE[0]
    corner = camera.to_photograph(np.array([0.5, 0.5]))
    assert (np.abs(corner) < 1.5).all()
    mask = covered(camera)
    assert not mask[0, mask.shape[1] // 2]
    assert mask[mask.shape[0] // 2, mask.shape[1] // 2]


def test_every_camera_model_is_read() -> None:
    """COLMAP orders parameters differently for each model."""
    simple = working_camera(model_with((150.0, 99.0, 76.0), "SIMPLE_PINHOLE"), SIZE, 1)
    assert (simple.pinhole.fy, simple.pinhole.cx, simple.pinhole.cy) == (150.0, 99.0, 76.0)
    full = working_camera(model_with((150.0, 151.0, 99.0, 76.0, 0.01, 0.02, 0.003, 0.004), "OPENCV"), SIZE, 1)
    assert (full.photograph.fy, full.photograph.cx) == (151.0, 99.0)
    assert vars(full.distortion) == {"k1": 0.01, "k2": 0.02, "p1": 0.003, "p2": 0.004}


def test_a_lens_that_folds_is_refused() -> None:
    """A distortion that cannot be undone inside the image gives a reason."""
    with pytest.raises(RejectedSceneError) as rejected:
        working_camera(model_with((60.0, 100.0, 75.0, -0.4)), SIZE, 1)
    assert rejected.value.reason == "bad_lens"
