"""How sure the place of a point is, against a closed form, a loop, and keypoints that are really off."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from groundwork.errors import RejectedSceneError
from recon.placing.similarity import Similarity
from recon.points import precision
from recon.points.fates import FATES
from recon.points.observations import Observations
from recon.points.placed_points import PlacedPoints, place_sparse
from recon.points.precision import deviations, keypoint_noise
from recon.settings import ReconSettings
from recon.sfm.colmap_model import SparseModel

F64 = NDArray[np.float64]
FOCAL = 800.0


def observations(images: list[list[int]]) -> Observations:
    """Say by which images each point was seen, anywhere."""
    start = np.concatenate([[0], np.cumsum([len(row) for row in images])])
    return Observations(start, np.concatenate(images).astype(np.int64), np.zeros((start[-1], 2)))


def test_two_cameras_abreast_have_a_closed_form() -> None:
    """Seen from both ends of a base b at the distance D, a point spreads by D^2 / (f b / 2) / sqrt(2) in depth."""
    base, depth = 2.0, 30.0
    centers = np.array([[-base / 2, 0, 0], [base / 2, 0, 0]])
    square = depth**2 + base**2 / 4
    expected = square / (FOCAL * base / 2) / np.sqrt(2)
    found = deviations(np.array([[0.0, 0.0, depth]]), centers, FOCAL, observations([[0, 1]]))
    np.testing.assert_allclose(found, [expected], rtol=1e-9)


def test_parallel_rays_tell_no_depth() -> None:
    """Two photographs from one place, and a point exactly between two cameras."""
    centers = np.array([[0.0, 0, 0], [0, 0, 0], [0, 0, 20]])
    found = deviations(np.tile([0.0, 0, 10], (2, 1)), centers, FOCAL, observations([[0, 1], [0, 2]]))
    assert np.isinf(found).all()


def test_keypoints_that_are_off_spread_points_so_far() -> None:
    """Triangulated anew from keypoints with one pixel of noise, a point strays by what was told."""
    rng = np.random.default_rng(4)
    centers, point = rng.uniform(-4, 4, (3, 3)) * [1, 1, 0.2], np.array([0.5, -0.3, 25.0])
    rays = point - centers

    def residuals(place: F64, seen: F64) -> F64:
        local = place - centers  # three cameras that all look along z
        return (FOCAL * local[:, :2] / local[:, 2:] - seen).ravel()

    truth = FOCAL * rays[:, :2] / rays[:, 2:]
    steps = np.array([residuals(point + 1e-6 * axis, truth) for axis in np.eye(3)]).T / 1e-6
    solve = np.linalg.pinv(steps)  # one step of Gauss and Newton: the noise is small beside the distance
    strayed = np.array([solve @ rng.normal(size=6) for _ in range(4000)])
    worst = np.sqrt(np.linalg.eigvalsh(np.cov(strayed.T))[-1])
    found = deviations(point[None], centers, FOCAL, observations([[0, 1, 2]]))
    assert found[0] == pytest.approx(worst, rel=0.06)  # the picture's corners stretch a pixel, rays do not


def test_has_a_plain_twin_in_any_portion(monkeypatch: pytest.MonkeyPatch) -> None:
    """Point by point, camera by camera; however few observations are taken at once."""
    rng = np.random.default_rng(8)
    centers, points = rng.normal(size=(9, 3)) * 5, rng.normal(size=(40, 3)) * 3 + [0, 0, 20]
    images = [rng.choice(9, rng.integers(2, 6), replace=False).tolist() for _ in points]
    twin = []
    for point, row in zip(points, images, strict=True):
        information = np.zeros((3, 3))
        for image in row:
            ray = point - centers[image]
            away = np.linalg.norm(ray)
            information += (FOCAL / away) ** 2 * (np.eye(3) - np.outer(ray, ray) / away**2)
        twin.append(np.sqrt(np.linalg.eigvalsh(np.linalg.inv(information))[-1]))
    for chunk in (1, 7, 1000):
        monkeypatch.setattr(precision, "_CHUNK", chunk)
        np.testing.assert_allclose(deviations(points, centers, FOCAL, observations(images)), twin, rtol=1e-7)


def example(far_images: list[int]) -> SparseModel:
    """A near point seen by two of four cameras abreast, one far point by two, and another by those named."""
    poses = np.tile(np.eye(4), (4, 1, 1))
    poses[:, 0, 3] = [0.0, 0.5, 1.0, 1.5]
    images = [0, 1, 1, 2, *far_images]
    return SparseModel(
        names=("a", "b", "c", "d"),
        poses=poses,
        camera_model="SIMPLE_RADIAL",
        camera_params=(FOCAL, 0.0, 0.0, 0.0),
        points=np.array([[0, 0, 2.0], [0, 0, 60.0], [1, 0, 60.0]]),
        colors=np.zeros((3, 3), np.uint8),
        errors=np.full(3, 0.4),
        obs_point=np.array([0, 0, 1, 1, *(2 for _ in far_images)]),
        obs_image=np.array(images),
        obs_uv=np.arange(2.0 * len(images)).reshape(-1, 2),
    )


def placed(model: SparseModel, *, scale: float = 1.0, metric: bool = True, **settings: Any) -> PlacedPoints:
    """Place a model whose cameras are all valid."""
    similarity = Similarity(scale, np.eye(3), np.zeros(3))
    chosen = ReconSettings.model_validate(settings)
    return place_sparse(model, np.arange(4), np.ones(4, bool), similarity, chosen, metric=metric)


def fates(model: SparseModel, **how: Any) -> list[str]:
    """Name what becomes of each point."""
    return [FATES[number] for number in placed(model, **how).fate]


def test_unsure_points_go() -> None:
    """A near point stays, a far one does not, however many views from nearly one place; without meters, all do."""
    found = placed(example([0, 1, 2, 3]))
    assert found.judged.all()
    assert found.coord[:, 2].tolist() == [2.0, 60.0, 60.0]
    assert found.seen.start.tolist() == [0, 2, 4, 8]
    assert fates(example([0, 1, 2, 3])) == ["kept", "deviation", "deviation"]
    assert fates(example([0, 1, 2, 3]), sure_views=4) == ["kept", "deviation", "kept"]
    assert fates(example([0, 1, 2, 3]), sure_views=2) == ["kept"] * 3
    assert fates(example([0, 1, 2, 3]), metric=False) == ["kept"] * 3
    assert fates(example([0, 1, 2, 3]), scale=0.005) == ["kept"] * 3  # the limit is one of the world's meters
    assert fates(example([0, 1, 2, 3]), min_views=3, sure_views=2) == ["views", "views", "kept"]
    poor = replace(example([0, 1, 2, 3]), errors=np.array([3.0, 0.4, 0.4]))
    assert fates(poor, sure_views=2) == ["reprojection", "kept", "kept"]


def test_what_its_keypoints_miss_decides_with_the_rays() -> None:
    """Of two points with the same rays, the one whose keypoints agree stays; where all agree, so does the other."""
    near = example([0, 1, 2, 3])
    near = replace(near, points=np.array([[0, 0, 12.0], [0, 0, 12.0], [1, 0, 12.0]]))
    limit = {"max_deviation": 0.5}
    assert fates(replace(near, errors=np.array([0.05, 1.6, 0.1])), **limit)[:2] == ["kept", "deviation"]
    point = np.repeat(np.arange(3, 303), 4)
    crowd = replace(  # three hundred more points, seen four times each, whose keypoints agree to a tenth of a pixel
        near,
        points=np.vstack([near.points, np.tile([0.3, 0.0, 5.0], (300, 1))]),
        colors=np.zeros((303, 3), np.uint8),
        errors=np.array([0.5, 0.5, *[0.1] * 301]),
        obs_point=np.concatenate([near.obs_point, point]),
        obs_image=np.concatenate([near.obs_image, np.tile([0, 1, 2, 3], 300)]),
        obs_uv=np.zeros((8 + 1200, 2)),
    )
    assert fates(replace(near, errors=np.full(3, 0.5)), max_deviation=0.25)[:2] == ["deviation"] * 2
    assert fates(crowd, max_deviation=0.25)[:2] == ["kept"] * 2


def test_keypoint_noise_is_found_from_what_points_leave_over() -> None:
    """Drawn keypoints: from 3 views on the common deviation comes back, of two views it is taken over; a bad one shows.

    The 4,000 points leave more than 12,000 numbers, so that their deviation is known to 1 % (and 2 % for distances
    that are not quite Rayleigh's after a fit); an error of a factor such as n for n - 3/2 would be 30 %.
    """
    rng = np.random.default_rng(4)
    for true in (0.2, 0.7):
        errors, views = [], rng.integers(3, 8, 4000)
        for count in views:
            design = np.linalg.qr(rng.normal(size=(2 * count, 3)))[0]
            drawn = rng.normal(scale=true, size=2 * count)
            left = drawn - design @ (design.T @ drawn)
            errors.append(np.linalg.norm(left.reshape(-1, 2), axis=1).mean())
        both = np.array([*errors, 0.0, 0.6 * true, 12 * true])
        noise = keypoint_noise(both, np.array([*views, 2, 2, 5]))
        common = np.sqrt(np.mean(noise[:-3] ** 2))
        assert common == pytest.approx(true, rel=0.06)
        assert 0.8 * true < noise[-3] < true  # no residual of two views says little
        assert noise[-1] > 5 * true
    assert keypoint_noise(np.full(3, 0.01), np.full(3, 3)) == pytest.approx(
        np.full(3, 0.9), abs=0.15
    )  # too few to know


def test_an_image_counts_once() -> None:
    """A track with two keypoints of one image has no more cameras, and no more rays, by them."""
    assert fates(example([0, 1, 2, 2]), sure_views=4) == ["kept", "deviation", "deviation"]
    seen = observations([[3, 1, 3], [0, 2], [2, 2, 2]])
    once = seen.once()
    assert once.counts.tolist() == [2, 2, 1]
    assert once.image.tolist() == [3, 1, 0, 2, 2]


def test_when_no_point_is_sure_the_settings_are_named() -> None:
    """Three photographs from far away make no cloud, and the reason says what would."""
    with pytest.raises(
        RejectedSceneError, match=r"all 3 points .* \[recon\] max_deviation, or set sure_views = 2"
    ) as found:
        placed(example([0, 1, 2]), max_deviation=1e-6)
    assert found.value.reason == "no_points"
