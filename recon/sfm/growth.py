"""The largest model grows on by images that few matches tie to it, and is kept only where it held.

A flight that turns between two images may have 40 matches there, of which too few become points that COLMAP would
register the next image by. Growth asks for fewer. What so few points tie may lose its scale: then the model folds.
"""

from pathlib import Path

import numpy as np
import pycolmap
from numpy.typing import NDArray

from recon.sfm.colmap_model import check_whole
from recon.sfm.runaways import runaways

F64 = NDArray[np.float64]

FEW_INLIERS = 15
"""Points that register an image; COLMAP asks for 30."""
FEW_TIES = 10
"""Points that must still tie it to the others when all is adjusted. Over the gaps of a flight round a cable-stayed
bridge 15 to 30 were left where growth was sound, fewer than 5 where it folded."""
MOST_MOVED = 0.003
"""How far a camera of the model may move among the others of it, as a share of the diagonal of their places [1]. It was
0.0001 to 0.0012 on that flight where growth was sound (0.001 is how far such models were off before), 0.0055 where it
folded."""


_LEAST = 3  # cameras that a similarity needs


def grow(
    model: pycolmap.Reconstruction,
    database: Path,
    images: Path,
    scratch: Path,
    options: pycolmap.IncrementalPipelineOptions,
) -> tuple[pycolmap.Reconstruction, dict[str, float]]:
    """Let a model grow on with fewer inliers; images that hang loose leave it, and it stays where it was bent.

    Points of two views fix no scale across a gap: with them, one model folded to a ten-millionth of its size.

    Args:
        model: The model; not changed.
        database: Matches that it was made of.
        images: Folder of the photographs.
        scratch: Existing folder for files on the way.
        options: As the model was made with; changed in place.

    Returns:
        The grown model, or the very one that was given; and what became of it: `added`: images that it gained;
        `loose`: images that left it again; `moved`: see `shift` [1], 0 where nothing was gained. The grown one is not
        taken where that is more than `MOST_MOVED`.
    """
    options.multiple_models = False
    options.mapper.abs_pose_min_num_inliers = FEW_INLIERS
    options.triangulation.ignore_two_view_tracks = True
    before, after = scratch / "before", scratch / "after"
    for path in (before, after):
        path.mkdir()
    model.write_binary(before)
    check_whole(before)
    found = pycolmap.incremental_mapping(database, images, after, options, input_path=before)
    grown = next((other for other in found.values() if other.num_reg_images() > model.num_reg_images()), None)
    if grown is None:
        return model, {"added": 0, "loose": 0, "moved": 0.0}
    loose = loose_images(grown, set(model.reg_image_ids()))
    for image in loose:
        grown.deregister_frame(grown.image(image).frame_id)
    added = max(0, grown.num_reg_images() - model.num_reg_images())
    moved = shift(model, grown) if added else 0.0
    if not added or moved > MOST_MOVED:
        grown, added = model, 0
    return grown, {"added": added, "loose": len(loose), "moved": moved}


def loose_images(grown: pycolmap.Reconstruction, known: set[int]) -> list[int]:
    """Find the images that hang on others by fewer than `FEW_TIES` points of known place.

    From the known images on, an image is known where it sees that many points that two known ones saw: such points
    alone carry the scale across a gap.

    Args:
        grown: A model.
        known: Numbers of its images that are known from the start.

    Returns:
        Numbers of the registered images that are never reached, sorted.
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
    """Measure how far the cameras of a model moved among each other while it grew.

    Args:
        model: The model before.
        grown: The model after, in any units; a camera that left it is not asked.

    Returns:
        The largest distance that the best similarity leaves between the places of a camera, as a share of the diagonal
        of the box of all places before [1]; 1 where all have become one place, 0 where fewer than three cameras are
        left, which cannot be bent. Cameras that had run away before are not asked.
    """
    away = set(runaways(model))  # they would make every other distance small
    numbers = sorted((set(model.reg_image_ids()) & set(grown.reg_image_ids())) - away)
    if len(numbers) < _LEAST:
        return 0.0
    before, after = (
        np.array([each.image(number).projection_center() for number in numbers]) for each in (model, grown)
    )
    fit = pycolmap.estimate_sim3d(after, before)
    if fit is None:
        return 1.0
    left = fit.scale * after @ fit.rotation.matrix().T + fit.translation - before
    return float(np.linalg.norm(left, axis=1).max() / np.linalg.norm(np.ptp(before, axis=0)))
