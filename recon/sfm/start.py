"""Restart of the mapper: with two images of the part of its model that GPS does not contradict.

COLMAP begins with the pair of images that has most matches and a wide angle. Where parts of a bridge look alike, this
pair may be wrong, and then every camera registered to it is wrong: one flight around a girder bridge with 109 images
began so, and 13 cameras were rotated by 62 degrees; when begun with another pair, all were right.
"""

import numpy as np
import pycolmap
from numpy.typing import NDArray
from scipy.sparse import csr_array

from recon.sfm.misplaced import LEAST_SIGMA, LIMIT, Fixes, centers, fit_trimmed, moved_by

F64 = NDArray[np.float64]

SUSPICIOUS = 0.03  # share of the cameras that may contradict their fixes [1]
_TRUSTED = 0.6  # share of the cameras that the similarity is fitted to [1]
_ROUNDS = 10
_LEAST = 10  # cameras with a fix
_LEAST_ANGLE = 16.0  # [deg] between the rays of the first two images, COLMAP's own


def contradicted_images(model: pycolmap.Reconstruction, fixes: Fixes) -> list[int]:
    """Find the images of a model whose positions contradict their fixes, if most positions agree with theirs.

    Args:
        model: A model.
        fixes: GPS position by name of image [m]; an image may have none.

    Returns:
        Ids, ascending; none where too few have a fix.
    """
    images = sorted(number for number in model.reg_image_ids() if model.image(number).name in fixes)
    if len(images) < _LEAST:
        return []
    places, measured = centers(model, images), np.array([fixes[model.image(number).name] for number in images])
    fit, kept = fit_trimmed(places, measured, round(_TRUSTED * len(images)), _ROUNDS)
    if fit is None:
        return []
    gap = np.linalg.norm(moved_by(fit, places) - measured, axis=1)
    sigma = max(float(np.sqrt(np.mean(gap[kept] ** 2) / 3.0)), LEAST_SIGMA)  # of a fix along an axis [m]
    return [number for number, far in zip(images, (gap > LIMIT * sigma * np.sqrt(3.0)).tolist(), strict=True) if far]


def starting_pair(model: pycolmap.Reconstruction, without: list[int]) -> tuple[int, int] | None:
    """Choose the two images that share the most points at a wide angle.

    Args:
        model: A model.
        without: Ids of images that must not be chosen.

    Returns:
        Their ids, the smaller one first; None if no two share points at such an angle.
    """
    images = sorted(set(model.reg_image_ids()) - set(without))
    row = {number: place for place, number in enumerate(images)}
    points = [model.point3D(number) for number in sorted(model.point3D_ids())]
    seen = {(row[e.image_id], k) for k, point in enumerate(points) for e in point.track.elements if e.image_id in row}
    of_image, of_point = np.array(sorted(seen), np.int64).reshape(-1, 2).T
    views = csr_array((np.ones(len(of_image), np.int32), (of_image, of_point)), shape=(len(images), len(points)))
    first, second = np.triu_indices(len(images), 1)
    shared = (views @ views.T).toarray()[first, second]
    places, surfaces = centers(model, images), np.array([point.xyz for point in points]).reshape(-1, 3)
    for pair in np.argsort(-shared, kind="stable")[: np.count_nonzero(shared)]:
        one, other = int(first[pair]), int(second[pair])
        both = surfaces[np.intersect1d(of_point[of_image == one], of_point[of_image == other])]
        if np.median(_angle(both - places[one], both - places[other])) >= _LEAST_ANGLE:
            return images[one], images[other]
    return None


def _angle(one: F64, other: F64) -> F64:
    """Measure the angle between rays [deg], shape (N,)."""
    lengths = np.linalg.norm(one, axis=1) * np.linalg.norm(other, axis=1)
    return np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", one, other) / lengths, -1.0, 1.0)))
