"""The stages of structure from motion that run in a child process: `python -m recon.sparse_child`.

COLMAP may abort the whole process (a full disk, a broken file), so each stage is one request to a process of its own.
"""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap

from groundwork.child import answer_parent
from groundwork.progress import Progress
from recon.settings import SparseSettings
from render.capture import Capture, load_image, read_capture

DATABASE = "database.db"
MODEL = "model"
_FATAL = 3  # the level of glog that stays quiet about everything else
_NO_LIMIT = 1e9  # [m] spatial pairing drops pairs that are farther apart than this


def serve(request: dict[str, Any], progress: Progress) -> object:
    """Run one stage.

    Args:
        request: `stage`, `capture`, `work`, `settings`, `seed`; for `transform` also `out` and `similarity`.
        progress: Listener.

    Returns:
        JSON figures of the stage.
    """
    pycolmap.logging.minloglevel = _FATAL
    pycolmap.set_random_seed(request["seed"])
    work = Path(request["work"])
    if request["stage"] == "transform":
        return transform(work, Path(request["out"]), request["similarity"])
    settings = SparseSettings.model_validate(request["settings"])
    capture = read_capture(Path(request["capture"]))
    if request["stage"] == "extract":
        return extract(capture, work, settings, progress)
    if request["stage"] == "match":
        return match(capture, work, settings, request["seed"], progress)
    return map_images(capture, work, settings, request["seed"], progress)


def extract(capture: Capture, work: Path, settings: SparseSettings, progress: Progress) -> object:
    """Decode every image once, then find its keypoints.

    Images enter the database in sorted order before the extraction: its threads would number them as they finish.

    Args:
        capture: Photographs.
        work: Folder of the database.
        settings: Features.
        progress: Listener.

    Returns:
        Number of keypoints of each image, in the order of the capture.

    Raises:
        InputError: An image is damaged; names the file.
    """
    progress.stage("check images", len(capture.images))
    for row in range(len(capture.images)):
        load_image(capture, row)
        progress.advance(row + 1)
    progress.stage("features", len(capture.images))
    names = sorted(image.file for image in capture.images)
    prior = capture.prior
    reader = pycolmap.ImageReaderOptions(
        camera_model=prior.model, camera_params=f"{prior.focal_px!r},{prior.cx!r},{prior.cy!r},0"
    )
    options = pycolmap.FeatureExtractionOptions(num_threads=settings.threads)
    options.sift.peak_threshold = settings.peak_threshold
    options.sift.max_num_features = settings.max_features
    path, single = work / DATABASE, pycolmap.CameraMode.SINGLE
    pycolmap.Database.open(path).close()
    pycolmap.import_images(path, capture.folder, single, names, reader)
    pycolmap.extract_features(path, capture.folder, names, single, reader, options, pycolmap.Device.cpu)
    with pycolmap.Database.open(path) as database:
        rows = {image.name: image for image in database.read_all_images()}
        _write_gps(capture, database, rows)
        return [
            database.num_keypoints_for_image(rows[image.file].image_id) if image.file in rows else 0
            for image in capture.images
        ]


def match(capture: Capture, work: Path, settings: SparseSettings, seed: int, progress: Progress) -> object:
    """Match image pairs and verify them geometrically.

    Args:
        capture: Photographs.
        work: Folder of the database.
        settings: Pairing.
        seed: Seed of the verification.
        progress: Listener.

    Returns:
        Pairing used, number of pairs tried, and of those verified.
    """
    path = work / DATABASE
    # One thread, whatever the machine: with two, about one run in eight loses half the matches of a pair or two
    # (seen in COLMAP 4.2.1). Matching and verification still overlap, so that two cores are nearly busy.
    matching = pycolmap.FeatureMatchingOptions(num_threads=1)
    verification = pycolmap.TwoViewGeometryOptions()
    verification.ransac.random_seed = seed
    kind = choose_pairing(capture, settings)
    begin, device = (path, matching), pycolmap.Device.cpu
    with pycolmap.Database.open(path) as database:
        if kind == "spatial":
            spatial = pycolmap.SpatialPairingOptions(
                ignore_z=False, max_num_neighbors=settings.neighbours, max_distance=_NO_LIMIT, num_threads=1
            )
            pairs = pycolmap.SpatialPairGenerator(spatial, database).all_pairs()
            run = partial(pycolmap.match_spatial, *begin, spatial, verification, device)
        elif kind == "sequential":
            sequential = pycolmap.SequentialPairingOptions(overlap=settings.overlap, num_threads=1)
            pairs = pycolmap.SequentialPairGenerator(sequential, database).all_pairs()
            run = partial(pycolmap.match_sequential, *begin, sequential, verification, device)
        else:
            exhaustive = pycolmap.ExhaustivePairingOptions()
            pairs = pycolmap.ExhaustivePairGenerator(exhaustive, database).all_pairs()
            run = partial(pycolmap.match_exhaustive, *begin, exhaustive, verification, device)
    count = len({frozenset(pair) for pair in pairs})  # spatial pairing names most pairs from both sides
    progress.stage("matching", count)
    run()
    with pycolmap.Database.open(path) as database:
        _, inliers = database.read_two_view_geometry_num_inliers()
        return {"pairing": kind, "pairs": count, "verified": sum(number > 0 for number in inliers)}


def choose_pairing(capture: Capture, settings: SparseSettings) -> str:
    """Settle what `auto` means for a capture.

    Args:
        capture: Photographs.
        settings: Pairing.

    Returns:
        `spatial`, `sequential` or `exhaustive`.
    """
    if settings.pairing != "auto":
        return settings.pairing
    if all(image.gps is not None for image in capture.images):
        return "spatial"
    return "exhaustive" if len(capture.images) <= settings.exhaustive_below else "sequential"


def map_images(capture: Capture, work: Path, settings: SparseSettings, seed: int, progress: Progress) -> object:
    """Run the incremental mapper and keep its largest model.

    Args:
        capture: Photographs.
        work: Folder of the database; receives the model.
        settings: Mapper.
        seed: Seed of every draw.
        progress: Listener.

    Returns:
        Number of images and points of each model, largest first.
    """
    options = pycolmap.IncrementalPipelineOptions(random_seed=seed, min_model_size=3)
    options.num_threads = options.mapper.num_threads = 1 if settings.deterministic else settings.threads
    options.mapper.random_seed = options.triangulation.random_seed = seed
    options.triangulation.ignore_two_view_tracks = not settings.two_view_tracks
    options.triangulation.min_angle = options.mapper.filter_min_tri_angle = settings.min_triangulation_angle
    options.use_prior_position = settings.use_gps_in_mapping
    total, done = len(capture.images), 2
    progress.stage("mapping", total)

    def count_one() -> None:
        nonlocal done
        done += 1
        progress.advance(min(done, total))

    models, final = work / "models", work / MODEL
    for folder in (models, final):
        folder.mkdir()
    found = pycolmap.incremental_mapping(
        work / DATABASE, capture.folder, models, options, next_image_callback=count_one
    )  # fmt: skip
    largest_first = sorted(found.items(), key=lambda row: (-row[1].num_reg_images(), -row[1].num_points3D(), row[0]))
    if largest_first:
        largest_first[0][1].write_binary(final)
    return [{"images": model.num_reg_images(), "points": model.num_points3D()} for _, model in largest_first]


def transform(work: Path, out: Path, similarity: dict[str, Any]) -> object:
    """Write the model in world metres.

    Args:
        work: Folder that holds the model.
        out: Folder to write it to.
        similarity: `scale`, `rotation` 3x3 row-major, `translation` [m].

    Returns:
        Number of points.
    """
    model = pycolmap.Reconstruction(work / MODEL)
    rotation = pycolmap.Rotation3d(np.array(similarity["rotation"]))
    model.transform(pycolmap.Sim3d(similarity["scale"], rotation, np.array(similarity["translation"])))
    out.mkdir()
    model.write_binary(out)
    return model.num_points3D()


def _write_gps(capture: Capture, database: pycolmap.Database, rows: dict[str, pycolmap.Image]) -> None:
    """Replace whatever positions the files' EXIF gave by those of the capture, in its local frame."""
    database.clear_pose_priors()
    sigma = np.maximum(np.array(capture.gps_sigma), 0.01)
    for image in sorted(capture.images, key=lambda image: image.file):
        if image.gps is not None and image.file in rows:
            database.write_pose_prior(
                pycolmap.PosePrior(
                    position=np.array(image.gps), position_covariance=np.diag(sigma**2),
                    coordinate_system=pycolmap.PosePriorCoordinateSystem.CARTESIAN,
                    corr_data_id=rows[image.file].data_id,
                )
            )  # fmt: skip


if __name__ == "__main__":
    answer_parent(serve)
