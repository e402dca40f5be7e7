"""The conductor: the steps from a capture to an annotated cloud, in the order of the paper's figure."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.files import write_json
from groundwork.progress import Progress
from recon.cloud import Cloud, write_cloud
from recon.dense.dense import run_dense
from recon.formats.export import write_ply
from recon.formats.laz import check_las_classes, write_laz
from recon.photos.photos import open_photographs
from recon.placing.align import OK, Alignment, Target
from recon.placing.ground_control import GroundControl
from recon.placing.place import (
    Registered,
    alignment_facts,
    camera_rows,
    place,
    place_on_control,
    read_control,
    similarity_facts,
)
from recon.points.duplicates import merge_duplicates
from recon.points.fates import KEPT
from recon.points.observations import Observations
from recon.points.placed_points import PlacedPoints, place_dense, place_sparse
from recon.settings import AGREEMENT, ReconSettings
from recon.sfm.colmap_model import SparseModel
from recon.sfm.sparse import Sparse, run_sparse, write_world_model
from recon.sfm.stored_model import MODEL, read_stored_model, write_stored_model
from recon.steps import enter_work, leave_work
from recon.truth.annotate import Annotation, ObservedTruth, annotate, gather
from recon.truth.bridge_digest import bridge_digest
from recon.truth.component_kinds import component_kinds, kind_rows
from recon.truth.noise_figures import describe_noise
from recon.truth.per_class import describe_classes, lost_classes, scarce_classes_in_words
from recon.truth.pixel_classes import describe_pixels
from recon.truth.statistics import describe, verdict_in_words
from recon.truth.surface_distance import nearest_surface, without_moving
from recon.truth.uncertainty import Uncertainty, depths, measure
from recon.truth.windows import lay_windows
from render.capture import Capture, Truth, read_truth
from usd_schemas.components import UNLABELED, class_rows


def reconstruct(
    capture: Path,
    folder: Path,
    settings: ReconSettings,
    progress: Progress,
    control: Path | None = None,
    model: Path | None = None,
) -> None:
    """Reconstruct a capture, align it to the world, label every point and measure its errors.

    With `mode = "both"`, structure from motion runs once, and the clouds are in `cloud/sparse` and `cloud/dense`.

    Args:
        capture: Folder of photographs, with or without truth.
        folder: Existing folder for the cloud: empty, or left by an interrupted run. It gains the model, too.
        settings: What to do.
        progress: Listener.
        control: File of ground control points and scale bars that the photographs show, or None.
        model: Folder that holds a model of these photographs, used without change; None makes one.

    Raises:
        InputError: The capture is damaged, the ground control or the model does not fit it, or LAS cannot hold a class
            id of its truth.
        RejectedSceneError: The images do not suffice for a cloud; its reason says why.
    """
    photographs = _open(capture)
    surveyed = None if control is None else read_control(control, photographs, progress)
    work = enter_work(folder)
    sparse = read_stored_model(model, photographs) if model else run_sparse(photographs, work, settings, progress)
    for mode in settings.modes:
        place = folder / "cloud" / mode if len(settings.modes) > 1 else folder
        place.mkdir(parents=True, exist_ok=True)
        one = settings.model_copy(update={"mode": mode})
        _make_cloud(photographs, sparse, surveyed, _Workplace(place, work), one, progress)
    (folder / MODEL).mkdir()
    write_stored_model(folder / MODEL, sparse, photographs)
    leave_work(work)


def reconstruct_model(capture: Path, folder: Path, settings: ReconSettings, progress: Progress) -> None:
    """Run structure from motion for a capture: the part of a reconstruction that all its clouds share.

    Args:
        capture: Folder of photographs; its truth, if any, is not used.
        folder: Existing folder for the model: empty, or left by an interrupted run.
        settings: What to do.
        progress: Listener.

    Raises:
        InputError: The capture is damaged.
        RejectedSceneError: The images do not suffice for a model; its reason says why.
    """
    photographs = open_photographs(capture)
    work = enter_work(folder)
    write_stored_model(folder, run_sparse(photographs, work, settings, progress), photographs)
    leave_work(work)


def reconstruct_cloud(
    capture: Path, model: Path, folder: Path, settings: ReconSettings, progress: Progress, control: Path | None = None
) -> None:
    """Make one cloud from an existing model.

    Args:
        capture: Folder of photographs, with or without truth.
        model: Folder of their model.
        folder: Existing folder for the cloud: empty, or left by an interrupted run.
        settings: What to do; one mode.
        progress: Listener.
        control: File of ground control points and scale bars that the photographs show, or None.

    Raises:
        InputError: The capture or the model is damaged, the ground control does not fit, or LAS cannot hold a class id
            of the truth.
        RejectedSceneError: The model does not suffice for a cloud; its reason says why.
    """
    photographs = _open(capture)
    surveyed = None if control is None else read_control(control, photographs, progress)
    work = enter_work(folder)
    sparse = read_stored_model(model, photographs)
    _make_cloud(photographs, sparse, surveyed, _Workplace(folder, work), settings, progress)
    leave_work(work)


def _open(capture: Path) -> Capture:
    """Open photographs, and refuse, before the work, class ids that `cloud.laz` could not hold."""
    photographs = open_photographs(capture)
    truth = read_truth(photographs)
    if truth is not None:
        check_las_classes([row.id for row in truth.classes])
    return photographs


@dataclass(frozen=True)
class _Workplace:
    """Folder of the cloud, and folder of intermediate files."""

    folder: Path
    work: Path


def _make_cloud(
    photographs: Capture,
    sparse: Sparse,
    surveyed: GroundControl | None,
    at: _Workplace,
    settings: ReconSettings,
    progress: Progress,
) -> None:
    """Align a model, make a cloud from it, and write it."""
    model, copies = merge_duplicates(sparse.model)
    progress.stage("align", 0)
    truth = read_truth(photographs)
    classes = truth.classes if truth else class_rows()
    rows = _rows_in_capture(model, photographs)
    registered = Registered(model.poses, rows, sparse.reasons)
    alignment, target, facts = _place(model, registered, photographs, truth, settings, surveyed)
    poses = np.full((len(photographs.images), 4, 4), np.nan)
    poses[rows] = alignment.similarity.move_poses(model.poses)
    valid = np.array([code == OK for code in alignment.status])
    figures: dict[str, Any] = {"sparse": sparse.facts}
    if settings.mode == "dense":
        dense, fates, figures["dense"] = run_dense(photographs, sparse, at.work, settings, progress)
        figures["pixels"] = describe_pixels(fates, rows, valid, truth, classes)
        found, copies = len(dense.counts), np.ones(len(dense.counts), np.int64)
        placed = place_dense(dense, rows, valid, alignment.similarity, AGREEMENT[settings.filter][0])
        del dense  # freed here: as large as the arrays that follow
    else:
        found = len(model.points)
        metric = target.kind != "none"
        placed = place_sparse(model, rows, valid, alignment.similarity, settings, metric=metric)
    progress.stage("annotate", 0)
    columns = _own_columns(placed)
    depth = depths(placed.coord, poses, placed.seen)
    observed, components = _label(columns, placed.coord, depth, placed.seen, truth, settings.dense.threads)
    figures |= _count_classes(columns["segment"], placed, copies, truth)
    kept = placed.fate == KEPT
    columns, observed, depth = _those(kept, columns, observed, depth)
    figures["noise"] = describe_noise(columns, np.minimum.reduceat(depth, observed["start"][:-1]))
    cloud = Cloud(
        columns,
        observed,
        components,
        classes,
        facts,
        camera_rows(photographs, alignment),
        {**describe(columns, alignment, model, classes), **figures},
        f"sfm-{settings.mode}",
        bridge_digest(*truth.surface(), truth.instances) if truth else "",
    )
    _write_files(at.folder, cloud)
    _write_poses(at.folder / "cameras_sfm.json", photographs, model, poses)
    world = similarity_facts(alignment.similarity)
    write_world_model(sparse.folder, at.folder / "sparse", world, settings, progress)
    progress.note(verdict_in_words(alignment.status, int(kept.sum()), found, facts["note"], lost_classes(figures)))
    if few := scarce_classes_in_words([figures]):
        progress.note(few)


def _write_files(folder: Path, cloud: Cloud) -> None:
    write_cloud(folder, cloud)
    write_laz(folder / "cloud.laz", cloud)
    write_ply(folder / "cloud.ply", cloud)


def _place(
    model: SparseModel,
    registered: Registered,
    photographs: Capture,
    truth: Truth | None,
    settings: ReconSettings,
    surveyed: GroundControl | None,
) -> tuple[Alignment, Target, dict[str, Any]]:
    """Align the model to ground control if there is any, else to the known cameras; describe it as JSON."""
    rng = np.random.default_rng(settings.seed)
    if surveyed is not None:
        alignment, target, residuals = place_on_control(model, registered, photographs, surveyed, rng)
        return alignment, target, alignment_facts(alignment, target, photographs, residuals)
    alignment, target = place(registered, photographs, truth, settings.alignment, rng)
    return alignment, target, alignment_facts(alignment, target, photographs)


def _rows_in_capture(model: SparseModel, capture: Capture) -> NDArray[np.int64]:
    row_of = {image.file: row for row, image in enumerate(capture.images)}
    return np.array([row_of[name] for name in model.names], np.int64)


def _own_columns(placed: PlacedPoints) -> dict[str, NDArray[Any]]:
    """Fill the columns that need no truth."""
    return {
        "coord": placed.coord,
        "color": placed.color,
        "normal": placed.normal,
        "reprojection_error": placed.reprojection_error,
        "n_views": placed.seen.counts.astype(np.uint16),
    }


def _label(
    columns: dict[str, NDArray[Any]],
    points: NDArray[np.float64],
    depth: NDArray[np.float64],
    seen: Observations,
    truth: Truth | None,
    threads: int,
) -> tuple[dict[str, NDArray[Any]], tuple[str, ...]]:
    """Fill the columns that need the truth; without it, with the values for unknown."""
    count, total = len(points), len(seen.image)
    components = component_kinds(truth.instances if truth else ())
    if truth is None:
        nothing, unknown = np.full(count, np.nan), np.full(count, UNLABELED, np.uint8)
        nan32 = nothing.astype(np.float32)
        error = np.full(total, np.nan)
        observed = ObservedTruth(np.full(total, UNLABELED, np.uint8), np.zeros(total, np.uint32), error, error)
        verdict = Annotation(unknown, np.zeros(count, np.uint32), nan32, nan32)
        measured = Uncertainty(nothing, nothing, nothing, nothing, nothing)
        distance, nearest, component = nothing, unknown, np.zeros(count, np.uint16)
    else:
        observed = gather(truth, seen, threads)
        error, measured = measure(points, depth, observed.depth.astype(float), truth, seen, threads)
        verdict = annotate(observed, error, seen)
        distance, nearest = without_moving(verdict.instance, truth, *nearest_surface(points, truth))
        component = kind_rows(verdict.instance, truth.instances)
    columns |= {
        "segment": verdict.label,
        "instance": verdict.instance,
        "component": component,
        "confidence": verdict.confidence,
        "label_margin_px": verdict.margin,
        "surface_class": nearest,
    }
    columns |= {
        name: values.astype(np.float32)
        for name, values in {
            "uncertainty": measured.median,
            "uncertainty_min": measured.least,
            "uncertainty_max": measured.greatest,
            "uncertainty_relative": measured.relative,
            "displacement": measured.displacement,
            "surface_distance": distance,
        }.items()
    }
    return {
        "start": seen.start,
        "image": seen.image.astype(np.uint32),
        "uv": seen.uv,
        "label": observed.label,
        "instance": observed.instance,
        "depth_error": error.astype(np.float32),
    }, components


def _count_classes(
    segment: NDArray[np.uint8], placed: PlacedPoints, copies: NDArray[np.int64], truth: Truth | None
) -> dict[str, Any]:
    """Count per class the points kept, those removed with the reason, and those kept along the bridge."""
    windows = None
    if truth is not None:
        corners, _, classes = truth.surface()
        windows = lay_windows(corners, classes)
    table = truth.classes if truth else class_rows()
    return describe_classes(segment, placed.fate, copies[placed.judged], placed.coord, table, windows)


def _those(
    kept: NDArray[np.bool_],
    columns: dict[str, NDArray[Any]],
    observed: dict[str, NDArray[Any]],
    depth: NDArray[np.float64],
) -> tuple[dict[str, NDArray[Any]], dict[str, NDArray[Any]], NDArray[np.float64]]:
    """Remove the points that are not kept from columns, observations and depths."""
    counts = np.diff(observed["start"])
    seen = np.repeat(kept, counts)
    start = np.concatenate([[0], np.cumsum(counts[kept])]).astype(np.int64)
    rows = {name: values[seen] for name, values in observed.items() if name != "start"}
    return {name: values[kept] for name, values in columns.items()}, {"start": start, **rows}, depth[seen]


def _write_poses(path: Path, capture: Capture, model: SparseModel, poses: NDArray[np.float64]) -> None:
    write_json(
        path,
        {
            "camera": {"model": model.camera_model, "params": model.camera_params, "size": capture.size},
            "poses": [
                {"name": image.name, "camera_to_world": pose.tolist()}
                for image, pose in zip(capture.images, poses, strict=True)
                if np.isfinite(pose).all()
            ],
        },
    )
