"""The alignment recovers known similarities, survives outliers and straight flights, and judges every camera."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from groundwork.errors import RejectedSceneError
from recon.placing.align import (
    CENTER_OUTLIER,
    OK,
    ROTATION_OUTLIER,
    UNREGISTERED,
    Target,
    align,
    center_limit,
    check_share,
    find_inliers,
    stand_upright,
)
from recon.placing.similarity import Similarity, angles, camera_up, fit_similarity, level_rotation, turn_upright
from recon.settings import AlignmentSettings
from usd_schemas.pinhole import look_at

F64 = NDArray[np.float64]
DEFAULT = AlignmentSettings(center_limit=0.25)
PAPER = AlignmentSettings(center_limit=0.25, method="paper")


def random_rotations(rng: np.random.Generator, count: int, degrees: float = 180.0) -> F64:
    """Draw rotations about random axes by up to an angle, shape (N, 3, 3), float64 (Rodrigues)."""
    axis = rng.normal(size=(count, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    angle = np.radians(rng.uniform(0, degrees, count))[:, None, None]
    cross = np.zeros((count, 3, 3))
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -axis[:, 2], axis[:, 1], -axis[:, 0]
    cross -= cross.transpose(0, 2, 1)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def flight(rng: np.random.Generator, centers: F64) -> tuple[F64, F64, Similarity]:
    """Make true poses at given centres, the same poses in model units, and the similarity between them."""
    true = np.tile(np.eye(4), (len(centers), 1, 1))
    true[:, :3, :3], true[:, :3, 3] = random_rotations(rng, len(centers)), centers
    known = Similarity(3.7, random_rotations(rng, 1)[0], np.array([120.0, -45.0, 8.0]))
    model = true.copy()
    model[:, :3, :3] = known.rotation.T @ true[:, :3, :3]
    model[:, :3, 3] = (centers - known.translation) @ known.rotation / known.scale
    return true, model, known


def target_of(true: F64, limit: float = 0.25) -> Target:
    """Make the target of true poses."""
    return Target("truth", true[:, :3, 3], true[:, :3, :3], limit)


@pytest.mark.parametrize("settings", [DEFAULT, PAPER])
def test_known_similarity_comes_back(settings: AlignmentSettings) -> None:
    """Exact poses give the exact similarity, and every camera is valid."""
    rng = np.random.default_rng(1)
    true, model, known = flight(rng, rng.normal(0, 8, (20, 3)))
    found = align(model, np.arange(20), target_of(true), settings, np.random.default_rng(2))
    assert found.similarity.scale == pytest.approx(known.scale, rel=1e-12)
    np.testing.assert_allclose(found.similarity.rotation, known.rotation, atol=1e-12)
    np.testing.assert_allclose(found.similarity.translation, known.translation, atol=1e-9)
    np.testing.assert_allclose(found.similarity.move_poses(model), true, atol=1e-9)
    assert set(found.status) == {OK}


@pytest.mark.parametrize("settings", [DEFAULT, PAPER])
def test_half_the_cameras_may_lie(settings: AlignmentSettings) -> None:
    """With 50 % of the centres misplaced by meters, the others still give the exact similarity."""
    rng = np.random.default_rng(3)
    true, model, known = flight(rng, rng.normal(0, 8, (40, 3)))
    liars = np.arange(40) % 2 == 1
    model[liars, :3, 3] += rng.normal(0, 2, (20, 3))
    found = align(model, np.arange(40), target_of(true), settings, np.random.default_rng(4))
    np.testing.assert_allclose(found.similarity.move(np.eye(3)), known.move(np.eye(3)), atol=1e-8)
    assert [code == CENTER_OUTLIER for code in found.status] == liars.tolist()


def test_turned_cameras_do_not_turn_the_result() -> None:
    """A camera in the right place that looks elsewhere is an outlier, and has no say in the mean rotation."""
    rng = np.random.default_rng(5)
    true, model, known = flight(rng, rng.normal(0, 8, (15, 3)))
    model[:5, :3, :3] = random_rotations(rng, 5) @ model[:5, :3, :3]
    found = align(model, np.arange(15), target_of(true), DEFAULT, np.random.default_rng(6))
    assert found.status == (ROTATION_OUTLIER,) * 5 + (OK,) * 10
    np.testing.assert_allclose(found.similarity.rotation, known.rotation, atol=1e-12)


@pytest.mark.parametrize(("degrees", "status"), [(1.9, OK), (2.1, ROTATION_OUTLIER)])
def test_two_degrees_make_a_rotation_outlier(degrees: float, status: str) -> None:
    """One of forty cameras turned by just less than 2 degrees, by default the limit, or by just more."""
    rng = np.random.default_rng(10)
    true, model, _ = flight(rng, rng.normal(0, 8, (40, 3)))
    model[7, :3, :3] = model[7, :3, :3] @ Rotation.from_rotvec([0, degrees, 0], degrees=True).as_matrix()
    found = align(model, np.arange(40), target_of(true), AlignmentSettings(center_limit=0.25), rng)
    assert found.status == (OK,) * 7 + (status,) + (OK,) * 32
    assert found.rotation_errors[7] == pytest.approx(degrees, abs=0.06)


def test_nearly_straight_flight_needs_rotations() -> None:
    """On a 30 m line with 1 cm of sway, centres leave the roll open: points 5 m off the path go astray by meters."""
    rng = np.random.default_rng(7)
    centers = np.column_stack([np.linspace(0, 30, 60), np.zeros(60), np.full(60, 3.0)])
    true, model, known = flight(rng, centers + rng.normal(0, 0.002, (60, 3)))
    model[:, :3, 3] += rng.normal(0, 0.03, (60, 3)) / known.scale
    model[:, :3, :3] = random_rotations(rng, 60, 0.2) @ model[:, :3, :3]
    aside = np.array([[15.0, 5.0, 3.0], [15.0, -5.0, 3.0], [15.0, 0.0, 8.0]])
    local = (aside - known.translation) @ known.rotation / known.scale
    full = AlignmentSettings(center_limit=0.25).method
    assert full == "centres+rotations"
    found = align(model, np.arange(60), target_of(true), DEFAULT, np.random.default_rng(8))
    assert np.linalg.norm(found.similarity.move(local) - aside, axis=1).max() < 0.03
    with pytest.raises(RejectedSceneError) as rejected:
        align(model, np.arange(60), target_of(true), PAPER, np.random.default_rng(8))
    assert rejected.value.reason == "straight_path"
    scale, rotation, translation = fit_similarity(model[:, :3, 3], true[:, :3, 3])
    assert np.linalg.norm(scale * local @ rotation.T + translation - aside, axis=1).max() > 0.5


def test_unregistered_cameras_and_unknown_positions() -> None:
    """A camera without a pose is unregistered; one without a position takes no part; rows keep their places."""
    rng = np.random.default_rng(9)
    true, model, known = flight(rng, rng.normal(0, 8, (10, 3)))
    rows = np.array([0, 2, 3, 4, 6, 7, 9])
    centers = true[:, :3, 3].copy()
    centers[4] = np.nan
    found = align(model[rows], rows, Target("gps", centers, None, 0.25), DEFAULT, np.random.default_rng(1))
    assert found.method == "centres"
    assert found.similarity.scale == pytest.approx(known.scale, rel=1e-9)
    assert [found.status[row] for row in (1, 5, 8)] == [UNREGISTERED] * 3
    assert found.status[4] == CENTER_OUTLIER
    assert np.isnan(found.center_errors[[1, 4, 5, 8]]).all()
    assert np.isfinite(found.center_errors[[0, 2, 3, 6, 7, 9]]).all()


@pytest.mark.parametrize("seed", range(8))
def test_wild_cameras_beside_unknown_positions(seed: int) -> None:
    """Where some positions are unknown and others miss by a kilometer, those that fit decide, however far the rest."""
    rng = np.random.default_rng(seed)
    true, model, _ = flight(rng, rng.normal(0, 8, (16, 3)))
    wild, unknown = np.arange(16) < 7, np.arange(16) >= 14
    goal = true[:, :3, 3].copy()
    goal[wild] += rng.normal(0, 1000, (7, 3))
    goal[unknown] = np.nan
    inliers = find_inliers(model[:, :3, 3], goal, ~unknown, 0.25, 500, np.random.default_rng(seed))
    assert (inliers == ~(wild | unknown)).all()


@pytest.mark.parametrize("kind", ["everything wrong", "two cameras", "one place"])
def test_hopeless_cameras_are_rejected(kind: str) -> None:
    """No agreement, too few cameras, or no extent: a reason code, no number."""
    rng = np.random.default_rng(10)
    true, model, _ = flight(rng, rng.normal(0, 8, (12, 3)))
    rows = np.arange(2 if kind == "two cameras" else 12)
    if kind == "everything wrong":
        model[:, :3, 3] = rng.normal(0, 8, (12, 3))
    if kind == "one place":
        model[:, :3, 3] = model[0, :3, 3]
    with pytest.raises(RejectedSceneError) as rejected:
        align(model[rows], rows, target_of(true, 0.05), DEFAULT, np.random.default_rng(11))
    assert rejected.value.reason == "alignment_failed"


@pytest.mark.parametrize(("invalid", "count", "passes"), [(4, 10, True), (5, 10, False), (2, 5, True), (21, 52, False)])
def test_forty_percent_is_the_limit(invalid: int, count: int, passes: bool) -> None:
    """Exactly 40 % of invalid cameras pass, one more does not."""
    status = (UNREGISTERED, CENTER_OUTLIER, ROTATION_OUTLIER) * count
    codes = status[:invalid] + (OK,) * (count - invalid)
    if passes:
        check_share(codes, DEFAULT)
        return
    with pytest.raises(RejectedSceneError, match=f"{invalid} of {count}") as rejected:
        check_share(codes, DEFAULT)
    assert rejected.value.reason == "too_few_cameras"


def test_center_limits() -> None:
    """0.25 m for a local survey; else half a percent of the diagonal, at most 0.5 m; or what the user says."""
    corners = np.array([[0.0, 0, 0], [30.0, 40.0, 0]])
    free = AlignmentSettings()
    assert center_limit(corners, "local", free) == 0.25
    assert center_limit(corners, "global", free) == pytest.approx(0.25)
    assert center_limit(2 * corners, "global", free) == pytest.approx(0.5)
    assert center_limit(9 * corners, "global", free) == 0.5
    assert center_limit(corners, "local", AlignmentSettings(center_limit=0.1)) == 0.1


def test_small_angles_stay_sharp() -> None:
    """An angle of 1e-6 degrees is not lost in an arc cosine."""
    turn = np.radians(1e-6)
    rotation = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    np.testing.assert_allclose(angles(np.stack([rotation, np.diag([-1.0, -1.0, 1.0])]), np.eye(3)), [1e-6, 180.0])


def level_flight(rng: np.random.Generator, centers: F64) -> tuple[F64, F64, Similarity]:
    """Make true poses that look about, pitched but level to half a degree, in world and model units."""
    _, _, known = flight(rng, centers)
    tilt = random_rotations(rng, len(centers), 0.5)
    looks = np.column_stack(
        [rng.normal(0, 0.4, len(centers)), np.ones(len(centers)), rng.uniform(-1, 0.3, len(centers))]
    )
    true = np.stack([look_at(eye, eye + look) for eye, look in zip(centers, looks, strict=True)])
    true[:, :3, :3] = tilt @ true[:, :3, :3]
    model = true.copy()
    model[:, :3, :3] = known.rotation.T @ true[:, :3, :3]
    model[:, :3, 3] = (centers - known.translation) @ known.rotation / known.scale
    return true, model, known


def test_without_positions_a_model_stands_upright() -> None:
    """Nothing known but the photographs: its own scale, up within a degree, cameras round the origin, none at fault."""
    rng = np.random.default_rng(13)
    _, model, known = level_flight(rng, rng.normal(0, 8, (30, 3)))
    turns = rng.integers(0, 4, 32)
    model[:, :3, :3] = turn_upright(model[:, :3, :3], -turns[:30] % 4)  # as pictures of cameras held this way or that
    found = stand_upright(
        model, np.arange(30), Target("none", np.full((32, 3), np.nan), None, 0.0, quarter_turns=turns)
    )
    assert found.similarity.scale == 1.0
    up = found.similarity.rotation @ known.rotation.T @ np.array([0.0, 0.0, 1.0])
    assert np.degrees(np.arccos(up[2])) < 1.0
    np.testing.assert_allclose(found.similarity.move_poses(model)[:, :3, 3].mean(axis=0), 0.0, atol=1e-9)
    assert found.status == (OK,) * 30 + (UNREGISTERED,) * 2


def test_cameras_that_look_down_know_up() -> None:
    """Nadir photographs turned every way: their rows are horizontal, and what is behind them is up."""
    yaw = np.linspace(0, 5, 12)
    down = np.stack([[[np.cos(a), np.sin(a), 0.0], [np.sin(a), -np.cos(a), 0.0], [0.0, 0.0, -1.0]] for a in yaw])
    assert np.allclose(np.linalg.det(down), 1.0)
    np.testing.assert_allclose(camera_up(down), [0.0, 0.0, 1.0], atol=0.05)


def test_pictures_are_turned_by_quarters() -> None:
    """Of a picture turned clockwise, the former bottom is left and the former left on top; four turns are none."""
    quarter = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    rotations = random_rotations(np.random.default_rng(5), 8)
    turns = np.arange(8) % 4
    found = turn_upright(rotations, turns)
    for rotation, count, mine in zip(rotations, turns.tolist(), found, strict=True):
        np.testing.assert_allclose(mine, rotation @ np.linalg.matrix_power(quarter, count), atol=1e-12)


def test_a_gimbal_says_where_up_is() -> None:
    """Half of the cameras know their own up: the median of it becomes +z; fewer do not count."""
    rng = np.random.default_rng(6)
    rotations, up = random_rotations(rng, 9), np.array([0.6, 0.0, 0.8])
    told = np.einsum("nji,j->ni", rotations, up)
    told[:4] = np.nan
    told[8] = -told[8]
    np.testing.assert_allclose(level_rotation(rotations, told) @ up, [0.0, 0.0, 1.0], atol=1e-12)
    told[4] = np.nan
    few, none = level_rotation(rotations, told), level_rotation(rotations)
    np.testing.assert_array_equal(few, none)
    np.testing.assert_allclose(none @ none.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(none @ camera_up(rotations), [0.0, 0.0, 1.0], atol=1e-12)
    assert np.linalg.det(none) > 0.0


def test_up_is_square_to_the_rows() -> None:
    """Level cameras pitched up or down: what their rows are square to, on the side of their tops."""
    for pitch in (-1.2, 0.0, 0.5):
        headings = np.linspace(0.0, 5.0, 7)
        poses = np.stack(
            [
                look_at(np.zeros(3), np.array([np.cos(pitch) * np.cos(h), np.cos(pitch) * np.sin(h), np.sin(pitch)]))
                for h in headings
            ]
        )
        np.testing.assert_allclose(camera_up(poses[:, :3, :3]), [0.0, 0.0, 1.0], atol=2e-3)
