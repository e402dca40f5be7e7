"""The fit to surveyed points: its optimum is that of a general solver, its covariances are those of repeated draws."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from recon.placing.control_fit import SurveyedPoints, fit_to_points
from recon.placing.gravity import GravityCues
from recon.placing.marked_places import MarkedPlace, mark_variances
from recon.placing.similarity import Similarity, derivatives
from tests.conftest import Count
from tests.recon.test_align import random_rotations

F64 = NDArray[np.float64]
NO_LEVELS = GravityCues(np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(0, np.int64), np.zeros(3))


def drawn(known: Similarity, true: F64, spread: F64, seed: int) -> SurveyedPoints:
    """Draw the errors of the model's points and of the survey, one standard deviation of 2 cm along each axis."""
    draw, sigma = np.random.default_rng(seed), np.full(true.shape, 0.02)
    model = (true - known.translation) @ known.rotation / known.scale
    off = np.einsum("nij,nj->ni", np.linalg.cholesky(spread), draw.normal(size=true.shape))
    return SurveyedPoints(model + off, true + draw.normal(size=true.shape) * sigma, sigma, spread)


def seen_from_above(count: int, rng: np.random.Generator) -> tuple[Similarity, F64, F64]:
    """Make points that are known to 1 cm across one direction of the model, and to 20 cm along it."""
    known = Similarity(2.5, random_rotations(rng, 1)[0], rng.normal(0, 30, 3))
    axis = random_rotations(rng, 1)[0]
    spread = np.repeat((axis @ np.diag([0.2, 0.01, 0.01]) ** 2 @ axis.T)[None] / known.scale**2, count, axis=0)
    return known, rng.uniform(-40, 40, (count, 3)), spread


def test_the_optimum_is_that_of_a_general_solver() -> None:
    """Squares of the differences, each weighted by its whole covariance, against SciPy from another start."""
    known, true, spread = seen_from_above(9, np.random.default_rng(0))
    points = drawn(known, true, spread, 1)
    fit = fit_to_points(points, NO_LEVELS, np.random.default_rng(0))
    assert fit is not None
    assert fit.agreeing.all()
    roots = np.linalg.cholesky(np.linalg.inv(points.covariances(fit.similarity)))

    def whitened(values: F64) -> F64:
        turn = np.exp(values[0]) * Rotation.from_rotvec(values[1:4]).as_matrix() @ known.rotation
        residual = points.goal - points.source @ (known.scale * turn).T - values[4:]
        return np.einsum("nji,nj->ni", roots, residual).ravel()

    best = least_squares(whitened, np.append(np.zeros(4), known.translation), x_scale="jac", xtol=1e-14, ftol=1e-14)
    np.testing.assert_allclose(np.log(fit.similarity.scale / known.scale), best.x[0], atol=1e-9)
    np.testing.assert_allclose(
        fit.similarity.rotation, Rotation.from_rotvec(best.x[1:4]).as_matrix() @ known.rotation, atol=1e-8
    )
    np.testing.assert_allclose(fit.similarity.translation, best.x[4:], atol=1e-6)


def test_exact_marks_have_the_least_noise_alike() -> None:
    """Rounding makes no point heavier than others, and no point with a wrong mark lighter than its residuals."""
    exact = [MarkedPlace(np.zeros(3), 5, pixels, np.eye(3)) for pixels in (1e-9, 3e-9, 1e-8, 0.0, 2e-9)]
    assert np.ptp(mark_variances(exact)) == 0.0
    wrong = MarkedPlace(np.zeros(3), 5, 60.0, np.eye(3))
    variances = mark_variances([*exact, wrong])
    assert variances[-1] == 5 * 60.0**2 / 7
    assert variances[0] == mark_variances(exact)[0]


def test_covariances_are_those_of_repeated_draws(proof_count: Count) -> None:
    """Of many draws, the errors of the seven parameters, whitened by the stated covariance, scatter by one."""
    known, true, spread = seen_from_above(10, np.random.default_rng(2))
    squares, ignoring = [], []
    for seed in range(proof_count(50, 100)):
        points = drawn(known, true, spread, seed)
        fit = fit_to_points(points, NO_LEVELS, np.random.default_rng(0))
        assert fit is not None
        center = points.source.mean(axis=0)
        turn = Rotation.from_matrix(fit.similarity.rotation @ known.rotation.T).as_rotvec()
        moved = fit.similarity.move(center[None])[0] - known.move(center[None])[0]
        error = np.concatenate([[np.log(fit.similarity.scale / known.scale)], turn, moved])
        covariance = fit.covariances.sum(axis=0) / fit.sigmas[0] ** 2
        squares.append(error @ np.linalg.solve(covariance, error) / 7.0)
        each = np.diagonal(points.covariances(known), axis1=1, axis2=2)
        jacobian = derivatives(known, points.source - center)
        alone = np.linalg.inv(np.einsum("nki,nk,nkj->ij", jacobian, 1.0 / each, jacobian))
        ignoring.append(error @ np.linalg.solve(alone, error) / 7.0)
    assert 0.82 < np.mean(squares) < 1.18
    assert not 0.7 < np.mean(ignoring) < 1.4  # weights of each axis alone state other errors
