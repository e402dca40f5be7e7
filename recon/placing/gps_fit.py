"""Fit of a similarity to the measured positions of a model's cameras, with its covariances.

Positions are measured to meters, the model is accurate to millimeters. So the scale is estimated by least squares from
model to positions, together with the rotation. A ratio of spreads would count the noise of the positions as size.
Source: least squares with a priori information and variance components; Förstner and Wrobel, Photogrammetric Computer
Vision (2016), 4.2 and 4.7; the start is the least median of squares, Rousseeuw (1984).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recon.placing.gravity import GravityCues
from recon.placing.similarity import (
    PARAMETERS,
    Similarity,
    adjusted,
    angles,
    derivatives,
    fit_similarity,
    rotation_by,
)

F64 = NDArray[np.float64]
Mask = NDArray[np.bool_]

_TRIPLE = 3
_TRIPLES = 300
_LEVEL, _FLAT_LEVEL = 2.366, 1.386  # median of the square of a normal vector of three, and of two
_FAR = 21.1  # one valid fix in ten thousand has a larger value
_ROUNDS, _STEPS = 15, 30
_NEAR, _SETTLED = 1e-4, 1e-10
_PRIOR_FREEDOM = 2.0  # prior weight that keeps the two variance components similar if there are few fixes
_LONG = 12  # least number of fixes from which their serial correlation is estimated
_SURE, _UNLIKE = 4.0, 15.0  # another rotation is rejected if its likelihood is smaller by e^2
_USUAL = 0.3  # serial correlation assumed for fewer fixes
_ALIKE = 0.95  # largest serial correlation assumed


@dataclass(frozen=True)
class Fit:
    """A similarity and its accuracy.

    Attributes:
        similarity: From the model into the world.
        agreeing: Fixes that were used, shape (N,), bool.
        sigmas: Standard deviation of a fix, horizontal and vertical, estimated from the residuals as a multiple of the
            stated one [1], shape (2,), float64.
        middle: Centroid of the agreeing cameras in the world [m], shape (3,), float64.
        covariances: Of logarithm of the scale, rotation vector [rad] and position of the centroid [m], from each of E
            sources of errors (of fixes: horizontal, vertical, and gravity), shape (E, 7, 7), float64.
        freedom: Degrees of freedom of each of these [1], shape (E,), float64.
        twofold: Whether a very different rotation fits equally well; then the limits are invalid.
        heightless: Whether no height was measured; then the height is arbitrary, and its covariance 0.
        tilted: Angle to the up direction of another rotation that fits nearly as well, where heights are missing [rad].
    """

    similarity: Similarity
    agreeing: Mask
    sigmas: F64
    middle: F64
    covariances: F64
    freedom: F64
    twofold: bool = False
    heightless: bool = False
    tilted: float = 0.0


@dataclass(frozen=True)
class _Fixes:
    """Camera centers, their measured positions and the stated deviations, as in `fit_to_fixes`."""

    source: F64
    goal: F64
    sigma: F64

    def subset(self, rows: Mask) -> "_Fixes":
        """Select some of the fixes."""
        return _Fixes(self.source[rows], self.goal[rows], self.sigma[rows])


def fit_to_fixes(
    source: F64, goal: F64, sigma: F64, levels: GravityCues, rng: np.random.Generator, *, flown: bool = True
) -> Fit | None:
    """Fit a similarity to measured positions with outliers, and to the direction of gravity.

    Args:
        source: Camera centers [model units], shape (N, 3), float64, in the order in which they were flown.
        goal: Their measured positions [m], shape (N, 3), float64.
        sigma: Stated standard deviation of each along x, y, z [m], shape (N, 3), float64; infinite along z where no
            height was measured. A factor for horizontal and one for vertical are estimated from the residuals.
        levels: Cues of the photographs for the up direction.
        rng: Source of the initial triples.
        flown: Whether they were measured one after the other, so that errors may repeat.

    Returns:
        The fit; None for fewer than three fixes, or if all cameras are in one place.
    """
    if len(source) < _TRIPLE or not min(np.ptp(source, axis=0).max(), np.ptp(goal, axis=0).max()) > 0.0:
        return None
    found = [_settle(source, goal, sigma, levels, start) for start in _starts(source, goal, sigma, levels, rng)]
    flat = np.isinf(sigma[:, 2])
    level = min(_level(_squares(similarity, source, goal, sigma), flat) for similarity in found)
    costs = [_cost(similarity, source, goal, sigma * level, levels) for similarity in found]
    if flat.any():
        found.append(_settle(source, goal, sigma, levels, _mirrored(found[int(np.argmin(costs))], source)))
        costs.append(_cost(found[-1], source, goal, sigma * level, levels))
    best = found[int(np.argmin(costs))]
    rivals = [other.rotation for other, cost in zip(found, costs, strict=True) if cost < min(costs) + _SURE]
    unlike = bool((angles(np.array(rivals), best.rotation) > _UNLIKE).any())
    agreeing = _squares(best, source, goal, sigma * level) <= _FAR
    fixes = _Fixes(source, goal, sigma)
    fit = _adjust(best, fixes, levels, agreeing, flown)
    for _ in range(_ROUNDS):
        again = _squares(fit.similarity, source, goal, sigma * fit.sigmas[[0, 0, 1]]) <= _FAR
        if (again == agreeing).all() or again.sum() < max(_TRIPLE, len(goal) / 2):
            break
        agreeing = again
        fit = _adjust(fit.similarity, fixes, levels, agreeing, flown)
    tilts = np.arccos(np.clip(np.array(rivals)[:, 2] @ best.rotation[2], -1.0, 1.0))
    return replace(fit, twofold=unlike, tilted=float(tilts.max()) if flat.any() else 0.0)


def _starts(source: F64, goal: F64, sigma: F64, levels: GravityCues, rng: np.random.Generator) -> list[Similarity]:
    """Propose initial similarities: from all fixes, from the best triple by least median, and each of them rolled.

    Rolled means turned by 90, 180 and 270 degrees about the flight path. Where heights are missing, one more is
    proposed from gravity and the horizontal positions.
    """
    count = len(source)
    keys = rng.random((_TRIPLES, count))
    triples = np.argpartition(keys, _TRIPLE - 1, axis=1)[:, :_TRIPLE] if count > _TRIPLE else np.arange(3)[None]
    scale, rotation, shift = fit_similarity(source[triples], goal[triples])
    moved = scale[:, None, None] * (source @ rotation.transpose(0, 2, 1)) + shift[:, None, :]
    squares = np.nan_to_num((((moved - goal) / sigma) ** 2).sum(axis=2), nan=np.inf)
    half = min((count + _TRIPLE + 2) // 2, count) - 1
    best = int(np.argmin(np.partition(squares, half, axis=1)[:, half]))
    whole = fit_similarity(source, goal)
    starts = [Similarity(float(whole[0]), whole[1], whole[2])]
    if np.isfinite(squares[best]).all():
        starts.append(Similarity(float(scale[best]), rotation[best], shift[best]))
    if np.isinf(sigma[:, 2]).any() and len(levels.heights):
        starts.append(_upright(source, goal, levels))
    starts = [start for start in starts if np.isfinite(start.scale) and start.scale > 0.0]
    rolled = []
    for start in starts:  # on a straight flight the fixes do not determine the roll about the path
        along = np.linalg.svd(goal - goal.mean(axis=0), full_matrices=False)[2][0]
        for turn in (90.0, 180.0, 270.0):
            roll = rotation_by(np.radians(turn) * along)
            middle = goal.mean(axis=0)
            rolled.append(Similarity(start.scale, roll @ start.rotation, roll @ (start.translation - middle) + middle))
    return starts + rolled


def _upright(source: F64, goal: F64, levels: GravityCues) -> Similarity:
    """Propose the similarity whose up direction is that of gravity, by least squares of the horizontal positions."""
    up = np.linalg.lstsq(levels.directions / levels.sigmas[:, None], levels.heights / levels.sigmas)[0]
    axes = np.linalg.svd(up[None])[2][[1, 2, 0]]
    axes[2] = up / max(float(np.linalg.norm(up)), 1e-300)
    axes[1] = np.cross(axes[2], axes[0])
    moved, middle = source @ axes.T, goal.mean(axis=0)
    planes = (moved - moved.mean(axis=0), goal - middle)
    before, after = (plane[:, 0] + 1j * plane[:, 1] for plane in planes)
    turn = np.vdot(before, after) / max(float(np.vdot(before, before).real), 1e-300)
    scale, rotation = float(np.abs(turn)), rotation_by(np.array([0.0, 0.0, np.angle(turn)])) @ axes
    return Similarity(scale, rotation, middle - scale * rotation @ source.mean(axis=0))


def _mirrored(similarity: Similarity, source: F64) -> Similarity:
    """Propose the opposite slope of a plane of cameras: their horizontal positions are the same on both slopes."""
    moved = similarity.move(source)
    middle = moved.mean(axis=0)
    normal = np.linalg.svd(moved - middle, full_matrices=False)[2][2]
    axis = np.cross(normal, [0.0, 0.0, 1.0]) * np.sign(normal[2])  # its length is the sine of the slope
    sine = float(np.linalg.norm(axis))
    turn = rotation_by(axis * 2.0 * np.arcsin(min(sine, 1.0)) / max(sine, 1e-300))
    return Similarity(similarity.scale, turn @ similarity.rotation, turn @ (similarity.translation - middle) + middle)


def _settle(source: F64, goal: F64, sigma: F64, levels: GravityCues, start: Similarity) -> Similarity:
    """Refine a start by iteratively reweighted least squares: a fix with a larger residual has a smaller weight."""
    similarity = start
    for _ in range(_STEPS):
        squares = _squares(similarity, source, goal, sigma)
        level = _level(squares, np.isinf(sigma[:, 2]))
        robust = 1.0 / (1.0 + squares / level**2 / 3.0)
        weights = robust[:, None] / (sigma * level) ** 2
        similarity, moved = _step(similarity, source, goal, weights, levels)
        if moved < _NEAR:
            break
    return similarity


def _step(
    similarity: Similarity, source: F64, goal: F64, weights: F64, levels: GravityCues
) -> tuple[Similarity, float]:
    """Take one Gauss-Newton step; returns the new similarity and the relative size of the step."""
    center = _middle(source, weights)
    jacobian = derivatives(similarity, source - center)
    residual = goal - similarity.move(source)
    ups = similarity.rotation.T[:, 2]
    pull = levels.weights(ups)
    turning = levels.derivatives(similarity.rotation)
    normal = np.einsum("nki,nk,nkj->ij", jacobian, weights, jacobian)
    normal[1:4, 1:4] += (turning * pull[:, None]).T @ turning
    if not weights[:, 2].any():
        normal[6, 6] = 1.0  # no height is known: it stays as it is
    right = np.einsum("nki,nk,nk->i", jacobian, weights, residual)
    right[1:4] += turning.T @ (pull * (levels.heights - levels.directions @ ups))
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    delta = np.linalg.lstsq(normal / np.outer(size, size), right / size, rcond=1e-13)[0] / size
    delta[:4] = np.clip(delta[:4], -0.5, 0.5)  # far from the optimum a step may be too large
    spread = np.linalg.norm(source - center, axis=1).max() * similarity.scale
    return adjusted(similarity, center, delta), float(
        np.abs(delta[:4]).max() + np.abs(delta[4:]).max() / max(spread, 1e-300)
    )


def _adjust(start: Similarity, fixes: _Fixes, levels: GravityCues, agreeing: Mask, flown: bool) -> Fit:
    """Fit to the agreeing fixes, and estimate their horizontal and vertical accuracy."""
    fixes = fixes.subset(agreeing)
    source, goal, stated = fixes.source, fixes.goal, fixes.sigma
    similarity, factors, serial_correlation = start, np.ones(2), 0.0
    freedom = np.ones(2)
    for _ in range(_STEPS):
        weights = 1.0 / (stated * factors[[0, 0, 1]]) ** 2
        moved = np.inf
        for _ in range(_STEPS):
            similarity, moved = _step(similarity, source, goal, weights, levels)
            if moved < _SETTLED:
                break
        residual = (goal - similarity.move(source)) / stated
        measured = int(np.isfinite(stated).sum())
        serial_correlation = _serial_correlation(residual / factors[[0, 0, 1]], measured) if flown else 0.0
        again, freedom = _components(similarity, fixes, factors, levels, serial_correlation)
        change = np.abs(np.log(again / factors)).max()
        factors = again
        if change < 1e-4:
            break
    weights = 1.0 / (stated * factors[[0, 0, 1]]) ** 2
    covariances = _covariances(similarity, source, weights, levels, serial_correlation)
    middle = similarity.move(_middle(source, weights)[None])[0]
    slow = (1.0 - serial_correlation**2) / (1.0 + serial_correlation**2)
    return Fit(
        similarity,
        agreeing,
        factors,
        middle,
        covariances,
        np.append(np.maximum(freedom * slow, 1.0), 1e6),
        heightless=bool(np.isinf(stated[:, 2]).all()),
    )


def _components(
    similarity: Similarity, fixes: _Fixes, factors: F64, levels: GravityCues, serial_correlation: float
) -> tuple[F64, F64]:
    """Estimate the two factors of the stated errors; returns them and their degrees of freedom."""
    residual = (fixes.goal - similarity.move(fixes.source)) / fixes.sigma
    weights = 1.0 / (fixes.sigma * factors[[0, 0, 1]]) ** 2
    jacobian = derivatives(similarity, fixes.source - _middle(fixes.source, weights)) * np.sqrt(weights)[:, :, None]
    inverse = np.asarray(np.linalg.pinv(_information(jacobian, similarity, levels), hermitian=True), np.float64)
    kept = np.array([_left_over(jacobian[:, axes], inverse, serial_correlation) for axes in ([0, 1], [2])])
    squares = np.array([(residual[:, :2] ** 2).sum(), (residual[:, 2] ** 2).sum()])
    common = (squares / factors**2).sum() / max(kept.sum(), 1.0)
    estimate = (squares + _PRIOR_FREEDOM * common * factors**2) / (kept + _PRIOR_FREEDOM)
    freedom = kept + _PRIOR_FREEDOM * kept.sum() / (kept.sum() + _PRIOR_FREEDOM)
    return np.sqrt(np.maximum(estimate, 1e-18)), np.minimum(freedom, kept.sum())


def _left_over(jacobian: F64, inverse: F64, serial_correlation: float) -> float:
    """Compute the redundancy of some axes: trace of (I - H) S (I - H), S their correlation."""
    used = 0.0
    for axis in range(jacobian.shape[1]):
        part = jacobian[:, axis]
        used += np.einsum("ij,jk,ik->", part, inverse, _alike(part, serial_correlation))
    return float(max(np.count_nonzero(jacobian.any(axis=2)) - used, 0.0))  # a height that is unknown has no weight


def _covariances(
    similarity: Similarity, source: F64, weights: F64, levels: GravityCues, serial_correlation: float
) -> F64:
    """Propagate the horizontal and vertical errors of fixes, and those of gravity, to the parameters."""
    jacobian = derivatives(similarity, source - _middle(source, weights)) * np.sqrt(weights)[:, :, None]
    inverse = np.linalg.pinv(_information(jacobian, similarity, levels), hermitian=True)
    parts = [
        sum(jacobian[:, axis].T @ _alike(jacobian[:, axis], serial_correlation) for axis in axes)
        for axes in ([0, 1], [2])
    ]
    turning, pull = levels.derivatives(similarity.rotation), levels.weights(similarity.rotation.T[:, 2])
    tilt = np.zeros((PARAMETERS, PARAMETERS))
    tilt[1:4, 1:4] = (turning * pull[:, None]).T @ turning
    return np.stack([inverse @ part @ inverse for part in (*parts, tilt)])


def _information(whitened: F64, similarity: Similarity, levels: GravityCues) -> F64:
    """Sum up the information of fixes and of gravity, shape (7, 7)."""
    turning, pull = levels.derivatives(similarity.rotation), levels.weights(similarity.rotation.T[:, 2])
    total = np.einsum("nki,nkj->ij", whitened, whitened)
    if not whitened[:, 2].any():
        total[6, 6] = 1.0  # no height is known; its covariance is 0, because no error is propagated to it
    total[1:4, 1:4] += (turning * pull[:, None]).T @ turning
    return total


def _serial_correlation(whitened: F64, measured: int | None = None) -> float:
    """Estimate the correlation of the error of a fix with that of the one before it.

    The fit removes slow variations, and with them some of the correlation; the correction is tuned by simulation
    (`benchmarks.recon.gps_scale`).
    """
    if len(whitened) < _LONG:
        return _USUAL
    raw = float((whitened[1:] * whitened[:-1]).sum() / (whitened**2).sum())
    count = float(whitened.size if measured is None else measured)
    freed = raw + (1.0 + 6.0 * max(raw, 0.0)) * PARAMETERS / count
    return float(np.clip(freed, 0.0, _ALIKE)) if freed > 2.0 / np.sqrt(count) else 0.0


def _alike(columns: F64, serial_correlation: float) -> F64:
    """Multiply by the matrix whose entries are serial_correlation to the power of |i - j|, shape (N, P)."""
    from scipy.signal import lfilter  # which loads scipy.stats: it takes half of the time to import the room

    if serial_correlation == 0.0:
        return columns
    ahead = lfilter([1.0], [1.0, -serial_correlation], columns, axis=0)
    back = lfilter([1.0], [1.0, -serial_correlation], columns[::-1], axis=0)[::-1]
    return np.asarray(ahead + back - columns)


def _squares(similarity: Similarity, source: F64, goal: F64, sigma: F64) -> F64:
    return (((goal - similarity.move(source)) / sigma) ** 2).sum(axis=1)


def _level(squares: F64, flat: Mask | None = None) -> float:
    """Estimate the factor by which the stated errors are too small, from the better half; at least a tenth.

    `flat` fixes have no height; their squares are smaller.
    """
    count = len(squares)
    half = min((count + _TRIPLE + 2) // 2, count) - 1
    missing = 0 if flat is None else int(flat.sum())
    if flat is not None and missing:
        squares = np.where(flat, squares * (_LEVEL / _FLAT_LEVEL), squares)
    free = max(1.0 - PARAMETERS / (3.0 * count - missing), 0.2)
    return float(max(np.sqrt(np.partition(squares, half)[half] / _LEVEL / free), 0.1))


def _cost(similarity: Similarity, source: F64, goal: F64, sigma: F64, levels: GravityCues) -> float:
    ups = similarity.rotation.T[:, 2]
    return float(np.minimum(_squares(similarity, source, goal, sigma), _FAR).sum()) + levels.cost(ups)


def _middle(source: F64, weights: F64) -> F64:
    share = weights.sum(axis=1)
    return np.asarray(share @ source / share.sum(), np.float64)
