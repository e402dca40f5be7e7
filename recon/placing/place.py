"""Placing of a model in the world: its target (truth, GPS or none), the alignment to it, and every camera's status."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from groundwork.errors import InputError
from groundwork.progress import Progress
from recon.photos.photos import fix_sigmas
from recon.placing.align import OK, UNREGISTERED, Alignment, Target, align, center_limit, check_share, stand_upright
from recon.placing.align_control import POINTS, align_to_control
from recon.placing.align_gps import align_to_fixes
from recon.placing.ground_control import GroundControl, image_key, read_ground_control
from recon.placing.similarity import Similarity
from recon.settings import AlignmentSettings
from recon.sfm.colmap_model import SparseModel
from render.capture import TRUTH, Capture, Truth

F64 = NDArray[np.float64]

_LEAST_SIGMA = 1e-3  # [m] smallest deviation assumed: bounds the weight of a fix


@dataclass(frozen=True, eq=False)
class Registered:
    """The registered images of a capture.

    Attributes:
        poses: camera_to_world of each [model units], shape (I, 4, 4), float64.
        rows: Their rows in the capture, shape (I,), int64.
        reasons: Why images are not in the model, by file, where it is known.
    """

    poses: F64
    rows: NDArray[np.int64]
    reasons: Mapping[str, str] = field(default_factory=dict)


def place(
    registered: Registered,
    capture: Capture,
    truth: Truth | None,
    settings: AlignmentSettings,
    rng: np.random.Generator,
) -> tuple[Alignment, Target]:
    """Align a model to the world as far as its position is known, and give every camera a status.

    If GPS is absent, or does not determine the frame, the model keeps its own units and is only turned upright.

    Args:
        registered: The images of the model.
        capture: Photographs.
        truth: Its truth, or None.
        settings: Method and limits.
        rng: Source of RANSAC's samples.

    Returns:
        The alignment and its target.

    Raises:
        RejectedSceneError: With truth only: `alignment_failed`, `straight_path` or `too_few_cameras`.
    """
    poses, rows = registered.poses, registered.rows
    target = _target(capture, truth, settings)
    if truth is not None:
        found = align(poses, rows, target, settings, rng)
    else:
        found = align_to_fixes(poses, rows, target, rng) if target.kind == "gps" else stand_upright(poses, rows, target)
        target = replace(target, kind="none") if found.unfixed else target
    found = replace(found, status=_with_reasons(found.status, registered.reasons, capture))
    if truth is not None:  # a data set requires a share of valid cameras; a user's photographs are used as they are
        check_share(found.status, settings)
    return found, target


def place_on_control(
    model: SparseModel,
    registered: Registered,
    capture: Capture,
    control: GroundControl,
    rng: np.random.Generator,
) -> tuple[Alignment, Target, dict[str, Any]]:
    """Align a model to ground control; every registered camera stays valid.

    Args:
        model: Reconstruction.
        registered: Its images.
        capture: Photographs without truth.
        control: Control points and scale bars.
        rng: Source of the initial triples of points.

    Returns:
        The alignment, its target, and JSON facts: residuals of every point and bar.

    Raises:
        InputError: The control points do not suffice, or a mark is wrong.
    """
    target = _target(capture, None, AlignmentSettings())
    found = align_to_control(model, registered.rows, target, capture, control, rng)
    status = _with_reasons(found.alignment.status, registered.reasons, capture)
    return replace(found.alignment, status=status), replace(target, kind=found.kind), found.facts


def read_control(path: Path, capture: Capture, progress: Progress) -> GroundControl:
    """Read ground control for photographs, before anything is computed.

    Args:
        path: File of control points.
        capture: The photographs.
        progress: Listener; it is told what was assumed, and which marks fit no photograph.

    Raises:
        InputError: The file is wrong, names none of the photographs, or these come with their truth.
    """
    control = read_ground_control(path)
    if (capture.folder / TRUTH).is_dir():
        raise InputError("a capture with truth is aligned to its truth", where=capture.folder, hint="Leave --gcp out")
    known = {image_key(image.file) for image in capture.images}
    marked = [mark.image for point in control.points for mark in point.marks]
    strange = sorted({image for image in marked if image_key(image) not in known})
    if all(image in strange for image in marked):
        raise InputError(
            "has no mark in these photographs",
            where=path,
            value=marked[0] if marked else None,
            allowed=f"names like {capture.images[0].file}",
            hint=f"Check that it belongs to {capture.folder}",
        )
    if strange:
        progress.note(f"{path}: {len(strange)} images with marks are not among the photographs, such as {strange[0]}")
    if control.system.assumed:
        name = control.system.name[:60]
        progress.note(f"{path}: coordinates in {name} are taken as meters; a PROJ string with +units=… states others")
    return control


def _with_reasons(status: tuple[str, ...], reasons: Mapping[str, str], capture: Capture) -> tuple[str, ...]:
    return tuple(
        reasons.get(image.file, code) if code == UNREGISTERED else code
        for image, code in zip(capture.images, status, strict=True)
    )


def similarity_facts(similarity: Similarity) -> dict[str, Any]:
    """Describe a similarity as JSON.

    Args:
        similarity: From the model into the world.
    """
    return {
        "scale": similarity.scale,
        "rotation": similarity.rotation.tolist(),
        "translation": similarity.translation.tolist(),
    }


def alignment_facts(
    alignment: Alignment, target: Target, capture: Capture, control: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Describe an alignment as JSON: the similarity, its target, and limits of its errors.

    Args:
        alignment: The alignment.
        target: What it aligned to.
        capture: Photographs.
        control: Residuals of control points and scale bars, and the origin, or None.
    """
    control = {} if control is None else control
    facts = {
        **similarity_facts(alignment.similarity),
        "target": target.kind,
        "method": alignment.method,
        "note": note(alignment, target, control),
        "unit": "m" if target.kind != "none" else "unknown",
        "inliers": sum(code == OK for code in alignment.status),
        "centre_limit": target.center_limit if target.kind == "truth" else None,
        "singular_values": alignment.singular_values.tolist(),
    }
    if alignment.errors is not None:
        facts["expected_error"] = alignment.errors.facts()
    if alignment.unfixed:
        facts["unfixed"] = alignment.unfixed
    if alignment.agreeing is not None:
        facts["fixes"] = int(np.isfinite(alignment.center_errors).sum())
        facts["agreeing_fixes"] = int(alignment.agreeing.sum())
    if "origin" in capture.facts and (target.kind == "gps" or alignment.agreeing is not None):
        facts["origin"] = capture.facts["origin"]
    return {**facts, **control}


def note(alignment: Alignment, target: Target, control: Mapping[str, Any]) -> str:
    """Describe in words what determines the scale of a model, and its possible error.

    Args:
        alignment: The alignment.
        target: What it aligned to.
        control: Residuals of control points and scale bars, if there are any.
    """
    if target.kind == "truth":
        return "labels and uncertainty from truth"
    if control and alignment.errors is not None:
        points = [row["distance"] for row in control.get("control_points", []) if row["agrees"]]
        bars = [row["error"] for row in control.get("scale_bars", [])]
        used = points if target.kind == POINTS else bars
        off = f"{len(used)} {target.kind} ({np.sqrt(np.mean(np.square(used))):.3f} m rms)"
        if target.kind == POINTS and len(points) < len(control["control_points"]):
            off += f", {len(control['control_points']) - len(points)} left out as far off"
        return f"no truth: aligned to {off}, {alignment.errors.in_words()}, without labels"
    if target.kind == "gps" and alignment.errors is not None and alignment.agreeing is not None:
        fixes = int(np.isfinite(alignment.center_errors).sum())
        agreeing = int(alignment.agreeing.sum())
        where = f"{fixes}" if agreeing == fixes else f"{agreeing} of {fixes}"
        return f"no truth: aligned to GPS ({where} fixes), {alignment.errors.in_words()}, without labels"
    why = f"GPS does not fix the frame ({alignment.unfixed})" if alignment.unfixed else "no GPS that fits"
    return f"no truth and {why}: in its own units, upright, without labels"


def camera_rows(capture: Capture, alignment: Alignment) -> tuple[dict[str, Any], ...]:
    """Describe the status of every image as JSON.

    Args:
        capture: Photographs.
        alignment: Its alignment.
    """

    def known(value: float) -> float | None:
        return float(value) if np.isfinite(value) else None

    rows = [
        {"name": image.name, "status": status, "center_error": known(center), "rotation_error": known(rotation)}
        for image, status, center, rotation in zip(
            capture.images, alignment.status, alignment.center_errors, alignment.rotation_errors, strict=True
        )
    ]
    if alignment.agreeing is not None:
        for row, agrees in zip(rows, alignment.agreeing, strict=True):
            row["fix"] = None if row["center_error"] is None else "agrees" if agrees else "strays"
    return tuple(rows)


def _target(capture: Capture, truth: Truth | None, settings: AlignmentSettings) -> Target:
    kind = capture.facts.get("kind")
    if truth is not None:
        centers = truth.poses[:, :3, 3]
        return Target("truth", centers, truth.poses[:, :3, :3], center_limit(centers, kind, settings))
    centers = np.array([image.gps or (np.nan,) * 3 for image in capture.images])
    turns, gimbal = _by_name(capture, "quarter_turns"), _by_name(capture, "gimbal")
    east, north, up = _numbers(capture.facts.get("gps_bias", capture.gps_sigma))
    kind = "gps" if np.isfinite(centers).all(axis=1).any() else "none"
    return Target(
        kind,
        centers,
        None,
        np.inf,
        np.maximum(fix_sigmas(capture), _LEAST_SIGMA),
        (east, north, up),
        gimbal,
        None if turns is None else turns.astype(np.int64),
    )


def _by_name(capture: Capture, fact: str) -> F64 | None:
    """Collect a fact of each photograph from the capture, in their order; NaN for null."""
    told = capture.facts.get(fact)
    if not isinstance(told, dict):
        return None
    return np.array([_numbers(told[image.name]) for image in capture.images], np.float64)


def _numbers(value: object) -> Any:
    return np.array(value, np.float64)
