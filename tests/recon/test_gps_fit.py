"""The robust fit to measured positions, piece by piece: derivatives, covariances and freedom against dense twins."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2

from recon.placing import gps_fit
from recon.placing.gps_fit import (
    Fit,
    _adjust,
    _alike,
    _covariances,
    _information,
    _left_over,
    _level,
    _serial_correlation,
    _step,
    fit_to_fixes,
)
from recon.placing.gravity import GravityCues, gravity_cues
from recon.placing.similarity import Similarity, derivatives, rotation_by
from tests.recon.test_align import random_rotations

F64 = NDArray[np.float64]
NO_LEVELS = GravityCues(np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(0, np.int64), np.zeros(3))


def similarity_of(rng: np.random.Generator) -> Similarity:
    """Draw a similarity."""
    return Similarity(float(rng.uniform(0.5, 3.0)), random_rotations(rng, 1)[0], rng.normal(0, 50, 3))


def fitted(goal: F64, noisy: F64, sigma: float = 1.0) -> Fit:
    """Fit a model at its true places to noisy fixes, without gravity."""
    stated = np.full(goal.shape, sigma)
    found = fit_to_fixes(goal, noisy, stated, NO_LEVELS, np.random.default_rng(0), flown=False)
    assert found is not None
    return found


def test_derivatives_are_those_of_the_moved_points() -> None:
    """Central differences by the logarithm of the scale, the rotation vector and the place find the same columns."""
    rng = np.random.default_rng(1)
    one, points, step = similarity_of(rng), rng.normal(0, 9, (6, 3)), 1e-6
    levels = gravity_cues(random_rotations(rng, 4), rng.normal(size=(4, 3)))

    def moved(parameters: F64) -> tuple[F64, F64]:
        rotation = rotation_by(parameters[1:4]) @ one.rotation
        places = one.scale * np.exp(parameters[0]) * points @ rotation.T + parameters[4:]
        return places, levels.directions @ rotation[2]

    for number, column in enumerate(np.eye(7) * step):
        ahead, back = moved(column), moved(-column)
        np.testing.assert_allclose(derivatives(one, points)[..., number], (ahead[0] - back[0]) / (2 * step), atol=1e-7)
        leaning = levels.derivatives(one.rotation)[:, number - 1] if 1 <= number < 4 else np.zeros(len(levels.heights))
        np.testing.assert_allclose(leaning, (ahead[1] - back[1]) / (2 * step), atol=1e-8)


def test_a_step_finds_growth_and_shift_at_once() -> None:
    """Without a turn the problem is linear: one step ends there, and tells growth plus shift over radius."""
    rng = np.random.default_rng(3)
    source = rng.normal(0, 9, (20, 3)) + np.array([400.0, -300.0, 80.0])  # far from the frame's origin
    middle, start = source.mean(axis=0), similarity_of(rng)
    goal = start.move(middle + 1.02 * (source - middle)) + np.array([0.3, -0.5, 0.2])
    found, moved = _step(start, source, goal, np.full((20, 3), 0.7), NO_LEVELS)
    assert found.scale == pytest.approx(start.scale * np.exp(0.02), rel=1e-9)
    radius = np.linalg.norm(source - middle, axis=1).max()
    assert moved == pytest.approx(0.02 + 0.5 / (radius * start.scale), rel=1e-7)
    at_middle = np.array([found.move(middle[None])[0], start.move(middle[None])[0] + [0.3, -0.5, 0.2]])
    np.testing.assert_allclose(at_middle[0], at_middle[1], atol=1e-9)


def test_a_fit_ends_when_it_has_settled(monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps of Gauss and Newton settle within a few; where no fix changes sides, the fit is made once."""
    rng, calls = np.random.default_rng(4), {"steps": 0, "fits": 0}

    def step(*given: object) -> object:
        calls["steps"] += 1
        return _step(*given)  # type: ignore[arg-type]

    def adjust(*given: object) -> object:
        calls["fits"] += 1
        return _adjust(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(gps_fit, "_step", step)
    monkeypatch.setattr(gps_fit, "_adjust", adjust)
    goal = rng.normal(0, 30, (40, 3))
    fit = fitted(goal, goal + rng.uniform(-1.0, 1.0, (40, 3)))  # none of them strays
    assert fit.agreeing.all()
    assert calls["fits"] == 1
    assert calls["steps"] < 100  # eight starts of some six, and a few for each round of deviations
    calls["steps"] = 0
    fitted(goal, goal)  # the fixes are exact: nothing is left to improve after the starts
    assert calls["steps"] < 100


def test_turns_are_rotations_about_their_vector() -> None:
    """The axis stays, a vector square to it turns by the length, handedness is kept; by next to nothing, too."""
    for length in (2.0, 1e-5, 1e-13):
        vector = np.array([2.0, -3.0, 6.0]) / 7.0 * length
        turn, square = rotation_by(vector), np.array([3.0, 2.0, 0.0]) / np.sqrt(13.0)
        np.testing.assert_allclose(turn @ vector, vector, rtol=1e-12)
        np.testing.assert_allclose(turn.T @ turn, np.eye(3), atol=1e-12)
        aside = np.cross(vector / length, square)
        np.testing.assert_allclose(turn @ square, np.cos(length) * square + np.sin(length) * aside, atol=1e-16)


@pytest.mark.parametrize("serial_correlation", [0.0, 0.4, 0.9])
def test_covariances_and_what_is_left_over_have_dense_twins(serial_correlation: float) -> None:
    """Matrices of correlation^|i - j|, written out: product, trace that a fit takes, the parameters' errors."""
    rng = np.random.default_rng(2)
    one, points, weights = similarity_of(rng), rng.normal(0, 9, (12, 3)), rng.uniform(0.2, 4.0, (12, 3))
    levels = gravity_cues(random_rotations(rng, 5, 20.0), None)
    number = np.arange(12)
    dense = serial_correlation ** np.abs(number[:, None] - number)
    np.testing.assert_allclose(_alike(points, serial_correlation), dense @ points, atol=1e-12)
    share = weights.sum(axis=1)
    jacobian = derivatives(one, points - share @ points / share.sum()) * np.sqrt(weights)[..., None]
    pull, turning = np.diag(levels.weights(one.rotation[2])), np.zeros((len(levels.heights), 7))
    turning[:, 1:4] = levels.derivatives(one.rotation)
    gravity = turning.T @ pull @ turning
    normal = sum(row.T @ row for row in jacobian) + gravity
    np.testing.assert_allclose(_information(jacobian, one, levels), normal, rtol=1e-9, atol=1e-9)
    inverse = np.asarray(np.linalg.inv(normal), np.float64)
    parts = [sum(jacobian[:, axis].T @ dense @ jacobian[:, axis] for axis in axes) for axes in ([0, 1], [2])]
    found = _covariances(one, points, weights, levels, serial_correlation)
    for mine, part in zip(found, (*parts, gravity), strict=True):
        np.testing.assert_allclose(mine, inverse @ part @ inverse, rtol=1e-6, atol=1e-12)
    for axes in ([0, 1], [2]):
        used = sum(np.trace(jacobian[:, axis] @ inverse @ jacobian[:, axis].T @ dense) for axis in axes)
        kept = _left_over(jacobian[:, axes], inverse, serial_correlation)
        assert kept == pytest.approx(max(12 * len(axes) - used, 0.0))


def test_the_level_of_errors_is_their_factor() -> None:
    """Squares at the quantiles of three normal errors, times a factor; wild ones change little; 0.1 at least."""
    quantiles = chi2.ppf((np.arange(999) + 0.5) / 999, 3)
    for factor in (0.5, 3.0):
        squares = factor**2 * quantiles
        assert _level(squares) == pytest.approx(factor / np.sqrt(1.0 - 7 / 2997), rel=0.01)
        squares[600:] = 1e9
        assert _level(squares) == pytest.approx(factor / np.sqrt(1.0 - 7 / 2997), rel=0.01)
    assert _level(0.0 * quantiles) == 0.1
    assert _level(np.array([2.366, 2.366, 2.366])) == pytest.approx(1.0 / np.sqrt(1.0 - 7 / 9))


def test_likeness_is_that_of_a_first_order_process() -> None:
    """White errors have none, those of a process that forgets slowly have its own, too few say nothing."""
    rng = np.random.default_rng(3)
    white = rng.normal(size=(4000, 3))
    assert _serial_correlation(white) == 0.0
    slow = np.zeros_like(white)
    for row in range(1, len(white)):
        slow[row] = 0.6 * slow[row - 1] + 0.8 * white[row]
    assert _serial_correlation(slow) == pytest.approx(0.6, abs=0.03)
    assert _serial_correlation(white[:11]) == _serial_correlation(slow[:11]) == 0.3
    assert _serial_correlation(np.ones((50, 3))) == 0.95
    pairs = np.tile(np.array([1.0, -1.0])[:, None], (20, 3))
    assert _serial_correlation(pairs) == 0.0


@pytest.mark.parametrize("count", [5, 9, 40])
def test_freedom_is_what_a_fit_leaves(count: int) -> None:
    """3 N measurements less 7 parameters leave 3 N - 7 degrees; two of the prior are shared between parts."""
    rng = np.random.default_rng(4)
    goal = rng.normal(0, 20, (count, 3))
    found = fitted(goal, goal + rng.normal(0, 0.5, goal.shape))
    kept = 3 * count - 7
    assert found.agreeing.all()
    assert found.freedom[:2].sum() == pytest.approx(kept + 4.0 * kept / (kept + 2.0), rel=1e-6)
    assert found.freedom[2] == 1e6


def test_deviations_come_from_the_residuals() -> None:
    """Stated deviations are mended along the ground and in height each by its own factor."""
    rng = np.random.default_rng(5)
    goal = rng.normal(0, 50, (400, 3))
    noise = rng.normal(size=goal.shape) * [0.5, 0.5, 4.0]
    found = fitted(goal, goal + noise, 2.0)
    np.testing.assert_allclose(found.sigmas, [0.25, 2.0], rtol=0.08)
    np.testing.assert_allclose(found.middle, goal.mean(axis=0), atol=0.5)
    np.testing.assert_allclose(
        np.sqrt(np.diag(found.covariances.sum(axis=0)))[4:], np.array([0.5, 0.5, 4.0]) / 20, rtol=0.1
    )
    assert not found.twofold


def test_what_strays_is_found_when_the_deviations_are_known() -> None:
    """Three fixes 3 m aside hide behind heights that are 2 m wrong, until the deviations along the ground are known."""
    rng = np.random.default_rng(6)
    goal = rng.normal(0, 30, (40, 3))
    noisy = goal + rng.normal(size=goal.shape) * [0.05, 0.05, 2.0]
    noisy[[5, 17, 30], 0] += [3.0, -3.0, 3.0]
    found = fitted(goal, noisy, 0.5)
    assert np.flatnonzero(~found.agreeing).tolist() == [5, 17, 30]
    assert found.sigmas[0] * 0.5 == pytest.approx(0.05, rel=0.3)


def test_fits_of_one_place_and_of_two_fixes_are_none() -> None:
    """Nothing fixes a scale there."""
    some = np.arange(9.0).reshape(3, 3) ** 2
    rng = np.random.default_rng(0)
    for source, goal in ((some[:2], some[:2]), (some, np.ones((3, 3))), (np.ones((3, 3)), some)):
        assert fit_to_fixes(source, goal, np.ones(goal.shape), NO_LEVELS, rng) is None
    assert fit_to_fixes(some, some, np.ones((3, 3)), NO_LEVELS, rng) is not None


def test_gravity_and_horizontal_positions_alone_give_a_start() -> None:
    """Without noise it is the similarity itself, whatever the deviations of the directions: heights are not used."""
    rng = np.random.default_rng(6)
    for _ in range(5):
        one, source = similarity_of(rng), rng.normal(0, 9, (7, 3))
        directions = random_rotations(rng, 6)[:, 0]
        heights, sigmas = directions @ one.rotation[2], rng.uniform(0.01, 3.0, 6)
        cues = GravityCues(directions, heights, sigmas, np.zeros(6, np.int64), np.zeros(3))
        goal = one.move(source)
        found = gps_fit._upright(source, goal, cues)
        np.testing.assert_allclose(found.move(source), goal, atol=1e-7)
        flat = goal.copy()
        flat[:, 2] = rng.normal(0, 99, 7)
        found = gps_fit._upright(source, flat, cues)
        np.testing.assert_allclose(found.move(source)[:, :2], goal[:, :2], atol=1e-7)


def test_a_start_settles_without_outliers_though_fixes_are_better_than_stated() -> None:
    """Weights follow the errors that there are: 1 cm stated as 1 m, and outliers of 5 m pull by no centimeter."""
    rng = np.random.default_rng(7)
    one, source = similarity_of(rng), rng.normal(0, 9, (60, 3))
    goal = one.move(source)
    noisy = goal + rng.normal(0, 0.01, goal.shape)
    noisy[::5] += [5.0, -5.0, 5.0]
    start = Similarity(one.scale * 1.01, one.rotation, one.translation + 0.3)
    found = gps_fit._settle(source, noisy, np.ones(goal.shape), NO_LEVELS, start)
    assert np.abs(found.move(source) - goal).max() < 0.02
