"""Lens distortion: the same numbers as OpenCV and COLMAP, an exact inverse, and an error where there is none."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from groundwork.errors import InputError
from usd_schemas.distortion import Distortion

LENS = Distortion(-0.11, 0.04, 0.0007, -0.0012)


def grid(half_width: float, half_height: float) -> np.ndarray:
    """Normalised coordinates all over an image [1]."""
    x, y = np.meshgrid(np.linspace(-half_width, half_width, 21), np.linspace(-half_height, half_height, 17))
    return np.stack([x, y], axis=-1)


def test_agrees_with_opencv_and_colmap() -> None:
    """Both libraries put a point where we put it, pixel conventions considered."""
    import cv2
    import pycolmap

    xy = grid(0.7, 0.5).reshape(-1, 2)
    ours = LENS.distort(xy)
    coefficients = np.array([LENS.k1, LENS.k2, LENS.p1, LENS.p2])
    points = np.column_stack([xy, np.ones(len(xy))])
    theirs, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), np.eye(3), coefficients)
    np.testing.assert_allclose(ours, theirs[:, 0], atol=1e-12)
    camera = pycolmap.Camera(model="OPENCV", width=1280, height=960, params=[900, 910, 655, 470, *coefficients])
    np.testing.assert_allclose(ours * [900, 910] + [655, 470], np.asarray(camera.img_from_cam(points)), atol=1e-9)


@given(k1=st.floats(-0.25, 0.3), k2=st.floats(-0.05, 0.1), p1=st.floats(-0.005, 0.005), p2=st.floats(-0.005, 0.005))
def test_undistort_inverts_distort(k1: float, k2: float, p1: float, p2: float) -> None:
    """There and back, to within rounding, over an image of 74 degrees and more."""
    lens = Distortion(k1, k2, p1, p2)
    xy = grid(0.75, 0.5)
    np.testing.assert_allclose(lens.undistort(lens.distort(xy)), xy, atol=1e-9)


def test_newton_squares_its_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """Six steps are enough all over an image of a lens that is strongly decentered: slopes are asked once more."""
    lens, count, slopes = Distortion(-0.11, 0.04, 0.02, -0.03), [0], Distortion.slopes

    def counted(self: Distortion, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        count[0] += 1
        return slopes(self, xy)

    monkeypatch.setattr(Distortion, "slopes", counted)
    np.testing.assert_allclose(lens.undistort(lens.distort(grid(0.7, 0.5))), grid(0.7, 0.5), atol=1e-12)
    assert count[0] <= 6 + 1


def test_no_point_beyond_a_fold_is_handed_out() -> None:
    """A lens that folds at 1.04, asked near its fold, where Newton's method comes from the far side: refused."""
    lens = Distortion(0.6, -0.5)
    fold = np.sqrt((1.8 + np.sqrt(1.8**2 + 10.0)) / 5.0)  # 1 + 3 k1 r² + 5 k2 r⁴ = 0
    outermost = fold * (1.0 + 0.6 * fold**2 - 0.5 * fold**4)
    for share in np.linspace(0.2, 0.9999, 40):
        for aside in (np.array([1.0, 0.0]), np.array([1.0, 1.0]) / np.sqrt(2.0), np.array([0.28, -0.96])):
            try:
                found = lens.undistort(share * outermost * aside[None])
            except InputError:
                assert share * outermost > 1.0  # nearer than that it starts before the fold, and stays there
            else:
                assert np.linalg.norm(found) < fold


def test_slopes_are_the_derivatives() -> None:
    """Central differences find the same slopes, all over the image; else Newton is slow and folds hide."""
    step, xy = 1e-5, grid(0.7, 0.5)
    lens = Distortion(-0.11, 0.04, 0.01, -0.02)
    by_x, by_y = (
        (lens.distort(xy + np.array(aside)) - lens.distort(xy - np.array(aside))) / (2 * step)
        for aside in ((step, 0.0), (0.0, step))
    )
    xx, mixed, yy = lens.slopes(xy)
    for found, wanted in ((xx, by_x[..., 0]), (mixed, by_x[..., 1]), (mixed, by_y[..., 0]), (yy, by_y[..., 1])):
        np.testing.assert_allclose(found, wanted, atol=1e-9)


def test_a_lens_that_folds_is_refused() -> None:
    """Pure barrel x + k1 x³ turns back at x = 1 / sqrt(-3 k1): just inside there is an inverse, just outside none."""
    lens = Distortion(k1=-1.0 / 3.0)  # turns at x = 1, where it draws 2 / 3
    inside = np.array([[2.0 / 3.0 - 1e-4, 0.0]])
    found = lens.undistort(inside)
    np.testing.assert_allclose(lens.distort(found), inside, atol=1e-11)
    assert 0.98 < found[0, 0] < 1.0
    with pytest.raises(InputError, match=r"k1 -0.333.*has no inverse 0.667 focal lengths from the axis"):
        lens.undistort(np.array([[0.1, 0.0], [2.0 / 3.0 + 1e-4, 0.0]]))


@pytest.mark.parametrize("tangential", [0.0, 1e-3])
def test_a_lens_that_rises_again_beyond_its_fold_is_refused(tangential: float) -> None:
    """A lens that folds at 0.651 has no inverse at 0.68, though the polynomial comes to 0.68 again farther out."""
    lens = Distortion(-0.4, 0.05, tangential, -tangential)
    aside = np.array([[1.0, 0.0], [0.6, 0.8], [0.0, -1.0]])
    assert (np.linalg.norm(lens.undistort(0.64 * aside), axis=1) < 1.036).all()
    for row in aside:
        with pytest.raises(InputError, match=r"has no inverse 0.68 focal lengths from the axis"):
            lens.undistort(0.68 * row[None])


def test_a_fold_is_found_off_the_axes_too() -> None:
    """A lens that folds at 0.602, of which only the radial slope is negative there: no inverse at 0.62, any way out."""
    lens = Distortion(-0.5, 0.1023)
    for aside in ([1.0, 0.0], [0.6, 0.8], [np.sqrt(0.5), -np.sqrt(0.5)]):
        assert np.linalg.norm(lens.undistort(0.6 * np.array([aside]))) < 1.0123
        with pytest.raises(InputError, match=r"has no inverse 0.62 focal lengths from the axis"):
            lens.undistort(0.62 * np.array([aside]))


def test_the_default_is_no_distortion() -> None:
    """Identity both ways, to the bit."""
    xy = grid(0.7, 0.5)
    assert Distortion().is_identity
    assert not LENS.is_identity
    np.testing.assert_array_equal(Distortion().distort(xy), xy)
    np.testing.assert_array_equal(Distortion().undistort(xy), xy)
