"""Images that GPS contradicts: they were registered at a part of the bridge that looks like the one in the image.

Few matches do not distinguish the two towers of a bridge: 22 points connected 58 images of the second tower to the
first one, 40 to 75 m from where they were taken.
"""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pycolmap
from numpy.typing import NDArray

F64 = NDArray[np.float64]
Fixes = Mapping[str, tuple[float, float, float]]

LIMIT = 6.0
"""Standard deviations between a camera and its fix, beyond which it was registered at the wrong place [1]."""
LEAST_SIGMA = 0.5
"""Least standard deviation of a fix along an axis [m]: the drift of a receiver does not show in a few fixes."""
_SURE = 3.0  # standard deviations of a fix: a position predicted less precisely than that along two axes is not checked
_LEAST = 4  # known cameras with a fix: with three, a similarity fits too well


def misplaced_images(grown: pycolmap.Reconstruction, known: Iterable[int], fixes: Fixes) -> list[int]:
    """Find the images whose camera positions contradict their fixes and the known images.

    The similarity from the known cameras to their fixes predicts the fix of each other camera. The covariance of its
    seven parameters gives the precision of the prediction, which falls with the distance from the known cameras.

    Args:
        grown: A model.
        known: Ids of its images whose relative positions are trusted.
        fixes: GPS position by name of image [m]; an image may have none.

    Returns:
        Ids of the registered images that are not known, and that their fix contradicts or cannot confirm, ascending.
    """
    known = set(known) & set(grown.reg_image_ids())
    others = sorted(set(grown.reg_image_ids()) - known)
    base = sorted(number for number in known if grown.image(number).name in fixes)
    if len(base) < _LEAST:
        return others
    places, measured = centers(grown, base), np.array([fixes[grown.image(number).name] for number in base])
    fit, kept = fit_trimmed(places, measured, len(places) - len(places) // 10)
    if fit is None:
        return others
    moved = moved_by(fit, places[kept])
    spread = np.sqrt(np.mean((moved - measured[kept]) ** 2))  # of a fix along an axis [m]
    sigma = max(float(spread), LEAST_SIGMA)
    checked = [number for number in others if grown.image(number).name in fixes]
    there = moved_by(fit, centers(grown, checked))
    gap = there - np.array([fixes[grown.image(number).name] for number in checked]).reshape(-1, 3)
    expected = np.eye(3) + predicted_covariance(moved, there)  # of a fix, in variances of one along an axis
    distance = np.sqrt(np.einsum("mi,mij,mj->m", gap, np.linalg.inv(expected), gap)) / sigma
    right = (distance < LIMIT) & (np.linalg.eigvalsh(expected)[:, 1] < _SURE**2)
    confirmed = {number for number, held in zip(checked, right.tolist(), strict=True) if held}
    return [number for number in others if number not in confirmed]


def predicted_covariance(known: F64, asked: F64) -> F64:
    """Compute how precisely a similarity that was fitted to some positions predicts others.

    Args:
        known: Positions that it was fitted to [m], shape (N, 3), float64.
        asked: Positions that it predicts [m], shape (M, 3), float64.

    Returns:
        Covariance in variances of a known position along an axis [1], shape (M, 3, 3), float64; very large along
        directions that the known positions do not determine, such as the rotation about cameras in a row.
    """
    middle = known.mean(axis=0)
    size = max(float(np.sqrt(np.mean((known - middle) ** 2))), 1e-9)  # so that the parameters have similar magnitudes
    before, after = _jacobian((known - middle) / size), _jacobian((asked - middle) / size)
    normal = np.einsum("nij,nik->jk", before, before)
    values, vectors = np.linalg.eigh(normal)
    inverse = vectors / np.maximum(values, 1e-9 * values[-1]) @ vectors.T
    return np.einsum("mij,jk,mlk->mil", after, inverse, after)


def _jacobian(places: F64) -> F64:
    """Compute the change of each position by a shift, a small rotation and a change of scale, shape (N, 3, 7)."""
    x, y, z = places.T
    zero = np.zeros_like(x)
    turn = np.stack([zero, z, -y, -z, zero, x, y, -x, zero], axis=1).reshape(-1, 3, 3)
    shift = np.broadcast_to(np.eye(3), turn.shape)
    return np.concatenate([shift, turn, places[:, :, None]], axis=2)


def fit_trimmed(
    places: F64, measured: F64, count: int, rounds: int = 3
) -> tuple[pycolmap.Sim3d | None, NDArray[np.int64]]:
    """Fit the similarity from positions to fixes by least squares, repeatedly without those with the largest residuals.

    Args:
        places: Centers of cameras [model units], shape (N, 3), float64.
        measured: Their fixes [m], shape (N, 3), float64.
        count: Number of cameras that each fit after the first one uses.
        rounds: Number of fits.

    Returns:
        The similarity, or None; and the rows with the smallest residuals, ascending, shape (count,), int64.
    """
    fit, kept = None, np.arange(len(places))
    for _ in range(rounds):
        fit = pycolmap.estimate_sim3d(places[kept], measured[kept])
        if fit is None:
            return None, kept
        gap = np.linalg.norm(moved_by(fit, places) - measured, axis=1)
        kept = np.sort(np.argsort(gap, kind="stable")[:count])
    return fit, kept


def moved_by(fit: pycolmap.Sim3d, places: F64) -> F64:
    """Transform positions by a similarity.

    Args:
        fit: The similarity.
        places: Positions [model units], shape (N, 3), float64.

    Returns:
        Transformed positions [m], shape (N, 3), float64.
    """
    return fit.scale * places @ fit.rotation.matrix().T + fit.translation


def centers(model: pycolmap.Reconstruction, images: Sequence[int]) -> F64:
    """List the centers of cameras.

    Args:
        model: A model.
        images: Ids of its images.

    Returns:
        Centers [model units], shape (N, 3), float64.
    """
    return np.array([model.image(number).projection_center() for number in images]).reshape(-1, 3)
