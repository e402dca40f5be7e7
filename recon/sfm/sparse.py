"""Structure from motion: runs its three steps in child processes, reports progress, and checks each result."""

import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from groundwork.canonical import file_digest, folder_digest
from groundwork.child import run_child
from groundwork.errors import RejectedSceneError
from groundwork.progress import Progress
from recon.settings import LONGEST_SIDE, ReconSettings
from recon.sfm.colmap_model import SparseModel, read_model
from recon.sfm.database import DATABASE, count_rows, empty_journal
from recon.shortage import check_space, plain_shortage
from recon.steps import Step, take_step
from render.capture import Capture

NO_TEXTURE, NO_OVERLAP, NOT_IN_LARGEST = "no_texture", "no_overlap", "not_in_largest_model"
_CHILD = "recon.sfm.sparse_child"
_SECTION = "recon.sparse"
_MODEL = "model"  # the child's name for it; importing it from there would load COLMAP
_VERSION = 6  # increase it whenever the same settings would give another model
_MAPPING_VERSION = 6  # the same, of the mapper alone
_SLACK = 120.0  # [s] in addition to the time per image
_LOOK = 0.5  # [s] how often progress is read from the database
_FEW_KEYPOINTS = 50
_MIN_IMAGES = 3
_BYTES_PER_KEYPOINT = 200  # descriptor, position, matches
_COPIES, _SHARE_IMAGES = 2, 256  # databases of all images; most images in the database of one batch of the matching


@dataclass(frozen=True)
class Sparse:
    """Result of structure from motion.

    Attributes:
        model: The largest model, in its own units.
        folder: The same as a COLMAP model on disk.
        recipe: Hash of everything that it depends on.
        reasons: Reason code of every image that is not in it, by file.
        facts: JSON figures of the steps.
    """

    model: SparseModel
    folder: Path
    recipe: str
    reasons: Mapping[str, str]
    facts: dict[str, Any]


def run_sparse(capture: Capture, work: Path, settings: ReconSettings, progress: Progress) -> Sparse:
    """Reconstruct camera poses and sparse points; never uses the truth.

    Args:
        capture: Photographs.
        work: Existing work folder; steps that are finished there are reused.
        settings: What to do.
        progress: Listener.

    Returns:
        The largest model, its figures, and a reason for each image that is not in it.

    Raises:
        InputError: An image is damaged.
        OutOfSpaceError: The disk is full, or would be.
        ChildError: A step exceeded a limit or crashed.
        RejectedSceneError: `too_few_images`, `no_texture`, `no_overlap` or `no_model`.
    """
    count = len(capture.images)
    if count < _MIN_IMAGES:
        raise RejectedSceneError("too_few_images", f"{count} images: a reconstruction needs at least {_MIN_IMAGES}")
    features = _extract(capture, work, settings, progress)
    keypoints: list[int] = features.result["keypoints"]
    if sum(number >= _FEW_KEYPOINTS for number in keypoints) < _MIN_IMAGES:
        raise RejectedSceneError(
            NO_TEXTURE,
            f"fewer than {_MIN_IMAGES} images show {_FEW_KEYPOINTS} keypoints. Lower [recon.sparse] peak_threshold",
        )
    matches = _match(capture, features, work, settings, progress)
    pairs: int = matches.result["pairs"]
    if matches.result["verified"] == 0:
        raise RejectedSceneError(NO_OVERLAP, f"in none of {pairs} image pairs do both images show the same objects")
    mapped = _map(capture, matches, work, settings, progress)
    if not any(model["points"] for model in mapped.result["models"]):
        raise RejectedSceneError(
            "no_model", "the mapper found no pair of images to start from: the camera only rotated, or hardly moved"
        )
    figures = {
        "keypoints": sum(keypoints),
        "pairing": matches.result["pairing"],
        "pairs": pairs,
        "verified": matches.result["verified"],
        "mapper": mapped.result["mapper"],
        "tie_points": mapped.result["tie_points"],
        "models": mapped.result["models"],
        **{key: mapped.result[key] for key in ("growth", "runaways", "doubtful") if key in mapped.result},
        "model_sha256": folder_digest(mapped.folder / _MODEL),
    }
    reasons = absent_reasons(capture, keypoints, matches.result["overlapping"], mapped.result["elsewhere"])
    return Sparse(read_model(mapped.folder / _MODEL), mapped.folder / _MODEL, mapped.recipe, reasons, figures)


def absent_reasons(
    capture: Capture, keypoints: list[int], overlapping: list[bool], elsewhere: list[str]
) -> dict[str, str]:
    """Give reasons for images that are not in the largest model, if more than the mapper's rejection is known.

    Args:
        capture: Photographs.
        keypoints: Number of keypoints of each.
        overlapping: Whether each is in a verified pair.
        elsewhere: Files of those that are in another model.

    Returns:
        Reason code by file.
    """
    found: dict[str, str] = {}
    others = set(elsewhere)
    for image, number, overlaps in zip(capture.images, keypoints, overlapping, strict=True):
        if image.file in others:
            found[image.file] = NOT_IN_LARGEST
        elif number < _FEW_KEYPOINTS:
            found[image.file] = NO_TEXTURE
        elif not overlaps:
            found[image.file] = NO_OVERLAP
    return found


def write_world_model(
    model: Path, out: Path, similarity: dict[str, Any], settings: ReconSettings, progress: Progress
) -> None:
    """Write the COLMAP model in the frame of the cloud: in meters, unless nothing determines its scale.

    Args:
        model: Folder of the model.
        out: Folder to create.
        similarity: `scale`, `rotation` 3x3 row-major, `translation` [m].
        settings: For the limits.
        progress: Listener.
    """
    request = {"stage": "transform", "before": str(model), "folder": str(out), "seed": 0, "similarity": similarity}
    with plain_shortage(out, _SECTION):
        run_child(_CHILD, request, time_limit=_SLACK, memory_limit=settings.sparse.memory_limit, progress=progress)


def _extract(capture: Capture, work: Path, settings: ReconSettings, progress: Progress) -> Step:
    sparse = settings.sparse
    progress.stage("read images", len(capture.images))
    hashes = [(image.file, file_digest(capture.folder / image.file)) for image in capture.images]
    recipe = [
        _VERSION,
        version("pycolmap"),
        hashes,
        capture.size,
        capture.prior,
        capture.facts.get("focal"),
        [image.gps for image in capture.images],
        capture.facts.get("gps_sigmas", capture.gps_sigma),
        sparse.peak_threshold,
        sparse.max_features,
        settings.seed,
    ]

    def make(folder: Path) -> Any:
        count = len(capture.images)
        images = _COPIES * count + sparse.threads * min(count, _SHARE_IMAGES)
        needed = images * sparse.max_features * _BYTES_PER_KEYPOINT
        check_space(work, needed, "structure from motion of these images")
        with _row_count(folder / DATABASE, "keypoints", progress):
            return _run("extract", capture, folder, folder, settings, progress)

    return take_step(work, "features", recipe, make)


def _match(capture: Capture, features: Step, work: Path, settings: ReconSettings, progress: Progress) -> Step:
    sparse = settings.sparse
    recipe = [
        features.recipe,
        sparse.pairing,
        sparse.neighbours,
        sparse.leaps_from,
        sparse.overlap,
        sparse.exhaustive_below,
    ]

    def make(folder: Path) -> Any:
        found = _run("match", capture, features.folder, folder, settings, progress)
        empty_journal(folder / DATABASE)
        return found

    return take_step(work, "matches", recipe, make)


def _map(capture: Capture, matches: Step, work: Path, settings: ReconSettings, progress: Progress) -> Step:
    sparse = settings.sparse
    recipe = [
        matches.recipe,
        _MAPPING_VERSION,
        sparse.mapper,
        sparse.global_from,
        sparse.two_view_tracks,
        sparse.min_triangulation_angle,
        sparse.use_gps_in_mapping,
        sparse.tie_points,
        sparse.deterministic or sparse.threads,
    ]
    return take_step(
        work, "model", recipe, lambda folder: _run("map", capture, matches.folder, folder, settings, progress)
    )


def _run(stage: str, capture: Capture, before: Path, folder: Path, settings: ReconSettings, progress: Progress) -> Any:
    sparse = settings.sparse
    threads = "1" if stage == "map" and sparse.deterministic else str(sparse.threads)
    request = {
        "stage": stage,
        "capture": str(capture.folder),
        "before": str(before),
        "folder": str(folder),
        "settings": sparse,
        "seed": settings.seed,
    }
    memory = sparse.memory_limit + sparse.memory_per_image * len(capture.images)
    if stage == "extract":  # each thread holds the pyramid of a photograph
        memory += sparse.memory_per_megapixel * sparse.threads * _searched_megapixels(capture.size)
    with plain_shortage(folder, _SECTION, ", or fewer threads" if stage == "extract" else ""):
        return run_child(
            _CHILD,
            request,
            time_limit=_SLACK + sparse.seconds_per_image * len(capture.images),
            memory_limit=memory,
            progress=progress,
            environment={"OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads},
        )


def _searched_megapixels(size: tuple[int, int]) -> float:
    """Count the pixels in which keypoints are sought [1e6]."""
    scale = min(1.0, LONGEST_SIDE / max(size))
    return size[0] * size[1] * scale * scale / 1e6


@contextmanager
def _row_count(database: Path, table: str, progress: Progress) -> Iterator[None]:
    """Report progress as the number of rows of a table while a child fills it; COLMAP's extraction has no callback.

    While we read, the child cannot empty SQLite's journal when it closes the database: `empty_journal` does it
    afterwards.
    """
    finished = threading.Event()

    def watch() -> None:
        last = 0
        while not finished.wait(_LOOK):
            now = count_rows(database, table)
            if now > last:
                progress.advance(now)
                last = now

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        finished.set()
        watcher.join()
    empty_journal(database)
