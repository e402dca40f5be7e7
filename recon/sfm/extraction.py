"""Keypoints of every photograph, in a COLMAP database; runs in a child process."""

from pathlib import Path
from typing import Any

import numpy as np
import pycolmap

from groundwork.progress import Progress
from recon.photos.photos import FOCAL_GUESSED, fix_sigmas
from recon.settings import LONGEST_SIDE, SparseSettings
from recon.sfm.database import DATABASE
from render.capture import Capture, load_image

_LEAST_SIGMA = 0.01  # [m] a deviation of 0 would give the prior infinite weight
_MOST_SIGMA = 1e4  # [m] for a height that was not measured


def extract(capture: Capture, folder: Path, settings: SparseSettings, progress: Progress) -> dict[str, Any]:
    """Decode every image once, then find its keypoints; images that are already in the database do not change.

    Images enter the database in sorted order before the extraction: its threads would number them in the order in which
    they finish.

    Args:
        capture: Photographs.
        folder: Receives the database; may hold one of an interrupted run.
        settings: Features.
        progress: Listener.

    Returns:
        `keypoints`: their number for each image, in the order of the capture.

    Raises:
        InputError: An image is damaged; names the file.
    """
    progress.stage("check images", len(capture.images))
    for row in range(len(capture.images)):
        load_image(capture, row)
        progress.advance(row + 1)
    progress.stage("features", len(capture.images))
    names = sorted(image.file for image in capture.images)
    reader = _reader(capture)
    options = pycolmap.FeatureExtractionOptions(num_threads=settings.threads, max_image_size=LONGEST_SIDE)
    options.sift.peak_threshold = settings.peak_threshold
    options.sift.max_num_features = settings.max_features
    path, single = folder / DATABASE, pycolmap.CameraMode.SINGLE
    pycolmap.Database.open(path).close()
    pycolmap.import_images(path, capture.folder, single, names, reader)
    pycolmap.extract_features(path, capture.folder, names, single, reader, options, pycolmap.Device.cpu)
    with pycolmap.Database.open(path) as database:
        rows = {image.name: image for image in database.read_all_images()}
        _write_gps(capture, database, rows)
        return {
            "keypoints": [
                database.num_keypoints_for_image(rows[image.file].image_id) if image.file in rows else 0
                for image in capture.images
            ]
        }


def _reader(capture: Capture) -> pycolmap.ImageReaderOptions:
    """Set the calibration; if the focal length is a guess, mark it as such for COLMAP."""
    prior = capture.prior
    if capture.facts.get("focal") == FOCAL_GUESSED:
        return pycolmap.ImageReaderOptions(camera_model=prior.model)
    return pycolmap.ImageReaderOptions(
        camera_model=prior.model, camera_params=f"{prior.focal_px!r},{prior.cx!r},{prior.cy!r},0"
    )


def _write_gps(capture: Capture, database: pycolmap.Database, rows: dict[str, pycolmap.Image]) -> None:
    """Replace the positions read from EXIF by those of the capture, in its local frame."""
    database.clear_pose_priors()
    sigmas = np.clip(fix_sigmas(capture), _LEAST_SIGMA, _MOST_SIGMA)
    for image, sigma in sorted(zip(capture.images, sigmas, strict=True), key=lambda pair: pair[0].file):
        if image.gps is not None and image.file in rows:
            database.write_pose_prior(
                pycolmap.PosePrior(
                    position=np.array(image.gps),
                    position_covariance=np.diag(sigma**2),
                    coordinate_system=pycolmap.PosePriorCoordinateSystem.CARTESIAN,
                    corr_data_id=rows[image.file].data_id,
                )
            )
