"""Register further images to the largest model with fewer inliers; keep the result only if its scale did not change.

Where a flight turns between two images, the pair may have 40 matches, and fewer of them become points than COLMAP
requires to register an image. Growth requires fewer. But images that few points connect may lose their common scale,
and the model folds. Few points also do not distinguish two towers that look alike: without GPS, nothing is registered.
"""

from pathlib import Path

import numpy as np
import pycolmap
from numpy.typing import NDArray

from recon.sfm.colmap_model import check_whole
from recon.sfm.misplaced import Fixes, misplaced_images
from recon.sfm.runaways import leave_out, runaways

F64 = NDArray[np.float64]

FEW_INLIERS = 15
"""Points that register an image; COLMAP asks for 30."""
FEW_TIES = 10
"""Points that must still connect it to the others after the adjustment. Over the gaps of a flight round a cable-stayed
bridge 15 to 30 were left where growth was sound, fewer than 5 where it folded."""
MOST_MOVED = 0.003
"""How far a camera of the model may move among the others of it, as a share of the diagonal of their places [1]. It was
0.0002 on that flight where growth was sound, 0.001 and 0.002 in two models that folded, before the removal."""
_ROUNDS = 3  # of growth: an image that was removed may connect to images that a later round adds
_FITS, _TWENTY = 10, 20
_LEAST = 3  # cameras that a similarity requires


def grow(
    model: pycolmap.Reconstruction,
    database: Path,
    images: Path,
    scratch: Path,
    options: pycolmap.IncrementalPipelineOptions,
    fixes: Fixes,
) -> tuple[pycolmap.Reconstruction, dict[str, float]]:
    """Register more images with fewer inliers; remove those that GPS does not confirm and loosely connected ones.

    A round that deformed the model is discarded. Two-view points do not fix the scale across a gap: with them, one
    model shrank to a ten-millionth of its size.

    Args:
        model: The model; not changed.
        database: Matches that it was made of.
        images: Folder of the photographs.
        scratch: Existing folder for temporary files.
        options: Those that the model was made with; changed in place.
        fixes: GPS position by name of image [m].

    Returns:
        The grown model, or `model` itself if nothing was gained; and figures: `added`: images gained; `misplaced` and
        `loose`: images removed again in the last round, because of their GPS position or too few points; `moved`:
        result of `shift` in the last round [1], 0 where nothing was gained. A round is discarded if `moved`
        exceeds `MOST_MOVED`.
    """
    options.multiple_models = False
    options.mapper.abs_pose_min_num_inliers = FEW_INLIERS
    options.triangulation.ignore_two_view_tracks = True
    grown, misplaced, loose, moved = model, 0, 0, 0.0
    for number in range(_ROUNDS):
        before, after = (scratch / f"{name}{number}" for name in ("before", "after"))
        for path in (before, after):
            path.mkdir()
        grown.write_binary(before)
        check_whole(before)
        found = pycolmap.incremental_mapping(database, images, after, options, input_path=before)
        larger = next((other for other in found.values() if other.num_reg_images() > grown.num_reg_images()), None)
        known = set(grown.reg_image_ids())
        misplaced = 0 if larger is None else _drop(larger, misplaced_images(larger, known, fixes))
        loose = 0 if larger is None else _drop(larger, loose_images(larger, known))
        if larger is None or larger.num_reg_images() <= grown.num_reg_images():
            break
        moved = shift(grown, larger)
        if moved > MOST_MOVED:
            break
        grown = larger
        if not misplaced + loose:
            break
    added = grown.num_reg_images() - model.num_reg_images()
    return grown, {"added": added, "misplaced": misplaced, "loose": loose, "moved": moved}


def _drop(grown: pycolmap.Reconstruction, images: list[int]) -> int:
    leave_out(grown, images)
    return len(images)


def loose_images(grown: pycolmap.Reconstruction, known: set[int]) -> list[int]:
    """Find the images that fewer than `FEW_TIES` points of known scale connect to the others.

    Starting from the known images, an image becomes known if it sees at least `FEW_TIES` points that two known images
    see: only such points transfer the scale across a gap.

    Args:
        grown: A model.
        known: Ids of its images that are known from the start.

    Returns:
        Ids of the registered images that never become known, sorted.
    """
    sights = [
        (n, element.image_id) for n, point in enumerate(grown.points3D.values()) for element in point.track.elements
    ]
    points, images = np.unique(np.array(sights, np.int64).reshape(-1, 2), axis=0).T
    numbers = np.array(sorted(grown.reg_image_ids()), np.int64)
    rows = np.searchsorted(numbers, images)
    reached = np.isin(numbers, sorted(known))
    while True:
        fixed = np.bincount(points[reached[rows]], minlength=grown.num_points3D()) >= 2
        now = reached | (np.bincount(rows[fixed[points]], minlength=len(numbers)) >= FEW_TIES)
        if (now == reached).all():
            return [int(number) for number in numbers[~reached]]
        reached = now


def shift(model: pycolmap.Reconstruction, grown: pycolmap.Reconstruction) -> float:
    """Measure how far the cameras of a model moved relative to each other while it grew.

    Args:
        model: The model before.
        grown: The model after, in any units; cameras that it no longer holds are ignored.

    Returns:
        The largest distance of a camera to its former place after the best similarity, as a share of the diagonal of
        the bounding box of the former places [1]; 1 where all cameras coincide, 0 where fewer than three are left.
        Runaway cameras are ignored in both, and so are the 5 % that moved most: at the end of one model the last
        camera was 11 m off, and growth corrected it.
    """
    away = set(runaways(model))  # they would make all other distances small
    numbers = sorted((set(model.reg_image_ids()) & set(grown.reg_image_ids())) - away)
    if len(numbers) < _LEAST:
        return 0.0
    before, after = (
        np.array([each.image(number).projection_center() for number in numbers]) for each in (model, grown)
    )
    asked, left = np.arange(len(numbers)), np.zeros(len(numbers))
    for _ in range(_FITS):
        fit = pycolmap.estimate_sim3d(after[asked], before[asked])
        if fit is None:
            return 1.0
        left = np.linalg.norm(fit.scale * after @ fit.rotation.matrix().T + fit.translation - before, axis=1)
        asked = np.argsort(left, kind="stable")[: len(numbers) - len(numbers) // _TWENTY]
    return float(left[asked].max() / np.linalg.norm(np.ptp(before[asked], axis=0)))
