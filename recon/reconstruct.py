"""The conductor: from a capture to an annotated cloud, step by step as in the paper's figure."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import RejectedSceneError
from groundwork.files import write_json
from groundwork.progress import Progress
from recon.align import OK, Alignment, Target, align, centre_limit, check_share
from recon.annotate import Annotation, ObservedTruth, annotate, gather
from recon.cloud import Cloud, write_cloud
from recon.colmap_model import SparseModel
from recon.export import write_laz, write_ply
from recon.observations import Observations, select_points
from recon.settings import AlignmentSettings, ReconSettings
from recon.sparse import run_sparse, write_world_model
from recon.statistics import describe
from recon.surface_distance import nearest_surface
from recon.uncertainty import Uncertainty, depths, measure
from render.capture import Capture, Truth, read_capture, read_truth
from usd_schemas.components import UNLABELLED, class_rows

_GPS_SIGMAS = 4.0  # a centre may stray this many standard deviations of the GPS


def reconstruct(capture: Path, folder: Path, settings: ReconSettings, progress: Progress) -> None:
    """Reconstruct a capture, carry it into the world, label every point, measure every point.

    Args:
        capture: Folder of photographs, with or without truth.
        folder: Existing empty folder for the cloud.
        settings: What to do.
        progress: Listener.

    Raises:
        InputError: The capture is damaged.
        RejectedSceneError: The images cannot become a cloud; its reason says why.
    """
    photographs = read_capture(capture)
    work = folder / "work"
    work.mkdir()
    model, facts = run_sparse(photographs, work, settings, progress)

    progress.stage("annotate", 0)
    truth = read_truth(photographs)
    rows = _rows_in_capture(model, photographs)
    target = _target(photographs, truth, settings.alignment)
    alignment = align(model.poses, rows, target, settings.alignment, np.random.default_rng(settings.seed))
    check_share(alignment.status, settings.alignment)
    poses = np.full((len(photographs.images), 4, 4), np.nan)
    poses[rows] = alignment.similarity.move_poses(model.poses)
    valid = np.array([code == OK for code in alignment.status])
    kept, seen = select_points(model, rows, valid, settings.max_reprojection_error, settings.min_views)
    if not kept.any():
        raise RejectedSceneError("no_points", "no point was seen well enough by valid cameras")
    points = alignment.similarity.move(model.points[kept])

    columns = _own_columns(points, model, kept, poses, seen)
    observed, components = _label(columns, points, poses, seen, truth)
    cloud = Cloud(
        columns, observed, components, truth.classes if truth else class_rows(),
        _alignment_facts(alignment, target), _camera_rows(photographs, alignment), {},
    )  # fmt: skip
    statistics = {**describe(columns, alignment, model, cloud.classes), "sparse": facts}
    cloud = Cloud(**{**vars(cloud), "statistics": statistics})

    write_cloud(folder, cloud)
    write_laz(folder / "cloud.laz", cloud)
    write_ply(folder / "cloud.ply", cloud)
    _write_poses(folder / "cameras_sfm.json", photographs, model, poses)
    write_world_model(work, folder / "sparse", _similarity_facts(alignment), settings, progress)
    shutil.rmtree(work)


def _rows_in_capture(model: SparseModel, capture: Capture) -> NDArray[np.int64]:
    row_of = {image.file: row for row, image in enumerate(capture.images)}
    return np.array([row_of[name] for name in model.names], np.int64)


def _target(capture: Capture, truth: Truth | None, settings: AlignmentSettings) -> Target:
    kind = capture.facts.get("kind")
    if truth is not None:
        centres = truth.poses[:, :3, 3]
        return Target("truth", centres, truth.poses[:, :3, :3], centre_limit(centres, kind, settings))
    centres = np.array([image.gps or (np.nan,) * 3 for image in capture.images])
    if np.isfinite(centres).all(axis=1).sum() < 3:
        raise RejectedSceneError("no_position", "neither truth nor GPS says where three of the cameras were")
    limit = centre_limit(centres, kind, settings) + _GPS_SIGMAS * float(np.linalg.norm(capture.gps_sigma))
    return Target("gps", centres, None, limit)


def _own_columns(
    points: NDArray[np.float64], model: SparseModel, kept: NDArray[np.bool_], poses: NDArray[np.float64],
    seen: Observations,
) -> dict[str, NDArray[Any]]:  # fmt: skip
    """Fill the columns that need no truth."""
    centres = np.add.reduceat(poses[seen.image, :3, 3], seen.start[:-1]) / seen.counts[:, None]
    normal = centres - points
    return {
        "coord": points,
        "color": model.colors[kept],
        "normal": (normal / np.linalg.norm(normal, axis=1, keepdims=True)).astype(np.float32),
        "reprojection_error": model.errors[kept].astype(np.float32),
        "n_views": seen.counts.astype(np.uint16),
    }


def _label(
    columns: dict[str, NDArray[Any]], points: NDArray[np.float64], poses: NDArray[np.float64], seen: Observations,
    truth: Truth | None,
) -> tuple[dict[str, NDArray[Any]], tuple[str, ...]]:  # fmt: skip
    """Fill the columns that need the truth; without it, with what says that nothing is known."""
    count, total = len(points), len(seen.image)
    components = ("", *sorted({row.component for row in truth.instances} - {""})) if truth else ("",)
    if truth is None:
        nothing, unknown = np.full(count, np.nan), np.full(count, UNLABELLED, np.uint8)
        nan32 = nothing.astype(np.float32)
        error = np.full(total, np.nan)
        observed = ObservedTruth(np.full(total, UNLABELLED, np.uint8), np.zeros(total, np.uint32), error, error)
        verdict = Annotation(unknown, np.zeros(count, np.uint32), nan32, nan32)
        measured = Uncertainty(nothing, nothing, nothing, nothing, nothing)
        distance, nearest, component = nothing, unknown, np.zeros(count, np.uint16)
    else:
        observed = gather(truth, seen)
        depth = depths(points, poses, seen)
        error, measured = measure(points, depth, observed.depth.astype(float), truth, seen)
        verdict = annotate(observed, error, seen)
        distance, nearest = nearest_surface(points, truth)
        component = _components(verdict.instance, truth, components)
    columns |= {
        "segment": verdict.label, "instance": verdict.instance, "component": component,
        "confidence": verdict.confidence, "label_margin_px": verdict.margin, "surface_class": nearest,
    }  # fmt: skip
    columns |= {name: values.astype(np.float32) for name, values in {
        "uncertainty": measured.median, "uncertainty_min": measured.least, "uncertainty_max": measured.greatest,
        "uncertainty_relative": measured.relative, "displacement": measured.displacement, "surface_distance": distance,
    }.items()}  # fmt: skip
    return {
        "start": seen.start, "image": seen.image.astype(np.uint32), "uv": seen.uv, "label": observed.label,
        "instance": observed.instance, "depth_error": error.astype(np.float32),
    }, components  # fmt: skip


def _components(instance: NDArray[np.uint32], truth: Truth, components: tuple[str, ...]) -> NDArray[np.uint16]:
    known = sorted(truth.instances, key=lambda row: row.id)
    ids = np.array([0, *(row.id for row in known)])
    kinds = np.array([0, *(components.index(row.component) for row in known)], np.uint16)
    at = np.minimum(np.searchsorted(ids, instance), len(ids) - 1)
    return np.where(ids[at] == instance, kinds[at], 0).astype(np.uint16)


def _similarity_facts(alignment: Alignment) -> dict[str, Any]:
    similarity = alignment.similarity
    return {
        "scale": similarity.scale,
        "rotation": similarity.rotation.tolist(),
        "translation": similarity.translation.tolist(),
    }


def _alignment_facts(alignment: Alignment, target: Target) -> dict[str, Any]:
    note = "labels and uncertainty from truth" if target.kind == "truth" else "no truth: aligned to GPS, without labels"
    return {
        **_similarity_facts(alignment), "target": target.kind, "method": alignment.method, "note": note,
        "inliers": sum(code == OK for code in alignment.status), "centre_limit": target.centre_limit,
        "singular_values": alignment.singular_values.tolist(),
    }  # fmt: skip


def _camera_rows(capture: Capture, alignment: Alignment) -> tuple[dict[str, Any], ...]:
    def known(value: float) -> float | None:
        return float(value) if np.isfinite(value) else None

    return tuple(
        {"name": image.name, "status": status, "center_error": known(centre), "rotation_error": known(rotation)}
        for image, status, centre, rotation in zip(
            capture.images, alignment.status, alignment.centre_errors, alignment.rotation_errors, strict=True
        )
    )


def _write_poses(path: Path, capture: Capture, model: SparseModel, poses: NDArray[np.float64]) -> None:
    write_json(path, {
        "camera": {"model": model.camera_model, "params": model.camera_params, "size": capture.size},
        "poses": [{"name": image.name, "camera_to_world": pose.tolist()}
                  for image, pose in zip(capture.images, poses, strict=True) if np.isfinite(pose).all()],
    })  # fmt: skip
