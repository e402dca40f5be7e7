"""Where a mapper begins anew: at two images of the part of its model that GPS does not contradict.

COLMAP begins with the pair of images that has most matches and a wide angle. Where parts of a bridge look alike, this
pair may be wrong, and so is what hangs on it: one flight round a girder bridge of 109 images began so, and 13 cameras
were turned by 62 degrees; begun with another pair, all were right.
"""

from itertools import combinations

import numpy as np
import pycolmap
from numpy.typing import NDArray

from recon.sfm.misplaced import LIMIT, Fixes

F64 = NDArray[np.float64]

SUSPICIOUS = 0.03  # share of the cameras that may contradict their fixes [1]
_TRUSTED = 0.6  # share of the cameras that the similarity is fitted to [1]
_ROUNDS = 10
_LEAST_SIGMA = 0.5  # [m] of a fix along an axis
_LEAST = 10  # cameras with a fix
_LEAST_ANGLE = 16.0  # [deg] between the rays of the first two images, COLMAP's own


def contradicted_images(model: pycolmap.Reconstruction, fixes: Fixes) -> list[int]:
    """Find the images of a model whose places their fixes contradict, if most are where their fixes say.

    Args:
        model: A model.
        fixes: GPS position by name of image [m]; an image may have none.

    Returns:
        Ids, ascending; none where too few have a fix.
    """
    images = sorted(number for number in model.reg_image_ids() if model.image(number).name in fixes)
    if len(images) < _LEAST:
        return []
    places = np.array([model.image(number).projection_center() for number in images])
    measured = np.array([fixes[model.image(number).name] for number in images])
    kept = np.arange(len(images))
    gap = np.zeros(len(images))
    for _ in range(_ROUNDS):
        fit = pycolmap.estimate_sim3d(places[kept], measured[kept])
        if fit is None:
            return []
        gap = np.linalg.norm(fit.scale * places @ fit.rotation.matrix().T + fit.translation - measured, axis=1)
        kept = np.sort(np.argsort(gap, kind="stable")[: round(_TRUSTED * len(images))])
    sigma = max(float(np.sqrt(np.mean(gap[kept] ** 2) / 3.0)), _LEAST_SIGMA)
    return [number for number, far in zip(images, (gap > LIMIT * sigma * np.sqrt(3.0)).tolist(), strict=True) if far]


def starting_pair(model: pycolmap.Reconstruction, without: list[int]) -> tuple[int, int] | None:
    """Choose the two images that share most points under a wide angle.

    Args:
        model: A model.
        without: Ids of images that are not to be chosen.

    Returns:
        Their ids, the smaller one first; None where no two share points under such an angle.
    """
    left_out = set(without)
    angles: dict[tuple[int, int], list[float]] = {}
    centers = {number: model.image(number).projection_center() for number in model.reg_image_ids()}
    for number in sorted(model.point3D_ids()):
        point = model.point3D(number)
        seen = sorted({element.image_id for element in point.track.elements} - left_out)
        rays = {image: (centers[image] - point.xyz) / np.linalg.norm(centers[image] - point.xyz) for image in seen}
        for pair in combinations(seen, 2):
            cosine = float(np.clip(rays[pair[0]] @ rays[pair[1]], -1.0, 1.0))
            angles.setdefault(pair, []).append(float(np.degrees(np.arccos(cosine))))
    wide = {pair: len(found) for pair, found in angles.items() if np.median(found) >= _LEAST_ANGLE}
    return max(sorted(wide), key=lambda pair: wide[pair]) if wide else None
