"""Fit of a similarity to surveyed points, whose positions in the model are less certain along some axes than others.

A point that few photographs show, or that all show from one side, is known well across the lines of sight and badly
along them. So each point has a full covariance; weights for each axis alone would count its errors as independent.
Source: Förstner and Wrobel, Photogrammetric Computer Vision (2016), 4.2 and 4.7.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recon.placing.gps_fit import Fit, fit_to_fixes
from recon.placing.gravity import GravityCues
from recon.placing.similarity import PARAMETERS, Similarity, adjusted, derivatives

F64 = NDArray[np.float64]

_STEPS = 30
_SETTLED = 1e-9
_PRIOR_FREEDOM = 4.0  # weight of the stated errors in the estimate of the errors, in degrees of freedom


@dataclass(frozen=True, eq=False)
class SurveyedPoints:
    """N points whose positions are known in the model and in the world.

    Attributes:
        source: Positions in the model [model units], shape (N, 3), float64.
        goal: Surveyed positions [m], shape (N, 3), float64.
        sigma: Stated standard deviation of the survey along x, y, z [m], shape (N, 3), float64.
        spread: Covariance of each position in the model by its marks [model units²], shape (N, 3, 3), float64.
    """

    source: F64
    goal: F64
    sigma: F64
    spread: F64

    def subset(self, rows: NDArray[np.bool_]) -> "SurveyedPoints":
        """Select some of the points.

        Args:
            rows: Which, shape (N,), bool.
        """
        return SurveyedPoints(self.source[rows], self.goal[rows], self.sigma[rows], self.spread[rows])

    def covariances(self, similarity: Similarity) -> F64:
        """Add the covariances of the survey and of the marks.

        Args:
            similarity: From the model into the world.

        Returns:
            Covariance of the difference of each pair [m²], shape (N, 3, 3), float64.
        """
        turn = similarity.scale * similarity.rotation
        return turn @ self.spread @ turn.T + self.sigma[:, :, None] ** 2 * np.eye(3)


def fit_to_points(points: SurveyedPoints, levels: GravityCues, rng: np.random.Generator) -> Fit | None:
    """Fit a similarity to surveyed points with outliers, and to the direction of gravity.

    Two robust fits find the points that agree: the first one weighs them by the survey alone, and turns the errors of
    the marks into the world for the second one.

    Args:
        points: The points.
        levels: Cues of the photographs for the up direction.
        rng: Source of the initial triples.

    Returns:
        The fit, with one factor of the stated errors for all axes; None for fewer than three points, or if all are in
        one place.
    """
    rough = fit_to_fixes(points.source, points.goal, points.sigma, levels, rng, flown=False)
    if rough is None:
        return None
    each = np.sqrt(np.diagonal(points.covariances(rough.similarity), axis1=1, axis2=2))
    robust = fit_to_fixes(points.source, points.goal, each, levels, rng, flown=False)
    return None if robust is None else _adjust(robust, points.subset(robust.agreeing), levels)


def _adjust(start: Fit, points: SurveyedPoints, levels: GravityCues) -> Fit:
    """Fit to the points that agree, each weighted by its covariance, and estimate the factor of these covariances."""
    similarity, factor, center = start.similarity, 1.0, points.source.mean(axis=0)
    for _ in range(_STEPS):
        weights = np.asarray(np.linalg.inv(points.covariances(similarity)) / factor, np.float64)
        measured, tilt, right = _equations(similarity, points, weights, levels)
        delta = _inverse(measured + tilt) @ right
        delta[:4] = np.clip(delta[:4], -0.5, 0.5)  # far from the optimum a step may be too large
        similarity, before = adjusted(similarity, center, delta), factor
        factor *= _variance_factor(similarity, points, weights, _redundancy(points, measured, tilt), factor)
        if np.abs(delta[:4]).max() < _SETTLED and abs(factor / before - 1.0) < _SETTLED:
            break
    weights = np.asarray(np.linalg.inv(points.covariances(similarity)) / factor, np.float64)
    measured, tilt, _ = _equations(similarity, points, weights, levels)
    inverse = _inverse(measured + tilt)
    return replace(
        start,
        similarity=similarity,
        sigmas=np.full(2, np.sqrt(factor)),
        middle=similarity.move(center[None])[0],
        covariances=np.stack([inverse @ part @ inverse for part in (measured, tilt)]),
        freedom=np.array([max(_redundancy(points, measured, tilt), 1.0) + _PRIOR_FREEDOM * (factor < 1.0), np.inf]),
    )


def _equations(
    similarity: Similarity, points: SurveyedPoints, weights: F64, levels: GravityCues
) -> tuple[F64, F64, F64]:
    """Set up the normal equations: those of the points, those of gravity, and the right side of both."""
    jacobian = derivatives(similarity, points.source - points.source.mean(axis=0))
    residual = points.goal - similarity.move(points.source)
    measured = np.einsum("nki,nkl,nlj->ij", jacobian, weights, jacobian)
    right = np.einsum("nki,nkl,nl->i", jacobian, weights, residual)
    ups, turning = similarity.rotation.T[:, 2], levels.derivatives(similarity.rotation)
    pull = levels.weights(ups)
    tilt = np.zeros((PARAMETERS, PARAMETERS))
    tilt[1:4, 1:4] = (turning * pull[:, None]).T @ turning
    right[1:4] += turning.T @ (pull * (levels.heights - levels.directions @ ups))
    return measured, tilt, right


def _inverse(normal: F64) -> F64:
    """Invert normal equations whose parameters have different units."""
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    scaled = np.linalg.pinv(normal / np.outer(size, size), hermitian=True)
    return np.asarray(scaled / np.outer(size, size), np.float64)


def _redundancy(points: SurveyedPoints, measured: F64, tilt: F64) -> float:
    """Count the coordinates that the parameters do not use up."""
    return float(points.goal.size - np.trace(_inverse(measured + tilt) @ measured))


def _variance_factor(
    similarity: Similarity, points: SurveyedPoints, weights: F64, redundancy: float, factor: float
) -> float:
    """Estimate by which factor the variances are to be multiplied.

    The stated errors have the weight of `_PRIOR_FREEDOM` measurements, unless the residuals are larger than stated:
    many files state no errors.
    """
    residual = points.goal - similarity.move(points.source)
    squares = np.einsum("nk,nkl,nl->", residual, weights, residual)
    mixed = (squares + _PRIOR_FREEDOM / factor) / (redundancy + _PRIOR_FREEDOM)
    return float(max(mixed, squares / max(redundancy, 1.0)))
