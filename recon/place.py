"""Where a model belongs: its target (truth, GPS, or nothing), the alignment to it, and every camera's reason code."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recon.align import OK, UNREGISTERED, Alignment, Target, align, centre_limit, check_share, stand_upright
from recon.align_gps import align_to_fixes
from recon.settings import AlignmentSettings
from recon.similarity import Similarity
from render.capture import Capture, Truth

F64 = NDArray[np.float64]

_LEAST_SIGMA = 1e-3  # [m] no receiver is better, and no weight infinite


def place(
    poses: F64, rows: NDArray[np.int64], reasons: Mapping[str, str], capture: Capture, truth: Truth | None,
    settings: AlignmentSettings, rng: np.random.Generator,
) -> tuple[Alignment, Target]:  # fmt: skip
    """Carry a model to where it belongs, as far as anybody knows, and judge every camera.

    Photographs whose GPS is absent, or does not fix the frame, leave the model in its own units, standing upright.

    Args:
        poses: camera_to_world of the registered images in model units, shape (I, 4, 4), float64.
        rows: Their rows in the capture, shape (I,), int64.
        reasons: Why an image is not in the model, by file, where more is known than that.
        capture: Photographs.
        truth: Its truth, if there is any.
        settings: Method and limits.
        rng: Draws RANSAC's samples.

    Returns:
        The alignment and what it aligned to.

    Raises:
        RejectedSceneError: With truth only: `alignment_failed`, `straight_path` or `too_few_cameras`.
    """
    target = _target(capture, truth, settings)
    if truth is not None:
        found = align(poses, rows, target, settings, rng)
    else:
        found = align_to_fixes(poses, rows, target, rng) if target.kind == "gps" else stand_upright(poses, rows, target)
        target = replace(target, kind="none") if found.unfixed else target
    status = tuple(
        reasons.get(image.file, code) if code == UNREGISTERED else code
        for image, code in zip(capture.images, found.status, strict=True)
    )
    if truth is not None:  # the rule is that of a data set; whoever brings photographs wants what they give
        check_share(status, settings)
    return replace(found, status=status), target


def similarity_facts(similarity: Similarity) -> dict[str, Any]:
    """State a similarity as JSON.

    Args:
        similarity: From the model into the world.
    """
    return {
        "scale": similarity.scale,
        "rotation": similarity.rotation.tolist(),
        "translation": similarity.translation.tolist(),
    }


def alignment_facts(alignment: Alignment, target: Target, capture: Capture) -> dict[str, Any]:
    """State an alignment as JSON: the similarity, what it was found on, and how far that can be relied upon.

    Args:
        alignment: The alignment.
        target: What it aligned to.
        capture: Photographs.
    """
    facts = {
        **similarity_facts(alignment.similarity), "target": target.kind, "method": alignment.method,
        "note": note(alignment, target), "unit": "m" if target.kind != "none" else "unknown",
        "inliers": sum(code == OK for code in alignment.status),
        "centre_limit": target.centre_limit if target.kind == "truth" else None,
        "singular_values": alignment.singular_values.tolist(),
    }  # fmt: skip
    if alignment.errors is not None:
        facts["expected_error"] = alignment.errors.facts()
    if alignment.unfixed:
        facts["unfixed"] = alignment.unfixed
    if alignment.agreeing is not None:
        facts["fixes"] = int(np.isfinite(alignment.centre_errors).sum())
        facts["agreeing_fixes"] = int(alignment.agreeing.sum())
    if "origin" in capture.facts and target.kind == "gps":
        facts["origin"] = capture.facts["origin"]
    return facts


def note(alignment: Alignment, target: Target) -> str:
    """Say in words what the metres of a model rest on, and how far they may be off.

    Args:
        alignment: The alignment.
        target: What it aligned to.
    """
    if target.kind == "truth":
        return "labels and uncertainty from truth"
    if target.kind == "gps" and alignment.errors is not None and alignment.agreeing is not None:
        fixes = int(np.isfinite(alignment.centre_errors).sum())
        agreeing = int(alignment.agreeing.sum())
        where = f"{fixes}" if agreeing == fixes else f"{agreeing} of {fixes}"
        return f"no truth: aligned to GPS ({where} fixes), {alignment.errors.in_words()}, without labels"
    why = f"GPS does not fix the frame ({alignment.unfixed})" if alignment.unfixed else "no GPS that fits"
    return f"no truth and {why}: in its own units, upright, without labels"


def camera_rows(capture: Capture, alignment: Alignment) -> tuple[dict[str, Any], ...]:
    """State the verdict on every image as JSON.

    Args:
        capture: Photographs.
        alignment: Its alignment.
    """

    def known(value: float) -> float | None:
        return float(value) if np.isfinite(value) else None

    rows = [
        {"name": image.name, "status": status, "center_error": known(centre), "rotation_error": known(rotation)}
        for image, status, centre, rotation in zip(
            capture.images, alignment.status, alignment.centre_errors, alignment.rotation_errors, strict=True
        )
    ]
    if alignment.agreeing is not None:
        for row, agrees in zip(rows, alignment.agreeing, strict=True):
            row["fix"] = None if row["center_error"] is None else "agrees" if agrees else "strays"
    return tuple(rows)


def _target(capture: Capture, truth: Truth | None, settings: AlignmentSettings) -> Target:
    kind = capture.facts.get("kind")
    if truth is not None:
        centres = truth.poses[:, :3, 3]
        return Target("truth", centres, truth.poses[:, :3, :3], centre_limit(centres, kind, settings))
    centres = np.array([image.gps or (np.nan,) * 3 for image in capture.images])
    turns, gimbal = _by_name(capture, "quarter_turns"), _by_name(capture, "gimbal")
    sigmas = _by_name(capture, "gps_sigmas")
    if sigmas is None:
        sigmas = np.tile(np.array(capture.gps_sigma), (len(centres), 1))
    east, north, up = _numbers(capture.facts.get("gps_bias", (0.0, 0.0, 0.0)))
    kind = "gps" if np.isfinite(centres).all(axis=1).any() else "none"
    return Target(
        kind, centres, None, np.inf, np.maximum(sigmas, _LEAST_SIGMA), (east, north, up), gimbal,
        None if turns is None else turns.astype(np.int64),
    )  # fmt: skip


def _by_name(capture: Capture, fact: str) -> F64 | None:
    """Take what the capture says of each photograph, in their order; NaN for null."""
    told = capture.facts.get(fact)
    if not isinstance(told, dict):
        return None
    return np.array([_numbers(told[image.name]) for image in capture.images], np.float64)


def _numbers(value: object) -> Any:
    return np.array(value, np.float64)
