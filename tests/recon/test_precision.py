"""How sure the place of a point is, against a closed form, a loop, and keypoints that are really off."""

import numpy as np
import pytest
from numpy.typing import NDArray

from groundwork.errors import RejectedSceneError
from recon.placing.similarity import Similarity
from recon.points import precision
from recon.points.observations import Observations
from recon.points.placed_points import PlacedPoints, place_sparse
from recon.points.precision import deviations
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
    centres = np.array([[-base / 2, 0, 0], [base / 2, 0, 0]])
    square = depth**2 + base**2 / 4
    expected = square / (FOCAL * base / 2) / np.sqrt(2)
    found = deviations(np.array([[0.0, 0.0, depth]]), centres, FOCAL, observations([[0, 1]]))
    np.testing.assert_allclose(found, [expected], rtol=1e-9)


def test_parallel_rays_tell_no_depth() -> None:
    """Two photographs from one place, and a point exactly between two cameras."""
    centres = np.array([[0.0, 0, 0], [0, 0, 0], [0, 0, 20]])
    found = deviations(np.tile([0.0, 0, 10], (2, 1)), centres, FOCAL, observations([[0, 1], [0, 2]]))
    assert np.isinf(found).all()


def test_keypoints_that_are_off_spread_points_so_far() -> None:
    """Triangulated anew from keypoints with one pixel of noise, a point strays by what was told."""
    rng = np.random.default_rng(4)
    centres, point = rng.uniform(-4, 4, (3, 3)) * [1, 1, 0.2], np.array([0.5, -0.3, 25.0])
    rays = point - centres

    def residuals(place: F64, seen: F64) -> F64:
        local = place - centres  # three cameras that all look along z
        return (FOCAL * local[:, :2] / local[:, 2:] - seen).ravel()

    truth = FOCAL * rays[:, :2] / rays[:, 2:]
    steps = np.array([residuals(point + 1e-6 * axis, truth) for axis in np.eye(3)]).T / 1e-6
    solve = np.linalg.pinv(steps)  # one step of Gauss and Newton: the noise is small beside the distance
    strayed = np.array([solve @ rng.normal(size=6) for _ in range(4000)])
    worst = np.sqrt(np.linalg.eigvalsh(np.cov(strayed.T))[-1])
    found = deviations(point[None], centres, FOCAL, observations([[0, 1, 2]]))
    assert found[0] == pytest.approx(worst, rel=0.06)  # the picture's corners stretch a pixel, rays do not


def test_has_a_plain_twin_in_any_portion(monkeypatch: pytest.MonkeyPatch) -> None:
    """Point by point, camera by camera; however few observations are taken at once."""
    rng = np.random.default_rng(8)
    centres, points = rng.normal(size=(9, 3)) * 5, rng.normal(size=(40, 3)) * 3 + [0, 0, 20]
    images = [rng.choice(9, rng.integers(2, 6), replace=False).tolist() for _ in points]
    twin = []
    for point, row in zip(points, images, strict=True):
        information = np.zeros((3, 3))
        for image in row:
            ray = point - centres[image]
            away = np.linalg.norm(ray)
            information += (FOCAL / away) ** 2 * (np.eye(3) - np.outer(ray, ray) / away**2)
        twin.append(np.sqrt(np.linalg.eigvalsh(np.linalg.inv(information))[-1]))
    for chunk in (1, 7, 1000):
        monkeypatch.setattr(precision, "_CHUNK", chunk)
        np.testing.assert_allclose(deviations(points, centres, FOCAL, observations(images)), twin, rtol=1e-7)


def example(far_images: list[int]) -> SparseModel:
    """A near point seen by two of four cameras abreast, one far point by two, and another by those named."""
    poses = np.tile(np.eye(4), (4, 1, 1))
    poses[:, 0, 3] = [0.0, 0.5, 1.0, 1.5]
    images = [0, 1, 1, 2, *far_images]
    return SparseModel(
        names=("a", "b", "c", "d"), poses=poses, camera_model="SIMPLE_RADIAL", camera_params=(FOCAL, 0.0, 0.0, 0.0),
        points=np.array([[0, 0, 2.0], [0, 0, 60.0], [1, 0, 60.0]]), colors=np.zeros((3, 3), np.uint8),
        errors=np.full(3, 0.4), obs_point=np.array([0, 0, 1, 1, *(2 for _ in far_images)]),
        obs_image=np.array(images), obs_uv=np.arange(2.0 * len(images)).reshape(-1, 2),
    )  # fmt: skip


def placed(model: SparseModel, *, scale: float = 1.0, metric: bool = True, **settings: object) -> PlacedPoints:
    """Place a model whose cameras are all valid."""
    similarity = Similarity(scale, np.eye(3), np.zeros(3))
    chosen = ReconSettings.model_validate(settings)
    return place_sparse(model, np.arange(4), np.ones(4, bool), similarity, chosen, metric=metric)


def test_unsure_points_need_more_views() -> None:
    """Two views keep a point that is near; a far one needs four; without metres, nobody can tell."""
    found = placed(example([0, 1, 2, 3]))
    assert found.coord[:, 2].tolist() == [2.0, 60.0]
    assert found.seen.start.tolist() == [0, 2, 6]
    assert found.seen.uv[:, 0].tolist() == [0.0, 2.0, 8.0, 10.0, 12.0, 14.0]
    assert len(placed(example([0, 1, 2, 3]), metric=False).coord) == 3
    assert len(placed(example([0, 1, 2, 3]), sure_views=2).coord) == 3
    assert len(placed(example([0, 1, 2, 3]), scale=0.005).coord) == 3  # the limit is one of the world's metres


def test_an_image_counts_once() -> None:
    """A track with two keypoints of one image has no more cameras, and no more rays, by them."""
    assert len(placed(example([0, 1, 2, 2])).coord) == 1
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
